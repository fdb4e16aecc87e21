//! A recording that is played: what is shown at which time, and what it came to.

use std::path::Path;
use std::time::Duration;

use nalgebra::{Isometry3, Vector3};
use skein_bp::{Event, Origin};
use skein_dbp::{Happened, NodeName};
use skein_ground::explain::Recorded;
use skein_ground::recorder::Recorder;
use skein_ground::replay::{Digest, Replay};
use skein_wire::event::{Declared as _, Drawn, Erased, MissionOver};
use skein_wire::{Form, Solid, State, Zone};

fn s(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

fn happened(at_s: f64, event: Event) -> Happened {
    Happened {
        home: name("ground/main"),
        event,
        seq: 1,
        term: 0,
        origin: Origin::Internal,
        requested_by: Vec::new(),
        choice: None,
        at: s(at_s),
    }
}

/// Ten seconds in which `uav/1` flies east at 1 m/s and passes `uav/2`, which hovers 5 m east and 2 m north, armed from
/// 1 s on; `uav/3` stands on the ground beside its way.
fn record(path: &Path) {
    let mut recorder = Recorder::create(path).unwrap();
    let ground = name("ground/main");
    let tree = Solid {
        form: Form::Cylinder { radius: 0.5, height: 8.0 },
        pose: Isometry3::translation(9.0, 9.0, 4.0),
    };
    let wall = Solid { form: Form::Box(Vector3::new(1.0, 2.0, 3.0)), pose: Isometry3::identity() };
    recorder.scene(s(0.0), &[tree, wall]).unwrap();
    let zone: Zone = r#"{"name":"pond","kind":"no_fly","centre_m":[0,9],"radius_m":2}"#.parse().unwrap();
    for tenth in 0..=100 {
        let at_s = f64::from(tenth) / 10.0;
        let places = [[at_s, 0.0, 3.0], [5.0, 2.0, 3.0], [5.0, 0.1, 0.0]];
        for (place, vehicle) in places.iter().zip(["uav/1", "uav/2", "uav/3"]) {
            let armed = vehicle != "uav/3" && at_s >= 1.0;
            let task = format!("{at_s:.1} s");
            let state =
                State { time: s(at_s), position: (*place).into(), armed, task, ..State::new(name(vehicle)) };
            recorder.state(s(at_s), &state).unwrap();
        }
        let poses = places.map(|[x, y, z]| Isometry3::translation(x, y, z));
        recorder.poses(s(at_s), &[("uav/1", poses[0]), ("uav/2", poses[1]), ("uav/3", poses[2])]).unwrap();
        if tenth == 30 {
            let drawn = Drawn { name: "pond".into(), zone: zone.to_json().into(), by: "Anna".into() };
            recorder.trace(&ground, &happened(3.0, drawn.at("ground/main"))).unwrap();
        } else if tenth == 70 {
            let erased = Erased { name: "pond".into(), by: "Anna".into() };
            recorder.trace(&ground, &happened(7.0, erased.at("ground/main"))).unwrap();
        }
    }
    recorder.trace(&ground, &happened(10.0, MissionOver { succeeded: true }.at("ground/main"))).unwrap();
    recorder.finish().unwrap();
}

fn recorded() -> Recorded {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mission.mcap");
    record(&path);
    Recorded::open(&path).unwrap()
}

fn east_m(replay: &Replay) -> f64 {
    replay.moment().states[&name("uav/1")].1.position.x
}

#[test]
fn it_is_played_at_its_speed_and_stops_at_its_end() {
    let mut replay = Replay::new(recorded()).unwrap();
    replay.go_on(s(2.0));
    assert_eq!((replay.at(), east_m(&replay)), (s(0.0), 0.0), "it does not play yet");
    replay.play(true);
    replay.go_on(s(2.0));
    assert!((east_m(&replay) - 2.0).abs() < 0.11, "between two states, by its poses: {}", east_m(&replay));
    replay.set_speed(4.0);
    replay.go_on(s(1.0));
    assert_eq!(replay.at(), s(6.0));
    assert!((east_m(&replay) - 6.0).abs() < 0.11);
    replay.go_on(s(9.0));
    assert_eq!((replay.at(), replay.is_playing()), (s(10.0), false));
    replay.play(true);
    assert_eq!((replay.at(), replay.is_playing()), (s(0.0), true), "from its end it begins anew");
    replay.set_speed(f64::NAN);
    assert_eq!(replay.speed(), 1.0);
}

#[test]
fn whoever_seeks_sees_what_was_so_then_in_both_directions() {
    let mut replay = Replay::new(recorded()).unwrap();
    assert_eq!(replay.moment().solids.len(), 2);
    let zones = |replay: &Replay| replay.moment().zones.keys().cloned().collect::<Vec<_>>();
    for (at_s, drawn, events) in
        [(5.0, vec!["pond"], 1), (8.0, vec![], 2), (1.0, vec![], 0), (4.0, vec!["pond"], 1)]
    {
        let jumps = replay.jumps();
        replay.seek(s(at_s));
        assert!((east_m(&replay) - at_s).abs() < 0.11);
        assert_eq!(zones(&replay), drawn, "at {at_s} s");
        assert_eq!(replay.take_happened().len(), events, "at {at_s} s");
        assert_eq!(replay.jumps(), jumps + 1);
    }
    replay.seek(s(1e9));
    assert_eq!(replay.at(), s(10.0));
}

#[test]
fn a_digest_tells_who_was_nearest_in_the_air_when_and_how_near() {
    let digest = Digest::of(&recorded()).unwrap();
    assert_eq!((digest.complete, digest.succeeded, digest.events), (true, Some(true), 3));
    assert_eq!(digest.vehicles, ["uav/1", "uav/2", "uav/3"]);
    let [near] = &digest.nearest[..] else { panic!("{:?}", digest.nearest) };
    assert_eq!((near.one.as_str(), near.other.as_str()), ("uav/1", "uav/2"));
    assert!((near.distance_m - 2.0).abs() < 0.01 && (near.at_s - 5.0).abs() < 0.11, "{near:?}");
    assert_eq!(digest.nearest_in_words(), ["uav/1 and uav/2 were 2.00 m apart at 5.0 s"]);
}

#[test]
fn one_that_was_cut_short_is_played_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mission.mcap");
    record(&path);
    let whole = std::fs::read(&path).unwrap();
    // What comes last are schemas and an index.
    let parts = (1..100).map(|percent| Recorded::read(&whole[..whole.len() * percent / 100], &path));
    let mut began = parts.filter_map(Result::ok).filter_map(|cut| Some((Digest::of(&cut)?, cut)));
    let (digest, cut) = began.find(|(digest, _)| digest.to_s >= 3.0).unwrap();
    assert!(!digest.complete && digest.to_s < 10.0, "{digest:?}");
    let mut replay = Replay::new(cut).unwrap();
    replay.seek(s(10.0));
    assert!((replay.at().as_secs_f64() - digest.to_s).abs() < 1e-6 && !replay.is_complete());
}

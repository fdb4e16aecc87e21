//! A mission that is held is explained by who holds it, live and from its recording.

use std::time::Duration;

use skein_ground::explain::{Explanation, Recorded, explain};
use skein_sim::fly::Recording;
use skein_tests::Lockstep;
use skein_wire::event::What;
use skein_wire::{Order, Who};

fn seconds(seconds: u64) -> Duration {
    Duration::from_secs(seconds)
}

/// Flies on to `end`, recorded.
fn fly(lockstep: &mut Lockstep, recording: &mut Recording, end: Duration) {
    while lockstep.swarm.now() < end {
        let happenings = lockstep.step();
        recording.take_in(&lockstep.swarm, &happenings).unwrap();
    }
}

/// What keeps a vehicle, and what would free it, in one text.
fn reasons(explanation: &Explanation) -> String {
    explanation.changes.iter().map(|change| format!("{change}\n")).collect()
}

#[test]
fn a_hold_is_the_reason_live_and_in_the_recording_until_it_is_over() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mission.mcap");
    let mut lockstep = Lockstep::new("open", None, 1);
    let mut recording = Recording::create(&path, &lockstep.scenario).unwrap();
    fly(&mut lockstep, &mut recording, seconds(9));
    lockstep.swarm.order(&Order::new(What::Hold, Who::All)).unwrap();
    fly(&mut lockstep, &mut recording, seconds(21));
    let vehicles = &lockstep.nodes[..4];
    let live: Vec<Explanation> =
        vehicles.iter().map(|vehicle| lockstep.swarm.ground().explain(vehicle).unwrap()).collect();
    lockstep.swarm.order(&Order::new(What::Resume, Who::All)).unwrap();
    fly(&mut lockstep, &mut recording, seconds(25));
    recording.finish().unwrap();

    let recorded = Recorded::open(&path).unwrap();
    assert!(recorded.is_complete());
    let at = |at: Duration, vehicle| explain(&recorded.evidence_at(at), at, vehicle).unwrap();
    for (vehicle, live) in lockstep.nodes[..4].iter().zip(&live) {
        let held = at(moment(live), vehicle);
        let why = reasons(&held);
        let request =
            format!("`{vehicle}/advance` is requested by navigation and blocked by ground/main#hold");
        assert!(why.contains(&request), "{held}");
        assert!(why.contains("the operator orders Resume"), "{held}");
        assert!(why.contains("ground/main is lost for 1.0 s"), "{held}");
        let asked = held.requests.iter().find(|request| request.by == "navigation").unwrap();
        assert!(asked.blocked_by[0].lease_age_s.is_some_and(|age_s| age_s < 0.5), "{held}");
        let since = held.situation.as_ref().and_then(|situation| situation.still_since_s).unwrap();
        assert!((9.0..19.0).contains(&since), "{held}");
        assert_eq!((reasons(live), &live.requests), (why, &held.requests), "{vehicle}");

        for (free_at, since_s) in [(7, 0.0), (25, 21.0)] {
            let free = at(seconds(free_at), vehicle);
            assert!(!reasons(&free).contains("#hold"), "{free}");
            let newest = free.events[0].time_s;
            assert!(newest >= since_s && newest <= free.time_s, "{free}");
        }
    }
    // The first to take off had leave to move at its own b-thread's request.
    let flying = at(seconds(7), &lockstep.nodes[0]);
    assert!(flying.changes.is_empty() && flying.headline().contains("moves"), "{flying}");
    let advance = flying.events.iter().find(|event| event.event == "uav/1/advance").unwrap();
    assert_eq!(advance.requested_by, ["navigation"], "{flying}");
    assert!(advance.choice.as_deref().is_some_and(|choice| choice.starts_with("priority 10")), "{flying}");
}

fn moment(explanation: &Explanation) -> Duration {
    Duration::from_secs_f64(explanation.time_s)
}

//! Recordings, as `explain` reads them.

use std::path::Path;
use std::time::Duration;

use skein_bp::{Event, Origin};
use skein_dbp::Happened;
use skein_ground::explain::{Recorded, explain};
use skein_ground::recorder::Recorder;
use skein_wire::State;

use crate::packets::{board, node};
use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "recordings", allowed: Allowed { bytes: 512 << 10, per_byte: 2000 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let Ok(recorded) = Recorded::read(input, Path::new("fuzzed.mcap")) else { return Reached::Refused };
    let Some((from, to)) = recorded.span() else { return Reached::Refused };
    assert!(from <= to);
    let evidence = recorded.evidence_at(to);
    let vehicles: Vec<_> = evidence.vehicles().cloned().collect();
    for vehicle in &vehicles {
        explain(&evidence, to, vehicle).expect("it is known").to_string();
    }
    Reached::read(!recorded.is_complete() && from > Duration::from_secs(3600))
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("mission.mcap");
    let mut recorder = Recorder::create(&path).expect("a recording");
    let at = Duration::from_millis(500);
    let happened = Happened {
        event: Event::new("uav/2/advance"),
        home: node("uav/2"),
        seq: 1,
        term: 0,
        origin: Origin::Occurred,
        requested_by: vec!["mission".into()],
        choice: None,
        at,
    };
    recorder.state(at, &State { mode: "hold".into(), ..State::new(node("uav/2")) }).expect("it is written");
    recorder.board(at, &board()).expect("it is written");
    recorder.trace(&node("uav/2"), &happened).expect("it is written");
    recorder.finish().expect("it is written");
    let whole = std::fs::read(&path).expect("it was written");
    let cut = whole[..whole.len() * 2 / 3].to_vec();
    vec![("whole.mcap", whole), ("cut.mcap", cut)]
}

//! An autopilot's lines reach the recording, each with its severity.

use std::time::Duration;

use skein_ground::explain::{Recorded, explain};
use skein_sim::fly::Recording;
use skein_tests::Lockstep;
use skein_wire::event::{AutopilotSays, Declared as _, Severity};

#[test]
fn its_lines_are_events_with_their_severity_that_the_recording_explains() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mission.mcap");
    let mut lockstep = Lockstep::new("open", Some(1), 1);
    let mut recording = Recording::create(&path, &lockstep.scenario).unwrap();
    let (mut said, mut armed_at) = (Vec::<AutopilotSays>::new(), None);
    while lockstep.swarm.now() < Duration::from_secs(9) {
        let happenings = lockstep.step();
        let own = happenings.selections.iter().filter(|happened| happened.home.as_str() == "uav/1");
        let new = said.len();
        said.extend(own.filter_map(|happened| AutopilotSays::read(&happened.event)));
        let is_new = said[new..].iter().any(|said| said.text.contains("Armed"));
        armed_at = armed_at.or(is_new.then(|| lockstep.swarm.now()));
        recording.take_in(&lockstep.swarm, &happenings).unwrap();
    }
    let is_said =
        |severity, text: &str| said.iter().any(|said| said.severity == severity && said.text.contains(text));
    assert!(is_said(Severity::Info, "Armed"), "{said:?}");
    assert!(said.len() < 30, "{}", said.len());

    recording.finish().unwrap();
    let recorded = Recorded::open(&path).unwrap();
    let at = armed_at.unwrap() + Duration::from_millis(40);
    let explanation = explain(&recorded.evidence_at(at), at, &lockstep.nodes[0]).unwrap();
    let is_told = explanation.events.iter().any(|event| event.event.contains("autopilot_says"));
    assert!(is_told, "{explanation}");
}

//! The verification of the program that flies: it holds, and each thing that is looked for can fail.

use std::time::Duration;

use serde::Serialize;
use serde_json::{Value, json};
use skein_agent::verify::{Scene, SceneReport, VehicleVerifier, check_script};
use skein_agent::{AgentConfig, AgentError, Envelope, Fence, Planners, bthreads::LinkLossPolicy};
use skein_bp::script::{Assignment, ScriptFile};
use skein_bp::verify::ViolationKind;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_mav::Datum;

/// States of a scene that are looked at here; the command looks at many more.
const MOST: usize = 2_000;

pub fn config() -> AgentConfig {
    AgentConfig {
        fleet: "test".to_owned(),
        node: "uav/1".to_owned(),
        ground: "ground/main".to_owned(),
        roster: ["uav/1", "uav/2", "ground/main"].map(str::to_owned).to_vec(),
        incarnation: 1,
        system_id: 1,
        datum: Datum::from_degrees(47.4, 8.5, 400.0),
        home: [0.0; 3],
        waypoints: vec![[50.0, 0.0, 3.0]],
        errands: Vec::new(),
        rally: Vec::new(),
        arrives_with: Vec::new(),
        takeoff_height_m: 2.0,
        return_altitude_m: 4.0,
        position: Default::default(),
        signing: None,
        sigma_limit_m: 2.0,
        lidar: true,
        fence: Fence { min: [-60.0, -60.0, -1.0], max: [60.0, 60.0, 20.0] },
        epoch: Duration::ZERO,
        airspace: Default::default(),
        envelope: Envelope::default(),
        planners: Planners::default(),
        link_loss: LinkLossPolicy::Return,
        scripts: Vec::new(),
        behaviours: Default::default(),
        lease: Duration::from_secs(1),
        radio_range_m: None,
        authority: skein_wire::standard_authority(),
        kept: skein_dbp::Kept::default(),
        seed: 1,
    }
}

fn vehicle() -> VehicleVerifier {
    VehicleVerifier::new(&config()).unwrap().most_states(MOST)
}

fn with_scripts(scripts: Vec<Assignment>) -> Result<VehicleVerifier, AgentError> {
    VehicleVerifier::new(&AgentConfig { scripts, ..config() }).map(|verifier| verifier.most_states(MOST))
}

fn verify(verifier: &VehicleVerifier, scene: Scene) -> SceneReport {
    verifier.verify(scene, |_| {})
}

fn holds(verifier: &VehicleVerifier, scene: Scene) -> SceneReport {
    let report = verify(verifier, scene);
    assert_eq!(report.report.verdict, None, "{scene}: {}", report.report);
    report
}

#[test]
fn the_program_that_flies_holds_in_every_scene() {
    let verifier = vehicle();
    for scene in verifier.scenes() {
        let SceneReport { report, coverage, .. } = holds(&verifier, scene);
        assert!(report.states == MOST || report.is_complete(), "{scene}: {report}");
        let flies =
            |verb: &str| coverage.happened.iter().any(|event| event.name() == format!("uav/1/{verb}"));
        assert!(flies("takeoff"), "{scene}: nobody takes off");
    }
}

/// Every b-thread that keeps a promise is missed when it is gone, in the scene that is about it.
#[test]
fn what_a_b_thread_is_for_fails_without_it() {
    for (bthread, scene, broken) in [
        ("pilot", Scene::Pilot, "from a pilot's mode change"),
        ("separation", Scene::Energy, "with a neighbour inside the emergency distance"),
        ("obstacle_avoidance", Scene::Flight, "along a path that is known to be blocked"),
        ("right_of_way", Scene::Passage, "before a narrow passage"),
        ("await_place", Scene::Flight, "while another vehicle has the place"),
        ("preflight", Scene::Launch, "no take-off unless the checks pass"),
        ("found_airborne", Scene::Pilot, "found in the air"),
        ("positioning", Scene::Position, "while its position is doubted"),
        ("one_name", Scene::Name, "while another process has its name"),
        ("battery", Scene::Energy, "battery"),
        ("geofence", Scene::Operator, "no waypoint outside the fence"),
        ("operator", Scene::Operator, "order"),
    ] {
        let verifier = vehicle().without_bthread(bthread).most_states(200_000);
        let SceneReport { report, .. } = verify(&verifier, scene);
        let Some(violation) = &report.verdict else { panic!("{bthread}: {report}") };
        assert!(violation.to_string().contains(broken), "{bthread}: {violation}");
        assert!(violation.trace.len() <= 20, "{bthread}: {violation}");
    }
}

/// From an event on, it states a bid for ever.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct From {
    after: EventSet,
    then: Bid,
    is_on: bool,
}

impl From {
    fn on(after: &str, then: Bid) -> Self {
        Self { after: EventSet::named(after), then, is_on: false }
    }
}

impl BThread for From {
    fn bid(&self) -> Option<Bid> {
        Some(if self.is_on { self.then.clone() } else { Bid::new().wait_for(self.after.clone()) })
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {
        self.is_on = true;
    }
}

#[test]
fn whoever_blocks_landing_is_found_with_the_way_there() {
    let broken = From::on("uav/1/battery_low", Bid::new().block(EventSet::named("uav/1/land")));
    let report = verify(&vehicle().with_bthread("broken", broken), Scene::Energy).report;
    let violation = report.verdict.unwrap();
    assert!(violation.to_string().contains("`broken` blocks `uav/1/land`"), "{violation}");
    assert_eq!(violation.violators, ["broken".into()]);
    let names: Vec<&str> = violation.trace.iter().map(Event::kind).collect();
    assert!(names.len() <= 4 && names.last() == Some(&"battery_low"), "{violation}");
}

#[test]
fn a_b_thread_that_never_rests_is_found() {
    let broken = From::on("uav/1/airborne", Bid::new().request("uav/1/script/again"));
    let report = verify(&vehicle().with_bthread("broken", broken), Scene::Launch).report;
    let violation = report.verdict.unwrap();
    assert_eq!(violation.kind, ViolationKind::Unsettled, "{violation}");
    assert_eq!(violation.violators, ["broken".into()]);
}

#[test]
fn a_b_thread_that_keeps_the_vehicle_up_is_found() {
    // Nobody blocks `landed`, and yet the ground is out of reach.
    let broken = From::on("uav/1/takeoff", Bid::new().block(EventSet::named("uav/1/landed")));
    let report = verify(&vehicle().with_bthread("broken", broken), Scene::Launch).report;
    assert!(report.verdict.unwrap().to_string().contains("safety event"));
}

fn script(body: Value) -> Assignment {
    let text = json!({"name": "test", "about": "A test.", "body": body}).to_string();
    Assignment { script: ScriptFile::parse("test.json", &text).unwrap(), with: [].into(), called: None }
}

/// Alone it waits for the vehicle's answer; with the vehicle, which answers at once, it goes round.
#[test]
fn a_script_that_goes_round_with_the_program_is_found() {
    let nags = script(json!([{"repeat": "forever", "do": [
        {"sync": {"request": {"name": "uav/1/order", "data": {"what": "goto"}}}},
        {"sync": {"wait": {"any_data": "uav/1/declined"}}},
    ]}]));
    let report = verify(&with_scripts(vec![nags]).unwrap(), Scene::Scripts).report;
    let violation = report.verdict.unwrap();
    assert_eq!(violation.kind, ViolationKind::Unsettled, "{violation}");
    assert!(violation.violators.contains(&"script/test".into()), "{violation}");
}

/// What lets go of the block is an event of the vehicle that cannot come while the block stands.
#[test]
fn a_script_that_waits_for_what_it_keeps_from_happening_is_found() {
    let waits = script(json!([
        {"sync": {"wait": {"any_data": "uav/1/ready"}}},
        {"sync": {"block": {"any_data": "uav/1/takeoff"}, "wait": {"any_data": "uav/1/airborne"}}},
    ]));
    let report = verify(&with_scripts(vec![waits]).unwrap().most_states(100_000), Scene::Launch).report;
    let violation = report.verdict.unwrap();
    assert!(violation.to_string().contains("`script/test` lets uav/1/takeoff happen"), "{violation}");
}

#[test]
fn the_scripts_that_come_with_the_agent_hold() {
    for (file, text, with) in [
        (
            "patrol.toml",
            include_str!("../scripts/patrol.toml"),
            json!({"route": [[1.0, 1.0, 2.0], [5.0, 1.0, 2.0]]}),
        ),
        (
            "curfew.toml",
            include_str!("../scripts/curfew.toml"),
            json!({"min": [5.0, 5.0, 0.0], "max": [10.0, 10.0, 9.0], "for_s": 60.0}),
        ),
        (
            "alternate.toml",
            include_str!("../scripts/alternate.toml"),
            json!({"other": "uav/2", "min": [5.0, 5.0, 0.0], "max": [10.0, 10.0, 9.0], "goes_first": 1}),
        ),
        ("follow.toml", include_str!("../scripts/follow.toml"), json!({"leader": "uav/2"})),
    ] {
        let script = ScriptFile::parse(file, text).unwrap();
        let assignment = Assignment { script, with: serde_json::from_value(with).unwrap(), called: None };
        check_script(&config(), &assignment, MOST).unwrap();
        holds(&with_scripts(vec![assignment]).unwrap(), Scene::Scripts);
    }
}

#[test]
fn what_the_scenes_have_not_met_is_told() {
    let verifier = vehicle();
    let launch = holds(&verifier, Scene::Launch);
    let not_covered = verifier.not_covered(&[launch]);
    let told = |name: &str| not_covered.never_told.iter().find(|(event, _)| event == name);
    let (_, waiting) = told("uav/1/battery_critical").unwrap();
    assert_eq!(waiting[..], ["battery".into()]);
    assert!(told("uav/1/ready").is_none());
    assert!(!not_covered.left_out.is_empty());
}

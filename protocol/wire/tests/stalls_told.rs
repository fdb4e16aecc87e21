//! A request blocked from afar is stalled, not deadlocked, and everyone can see by whom.

use std::time::Duration;

use crate::swarm::{Always, Blocker, Requester, Swarm, program};
use skein_bp::Bid;
use skein_wire::NetworkConfig;

#[test]
fn a_stall_is_told_with_its_blockers_and_its_end() {
    let mut swarm = Swarm::new(&["uav/1", "uav/2", "ground/main"], NetworkConfig::default(), 1);
    let mut home = program(1);
    home.add("fly", Requester::new("uav/1/advance", 1000, Duration::from_millis(100)));
    swarm.start("uav/1", 1, home);
    for (node, on) in [("ground/main", 3000), ("uav/2", 1000)] {
        let mut program = program(1);
        program.add("hold", Blocker::new("uav/1/advance", Duration::from_millis(on), Duration::from_secs(1)));
        swarm.start(node, 1, program);
    }
    swarm.run(Duration::from_millis(3500));
    let explanation = swarm.node("uav/1").explain("uav/1/advance");
    assert_eq!(explanation.remote.len(), 2, "{explanation}");
    let ground = &explanation.remote[0];
    assert_eq!((ground.node.as_str(), ground.bthread.as_str()), ("ground/main", "hold"));
    assert!(ground.lease_age < Duration::from_millis(400), "{explanation}");
    assert!(explanation.to_string().contains("blocked by ground/main#hold"), "{explanation}");
    assert!(!swarm.node("uav/1").program().is_deadlocked());

    swarm.run(Duration::from_secs(1));
    let told: Vec<(String, Option<String>)> = swarm
        .seen
        .iter()
        .filter(|seen| seen.node.as_str() == "uav/2" && seen.happened.event.name().starts_with("uav/1/"))
        .filter(|seen| seen.happened.event.kind().contains("stalled"))
        .map(|seen| (seen.happened.event.kind().into(), seen.happened.event.text("by").map(Into::into)))
        .collect();
    let stalled = |by: &str| ("stalled".to_owned(), Some(by.to_owned()));
    // uav/2 holds from 1 s to 2 s and again from 3 s, the ground from 1 s to 4 s.
    assert_eq!(told[..3], [stalled("ground/main#hold"), stalled("uav/2#hold"), stalled("uav/2#hold")]);
    assert_eq!(told[3], ("unstalled".to_owned(), None));
    assert_eq!(told.len(), 4);
}

#[test]
fn a_request_without_a_way_and_a_misdirected_event_are_reported() {
    let mut swarm = Swarm::new(&["uav/1", "ground/main"], NetworkConfig::default(), 1);
    let mut ground = program(1);
    ground.add("ask", Always(Bid::new().request("uav/9/takeoff")));
    swarm.start("ground/main", 1, ground);
    swarm.node("ground/main").enqueue("uav/1/takeoff");
    swarm.run(Duration::from_millis(200));
    let unroutable = &swarm.saw("ground/main", "ground/main/unroutable").next().unwrap().happened.event;
    assert_eq!(unroutable.text("event"), Some("uav/9/takeoff"));
    let misdirected = &swarm.saw("ground/main", "ground/main/misdirected").next().unwrap().happened.event;
    assert_eq!(misdirected.text("event"), Some("uav/1/takeoff"));
}

#[test]
fn requests_at_two_homes_at_once_are_an_error_that_names_them() {
    let mut swarm = Swarm::new(&["uav/1", "uav/2", "ground/main"], NetworkConfig::default(), 1);
    let mut ground = program(1);
    ground.add("greedy", Always(Bid::new().request("uav/1/a").request("uav/2/a")));
    let mut node = skein_dbp::Node::new(swarm.config("ground/main", 1), ground);
    let error = node.step(Duration::ZERO).unwrap_err().to_string();
    assert!(error.contains("greedy") && error.contains("uav/1") && error.contains("uav/2"), "{error}");
    assert!(node.step(Duration::from_millis(20)).is_ok(), "reported more than once");
    swarm.run(Duration::ZERO);
}

//! `explain` names who requests, blocks and waits.

use crate::support::{START, plain};
use serde_json::json;
use skein_bp::Bid;

#[test]
fn a_stalled_request_is_explained_by_its_blockers() {
    let mut program = plain([
        ("mission", json!([{"sync": {"request": ["uav/1/takeoff", "uav/1/other"]}}])),
        ("preflight", json!([{"sync": {"block": ["uav/1/takeoff", "uav/1/other"]}}])),
        ("log", json!([{"sync": {"wait": {"named": "uav/*/takeoff"}}}])),
        ("unconcerned", json!([{"sync": {"wait": "uav/1/land", "block": "uav/1/land"}}])),
    ]);
    program.put_proxy("ground#hold", &Bid::new().block("uav/1/**"));
    program.synchronise(START).unwrap();
    let explanation = program.explain("uav/1/takeoff");
    assert_eq!(explanation.requested, [("mission".into(), "uav/1/takeoff".into())]);
    let blockers: Vec<&str> = explanation.blocked.iter().map(|(name, _)| &**name).collect();
    assert_eq!(blockers, ["preflight", "ground#hold"]);
    assert_eq!(explanation.waiting.len(), 1);
    assert!(explanation.selectable.is_empty());
    assert_eq!(
        explanation.to_string(),
        "uav/1/takeoff\n\
         \u{20} requested by mission: uav/1/takeoff\n\
         \u{20} blocked by preflight: (=uav/1/takeoff | =uav/1/other)\n\
         \u{20} blocked by ground#hold: uav/1/**\n\
         \u{20} waited for by log: uav/*/takeoff\n"
    );
}

#[test]
fn what_nobody_requests_is_explained_by_names() {
    let mut program = plain([
        ("waits", json!([{"sync": {"wait": {"name": "uav/1/go", "data": {"x": 1}}}}])),
        ("elsewhere", json!([{"sync": {"wait": "uav/2/go", "block": {"prefix": "uav/2/"}}}])),
    ]);
    program.synchronise(START).unwrap();
    let explanation = program.explain("uav/1/go");
    assert!(explanation.to_string().contains("requested by nobody"));
    assert_eq!(explanation.waiting.len(), 1);
    assert!(explanation.blocked.is_empty());
}

#[test]
fn a_selectable_event_is_said_to_be() {
    let mut program = plain([("asks", json!([{"sync": {"request": ["a"]}}]))]);
    program.enqueue("a");
    program.synchronise(START).unwrap();
    let explanation = program.explain("a");
    assert_eq!((explanation.selectable, explanation.queued), (vec!["a".into()], vec!["a".into()]));
}

//! A plan for the fleet, as browsers and the shell are told it.

use std::collections::BTreeMap;

use serde::Serialize;
use skein_swarm::route::Assessment;
use skein_wire::Route;

use crate::planning::{Alternative, Encounter, FleetPlan, Journey, Method};

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[cfg_attr(test, ts(rename = "PlanView"))]
pub(super) struct PlanView<'a> {
    journeys: Vec<JourneyView<'a>>,
    /// The vehicles that no route was made for, and why.
    left_out: BTreeMap<&'a str, &'a str>,
    /// When all arrive, seconds after they have set out.
    arrival_s: f64,
    cost_m: f64,
    /// The pairs that would come too near: a plan with any is not to be sent.
    encounters: &'a [Encounter],
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct JourneyView<'a> {
    vehicle: &'a str,
    /// The numbers of its targets, from 1.
    targets: Vec<usize>,
    /// The points to send it as its route, metres ENU.
    points: Vec<[f64; 3]>,
    /// The numbers, from 0, of those that it is to reach whatever comes: to be sent with them.
    stops: Vec<usize>,
    by: Method,
    cost: CostView,
    second: Option<SecondView>,
    /// Factor by which it flies slower than at cruise.
    slowed: f64,
}

#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct SecondView {
    by: Method,
    cost: CostView,
    points: Vec<[f64; 3]>,
}

/// A route's cost, and what it is made of before that is weighed.
#[derive(Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(super) struct CostView {
    cost_m: f64,
    length_m: f64,
    /// At cruise.
    time_s: f64,
    height_m: f64,
    repulsion_m: f64,
    /// Share of what is in the battery.
    energy: f64,
    turning: f64,
}

impl<'a> PlanView<'a> {
    pub(super) fn of(plan: &'a FleetPlan) -> Self {
        let left_out = plan.left_out.iter().map(|left| (left.node.as_str(), left.why.as_str()));
        Self {
            journeys: plan.journeys.iter().map(JourneyView::of).collect(),
            left_out: left_out.collect(),
            arrival_s: plan.arrival_s,
            cost_m: plan.cost_m,
            encounters: &plan.encounters,
        }
    }
}

impl<'a> JourneyView<'a> {
    fn of(journey: &'a Journey) -> Self {
        // A journey is no longer than a route may be.
        let route = journey.sent().ok();
        Self {
            vehicle: journey.node.as_str(),
            targets: journey.targets.iter().map(|number| number + 1).collect(),
            points: route.iter().flat_map(|route| route.points()).copied().collect(),
            stops: route.iter().flat_map(Route::targets).map(|(index, _)| index).collect(),
            by: journey.by,
            cost: CostView::of(&journey.assessment),
            second: journey.second.as_ref().map(SecondView::of),
            slowed: journey.slowed,
        }
    }
}

impl SecondView {
    fn of(second: &Alternative) -> Self {
        let points = second.route.iter().skip(1).map(|point| (*point).into()).collect();
        Self { by: second.by, cost: CostView::of(&second.assessment), points }
    }
}

impl CostView {
    fn of(part: &Assessment) -> Self {
        Self {
            cost_m: part.cost_m,
            length_m: part.length_m,
            time_s: part.time_s,
            height_m: part.height_m,
            repulsion_m: part.repulsion_m,
            energy: part.energy,
            turning: part.turning,
        }
    }
}

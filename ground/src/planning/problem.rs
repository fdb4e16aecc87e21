//! The problem that is planned for.

use nalgebra::Vector3;
use skein_dbp::NodeName;
use skein_planning::airspace::{Airspace, KeepOut};
use skein_swarm::route::RouteCost;

use super::theatre::Theatre;

/// A vehicle that is planned for.
#[derive(Clone, Debug, PartialEq)]
pub struct Flyer {
    pub node: NodeName,
    /// Where it is (ENU, metres).
    pub position: Vector3<f64>,
    /// Share of its battery's energy that is left, 0 to 1.
    pub battery: f64,
    /// Where it goes first, in this order (ENU, metres).
    pub stops: Vec<Vector3<f64>>,
}

/// A vehicle that flies on as it is, unless the plan sends it elsewhere, and the points of its way ahead (ENU, metres): only its place if it stays there.
#[derive(Clone, Debug, PartialEq)]
pub struct Other {
    pub node: NodeName,
    pub way: Vec<Vector3<f64>>,
}

/// The fleet as it is, and where it is to go.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetProblem {
    pub theatre: Theatre,
    pub flyers: Vec<Flyer>,
    pub others: Vec<Other>,
    /// The targets (ENU, metres).
    pub targets: Vec<Vector3<f64>>,
    /// One vehicle goes to each target, and whoever has none stays out of the plan; else all go, several to one target
    /// where there are more of them.
    pub one_to_each: bool,
    /// The same seed gives the same plan.
    pub seed: u64,
}

/// So many targets are planned for at once.
pub const MOST_TARGETS: usize = 64;

/// Why there is no plan at all.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    #[error("there is no target: name at least one, such as \"10,20,5\"")]
    NoTarget,
    #[error("there are {0} targets: expected at most {MOST_TARGETS}")]
    TooManyTargets(usize),
    #[error("target {number}, {at}, {why}")]
    Target { number: usize, at: String, why: String },
    #[error("no vehicle can be planned for: {}", reasons(.0))]
    NoVehicle(Vec<LeftOut>),
}

/// A vehicle that no route was made for.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    pub node: NodeName,
    pub why: String,
}

fn reasons(left_out: &[LeftOut]) -> String {
    if left_out.is_empty() {
        return "none is there that flies".to_owned();
    }
    let reasons: Vec<_> = left_out.iter().map(|left| format!("{} {}", left.node, left.why)).collect();
    reasons.join("; ")
}

/// The air that routes lead through: margins and clearance included.
pub(super) struct Open {
    pub(super) airspace: Airspace,
    closed: KeepOut,
}

impl Open {
    pub(super) fn new(theatre: &Theatre) -> Self {
        let margin_m = theatre.craft.margin_m;
        let airspace = theatre.airspace.keeping_off(margin_m);
        Self { airspace, closed: KeepOut::new(theatre.airspace.clone(), margin_m, theatre.craft.clearance_m) }
    }

    /// The targets are no places to fly to.
    pub(super) fn check(&self, targets: &[Vector3<f64>], cost: &RouteCost) -> Result<(), PlanError> {
        match targets.len() {
            0 => return Err(PlanError::NoTarget),
            count if count > MOST_TARGETS => return Err(PlanError::TooManyTargets(count)),
            _ => {}
        }
        let wrong = |(number, target): (usize, &Vector3<f64>)| {
            let why = self.objection(target, cost)?;
            Some(PlanError::Target { number, at: written(target), why })
        };
        (1..).zip(targets).find_map(wrong).map_or(Ok(()), Err)
    }

    /// Why nobody can fly to a place, if so.
    pub(super) fn objection(&self, at: &Vector3<f64>, cost: &RouteCost) -> Option<String> {
        let (lower, upper) = (self.airspace.lower, self.airspace.upper);
        if !at.iter().all(|metres| metres.is_finite()) || self.airspace.nearest_inside(at) != *at {
            return Some(format!(
                "is outside the air that is planned for, {} to {}",
                written(&lower),
                written(&upper)
            ));
        }
        let height_m = self.airspace.clearance_m(at);
        if height_m < cost.least_clearance_m {
            let least_m = cost.least_clearance_m;
            return Some(format!("is {height_m:.1} m above the ground: expected at least {least_m:.1} m"));
        }
        (self.closed.room_m(at) < 0.0).then(|| "is in a zone or a threat, or too near to one".to_owned())
    }

    /// The place from which a route leads on for who is here: as high as it must, and in the box.
    pub(super) fn entry(&self, at: &Vector3<f64>, cost: &RouteCost) -> Vector3<f64> {
        let least_m = self.airspace.terrain_m(at.x, at.y) + cost.least_clearance_m;
        self.airspace.nearest_inside(&Vector3::new(at.x, at.y, at.z.max(least_m)))
    }
}

pub(super) fn written(place: &Vector3<f64>) -> String {
    format!("({:.1}, {:.1}, {:.1})", place.x, place.y, place.z)
}

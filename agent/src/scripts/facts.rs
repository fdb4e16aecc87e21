//! What is told to scripts about places and energy, and to nobody while none listens.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use skein_bp::Event;
use skein_wire::NodeName;
use skein_wire::event::{Ahead, At, BatteryLevel, Declared as _, NeighbourAt};

use super::Scripts;
use crate::{me::Me, neighbours::Neighbour};

/// A place is told again when it has changed by so much, m.
const STEP_M: f64 = 1.0;
/// Energy is told in steps of so many per cent.
const STEP_PERCENT: i64 = 5;

/// What a vehicle knows of itself and of the others at one time.
#[derive(Clone, Copy, Debug)]
pub struct Circumstances<'a> {
    /// Where it is, m.
    pub position: Vector3<f64>,
    /// Where leave to move will have led in a moment, m, if there is a path.
    pub ahead: Option<Vector3<f64>>,
    /// Share of the battery's energy left.
    pub battery: Option<f64>,
    pub neighbours: &'a [Neighbour],
}

/// What was told last.
#[derive(Debug, Default)]
pub struct ScriptFacts {
    at: Option<Vector3<f64>>,
    ahead: Option<Vector3<f64>>,
    percent: Option<i64>,
    /// Where each was, and where this vehicle was then.
    neighbours: BTreeMap<NodeName, (Vector3<f64>, Vector3<f64>)>,
}

impl ScriptFacts {
    /// Says everything anew: somebody has begun to listen.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// The path has changed.
    pub fn forget_path(&mut self) {
        self.ahead = None;
    }

    /// What has changed since it was told last, as far as a script listens.
    pub fn tell(&mut self, me: &Me, scripts: &Scripts, now: &Circumstances<'_>) -> Vec<Event> {
        let mut events = Vec::new();
        if scripts.listen_to(BatteryLevel::NAME)
            && let Some(fraction) = now.battery
        {
            // Rounded up, so that 40 is told at 40 % and not at 44 %.
            let percent = (fraction * 100.0).round() as i64;
            let step = (percent + STEP_PERCENT - 1) / STEP_PERCENT * STEP_PERCENT;
            if self.percent.replace(step) != Some(step) {
                events.push(me.event(BatteryLevel { percent: step }));
            }
        }
        for neighbour in
            now.neighbours.iter().filter(|neighbour| neighbour.armed && neighbour.track.cooperative)
        {
            if !scripts.listen_to(NeighbourAt::NAME) {
                break;
            }
            let place = neighbour.position();
            let told = self.neighbours.get(&neighbour.node);
            if told.is_none_or(|(there, here)| moved(there, &place) || moved(here, &now.position)) {
                self.neighbours.insert(neighbour.node.clone(), (place, now.position));
                let (node, distance_m) = (neighbour.node.as_str().into(), (place - now.position).norm());
                events.push(me.event(NeighbourAt { node, x: place.x, y: place.y, z: place.z, distance_m }));
            }
        }
        if scripts.listen_to(At::NAME) && self.at.is_none_or(|told| moved(&told, &now.position)) {
            self.at = Some(now.position);
            events.push(me.event(At { x: now.position.x, y: now.position.y, z: now.position.z }));
        }
        if let (true, Some(ahead)) = (scripts.listen_to(Ahead::NAME), now.ahead)
            && self.ahead.is_none_or(|told| moved(&told, &ahead))
        {
            self.ahead = Some(ahead);
            events.push(me.event(Ahead { x: ahead.x, y: ahead.y, z: ahead.z }));
        }
        events
    }
}

fn moved(from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
    (to - from).norm() >= STEP_M
}

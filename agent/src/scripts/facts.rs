//! Facts about places and energy, told while a script listens.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use skein_bp::Event;
use skein_wire::NodeName;
use skein_wire::event::{Ahead, Alone, At, BatteryLevel, Declared as _, Nearest, NeighbourAt};

use crate::{me::Me, neighbours::Neighbour};

/// A place is told again when it has changed by so much, m.
const STEP_M: f64 = 1.0;
/// Energy is told in steps of so many per cent.
const STEP_PERCENT: i64 = 5;

/// A vehicle's knowledge of itself and of the others at one time.
#[derive(Clone, Copy, Debug)]
pub struct Circumstances<'a> {
    /// Where it is, m.
    pub position: Vector3<f64>,
    /// Whether this agent flies it.
    pub is_flown: bool,
    /// Where leave to move will have led in a moment, m, if there is a path.
    pub ahead: Option<Vector3<f64>>,
    /// Share of the battery's energy left.
    pub battery: Option<f64>,
    pub neighbours: &'a [Neighbour],
}

/// The facts that were told last.
#[derive(Debug, Default)]
pub struct ScriptFacts {
    at: Option<Vector3<f64>>,
    ahead: Option<Vector3<f64>>,
    percent: Option<i64>,
    /// Where each was, and where this vehicle was then.
    neighbours: BTreeMap<NodeName, (Vector3<f64>, Vector3<f64>)>,
    /// The nearest, and how far away; none if it was told that there is none.
    nearest: Option<Option<(NodeName, f64)>>,
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

    /// The changes since the last call, as far as somebody listens.
    pub fn tell(&mut self, me: &Me, is_heard: impl Fn(&str) -> bool, now: &Circumstances<'_>) -> Vec<Event> {
        let mut events: Vec<Event> =
            if is_heard(Nearest::NAME) { self.tell_nearest(me, now) } else { None }.into_iter().collect();
        if !now.is_flown {
            return events;
        }
        if is_heard(BatteryLevel::NAME)
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
            if !is_heard(NeighbourAt::NAME) {
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
        if is_heard(At::NAME) && self.at.is_none_or(|told| moved(&told, &now.position)) {
            self.at = Some(now.position);
            events.push(me.event(At { x: now.position.x, y: now.position.y, z: now.position.z }));
        }
        if let (true, Some(ahead)) = (is_heard(Ahead::NAME), now.ahead)
            && self.ahead.is_none_or(|told| moved(&told, &ahead))
        {
            self.ahead = Some(ahead);
            events.push(me.event(Ahead { x: ahead.x, y: ahead.y, z: ahead.z }));
        }
        events
    }

    fn tell_nearest(&mut self, me: &Me, now: &Circumstances<'_>) -> Option<Event> {
        let nearest = now
            .neighbours
            .iter()
            .filter(|neighbour| neighbour.armed)
            .map(|neighbour| (&neighbour.node, (neighbour.position() - now.position).norm()))
            .min_by(|(_, a), (_, b)| a.total_cmp(b));
        let told = self.nearest.as_ref();
        let is_new = match (told, nearest) {
            (Some(Some((_, before_m))), Some((_, now_m))) => (now_m - before_m).abs() >= STEP_M,
            (told, nearest) => told.is_none_or(|told| told.is_some() != nearest.is_some()),
        };
        if !is_new {
            return None;
        }
        self.nearest = Some(nearest.map(|(node, distance_m)| (node.clone(), distance_m)));
        Some(match nearest {
            Some((node, distance_m)) => me.event(Nearest { node: node.as_str().into(), distance_m }),
            None => me.event(Alone),
        })
    }
}

fn moved(from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
    (to - from).norm() >= STEP_M
}

//! Scenes: parts of the world that are put together around the whole program and looked at in all their runs.

use std::collections::BTreeSet;

use skein_bp::Event;
use skein_bp::behaviour::WORLD;
use skein_wire::NodeName;
use skein_wire::event::What;

use super::part::Part;
use super::world::{self, Disturbed};
use crate::{config::AgentConfig, me::Me};

skein_bp::words! {
    /// A selection of what may happen around a vehicle. The program is always whole.
    pub enum Scene {
        /// Checks that pass and fail, take-off asked for, refused, held, decided together.
        Launch = "launch",
        /// Paths that are not found or turn out blocked, getting stuck, a neighbour too close, a station that holds.
        Flight = "flight",
        /// A narrow passage, claimed against another vehicle, while nodes are lost and heard again.
        Passage = "passage",
        /// A battery that runs low and empty, and the fence, while a neighbour comes too close.
        Energy = "energy",
        /// A ground station that is lost and heard again, with a low battery.
        Link = "link",
        /// An operator's orders, with a low battery.
        Operator = "operator",
        /// A pilot who takes over and hands back, an agent that slept or started in the air, with battery and orders.
        Pilot = "pilot",
        /// Another process under the vehicle's name, and an operator who holds and resumes.
        Name = "name",
        /// A position that is doubted and trusted again, with a low battery and orders.
        Position = "position",
        /// Events told to scripts only, around an undisturbed flight.
        Scripts = "scripts",
        /// Two people who order, ask for, take and give the vehicle.
        Holder = "holder",
        /// All of it at once, but for who holds the vehicle.
        Everything = "everything",
    }
}

/// The world of one vehicle, from which scenes take their parts.
pub(super) struct World<'a> {
    pub(super) me: &'a Me,
    pub(super) config: &'a AgentConfig,
    /// Another vehicle, if there is one.
    pub(super) other: Option<&'a NodeName>,
    pub(super) ground: Option<&'a NodeName>,
    /// The facts that are told to scripts only.
    pub(super) script_facts: &'a BTreeSet<Event>,
}

impl Scene {
    /// Events that may happen in it, besides an undisturbed flight.
    pub fn about(self) -> &'static str {
        match self {
            Self::Launch => "checks, refused commands, the ground's launch and hold, joint launch and abort",
            Self::Flight => {
                "blocked and missing paths, getting stuck, a neighbour too close, the ground's hold"
            }
            Self::Passage => "a narrow passage, claims against another vehicle, nodes lost and heard again",
            Self::Energy => "low and empty battery, fence, a neighbour too close",
            Self::Link => "ground station lost and heard again, low battery",
            Self::Operator => "orders to hold, resume, land, return and go to a point, low battery",
            Self::Pilot => "pilot, sleep, start in the air, hand-back, orders, battery",
            Self::Name => "another process under this name, orders to hold, resume and return",
            Self::Position => "a position that is doubted and trusted again, orders, low battery",
            Self::Scripts => "what is told to scripts, the ground's hold, low battery",
            Self::Holder => "two people who order, ask for, take, give and release the vehicle",
            Self::Everything => "all of it at once, but for who holds the vehicle",
        }
    }

    /// The parts of the world in this scene, by name, those that stand for other nodes' bids last.
    pub(super) fn parts(self, world: &World<'_>) -> Vec<(String, Part)> {
        let World { me, config, other, ground, script_facts } = *world;
        let legs = world::legs(config.waypoints.len());
        let everything = self == Self::Everything;
        let disturbed = Disturbed {
            refusals: everything || self == Self::Launch,
            pilot: everything || self == Self::Pilot,
        };
        let hard = everything || self == Self::Flight;
        let is_in = |scenes: &[Self]| everything || scenes.contains(&self);
        let mut parts = vec![
            ("flight".to_owned(), world::flight(me, disturbed)),
            ("guidance".to_owned(), world::guidance(me, &legs, hard)),
            ("checks".to_owned(), world::checks(me)),
        ];
        let mut add = |name: &str, part: Part| parts.push((name.to_owned(), part));
        if is_in(&[Self::Flight, Self::Energy]) {
            add("closeness", world::closeness(me, other));
        }
        if is_in(&[Self::Energy, Self::Link, Self::Operator, Self::Pilot, Self::Position, Self::Scripts]) {
            add("battery", world::battery(me));
        }
        if is_in(&[Self::Energy]) {
            add("fence", world::fence(me));
        }
        if is_in(&[Self::Passage]) {
            add("passage", world::passage(me, other));
            add("in the way", world::in_the_way(me));
        }
        if let Some(ground) = ground.filter(|_| is_in(&[Self::Launch, Self::Passage, Self::Link])) {
            add("ground station", world::peer(me, ground));
        }
        if let Some(other) = other.filter(|_| is_in(&[Self::Passage])) {
            add(&format!("vehicle {other}"), world::peer(me, other));
        }
        if let Some(ground) = ground.filter(|_| is_in(&[Self::Launch])) {
            add("joint decisions", world::together(me, ground));
        }
        if is_in(&[Self::Position]) {
            add("position", world::position(me));
        }
        if is_in(&[Self::Name]) {
            add("namesake", world::namesake(me));
        }
        let orders = self.orders();
        if !orders.is_empty() {
            add("operator", world::operator(me, config, orders));
        }
        if self == Self::Holder {
            add("people", world::people(me));
        }
        if is_in(&[Self::Scripts]) && !script_facts.is_empty() {
            add("script facts", world::script_facts(script_facts.iter().cloned()));
        }
        let mut parts: Vec<_> =
            parts.into_iter().map(|(name, part)| (format!("{WORLD}{name}"), part)).collect();
        parts.extend(world::ground_bids(me, config).into_iter().filter(|(name, _)| {
            is_in(&[Self::Launch, Self::Flight, Self::Scripts]) || name != "ground#hold"
        }));
        parts
    }

    fn orders(self) -> &'static [What] {
        use What::{GoTo, HandBack, Hold, Land, Resume, Return};
        match self {
            Self::Operator => &[Hold, Resume, Land, Return, GoTo],
            Self::Pilot => &[HandBack, Resume, Return, Land],
            Self::Name | Self::Position => &[Hold, Resume, Return],
            Self::Everything => &[Hold, Resume, Land, Return, GoTo, HandBack],
            _ => &[],
        }
    }
}

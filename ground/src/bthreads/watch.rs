//! Watches until the mission is over.

use std::collections::BTreeMap;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::{NodeName, first_two_chunks};
use skein_wire::event::{
    self, Airborne, Complete, Declared as _, Failed, Heard, Landed, MissionOver, Situation, of,
    of_every_vehicle,
};

/// The debts of each vehicle: the outcome of its mission and, if it has flown, its landing.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Watch {
    ground: NodeName,
    vehicles: BTreeMap<String, Progress>,
    told: bool,
}

#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize)]
struct Progress {
    flying: bool,
    /// Done, or the reason why not.
    mission: Option<Result<(), String>>,
}

impl Progress {
    /// The vehicle was there, and so far, before this station.
    fn find(&mut self, situation: Situation, task: &str) {
        self.flying = situation == Situation::Flying;
        match situation {
            Situation::Complete => self.mission = Some(Ok(())),
            Situation::Failed => self.mission = Some(Err(task.to_owned())),
            Situation::Grounded | Situation::Flying => {}
        }
    }
}

/// The outcome of a mission.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissionOutcome {
    /// The vehicles that did not do what they were sent for, and why.
    pub failed: BTreeMap<String, String>,
}

impl MissionOutcome {
    /// Whether every vehicle did what it was sent for.
    pub fn succeeded(&self) -> bool {
        self.failed.is_empty()
    }
}

impl Watch {
    /// The name that this b-thread runs under: the core asks it by name.
    pub const NAME: &'static str = "watch";

    /// Watches these vehicles.
    pub fn new(ground: NodeName, vehicles: impl IntoIterator<Item = NodeName>) -> Self {
        let vehicles =
            vehicles.into_iter().map(|vehicle| (vehicle.to_string(), Progress::default())).collect();
        Self { ground, vehicles, told: false }
    }

    /// The outcome of the mission, once every vehicle is on the ground and knows.
    pub fn outcome(&self) -> Option<MissionOutcome> {
        let mut failed = BTreeMap::new();
        for (vehicle, progress) in &self.vehicles {
            match &progress.mission {
                _ if progress.flying => return None,
                None => return None,
                Some(Ok(())) => {}
                Some(Err(reason)) => drop(failed.insert(vehicle.clone(), reason.clone())),
            }
        }
        Some(MissionOutcome { failed })
    }
}

impl BThread for Watch {
    fn bid(&self) -> Option<Bid> {
        Some(match self.outcome() {
            None => {
                let news = of_every_vehicle::<(Airborne, Landed, Complete, Failed)>();
                Bid::new().wait_for(news).wait_for(of::<Heard>(&self.ground))
            }
            Some(outcome) if !self.told => {
                Bid::new().request(MissionOver { succeeded: outcome.succeeded() }.at(&self.ground))
            }
            Some(_) => Bid::new(),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if let Some(heard) = Heard::read(event) {
            if let Some(progress) = self.vehicles.get_mut(heard.vehicle.as_str()) {
                progress.find(heard.situation, &heard.why);
            }
            return;
        }
        let home = first_two_chunks(event.name()).unwrap_or_default();
        let Some(progress) = self.vehicles.get_mut(home) else {
            self.told |= event.kind() == MissionOver::NAME;
            return;
        };
        match event.kind() {
            Airborne::NAME => progress.flying = true,
            Landed::NAME => progress.flying = false,
            Complete::NAME => progress.mission = Some(Ok(())),
            _ => progress.mission = Some(Err(event::why(event).unwrap_or("no reason given").into())),
        }
    }
}

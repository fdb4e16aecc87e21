//! The first half of a launch: what would be launched, and the token that launches it.

use std::time::Duration;

use skein_dbp::NodeName;
use skein_wire::event::What;
use skein_wire::{MissionState, Readiness, State};

use crate::giver::Giver;

/// A launch that is offered is taken up within this time, or not at all.
pub const OFFER_LASTS: Duration = Duration::from_secs(10);
/// So many people may think about a launch at once; the oldest offer gives way.
const MOST_OFFERS: usize = 16;

/// A launch that waits for its token to come back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LaunchOffer {
    pub token: String,
    pub what: What,
    /// The one who has asked for it; nobody else can take it up.
    pub by: Giver,
    /// Those that would take off, in this order.
    pub candidates: Vec<Candidate>,
    until: Duration,
}

/// A vehicle that would take off.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Candidate {
    pub vehicle: NodeName,
    /// Its task, as it tells it.
    pub task: String,
    /// The checks before take-off that do not pass, with what to do.
    pub doubts: Vec<String>,
}

impl Candidate {
    /// The vehicle as one to be launched; none if it flies, or has its mission behind it.
    pub(crate) fn of(
        vehicle: &NodeName,
        state: Option<&State>,
        readiness: Option<&Readiness>,
        alive: bool,
    ) -> Option<Self> {
        let waits = state.is_none_or(|state| !state.armed && state.mission == MissionState::UnderWay);
        let mut doubts = Vec::new();
        if !alive {
            doubts.push("it is not heard: is its agent running, and its network up?".to_owned());
        }
        doubts.extend(readiness.iter().flat_map(|said| said.faults()).map(|check| {
            let words = [&check.name, &check.value, &check.advice].map(|word| word.trim());
            words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(": ")
        }));
        let task = state.map(|state| state.task.clone()).unwrap_or_default();
        waits.then(|| Self { vehicle: vehicle.clone(), task, doubts })
    }
}

/// The launches that are offered now.
#[derive(Debug, Default)]
pub(crate) struct LaunchOffers(Vec<LaunchOffer>);

impl LaunchOffers {
    /// Offers a launch to `by`. Whatever else was offered to the same person is not offered any more.
    pub(crate) fn offer(
        &mut self,
        now: Duration,
        (by, what): (&Giver, What),
        token: String,
        candidates: Vec<Candidate>,
    ) -> LaunchOffer {
        self.0.retain(|offer| offer.by != *by && offer.until >= now);
        if self.0.len() == MOST_OFFERS {
            self.0.remove(0);
        }
        let offer = LaunchOffer { token, what, by: by.clone(), candidates, until: now + OFFER_LASTS };
        self.0.push(offer.clone());
        offer
    }

    /// The offer that `by` takes up; it serves once.
    pub(crate) fn take_up(&mut self, now: Duration, by: &Giver, token: &str) -> Option<LaunchOffer> {
        self.0.retain(|offer| offer.until >= now);
        let index = self.0.iter().position(|offer| offer.by == *by && offer.token == token)?;
        Some(self.0.remove(index))
    }
}

impl LaunchOffer {
    /// Whether the same vehicles would take off.
    pub(crate) fn is_about(&self, candidates: &[Candidate]) -> bool {
        self.candidates.iter().map(|one| &one.vehicle).eq(candidates.iter().map(|one| &one.vehicle))
    }
}

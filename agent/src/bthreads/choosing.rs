//! Choosing: which source of position the vehicle flies by.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{Declared as _, FlyBy, SourceFound, SourceLost};

use crate::config::PositionSource;
use crate::{me::Me, precedence};

/// The name of no source: inertia and flow alone.
const DEAD_RECKONING: &str = "dead_reckoning";

/// Requests `fly_by` of the first source in its order that can be flown by, and of none where none can. A source that
/// somebody else has chosen stays flown until it is lost.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Choosing {
    me: Me,
    /// Each source, the preferred one first, and whether it can be flown by.
    sources: Vec<(&'static str, bool)>,
    flown: String,
    /// Whether somebody else has chosen it.
    is_wished: bool,
    /// Whether a source has been found since the vehicle was switched on: before that it stands where it was put.
    has_begun: bool,
}

impl Choosing {
    /// A vehicle with these sources, which flies by the first until it hears more.
    pub fn new(me: Me, sources: &[PositionSource]) -> Self {
        Self {
            me,
            flown: sources.first().map_or(DEAD_RECKONING, |first| first.name()).to_owned(),
            sources: sources.iter().map(|source| (source.name(), false)).collect(),
            is_wished: false,
            has_begun: false,
        }
    }

    /// The source to fly by.
    fn best(&self) -> &str {
        if self.is_wished || !self.has_begun {
            return &self.flown;
        }
        self.sources.iter().find(|(_, is_found)| *is_found).map_or(DEAD_RECKONING, |(name, _)| name)
    }

    fn mark(&mut self, source: &str, is_found: bool) {
        for (name, known) in &mut self.sources {
            if *name == source {
                *known = is_found;
            }
        }
        self.has_begun |= is_found;
        self.is_wished &= is_found || self.flown != source;
    }
}

impl BThread for Choosing {
    fn bid(&self) -> Option<Bid> {
        let bid =
            Bid::new()
                .priority(precedence::COLLISION)
                .wait_for(self.me.any::<(SourceFound, SourceLost, FlyBy)>());
        let best = self.best();
        Some(if best == self.flown { bid } else { bid.request(self.me.event(FlyBy { source: best.into() })) })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        match self.me.verb(event) {
            Some(SourceFound::NAME) => {
                if let Some(found) = SourceFound::read(event) {
                    self.mark(&found.source, true);
                }
            }
            Some(SourceLost::NAME) => {
                if let Some(lost) = SourceLost::read(event) {
                    self.mark(&lost.source, false);
                }
            }
            Some(FlyBy::NAME) => {
                if let Some(chosen) = FlyBy::read(event) {
                    self.is_wished = *chosen.source != *self.best();
                    self.flown = chosen.source.to_string();
                }
            }
            _ => {}
        }
    }
}

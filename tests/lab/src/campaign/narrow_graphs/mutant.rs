//! Right of way with one of its decisions left out, to see that it is missed.

use serde::Serialize;
use skein_agent::{Me, bthreads::RIGHT_OF_WAY, bthreads::RightOfWay};
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::facts::{Confirmed, Stalled};
use skein_wire::event::{Advance, Declared as _, InTheWay, Right};

use super::decisions::Rule;

/// The decision that is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, clap::ValueEnum)]
pub enum Missing {
    /// Nobody's confirmation is awaited.
    Confirmation,
    /// The stretch is entered, and kept from nobody while it is flown through.
    Hold,
    /// Nobody makes way.
    MakingWay,
    /// A claim is never withdrawn.
    GivingIn,
}

/// The flown rule without that.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Mutant {
    pub me: Me,
    pub flown: RightOfWay,
    pub missing: Option<Missing>,
}

impl Mutant {
    fn confirmed(&self) -> Event {
        self.me.event(Confirmed { bthread: RIGHT_OF_WAY.into(), sync: 1 })
    }

    fn ignores(&self, event: &Event) -> bool {
        match self.missing {
            Some(Missing::MakingWay) => self.me.heard::<InTheWay>(event),
            Some(Missing::GivingIn) => {
                let claims = self.flown.bid().is_some_and(|bid| !bid.requests().is_empty());
                claims && (*event == Event::timeout() || Stalled::read(event).is_some())
            }
            _ => false,
        }
    }
}

impl BThread for Mutant {
    fn bid(&self) -> Option<Bid> {
        let bid = self.flown.bid()?;
        let may_move = !bid.blocks().contains(&self.me.event(Advance::ANYWHERE));
        if self.missing != Some(Missing::Hold) || !may_move {
            return Some(bid);
        }
        let without =
            bid.requests().iter().cloned().fold(Bid::new(), Bid::request).wait_for(bid.waits().clone());
        Some(bid.given_deadline().into_iter().fold(without, Bid::deadline))
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        if self.ignores(event) {
            return;
        }
        self.flown.resume(event, cx);
        let confirmed = self.confirmed();
        let awaits = self.flown.bid().is_some_and(|bid| bid.waits().contains(&confirmed));
        if self.missing == Some(Missing::Confirmation) && awaits {
            self.flown.resume(&confirmed, cx);
        }
    }
}

impl Rule for Mutant {
    fn right(&self) -> Right {
        self.flown.right()
    }
}

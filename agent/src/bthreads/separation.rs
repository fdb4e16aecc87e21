//! Separation: a vehicle with a neighbour inside the emergency distance does not press on.
//!
//! The pipeline's repulsion and safety filter keep the distance; they do not wait for this b-thread.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{Advance, Clear, Homeward, TooClose};

use crate::{me::Me, precedence};

/// Blocks `advance` while a neighbour is too close.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Separation {
    me: Me,
    too_close: bool,
}

impl Separation {
    pub fn new(me: Me) -> Self {
        Self { me, too_close: false }
    }
}

impl BThread for Separation {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().priority(precedence::COLLISION);
        Some(if self.too_close {
            bid.wait_for(self.me.any::<Clear>()).block(self.me.any::<(Advance, Homeward)>())
        } else {
            bid.wait_for(self.me.any::<TooClose>())
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        self.too_close = self.me.heard::<TooClose>(event);
    }
}

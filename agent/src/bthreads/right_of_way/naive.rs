//! The rule that reads well and is wrong: enter a passage in which nobody has been heard to be.
//!
//! Between another's `enter` and the news of it, two that arrive together both find the passage empty. No mission flies it:
//! `experiment right-of-way` does, beside [`RightOfWay`](super::RightOfWay).

use std::collections::BTreeMap;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_wire::event::{Advance, Declared as _, Enter, Homeward, Landed, Leave, Passage, of_every_vehicle};

use super::around;
use crate::{me::Me, precedence};

/// Enters a passage as soon as nobody is heard to be in it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct NaiveRightOfWay {
    me: Me,
    /// Who was heard to enter and not yet to leave: the `enter` of each vehicle.
    inside: BTreeMap<String, Event>,
    /// The passage that lies ahead, as it was announced.
    ahead: Option<Event>,
}

impl NaiveRightOfWay {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, inside: BTreeMap::new(), ahead: None }
    }
}

impl BThread for NaiveRightOfWay {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new()
            .priority(precedence::COLLISION)
            .wait_for(of_every_vehicle::<(Enter, Leave, Landed)>())
            .wait_for(me.any::<Passage>());
        let Some(passage) = &self.ahead else { return Some(bid) };
        let taken = self.inside.values().any(|enter| around(passage).contains(enter));
        let bid = bid.block(me.any::<(Advance, Homeward)>());
        Some(if taken { bid } else { bid.request(super::entering(me, passage)) })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        let mine = event.home() == self.me.name();
        match event.kind() {
            Passage::NAME => self.ahead = Some(event.clone()),
            Enter::NAME if !mine => drop(self.inside.insert(event.home().to_owned(), event.clone())),
            _ if !mine => drop(self.inside.remove(event.home())),
            _ => self.ahead = None,
        }
    }
}

//! An operator's orders to the node itself: a new roster, and lifting a block.

use skein_bp::Event;
use skein_bp::catalogue::Declared as _;

use crate::facts::RosterRefused;
use crate::joint::roster::Roster;
use crate::name::NodeName;
use crate::node::Node;
use crate::rule::{Lift, NewRoster};

/// A term so many after the present one is none: after the last number no roster could be given any more.
const MOST_TERMS_AHEAD: u64 = 1 << 32;

impl Node {
    /// Obeys an event that was selected here, if it is such an order.
    pub(super) fn heed(&mut self, event: &Event) {
        let own = event.name().strip_prefix(self.config.name.as_str());
        match own.and_then(|rest| rest.strip_prefix('/')) {
            Some(NewRoster::NAME) => self.adopt(event),
            Some(Lift::NAME) => {
                if let Some(Lift { node, bthread }) = Lift::read(event) {
                    self.run.change_proxies(self.home.table.lift(&node, &bthread));
                }
            }
            _ => {}
        }
    }

    fn adopt(&mut self, order: &Event) {
        let refused = match Roster::ordered(order) {
            Err(error) => error.to_string(),
            Ok(roster) if roster.term <= self.joint.number() => format!("term {} is over", roster.term),
            Ok(roster) if roster.term - self.joint.number() > MOST_TERMS_AHEAD => {
                format!("term {} is far ahead: the next is {}", roster.term, self.joint.number() + 1)
            }
            Ok(_) if self.joint.is_stuck() => "the disk does not take it: see to its state folder".to_owned(),
            Ok(roster) => match roster.members.iter().find(|member| !self.knows(member)) {
                Some(stranger) => format!("{stranger} is not of this fleet"),
                None => {
                    let former = self.joint.adopt(roster, &self.config);
                    self.channel.speak_up(self.clock.now());
                    self.take_up_roster();
                    if let Some(former) = former {
                        let coordinator = self.joint.roster().map(|roster| &roster.coordinator);
                        self.guest.leave_unknown(&former, coordinator, &mut self.run);
                    }
                    return;
                }
            },
        };
        self.run.fact(RosterRefused { why: refused.into() });
    }

    /// Sets the events that are decided here, and may be bid for here, by the roster.
    pub(super) fn take_up_roster(&mut self) {
        self.home.decide(&self.config.name, self.joint.leads(), &mut self.run.program);
        self.joint.guard(&self.clock, self.config.lease, &mut self.run);
        self.guest.restate();
    }

    fn knows(&self, node: &NodeName) -> bool {
        *node == self.config.name || self.channel.peers.name(node.as_str()).is_some()
    }
}

//! Local-minimum escape: a vehicle that makes no way plans anew around whatever stands there.

use std::collections::BTreeSet;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::facts::{PeerJoined, PeerLost};
use skein_wire::event::{Arrived, Declared as _, Goto, Land, Plan, PlanReason, Stuck};

use crate::{me::Me, precedence};

/// Escapes from one waypoint before the vehicle lands.
pub const ATTEMPTS: u8 = 12;

/// Requests `plan` when the vehicle is stuck; the planner then goes around its neighbours too and pulls less
/// (Wang 2023: re-planning with A* while the attractive gain is reduced).
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Escape {
    me: Me,
    attempts: u8,
    stuck: bool,
    /// The vehicles that are lost: they may be what stands there.
    lost: BTreeSet<String>,
}

impl Escape {
    pub fn new(me: Me) -> Self {
        Self { me, attempts: 0, stuck: false, lost: BTreeSet::new() }
    }

    /// Why there is no escape.
    fn why(&self) -> String {
        let mut why = "stuck: no way past what stands around".to_owned();
        if !self.lost.is_empty() {
            let names: Vec<_> = self.lost.iter().map(String::as_str).collect();
            why.push_str(&format!("; lost: {}", names.join(", ")));
        }
        why
    }

    /// Takes in who is lost and who is heard again; whether the event tells of that.
    fn notes(&mut self, event: &Event) -> bool {
        if let Some(PeerLost { node, .. }) = PeerLost::read(event) {
            if node.as_str().starts_with("uav/") {
                self.lost.insert(node.to_string());
            }
        } else if let Some(PeerJoined { node, .. }) = PeerJoined::read(event) {
            self.lost.remove(node.as_str());
        } else {
            return false;
        }
        true
    }
}

impl BThread for Escape {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().priority(precedence::MISSION);
        let bid = bid.wait_for(me.any::<(Goto, Arrived, Land, PeerJoined, PeerLost)>());
        Some(match (self.stuck, self.attempts) {
            (false, _) => bid.wait_for(me.any::<Stuck>()),
            (true, ATTEMPTS..) => bid.request(me.event(Land { why: self.why().as_str().into() })),
            (true, _) => bid.request(me.event(Plan { why: PlanReason::Stuck })),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        if self.notes(event) {
            return;
        }
        match self.me.verb(event) {
            Some(Stuck::NAME) => self.stuck = true,
            Some(Plan::NAME) => {
                self.stuck = false;
                self.attempts += 1;
            }
            _ => {
                self.stuck = false;
                self.attempts = 0;
            }
        }
    }
}

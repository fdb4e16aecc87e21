//! Together: the swarm's joint launch and joint abort, which the whole roster learns of before anything else is decided.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, EventSet};
use skein_dbp::facts::{IN_STEP, PEER_LOST};
use skein_wire::vocabulary::{
    ABORT, AIRBORNE, HEEDED, LAND, LANDED, LAUNCH, READY, SWARM, TAKEOFF, UNREADY, event, of,
};

use crate::{me::Me, precedence};

/// Keeps `swarm/launch` back while the vehicle is not ready; takes off with it, and lands with `swarm/abort`.
///
/// Decisions that it hears late, after a restart or a time out of reach, are told before `in_step`: of those a launch
/// is not followed any more, and an abort only if nothing came after it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Together {
    me: Me,
    ready: bool,
    flying: bool,
    /// The coordinator, while all decisions so far are known.
    in_step_with: Option<String>,
    /// Whether the last of the decisions heard late was to abort.
    aborted_meanwhile: bool,
    task: Task,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
enum Task {
    Nothing,
    TakeOff,
    /// Say that the abort is heard.
    Answer,
    Land,
}

impl Together {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        let task = Task::Nothing;
        Self { me, ready: false, flying: false, in_step_with: None, aborted_meanwhile: false, task }
    }

    fn decided(&mut self, verb: &str) {
        if self.in_step_with.is_none() {
            self.aborted_meanwhile = verb == ABORT;
        } else if verb == ABORT {
            self.task = Task::Answer;
        } else if !self.flying {
            self.task = Task::TakeOff;
        }
    }
}

impl BThread for Together {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new()
            .wait_for(EventSet::any_of([of(SWARM, LAUNCH), of(SWARM, ABORT)]))
            .wait_for(me.any_of(&[READY, UNREADY, TAKEOFF, AIRBORNE, LAND, LANDED, IN_STEP, PEER_LOST]));
        let bid = if self.ready || self.flying { bid } else { bid.block(event(SWARM, LAUNCH)) };
        Some(match self.task {
            Task::Nothing => bid,
            Task::TakeOff => bid.request(me.event(TAKEOFF)).priority(precedence::MISSION),
            Task::Answer => bid.request(me.event(HEEDED).with("what", ABORT)).priority(precedence::LINK),
            Task::Land => bid.request(me.because(LAND, "called off together")).priority(precedence::LINK),
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        let Some(verb) = self.me.verb(event) else { return self.decided(event.kind()) };
        match verb {
            READY | UNREADY => self.ready = verb == READY,
            TAKEOFF | AIRBORNE => {
                self.flying = true;
                if self.task == Task::TakeOff {
                    self.task = Task::Nothing;
                }
            }
            HEEDED => self.task = if self.flying { Task::Land } else { Task::Nothing },
            LAND => self.task = Task::Nothing,
            LANDED => (self.flying, self.task) = (false, Task::Nothing),
            PEER_LOST if event.text("node") == self.in_step_with.as_deref() => self.in_step_with = None,
            IN_STEP => {
                self.in_step_with = event.text("coordinator").map(str::to_owned);
                if std::mem::take(&mut self.aborted_meanwhile) {
                    self.decided(ABORT);
                }
            }
            _ => {}
        }
    }
}

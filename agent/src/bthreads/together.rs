//! Together: the swarm's joint launch and joint abort, which the whole roster learns of before anything else is
//! decided.

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};
use skein_dbp::NodeName;
use skein_dbp::facts::{InStep, PeerLost};
use skein_wire::event::{
    Abort, Airborne, Declared as _, Heeded, Land, Landed, Launch, Ready, SWARM, Takeoff, Unready, What, of,
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
    in_step_with: Option<NodeName>,
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
    pub fn new(me: Me) -> Self {
        let task = Task::Nothing;
        Self { me, ready: false, flying: false, in_step_with: None, aborted_meanwhile: false, task }
    }

    fn decided(&mut self, verb: &str) {
        if self.in_step_with.is_none() {
            self.aborted_meanwhile = verb == Abort::NAME;
        } else if verb == Abort::NAME {
            self.task = Task::Answer;
        } else if !self.flying {
            self.task = Task::TakeOff;
        }
    }
}

impl BThread for Together {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new().wait_for(of::<(Launch, Abort)>(SWARM)).wait_for(me.any::<(
            Ready,
            Unready,
            Takeoff,
            Airborne,
            Land,
            Landed,
            InStep,
            PeerLost,
        )>());
        let bid = if self.ready || self.flying { bid } else { bid.block(Launch.at(SWARM)) };
        Some(match self.task {
            Task::Nothing => bid,
            Task::TakeOff => bid.request(me.event(Takeoff)).priority(precedence::MISSION),
            Task::Answer => bid.request(me.event(Heeded { what: What::Abort })).priority(precedence::LINK),
            Task::Land => {
                bid.request(me.event(Land { why: "called off together".into() })).priority(precedence::LINK)
            }
        })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        let Some(verb) = self.me.verb(event) else { return self.decided(event.kind()) };
        match verb {
            Ready::NAME | Unready::NAME => self.ready = verb == Ready::NAME,
            Takeoff::NAME | Airborne::NAME => {
                self.flying = true;
                if self.task == Task::TakeOff {
                    self.task = Task::Nothing;
                }
            }
            Heeded::NAME => self.task = if self.flying { Task::Land } else { Task::Nothing },
            Land::NAME => self.task = Task::Nothing,
            Landed::NAME => (self.flying, self.task) = (false, Task::Nothing),
            PeerLost::NAME => {
                let lost = PeerLost::read(event).map(|lost| lost.node);
                self.in_step_with.take_if(|coordinator| lost.as_ref() == Some(coordinator));
            }
            InStep::NAME => {
                self.in_step_with = InStep::read(event).map(|told| told.coordinator);
                if std::mem::take(&mut self.aborted_meanwhile) {
                    self.decided(Abort::NAME);
                }
            }
            _ => {}
        }
    }
}

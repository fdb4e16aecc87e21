//! Commands on their way: each is repeated with a rising confirmation counter until it is acknowledged.

use std::time::Duration;

use mavlink::dialects::common::{COMMAND_LONG_DATA, MavCmd, MavResult};

use crate::command::{Command, CommandResult};
use crate::frame::FrameWriter;
use crate::patience::{Patience, Retry, Turn};

const RETRY: Retry = Retry { every: Duration::from_millis(400), times: 4 };
/// A command "in progress" may take this long.
const PROGRESS: Duration = Duration::from_secs(5);

/// Why a command was sent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Purpose {
    /// The agent asked for it and learns the result.
    Flight(Command),
    /// To have the message with this id sent; repeated by the subscriptions themselves.
    Subscription(u32),
}

/// The commands that wait for their acknowledgement: at most one per number, because the number is all that
/// an acknowledgement repeats.
#[derive(Debug, Clone, Default)]
pub(super) struct Commands {
    pending: Vec<Pending>,
}

#[derive(Debug, Clone)]
struct Pending {
    purpose: Purpose,
    message: COMMAND_LONG_DATA,
    patience: Patience,
    /// Acknowledgements still to come for a command of the same number that this one replaced. They say
    /// nothing about this one. If one of them is lost, a repetition asks again.
    stale_acks: u8,
}

impl Commands {
    /// Sends a command. A newer one replaces an unacknowledged older one of the same number at once (*land*
    /// does not wait for *offboard*); returns the purpose of the one replaced.
    pub(super) fn send(
        &mut self,
        now: Duration,
        purpose: Purpose,
        message: COMMAND_LONG_DATA,
        output: &mut FrameWriter,
    ) -> Option<Purpose> {
        let replaced = self.take(message.command);
        output.write(&message);
        self.pending.push(Pending {
            purpose,
            message,
            patience: RETRY.from(now),
            stale_acks: replaced.as_ref().map_or(0, Pending::acks_to_come),
        });
        replaced.map(|old| old.purpose)
    }

    /// Whether a command of this number waits for its acknowledgement.
    pub(super) fn is_pending(&self, command: MavCmd) -> bool {
        self.pending.iter().any(|pending| pending.message.command == command)
    }

    /// An acknowledgement arrived. Returns what it settles.
    pub(super) fn on_ack(
        &mut self,
        now: Duration,
        command: MavCmd,
        result: MavResult,
    ) -> Option<(Purpose, CommandResult)> {
        let pending = self.pending.iter_mut().find(|pending| pending.message.command == command)?;
        if pending.stale_acks > 0 {
            pending.stale_acks -= 1;
            return None;
        }
        let Some(result) = CommandResult::from_ack(result) else {
            pending.patience.put_off(now + PROGRESS);
            return None;
        };
        self.take(command).map(|settled| (settled.purpose, result))
    }

    /// Repeats what is overdue; returns the purposes of the commands given up.
    pub(super) fn tick(&mut self, now: Duration, output: &mut FrameWriter) -> Vec<Purpose> {
        let given_up = |pending: &mut Pending| match pending.patience.turn(now) {
            Turn::Wait => false,
            Turn::Repeat => {
                pending.message.confirmation += 1;
                pending.stale_acks = 0;
                output.write(&pending.message);
                false
            }
            Turn::GiveUp => true,
        };
        self.pending.extract_if(.., given_up).map(|lost| lost.purpose).collect()
    }

    fn take(&mut self, command: MavCmd) -> Option<Pending> {
        let index = self.pending.iter().position(|pending| pending.message.command == command)?;
        Some(self.pending.remove(index))
    }
}

impl Pending {
    /// Acknowledgements that may come for this command and for those it replaced.
    fn acks_to_come(&self) -> u8 {
        self.stale_acks.saturating_add(self.message.confirmation + 1)
    }
}

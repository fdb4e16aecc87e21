//! Commands on their way: each is repeated with a rising confirmation counter until it is acknowledged.

use std::time::Duration;

use mavlink::dialects::common::{COMMAND_LONG_DATA, MavCmd, MavResult};

use crate::command::{Command, CommandResult};
use crate::frame::FrameWriter;

/// How long an acknowledgement is waited for before the command is repeated.
const RETRY: Duration = Duration::from_millis(400);
/// How often a command is sent in all.
pub(super) const MAX_SENDS: u8 = 5;
/// How long a command "in progress" may take.
const PROGRESS: Duration = Duration::from_secs(5);

/// Why a command was sent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Purpose {
    /// The agent asked for it and learns the result.
    Flight(Command),
    /// To have a message sent; repeated by the subscriptions themselves.
    Subscription,
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
    repeat_at: Duration,
    sends: u8,
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
            repeat_at: now + RETRY,
            sends: 1,
            stale_acks: replaced.as_ref().map_or(0, |old| old.stale_acks.saturating_add(old.sends)),
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
            pending.repeat_at = now + PROGRESS;
            return None;
        };
        self.take(command).map(|settled| (settled.purpose, result))
    }

    /// Repeats what is overdue; returns the purposes of the commands given up.
    pub(super) fn tick(&mut self, now: Duration, output: &mut FrameWriter) -> Vec<Purpose> {
        for pending in &mut self.pending {
            if now >= pending.repeat_at && pending.sends < MAX_SENDS {
                pending.message.confirmation = pending.sends;
                pending.sends += 1;
                pending.stale_acks = 0;
                pending.repeat_at = now + RETRY;
                output.write(&pending.message);
            }
        }
        self.pending.extract_if(.., |pending| now >= pending.repeat_at).map(|lost| lost.purpose).collect()
    }

    fn take(&mut self, command: MavCmd) -> Option<Pending> {
        let index = self.pending.iter().position(|pending| pending.message.command == command)?;
        Some(self.pending.remove(index))
    }
}

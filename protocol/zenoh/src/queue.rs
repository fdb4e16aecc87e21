//! The bounded queue before a session: whoever asks something of the session hands it over here and never waits.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use skein_wire::Key;
use tokio::sync::mpsc::{Receiver, Sender, UnboundedReceiver, UnboundedSender, channel, unbounded_channel};

use crate::error::ZenohError;
use crate::inbox::Inbox;

/// Counts of the messages that have passed through a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ZenohStats {
    pub messages: u64,
    /// Bytes of keys and payloads put.
    pub bytes: u64,
    /// Messages dropped because the queue was full.
    pub dropped: u64,
    /// Messages that Zenoh refused.
    pub failed: u64,
}

#[derive(Debug, Default)]
pub(crate) struct Counters {
    pub(crate) messages: AtomicU64,
    pub(crate) bytes: AtomicU64,
    pub(crate) dropped: AtomicU64,
    pub(crate) failed: AtomicU64,
}

/// A message to put.
pub(crate) struct Put {
    pub(crate) port: u64,
    pub(crate) key: Key,
    pub(crate) payload: Vec<u8>,
}

/// Anything else that the session is asked to do.
pub(crate) enum Command {
    Join { port: u64, patterns: Vec<String>, inbox: Arc<Inbox>, answer: SyncSender<Result<(), ZenohError>> },
    Leave { port: u64 },
    CountPeers { answer: SyncSender<usize> },
}

/// Anything that comes out of the queue.
pub(crate) enum Asked {
    Put(Put),
    Command(Command),
}

/// The asking end: messages to put are so many at most, commands are few.
#[derive(Debug)]
pub(crate) struct Senders {
    puts: Sender<Put>,
    commands: UnboundedSender<Command>,
    counters: Arc<Counters>,
}

/// The session's end.
pub(crate) struct Queue {
    puts: Receiver<Put>,
    commands: UnboundedReceiver<Command>,
    pub(crate) counters: Arc<Counters>,
}

/// A queue for so many messages.
pub(crate) fn queue(capacity: usize) -> (Senders, Queue) {
    let (puts, puts_out) = channel(capacity.max(1));
    let (commands, commands_out) = unbounded_channel();
    let counters = Arc::new(Counters::default());
    let queue = Queue { puts: puts_out, commands: commands_out, counters: counters.clone() };
    (Senders { puts, commands, counters }, queue)
}

impl Queue {
    /// The next one; none when nobody can ask any more.
    pub(crate) async fn next(&mut self) -> Option<Asked> {
        tokio::select! {
            biased;
            Some(command) = self.commands.recv() => Some(Asked::Command(command)),
            Some(put) = self.puts.recv() => Some(Asked::Put(put)),
            else => None,
        }
    }
}

/// The end that a session's handles and links share. When the last of them is gone, the session closes.
#[derive(Debug)]
pub(crate) struct Entry {
    /// Gone only while the session closes.
    senders: Option<Senders>,
    /// The session's thread.
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl Entry {
    pub(crate) fn new(senders: Senders, thread: JoinHandle<()>) -> Self {
        Self { senders: Some(senders), thread: Mutex::new(Some(thread)) }
    }

    /// Hands a message over for sending, or drops it when too many wait.
    pub(crate) fn put(&self, port: u64, key: &Key, payload: Vec<u8>) {
        let Some(Senders { puts, counters, .. }) = &self.senders else { return };
        if puts.try_send(Put { port, key: key.clone(), payload }).is_err() {
            counters.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Ends a link.
    pub(crate) fn leave(&self, port: u64) {
        // Where nobody serves any more, there is nothing to leave.
        let _ = self.ask(Command::Leave { port });
    }

    pub(crate) fn ask(&self, command: Command) -> Result<(), ZenohError> {
        let senders = self.senders.as_ref().ok_or(ZenohError::ThreadGone)?;
        senders.commands.send(command).map_err(|_| ZenohError::ThreadGone)
    }

    pub(crate) fn stats(&self) -> ZenohStats {
        let Some(Senders { counters, .. }) = &self.senders else { return ZenohStats::default() };
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        ZenohStats {
            messages: read(&counters.messages),
            bytes: read(&counters.bytes),
            dropped: read(&counters.dropped),
            failed: read(&counters.failed),
        }
    }
}

impl Drop for Entry {
    /// Ends the thread, which sends what still waits and closes the session.
    fn drop(&mut self) {
        self.senders = None;
        if let Some(thread) = self.thread.get_mut().ok().and_then(Option::take) {
            // Its panic, if any, has been reported where it happened.
            let _ = thread.join();
        }
    }
}

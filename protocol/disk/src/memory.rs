//! All that a node needs of its state folder to begin a life.

use std::path::Path;
use std::time::{Duration, SystemTime};

use skein_dbp::Kept;
use skein_wire::{NodeName, Saver, Store};

use crate::background::Background;
use crate::incarnation::{IncarnationError, next_incarnation};
use crate::promises::PromiseStore;

/// A node's memory of its former lives.
pub struct Memory {
    pub incarnation: Number,
    pub kept: Kept,
    /// Where promises are kept from now on, on a thread of its own.
    pub promises: Box<dyn Store>,
    /// Why what a former life has kept is lost, if it is.
    pub lost: Option<String>,
}

/// The number of a life, which may have yet to be kept.
pub struct Number {
    pub number: u64,
    saver: Option<Saver<u64>>,
    trouble: Option<String>,
}

impl Memory {
    /// Opens the memory of `node` in `folder`, for a life whose number is at least `least`; `clock` is this
    /// computer's, and `done` is called when something has been kept, or could not be.
    ///
    /// # Errors
    /// There is no number for this life that is surely greater than those before, or no thread for the disk.
    pub fn open(
        folder: &Path,
        node: &NodeName,
        least: u64,
        clock: SystemTime,
        done: impl Fn() + Clone + Send + 'static,
    ) -> Result<Self, MemoryError> {
        let life = next_incarnation(folder, node, least, clock)?;
        let saver = life.unsaved.map(|store| -> std::io::Result<_> {
            let mut saver = Saver::new(Box::new(Background::new(store, done.clone())?));
            saver.put(Duration::ZERO, life.number);
            Ok(saver)
        });
        let incarnation = Number { number: life.number, saver: saver.transpose()?, trouble: life.trouble };
        let (store, kept) = PromiseStore::open(folder, node);
        let (kept, lost) = match kept {
            Ok(kept) => (kept, None),
            Err(lost) => (Kept::default(), Some(lost.to_string())),
        };
        Ok(Self { incarnation, kept, promises: Box::new(Background::new(store, done)?), lost })
    }
}

impl Number {
    /// Goes on with keeping it.
    pub fn go_on(&mut self, now: Duration) {
        if let Some(saver) = &mut self.saver
            && saver.go_on(now)
        {
            self.saver = None;
            self.trouble = None;
        }
    }

    /// Why it is not kept, or was taken from the clock.
    #[must_use]
    pub fn trouble(&self) -> Option<&str> {
        self.trouble.as_deref()
    }

    /// Whether it is not kept yet.
    #[must_use]
    pub fn is_unsaved(&self) -> bool {
        self.saver.is_some()
    }
}

/// Why a node's memory cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum MemoryError {
    #[error(transparent)]
    Incarnation(#[from] IncarnationError),
    #[error("the disk's thread cannot be started: {0}")]
    Thread(#[from] std::io::Error),
}

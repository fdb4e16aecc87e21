//! The seam to whatever survives a restart.

use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

use skein_dbp::Kept;

/// Where a node keeps what it must not forget.
pub trait Store: Debug + Send {
    /// Keeps `kept` in place of what was kept before, so that it is still there after a crash.
    ///
    /// # Errors
    /// A text for people that names what could not be written. The node then does not say what it could not keep.
    fn save(&mut self, kept: &Kept) -> Result<(), String>;
}

/// Keeps in memory: for runs on one host, where a node's life ends but not the process.
#[derive(Clone, Debug, Default)]
pub struct MemoryStore(Arc<Mutex<Kept>>);

impl MemoryStore {
    /// What was kept last.
    #[must_use]
    pub fn kept(&self) -> Kept {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Store for MemoryStore {
    fn save(&mut self, kept: &Kept) -> Result<(), String> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = kept.clone();
        Ok(())
    }
}

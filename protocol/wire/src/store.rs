//! The seam to whatever survives a restart.

use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use skein_bp::script::Assignment;
use skein_dbp::Kept;

/// Keeps what must not be forgotten: a node's promises ([`Kept`]), or the scripts that it was sent ([`KeptScript`]).
pub trait Store<T = Kept>: Debug + Send {
    /// Keeps `kept` in place of what was kept before, so that it is still there after a crash.
    ///
    /// # Errors
    /// A text for people that names what could not be written. The node then does not say what it could not keep.
    fn save(&mut self, kept: &T) -> Result<(), String>;
}

/// A script that a vehicle was sent and has taken in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptScript {
    /// Its sender: a b-thread of another node, such as `ground/main#scripts for uav/1`, or the vehicle itself.
    pub from: String,
    /// The script, and the values of its parameters.
    pub assignment: Assignment,
}

/// Keeps in memory: for runs on one host, where a node's life ends but not the process.
#[derive(Clone, Debug, Default)]
pub struct MemoryStore<T = Kept>(Arc<Mutex<T>>);

impl<T: Clone> MemoryStore<T> {
    /// The value that was kept last.
    pub fn kept(&self) -> T {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl<T: Clone + Debug + Send> Store<T> for MemoryStore<T> {
    fn save(&mut self, kept: &T) -> Result<(), String> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = kept.clone();
        Ok(())
    }
}

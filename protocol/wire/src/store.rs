//! The seam to whatever survives a restart.

use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use skein_bp::script::Assignment;
use skein_dbp::Kept;

use crate::zone::Zone;

/// Keeps what must not be forgotten: a node's promises ([`Kept`]), the scripts that it was sent ([`KeptScript`]), or the
/// zones that it has drawn ([`KeptZone`]).
pub trait Store<T = Kept>: Debug + Send {
    /// Keeps `kept` in place of what was kept before, so that it is still there after a crash. One that takes
    /// its time is asked again with the same value until it is done, or has failed; asked after that, it
    /// tries again.
    fn save(&mut self, kept: &T) -> Saving;
}

/// The progress of a store with what it was given last.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Saving {
    /// It would be there after a crash.
    Done,
    /// It is not known yet.
    UnderWay,
    /// A text for people that names what could not be written, and why.
    Failed(String),
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

/// A zone that a station has drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptZone {
    /// The person or program that has drawn it.
    pub by: String,
    pub zone: Zone,
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
    fn save(&mut self, kept: &T) -> Saving {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = kept.clone();
        Saving::Done
    }
}

//! What a vehicle keeps of the scripts that were sent to it, from one life of its agent to the next.

use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use skein_bp::script::Assignment;

/// A script that was sent and taken in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptScript {
    /// Who has sent it: a b-thread of another node, such as `ground/main#scripts for uav/1`, or the vehicle itself.
    pub from: String,
    /// The script, and the values of its parameters.
    pub assignment: Assignment,
}

/// Where a vehicle keeps the scripts that were sent to it.
pub trait ScriptStore: Debug + Send {
    /// Keeps `scripts` in place of those kept before, so that they are still there after a crash.
    ///
    /// # Errors
    /// A text for people that names what could not be written.
    fn save(&mut self, scripts: &[KeptScript]) -> Result<(), String>;
}

/// Keeps scripts in memory, where an agent's life ends but not the process.
#[derive(Clone, Debug, Default)]
pub struct MemoryScriptStore(Arc<Mutex<Vec<KeptScript>>>);

impl MemoryScriptStore {
    /// The scripts that were kept last.
    #[must_use]
    pub fn kept(&self) -> Vec<KeptScript> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl ScriptStore for MemoryScriptStore {
    fn save(&mut self, scripts: &[KeptScript]) -> Result<(), String> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = scripts.to_vec();
        Ok(())
    }
}

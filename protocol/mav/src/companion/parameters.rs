//! The parameter protocol at the companion's end: read or write by name, repeated until the value comes back.

use std::time::Duration;

use mavlink::dialects::common::{PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA};

use crate::frame::{Address, FrameWriter};
use crate::mode::AutopilotKind;
use crate::parameter::{ParameterValue, name_from_wire, wire_name};

/// How long a value is waited for before it is asked for again.
const RETRY: Duration = Duration::from_millis(400);
/// How often it is asked for in all.
const MAX_SENDS: u8 = 5;

/// The parameters asked for and not heard of yet.
#[derive(Debug, Clone, Default)]
pub(super) struct Parameters {
    pending: Vec<Pending>,
}

#[derive(Debug, Clone)]
struct Pending {
    name: String,
    /// The value to write; `None` to read.
    write: Option<ParameterValue>,
    repeat_at: Duration,
    sends: u8,
}

impl Parameters {
    /// Asks for a parameter, or writes it, at the next tick.
    pub(super) fn request(&mut self, name: &str, write: Option<ParameterValue>) {
        self.pending.retain(|pending| pending.name != name);
        self.pending.push(Pending { name: name.to_owned(), write, repeat_at: Duration::ZERO, sends: 0 });
    }

    /// A value arrived. Returns it if it was asked for.
    pub(super) fn on_value(
        &mut self,
        message: &PARAM_VALUE_DATA,
        kind: AutopilotKind,
    ) -> Option<(String, ParameterValue)> {
        let name = name_from_wire(&message.param_id);
        let index = self.pending.iter().position(|pending| pending.sends > 0 && pending.name == name)?;
        let value = ParameterValue::decode(message.param_value, message.param_type, kind);
        Some((self.pending.remove(index).name, value))
    }

    /// Sends what is due; returns the names given up.
    pub(super) fn tick(
        &mut self,
        now: Duration,
        kind: AutopilotKind,
        autopilot: Address,
        output: &mut FrameWriter,
    ) -> Vec<String> {
        for pending in &mut self.pending {
            if now >= pending.repeat_at && pending.sends < MAX_SENDS {
                pending.sends += 1;
                pending.repeat_at = now + RETRY;
                pending.send(kind, autopilot, output);
            }
        }
        self.pending.extract_if(.., |pending| now >= pending.repeat_at).map(|lost| lost.name).collect()
    }
}

impl Pending {
    fn send(&self, kind: AutopilotKind, autopilot: Address, output: &mut FrameWriter) {
        let param_id = wire_name(&self.name);
        match self.write {
            None => output.write(&PARAM_REQUEST_READ_DATA {
                // By name, not by index.
                param_index: -1,
                target_system: autopilot.system_id,
                target_component: autopilot.component_id,
                param_id,
            }),
            Some(value) => {
                let (param_value, param_type) = value.encode(kind);
                output.write(&PARAM_SET_DATA {
                    param_value,
                    target_system: autopilot.system_id,
                    target_component: autopilot.component_id,
                    param_id,
                    param_type,
                });
            }
        }
    }
}

//! The parameter protocol at the companion's end: a read or write by name is repeated until
//! the value comes back.

use std::time::Duration;

use mavlink::dialects::common::{PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA};

use crate::address::Address;
use crate::frame::FrameWriter;
use crate::parameter::{ParameterEncoding, ParameterValue, name_from_wire, wire_name};
use crate::patience::{Patience, Retry, Turn};

const RETRY: Retry = Retry { every: Duration::from_millis(400), times: 4 };

/// The parameters that have been asked for and have not come.
#[derive(Debug, Clone, Default)]
pub(super) struct Parameters {
    pending: Vec<Pending>,
}

#[derive(Debug, Clone)]
struct Pending {
    name: String,
    /// The value to write; `None` to read.
    write: Option<ParameterValue>,
    /// `None` before it is sent.
    patience: Option<Patience>,
}

impl Parameters {
    /// Reads a parameter, or writes it, at the next tick.
    pub(super) fn request(&mut self, name: &str, write: Option<ParameterValue>) {
        self.pending.retain(|pending| pending.name != name);
        self.pending.push(Pending { name: name.to_owned(), write, patience: None });
    }

    /// A value arrived, which somebody else may have asked for or set.
    pub(super) fn on_value(
        &mut self,
        message: &PARAM_VALUE_DATA,
        encoding: ParameterEncoding,
    ) -> (String, ParameterValue) {
        let name = name_from_wire(&message.param_id).to_owned();
        self.pending.retain(|pending| pending.patience.is_none() || pending.name != name);
        (name, ParameterValue::decode(message.param_value, message.param_type, encoding))
    }

    /// Sends what is due; returns the names given up.
    pub(super) fn tick(
        &mut self,
        now: Duration,
        encoding: ParameterEncoding,
        autopilot: Address,
        output: &mut FrameWriter,
    ) -> Vec<String> {
        let given_up = |pending: &mut Pending| {
            let turn = match &mut pending.patience {
                Some(patience) => patience.turn(now),
                None => {
                    pending.patience = Some(RETRY.from(now));
                    Turn::Repeat
                }
            };
            if turn == Turn::Repeat {
                pending.send(encoding, autopilot, output);
            }
            turn == Turn::GiveUp
        };
        self.pending.extract_if(.., given_up).map(|lost| lost.name).collect()
    }
}

impl Pending {
    fn send(&self, encoding: ParameterEncoding, autopilot: Address, output: &mut FrameWriter) {
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
                let (param_value, param_type) = value.encode(encoding);
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

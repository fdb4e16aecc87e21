//! The parameter protocol at the autopilot's end.

use mavlink::dialects::common::{PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA};

use super::parameter_table::{ParameterError, ParameterTable};
use crate::frame::FrameWriter;
use crate::parameter::{ParameterEncoding, ParameterValue, name_from_wire, wire_name};

/// The number of a list's parameters that are sent at each report, so that a list does not crowd out telemetry.
const LISTED_PER_REPORT: usize = 2;
const ENCODING: ParameterEncoding = ParameterEncoding::Bytewise;

/// The table, and the list of it that is being sent.
#[derive(Debug)]
pub(super) struct Parameters {
    pub(super) table: ParameterTable,
    /// Index of the next parameter of the list.
    listing: Option<usize>,
}

impl Parameters {
    pub(super) fn new(table: ParameterTable) -> Self {
        Self { table, listing: None }
    }

    /// `PARAM_REQUEST_LIST`.
    pub(super) fn begin_list(&mut self) {
        self.listing = Some(0);
    }

    /// Sends the next part of the list under way.
    pub(super) fn list(&mut self, output: &mut FrameWriter) {
        if let Some(first) = self.listing {
            let end = first + LISTED_PER_REPORT;
            for index in first..end {
                self.send(index, output);
            }
            self.listing = (end < self.table.len()).then_some(end);
        }
    }

    /// `PARAM_REQUEST_READ`: by name if the index is negative.
    pub(super) fn read(&self, message: &PARAM_REQUEST_READ_DATA, output: &mut FrameWriter) {
        let by_name = || self.table.find(name_from_wire(&message.param_id)).map(|(index, _)| index);
        if let Some(index) = usize::try_from(message.param_index).ok().or_else(by_name) {
            self.send(index, output);
        }
    }

    /// `PARAM_SET`: sends the value that the parameter has then, which is the old one if it was refused.
    ///
    /// # Errors
    /// The reason for the refusal.
    pub(super) fn set(
        &mut self,
        message: &PARAM_SET_DATA,
        output: &mut FrameWriter,
    ) -> Result<&'static str, ParameterError> {
        let name = name_from_wire(&message.param_id);
        let value = ParameterValue::decode(message.param_value, message.param_type, ENCODING);
        let outcome = self.table.set(name, value);
        if let Some((index, _)) = self.table.find(name) {
            self.send(index, output);
        }
        outcome
    }

    fn send(&self, index: usize, output: &mut FrameWriter) {
        if let Some(entry) = self.table.at(index) {
            let (param_value, param_type) = entry.value.encode(ENCODING);
            output.write(&PARAM_VALUE_DATA {
                param_value,
                param_count: self.table.len() as u16,
                param_index: index as u16,
                param_id: wire_name(entry.name),
                param_type,
            });
        }
    }
}

//! Events that have happened, in the form in which a recording keeps them.

use std::sync::Arc;
use std::time::Duration;

use skein_bp::Origin;
use skein_dbp::{Happened, NodeName};

use crate::decode_error::DecodeError;
use crate::message::{Result, node, ns};
use crate::proto::{self, TraceEvent};

impl TraceEvent {
    /// The record of what `node` saw happen.
    pub fn new(node: &NodeName, happened: &Happened) -> Self {
        let proto::Event { name, data } = (&happened.event).into();
        Self {
            node: node.as_str().into(),
            home: happened.home.as_str().into(),
            seq: happened.seq,
            time_ns: ns(happened.at),
            event: name,
            data,
            origin: happened.origin.to_string(),
            requested_by: happened.requested_by.iter().map(|name| name.as_ref().into()).collect(),
            blocked_by: happened.event.text("by").map(Into::into).into_iter().collect(),
            lease_age_ms: None,
            choice: happened.choice.as_deref().unwrap_or_default().into(),
        }
    }
}

impl TryFrom<TraceEvent> for Happened {
    type Error = DecodeError;

    /// A recording does not keep the term of a joint event.
    fn try_from(trace: TraceEvent) -> Result<Self> {
        Ok(Self {
            event: proto::Event { name: trace.event, data: trace.data }.try_into()?,
            home: node("TraceEvent.home", &trace.home)?,
            seq: trace.seq,
            term: 0,
            // In a word of a later version, it is at least a fact.
            origin: [Origin::Internal, Origin::External]
                .into_iter()
                .find(|origin| origin.to_string() == trace.origin)
                .unwrap_or(Origin::Occurred),
            requested_by: trace.requested_by.into_iter().map(Arc::from).collect(),
            choice: (!trace.choice.is_empty()).then(|| trace.choice.into()),
            at: Duration::from_nanos(trace.time_ns),
        })
    }
}

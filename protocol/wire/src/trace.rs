//! Events that have happened, as a recording keeps them.

use skein_dbp::{Happened, NodeName};

use crate::proto::TraceEvent;

impl TraceEvent {
    /// What `node` saw happen, without blockers.
    #[must_use]
    pub fn new(node: &NodeName, happened: &Happened) -> Self {
        Self {
            node: node.as_str().into(),
            home: happened.home.as_str().into(),
            seq: happened.seq,
            time_ns: u64::try_from(happened.at.as_nanos()).unwrap_or(u64::MAX),
            event: happened.event.name().into(),
            data: happened.event.data().map(|(key, value)| (key.into(), value.into())).collect(),
            origin: happened.origin.to_string(),
            requested_by: happened.requested_by.iter().map(|name| name.as_ref().into()).collect(),
            blocked_by: happened.event.text("by").map(Into::into).into_iter().collect(),
            lease_age_ms: None,
            choice: happened.choice.as_deref().unwrap_or_default().into(),
        }
    }
}

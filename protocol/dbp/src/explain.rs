//! Why something can or cannot happen here, remote b-threads included.

use std::fmt;

use skein_bp::Explanation;

use crate::RemoteParty;

/// The program's explanation, and who stands behind the proxies in it.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeExplanation {
    /// Who requests, blocks and waits for the events asked about; remote b-threads as `node#bthread`.
    pub local: Explanation,
    /// The remote b-threads among them.
    pub remote: Vec<RemoteParty>,
}

impl fmt::Display for NodeExplanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.local.fmt(f)?;
        for RemoteParty { node, bthread, lease_age, lease } in &self.remote {
            let (age, lease) = (lease_age.as_secs_f64(), lease.as_secs_f64());
            writeln!(f, "  {node}#{bthread} was renewed {age:.2} s ago and lapses at {lease:.2} s")?;
        }
        Ok(())
    }
}

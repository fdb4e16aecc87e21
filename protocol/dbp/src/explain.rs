//! The explanation why something can or cannot happen at a node, remote b-threads included.

use std::fmt;

use skein_bp::Explanation;

use crate::home::table::RemoteParty;

/// The program's explanation, and the remote b-threads behind the proxies in it.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeExplanation {
    /// The b-threads that request, block and wait for the events asked about; remote ones as `node#bthread`.
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

//! The table `[network.security]` of a node's configuration file: its certificates.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use skein_wire::NodeName;

/// The files of an authority and of a fleet's roster in a folder of certificates.
pub(crate) const AUTHORITY: &str = "authority.pem";
pub(crate) const ROSTER: &str = "roster.toml";

/// Certificates, as PEM files: whoever has one of this authority in a name of the roster is a member, says what is its
/// own to say, and all that travels is encrypted.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Security {
    /// The authority's certificate.
    pub authority: PathBuf,
    /// This node's certificate, for the host names by which others connect to it.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
    /// Who takes part, and with which certificates: a [`Roster`](crate::Roster)'s file. Without it, whoever this node's own
    /// configuration names, with their first certificates, and nobody relays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roster: Option<PathBuf>,
}

impl Security {
    /// The files of `node` in a folder that `skein-ground certificates` has filled.
    pub fn in_folder(folder: &Path, node: &NodeName) -> Self {
        let stem = stem(node);
        Self {
            authority: folder.join(AUTHORITY),
            certificate: folder.join(format!("{stem}.pem")),
            key: folder.join(format!("{stem}.key")),
            roster: Some(folder.join(ROSTER)),
        }
    }

    /// The same, with paths relative to `folder`.
    #[must_use]
    pub fn relative_to(&self, folder: &Path) -> Self {
        Self {
            authority: folder.join(&self.authority),
            certificate: folder.join(&self.certificate),
            key: folder.join(&self.key),
            roster: self.roster.as_ref().map(|roster| folder.join(roster)),
        }
    }
}

/// The files of a node's certificate and key, but for their endings.
pub(crate) fn stem(node: &NodeName) -> String {
    node.as_str().replace('/', "-")
}

//! The console beyond this computer: TLS, to browsers that show a certificate of the fleet's authority.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::WebPkiClientVerifier;
use rustls::{RootCertStore, ServerConfig, ServerConnection};
use x509_parser::prelude::{FromDer as _, X509Certificate};

use super::session::{Identity, Role};
use crate::giver::Giver;

/// Certificates (PEM), and who may do what by theirs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConsoleSecurity {
    /// The authority whose certificates browsers show.
    pub authority: PathBuf,
    /// The station's certificate, for the host names by which browsers come.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
    /// The role of each person or program, by their certificate's common name. Who is not named is turned away.
    pub roles: BTreeMap<String, Role>,
}

/// Why there is no TLS.
#[derive(Debug, thiserror::Error)]
pub enum ConsoleSecurityError {
    #[error("console, `{}`: {why}: expected {expected} in PEM", path.display())]
    File { path: PathBuf, why: String, expected: &'static str },
    #[error(
        "console: [console.roles] names nobody, so that nobody could open it: add \"NAME\" = \"operator\""
    )]
    NoRoles,
    #[error("console, [console.roles]: {0}")]
    Name(String),
    #[error("console: these certificates do not go together: {0}")]
    Unfit(String),
}

/// The settings of a connection: TLS, and who may do what.
#[derive(Clone)]
pub(super) struct Tls {
    pub(super) server: Arc<ServerConfig>,
    roles: Arc<BTreeMap<String, (Giver, Role)>>,
}

impl ConsoleSecurity {
    /// Reads the certificates.
    pub(super) fn open(&self) -> Result<Tls, ConsoleSecurityError> {
        if self.roles.is_empty() {
            return Err(ConsoleSecurityError::NoRoles);
        }
        let unfit = |error: &dyn std::fmt::Display| ConsoleSecurityError::Unfit(error.to_string());
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let mut authority = RootCertStore::empty();
        for certificate in certificates(&self.authority)? {
            authority.add(certificate).map_err(|error| unfit(&error))?;
        }
        let verifier = WebPkiClientVerifier::builder_with_provider(authority.into(), provider.clone())
            .build()
            .map_err(|error| unfit(&error))?;
        let key = PrivateKeyDer::from_pem_file(&self.key)
            .map_err(|error| fault(&self.key, error.to_string(), "a private key"))?;
        let mut server = ServerConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .map_err(|error| unfit(&error))?
            .with_client_cert_verifier(verifier)
            .with_single_cert(certificates(&self.certificate)?, key)
            .map_err(|error| unfit(&error))?;
        server.alpn_protocols = vec![b"http/1.1".to_vec()];
        // A session that is resumed would outlive the certificate that began it.
        server.send_tls13_tickets = 0;
        server.session_storage = Arc::new(rustls::server::NoServerSessionStorage {});
        Ok(Tls { server: Arc::new(server), roles: Arc::new(self.names()?) })
    }

    /// The name that each common name stands for: what stands before its serial number.
    fn names(&self) -> Result<BTreeMap<String, (Giver, Role)>, ConsoleSecurityError> {
        let named = |(common_name, role): (&String, &Role)| {
            let name = common_name.split(';').next().unwrap_or_default().replace('/', " ");
            let giver = Giver::new(&name).map_err(|error| ConsoleSecurityError::Name(error.to_string()))?;
            Ok((common_name.clone(), (giver, *role)))
        };
        self.roles.iter().map(named).collect()
    }
}

impl Tls {
    /// The one who has made this connection.
    pub(super) fn identity(&self, connection: &ServerConnection) -> Identity {
        let common_name = connection.peer_certificates().and_then(|chain| common_name(chain.first()?));
        let common_name = common_name.unwrap_or_default();
        match self.roles.get(&common_name) {
            Some((name, role)) => Identity::Known(name.clone(), *role),
            None => Identity::Stranger(common_name),
        }
    }
}

fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, ConsoleSecurityError> {
    let expected = "a certificate";
    let read = CertificateDer::pem_file_iter(path).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let found = read.map_err(|error| fault(path, error.to_string(), expected))?;
    if found.is_empty() { Err(fault(path, "it holds none".into(), expected)) } else { Ok(found) }
}

fn fault(path: &Path, why: String, expected: &'static str) -> ConsoleSecurityError {
    ConsoleSecurityError::File { path: path.to_owned(), why, expected }
}

/// The one common name of a certificate; none if it has none or several.
fn common_name(certificate: &CertificateDer<'_>) -> Option<String> {
    let (_, certificate) = X509Certificate::from_der(certificate).ok()?;
    let mut names = certificate.subject().iter_common_name();
    let name = names.next()?.as_str().ok()?.to_owned();
    names.next().is_none().then_some(name)
}

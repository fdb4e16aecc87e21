//! A node's own certificate, looked at before it opens a session: so that whoever started it hears what is wrong, and
//! not that nobody answers.

use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rustls::crypto::ring::sign::any_supported_type;
use rustls::pki_types::PrivateKeyDer;
use rustls::pki_types::pem::PemObject as _;
use skein_wire::NodeName;
use x509_parser::certificate::X509Certificate;
use x509_parser::extensions::GeneralName;
use x509_parser::pem::Pem;
use x509_parser::time::ASN1Time;

use crate::roster::{Roster, Unlisted};
use crate::security::Security;

/// A certificate that ends sooner is warned of.
const SOON: Duration = Duration::from_secs(7 * 24 * 3600);

/// Something is wrong with the files of `[network.security]`.
#[derive(Debug, thiserror::Error)]
#[error("`{}`: {fault}", path.display())]
pub struct CertificateError {
    pub path: PathBuf,
    pub fault: Fault,
}

/// The fault, and what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    #[error("cannot be read: {0}; `[network.security]` names it")]
    Unreadable(std::io::Error),
    #[error("holds no {0} in PEM form; `[network.security]` names it")]
    Empty(&'static str),
    #[error("holds no sound certificate: {0}")]
    Unsound(String),
    #[error("this node is {node}, and {why}; make it one with `skein-ground certificates`")]
    Unlisted { node: NodeName, why: Unlisted },
    #[error(
        "is the certificate of {holder}, and this node is {node}: name its own under `[network.security]`"
    )]
    OfAnother { node: NodeName, holder: NodeName },
    #[error(
        "has expired on {until}, and it is {now} here: renew it with `skein-ground certificates --renew`, or set this \
         computer's clock if that is wrong"
    )]
    Expired { until: String, now: String },
    #[error(
        "is not valid before {from}, and it is {now} here: set this computer's clock (`date --set`), or start this \
         program once the time has come from the network or a satellite (systemd: `After=time-sync.target`); a \
         computer without a battery for its clock starts in 1970"
    )]
    NotYet { from: String, now: String },
    #[error("is not signed by the authority in `{}`: both must come from the same `skein-ground certificates`", authority.display())]
    Foreign { authority: PathBuf },
    #[error("is not the key of the certificate in `{}`: name the file that was made with it", certificate.display())]
    WrongKey { certificate: PathBuf },
    #[error("holds no key that can be used: {0}")]
    BadKey(String),
    #[error(
        "is for {names}, and this node listens at `{host}`, where nobody would believe it: make one for that address \
         (`skein-ground certificates NODE={host}`)"
    )]
    WrongHost { host: String, names: String },
}

/// Looks at the files of a node that listens at `hosts`, at the time `now`. Gives what it is to be warned of.
///
/// # Errors
/// The file that is at fault, what is wrong with it, and what to do.
pub fn check(
    security: &Security,
    node: &NodeName,
    roster: &Roster,
    hosts: &[String],
    now: SystemTime,
) -> Result<Vec<String>, CertificateError> {
    let now = Now::of(now);
    let Security { authority, certificate, key, .. } = security;
    let authorities = read_certificates(authority)?;
    let own = read_certificates(certificate)?;
    for pem in &authorities {
        now.check(&parse(pem, authority)?).map_err(at(authority))?;
    }
    let own_first = own.first().ok_or(Fault::Empty("certificate")).map_err(at(certificate))?;
    let leaf = parse(own_first, certificate)?;
    let holder = roster.holder(common_name(&leaf));
    let holder =
        holder.map_err(|why| Fault::Unlisted { node: node.clone(), why }).map_err(at(certificate))?;
    if holder != node {
        let (node, holder) = (node.clone(), holder.clone());
        return Err(at(certificate)(Fault::OfAnother { node, holder }));
    }
    now.check(&leaf).map_err(at(certificate))?;
    check_issuer(&leaf, &own, &authorities, authority).map_err(at(certificate))?;
    hosts.iter().try_for_each(|host| check_host(&leaf, host)).map_err(at(certificate))?;
    check_key(key, &leaf, certificate).map_err(at(key))?;
    Ok(warnings(&leaf, certificate, key, &now))
}

fn at(path: &Path) -> impl FnOnce(Fault) -> CertificateError {
    let path = path.to_owned();
    move |fault| CertificateError { path, fault }
}

fn read_certificates(path: &Path) -> Result<Vec<Pem>, CertificateError> {
    let bytes = std::fs::read(path).map_err(Fault::Unreadable).map_err(at(path))?;
    let found: Vec<Pem> = Pem::iter_from_buffer(&bytes)
        .collect::<Result<_, _>>()
        .map_err(|error| Fault::Unsound(error.to_string()))
        .map_err(at(path))?;
    let certificates: Vec<Pem> = found.into_iter().filter(|pem| pem.label == "CERTIFICATE").collect();
    if certificates.is_empty() {
        return Err(at(path)(Fault::Empty("certificate")));
    }
    Ok(certificates)
}

fn parse<'a>(pem: &'a Pem, path: &Path) -> Result<X509Certificate<'a>, CertificateError> {
    pem.parse_x509().map_err(|error| Fault::Unsound(error.to_string())).map_err(at(path))
}

/// The name that Zenoh's access control reads too: the first.
fn common_name<'a>(certificate: &'a X509Certificate<'_>) -> Option<&'a str> {
    certificate.subject().iter_common_name().next().and_then(|name| name.as_str().ok())
}

/// Whoever signed it is an authority, if no other certificate of the file stands between them.
fn check_issuer(
    leaf: &X509Certificate<'_>,
    own: &[Pem],
    authorities: &[Pem],
    path: &Path,
) -> Result<(), Fault> {
    let signed = |issuer: &X509Certificate<'_>| leaf.verify_signature(Some(issuer.public_key())).is_ok();
    let issuers = authorities.iter().chain(own.iter().skip(1));
    let is_signed = issuers.filter_map(|pem| pem.parse_x509().ok()).any(|issuer| signed(&issuer));
    if is_signed { Ok(()) } else { Err(Fault::Foreign { authority: path.into() }) }
}

/// Others connect to the host by name, and believe only a certificate that has it.
fn check_host(leaf: &X509Certificate<'_>, host: &str) -> Result<(), Fault> {
    let host = host.trim_matches(['[', ']']);
    let address: Option<IpAddr> = host.parse().ok();
    // Whoever listens everywhere is reached by other names.
    if address.is_some_and(|address| address.is_unspecified()) {
        return Ok(());
    }
    let hosts = hosts(leaf);
    let is_it = |name: &String| match address {
        Some(address) => *name == address.to_string(),
        None => name.eq_ignore_ascii_case(host) || name.starts_with("*."),
    };
    if hosts.iter().any(is_it) {
        return Ok(());
    }
    let names = if hosts.is_empty() { "no host".into() } else { hosts.join(", ") };
    Err(Fault::WrongHost { host: host.into(), names })
}

/// The names and addresses of hosts that a certificate is for.
pub(crate) fn hosts(certificate: &X509Certificate<'_>) -> Vec<String> {
    let names = certificate.subject_alternative_name().ok().flatten();
    let names = names.map(|it| it.value.general_names.as_slice()).unwrap_or_default();
    let host = |name: &GeneralName<'_>| match name {
        GeneralName::DNSName(name) => Some((*name).to_owned()),
        GeneralName::IPAddress(bytes) => ip(bytes).map(|address| address.to_string()),
        _ => None,
    };
    names.iter().filter_map(host).collect()
}

fn ip(bytes: &[u8]) -> Option<IpAddr> {
    let four = <[u8; 4]>::try_from(bytes).ok().map(IpAddr::from);
    four.or_else(|| <[u8; 16]>::try_from(bytes).ok().map(IpAddr::from))
}

fn check_key(path: &Path, leaf: &X509Certificate<'_>, certificate: &Path) -> Result<(), Fault> {
    let text = std::fs::read(path).map_err(Fault::Unreadable)?;
    let key = PrivateKeyDer::from_pem_slice(&text).map_err(|_| Fault::Empty("private key"))?;
    let key = any_supported_type(&key).map_err(|error| Fault::BadKey(error.to_string()))?;
    match key.public_key() {
        Some(public) if *public.as_ref() != *leaf.public_key().raw => {
            Err(Fault::WrongKey { certificate: certificate.into() })
        }
        _ => Ok(()),
    }
}

fn warnings(leaf: &X509Certificate<'_>, certificate: &Path, key: &Path, now: &Now) -> Vec<String> {
    let until = leaf.validity().not_after;
    let left_s = until.timestamp() - now.0;
    let ends_soon = left_s < SOON.as_secs().cast_signed();
    let soon = ends_soon.then(|| {
        format!(
            "`{}` expires on {until}: renew it with `skein-ground certificates --renew`",
            certificate.display()
        )
    });
    let open = is_readable_by_others(key)
        .then(|| format!("`{}` can be read by others: chmod 600 {}", key.display(), key.display()));
    soon.into_iter().chain(open).collect()
}

#[cfg(unix)]
fn is_readable_by_others(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt as _;
    std::fs::metadata(path).is_ok_and(|file| file.permissions().mode() & 0o077 != 0)
}

#[cfg(not(unix))]
fn is_readable_by_others(_: &Path) -> bool {
    false
}

/// A time by this computer's clock, in seconds since 1970.
struct Now(i64);

impl Now {
    fn of(time: SystemTime) -> Self {
        let unix = time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs();
        Self(i64::try_from(unix).unwrap_or(i64::MAX))
    }

    fn check(&self, certificate: &X509Certificate<'_>) -> Result<(), Fault> {
        let (from, until) = (certificate.validity().not_before, certificate.validity().not_after);
        let now =
            || ASN1Time::from_timestamp(self.0).map_or_else(|_| self.0.to_string(), |now| now.to_string());
        if self.0 < from.timestamp() {
            return Err(Fault::NotYet { from: from.to_string(), now: now() });
        }
        if self.0 > until.timestamp() {
            return Err(Fault::Expired { until: until.to_string(), now: now() });
        }
        Ok(())
    }
}

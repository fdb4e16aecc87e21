//! A fleet's authority, and the certificates that it signs: what `skein-ground certificates` makes.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rcgen::{
    BasicConstraints, CertificateParams, DistinguishedName, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer,
    KeyPair, KeyUsagePurpose, SanType,
};
use skein_wire::NodeName;
use x509_parser::pem::Pem;

use crate::certificate;
use crate::roster::{FIRST_SERIAL, Roster, RosterError};
use crate::security::{AUTHORITY, ROSTER, Security, stem};

const AUTHORITY_KEY: &str = "authority.key";

const DAY: Duration = Duration::from_secs(24 * 3600);
/// An authority counts so long.
const AUTHORITY_LASTS: Duration = Duration::from_secs(3650 * 24 * 3600);

/// The hosts of a certificate for which none are named: this computer.
const HERE: [&str; 3] = ["localhost", "127.0.0.1", "::1"];

/// Why certificates cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum AuthorityError {
    #[error("`{}`: {cause}", path.display())]
    File { path: PathBuf, cause: io::Error },
    #[error("`{}`: {fault}", path.display())]
    Unsound { path: PathBuf, fault: String },
    #[error("{node} and {other} would have one file, {file}: give one of them another name")]
    SameFile { node: NodeName, other: NodeName, file: String },
    #[error("{node} at `{host}`: expected an address or a host's name")]
    Host { node: NodeName, host: String },
    #[error(transparent)]
    Roster(#[from] RosterError),
}

/// A node that is to have a certificate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holder {
    pub node: NodeName,
    /// The names and addresses by which others connect to it; none for those that it has, or for this computer's own.
    pub hosts: Vec<String>,
    /// Whether it passes on what others say.
    pub relays: bool,
}

impl Holder {
    /// A node that others reach on this computer.
    pub fn here(node: NodeName) -> Self {
        Self { node, hosts: Vec::new(), relays: false }
    }
}

/// The work done for a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Issued {
    pub node: NodeName,
    pub serial: u32,
    pub certificate: PathBuf,
    /// Whether it was made now, and was not there before.
    pub is_new: bool,
}

/// A folder with an authority, its members' certificates and keys, and their roster.
#[derive(Debug)]
pub struct Authority {
    folder: PathBuf,
    issuer: Issuer<'static, KeyPair>,
    roster: Roster,
}

impl Authority {
    /// The authority of `folder`, made for `fleet` if there is none.
    ///
    /// # Errors
    /// A file that is not sound, or cannot be written.
    pub fn open(folder: &Path, fleet: &str, now: SystemTime) -> Result<Self, AuthorityError> {
        fs::create_dir_all(folder).map_err(|cause| AuthorityError::File { path: folder.into(), cause })?;
        let (path, key_path) = (folder.join(AUTHORITY), folder.join(AUTHORITY_KEY));
        let issuer = match path.exists() || key_path.exists() {
            true => {
                let unsound = |path: &Path| {
                    let path = path.to_owned();
                    move |error: rcgen::Error| AuthorityError::Unsound { path, fault: error.to_string() }
                };
                let key = KeyPair::from_pem(&read(&key_path)?).map_err(unsound(&key_path))?;
                Issuer::from_ca_cert_pem(&read(&path)?, key).map_err(unsound(&path))?
            }
            false => make_authority(&path, &key_path, fleet, now)?,
        };
        let roster = folder.join(ROSTER);
        let roster = if roster.exists() { Roster::read(&roster)? } else { Roster::default() };
        Ok(Self { folder: folder.into(), issuer, roster })
    }

    /// Everybody who has a certificate of the roster.
    pub fn holders(&self) -> Vec<Holder> {
        self.roster.members().map(|(node, _)| Holder::here(node.clone())).collect()
    }

    /// Gives each of these a certificate for so many days, unless it has one and is not to be given a new one. New
    /// ones have the next serial, which the roster asks for from then on.
    ///
    /// # Errors
    /// Two that would have one file; a host that is none; a file that cannot be written.
    pub fn issue(
        &mut self,
        holders: &[Holder],
        days: u32,
        renew: bool,
        now: SystemTime,
    ) -> Result<Vec<Issued>, AuthorityError> {
        self.check_files(holders)?;
        for Holder { node, hosts, .. } in holders {
            hosts.iter().try_for_each(|host| name_of(node, host).map(drop))?;
        }
        let issued = holders.iter().map(|holder| self.issue_one(holder, days, renew, now)).collect();
        let relays = holders.iter().filter(|holder| holder.relays).map(|holder| holder.node.clone());
        self.roster = std::mem::take(&mut self.roster).relayed_by(relays);
        write(&self.folder.join(ROSTER), &self.roster.to_text(), 0o644)?;
        issued
    }

    /// The settings by which `node` uses its certificate, with paths that begin with the folder's.
    pub fn security(&self, node: &NodeName) -> Security {
        Security::in_folder(&self.folder, node)
    }

    /// Everybody's certificates, and who relays.
    pub fn roster(&self) -> &Roster {
        &self.roster
    }

    fn check_files(&self, holders: &[Holder]) -> Result<(), AuthorityError> {
        let mut files = BTreeMap::new();
        let members = self.roster.members().map(|(node, _)| node);
        for node in members.chain(holders.iter().map(|holder| &holder.node)) {
            if let Some(other) = files.insert(stem(node), node).filter(|other| *other != node) {
                let file = format!("{}.pem", stem(node));
                return Err(AuthorityError::SameFile { node: node.clone(), other: other.clone(), file });
            }
        }
        Ok(())
    }

    fn issue_one(
        &mut self,
        holder: &Holder,
        days: u32,
        renew: bool,
        now: SystemTime,
    ) -> Result<Issued, AuthorityError> {
        let node = &holder.node;
        let Security { certificate, key: key_path, .. } = self.security(node);
        let known = self.roster.members().find(|(member, _)| *member == node).map(|(_, serial)| serial);
        let there = known.filter(|_| !renew && certificate.exists() && key_path.exists());
        if let Some(serial) = there {
            return Ok(Issued { node: node.clone(), serial, certificate, is_new: false });
        }
        let serial = known.map_or(FIRST_SERIAL, |serial| serial.saturating_add(1));
        let hosts = if holder.hosts.is_empty() { hosts_of(&certificate) } else { holder.hosts.clone() };
        let unsound = |error: rcgen::Error| AuthorityError::Unsound {
            path: certificate.clone(),
            fault: error.to_string(),
        };
        let key = KeyPair::generate().map_err(unsound)?;
        let mut params = CertificateParams::default();
        params.subject_alt_names = hosts.iter().map(|host| name_of(node, host)).collect::<Result<_, _>>()?;
        params.distinguished_name = named(&format!("{node};{serial}"));
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages =
            vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth];
        lasts(&mut params, now, DAY * days);
        let text = params.signed_by(&key, &self.issuer).map_err(unsound)?.pem();
        write(&key_path, &key.serialize_pem(), 0o600)?;
        write(&certificate, &text, 0o644)?;
        self.roster.set(node.clone(), serial);
        Ok(Issued { node: node.clone(), serial, certificate, is_new: true })
    }
}

fn make_authority(
    path: &Path,
    key_path: &Path,
    fleet: &str,
    now: SystemTime,
) -> Result<Issuer<'static, KeyPair>, AuthorityError> {
    let unsound =
        |error: rcgen::Error| AuthorityError::Unsound { path: path.into(), fault: error.to_string() };
    let key = KeyPair::generate().map_err(unsound)?;
    let mut params = CertificateParams::default();
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    params.distinguished_name = named(&format!("authority of fleet {fleet}"));
    lasts(&mut params, now, AUTHORITY_LASTS);
    let text = params.self_signed(&key).map_err(unsound)?.pem();
    write(key_path, &key.serialize_pem(), 0o600)?;
    write(path, &text, 0o644)?;
    Ok(Issuer::new(params, key))
}

fn named(common_name: &str) -> DistinguishedName {
    let mut name = DistinguishedName::new();
    name.push(DnType::CommonName, common_name);
    name
}

/// From the day before, for computers whose clocks are a little slow.
fn lasts(params: &mut CertificateParams, now: SystemTime, time: Duration) {
    params.not_before = (now - DAY).into();
    params.not_after = (now + time).into();
}

fn name_of(node: &NodeName, host: &str) -> Result<SanType, AuthorityError> {
    let bad = || AuthorityError::Host { node: node.clone(), host: host.into() };
    if let Ok(address) = host.parse() {
        return Ok(SanType::IpAddress(address));
    }
    let is_name =
        !host.is_empty() && host.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '.' | '-'));
    if !is_name {
        return Err(bad());
    }
    host.try_into().map(SanType::DnsName).map_err(|_| bad())
}

/// The hosts of the certificate that is there, or this computer's own names.
fn hosts_of(certificate: &Path) -> Vec<String> {
    let bytes = fs::read(certificate).unwrap_or_default();
    let pem = Pem::iter_from_buffer(&bytes).next().and_then(Result::ok);
    let hosts = pem.as_ref().and_then(|pem| pem.parse_x509().ok()).map(|it| certificate::hosts(&it));
    hosts.filter(|hosts| !hosts.is_empty()).unwrap_or_else(|| HERE.map(String::from).to_vec())
}

fn read(path: &Path) -> Result<String, AuthorityError> {
    fs::read_to_string(path).map_err(|cause| AuthorityError::File { path: path.into(), cause })
}

/// Replaces a file whole; nobody else reads what is not for others, not even while it is written.
fn write(path: &Path, text: &str, mode: u32) -> Result<(), AuthorityError> {
    let failed = |cause| AuthorityError::File { path: path.into(), cause };
    let beside = path.with_extension("new");
    // Of an attempt before, with rights that may be others.
    let _ = fs::remove_file(&beside);
    let mut options = fs::OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, mode);
    let mut file = options.open(&beside).map_err(failed)?;
    file.write_all(text.as_bytes()).and_then(|()| file.sync_all()).map_err(failed)?;
    fs::rename(&beside, path).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::certificate::check;

    fn node(name: &str) -> NodeName {
        NodeName::new(name).unwrap()
    }

    /// An authority in `folder` with a ground station and a vehicle.
    fn authority(folder: &Path) -> Authority {
        let mut authority = Authority::open(folder, "demo", SystemTime::now()).unwrap();
        let holders = ["ground/main", "uav/1"].map(|name| Holder::here(node(name)));
        authority.issue(&holders, 30, false, SystemTime::now()).unwrap();
        authority
    }

    fn fault(
        security: &Security,
        authority: &Authority,
        host: &str,
        now: SystemTime,
    ) -> Result<Vec<String>, String> {
        check(security, &node("uav/1"), authority.roster(), &[host.to_owned()], now)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn each_fault_is_named_with_its_file_and_a_remedy() {
        let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let [ours, theirs] = [0, 1].map(|it| authority(folders[it].path()));
        let [own, ground, foreign] = [
            ours.security(&node("uav/1")),
            ours.security(&node("ground/main")),
            theirs.security(&node("uav/1")),
        ];
        let (here, now) = ("127.0.0.1", SystemTime::now());
        let nonsense = folders[0].path().join("nonsense.pem");
        std::fs::write(&nonsense, "-----BEGIN NOTHING-----").unwrap();
        assert_eq!(fault(&own, &ours, here, now), Ok(vec![]));
        assert_eq!(fault(&own, &ours, "0.0.0.0", now), Ok(vec![]));
        let year = Duration::from_secs(365 * 24 * 3600);
        let soon = fault(&own, &ours, here, now + Duration::from_secs(25 * 24 * 3600)).unwrap();
        assert!(soon.len() == 1 && soon[0].contains("expires on"), "{soon:?}");
        for (security, host, now, words) in [
            (own.clone(), here, SystemTime::UNIX_EPOCH, ["authority.pem", "time-sync.target"]),
            (own.clone(), here, now + year, ["uav-1.pem", "has expired on"]),
            (own.clone(), "10.0.0.7", now, ["uav-1.pem", "uav/1=10.0.0.7".trim_start_matches("uav/1")]),
            (ground.clone(), here, now, ["ground-main.pem", "certificate of ground/main"]),
            (
                Security { key: ground.key.clone(), ..own.clone() },
                here,
                now,
                ["ground-main.key", "uav-1.pem"],
            ),
            (
                Security { authority: foreign.authority.clone(), ..own.clone() },
                here,
                now,
                ["uav-1.pem", "not signed by the authority"],
            ),
            (Security { certificate: nonsense.clone(), ..own.clone() }, here, now, ["nonsense.pem", "PEM"]),
            (Security { key: "/none.key".into(), ..own.clone() }, here, now, ["/none.key", "cannot be read"]),
            (Security { authority: "/none.pem".into(), ..own }, here, now, ["/none.pem", "cannot be read"]),
        ] {
            let fault = fault(&security, &ours, host, now).unwrap_err();
            assert!(words.iter().all(|word| fault.contains(word)), "{fault}");
        }
    }
}

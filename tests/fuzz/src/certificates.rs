//! Certificates and keys (PEM, X.509) that a node looks at before it opens a session.

use std::fs;
use std::path::Path;
use std::time::{Duration, SystemTime};

use skein_zenoh::{Fault, Roster, Security, check_certificate};

use crate::packets::node;
use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "certificates", allowed: Allowed { bytes: 256 << 10, per_byte: 400 }, read, seeds };

const AUTHORITY: &[u8] = include_bytes!("../certificates/authority.pem");
const CERTIFICATE: &[u8] = include_bytes!("../certificates/uav-1.pem");
const KEY: &[u8] = include_bytes!("../certificates/uav-1.key");
/// The ground station's, which has two hosts and a second serial number.
const ANOTHER: &[u8] = include_bytes!("../certificates/ground-main.pem");

/// The three files are valid from 2026-12-01 on, for 30 days and more.
const THEN: Duration = Duration::from_secs(1_796_200_000);

/// The input is taken for each of the files in turn, beside two sound ones.
fn read(input: &[u8]) -> Reached {
    let files = [[input, CERTIFICATE, KEY], [AUTHORITY, input, KEY], [AUTHORITY, CERTIFICATE, input]];
    let reached = files.map(|files| {
        let folder = tempfile::tempdir().expect("a folder");
        check(folder.path(), files)
    });
    let rank = |reached: &Reached| {
        [Reached::Refused, Reached::Read, Reached::Planted].iter().position(|r| r == reached)
    };
    reached.into_iter().max_by_key(rank).expect("there are three")
}

fn check(folder: &Path, [authority, certificate, key]: [&[u8]; 3]) -> Reached {
    let me = node("uav/1");
    let security = Security::in_folder(folder, &me);
    for (path, content) in
        [(&security.authority, authority), (&security.certificate, certificate), (&security.key, key)]
    {
        fs::write(path, content).expect("it is written");
    }
    let roster = Roster::of([me.clone(), node("ground/main")]);
    let hosts = ["127.0.0.1".to_owned()];
    match check_certificate(&security, &me, &roster, &hosts, SystemTime::UNIX_EPOCH + THEN) {
        Ok(_) => {
            // Nobody else's is taken for its own.
            assert_ne!(certificate, ANOTHER);
            Reached::Read
        }
        // No seed has run out; nobody has to sign it to get there.
        Err(error) if matches!(error.fault, Fault::Expired { .. }) => Reached::Planted,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            Reached::Refused
        }
    }
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    vec![("authority", AUTHORITY.into()), ("own", CERTIFICATE.into()), ("key", KEY.into())]
}

//! `certificates`: a fleet's authority, and its members' certificates.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::SystemTime;

use anyhow::Context as _;
use clap::Args;
use serde_json::json;
use skein_wire::{Fleet, NodeName};
use skein_zenoh::{Authority, Holder, Issued};

#[derive(Args)]
pub struct Certificates {
    /// Folder for authority, certificates, keys and roster; made if missing, added to if there is an authority.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The fleet that the authority is for.
    #[arg(long, value_name = "NAME")]
    fleet: String,
    /// Give nodes that have a certificate a new one, with the next serial; without NODE, all that have one.
    #[arg(long)]
    renew: bool,
    /// Node that passes on what others say, such as a router: trusted with all of it.
    #[arg(long = "relay", value_name = "NODE")]
    relays: Vec<String>,
    /// Days for which certificates are valid.
    #[arg(long, value_name = "N", default_value_t = 365, value_parser = clap::value_parser!(u32).range(1..=3650))]
    days: u32,
    /// Node with the addresses at which others connect to it, such as `uav/1=10.0.0.11,uav-1.local` [default: this
    /// computer's own].
    #[arg(value_name = "NODE[=HOST,...]")]
    nodes: Vec<String>,
}

/// Makes what is missing, and says what belongs where.
pub fn run(args: &Certificates, as_json: bool) -> anyhow::Result<ExitCode> {
    Fleet::new(&args.fleet).context("--fleet")?;
    let mut holders = args.nodes.iter().map(|text| holder(text)).collect::<anyhow::Result<Vec<_>>>()?;
    for relay in &args.relays {
        let named = holder(relay)?;
        match holders.iter_mut().find(|holder| holder.node == named.node) {
            Some(holder) => holder.relays = true,
            None => holders.push(Holder { relays: true, ..named }),
        }
    }
    let is_new = !args.out.join("authority.pem").exists();
    anyhow::ensure!(
        !holders.is_empty() || args.renew && !is_new,
        "no node is named: name those that are to have a certificate, such as ground/main uav/1"
    );
    let now = SystemTime::now();
    let mut authority = Authority::open(&args.out, &args.fleet, now)?;
    if holders.is_empty() {
        holders = authority.holders();
    }
    let issued = authority.issue(&holders, args.days, args.renew, now)?;
    if as_json {
        println!("{}", summary(args, &authority, &issued));
    } else {
        print!("{}", told(&args.out, &issued, is_new));
    }
    Ok(ExitCode::SUCCESS)
}

fn holder(text: &str) -> anyhow::Result<Holder> {
    let (node, hosts) = text.split_once('=').unwrap_or((text, ""));
    let node = NodeName::new(node).with_context(|| format!("`{text}`"))?;
    let hosts = hosts.split(',').filter(|host| !host.is_empty()).map(String::from).collect();
    Ok(Holder { node, hosts, relays: false })
}

fn summary(args: &Certificates, authority: &Authority, issued: &[Issued]) -> serde_json::Value {
    let issued: Vec<_> = issued
        .iter()
        .map(|it| {
            let security = authority.security(&it.node);
            json!({
                "node": it.node.as_str(), "serial": it.serial, "made": it.is_new,
                "certificate": security.certificate, "key": security.key,
            })
        })
        .collect();
    json!({
        "authority": args.out.join("authority.pem"), "roster": args.out.join("roster.toml"), "issued": issued,
    })
}

fn told(out: &Path, issued: &[Issued], is_new: bool) -> String {
    let mut text = String::new();
    if is_new {
        text += &format!(
            "Made an authority. {} signs for the fleet: keep it here, or away, and on no vehicle.\n",
            out.join("authority.key").display()
        );
    }
    for Issued { node, serial, certificate, is_new } in issued {
        let done = if *is_new { "made" } else { "was there: --renew makes a new one" };
        text += &format!("  {node}, serial {serial}: {} ({done})\n", certificate.display());
    }
    text += "Each host needs authority.pem, roster.toml, and of its own node the .pem and the .key. Nodes read them \
             when they start.\n";
    text
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        certificates: Certificates,
    }

    fn made(folder: &Path, rest: &[&str]) -> anyhow::Result<ExitCode> {
        let line = ["certificates", "--fleet", "demo", "--out", folder.to_str().unwrap()];
        run(&Line::try_parse_from(line.iter().chain(rest))?.certificates, true)
    }

    #[test]
    fn certificates_are_made_once_and_anew_when_they_are_renewed() {
        let folder = tempfile::tempdir().unwrap();
        let read = |file: &str| std::fs::read_to_string(folder.path().join(file)).unwrap();
        assert!(made(folder.path(), &[]).is_err(), "nobody was named");
        made(folder.path(), &["ground/main", "uav/1=10.0.0.11,uav-1.local", "--relay", "router/1"]).unwrap();
        let first = ["authority.pem", "ground-main.pem", "uav-1.pem", "router-1.pem"].map(read);
        assert!(read("roster.toml").contains("relays = [\"router/1\"]"));
        made(folder.path(), &["ground/main", "uav/1"]).unwrap();
        assert_eq!(["authority.pem", "ground-main.pem", "uav-1.pem", "router-1.pem"].map(read), first);
        made(folder.path(), &["--renew", "uav/1"]).unwrap();
        assert_eq!((read("authority.pem"), read("ground-main.pem")), (first[0].clone(), first[1].clone()));
        assert_ne!(read("uav-1.pem"), first[2]);
        assert!(
            read("roster.toml").contains("\"uav/1\" = 2")
                && read("roster.toml").contains("\"ground/main\" = 1")
        );
        made(folder.path(), &["--renew"]).unwrap();
        assert!(
            read("roster.toml").contains("\"uav/1\" = 3")
                && read("roster.toml").contains("\"ground/main\" = 2")
        );
        for bad in ["uav", "uav/1=a b", "uav-1/x=y"] {
            let outcome = made(folder.path(), &[bad]);
            assert_eq!(outcome.is_err(), bad != "uav-1/x=y", "{bad}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn keys_are_for_their_owner_alone() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        made(folder.path(), &["uav/1"]).unwrap();
        for (file, mode) in [("authority.key", 0o600), ("uav-1.key", 0o600)] {
            let rights = std::fs::metadata(folder.path().join(file)).unwrap().permissions().mode();
            assert_eq!(rights & 0o777, mode, "{file}");
        }
    }
}

//! Files that a node keeps from life to life. Damaged ones are set aside.

use std::fs;
use std::time::{Duration, SystemTime};

use skein_bp::script::{Assignment, ScriptFile};
use skein_bp::{Event, EventSet};
use skein_dbp::{Kept, KeptBlock, Roster};
use skein_disk::{ListStore, PromiseStore, next_incarnation};
use skein_wire::{KeptScript, Saving, Store};

use crate::packets::node;
use crate::target::{Allowed, Reached, Target};

pub const TARGET: Target =
    Target { name: "kept", allowed: Allowed { bytes: 64 << 10, per_byte: 300 }, read, seeds };

/// The file's content is taken for each kind of file.
fn read(input: &[u8]) -> Reached {
    let reached = [promises(input), scripts(input), incarnation(input)];
    let rank = |reached: &Reached| {
        [Reached::Refused, Reached::Read, Reached::Planted].iter().position(|r| r == reached)
    };
    reached.into_iter().max_by_key(rank).expect("there are three")
}

fn promises(input: &[u8]) -> Reached {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("uav-1.kept.json");
    fs::write(&path, input).expect("it is written");
    let (mut store, kept) = PromiseStore::open(folder.path(), &node("uav/1"));
    let Ok(kept) = kept else {
        let aside = folder.path().join("uav-1.kept.json.damaged");
        assert_eq!(fs::read(aside).expect("it is set aside"), input);
        return Reached::Refused;
    };
    assert_eq!(store.save(&kept), Saving::Done);
    let (_, again) = PromiseStore::open(folder.path(), &node("uav/1"));
    assert_eq!(again.expect("what was written is read"), kept);
    Reached::read(kept.term == 4 && kept.blocks.is_empty())
}

fn scripts(input: &[u8]) -> Reached {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("uav-1.scripts.json"), input).expect("it is written");
    let (mut store, kept) = ListStore::of_scripts(folder.path(), &node("uav/1"));
    let Ok(kept) = kept else { return Reached::Refused };
    assert_eq!(store.save(&kept), Saving::Done);
    let (_, again) = ListStore::of_scripts(folder.path(), &node("uav/1"));
    assert_eq!(again.expect("what was written is read"), kept);
    Reached::read(kept.len() == 2)
}

fn incarnation(input: &[u8]) -> Reached {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("uav-1.incarnation"), input).expect("it is written");
    let clock = SystemTime::UNIX_EPOCH + Duration::from_secs(1_790_000_000);
    let life = || next_incarnation(folder.path(), &node("uav/1"), 0, clock).expect("the clock is set");
    let (first, second) = (life(), life());
    assert!(first.number <= second.number && second.trouble.is_none());
    assert!(first.number < second.number || first.number == u64::MAX);
    if first.trouble.is_none() { Reached::read(first.number == 8) } else { Reached::Refused }
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let block = KeptBlock {
        node: node("ground/main"),
        incarnation: 4,
        bthread: "curfew".into(),
        sync: 7,
        block: EventSet::from("uav/1/enter").and(EventSet::region([0.0; 3], [f64::INFINITY, 2.0, 3.0])),
    };
    let roster = Some(Roster::first(node("uav/1"), [node("uav/2")]));
    let decisions = vec![Event::new("swarm/launch").with("n", 1)];
    let promises = Kept { blocks: vec![block], roster, term: 1, decisions };
    let script = include_str!("../../../agent/scripts/patrol.toml");
    let script = ScriptFile::parse("patrol.toml", script).expect("our own script");
    let assignment = Assignment { script, with: Default::default(), called: Some("round".into()) };
    let scripts = vec![KeptScript { from: "ground/main#scripts for uav/1".into(), assignment }];
    let folder = tempfile::tempdir().expect("a folder");
    let me = node("uav/1");
    assert_eq!(PromiseStore::open(folder.path(), &me).0.save(&promises), Saving::Done);
    assert_eq!(ListStore::of_scripts(folder.path(), &me).0.save(&scripts), Saving::Done);
    next_incarnation(folder.path(), &me, 0, SystemTime::UNIX_EPOCH + Duration::from_secs(1_790_000_000))
        .expect("a number");
    let file = |name: &str| fs::read(folder.path().join(name)).expect("it was written");
    vec![
        ("promises.json", file("uav-1.kept.json")),
        ("scripts.json", file("uav-1.scripts.json")),
        ("incarnation", file("uav-1.incarnation")),
    ]
}

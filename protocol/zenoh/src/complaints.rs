//! Complaints about useless messages, in a line a second at most.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Duration;

use skein_wire::{NodeLink, NodeName, Owner, SenderStats};

use crate::link::ZenohLink;
use crate::links;

/// Between two lines.
const PERIOD: Duration = Duration::from_secs(1);

/// Looks at what a node could not use, and says so when there is more of it.
#[derive(Debug, Default)]
pub struct Complaints {
    told: [u64; 11],
    told_life: Option<u64>,
    told_versions: BTreeMap<NodeName, u32>,
    due: Duration,
}

impl Complaints {
    /// A line, if there is something new to complain about and the last one is a second ago. Counts are since the
    /// start.
    pub fn check(&mut self, now: Duration, node: &NodeLink, link: &ZenohLink) -> Option<String> {
        if now < self.due {
            return None;
        }
        let (heard, arrived) = (node.stats(), link.stats());
        let senders: Vec<(Option<&NodeName>, SenderStats)> = node.senders().collect();
        let caused =
            |count: fn(&SenderStats) -> u64| senders.iter().map(|(_, stats)| count(stats)).sum::<u64>();
        let counts = [
            heard.undecodable,
            heard.forged,
            arrived.oversized + heard.oversized,
            arrived.misnamed,
            arrived.dropped,
            heard.dropped,
            heard.unsendable,
            heard.strange,
            heard.implausible,
            caused(|stats| stats.caused.facts_withheld),
            caused(|stats| stats.caused.lives_refused),
        ];
        links::note_silent(|name| {
            let mut peers = node.node().peers();
            peers.find(|(peer, _)| *peer == name).map(|(_, peer)| peer.age(now))
        });
        let refused = links::take();
        let outlived = node.node().outlived();
        let versions: BTreeMap<_, _> = node.skewed().map(|(node, version)| (node.clone(), version)).collect();
        if counts == self.told
            && versions == self.told_versions
            && refused.is_empty()
            && outlived.map(|(_, life)| life) == self.told_life
        {
            return None;
        }
        let mut line = String::new();
        let what = [
            "undecodable",
            "under a key that is not their sender's",
            "too long",
            "under strange keys",
            "dropped because the node was too slow",
            "dropped because their sender sends more than its share",
            "of this node's own not sent because they are too long",
            "of nodes outside the roster",
            "states with a radius or speed that nobody has",
            "facts not told because one member caused too many",
            "lives of members that began too often",
        ];
        if counts != self.told {
            let listed: Vec<String> = counts
                .iter()
                .zip(what)
                .filter(|(count, _)| **count > 0)
                .map(|(count, what)| format!("{count} {what}"))
                .collect();
            let _ =
                write!(line, "messages passed over so far: {}{}. ", listed.join(", "), whose(&senders, link));
        }
        for (node, version) in
            versions.iter().filter(|(node, version)| self.told_versions.get(*node) != Some(version))
        {
            let own = skein_wire::VERSION;
            let _ = write!(
                line,
                "{node} speaks version {version} of the messages and this node {own}: update one of them. "
            );
        }
        if let Some((peer, life)) = outlived.filter(|(_, life)| self.told_life != Some(*life)) {
            let (name, own, next) = (node.node().name(), node.node().incarnation(), life.saturating_add(1));
            let _ = write!(
                line,
                "{peer} has heard {name} in life {life}, and hears nothing of this one, life {own}: `state` is not the \
                 folder it was. If no other process has this name, start again with `--incarnation {next}`. "
            );
            self.told_life = Some(life);
        }
        for refusal in refused {
            let _ = write!(line, "{refusal}. ");
        }
        self.told = counts;
        self.told_versions = versions;
        self.due = now + PERIOD;
        (!line.is_empty()).then(|| line.trim_end().to_owned())
    }
}

/// From whom most of it comes: ` (most from uav/9: 1200)`.
fn whose(senders: &[(Option<&NodeName>, SenderStats)], link: &ZenohLink) -> String {
    let mut of: BTreeMap<Owner, u64> = link.dropped();
    for (sender, stats) in senders {
        *of.entry(sender.cloned()).or_default() += stats.passed_over();
    }
    let most = of.into_iter().max_by_key(|(_, count)| *count).filter(|(_, count)| *count > 0);
    most.map_or_else(String::new, |(sender, count)| {
        let name = sender.map_or("nodes outside the roster".to_owned(), |sender| sender.to_string());
        format!(" (most from {name}: {count})")
    })
}

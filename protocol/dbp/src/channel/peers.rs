//! The peers of a node, and which of them live as far as it can tell (G5).

use std::collections::BTreeMap;
use std::time::Duration;

use skein_bp::Bound;

use crate::allowance::Allowance;
use crate::name::NodeName;

/// A life so many after the last one that is known is none: lives are counted one by one, or begin with the time since
/// 1970 in milliseconds, and one false word must not silence it for ever.
pub(crate) const MOST_LIVES_AHEAD: u64 = 1 << 48;

/// A peer, as this node knows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Peer {
    /// Its incarnation, once it has been heard.
    pub incarnation: Option<u64>,
    /// When it was last heard, on this node's clock.
    pub last_word: Option<Duration>,
    /// The time for which it counts as alive without a word.
    pub lease: Duration,
    /// Whether it counts as alive.
    pub alive: bool,
    /// The lives that it has begun, beyond those that a process can begin.
    pub lives_refused: u64,
    lives: Allowance,
    /// Occurrences repeated for it.
    repeats: Allowance,
}

/// The meaning of a word from a peer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Word {
    /// It comes from a life that is over, or from a stranger: it counts for nothing.
    Fenced,
    /// The peer is alive, as it was before.
    Alive,
    /// The peer is back, in the same life.
    Back,
    /// The peer begins a life; another one may have ended unnoticed.
    Born {
        /// Whether the life before was taken to go on.
        was_alive: bool,
    },
}

/// Every other member of the roster.
#[derive(Clone, Debug)]
pub(crate) struct Peers(BTreeMap<NodeName, Peer>);

impl Peers {
    /// Nobody has been heard yet; `lease` counts until a peer has told its own.
    pub(crate) fn new(roster: impl IntoIterator<Item = NodeName>, lease: Duration) -> Self {
        let silent = Peer {
            incarnation: None,
            last_word: None,
            lease,
            alive: false,
            lives_refused: 0,
            lives: Allowance::default(),
            repeats: Allowance::default(),
        };
        Self(roster.into_iter().map(|name| (name, silent.clone())).collect())
    }

    pub(crate) fn name(&self, name: &str) -> Option<&NodeName> {
        self.0.get_key_value(name).map(|(name, _)| name)
    }

    pub(crate) fn names(&self) -> impl Iterator<Item = &NodeName> {
        self.0.keys()
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = (&NodeName, &Peer)> {
        self.0.iter()
    }

    /// Notes a word from `node` in its life `incarnation`.
    pub(crate) fn hear(&mut self, now: Duration, node: &NodeName, incarnation: u64) -> Word {
        let Some(peer) = self.0.get_mut(node) else { return Word::Fenced };
        let known = peer.incarnation.unwrap_or(0);
        if incarnation < known || incarnation - known > MOST_LIVES_AHEAD {
            return Word::Fenced;
        }
        if peer.incarnation != Some(incarnation)
            && !peer.lives.take(now, Bound::LivesPerSecond, Bound::LivesPerSecond)
        {
            peer.lives_refused += 1;
            return Word::Fenced;
        }
        let was_alive = std::mem::replace(&mut peer.alive, true);
        peer.last_word = Some(now);
        if peer.incarnation.replace(incarnation) != Some(incarnation) {
            Word::Born { was_alive }
        } else if was_alive {
            Word::Alive
        } else {
            Word::Back
        }
    }

    pub(crate) fn lives_refused(&self, node: &NodeName) -> u64 {
        self.0.get(node).map_or(0, |peer| peer.lives_refused)
    }

    /// Whether one more occurrence may be repeated for `node`.
    pub(crate) fn may_be_repeated_to(&mut self, now: Duration, node: &NodeName) -> bool {
        let peer = self.0.get_mut(node);
        peer.is_some_and(|peer| peer.repeats.take(now, Bound::RepeatsAtOnce, Bound::RepeatsPerSecond))
    }

    /// The life in which `node` was last heard.
    pub(crate) fn incarnation(&self, node: &NodeName) -> Option<u64> {
        self.0.get(node)?.incarnation
    }

    /// Takes a peer to have been silent since the start of time.
    pub(crate) fn silence(&mut self, node: &NodeName) {
        if let Some(peer) = self.0.get_mut(node) {
            peer.last_word = peer.last_word.map(|_| Duration::ZERO);
        }
    }

    /// Takes over the lease that a peer has announced.
    pub(crate) fn set_lease(&mut self, node: &NodeName, lease: Duration) {
        if let Some(peer) = self.0.get_mut(node) {
            peer.lease = lease;
        }
    }

    /// The peers that count as lost from now on.
    pub(crate) fn take_lost(&mut self, now: Duration) -> Vec<NodeName> {
        let mut lost = Vec::new();
        for (name, peer) in &mut self.0 {
            if peer.alive && peer.silent_at().is_some_and(|at| now >= at) {
                peer.alive = false;
                lost.push(name.clone());
            }
        }
        lost
    }

    /// When the next one counts as lost if it stays silent.
    pub(crate) fn next_deadline(&self) -> Option<Duration> {
        self.0.values().filter(|peer| peer.alive).filter_map(Peer::silent_at).min()
    }
}

impl Peer {
    /// The time since it was last heard.
    pub fn age(&self, now: Duration) -> Option<Duration> {
        self.last_word.map(|at| now.saturating_sub(at))
    }

    fn silent_at(&self) -> Option<Duration> {
        self.last_word.map(|at| at + self.lease)
    }
}

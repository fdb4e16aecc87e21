//! A node's board: every bid on its table, for whoever asks why something happens or does not.

use std::time::Duration;

use skein_bp::{Bid, Event, EventSet, Value};

use crate::NodeName;

/// What all b-threads bid at a node at one moment, those elsewhere that have a say here included.
///
/// It is for people, and for programs that explain to people: nothing is decided by it. So that it stays small it is cut
/// to the quotas below, and says so.
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    /// The node.
    pub node: NodeName,
    /// Its incarnation.
    pub incarnation: u64,
    /// When, on the node's clock.
    pub at: Duration,
    /// The node's own b-threads by name, then those elsewhere.
    pub rows: Vec<BoardRow>,
    /// How many rows there was no room for.
    pub left_out: u32,
}

/// What one b-thread bids.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardRow {
    /// The b-thread: `navigation`, or `ground/main#hold` for one elsewhere.
    pub bthread: String,
    /// What it requests, and who blocks that.
    pub requests: Vec<BoardRequest>,
    /// What it waits for; not known of b-threads elsewhere.
    pub waits: EventSet,
    /// What it blocks.
    pub blocks: EventSet,
    /// What ends it; not known of b-threads elsewhere.
    pub interrupts: EventSet,
    /// The priority of its requests.
    pub priority: Option<i32>,
    /// When it goes on by itself, on the node's clock.
    pub deadline: Option<Duration>,
    /// Of one elsewhere: the lease that its bid here has.
    pub lease: Option<BoardLease>,
    /// Whether there was no room for all of it.
    pub cut: bool,
}

/// One request on a board.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardRequest {
    /// The event.
    pub event: Event,
    /// Who blocks it here, by name. An event of this home that nobody blocks may be selected.
    pub blocked_by: Vec<String>,
}

/// The lease of a remote bid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardLease {
    /// How long ago the bid was renewed.
    pub age: Duration,
    /// After what age it lapses.
    pub length: Duration,
}

impl Board {
    /// Rows.
    pub const MAX_ROWS: usize = 128;
    /// Requests in a row, and blockers of a request.
    pub const MAX_REQUESTS: usize = 16;
    /// Alternatives in one of a row's sets, and the terms of each of them.
    pub const MAX_TERMS: usize = 32;
    /// Bytes in a name or in a text of an event.
    pub const MAX_TEXT: usize = 160;

    /// A board of these rows, cut to the quotas.
    #[must_use]
    pub fn new(node: NodeName, incarnation: u64, at: Duration, rows: Vec<BoardRow>) -> Self {
        let left_out = u32::try_from(rows.len().saturating_sub(Self::MAX_ROWS)).unwrap_or(u32::MAX);
        let rows = rows.into_iter().take(Self::MAX_ROWS).map(BoardRow::cut_to_quotas).collect();
        Self { node, incarnation, at, rows, left_out }
    }

    /// What a b-thread of this name bids here.
    #[must_use]
    pub fn row(&self, bthread: &str) -> Option<&BoardRow> {
        self.rows.iter().find(|row| row.bthread == bthread)
    }

    /// Whether this says the same as an `earlier` one, but for the time that has passed.
    #[must_use]
    pub fn repeats(&self, earlier: &Self) -> bool {
        (&self.node, self.incarnation, self.left_out)
            == (&earlier.node, earlier.incarnation, earlier.left_out)
            && self.rows.len() == earlier.rows.len()
            && self.rows.iter().zip(&earlier.rows).all(|(row, before)| row.repeats(before))
    }

    /// Whether the same requests as on an `earlier` one are blocked, by the same b-threads.
    #[must_use]
    pub fn stalls_as(&self, earlier: &Self) -> bool {
        self.blocked().eq(earlier.blocked())
    }

    fn blocked(&self) -> impl Iterator<Item = (&str, &BoardRequest)> {
        let requests =
            self.rows.iter().flat_map(|row| row.requests.iter().map(|request| (&*row.bthread, request)));
        requests.filter(|(_, request)| !request.blocked_by.is_empty())
    }
}

impl BoardRow {
    /// The row of a b-thread at its own node; `blockers` gives who blocks an event there.
    #[must_use]
    pub fn new(bthread: impl Into<String>, bid: &Bid, blockers: impl Fn(&Event) -> Vec<String>) -> Self {
        let request = |event: &Event| BoardRequest { event: event.clone(), blocked_by: blockers(event) };
        Self {
            bthread: bthread.into(),
            requests: bid.requests().iter().map(request).collect(),
            waits: bid.waits().clone(),
            blocks: bid.blocks().clone(),
            interrupts: bid.interrupts().clone(),
            priority: bid.given_priority(),
            deadline: bid.given_deadline(),
            lease: None,
            cut: false,
        }
    }

    fn repeats(&self, earlier: &Self) -> bool {
        let length = |row: &Self| row.lease.map(|lease| lease.length);
        (&self.bthread, &self.requests, self.priority, self.deadline, self.cut, length(self))
            == (
                &earlier.bthread,
                &earlier.requests,
                earlier.priority,
                earlier.deadline,
                earlier.cut,
                length(earlier),
            )
            && (&self.waits, &self.blocks, &self.interrupts)
                == (&earlier.waits, &earlier.blocks, &earlier.interrupts)
    }

    fn cut_to_quotas(mut self) -> Self {
        let mut cut = self.cut;
        cut |= shorten(&mut self.bthread);
        cut |= truncate(&mut self.requests);
        for request in &mut self.requests {
            cut |= truncate(&mut request.blocked_by);
            for blocker in &mut request.blocked_by {
                cut |= shorten(blocker);
            }
            cut |= shorten_event(&mut request.event);
        }
        for set in [&mut self.waits, &mut self.blocks, &mut self.interrupts] {
            cut |= shorten_set(set);
        }
        Self { cut, ..self }
    }
}

fn truncate<T>(list: &mut Vec<T>) -> bool {
    let long = list.len() > Board::MAX_REQUESTS;
    list.truncate(Board::MAX_REQUESTS);
    long
}

/// Cuts a text that is too long; says whether it was.
pub(crate) fn shorten(text: &mut String) -> bool {
    let long = text.len() > Board::MAX_TEXT;
    if long {
        *text = shortened(text);
    }
    long
}

/// The beginning of a text that is too long, and a mark that it is.
fn shortened(text: &str) -> String {
    let end = (0..=Board::MAX_TEXT - '…'.len_utf8()).rev().find(|end| text.is_char_boundary(*end));
    format!("{}…", text.get(..end.unwrap_or_default()).unwrap_or_default())
}

fn is_long(event: &Event) -> bool {
    let long = |text: &str| text.len() > Board::MAX_TEXT;
    let datum = |(key, value): (&str, &Value)| long(key) || matches!(value, Value::Text(text) if long(text));
    long(event.name()) || event.data().len() > Board::MAX_REQUESTS || event.data().any(datum)
}

fn shorten_event(event: &mut Event) -> bool {
    if !is_long(event) {
        return false;
    }
    let mut name = event.name().to_owned();
    shorten(&mut name);
    *event = event.data().take(Board::MAX_REQUESTS).fold(Event::new(name), |short, (key, value)| {
        let mut key = key.to_owned();
        shorten(&mut key);
        match value {
            Value::Text(text) if text.len() > Board::MAX_TEXT => short.with(key, shortened(text)),
            value => short.with(key, value.clone()),
        }
    });
    true
}

/// Leaves out alternatives beyond the quota, and any whose terms are too many or too long.
fn shorten_set(set: &mut EventSet) -> bool {
    let fits = |set: &EventSet| {
        let mut terms = Board::MAX_TERMS;
        has_room(set, &mut terms)
    };
    match set {
        EventSet::Or(alternatives) => {
            let before = alternatives.len();
            alternatives.retain(fits);
            alternatives.truncate(Board::MAX_TERMS);
            alternatives.len() < before
        }
        set if fits(set) => false,
        set => {
            *set = EventSet::None;
            true
        }
    }
}

/// Whether there is room for a set among so many `terms` more.
fn has_room(set: &EventSet, terms: &mut usize) -> bool {
    let Some(left) = terms.checked_sub(1) else { return false };
    *terms = left;
    match set {
        EventSet::None | EventSet::All | EventSet::Region { .. } => true,
        EventSet::Exactly(event) => !is_long(event),
        EventSet::Named(pattern) => pattern.as_str().len() <= Board::MAX_TEXT,
        EventSet::Prefix(prefix) => prefix.len() <= Board::MAX_TEXT,
        EventSet::FieldRange { key, .. } => key.len() <= Board::MAX_TEXT,
        EventSet::FieldIs(fields) => {
            let event = fields
                .iter()
                .fold(Event::new(""), |event, (key, value)| event.with(key.clone(), value.clone()));
            !is_long(&event)
        }
        EventSet::Not(set) => has_room(set, terms),
        EventSet::And(sets) | EventSet::Or(sets) => sets.iter().all(|set| has_room(set, terms)),
    }
}

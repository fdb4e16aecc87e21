//! A node's board: every bid on its table, for whoever asks why something happens or does not.

use std::time::Duration;

use skein_bp::{Bid, Event, EventSet, Value};

use crate::name::NodeName;

/// The bids of all b-threads at a node at one moment, those elsewhere that have a say here included.
///
/// It is for people, and for programs that explain to people: nothing is decided by it. So that it stays small it is
/// cut to the quotas below, and says so.
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    pub node: NodeName,
    pub incarnation: u64,
    /// When, on the node's clock.
    pub at: Duration,
    /// The node's own b-threads by name, then those elsewhere.
    pub rows: Vec<BoardRow>,
    /// The number of rows for which there was no room.
    pub left_out: u32,
}

/// The bid of one b-thread.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardRow {
    /// The b-thread: `navigation`, or `ground/main#hold` for one elsewhere.
    pub bthread: String,
    /// Its requests, and who blocks them.
    pub requests: Vec<BoardRequest>,
    /// The events it waits for; not known of b-threads elsewhere.
    pub waits: EventSet,
    pub blocks: EventSet,
    /// The events that end it; not known of b-threads elsewhere.
    pub interrupts: EventSet,
    /// The statements that hold meanwhile.
    pub states: Vec<Event>,
    /// The priority of its requests.
    pub priority: Option<i32>,
    /// When it goes on by itself, on the node's clock.
    pub deadline: Option<Duration>,
    /// Of one elsewhere: the lease that its bid here has.
    pub lease: Option<BoardLease>,
    /// Whether there was no room for all of it.
    pub cut: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub struct BoardRequest {
    pub event: Event,
    /// The b-threads that block it here. An event of this home that nobody blocks may be selected.
    pub blocked_by: Vec<String>,
}

/// The lease of a remote bid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardLease {
    /// The time since the bid was renewed.
    pub age: Duration,
    /// After what age it lapses.
    pub length: Duration,
}

impl Board {
    pub const MAX_ROWS: usize = 128;
    /// Requests in a row, and blockers of a request.
    pub const MAX_REQUESTS: usize = 16;
    /// Bytes in a name or in a text of an event.
    pub const MAX_TEXT: usize = 160;
    /// Bytes in one of a row's sets, about.
    pub const MAX_SET: usize = 2 << 10;
    /// Bytes in all, about.
    pub const MAX_SIZE: usize = 128 << 10;

    /// A board of these rows, cut to the quotas.
    pub fn new(node: NodeName, incarnation: u64, at: Duration, rows: Vec<BoardRow>) -> Self {
        let (given, mut room) = (rows.len(), Self::MAX_SIZE);
        let fits = |row: BoardRow| {
            let (row, size) = row.cut_to_quotas();
            room = room.checked_sub(size)?;
            Some(row)
        };
        let rows: Vec<BoardRow> = rows.into_iter().take(Self::MAX_ROWS).map_while(fits).collect();
        let left_out = u32::try_from(given - rows.len()).unwrap_or(u32::MAX);
        Self { node, incarnation, at, rows, left_out }
    }

    /// The bid of a b-thread of this name here.
    pub fn row(&self, bthread: &str) -> Option<&BoardRow> {
        self.rows.iter().find(|row| row.bthread == bthread)
    }

    /// Whether this says the same as an `earlier` one, but for the time that has passed.
    pub fn repeats(&self, earlier: &Self) -> bool {
        (&self.node, self.incarnation, self.left_out)
            == (&earlier.node, earlier.incarnation, earlier.left_out)
            && self.rows.len() == earlier.rows.len()
            && self.rows.iter().zip(&earlier.rows).all(|(row, before)| row.repeats(before))
    }

    /// Whether the same requests as on an `earlier` one are blocked, by the same b-threads.
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
    pub fn new(bthread: impl Into<String>, bid: &Bid, blockers: impl Fn(&Event) -> Vec<String>) -> Self {
        let request = |event: &Event| BoardRequest { event: event.clone(), blocked_by: blockers(event) };
        Self {
            bthread: bthread.into(),
            requests: bid.requests().iter().map(request).collect(),
            waits: plain(bid.waits()),
            blocks: plain(bid.blocks()),
            interrupts: plain(bid.interrupts()),
            states: bid.stated().to_vec(),
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
            && (&self.waits, &self.blocks, &self.interrupts, &self.states)
                == (&earlier.waits, &earlier.blocks, &earlier.interrupts, &earlier.states)
    }

    /// As much of the row as there is room for, and about how many bytes that is.
    fn cut_to_quotas(mut self) -> (Self, usize) {
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
        cut |= truncate(&mut self.states);
        for stated in &mut self.states {
            cut |= shorten_event(stated);
        }
        for set in [&mut self.waits, &mut self.blocks, &mut self.interrupts] {
            cut |= shorten_set(set);
        }
        let requests = self.requests.iter().map(|request| {
            size_of_event(&request.event) + request.blocked_by.iter().map(String::len).sum::<usize>()
        });
        let sets = [&self.waits, &self.blocks, &self.interrupts].into_iter().map(size_of_set);
        let states = self.states.iter().map(size_of_event);
        let size = self.bthread.len() + requests.chain(states).sum::<usize>() + sets.sum::<usize>();
        (Self { cut, ..self }, size)
    }
}

fn truncate<T>(list: &mut Vec<T>) -> bool {
    let long = list.len() > Board::MAX_REQUESTS;
    list.truncate(Board::MAX_REQUESTS);
    long
}

/// Cuts a text that is too long; says whether it was.
pub(crate) fn shorten(text: &mut String) -> bool {
    shorten_to(text, Board::MAX_TEXT)
}

/// Cuts a text that is longer than so many bytes; says whether it was.
pub(crate) fn shorten_to(text: &mut String, most: usize) -> bool {
    let long = text.len() > most;
    if long {
        *text = shortened(text, most);
    }
    long
}

/// The beginning of a text that is too long, and a mark that it is.
pub fn shortened(text: &str, most: usize) -> String {
    let end = (0..=most.saturating_sub('…'.len_utf8())).rev().find(|end| text.is_char_boundary(*end));
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
            Value::Text(text) if text.len() > Board::MAX_TEXT => {
                short.with(key, shortened(text, Board::MAX_TEXT))
            }
            value => short.with(key, value.clone()),
        }
    });
    true
}

/// Leaves out the alternatives that there is no room for.
fn shorten_set(set: &mut EventSet) -> bool {
    if set.check_bounds().is_err() {
        *set = EventSet::None;
        return true;
    }
    if size_of_set(set) <= Board::MAX_SET {
        return false;
    }
    match set {
        EventSet::Or(alternatives) => {
            let mut room = Board::MAX_SET;
            alternatives.retain(|set| {
                let left = room.checked_sub(size_of_set(set));
                room = left.unwrap_or(room);
                left.is_some()
            });
        }
        _ => *set = EventSet::None,
    }
    *set = plain(set);
    true
}

/// The set; if it surely holds nothing, that in one word.
fn plain(set: &EventSet) -> EventSet {
    if set.is_none() { EventSet::None } else { set.clone() }
}

/// About how many bytes a set is on the wire.
pub(crate) fn size_of_set(set: &EventSet) -> usize {
    const FORM: usize = 4;
    FORM + match set {
        EventSet::None | EventSet::All => 0,
        EventSet::Exactly(event) => size_of_event(event),
        EventSet::Named(pattern) => pattern.as_str().len(),
        EventSet::Prefix(prefix) => prefix.len(),
        EventSet::FieldRange { key, .. } => key.len() + 16,
        EventSet::FieldIs(fields) => fields.iter().map(|(key, value)| size_of_datum(key, value)).sum(),
        EventSet::Region { .. } => 48,
        EventSet::Not(set) => size_of_set(set),
        EventSet::And(sets) | EventSet::Or(sets) => sets.iter().map(size_of_set).sum(),
    }
}

pub(crate) fn size_of_event(event: &Event) -> usize {
    event.name().len() + event.data().map(|(key, value)| size_of_datum(key, value)).sum::<usize>()
}

fn size_of_datum(key: &str, value: &Value) -> usize {
    const NUMBER: usize = 12;
    key.len() + if let Value::Text(text) = value { text.len() } else { NUMBER }
}

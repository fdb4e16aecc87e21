//! The bounds on what one member of a fleet can make another one do or keep.
//!
//! This is the one place that states them, each with its unit and its reason; `docs/security-bounds.md` quotes it, and a
//! test holds the two against each other. A campaign takes one away at a time (feature `mutants`) and must see the harm.

use std::fmt;

macro_rules! bounds {
    ($($name:ident = $word:literal, $most:expr, $unit:literal, $reason:literal;)+) => {
        /// A bound on what one member can make another one do or keep.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Bound {
            $(#[doc = $reason] $name),+
        }

        impl Bound {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$name),+];

            /// Its name, for people and files: `set_depth`.
            pub const fn word(self) -> &'static str {
                match self { $(Self::$name => $word),+ }
            }

            pub const fn unit(self) -> &'static str {
                match self { $(Self::$name => $unit),+ }
            }

            pub const fn reason(self) -> &'static str {
                match self { $(Self::$name => $reason),+ }
            }

            /// The most that is let through, in its unit, whether or not it is taken away.
            pub const fn stated(self) -> usize {
                match self { $(Self::$name => $most),+ }
            }
        }
    };
}

bounds! {
    // Event sets and events.
    SetDepth = "set_depth", 16, "levels of sets inside one another",
        "A walk goes as deep as the set; nobody writes more than five levels.";
    SetNodes = "set_nodes", 2048, "sets in one set",
        "What a home honours of a record's blocks, joined with what it keeps of a former life.";
    AskedDepth = "asked_depth", 12, "levels of sets inside one another in a block of a record",
        "What a home honours of it has up to four more.";
    SetSteps = "set_steps", 16, "pairs of sets looked at for each set inside two that are compared",
        "To compare two sets can take a power of both; who is not done by then answers no, which is the safe answer.";
    SetWalk = "set_walk", 1, "visits of each set inside another in one walk",
        "A walk that visits the sets of an intersection twice takes twice as long for each level.";
    NameBytes = "name_bytes", 256, "bytes of a name of an event, a b-thread or a field, or of a pattern",
        "Names are compared, kept and told to all.";
    NameChunks = "name_chunks", 16, "chunks of a name or pattern",
        "A pattern with stars is tried at each chunk of a name.";
    EventFields = "event_fields", 32, "data of an event, or fields that a set asks for",
        "They are searched one after another; the most that is declared is 8.";
    EventBytes = "event_bytes", 32 << 10, "bytes of an event, name and data",
        "A script of 16 KiB is sent as one text of an event.";
    // Messages.
    PresenceBytes = "presence_bytes", 1 << 10, "bytes of a sign of life or a wish for repair",
        "They are of fixed form, some 100 bytes.";
    StateBytes = "state_bytes", 16 << 10, "bytes of a state",
        "32 points, 8 names and 3 texts are some 3 KiB.";
    BidBytes = "bid_bytes", 64 << 10, "bytes of a record of bids, or of its acknowledgement",
        "256 bids of 250 bytes; a home reads it in a few milliseconds at most.";
    OccurrenceBytes = "occurrence_bytes", 192 << 10, "bytes of an occurrence",
        "An event, and the names of those who asked for it.";
    BoardBytes = "board_bytes", 256 << 10, "bytes of a board, or of a vehicle's checks",
        "A board is cut to 128 KiB by whoever sends it.";
    SceneBytes = "scene_bytes", 512 << 10, "bytes of a scene",
        "4096 bodies are 450 KB, and more of one member may not wait; only ground stations listen.";
    ScanBytes = "scan_bytes", 32 << 10, "bytes of a scan",
        "4096 rays are 16 KiB.";
    RecordBids = "record_bids", 512, "bids of one record",
        "Those beyond the ones that a home honours are refused one by one.";
    RecordRequests = "record_requests", 128, "requests of one record",
        "Each is looked at whenever the home selects.";
    RecordNodes = "record_nodes", 1024, "sets in all blocks of one record",
        "Each may be looked at whenever the home selects. A hold of 300 vehicles by name has 900.";
    HonouredBids = "honoured_bids", 256, "bids of one member that a home honours, those kept of its former lives included",
        "Each stands in the home's program as a proxy.";
    BidRequests = "bid_requests", 64, "requests of one bid that a home honours",
        "One of them is to happen.";
    ListItems = "list_items", 4096, "refusals of an acknowledgement",
        "A record has 512 bids, and few are refused for more than one reason.";
    NamesServed = "names_served", 256, "requests that an occurrence has served, or b-threads that asked for it",
        "As many as one member's bids; further ones are left out by whoever sends.";
    TextBytes = "text_bytes", 512, "bytes of a text for people in a state or a check",
        "It is shown in a line or two.";
    // Waiting messages.
    WaitingMessages = "waiting_messages", 512, "messages of one member that wait",
        "As many as one repair brings; of more, its oldest go.";
    WaitingBytes = "waiting_bytes", 512 << 10, "bytes of one member's messages that wait",
        "What it sends in a fifth of a second at its full share; of more, its oldest go.";
    WaitingInAll = "waiting_in_all", 8 << 20, "bytes of all messages that wait",
        "Beyond it, whoever has most waiting loses its oldest.";
    WaitingSenders = "waiting_senders", 64, "nodes outside the roster with a queue of their own",
        "Names are free where there is no security; all further ones share a queue.";
    TickBytes = "tick_bytes", 64 << 10, "bytes of one member's messages taken in each 20 ms, and 512 more for each message",
        "To read and follow them takes some 2 ms, a tenth of a tick; the rest waits. Nodes outside the roster share one share.";
    // What a node keeps and tells.
    LivesPerSecond = "lives_per_second", 5, "new lives of one member in a second, and as many at once",
        "Each resets what is known of it, and is told to all; a process takes longer to start.";
    FactsAtOnce = "facts_at_once", 64, "facts told at once because of one member",
        "Each is an occurrence that is told to all and kept. The rest is counted and not told.";
    FactsPerSecond = "facts_per_second", 32, "facts told in a second because of one member, beyond those at once",
        "As for those at once.";
    RecordDenials = "record_denials", 1, "facts about what a home does not honour of one record",
        "It says how many more there are; the acknowledgement lists all for the bidder.";
    StallsNoted = "stalls_noted", 4, "b-threads of one member that are noted as blocking one event",
        "Each is told to all when it begins to.";
    RepeatsAtOnce = "repeats_at_once", 1024, "occurrences repeated at once for one member",
        "A wish of 100 bytes brings up to 64 of them.";
    RepeatsPerSecond = "repeats_per_second", 1024, "occurrences repeated in a second for one member, beyond those at once",
        "As for those at once.";
    BoardRows = "board_rows", 16, "b-threads of one other member on a board",
        "A board has 128 rows for all.";
    PendingOccurrences = "pending_occurrences", 1024, "occurrences of one home that wait behind a hole",
        "Those further ahead are asked for again.";
    PendingBytes = "pending_bytes", 512 << 10, "bytes of those",
        "1024 occurrences of common size.";
    HistoryBytes = "history_bytes", 4 << 20, "bytes of own occurrences kept for repair",
        "1024 of common size are 0.3 MB; who requests long events must not fill the memory.";
    EndedNames = "ended_names", 1024, "names of ended b-threads whose synchronisation points are known",
        "Names of scripts are free; those of all others go on from the greatest that was forgotten.";
    // Vehicles.
    Strangers = "strangers", 16, "vehicles heard of where there is no roster",
        "Where there is one, its members alone are heard. First come, first kept; one silent for 45 s makes room.";
    RadiusMetres = "radius_m", 5, "m, the radius that a neighbour is believed",
        "The largest multicopters span 4 m. Who claims more is kept away from as if it were so large.";
    SigmaMetres = "sigma_m", 4, "m, the standard deviation of a position that a neighbour is believed",
        "Who knows less of its place lands; the separation widens by 4 m at most anyway.";
    SpeedMetresPerSecond = "speed_m_s", 50, "m/s, the speed that a neighbour is believed",
        "Twice what multicopters fly.";
    PlaceMetres = "place_m", 1_000_000, "m, a coordinate of a place in the world",
        "Beyond it the world's plane is no map; numbers near the largest would make sums infinite.";
    // Scripts.
    ScriptNodes = "script_nodes", 4096, "sets in all synchronisation points of a script",
        "Each is looked at in each state that a trial visits.";
    ScriptBytes = "script_bytes", 256 << 10, "bytes of a script whose parameters are filled in",
        "Sixteen times as many as it may have in its file.";
    ScriptEvents = "script_events", 256, "events in, and beside, what a script blocks, and as many of what it waits for, with which it is tried",
        "Each may happen in each state that a trial visits.";
}

impl Bound {
    /// The most that is let through, in its unit.
    #[inline]
    pub fn most(self) -> usize {
        #[cfg(feature = "mutants")]
        if mutants::is_removed(self) {
            return usize::MAX;
        }
        self.stated()
    }

    /// The same as a number with a point.
    #[inline]
    pub fn most_real(self) -> f64 {
        #[cfg(feature = "mutants")]
        if mutants::is_removed(self) {
            return f64::MAX;
        }
        self.stated() as f64
    }

    /// Lets `given` through if it is within the bound.
    ///
    /// # Errors
    /// [`Exceeded`], which names the bound.
    pub fn check(self, given: usize) -> Result<(), Exceeded> {
        if given <= self.most() { Ok(()) } else { Err(Exceeded { bound: self, given }) }
    }
}

/// More of something than is let through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exceeded {
    pub bound: Bound,
    pub given: usize,
}

impl fmt::Display for Exceeded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { bound, given } = self;
        write!(f, "{given} {}: expected at most {} (bound `{}`)", bound.unit(), bound.stated(), bound.word())
    }
}

impl std::error::Error for Exceeded {}

/// Bounds taken away on purpose, and the work that this lets through, each for the thread that asks.
#[cfg(feature = "mutants")]
pub mod mutants {
    use std::cell::Cell;

    use super::Bound;

    thread_local! {
        static REMOVED: Cell<Option<Bound>> = const { Cell::new(None) };
        static NODES: Cell<u64> = const { Cell::new(0) };
    }

    /// While it lives, a bound does not hold in this thread.
    #[derive(Debug)]
    pub struct Removed(Option<Bound>);

    impl Bound {
        /// Takes the bound away in this thread, in the place of any other, until what is returned is dropped.
        #[must_use]
        pub fn remove(self) -> Removed {
            Removed(REMOVED.replace(Some(self)))
        }
    }

    impl Drop for Removed {
        fn drop(&mut self) {
            REMOVED.set(self.0);
        }
    }

    pub(super) fn is_removed(bound: Bound) -> bool {
        REMOVED.get() == Some(bound)
    }

    /// Counts a set that is looked at.
    pub(crate) fn count_node() {
        NODES.set(NODES.get() + 1);
    }

    /// The sets that were looked at in this thread so far.
    pub fn nodes() -> u64 {
        NODES.get()
    }
}

/// Counts a set that is looked at, where somebody reads the count.
#[inline]
pub(crate) fn count_node() {
    #[cfg(feature = "mutants")]
    mutants::count_node();
}

#[cfg(test)]
mod tests {
    use super::Bound;

    const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/security-bounds.md");

    #[test]
    fn the_page_states_all_bounds_as_they_are() {
        let row = |bound: &Bound| {
            format!("| `{}` | {} | {} | {} |", bound.word(), bound.stated(), bound.unit(), bound.reason())
        };
        let rows: Vec<String> = Bound::ALL.iter().map(row).collect();
        let table = format!("| bound | most | of | why |\n|---|---|---|---|\n{}\n", rows.join("\n"));
        let page = std::fs::read_to_string(PAGE).unwrap();
        let (before, rest) = page.split_once("<!-- bounds -->\n").unwrap();
        let (stated, after) = rest.split_once("<!-- end of bounds -->").unwrap();
        if std::env::var_os("SKEIN_WRITE_GENERATED").is_some() {
            let page = format!("{before}<!-- bounds -->\n{table}<!-- end of bounds -->{after}");
            std::fs::write(PAGE, page).unwrap();
        } else {
            assert_eq!(stated, table, "SKEIN_WRITE_GENERATED=1 writes it anew");
        }
    }

    #[test]
    fn an_error_names_the_bound() {
        let error = Bound::SetDepth.check(46).unwrap_err().to_string();
        assert_eq!(error, "46 levels of sets inside one another: expected at most 16 (bound `set_depth`)");
        assert_eq!(Bound::SetDepth.check(16), Ok(()));
    }

    #[cfg(feature = "mutants")]
    #[test]
    fn a_bound_is_away_only_as_long_as_it_is_taken_away() {
        let removed = Bound::SetDepth.remove();
        assert_eq!((Bound::SetDepth.check(46), Bound::SetNodes.most()), (Ok(()), Bound::SetNodes.stated()));
        drop(removed);
        assert!(Bound::SetDepth.check(46).is_err());
    }
}

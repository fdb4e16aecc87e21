//! The chain of b-threads that keep a vehicle from moving.

use std::collections::BTreeSet;

use skein_bp::EventSet;
use skein_dbp::{Board, BoardLease, BoardRequest, BoardRow, Happened, NodeName, first_two_chunks};
use skein_wire::MissionState;
use skein_wire::event::{
    Advance, Declared as _, Enter, Events as _, Goto, Homeward, Ready, Takeoff, Unready,
};

use super::evidence::Evidence;
use super::explanation::Change;
use super::party::Party;
use super::waits;
use crate::bthreads::{Hold, Launch};

/// Reasons that are given.
const MOST_CHANGES: usize = 8;
/// B-threads in a chain that are followed.
const LONGEST_CHAIN: usize = 8;
/// Of those who block one request, and of the requests that one waits for, so many are followed.
const MOST_FOLLOWED: usize = 4;
/// B-threads that are asked in all: boards may be as tangled as those who bid like.
const MOST_ASKED: usize = 256;
/// The requests that a standing vehicle lacks first; others come after these.
type First = (Advance, Homeward, Enter, Takeoff, Goto);

/// Follows who waits for whom, from one vehicle on.
pub(super) struct Inquiry<'a> {
    evidence: &'a Evidence,
    vehicle: &'a NodeName,
    /// The chain of b-threads that wait for one another, so far.
    path: Vec<Party>,
    /// The same in sentences.
    because: Vec<String>,
    /// The b-threads whose reasons have been given.
    asked: BTreeSet<Party>,
    /// The number of b-threads that may still be asked.
    left: usize,
    changes: Vec<Change>,
}

/// A request somewhere, and where it is decided.
struct Found<'a> {
    home: &'a Board,
    by: Party,
    request: &'a BoardRequest,
}

impl<'a> Inquiry<'a> {
    pub(super) fn new(evidence: &'a Evidence, vehicle: &'a NodeName) -> Self {
        Self {
            evidence,
            vehicle,
            path: Vec::new(),
            because: Vec::new(),
            asked: BTreeSet::new(),
            left: MOST_ASKED,
            changes: Vec::new(),
        }
    }

    /// Every reason that is known for which the vehicle stands still.
    pub(super) fn what_would_move_it(mut self) -> Vec<Change> {
        let Some(board) = self.board(self.vehicle) else { return Vec::new() };
        if let Some(contradiction) = super::limits(board).contradiction() {
            self.say(vec![contradiction], vec!["one of them gives way".to_owned()]);
        }
        let mut blocked: Vec<(&BoardRow, &BoardRequest)> = board
            .rows
            .iter()
            .flat_map(|row| row.requests.iter().map(move |request| (row, request)))
            .filter(|(_, request)| !request.blocked_by.is_empty())
            .collect();
        let rank =
            |request: &BoardRequest| First::NAMES.iter().position(|kind| *kind == request.event.kind());
        blocked.sort_by_key(|(_, request)| rank(request).unwrap_or(First::NAMES.len()));
        for (row, request) in blocked {
            let by = Party::read(&board.node, &row.bthread);
            // Who stands in the way of a move has been asked already.
            if self.asked.insert(by.clone()) {
                self.path.push(by.clone());
                self.follow_blockers(&Found { home: board, by, request });
                self.path.pop();
            }
        }
        if self.changes.is_empty() {
            self.ask_who_would_move_it(board);
        }
        self.changes
    }

    /// Nothing that is requested is blocked: who would have to request something?
    fn ask_who_would_move_it(&mut self, board: &'a Board) {
        let state = self
            .evidence
            .vehicle(self.vehicle)
            .and_then(|known| known.state.as_ref())
            .map(|noted| &noted.what);
        let mission = state.map(|state| (state.mission, state.armed)).unwrap_or_default();
        match mission {
            (MissionState::Complete, false) => {
                self.say(vec!["its mission is complete, and it is on the ground".to_owned()], Vec::new());
            }
            (MissionState::Failed, false) => {
                let why = state.map(|state| state.task.as_str()).unwrap_or_default();
                self.say(vec![format!("its mission has failed, and it is on the ground: {why}")], Vec::new());
            }
            (_, false) => self.ask_who_would_launch_it(board),
            (_, true) => self.ask_its_movers(board),
        }
    }

    fn ask_who_would_launch_it(&mut self, board: &'a Board) {
        let takeoff = Takeoff.at(self.vehicle);
        let mut rows = self.evidence.boards().flat_map(|board| &board.rows);
        if rows.any(|row| row.requests.iter().any(|request| request.event == takeoff)) {
            let because = format!("`{}` is requested, and nobody is known to block it", takeoff.name());
            return self.say(vec![because], vec!["it takes the request in".to_owned()]);
        }
        let mut lack = format!("nobody requests `{}`", takeoff.name());
        let waiting = board.rows.iter().find(|row| row.waits.contains(&takeoff));
        if let Some(row) = waiting {
            lack.push_str(&format!(", which {} waits for", row.bthread));
        }
        let stations = self.evidence.boards().filter(|board| board.row(Launch::NAME).is_some());
        let stations = stations.map(|board| Party::read(&board.node, Launch::NAME));
        let launchers: BTreeSet<Party> = self.evidence.launchers().cloned().chain(stations).collect();
        for launcher in launchers.iter().take(MOST_FOLLOWED) {
            self.because.push(lack.clone());
            self.because.push(format!("{} would", self.name(launcher)));
            self.go_on(launcher, None);
            self.because.clear();
        }
        if self.changes.is_empty() {
            self.say(vec![lack], vec!["somebody requests it".to_owned()]);
        }
    }

    /// In the air, without a request that is blocked: what do those wait for who have asked for its moves before?
    fn ask_its_movers(&mut self, board: &'a Board) {
        let known = self.evidence.vehicle(self.vehicle);
        let movers: Vec<&BoardRow> = known
            .iter()
            .flat_map(|known| &known.movers)
            .filter_map(|mover| board.row(mover))
            .filter(|row| !(row.waits.is_none() && row.requests.is_empty()))
            .collect();
        // Before its first move, all are asked.
        let rows = if movers.is_empty() { board.rows.iter().collect() } else { movers };
        for row in rows {
            self.because.push("nothing that would move it is blocked".to_owned());
            self.because.push(format!("{} waits", row.bthread));
            self.go_on(&Party::read(&board.node, &row.bthread), None);
            self.because.clear();
        }
    }

    /// Somebody's request is blocked: what would let the blockers go?
    fn follow_blockers(&mut self, found: &Found<'a>) {
        let Found { home, by, request } = found;
        for name in request.blocked_by.iter().take(MOST_FOLLOWED) {
            let blocker = Party::read(&home.node, name);
            let lease = home.row(name).and_then(|row| row.lease);
            let renewed = lease.map(|lease| format!(", renewed {:.1} s ago", lease.age.as_secs_f64()));
            self.because.push(format!(
                "`{}` is requested by {} and blocked by {}{}",
                request.event.name(),
                self.name(by),
                self.name(&blocker),
                renewed.unwrap_or_default()
            ));
            let said = self.because.len();
            self.because.extend(self.why_unready(&blocker.node, request));
            self.because.extend(self.who_ordered_hold(&blocker));
            self.go_on(&blocker, lease);
            self.because.truncate(said - 1);
        }
    }

    /// The checks that do not pass, by the word of a vehicle that keeps itself on the ground.
    fn why_unready(&self, blocker: &NodeName, request: &BoardRequest) -> Option<String> {
        let is_own = Takeoff.at(blocker) == request.event;
        let known = self.evidence.vehicle(blocker).filter(|_| is_own)?;
        let checks = |event: &&Happened| matches!(event.event.kind(), Ready::NAME | Unready::NAME);
        let unready = Unready::read(&known.latest_events().find(checks)?.event)?;
        Some(format!("{blocker} is not ready: {}", unready.why))
    }

    /// The person or program that has ordered a station to hold the vehicle.
    fn who_ordered_hold(&self, blocker: &Party) -> Option<String> {
        let known = self.evidence.vehicle(self.vehicle).filter(|_| blocker.bthread == Hold::NAME)?;
        known.held_by(&blocker.node).map(|by| format!("{by} has ordered it"))
    }

    /// The events that would let `party` go on, or its lease here lapse?
    fn go_on(&mut self, party: &Party, lease: Option<BoardLease>) {
        if let Some(at) = self.path.iter().position(|earlier| earlier == party) {
            return self.report_cycle(at);
        }
        self.asked.insert(party.clone());
        if self.path.len() == LONGEST_CHAIN {
            return self.say(self.because.clone(), Vec::new());
        }
        let Some(left) = self.left.checked_sub(1) else { return };
        self.left = left;
        let before = self.changes.len();
        let (mut needed, mut leads_on) = (Vec::new(), false);
        self.path.push(party.clone());
        if let Some(board) = self.board(&party.node)
            && let Some(row) = board.row(&party.bthread)
        {
            self.follow_requests(party, row, &mut needed);
            if self.changes.len() == before {
                self.follow_waits(party, row, &mut needed);
            }
            leads_on = self.changes.len() > before;
            if !leads_on && needed.is_empty() {
                needed = waits::in_words(&row.waits, self.vehicle);
            }
            needed.extend(self.deadline(party, board, row));
        } else {
            needed.push(format!("{} withdraws it; what that waits for is not known", self.name(party)));
        }
        self.path.pop();
        needed.extend(lease.map(|lease| {
            format!("{} is lost for {:.1} s, and its lease lapses", party.node, lease.length.as_secs_f64())
        }));
        // What only leads on to others has nothing to say of its own.
        if !(leads_on && needed.is_empty()) {
            self.say(self.because.clone(), needed);
        }
    }

    /// Follows what `party` requests itself.
    fn follow_requests(&mut self, party: &Party, row: &'a BoardRow, needed: &mut Vec<String>) {
        for request in row.requests.iter().take(MOST_FOLLOWED) {
            let found = self.find_at_home(party, request);
            match found {
                Some(found) if !found.request.blocked_by.is_empty() => self.follow_blockers(&found),
                _ => needed.push(format!(
                    "`{}` happens, which {} requests",
                    request.event.name(),
                    self.name(party)
                )),
            }
        }
    }

    /// Follows what others request and `party` waits for.
    fn follow_waits(&mut self, party: &Party, row: &BoardRow, needed: &mut Vec<String>) {
        for found in self.requests_in(&row.waits).into_iter().take(MOST_FOLLOWED) {
            if found.by == *party {
                continue;
            }
            let name = found.request.event.name();
            if found.request.blocked_by.is_empty() {
                needed.push(format!("`{name}` happens, which {} requests", self.name(&found.by)));
            } else {
                self.because.push(format!("{} waits for `{name}`", self.name(party)));
                self.follow_blockers(&found);
                self.because.pop();
            }
        }
    }

    fn find_at_home(&self, party: &Party, request: &'a BoardRequest) -> Option<Found<'a>> {
        let home = first_two_chunks(request.event.name()).and_then(|home| NodeName::new(home).ok());
        let home = self.board(home.as_ref().unwrap_or(&party.node))?;
        let row = home.row(&party.name_at(&home.node))?;
        let request = row.requests.iter().find(|there| there.event == request.event)?;
        Some(Found { home, by: party.clone(), request })
    }

    /// All requests for events of a set, as their homes have them.
    fn requests_in(&self, set: &EventSet) -> Vec<Found<'a>> {
        let of_board = |home: &'a Board| {
            let of_row = move |row: &'a BoardRow| {
                let by = Party::read(&home.node, &row.bthread);
                row.requests.iter().map(move |request| Found { home, by: by.clone(), request })
            };
            home.rows.iter().flat_map(of_row)
        };
        let decided_there = |found: &Found<'_>| {
            first_two_chunks(found.request.event.name()).is_none_or(|home| home == found.home.node.as_str())
        };
        let all = self.evidence.boards().flat_map(of_board);
        all.filter(|found| set.contains(&found.request.event) && decided_there(found)).collect()
    }

    /// That `party` goes on by itself after a while.
    fn deadline(&self, party: &Party, board: &Board, row: &BoardRow) -> Option<String> {
        let left = row.deadline?.saturating_sub(board.at);
        Some(format!("{} goes on by itself, in {:.1} s", self.name(party), left.as_secs_f64()))
    }

    /// The path from `at` on ends where it begins.
    fn report_cycle(&mut self, at: usize) {
        let ring: Vec<Party> = self.path.get(at..).unwrap_or_default().to_vec();
        let mut because = self.because.clone();
        let names: Vec<String> = ring.iter().map(|party| self.name(party)).collect();
        let first = names.first().cloned().unwrap_or_default();
        because.push(format!("that is a cycle of waiting: {} and back to {first}", names.join(", then ")));
        let mut needed: Vec<String> = ring
            .iter()
            .filter_map(|party| {
                let board = self.board(&party.node)?;
                self.deadline(party, board, board.row(&party.bthread)?)
            })
            .collect();
        needed.push("one of them gives way".to_owned());
        if self.changes.len() < MOST_CHANGES {
            self.changes.push(Change { because, needed, cycle: names });
        }
    }

    fn say(&mut self, because: Vec<String>, needed: Vec<String>) {
        if self.changes.len() < MOST_CHANGES {
            self.changes.push(Change { because, needed, cycle: Vec::new() });
        }
    }

    /// The name of `party` when one speaks of the vehicle.
    fn name(&self, party: &Party) -> String {
        party.name_at(self.vehicle)
    }

    fn board(&self, node: &NodeName) -> Option<&'a Board> {
        self.evidence.board(node).map(|noted| &noted.what)
    }
}

//! Why a vehicle does what it does, or does not move: who requests, who blocks, and what would have to change.
//!
//! [`Evidence`] is what a station has heard, or a recording holds, up to some moment: the boards of all nodes, the states of
//! the vehicles, and what has happened. [`explain`] draws its conclusions from that and nothing else, so that the console
//! and a recording tell the same.
//!
//! ```
//! use std::time::Duration;
//! use skein_bp::Bid;
//! use skein_dbp::{Board, BoardRow, NodeName};
//! use skein_ground::explain::{Evidence, explain};
//! use skein_wire::State;
//!
//! let (now, vehicle) = (Duration::from_secs(9), NodeName::new("uav/3")?);
//! let rows = vec![
//!     BoardRow::new("navigation", &Bid::new().request("uav/3/advance"), |_| vec!["separation".to_owned()]),
//!     BoardRow::new("separation", &Bid::new().wait_for("uav/3/clear").block("uav/3/advance"), |_| Vec::new()),
//! ];
//! let mut evidence = Evidence::default();
//! evidence.note_board(now, Board::new(vehicle.clone(), 1, now, rows));
//! evidence.note_state(Duration::ZERO, &State { armed: true, ..State::new(vehicle.clone()) });
//! let change = &explain(&evidence, now, &vehicle).ok_or("unknown")?.changes[0];
//! assert_eq!(change.because, ["`uav/3/advance` is requested by navigation and blocked by separation"]);
//! assert_eq!(change.needed, ["`uav/3/clear` happens, which nobody requests"]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod evidence;
mod explanation;
mod inquiry;
mod messages;
mod party;
mod recorded;
mod waits;

use std::time::Duration;

use skein_dbp::{Board, NodeName};
use skein_wire::{Limits, MissionState};

pub use self::evidence::Evidence;
pub use self::explanation::{Blocker, Change, EventNote, Explanation, Request, Situation};
pub(crate) use self::recorded::Note;
pub use self::recorded::{Recorded, RecordedError};

use self::evidence::Noted;
use self::inquiry::Inquiry;
use self::party::Party;

/// A board that is older than this may no longer be so: its node tells it anew every three seconds.
const OLD_BOARD: Duration = Duration::from_secs(5);

/// The explanation of a vehicle at `now`; none of one that nobody has named.
pub fn explain(evidence: &Evidence, now: Duration, vehicle: &NodeName) -> Option<Explanation> {
    let known = evidence.vehicle(vehicle)?;
    let board = evidence.board(vehicle);
    let still_since = known.stillness.since(now);
    let situation = known.state.as_ref().map(|Noted { at, what: state }| Situation {
        age_s: now.saturating_sub(*at).as_secs_f64(),
        mode: state.mode.clone(),
        task: state.task.clone(),
        armed: state.armed,
        mission: match state.mission {
            MissionState::UnderWay => "under_way",
            MissionState::Complete => "complete",
            MissionState::Failed => "failed",
        },
        position: state.position.into(),
        speed_m_s: state.velocity.norm(),
        still_since_s: still_since.map(|since| since.as_secs_f64()),
    });
    let changes = if still_since.is_some() || situation.is_none() {
        Inquiry::new(evidence, vehicle).what_would_move_it()
    } else {
        Vec::new()
    };
    Some(Explanation {
        vehicle: vehicle.to_string(),
        time_s: now.as_secs_f64(),
        situation,
        events: known.latest_events().map(EventNote::from).collect(),
        requests: board.map(|board| requests(&board.what)).unwrap_or_default(),
        limits: board.map(|board| limits(&board.what).in_words()).unwrap_or_default(),
        changes,
        doubts: doubts(evidence, now, vehicle),
    })
}

/// The requests at a node, each with its blockers.
fn requests(board: &Board) -> Vec<Request> {
    let of_row = |row: &skein_dbp::BoardRow| {
        let (by, priority) = (row.bthread.clone(), row.priority);
        let request = move |request: &skein_dbp::BoardRequest| Request {
            event: format!("{:#}", request.event),
            by: by.clone(),
            priority,
            blocked_by: request.blocked_by.iter().map(|name| blocker(board, name)).collect(),
        };
        row.requests.iter().map(request).collect::<Vec<_>>()
    };
    board.rows.iter().flat_map(of_row).collect()
}

/// The limits that are stated at a node by its own b-threads.
fn limits(board: &Board) -> Limits {
    let rows = board.rows.iter();
    let stated = rows.flat_map(|row| row.states.iter().map(|event| (row.bthread.as_str(), event)));
    Limits::of(board.node.as_str(), stated)
}

/// The blocker of this name at a node.
fn blocker(board: &Board, name: &str) -> Blocker {
    let party = Party::read(&board.node, name);
    let lease = board.row(name).and_then(|row| row.lease);
    Blocker {
        local: party.node == board.node,
        node: party.node.to_string(),
        bthread: party.bthread,
        lease_age_s: lease.map(|lease| lease.age.as_secs_f64()),
        lease_s: lease.map(|lease| lease.length.as_secs_f64()),
    }
}

/// The doubts about the explanation.
fn doubts(evidence: &Evidence, now: Duration, vehicle: &NodeName) -> Vec<String> {
    let mut doubts = Vec::new();
    match evidence.board(vehicle) {
        None => doubts.push(format!("{vehicle} has told nothing of what it requests and blocks")),
        Some(board) => {
            let age = now.saturating_sub(board.at);
            if age > OLD_BOARD {
                let age_s = age.as_secs_f64();
                doubts.push(format!("what {vehicle} requests and blocks is known as of {age_s:.0} s before"));
            }
            if board.what.left_out > 0 || board.what.rows.iter().any(|row| row.cut) {
                doubts.push(format!("{vehicle} has more on its board than it tells"));
            }
        }
    }
    doubts
}

//! The checks of a script's ops that come from a file.

use std::time::Duration;

use crate::bid::Bid;
use crate::script::op::{Op, Times};
use crate::script::reading::Fault;

/// Blocks that take less time would fire without end.
const LEAST_WITHIN: Duration = Duration::from_millis(100);

/// Refuses the ops that only whole programs may have, and loops that may go round without a synchronisation point.
pub(super) fn check(ops: &[Op], field: &str) -> Result<(), Fault> {
    for (index, op) in ops.iter().enumerate() {
        let field = format!("{field}[{index}]");
        let alien = |what: &str| {
            let expected = "expected `sync`, `repeat`, `until`, `within_s`, `each`, `on` or `stop`";
            Err(Fault::new(&field, format!("is `{what}`, which is not for scripts from files: {expected}")))
        };
        match op {
            Op::Sync(bid) => check_bid(bid, &field)?,
            Op::Repeat { times, body } => {
                if *times != Times::Count(0) && !always_syncs(body) {
                    let problem = "may go round without a `sync`: expected one on every way through it";
                    return Err(Fault::new(&field, problem));
                }
                check(body, &format!("{field}.do"))?;
            }
            Op::Until { within, body, .. } => {
                if within.is_some_and(|within| within < LEAST_WITHIN) {
                    return Err(Fault::new(
                        format!("{field}.within_s"),
                        "is too short: expected at least 0.1 s",
                    ));
                }
                check(body, &format!("{field}.do"))?;
            }
            Op::On(arms) => {
                for (name, body) in arms {
                    check(body, &format!("{field}.on.{name}"))?;
                }
            }
            Op::Stop => {}
            Op::AssertFail(_) => return alien("assert_fail"),
            Op::Enqueue(_) => return alien("enqueue"),
            Op::Spawn(_) => return alien("spawn"),
            Op::Daemon(_) => return alien("daemon"),
            Op::OnInterruptEnqueue(_) => return alien("on_interrupt_enqueue"),
        }
    }
    Ok(())
}

fn check_bid(bid: &Bid, field: &str) -> Result<(), Fault> {
    let fault = |key: &str, problem: &str| Err(Fault::new(format!("{field}.sync.{key}"), problem));
    if bid.given_deadline().is_some() {
        return fault("deadline", "is not for scripts from files: expected `within_s` around the `sync`");
    }
    if bid.holds_when_lost() {
        return fault("hold_when_lost", "is not for scripts from files: they block nothing from afar");
    }
    if bid.given_priority().is_some() {
        return fault("prio", "is not for scripts from files: all have the priority of a mission");
    }
    Ok(())
}

/// Whether every way through `ops` comes to a synchronisation point or ends the script.
fn always_syncs(ops: &[Op]) -> bool {
    ops.iter().any(|op| match op {
        Op::Sync(_) | Op::Stop => true,
        Op::Repeat { times, body } => *times != Times::Count(0) && always_syncs(body),
        Op::Until { body, .. } => always_syncs(body),
        _ => false,
    })
}

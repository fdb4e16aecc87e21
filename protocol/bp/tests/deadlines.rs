//! Deadlines: timers that are part of a bid.

use std::time::Duration;

use crate::support::plain;
use serde::Serialize;
use serde_json::json;
use skein_bp::{BThread, Bid, Context, Event, Program, ProgramConfig};

fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// Waits for `pong`; each time it is late, asks again 100 ms later.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, Serialize)]
struct Pinger {
    due: Duration,
    late: u32,
    answered: bool,
}

impl BThread for Pinger {
    fn bid(&self) -> Option<Bid> {
        (!self.answered).then(|| Bid::new().wait_for("pong").deadline(self.due))
    }

    fn start(&mut self, cx: &mut Context) {
        self.due = cx.now() + ms(100);
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        if *event == Event::timeout() {
            self.late += 1;
            self.due = cx.now() + ms(100);
        } else {
            self.answered = true;
        }
    }
}

#[test]
fn a_deadline_resumes_its_bthread_alone_with_the_timeout() {
    let mut program = plain([("other", json!([{"sync": {"wait": "timeout"}}]))]);
    program.add("pinger", Pinger::default());
    assert!(program.superstep(ms(0)).unwrap().is_empty());
    assert_eq!(program.next_deadline(), Some(ms(100)));
    program.superstep(ms(99)).unwrap();
    assert_eq!(program.state_of::<Pinger>("pinger").unwrap().late, 0);
    assert!(program.superstep(ms(100)).unwrap().is_empty(), "a timeout is no selection");
    assert_eq!(program.state_of::<Pinger>("pinger").unwrap().late, 1);
    assert_eq!(program.next_deadline(), Some(ms(200)));
    assert!(program.bid("other").is_some(), "still waits");
}

#[test]
fn a_deadline_passes_before_the_next_selection() {
    let mut program = Program::new(ProgramConfig::default());
    program.add("pinger", Pinger::default());
    program.superstep(ms(0)).unwrap();
    program.enqueue("pong");
    program.superstep(ms(150)).unwrap();
    assert!(!program.has_bthreads());
    assert_eq!(program.next_deadline(), None);
}

#[test]
fn what_has_happened_elsewhere_comes_before_a_deadline() {
    let mut program = Program::new(ProgramConfig::default());
    program.add("pinger", Pinger::default());
    program.superstep(ms(0)).unwrap();
    program.occurred("pong");
    assert_eq!(program.step(ms(150)).unwrap().unwrap().resumed[..], ["pinger".into()]);
    assert!(!program.has_bthreads());
}

#[test]
fn an_open_deadline_is_no_deadlock() {
    #[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
    struct Insists;
    impl BThread for Insists {
        fn bid(&self) -> Option<Bid> {
            Some(Bid::new().request("a").block("a").deadline(ms(1000)))
        }
        fn resume(&mut self, _: &Event, _: &mut Context) {}
    }
    let mut program = Program::new(ProgramConfig::default());
    program.add("insists", Insists);
    program.superstep(ms(0)).unwrap();
    assert!(!program.is_deadlocked());
    // Time has passed the fixed deadline, which the b-thread keeps restating.
    let error = program.step(ms(1000)).unwrap_err().to_string();
    assert!(error.contains("`insists` failed: keeps setting deadlines"), "{error}");
}

#[test]
fn the_earliest_of_two_deadlines_counts() {
    assert_eq!(Bid::new().deadline(ms(5)).deadline(ms(3)).given_deadline(), Some(ms(3)));
}

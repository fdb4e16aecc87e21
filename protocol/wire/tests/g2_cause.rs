//! G2: an event occurs only while a bid in its home's table requests it.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::swarm::{Blocker, LEASE, Swarm, TICK, hostile, program};
use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event};

const ASKING: Duration = Duration::from_millis(500);
const RESTING: Duration = Duration::from_millis(2500);
const LONGEST_DELAY: Duration = Duration::from_millis(300);

/// Asks for `uav/1/act{n}`, gives up after a while, rests, and asks for the next.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Impatient {
    n: i64,
    asking: bool,
    until: Duration,
}

impl BThread for Impatient {
    fn bid(&self) -> Option<Bid> {
        let bid = Bid::new().deadline(self.until);
        Some(if self.asking { bid.request(Event::new("uav/1/act").with("n", self.n)) } else { bid })
    }

    fn resume(&mut self, _: &Event, cx: &mut Context) {
        if !self.asking {
            self.n += 1;
        }
        self.asking = !self.asking;
        self.until = cx.now() + if self.asking { ASKING } else { RESTING };
    }
}

#[test]
fn a_withdrawn_request_is_never_served_late() {
    let mut served = 0;
    for seed in 0..20 {
        let mut swarm = Swarm::new(&["uav/1", "ground/main"], hostile(), seed);
        let mut home = program(seed);
        home.add("gate", Blocker::new("uav/1/act", Duration::from_millis(900), Duration::from_millis(400)));
        swarm.start("uav/1", 1, home);
        let mut ground = program(seed);
        ground.add("ask", Impatient { n: 0, asking: false, until: LEASE });
        swarm.start("ground/main", 1, ground);

        let mut asked_until: BTreeMap<i64, Duration> = BTreeMap::new();
        for _ in 0..1500 {
            swarm.tick();
            let now = swarm.now;
            let ask = swarm.node("ground/main").program().state_of::<Impatient>("ask").unwrap().clone();
            if ask.asking {
                asked_until.insert(ask.n, now);
            }
        }
        for act in swarm.occurred("uav/1", "uav/1/act") {
            let n = act.happened.event.int("n").unwrap();
            assert_eq!(act.happened.requested_by.len(), 1, "nobody asked");
            assert_eq!(*act.happened.requested_by[0], *"ground/main#ask");
            let until = asked_until.get(&n).expect("an event that was never requested");
            // The home may not have heard of the withdrawal, but the lease ends it all the same.
            assert!(
                act.at <= *until + LONGEST_DELAY + LEASE + TICK,
                "request {n} served long after it was withdrawn"
            );
            served += 1;
        }
    }
    assert!(served > 50, "only {served} requests were served: the test says nothing");
}

#[test]
fn an_event_of_another_home_is_never_selected_here() {
    let mut swarm = Swarm::new(&["uav/1", "ground/main"], hostile(), 3);
    let mut ground = program(3);
    ground.add("ask", crate::swarm::Requester::new("uav/1/act", 5, Duration::ZERO));
    swarm.start("ground/main", 1, ground);
    swarm.run(Duration::from_secs(2));
    assert_eq!(swarm.saw("ground/main", "uav/1/act").count(), 0, "an event occurred without its home");
    swarm.start("uav/1", 1, program(3));
    swarm.run(Duration::from_secs(12));
    assert_eq!(swarm.occurred("uav/1", "uav/1/act").count(), 5);
    assert_eq!(swarm.saw("ground/main", "uav/1/act").count(), 5);
}

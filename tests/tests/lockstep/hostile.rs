//! One member says whatever it likes: the others fly on.

use std::time::Duration;

use skein_agent::Outcome;
use skein_bp::EventSet;
use skein_dbp::{BidRecord, Message, NodeName, OnLoss, Presence, RemoteBid};
use skein_sim::fly::FLEET;
use skein_tests::Lockstep;
use skein_wire::{Fleet, Key, Payload, State};

/// What a hostile member puts in one tick.
struct Hostile {
    me: NodeName,
    fleet: Fleet,
    ticks: u64,
}

impl Hostile {
    /// Says that it is there, in one life after another, and huge, and fast.
    fn put_states(&self, link: &mut impl skein_wire::Link, place: [f64; 3]) {
        let mut state = State::new(self.me.clone());
        (state.incarnation, state.time, state.armed) = (99, Duration::from_millis(20 * self.ticks), true);
        state.position = place.into();
        (state.radius_m, state.position_sigma_m) = (1e6, 1e6);
        state.velocity = [1e308, 1e308, -1e308].into();
        link.put(&Key::to_all::<State>(&self.fleet, self.me.clone()), Payload::State(state).encode());
        for number in 0..100 {
            let name = NodeName::new(&format!("uav/x{}", (self.ticks * 100 + number) % 30_000)).unwrap();
            let state = State { position: place.into(), armed: true, ..State::new(name.clone()) };
            link.put(&Key::to_all::<State>(&self.fleet, name), Payload::State(state).encode());
        }
        let presence = Presence {
            node: self.me.clone(),
            incarnation: 100 + self.ticks,
            up: Duration::ZERO,
            latest_seq: 5 * self.ticks,
            oldest_seq: 4 * self.ticks + 1,
            lease_ms: 10,
            joint: None,
        };
        let key = Key::to_all::<Presence>(&self.fleet, self.me.clone());
        link.put(&key, Payload::Message(Message::Presence(presence)).encode());
    }

    /// Blocks everything in the most laborious way, and sends what is much too long.
    fn put_bids(&self, link: &mut impl skein_wire::Link, home: &NodeName) {
        let key = Key::to_one::<BidRecord>(&self.fleet, self.me.clone(), home.clone());
        for (levels, bids) in [(46, 1), (5, 250)] {
            let block =
                (0..levels).fold(EventSet::from("**"), |set, _| EventSet::And(vec![set, EventSet::All]));
            let bid = |number: u64| RemoteBid {
                bthread: format!("b{}", number + self.ticks),
                sync: self.ticks + 1,
                requests: vec![home.event_name("land").into()],
                block: if bids == 1 { block.clone() } else { EventSet::from("**") },
                block_since: 1,
                priority: Some(i32::MAX),
                on_loss: OnLoss::Hold,
            };
            let record = BidRecord {
                node: self.me.clone(),
                incarnation: 100 + self.ticks,
                home: home.clone(),
                home_incarnation: None,
                epoch: self.ticks + 1,
                sent_at: Duration::from_millis(20 * self.ticks),
                applied: 0,
                term: 0,
                decided: 0,
                lease_ms: 10,
                bids: (0..bids).map(bid).collect(),
            };
            link.put(&key, Payload::Message(Message::Bid(record)).encode());
        }
        link.put(&key, vec![0x0a; 400_000]);
    }
}

#[test]
fn a_member_that_says_whatever_it_likes_keeps_nobody_from_the_mission() {
    let vehicle = |n: u32| {
        let y = 6.0 * f64::from(n);
        format!("[[vehicle]]\nstart_m = [0.0, {y:.1}]\nwaypoints_m = [[25.0, {y:.1}, 3.0]]\n")
    };
    let vehicles: Vec<String> = (0..4).map(vehicle).collect();
    let mut lockstep = Lockstep::from_text(&vehicles.concat());
    let me = lockstep.nodes[3].clone();
    lockstep.network.leave(&me);
    let mut link = lockstep.network.join(&me);
    let mut hostile = Hostile { me, fleet: Fleet::new(FLEET).unwrap(), ticks: 0 };
    let place = lockstep.swarm.simulation().vehicle(3).unwrap().motion.position.into();
    let others: Vec<_> = lockstep.nodes.iter().filter(|node| **node != hostile.me).cloned().collect();
    while lockstep.swarm.now() < Duration::from_secs(120)
        && !lockstep.swarm.outcomes().take(3).all(|outcome| outcome.is_some())
    {
        hostile.ticks += 1;
        hostile.put_states(&mut link, place);
        others.iter().for_each(|home| hostile.put_bids(&mut link, home));
        (0..5).for_each(|_| drop(lockstep.step()));
    }
    let now = lockstep.swarm.now();
    let said: Vec<_> = lockstep.swarm.agents().take(3).map(|agent| agent.status(now)).collect();
    let are_complete = lockstep.swarm.outcomes().take(3).all(|outcome| outcome == Some(&Outcome::Complete));
    assert!(are_complete, "after {now:?}: {said:?}");
    assert_eq!(
        (lockstep.swarm.truth().collisions_vehicle, lockstep.swarm.truth().collisions_obstacle),
        (0, 0)
    );
    let heard =
        lockstep.swarm.agents().next().unwrap().node().senders().find(|(name, _)| *name == Some(&hostile.me));
    let (_, of_hostile) = heard.unwrap();
    assert!(
        of_hostile.oversized > 100 && of_hostile.undecodable > 100 && of_hostile.implausible > 100,
        "{of_hostile:?}"
    );
}

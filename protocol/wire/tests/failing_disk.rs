//! A disk that fails costs the promises that would have to be kept on it, and nothing else.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::swarm::{Always, LEASE, Member, Requester, Swarm, TICK, name, program};
use skein_bp::catalogue::Declared as _;
use skein_bp::{Bid, Program};
use skein_dbp::{Kept, Node, NodeConfig, Roster, facts};
use skein_wire::{Fleet, NetworkConfig, NodeLink, Saving, Store};

const HOME: &str = "uav/1";
const GROUND: &str = "ground/main";

/// A disk that does what a test says.
#[derive(Clone, Debug)]
struct Disk(Arc<Mutex<(Saving, Kept)>>);

impl Disk {
    fn new(answer: Saving) -> Self {
        Self(Arc::new(Mutex::new((answer, Kept::default()))))
    }

    fn answers(&self, answer: Saving) {
        self.0.lock().unwrap().0 = answer;
    }

    fn kept(&self) -> Kept {
        self.0.lock().unwrap().1.clone()
    }
}

impl Store for Disk {
    fn save(&mut self, kept: &Kept) -> Saving {
        let mut disk = self.0.lock().unwrap();
        if disk.0 == Saving::Done {
            disk.1 = kept.clone();
        }
        disk.0.clone()
    }
}

/// A disk that is full, and one that does not answer.
fn failures() -> [Saving; 2] {
    [Saving::Failed("no space left".to_owned()), Saving::UnderWay]
}

fn start(swarm: &mut Swarm, config: NodeConfig, program: Program, disk: &Disk) {
    let node = config.name.clone();
    swarm.network.leave(&node);
    let link = swarm.network.join(&node);
    let config = NodeConfig { durable: true, kept: disk.kept(), ..config };
    let coupled =
        NodeLink::durable(Node::new(config, program), Fleet::new("test").unwrap(), Box::new(disk.clone()));
    swarm.members.insert(node, Member { node: coupled, link });
}

fn told<'a>(swarm: &'a Swarm, fact: &str, bthread: &'a str) -> impl Iterator<Item = Duration> + 'a {
    let fact = format!("{GROUND}/{fact}");
    let seen = swarm.seen.iter().filter(move |seen| {
        seen.node.as_str() == GROUND
            && seen.happened.event.name() == fact
            && seen.happened.event.text("bthread") == Some(bthread)
    });
    seen.map(|seen| seen.at)
}

fn steps_between(swarm: &Swarm, from: Duration, to: Duration) -> usize {
    swarm.occurred(HOME, "uav/1/step").filter(|seen| seen.at >= from && seen.at < to).count()
}

/// A home that steps, and a ground station that holds it with a lease, and with a block that must be kept.
fn held(disk: &Disk) -> Swarm {
    let mut swarm = Swarm::new(&[HOME, GROUND], NetworkConfig::default(), 1);
    let mut home = program(1);
    home.add("steps", Requester::new("uav/1/step", i64::MAX, TICK));
    let config = swarm.config(HOME, 1);
    start(&mut swarm, config, home, disk);
    let mut ground = program(1);
    ground.add("curfew", Always(Bid::new().block("uav/1/enter").hold_when_lost()));
    ground.add("hold", Always(Bid::new().block("uav/1/step")));
    swarm.start(GROUND, 1, ground);
    swarm
}

#[test]
fn a_hold_is_confirmed_and_a_promise_that_must_be_kept_is_not_given() {
    for failure in failures() {
        let disk = Disk::new(failure);
        let mut swarm = held(&disk);
        swarm.run(3 * LEASE);
        let first = told(&swarm, facts::Confirmed::NAME, "hold").next().unwrap();
        assert!(first < LEASE, "the hold is confirmed after {first:?}");
        assert_eq!(steps_between(&swarm, first, swarm.now), 0, "it is not kept");
        assert_eq!(told(&swarm, facts::Confirmed::NAME, "curfew").count(), 0);
        assert_eq!(told(&swarm, facts::BlockLapsed::NAME, "hold").count(), 0);
        assert!(swarm.members[&name(HOME)].node.trouble().is_some());
        assert_eq!(disk.kept(), Kept::default());
        disk.answers(Saving::Done);
        swarm.run(3 * LEASE);
        assert_eq!(told(&swarm, facts::Confirmed::NAME, "curfew").count(), 1, "it is given late");
        assert_eq!((disk.kept().blocks.len(), swarm.members[&name(HOME)].node.trouble()), (1, None));
    }
}

#[test]
fn a_promise_on_a_disk_that_fails_later_stays_promised() {
    for failure in failures() {
        let disk = Disk::new(Saving::Done);
        let mut swarm = held(&disk);
        swarm.run(LEASE);
        assert_eq!(told(&swarm, facts::Confirmed::NAME, "curfew").count(), 1);
        disk.answers(failure);
        let late = Always(Bid::new().block("uav/1/leave").hold_when_lost());
        swarm.node(GROUND).program_mut().add("late", late);
        swarm.run(5 * LEASE);
        assert_eq!(told(&swarm, facts::Confirmed::NAME, "late").count(), 0);
        assert_eq!(told(&swarm, facts::BlockLapsed::NAME, "curfew").count(), 0);
        assert_eq!(told(&swarm, facts::BlockLapsed::NAME, "hold").count(), 0);
        assert_eq!(disk.kept().blocks.len(), 1);
    }
}

fn joint() -> Option<Roster> {
    Some(Roster::first(name(GROUND), [name(HOME)]))
}

/// A station that decides together with a vehicle, and holds it.
fn decides(disk: &Disk) -> Swarm {
    let mut swarm = Swarm::new(&[HOME, GROUND], NetworkConfig::default(), 1);
    let mut home = program(1);
    home.add("steps", Requester::new("uav/1/step", i64::MAX, TICK));
    home.add("listen", Always(Bid::new().wait_for("swarm/**")));
    let config = NodeConfig { joint: joint(), ..swarm.config(HOME, 1) };
    swarm.start_with(config, home);
    let mut ground = program(1);
    ground.add("decide", Requester::new("swarm/go", 3, LEASE / 2));
    ground.add("hold", Always(Bid::new().block("uav/1/step")));
    let config = NodeConfig { joint: joint(), ..swarm.config(GROUND, 1) };
    start(&mut swarm, config, ground, disk);
    swarm
}

#[test]
fn what_is_not_kept_nobody_learns_and_its_holder_is_not_lost() {
    for failure in failures() {
        let disk = Disk::new(failure);
        let mut swarm = decides(&disk);
        swarm.run(10 * LEASE);
        assert_eq!(swarm.saw(HOME, "swarm/go").count(), 0, "a decision is told that may be forgotten");
        assert!(swarm.saw(GROUND, "swarm/go").count() <= 1, "it goes on deciding");
        assert_eq!(swarm.saw(HOME, "uav/1/peer_lost").count(), 0, "the station is silent");
        let first = told(&swarm, facts::Confirmed::NAME, "hold").next().unwrap();
        assert_eq!(steps_between(&swarm, first, swarm.now), 0, "its hold is not kept");
        disk.answers(Saving::Done);
        swarm.run(10 * LEASE);
        assert_eq!(swarm.saw(HOME, "swarm/go").count(), 3, "it goes on when the disk does");
        assert_eq!(disk.kept().decisions.len(), 3);
    }
}

#[test]
fn a_slow_disk_delays_a_decision_and_nothing_else() {
    let disk = Disk::new(Saving::UnderWay);
    let mut swarm = decides(&disk);
    while swarm.saw(GROUND, "swarm/go").next().is_none() {
        swarm.tick();
    }
    swarm.run(Duration::from_millis(100));
    assert_eq!(swarm.saw(HOME, "swarm/go").count(), 0);
    disk.answers(Saving::Done);
    swarm.run(Duration::from_millis(100));
    assert_eq!(swarm.saw(HOME, "swarm/go").count(), 1, "it is told as soon as it is kept");
    assert!(swarm.members[&name(GROUND)].node.trouble().is_none());
}

#[test]
fn a_coordinator_that_has_forgotten_decides_nothing_before_a_new_term() {
    let mut swarm = Swarm::new(&[HOME, GROUND], NetworkConfig::default(), 1);
    let mut home = program(1);
    home.add("listen", Always(Bid::new().wait_for("swarm/**")));
    swarm.start_with(NodeConfig { joint: joint(), ..swarm.config(HOME, 1) }, home);
    let mut ground = program(1);
    ground.add("decide", Requester::new("swarm/go", 1, LEASE / 2));
    swarm.start_with(NodeConfig { joint: joint(), forgot: true, ..swarm.config(GROUND, 1) }, ground);
    swarm.run(5 * LEASE);
    assert_eq!(swarm.saw(HOME, "swarm/go").count(), 0);
    let roster = Roster { term: 2, ..joint().unwrap() };
    for node in [HOME, GROUND] {
        swarm.node(node).enqueue(roster.order(&name(node)));
    }
    swarm.run(5 * LEASE);
    assert_eq!(swarm.saw(HOME, "swarm/go").count(), 1);
}

#[test]
fn it_is_told_once_that_a_disk_fails_and_once_that_it_works_again() {
    let disk = Disk::new(Saving::Failed("no space left".to_owned()));
    let mut swarm = held(&disk);
    swarm.run(5 * LEASE);
    disk.answers(Saving::Done);
    swarm.run(5 * LEASE);
    let told = |fact: &str| {
        let seen = swarm.occurred(HOME, fact).map(|seen| seen.happened.event.to_string());
        seen.collect::<Vec<_>>()
    };
    let fails = told("uav/1/disk_fails");
    assert!(fails.len() == 1 && fails[0].contains("no space left"), "{fails:?}");
    assert_eq!(told("uav/1/disk_works").len(), 1);
}

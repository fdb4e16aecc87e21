//! The station with three simple vehicles over the in-memory network.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, Program, ProgramConfig};
use skein_dbp::{Happened, Node, NodeConfig, NodeName};
use skein_ground::{GroundConfig, GroundCore, Order, Who};
use skein_wire::event::{
    Advance, Airborne, Complete, Declared as _, Failed, Landed, OrderTaken, Takeoff, What, of,
};
use skein_wire::{Fleet, MemoryLink, Network, NetworkConfig, NodeLink, State};

const TICK: Duration = Duration::from_millis(20);
const LEGS: i64 = 50;

/// A vehicle that takes off in half a second, advances ten times a second until it is there, and lands; on an order it
/// lands at once.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Vehicle {
    name: NodeName,
    stage: Stage,
    legs: i64,
    timer: Duration,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
enum Stage {
    Parked,
    Climbing,
    Airborne,
    Resting,
    Flying,
    Done,
    Ordered,
    Landing,
    Down,
}

impl BThread for Vehicle {
    fn bid(&self) -> Option<Bid> {
        let name = &self.name;
        let resume = OrderTaken::what(What::Resume);
        let bid = Bid::new().wait_for(of::<OrderTaken>(name).and(resume.not()));
        Some(match self.stage {
            Stage::Parked => Bid::new().wait_for(of::<Takeoff>(name)),
            Stage::Climbing | Stage::Resting => bid.deadline(self.timer),
            Stage::Airborne => bid.request(Airborne.at(name)),
            Stage::Flying => bid.request(Advance::ANYWHERE.at(name)),
            Stage::Done => bid.request(Complete.at(name)),
            Stage::Ordered => Bid::new().request(Failed { why: "ordered to land".into() }.at(name)),
            Stage::Landing => Bid::new().request(Landed.at(name)),
            Stage::Down => return None,
        })
    }

    fn resume(&mut self, event: &Event, cx: &mut Context) {
        self.timer = cx.now() + Duration::from_millis(if self.stage == Stage::Parked { 500 } else { 100 });
        self.stage = match (self.stage, event.kind()) {
            (_, OrderTaken::NAME) => Stage::Ordered,
            (Stage::Parked, _) => Stage::Climbing,
            (Stage::Climbing, _) => Stage::Airborne,
            (Stage::Resting, _) => Stage::Flying,
            (Stage::Airborne, _) => Stage::Resting,
            (Stage::Flying, _) => {
                self.legs += 1;
                if self.legs < LEGS { Stage::Resting } else { Stage::Done }
            }
            (Stage::Done | Stage::Ordered, _) => Stage::Landing,
            (Stage::Landing | Stage::Down, _) => Stage::Down,
        };
    }
}

struct Fleet3 {
    network: Network,
    now: Duration,
    station: GroundCore,
    station_link: MemoryLink,
    vehicles: BTreeMap<NodeName, (NodeLink, MemoryLink)>,
    happened: Vec<Happened>,
}

fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

impl Fleet3 {
    fn new(orders: Vec<(Duration, Order)>, network: NetworkConfig, seed: u64) -> Self {
        let fleet = Fleet::new("test").unwrap();
        let vehicles = ["uav/1", "uav/2", "uav/3"].map(name);
        let network = Network::new(network, seed);
        let config = GroundConfig {
            orders,
            seed,
            ..GroundConfig::new(fleet.clone(), name("ground/main"), vehicles.to_vec())
        };
        let station = GroundCore::new(config);
        let station_link = network.join(&name("ground/main"));
        let roster: Vec<NodeName> = vehicles.iter().cloned().chain([name("ground/main")]).collect();
        let vehicles = vehicles.map(|vehicle| {
            let mut program = Program::new(ProgramConfig::vehicle(seed));
            let bthread =
                Vehicle { name: vehicle.clone(), stage: Stage::Parked, legs: 0, timer: Duration::ZERO };
            program.add("vehicle", bthread);
            let node = Node::new(NodeConfig::new(vehicle.clone(), 1, roster.clone()), program);
            let link = network.join(&vehicle);
            (vehicle, (NodeLink::new(node, fleet.clone()), link))
        });
        Self {
            network,
            now: Duration::ZERO,
            station,
            station_link,
            vehicles: vehicles.into(),
            happened: Vec::new(),
        }
    }

    fn run(&mut self, duration: Duration) {
        let end = self.now + duration;
        while self.now < end && self.station.finished().is_none() {
            self.network.advance(self.now);
            self.station.tick(self.now, &mut self.station_link).unwrap();
            self.happened.extend(self.station.take_selections());
            for (vehicle, (node, link)) in &mut self.vehicles {
                node.pump(self.now, link).unwrap();
                node.put_state(&State { time: self.now, ..State::new(vehicle.clone()) }, link);
            }
            self.now += TICK;
        }
    }

    /// When the station saw the events of this name.
    fn saw(&self, event: &str) -> Vec<Duration> {
        self.happened
            .iter()
            .filter(|happened| happened.event.name() == event)
            .map(|happened| happened.at)
            .collect()
    }
}

const LOSSY: NetworkConfig = NetworkConfig {
    latency: (Duration::from_millis(1), Duration::from_millis(80)),
    loss: 0.2,
    duplicate: 0.1,
    reorder: 0.3,
};

#[test]
fn vehicles_are_launched_one_after_another_and_the_mission_ends() {
    for seed in 0..5 {
        let mut fleet = Fleet3::new(vec![], LOSSY, seed);
        fleet.run(Duration::from_secs(60));
        let outcome = fleet.station.finished().expect("the mission never ended");
        assert!(outcome.succeeded(), "{outcome:?}");
        for (before, after) in [("uav/1", "uav/2"), ("uav/2", "uav/3")] {
            let airborne = fleet.saw(&format!("{before}/airborne"));
            let takeoff = fleet.saw(&format!("{after}/takeoff"));
            assert_eq!((airborne.len(), takeoff.len()), (1, 1));
            assert!(airborne[0] < takeoff[0], "{after} took off before {before} was airborne");
        }
        assert_eq!(fleet.station.roster().count(), 3);
    }
}

#[test]
fn a_hold_is_confirmed_and_stops_every_vehicle_until_it_is_lifted() {
    for seed in 0..5 {
        let orders = vec![
            (Duration::from_secs(3), Order::Hold(Who::All)),
            (Duration::from_secs(8), Order::Resume(Who::All)),
        ];
        let mut fleet = Fleet3::new(orders, LOSSY, seed);
        fleet.run(Duration::from_secs(60));
        assert!(fleet.station.finished().is_some_and(|outcome| outcome.succeeded()));
        let held = fleet.saw("ground/main/confirmed");
        assert!(!held.is_empty() && held[0] < Duration::from_secs(5), "the hold was confirmed at {held:?}");
        // What had occurred before may still be on its way, and be repaired, but not for seconds.
        let settled = held[0] + Duration::from_secs(1);
        for vehicle in ["uav/1", "uav/2", "uav/3"] {
            let advanced = fleet.saw(&format!("{vehicle}/advance"));
            assert!(
                advanced.iter().all(|at| *at < settled || *at >= Duration::from_secs(8)),
                "{vehicle} moved: {advanced:?}"
            );
            assert_eq!(advanced.len() as i64, LEGS);
        }
        assert!(!fleet.saw("uav/1/stalled").is_empty());
    }
}

#[test]
fn one_vehicle_can_be_held_and_let_go_out_of_all() {
    let orders = vec![
        (Duration::from_millis(3000), Order::Hold(Who::All)),
        (Duration::from_millis(5000), Order::Resume(Who::only(name("uav/1")))),
        (Duration::from_millis(9000), Order::Resume(Who::All)),
    ];
    let mut fleet = Fleet3::new(orders, NetworkConfig::default(), 1);
    fleet.run(Duration::from_secs(60));
    assert!(fleet.station.finished().is_some());
    let between = |vehicle: &str| {
        let advanced = fleet.saw(&format!("{vehicle}/advance"));
        advanced
            .iter()
            .filter(|at| (Duration::from_millis(5200)..Duration::from_secs(9)).contains(*at))
            .count()
    };
    assert!(between("uav/1") > 5);
    assert_eq!((between("uav/2"), between("uav/3")), (0, 0));
}

#[test]
fn an_order_to_land_reaches_the_vehicles_it_is_for_even_on_hold() {
    let orders = vec![
        (Duration::from_millis(2500), Order::Hold(Who::All)),
        (Duration::from_millis(4000), Order::Land(Who::only(name("uav/2")))),
        (Duration::from_millis(6000), Order::Resume(Who::All)),
    ];
    let mut fleet = Fleet3::new(orders, LOSSY, 3);
    fleet.run(Duration::from_secs(60));
    let outcome = fleet.station.finished().expect("the mission never ended");
    assert!(!outcome.succeeded());
    assert_eq!(outcome.failed, BTreeMap::from([("uav/2".to_owned(), "ordered to land".to_owned())]));
    assert!(fleet.saw("uav/2/landed")[0] < Duration::from_secs(6));
    assert_eq!((fleet.saw("uav/2/order").len(), fleet.saw("uav/1/order").len()), (2, 1));
}

#[test]
fn everyone_can_be_called_home() {
    let mut fleet =
        Fleet3::new(vec![(Duration::from_secs(2), Order::Return(Who::All))], NetworkConfig::default(), 1);
    fleet.run(Duration::from_secs(3));
    for vehicle in ["uav/1", "uav/2", "uav/3"] {
        let what: Vec<_> = fleet
            .happened
            .iter()
            .filter(|happened| happened.event.name() == format!("{vehicle}/order"))
            .filter_map(|happened| OrderTaken::read(&happened.event))
            .map(|order| order.what)
            .collect();
        assert_eq!(what, [What::Return], "{vehicle}");
    }
}

#[test]
fn a_vehicle_that_never_answers_keeps_no_other_on_the_ground() {
    let mut fleet = Fleet3::new(vec![], NetworkConfig::default(), 1);
    fleet.run(Duration::from_millis(200));
    fleet.network.leave(&name("uav/2"));
    fleet.vehicles.remove(&name("uav/2"));
    fleet.run(Duration::from_secs(10));
    assert_eq!(fleet.saw("uav/3/takeoff").len(), 1);
    assert!(fleet.station.finished().is_none(), "a lost vehicle is not a finished one");
}

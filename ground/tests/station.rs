//! The station with three simple vehicles over the in-memory network.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use serde::Serialize;
use skein_bp::{BThread, Bid, Context, Event, Program, ProgramConfig};
use skein_dbp::{Happened, Node, NodeConfig, NodeName};
use skein_ground::{Answer, Giver, GroundConfig, GroundCore, OFFER_LASTS, Refusal};
use skein_wire::event::{
    Advance, Airborne, Complete, Declared as _, Failed, Handover, Landed, OrderGiven, OrderTaken, Takeoff,
    What, of,
};
use skein_wire::{Fleet, MemoryLink, Network, NetworkConfig, NodeLink, Order, State, Who};

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
    holders: BTreeMap<NodeName, String>,
    /// Those that say that their motors are armed.
    flying: BTreeSet<NodeName>,
}

/// Blocks the orders of all but one.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
struct Heeds {
    vehicle: NodeName,
    by: String,
}

impl BThread for Heeds {
    fn bid(&self) -> Option<Bid> {
        let others = OrderTaken::by(self.by.as_str()).not();
        Some(
            Bid::new().block(of::<OrderTaken>(&self.vehicle).and(OrderTaken::what(What::Resume)).and(others)),
        )
    }

    fn resume(&mut self, _: &Event, _: &mut Context) {}
}

fn giver(name: &str) -> Giver {
    Giver::new(name).unwrap()
}

fn name(text: &str) -> NodeName {
    NodeName::new(text).unwrap()
}

impl Fleet3 {
    fn new(orders: Vec<(Duration, Order)>, network: NetworkConfig, seed: u64) -> Self {
        let orders = orders.into_iter().map(|(at, order)| (at, giver("Anna"), order)).collect();
        Self::with(network, seed, |config| GroundConfig { orders, ..config })
    }

    /// On the ground until somebody launches them.
    fn waiting() -> Self {
        let mut fleet = Self::with(NetworkConfig::default(), 1, |config| GroundConfig {
            launch_on_order: true,
            ..config
        });
        fleet.run(Duration::from_millis(500));
        fleet
    }

    fn with(network: NetworkConfig, seed: u64, change: impl FnOnce(GroundConfig) -> GroundConfig) -> Self {
        let fleet = Fleet::new("test").unwrap();
        let vehicles = ["uav/1", "uav/2", "uav/3"].map(name);
        let network = Network::new(network, seed);
        let config =
            GroundConfig { seed, ..GroundConfig::new(fleet.clone(), name("ground/main"), vehicles.to_vec()) };
        let config = change(config);
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
            holders: BTreeMap::new(),
            flying: BTreeSet::new(),
        }
    }

    /// From now on this vehicle tells that it is held by them, and heeds no other.
    fn is_held(&mut self, vehicle: &str, by: &str) {
        self.holders.insert(name(vehicle), by.to_owned());
        let (node, _) = self.vehicles.get_mut(&name(vehicle)).unwrap();
        let heeds = Heeds { vehicle: name(vehicle), by: by.to_owned() };
        node.node_mut().program_mut().add("heeds", heeds);
    }

    fn answer(&self, order: u64, vehicle: &str) -> &Answer {
        let record = self.station.orders().find(|record| record.id == order).unwrap();
        &record.answers[&name(vehicle)]
    }

    fn run(&mut self, duration: Duration) {
        let end = self.now + duration;
        while self.now < end && self.station.finished().is_none() {
            self.network.advance(self.now);
            self.station.tick(self.now, &mut self.station_link).unwrap();
            self.happened.extend(self.station.take_selections());
            for (vehicle, (node, link)) in &mut self.vehicles {
                node.pump(self.now, link).unwrap();
                let holder = self.holders.get(vehicle).cloned().unwrap_or_default();
                node.put_state(
                    &State {
                        time: self.now,
                        holder,
                        armed: self.flying.contains(vehicle),
                        ..State::new(vehicle.clone())
                    },
                    link,
                );
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
    range_m: None,
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
            (Duration::from_secs(3), Order::new(What::Hold, Who::All)),
            (Duration::from_secs(8), Order::new(What::Resume, Who::All)),
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
        (Duration::from_millis(3000), Order::new(What::Hold, Who::All)),
        (Duration::from_millis(5000), Order::new(What::Resume, Who::only(name("uav/1")))),
        (Duration::from_millis(9000), Order::new(What::Resume, Who::All)),
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
        (Duration::from_millis(2500), Order::new(What::Hold, Who::All)),
        (Duration::from_millis(4000), Order::new(What::Land, Who::only(name("uav/2")))),
        (Duration::from_millis(6000), Order::new(What::Resume, Who::All)),
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
    let mut fleet = Fleet3::new(
        vec![(Duration::from_secs(2), Order::new(What::Return, Who::All))],
        NetworkConfig::default(),
        1,
    );
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

#[test]
fn an_order_names_who_gave_it_from_the_console_to_the_vehicle() {
    let mut fleet = Fleet3::new(vec![], NetworkConfig::default(), 1);
    fleet.run(Duration::from_secs(1));
    let id = fleet.station.order(&giver("Anna"), &Order::new(What::Land, Who::only(name("uav/1")))).unwrap();
    fleet.run(Duration::from_secs(1));
    let events = fleet.happened.iter().map(|happened| &happened.event);
    let by: Vec<_> = events
        .filter_map(|event| Some(OrderGiven::read(event)?.by).or_else(|| Some(OrderTaken::read(event)?.by)))
        .collect();
    assert_eq!(by.iter().map(|by| &**by).collect::<Vec<_>>(), ["Anna"], "at the station");
    assert_eq!(fleet.station.orders().last().map(|record| record.by.as_str()), Some("Anna"));
    assert!(matches!(fleet.answer(id, "uav/1"), Answer::Acknowledged(_)));
}

#[test]
fn another_holder_is_named_with_the_remedy_and_keeps_nobody_from_stopping_the_vehicle() {
    let mut fleet = Fleet3::waiting();
    fleet.is_held("uav/1", "Anna");
    fleet.run(Duration::from_millis(500));
    let one = || Who::only(name("uav/1"));
    let refusal = fleet.station.order(&giver("Ben"), &Order::new(What::Resume, one())).unwrap_err();
    assert_eq!(refusal, Refusal::Held { vehicle: name("uav/1"), holder: "Anna".into() });
    let words = refusal.to_string();
    assert!(
        words.contains("Anna holds `uav/1`") && words.contains("`ask`") && words.contains("`take`"),
        "{words}"
    );

    let all = fleet.station.order(&giver("Ben"), &Order::new(What::Resume, Who::All)).unwrap();
    assert_eq!(*fleet.answer(all, "uav/1"), Answer::Refused(words));
    fleet.run(Duration::from_millis(200));
    assert!(fleet.saw("uav/1/order").is_empty() && !fleet.saw("uav/2/order").is_empty());

    for stop in [
        Order::new(What::Hold, one()),
        Order::new(What::Return, one()),
        Order::new(What::Land, one()),
        Order::new(What::Abort, Who::All),
    ] {
        fleet.station.order(&giver("Ben"), &stop).unwrap();
    }
    fleet.station.order(&giver("Anna"), &Order::new(What::Resume, one())).unwrap();
    let not_his = fleet.station.order(&giver("Ben"), &Order::give(one(), "Ben")).unwrap_err();
    assert!(matches!(not_his, Refusal::NotHolder { .. }), "{not_his}");
}

#[test]
fn of_two_stations_the_one_that_comes_second_learns_it_from_the_vehicle() {
    let mut fleet = Fleet3::waiting();
    let order =
        fleet.station.order(&giver("Ben"), &Order::new(What::Resume, Who::only(name("uav/1")))).unwrap();
    // Another station's order has come first, and this one does not know it yet.
    fleet.is_held("uav/1", "Anna");
    fleet.run(Duration::from_secs(1));
    let Answer::Refused(why) = fleet.answer(order, "uav/1") else { panic!("it was not refused") };
    assert!(why.contains("Anna holds `uav/1`"), "{why}");
    // It is not brought any more, even if Anna lets the vehicle go.
    fleet.vehicles.get_mut(&name("uav/1")).unwrap().0.node_mut().program_mut().remove("heeds");
    fleet.holders.clear();
    fleet.run(Duration::from_secs(5));
    assert!(fleet.saw("uav/1/order").is_empty());
}

#[test]
fn a_holder_who_is_there_is_kept_holding_and_one_who_is_gone_is_not() {
    let mut fleet = Fleet3::waiting();
    fleet.is_held("uav/1", "Anna");
    let kept = |fleet: &Fleet3| {
        let kept =
            |happened: &&Happened| OrderGiven::read(&happened.event).is_some_and(|it| it.what == What::Keep);
        fleet.happened.iter().filter(kept).count()
    };
    fleet.run(Duration::from_secs(25));
    assert_eq!(kept(&fleet), 0, "she is not there");
    fleet.station.attend([giver("Anna"), giver("Ben")].into());
    fleet.run(Duration::from_secs(25));
    assert!((2..=3).contains(&kept(&fleet)), "{} times", kept(&fleet));
    let by = |event: &Event| Handover::read(event).map(|handover| handover.by.to_string());
    assert!(fleet.happened.iter().filter_map(|happened| by(&happened.event)).all(|by| by == "Anna"));
}

#[test]
fn a_launch_is_two_messages() {
    let mut fleet = Fleet3::waiting();
    let (anna, ben) = (giver("Anna"), giver("Ben"));
    assert_eq!(fleet.station.order(&anna, &Order::new(What::Launch, Who::All)), Err(Refusal::LaunchUnasked));
    let offer = fleet.station.offer_launch(&anna, What::Launch, "t1".into()).unwrap();
    let vehicles: Vec<_> = offer.candidates.iter().map(|one| one.vehicle.as_str()).collect();
    assert_eq!((offer.token.as_str(), &vehicles[..]), ("t1", &["uav/1", "uav/2", "uav/3"][..]));
    fleet.run(Duration::from_secs(2));
    assert!(fleet.saw("uav/1/takeoff").is_empty(), "one message launches nobody");

    assert_eq!(fleet.station.launch(&ben, "t1"), Err(Refusal::NoSuchOffer), "another's");
    assert_eq!(fleet.station.launch(&anna, "t2"), Err(Refusal::NoSuchOffer), "guessed");
    fleet.station.launch(&anna, "t1").unwrap();
    assert_eq!(fleet.station.launch(&anna, "t1"), Err(Refusal::NoSuchOffer), "used");
    fleet.run(Duration::from_secs(2));
    assert_eq!(fleet.saw("uav/1/takeoff").len(), 1);
}

#[test]
fn an_offered_launch_lapses_gives_way_to_a_later_one_and_is_about_those_it_named() {
    let mut fleet = Fleet3::waiting();
    let anna = giver("Anna");
    let offer = |fleet: &mut Fleet3, token: &str| {
        fleet.station.offer_launch(&anna, What::Launch, token.into()).unwrap();
    };
    offer(&mut fleet, "old");
    fleet.run(OFFER_LASTS + 2 * TICK);
    assert_eq!(fleet.station.launch(&anna, "old"), Err(Refusal::NoSuchOffer), "too late");
    offer(&mut fleet, "first");
    offer(&mut fleet, "second");
    assert_eq!(fleet.station.launch(&anna, "first"), Err(Refusal::NoSuchOffer));
    fleet.station.launch(&anna, "second").unwrap();

    let mut fleet = Fleet3::waiting();
    offer(&mut fleet, "three");
    fleet.flying.insert(name("uav/2"));
    fleet.run(Duration::from_millis(200));
    assert_eq!(fleet.station.launch(&anna, "three"), Err(Refusal::OfferOutdated));

    let mut fleet = Fleet3::waiting();
    fleet.is_held("uav/3", "Ben");
    fleet.run(Duration::from_millis(200));
    let held = fleet.station.offer_launch(&anna, What::Launch, "t".into()).unwrap_err();
    assert_eq!(held, Refusal::Held { vehicle: name("uav/3"), holder: "Ben".into() });
}

#[test]
fn orders_that_were_known_in_advance_hold_no_vehicle() {
    let resume = Order::new(What::Resume, Who::only(name("uav/2")));
    let mut fleet = Fleet3::new(vec![(Duration::from_secs(2), resume)], NetworkConfig::default(), 1);
    fleet.run(Duration::from_secs(2));
    fleet.holders.insert(name("uav/2"), "Anna".into());
    fleet.run(Duration::from_secs(2));
    let released =
        |happened: &&Happened| OrderGiven::read(&happened.event).is_some_and(|it| it.what == What::Release);
    assert_eq!(fleet.happened.iter().filter(released).count(), 1);
}

fn zone(text: &str) -> skein_wire::Zone {
    text.parse().unwrap()
}

#[test]
fn a_vehicle_that_cannot_keep_a_zone_says_so_and_one_that_is_removed_goes_off_the_record() {
    let mut fleet = Fleet3::waiting();
    let pond = zone(r#"{"name":"pond","kind":"no_fly","centre_m":[0,0],"radius_m":5}"#);
    fleet.station.draw(&giver("Anna"), pond.clone()).unwrap();
    fleet.run(Duration::from_secs(1));
    let record = fleet.station.zones().next().unwrap();
    assert_eq!((&record.zone, record.by.as_str(), record.is_going), (&pond, "Anna", false));
    let refused = Answer::Refused("its disk does not take it".into());
    assert!(record.answers.values().all(|answer| *answer == refused), "{:?}", record.answers);
    fleet.station.erase(&giver("Ben"), "pond").unwrap();
    fleet.run(Duration::from_secs(1));
    assert_eq!(fleet.station.zones().count(), 0);
    assert_eq!((fleet.saw("ground/main/drawn").len(), fleet.saw("ground/main/erased").len()), (1, 1));
}

#[test]
fn no_more_zones_are_drawn_than_travel_in_one_message_and_unknown_ones_are_not_removed() {
    let mut fleet = Fleet3::waiting();
    let by = giver("Anna");
    let numbered = |number: usize| {
        zone(&format!(r#"{{"name":"z{number}","kind":"no_fly","centre_m":[0,0],"radius_m":5}}"#))
    };
    for number in 0..skein_wire::Zone::MOST {
        fleet.station.draw(&by, numbered(number)).unwrap();
    }
    assert_eq!(fleet.station.draw(&by, numbered(99)), Err(Refusal::TooManyZones));
    assert_eq!(fleet.station.draw(&by, numbered(3)), Ok(()), "in the place of itself");
    let unknown = Refusal::NoSuchZone { name: "moon".into() };
    assert_eq!(fleet.station.erase(&by, "moon"), Err(unknown));
    let mut fleet = Fleet3::waiting();
    let cornered = |number: usize| {
        let corners: Vec<_> = (0..64).map(|k| [f64::from(k), f64::from(k * k)]).collect();
        zone(&format!(r#"{{"name":"c{number}","kind":"stay_inside","corners_m":{corners:?}}}"#))
    };
    for number in 0..8 {
        fleet.station.draw(&by, cornered(number)).unwrap();
    }
    assert_eq!(fleet.station.draw(&by, cornered(8)), Err(Refusal::TooManyCorners { corners: 576 }));
    fleet.station.erase(&by, "c3").unwrap();
    assert_eq!(fleet.station.draw(&by, cornered(8)), Ok(()));
}

//! Scripts on a vehicle: what they may, what becomes of them, and what those do that come with the agent.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use serde_json::{Value, json};
use skein_agent::{
    AgentConfig, AgentCore, Envelope, Fence, Me, Planners,
    bthreads::{self, LinkLossPolicy},
    scripts::{Begins, Runner, Scripts},
};
use skein_bp::script::{Argument, Assignment, ScriptFile};
use skein_bp::{Event, Program, ProgramConfig};
use skein_mav::Datum;
use skein_wire::event::*;
use skein_wire::{KeptScript, Limits, MemoryStore, Network, NetworkConfig, Saving, Store};

const ME: &str = "uav/1";
const ROSTER: [&str; 4] = ["uav/1", "uav/2", "ground/main", "script/operator"];
const SENDER: &str = "ground/main#scripts for uav/1";
const SHIPPED: [(&str, &str); 5] = [
    ("patrol", include_str!("../scripts/patrol.toml")),
    ("curfew", include_str!("../scripts/curfew.toml")),
    ("alternate", include_str!("../scripts/alternate.toml")),
    ("follow", include_str!("../scripts/follow.toml")),
    ("keep-low", include_str!("../scripts/keep-low.toml")),
];

fn config() -> AgentConfig {
    AgentConfig {
        fleet: "test".to_owned(),
        node: ME.to_owned(),
        ground: "ground/main".to_owned(),
        roster: ROSTER.map(str::to_owned).to_vec(),
        incarnation: 1,
        system_id: 1,
        datum: Datum::from_degrees(47.4, 8.5, 400.0),
        home: [0.0; 3],
        waypoints: vec![[50.0, 0.0, 3.0]],
        errands: Vec::new(),
        rally: Vec::new(),
        arrives_with: Vec::new(),
        takeoff_height_m: 2.0,
        return_altitude_m: 4.0,
        position: Default::default(),
        signing: None,
        sigma_limit_m: 2.0,
        lidar: true,
        fence: Fence { min: [-60.0, -60.0, -1.0], max: [60.0, 60.0, 20.0] },
        airspace: Default::default(),
        envelope: Envelope::default(),
        planners: Planners::default(),
        link_loss: LinkLossPolicy::Continue,
        scripts: Vec::new(),
        behaviours: Default::default(),
        lease: Duration::from_secs(1),
        radio_range_m: None,
        epoch: Duration::ZERO,
        authority: skein_wire::standard_authority(),
        kept: skein_dbp::Kept::default(),
        seed: 1,
    }
}

/// A vehicle's b-threads and its scripts.
struct Vehicle {
    program: Program,
    scripts: Scripts,
    now: Duration,
}

impl Vehicle {
    fn on_the_ground() -> Self {
        let config = config();
        let mut program = Program::new(ProgramConfig::vehicle(1));
        bthreads::load(&mut program, &config);
        Self {
            program,
            scripts: Scripts::new(Me::new(ME), &config.roster, &config.events()),
            now: Duration::ZERO,
        }
    }

    /// In the air, with a path to its waypoint.
    fn in_the_air() -> Self {
        let mut vehicle = Self::on_the_ground();
        for verb in [Ready::NAME, Takeoff::NAME, Airborne::NAME, Planned::NAME] {
            vehicle.hears(mine(verb));
        }
        vehicle
    }

    fn load(&mut self, assignment: &Assignment) -> Result<(), String> {
        self.scripts.load(&mut self.program, assignment, SENDER, Begins::AtOnce).map(|_| ())
    }

    /// Everything that happens after an event from outside, itself first.
    fn hears(&mut self, event: Event) -> Vec<Event> {
        self.program.enqueue(event);
        self.happens()
    }

    fn happens(&mut self) -> Vec<Event> {
        let selections = self.program.superstep(self.now).unwrap();
        let events: Vec<Event> = selections.into_iter().map(|selection| selection.event).collect();
        events.iter().for_each(|event| self.scripts.hear(event));
        events
    }

    fn verbs_after(&mut self, event: Event) -> Vec<String> {
        self.hears(event).iter().map(|event| event.kind().to_owned()).collect()
    }

    /// Whether it asks for leave to move, and gets it, a navigation cycle later.
    fn moves(&mut self) -> bool {
        self.now += Duration::from_millis(100);
        self.happens().iter().any(|event| event.kind() == Advance::NAME)
    }
}

fn states(events: &[Event]) -> Vec<ScriptState> {
    events.iter().filter_map(ScriptNews::read).map(|news| news.state).collect()
}

fn mine(verb: &str) -> Event {
    Event::new(format!("{ME}/{verb}"))
}

fn at(verb: &str, [x, y, z]: [f64; 3]) -> Event {
    mine(verb).with("x", x).with("y", y).with("z", z)
}

fn shipped(name: &str, with: Value) -> Assignment {
    let (_, text) = SHIPPED.iter().find(|(known, _)| *known == name).unwrap();
    let script = ScriptFile::parse(&format!("{name}.toml"), text).unwrap();
    Assignment { script, with: serde_json::from_value(with).unwrap(), called: None }
}

/// A script of these ops, without parameters.
fn script(body: Value) -> Assignment {
    let text = json!({"name": "test", "about": "A test.", "body": body}).to_string();
    Assignment { script: ScriptFile::parse("test.json", &text).unwrap(), with: [].into(), called: None }
}

fn refusal(body: Value) -> String {
    Vehicle::in_the_air().load(&script(body)).unwrap_err()
}

#[test]
fn a_script_requests_only_what_it_may() {
    for (request, why) in [
        (json!("uav/1/land"), "it requests `uav/1/land`, which scripts may not"),
        (json!({"name": "uav/1/goto", "data": {"x": 0.0}}), "it requests `uav/1/goto"),
        (json!({"name": "uav/1/order", "data": {"what": "hand_back"}}), "hand_back"),
        (json!({"name": "uav/1/order", "data": {"what": "$what"}}), "$what"),
        (json!({"name": "uav/2/order", "data": {"what": "land"}}), "uav/2/order"),
        (
            json!("uav/1/scripted"),
            "they may request `uav/1/order` with `what` one of hold, resume, land, return, goto",
        ),
        (json!("uav/1/battery"), "uav/1/battery"),
    ] {
        let error = refusal(json!([{"sync": {"request": request}}]));
        assert!(error.contains(why), "{error} does not say {why}");
    }
    for request in [json!({"name": "uav/1/order", "data": {"what": "land"}}), json!("uav/1/script/done")] {
        Vehicle::in_the_air().load(&script(json!([{"sync": {"request": request}}]))).unwrap();
    }
}

#[test]
fn a_script_speaks_of_fields_that_there_are_and_of_what_they_may_be() {
    let order = |data: Value| json!({"request": {"name": "uav/1/order", "data": data}});
    for (sync, why) in [
        (
            order(json!({"what": "land", "speed": 3})),
            "it requests the field `speed`, and there is no such field: `order` has `what`, `x`, `y`, `z`, `way`, `by`",
        ),
        (
            order(json!({"what": "goto", "x": "far"})),
            "`x` of `order` as \"far\": expected number in m, or none",
        ),
        (json!({"wait": {"any_data": "uav/1/arrived", "data_has": {"what": 1}}}), "`arrived` has `leg`"),
        (json!({"wait": {"any_data": "uav/1/arrived", "data_has": {"leg": 1.5}}}), "expected whole number"),
        (json!({"wait": {"any_data": "uav/1/landed", "data_has": {"leg": 1}}}), "`landed` has none"),
        (
            json!({"wait": {"any_data": "uav/1/plan", "data_has": {"why": "bored"}}}),
            "waypoint, obstacle, stuck",
        ),
        (json!({"wait": {"any_data": "uav/1/battery", "data_has": {"percent": 120}}}), "0 to 100"),
        (
            json!({"wait": {"any_data": "uav/1/neighbour", "field_range": {"key": "node", "max": 3}}}),
            "`node` of `neighbour` as a number: expected text",
        ),
        (
            json!({"wait": {"any_data": "uav/1/landed", "region": {"min": [0, 0, 0], "max": [1, 1, 1]}}}),
            "the field `x`",
        ),
    ] {
        let error = refusal(json!([{"sync": sync}]));
        assert!(error.contains(why), "{error} does not say {why}");
    }
    let order = order(json!({"what": "goto", "x": "$x", "y": 2, "z": 3.0, "by": "script/test"}));
    let wait = json!({"wait": {"any_data": "uav/1/neighbour", "data_has": {"node": "uav/2"}}});
    Vehicle::in_the_air().load(&script(json!([{"sync": wait}, {"sync": order}]))).unwrap();
}

#[test]
fn a_script_states_nothing_but_limits_on_its_own_vehicle() {
    let limit = |data: Value| json!({"name": "uav/1/limit", "data": data});
    let states = |stated: Value| json!([{"sync": {"state": stated, "wait": "uav/1/alone"}}]);
    for (stated, why) in [
        (json!("uav/1/land"), "it states `uav/1/land`; scripts may state nothing but `uav/1/limit`"),
        (json!({"name": "uav/2/limit", "data": {"max_z": 4}}), "it states `uav/2/limit`"),
        (json!("uav/1/limit"), "without a bound"),
        (limit(json!({"height": 4})), "`limit` has `speed_m_s`"),
        (limit(json!({"speed_m_s": 0.1})), "expected number in m/s, at least 0.3"),
        (limit(json!({"max_z": "low"})), "expected number in m"),
    ] {
        let error = refusal(states(stated));
        assert!(error.contains(why), "{error} does not say {why}");
    }
    let mut vehicle = Vehicle::in_the_air();
    vehicle.load(&script(states(limit(json!({"max_z": 4, "speed_m_s": 1.5}))))).unwrap();
    vehicle.moves();
    let limits = Limits::of(ME, vehicle.program.stated());
    assert_eq!(
        limits.in_words(),
        ["script/test limits speed to at most 1.5 m/s", "script/test limits z to at most 4 m"]
    );
    vehicle.hears(mine(Alone::NAME));
    assert!(Limits::of(ME, vehicle.program.stated()).is_none());
}

#[test]
fn a_script_blocks_no_safety_event_however_it_is_named() {
    let catalogue = Catalogue::standard();
    let own = catalogue.own().map(|event| event.name);
    let never =
        own.chain([OrderTaken::NAME, Load::NAME, Unload::NAME, Enter::NAME, "confirmed", "peer_lost"]);
    for verb in never {
        for set in [
            json!({"any_data": format!("uav/1/{verb}")}),
            json!({"name": format!("uav/1/{verb}"), "data": {"why": "x"}}),
            json!({"prefix": "uav/1/"}),
            json!({"named": "uav/*/*"}),
            json!({"region": {"min": [0, 0, 0], "max": [1, 1, 1]}}),
            json!({"not": "uav/1/advance"}),
            json!({"all": true}),
        ] {
            let error = refusal(json!([{"sync": {"block": set, "wait": "uav/1/landed"}}]));
            assert!(error.contains("which scripts may not"), "{set}: {error}");
        }
    }
    let error = refusal(json!([{"sync": {"block": {"named": "uav/*/advance"}}}]));
    assert!(error.contains("it blocks events of uav/2"), "{error}");
}

#[test]
fn the_way_home_stays_open_whatever_a_script_blocks() {
    let mut vehicle = Vehicle::in_the_air();
    vehicle
        .load(&script(
            json!([{"sync": {"block": [{"any_data": "uav/1/goto"}, {"any_data": "uav/1/advance"}], "wait": "uav/1/landed"}}]),
        ))
        .unwrap();
    assert!(!vehicle.moves());
    let verbs = vehicle.verbs_after(OrderTaken::plain(What::Return, "the operator").given_aboard().at(ME));
    assert_eq!(verbs, ["order", "return", "goto", "plan"]);
    let planned = Planned { leg: bthreads::HOME_LEG, length_m: 9.0 }.at(ME);
    assert_eq!(vehicle.verbs_after(planned), ["planned", "homeward"]);
}

#[test]
fn a_script_that_speaks_of_what_does_not_exist_is_refused() {
    for (sync, why) in [
        (
            json!({"wait": {"any_data": "uav/1/landet"}}),
            "it waits for `uav/1/landet`, and there is no such event",
        ),
        (json!({"interrupt": "uav/7/landed"}), "it is ended by `uav/7/landed`"),
        (json!({"wait": {"and": [{"named": "uav/*/lands"}, {"data_has": {"x": 1}}]}}), "`uav/*/lands`"),
        (json!({"wait": {"prefix": "boat/"}}), "`boat/..`"),
        (json!({"wait": {"not": "landed"}}), "`landed`"),
    ] {
        let error = refusal(json!([{"sync": sync}]));
        assert!(error.contains(why), "{error} does not say {why}");
    }
    let wait =
        json!(["uav/2/landed", {"named": "uav/*/peer_lost"}, "ground/main/ordered", "uav/2/script/turn"]);
    Vehicle::in_the_air().load(&script(json!([{"sync": {"wait": wait}}]))).unwrap();
}

#[test]
fn a_script_is_explained_withdrawn_and_may_come_again() {
    let mut vehicle = Vehicle::in_the_air();
    let hold = script(json!([{"sync": {"block": {"any_data": "uav/1/advance"}, "wait": "uav/1/landed"}}]));
    vehicle.load(&hold).unwrap();
    vehicle.load(&hold).unwrap();
    assert!(!vehicle.moves());
    let explained = vehicle.program.explain(mine(Advance::NAME));
    assert!(explained.blocked.iter().any(|(bthread, _)| &**bthread == "script/test"), "{explained:?}");
    let other = script(json!([{"sync": {}}]));
    assert!(vehicle.load(&other).unwrap_err().contains("withdraw it first"));
    let happened = vehicle.hears(mine(Unload::NAME).with("name", "test").with("by", "the operator"));
    assert_eq!(states(&happened), [ScriptState::Withdrawn]);
    assert!(vehicle.moves());
    assert_eq!(vehicle.scripts.running().count(), 0);
    vehicle.load(&other).unwrap();
}

#[test]
fn a_script_says_how_it_has_ended() {
    let ended = |body: Value, event: Event| {
        let mut vehicle = Vehicle::in_the_air();
        vehicle.load(&script(body)).unwrap();
        let happened = vehicle.hears(event);
        let report = happened.iter().find_map(ScriptNews::read).unwrap();
        assert_eq!((&*report.name, report.state), ("test", ScriptState::Ended));
        assert_eq!(vehicle.scripts.running().count(), 0);
        assert!(vehicle.program.bid(&Runner::bthread_name("test")).is_none());
        report.why.to_string()
    };
    let arrived = || Arrived { leg: 7 }.at(ME);
    assert_eq!(
        ended(json!([{"sync": {"wait": {"any_data": "uav/1/arrived"}}}]), arrived()),
        "it has come to its end"
    );
    let why = ended(json!([{"sync": {"interrupt": {"any_data": "uav/1/arrived"}}}]), arrived());
    assert_eq!(why, "it was ended by uav/1/arrived{leg: 7}");
}

#[test]
fn scripts_that_go_round_by_themselves_stop_nobody() {
    let round = json!({"repeat": "forever", "do": [{"sync": {"request": "uav/1/script/x"}}]});
    let error = refusal(json!([{"sync": {"wait": {"any_data": "uav/1/arrived"}}}, round]));
    assert!(
        error.contains("it goes round without waiting for anything: uav/1/script/x after uav/1/arrived"),
        "{error}"
    );
    // Of two that keep one another going, neither does so alone.
    let mut vehicle = Vehicle::in_the_air();
    for (name, hears, says) in [("ping", "a", "b"), ("pong", "b", "a")] {
        let [hears, says] = [hears, says].map(|event| format!("uav/1/script/{event}"));
        let body =
            json!([{"repeat": "forever", "do": [{"sync": {"wait": hears}}, {"sync": {"request": says}}]}]);
        vehicle.load(&Assignment { called: Some(name.to_owned()), ..script(body) }).unwrap();
    }
    let happened = vehicle.hears(mine("script/a"));
    let report = happened.iter().find_map(ScriptNews::read).unwrap();
    assert!(report.why.contains("it did not come to rest"), "{report:?}");
    assert_eq!(vehicle.scripts.running().count(), 1);
    assert!(vehicle.moves());
}

#[test]
fn no_more_scripts_run_than_a_state_can_name() {
    let mut vehicle = Vehicle::in_the_air();
    let named =
        |number: usize| Assignment { called: Some(format!("s{number}")), ..script(json!([{"sync": {}}])) };
    (0..8).for_each(|number| vehicle.load(&named(number)).unwrap());
    assert!(vehicle.load(&named(8)).unwrap_err().contains("8 scripts run already"));
}

#[test]
fn facts_are_told_only_to_those_who_listen() {
    let mut vehicle = Vehicle::in_the_air();
    let listened = |vehicle: &Vehicle| {
        [At::NAME, Ahead::NAME, NeighbourAt::NAME, BatteryLevel::NAME]
            .map(|fact| vehicle.scripts.listen_to(fact))
    };
    assert_eq!(listened(&vehicle), [false; 4]);
    vehicle.load(&shipped("patrol", json!({"route": [[0, 0, 3]]}))).unwrap();
    assert_eq!(listened(&vehicle), [true, false, false, true]);
    vehicle.load(&shipped("curfew", json!({"min": [0, 0, 0], "max": [1, 1, 1], "for_s": 9}))).unwrap();
    assert_eq!(listened(&vehicle), [true, true, false, true]);
    vehicle.hears(OrderTaken::plain(What::Resume, "the operator").given_aboard().at(ME));
    assert_eq!(listened(&vehicle), [true, true, false, false], "the patrol has ended");
}

/// A script that keeps the vehicle where it is.
fn stay() -> Assignment {
    script(json!([{"sync": {"block": {"any_data": "uav/1/advance"}, "wait": "uav/1/landed"}}]))
}

#[test]
fn a_script_that_was_sent_is_kept_until_it_is_withdrawn() {
    let mut vehicle = Vehicle::in_the_air();
    let store = MemoryStore::default();
    vehicle.scripts.keep_in(Box::new(store.clone()));
    vehicle.load(&stay()).unwrap();
    assert_eq!(store.kept(), [KeptScript { from: SENDER.to_owned(), assignment: stay() }]);
    vehicle.hears(mine(Unload::NAME).with("name", "test").with("by", "the operator"));
    assert_eq!(store.kept(), []);
}

/// A disk that is full until somebody makes room.
#[derive(Clone, Debug, Default)]
struct Disk(Arc<AtomicBool>);

impl Store<Vec<KeptScript>> for Disk {
    fn save(&mut self, _: &Vec<KeptScript>) -> Saving {
        if self.0.load(Ordering::Relaxed) { Saving::Done } else { Saving::Failed("no space left".to_owned()) }
    }
}

#[test]
fn a_script_that_cannot_be_kept_is_refused_and_one_that_cannot_be_forgotten_is_tried_again() {
    let mut vehicle = Vehicle::in_the_air();
    let disk = Disk::default();
    vehicle.scripts.keep_in(Box::new(disk.clone()));
    let why = vehicle.load(&stay()).unwrap_err();
    assert!(why.contains("next life") && why.contains("no space left"), "{why}");
    assert!(vehicle.moves(), "nothing of it runs");

    disk.0.store(true, Ordering::Relaxed);
    vehicle.load(&stay()).unwrap();
    disk.0.store(false, Ordering::Relaxed);
    vehicle.hears(mine(Unload::NAME).with("name", "test").with("by", "the operator"));
    assert!(vehicle.moves(), "it is withdrawn all the same");
    assert_eq!(vehicle.scripts.unsaved(), Some("no space left"));
    vehicle.scripts.catch_up(Duration::ZERO, &mut vehicle.program);
    disk.0.store(true, Ordering::Relaxed);
    vehicle.scripts.catch_up(Duration::from_millis(900), &mut vehicle.program);
    assert_eq!(
        vehicle.scripts.unsaved(),
        Some("no space left"),
        "a disk that fails is left alone for a while"
    );
    vehicle.scripts.catch_up(Duration::from_secs(1), &mut vehicle.program);
    assert_eq!(vehicle.scripts.unsaved(), None);
}

#[test]
fn a_script_of_a_former_life_begins_when_the_vehicle_is_let_go_on() {
    let begins_with = |mut vehicle: Vehicle, release: Event| {
        vehicle.scripts.load(&mut vehicle.program, &stay(), SENDER, Begins::WhenReleased).unwrap();
        vehicle.happens();
        let blocks = |vehicle: &Vehicle| {
            let explained = vehicle.program.explain(mine(Advance::NAME));
            explained.blocked.iter().any(|(bthread, _)| &**bthread == "script/test")
        };
        assert!(!blocks(&vehicle));
        vehicle.hears(release);
        blocks(&vehicle)
    };
    assert!(begins_with(Vehicle::on_the_ground(), mine(Ready::NAME)));
    assert!(begins_with(
        Vehicle::in_the_air(),
        OrderTaken::plain(What::Resume, "the operator").given_aboard().at(ME)
    ));
    assert!(!begins_with(
        Vehicle::in_the_air(),
        OrderTaken::plain(What::Hold, "the operator").given_aboard().at(ME)
    ));
}

#[test]
fn a_script_cannot_order_in_anothers_name() {
    let land = json!({"name": "uav/1/order", "data": {"what": "land", "by": "Anna"}});
    let ordered = |request: Value| {
        let mut vehicle = Vehicle::in_the_air();
        vehicle
            .load(&script(
                json!([{"sync": {"request": request}}, {"sync": {"request": "uav/1/script/done"}}]),
            ))
            .unwrap();
        let events = vehicle.hears(mine("clear"));
        assert!(events.iter().any(|event| event.name() == "uav/1/script/done"), "it goes on: {events:?}");
        events.iter().find_map(OrderTaken::read).unwrap()
    };
    for request in [land, json!({"name": "uav/1/order", "data": {"what": "land"}})] {
        let order = ordered(request);
        assert_eq!((&*order.by, order.aboard), ("script/test", Some(true)));
    }
}

#[test]
fn a_script_that_is_there_from_the_start_does_not_end_the_hold_of_a_vehicle_found_in_the_air() {
    let onward = script(json!([
        {"sync": {"request": {"name": "uav/1/order", "data": {"what": "resume", "by": "script/test"}}}},
        {"sync": {"wait": "uav/1/landed"}},
    ]));
    let by_script = |events: &[Event]| {
        events.iter().any(|event| OrderTaken::read(event).is_some_and(|order| &*order.by == "script/test"))
    };
    let found = |begins| {
        let mut vehicle = Vehicle::on_the_ground();
        vehicle.scripts.load(&mut vehicle.program, &onward, SENDER, begins).unwrap();
        let events = vehicle.hears(mine(FoundAirborne::NAME));
        (vehicle, by_script(&events))
    };
    assert!(found(Begins::AtOnce).1, "one that is sent then may");
    let (mut vehicle, orders) = found(Begins::WhenReleased);
    assert!(!orders);
    assert!(by_script(&vehicle.hears(mine(HandBack::NAME))), "whoever hands it back lets it go on");

    let (mut vehicle, _) = found(Begins::WhenReleased);
    let events = vehicle.hears(mine(Unload::NAME).with("name", "test").with("by", "the operator"));
    assert_eq!(states(&events), [ScriptState::Withdrawn]);
    assert!(
        !by_script(&vehicle.hears(OrderTaken::plain(What::Resume, "the operator").given_aboard().at(ME))),
        "withdrawn before it began"
    );

    // So are those of the configuration.
    let mut core = AgentCore::new(AgentConfig { scripts: vec![onward], ..config() }).unwrap();
    let mut link = Network::new(NetworkConfig::default(), 1).join(core.name());
    core.tick(Duration::ZERO, &mut link);
    let bid = core.node().node().program().bid(&Runner::bthread_name("test")).unwrap();
    assert!(bid.waits().contains(&mine(Ready::NAME)), "{bid:?}");
}

#[test]
fn the_next_life_runs_what_was_kept_and_forgets_what_passes_no_more() {
    let from = |from: &str, called: &str| KeptScript {
        from: from.to_owned(),
        assignment: Assignment { called: Some(called.to_owned()), ..stay() },
    };
    let kept = [
        from(SENDER, "good"),
        from("uav/2#friend", "vehicles"),
        from("ground/other#scripts for uav/1", "strangers"),
        from("no node#", "nobodys"),
        KeptScript {
            from: SENDER.to_owned(),
            assignment: script(json!([{"sync": {"block": "uav/1/land"}}])),
        },
    ];
    let store = MemoryStore::default();
    let core = AgentCore::new(config()).unwrap().keeping_scripts(Box::new(store.clone()), &kept);
    assert_eq!(core.scripts().map(|(name, _)| name).collect::<Vec<_>>(), ["good"]);
    assert_eq!(store.kept(), kept[..1]);

    let none = AgentConfig { authority: skein_dbp::Authority::new(Vec::new(), None), ..config() };
    let core = AgentCore::new(none).unwrap().keeping_scripts(Box::new(store.clone()), &kept);
    assert_eq!((core.scripts().count(), store.kept().len()), (0, 0), "its sender has no right any more");
}

#[test]
fn patrol_flies_round_and_goes_on_with_the_mission_at_its_level() {
    let mut vehicle = Vehicle::in_the_air();
    vehicle.load(&shipped("patrol", json!({"route": [[1, 2, 3], [4, 5, 6]], "min_percent": 30}))).unwrap();
    let goto = |events: &[Event]| {
        let goto = events.iter().find_map(Goto::read)?;
        Some([goto.x, goto.y, goto.z])
    };
    assert_eq!(goto(&vehicle.hears(at(At::NAME, [0.0; 3]))), Some([1.0, 2.0, 3.0]));
    let arrived = Arrived { leg: bthreads::OPERATOR_LEG }.at(ME);
    for place in [[4.0, 5.0, 6.0], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]] {
        assert_eq!(goto(&vehicle.hears(arrived.clone())), Some(place));
    }
    assert_eq!(goto(&vehicle.hears(BatteryLevel { percent: 35 }.at(ME))), None);
    assert_eq!(goto(&vehicle.hears(BatteryLevel { percent: 30 }.at(ME))), Some([50.0, 0.0, 3.0]));
    assert_eq!(vehicle.scripts.running().count(), 0);
}

#[test]
fn patrol_gives_way_to_an_operator_and_passes_over_points_out_of_bounds() {
    let mut vehicle = Vehicle::in_the_air();
    vehicle.load(&shipped("patrol", json!({"route": [[900, 0, 3], [4, 5, 6]]}))).unwrap();
    assert_eq!(vehicle.verbs_after(at(At::NAME, [0.0; 3])), ["at", "order"]);
    vehicle.now += Duration::from_secs(3);
    let happened = vehicle.happens();
    assert!(happened.iter().any(|event| event.kind() == Declined::NAME));
    assert_eq!(happened.iter().find_map(Goto::read).map(|goto| goto.x), Some(4.0));
    let point = OrderTaken::go_to([7.0, 7.0, 3.0], "the operator").given_aboard().at(ME);
    assert_eq!(vehicle.hears(point).iter().find_map(Goto::read).map(|goto| goto.x), Some(7.0));
    assert_eq!(vehicle.scripts.running().count(), 0);
}

#[test]
fn curfew_keeps_a_vehicle_out_while_it_lasts_and_lets_one_inside_leave() {
    let region = json!({"min": [10, -5, 0], "max": [20, 5, 10], "after_s": 5, "for_s": 60});
    let (inside, outside) = ([15.0, 0.0, 3.0], [2.0, 0.0, 3.0]);
    for begins_inside in [false, true] {
        let mut vehicle = Vehicle::in_the_air();
        vehicle.load(&shipped("curfew", region.clone())).unwrap();
        vehicle.hears(at(Ahead::NAME, inside));
        assert!(vehicle.moves(), "it has not begun");
        vehicle.now += Duration::from_secs(5);
        vehicle.hears(at(At::NAME, if begins_inside { inside } else { outside }));
        assert_eq!(vehicle.moves(), begins_inside);
        vehicle.hears(at(At::NAME, outside));
        vehicle.hears(at(Ahead::NAME, outside));
        assert!(vehicle.moves(), "outside");
        vehicle.hears(at(Ahead::NAME, inside));
        assert!(!vehicle.moves(), "about to fly in");
        vehicle.now += Duration::from_secs(61);
        assert!(vehicle.moves(), "it is over");
    }
}

#[test]
fn alternate_waits_for_the_other_and_does_not_wait_for_ever() {
    let with =
        |first: i64| json!({"other": "uav/2", "min": [10, -5, 0], "max": [20, 5, 10], "goes_first": first});
    let (inside, outside) = ([15.0, 0.0, 3.0], [2.0, 0.0, 3.0]);
    let other = |place| at(NeighbourAt::NAME, place).with("node", "uav/2").with("distance_m", 9.0);
    let mut first = Vehicle::in_the_air();
    first.load(&shipped("alternate", with(1))).unwrap();
    let mut second = Vehicle::in_the_air();
    second.load(&shipped("alternate", with(0))).unwrap();
    for vehicle in [&mut first, &mut second] {
        vehicle.hears(at(Ahead::NAME, inside));
    }
    assert!(first.moves() && !second.moves());
    [inside, outside].into_iter().for_each(|place| drop(first.hears(at(At::NAME, place))));
    assert!(!first.moves(), "it is not its turn again");
    [inside, outside].into_iter().for_each(|place| drop(second.hears(other(place))));
    assert!(second.moves());
    first.now += Duration::from_secs(121);
    assert!(first.moves(), "its patience is at an end");
    [inside, outside].into_iter().for_each(|place| drop(second.hears(at(At::NAME, place))));
    assert!(!second.moves());
    second.program.occurred(Landed.at("uav/2"));
    assert!(second.moves(), "there is nobody to take turns with");
}

#[test]
fn follow_keeps_its_distance_and_goes_on_when_the_leader_lands() {
    let mut vehicle = Vehicle::in_the_air();
    vehicle.load(&shipped("follow", json!({"leader": "uav/2", "distance_m": 8}))).unwrap();
    let leader = |x: f64, distance_m: f64| {
        at(NeighbourAt::NAME, [x, 0.0, 3.0]).with("node", "uav/2").with("distance_m", distance_m)
    };
    let goto = |events: Vec<Event>| events.iter().find_map(Goto::read).map(|goto| goto.x);
    assert_eq!(goto(vehicle.hears(leader(20.0, 12.0))), Some(20.0));
    assert_eq!(goto(vehicle.hears(leader(21.0, 11.0))), Some(21.0));
    vehicle.hears(Planned { leg: bthreads::OPERATOR_LEG, length_m: 5.0 }.at(ME));
    assert!(vehicle.moves());
    vehicle.hears(leader(21.0, 7.5));
    assert!(!vehicle.moves(), "near enough");
    vehicle.hears(leader(24.0, 9.0));
    assert!(vehicle.moves());
    assert_eq!(goto(vehicle.hears(leader(25.0, 10.0))), Some(25.0));
    vehicle.program.occurred(Land { why: "mission complete".into() }.at("uav/2"));
    assert_eq!(goto(vehicle.happens()), Some(50.0));
}

#[test]
fn what_is_shipped_says_what_it_is_for_and_fits_its_name() {
    for (name, text) in SHIPPED {
        let script = ScriptFile::parse(&format!("{name}.toml"), text).unwrap();
        assert_eq!(script.name, name);
        assert!(
            script.about.ends_with('.') && script.parameters.values().all(|p| p.about.ends_with('.')),
            "{name}"
        );
    }
    assert!(matches!(shipped("patrol", json!({})).bind(ME).unwrap_err().field.as_str(), "with.route"));
    assert!(matches!(shipped("curfew", json!({"for_s": 5})).with["for_s"], Argument::Integer(5)));
}

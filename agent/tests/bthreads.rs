//! A vehicle's b-threads, run together: what they make of what the vehicle and the fleet report.

use std::time::Duration;

use skein_agent::{
    AgentConfig, Envelope, Errand, Fence, Me, PayloadCommand, Planners,
    bthreads::{self, HOLDING_LASTS, Holder, LinkLossPolicy},
};
use skein_bp::{Bid, Event, EventSet, Program, ProgramConfig};
use skein_dbp::NodeName;
use skein_dbp::facts::{BlockLapsed, Confirmed, DuplicateName, PeerJoined, PeerLost, Stalled};
use skein_mav::Datum;
use skein_wire::Limits;
use skein_wire::event::*;

/// Its number follows 9 as a number, not as a text.
const ME: &str = "uav/10";
const LOWER: &str = "uav/9";
const HIGHER: &str = "uav/11";
const GROUND: &str = "ground/1";
const RETURN_ALTITUDE_M: f64 = 7.0;
const CYCLE: Duration = Duration::from_millis(100);
const SECOND: Duration = Duration::from_secs(1);
const NOTHING: [&str; 0] = [];

fn config() -> AgentConfig {
    AgentConfig {
        fleet: "test".to_owned(),
        node: ME.to_owned(),
        ground: GROUND.to_owned(),
        roster: [ME, LOWER, HIGHER, GROUND].map(str::to_owned).to_vec(),
        incarnation: 1,
        system_id: 11,
        datum: Datum::from_degrees(47.4, 8.5, 400.0),
        home: [1.0, 2.0, 0.0],
        waypoints: vec![[10.0, 0.0, 2.0], [10.0, 10.0, 2.0]],
        errands: Vec::new(),
        rally: Vec::new(),
        arrives_with: Vec::new(),
        takeoff_height_m: 2.0,
        return_altitude_m: RETURN_ALTITUDE_M,
        position: Default::default(),
        signing: None,
        sigma_limit_m: 2.0,
        lidar: true,
        fence: Fence { min: [-20.0, -20.0, 0.0], max: [20.0, 20.0, 10.0] },
        airspace: Default::default(),
        envelope: Envelope::default(),
        planners: Planners::default(),
        link_loss: LinkLossPolicy::Continue,
        scripts: Vec::new(),
        behaviours: Default::default(),
        lease: SECOND,
        radio_range_m: None,
        epoch: Duration::ZERO,
        authority: skein_wire::standard_authority(),
        kept: skein_dbp::Kept::default(),
        seed: 1,
    }
}

fn mine(verb: &str) -> Event {
    Event::new(format!("{ME}/{verb}"))
}

fn joined(node: &str) -> Event {
    PeerJoined { node: NodeName::new(node).unwrap(), incarnation: 1 }.at(ME)
}

fn lost(node: &str, released: &str) -> Event {
    PeerLost { node: NodeName::new(node).unwrap(), released: released.into(), held: None }.at(ME)
}

fn at(verb: Event, [x, y, z]: [f64; 3]) -> Event {
    verb.with("x", x).with("y", y).with("z", z)
}

/// What the tests compare: the verb, with the datum that matters; other nodes are named.
fn told(event: &Event) -> String {
    let verb = Me::new(ME).verb(event).unwrap_or(event.name()).to_owned();
    match (why(event), event.text("what"), event.int("leg")) {
        (Some(why), _, _) => format!("{verb}: {why}"),
        (_, Some(what), _) => format!("{verb} {what}"),
        (_, _, Some(leg)) => format!("{verb} {leg}"),
        _ => verb,
    }
}

/// A vehicle's program with a clock. Whatever is done to it answers with what then happened.
#[derive(Clone)]
struct Vehicle {
    program: Program,
    now: Duration,
    /// Everything that happened so far.
    log: Vec<Event>,
}

impl Vehicle {
    fn new(config: &AgentConfig) -> Self {
        let mut program = Program::new(ProgramConfig::vehicle(config.seed));
        bthreads::load(&mut program, config);
        Self { program, now: Duration::ZERO, log: Vec::new() }
    }

    /// In the air, on its way to the first waypoint, without a path yet.
    fn in_the_air(config: &AgentConfig) -> Self {
        let mut vehicle = Self::new(config);
        assert_eq!(vehicle.reports(Ready::NAME), ["ready"]);
        assert_eq!(vehicle.reports(Takeoff::NAME), ["takeoff"]);
        assert_eq!(vehicle.reports(Airborne::NAME), ["airborne", "goto 0", "plan: waypoint"]);
        vehicle
    }

    /// Moving along a path to the first waypoint.
    fn on_its_way() -> Self {
        let mut vehicle = Self::in_the_air(&config());
        assert_eq!(vehicle.reports(Planned::NAME), ["planned", "advance"]);
        vehicle
    }

    fn happened(&mut self) -> Vec<String> {
        let selections = self.program.superstep(self.now).unwrap();
        let events: Vec<Event> = selections.into_iter().map(|selection| selection.event).collect();
        let told = events.iter().map(told).collect();
        self.log.extend(events);
        told
    }

    /// An external event.
    fn hears(&mut self, event: Event) -> Vec<String> {
        self.program.enqueue(event);
        self.happened()
    }

    /// An external event of the vehicle itself, without data.
    fn reports(&mut self, verb: &str) -> Vec<String> {
        self.hears(mine(verb))
    }

    fn arrives(&mut self, leg: i64) -> Vec<String> {
        self.hears(Arrived { leg }.at(ME))
    }

    fn is_ordered(&mut self, what: What) -> Vec<String> {
        self.hears(OrderTaken::plain(what, "the operator").given_aboard().at(ME))
    }

    /// A fact of the fleet, or an event of another home.
    fn learns(&mut self, event: Event) -> Vec<String> {
        self.program.occurred(event);
        self.happened()
    }

    fn after(&mut self, wait: Duration) -> Vec<String> {
        self.now += wait;
        self.happened()
    }

    /// Whether `event` could happen now.
    fn allows(&self, event: Event) -> bool {
        let mut other = self.clone();
        other.program.enqueue(event.clone());
        other.happened();
        other.log.iter().skip(self.log.len()).any(|happened| *happened == event)
    }

    /// Whether the vehicle could be told to do this, somewhere inside its fence.
    fn may(&self, verb: &str) -> bool {
        self.allows(at(mine(verb), [0.0, 0.0, 2.0]))
    }

    fn last(&self, verb: &str) -> &Event {
        self.log.iter().rfind(|event| event.kind() == verb).unwrap()
    }
}

mod mission {
    use super::*;

    #[test]
    fn flies_the_waypoints_in_turn_then_lands_and_completes_whatever_the_seed() {
        for seed in 0..8 {
            let mut vehicle = Vehicle::in_the_air(&AgentConfig { seed, ..config() });
            assert_eq!(*vehicle.last(Goto::NAME), {
                let goto = mine(Goto::NAME).with("leg", 0_i64).with("lands", false);
                at(goto, [10.0, 0.0, 2.0])
            });
            assert_eq!(vehicle.reports(Planned::NAME), ["planned", "advance"]);
            assert_eq!(vehicle.arrives(0), ["arrived 0", "goto 1", "plan: waypoint"]);
            assert_eq!(Goto::read(vehicle.last(Goto::NAME)).map(|goto| goto.lands), Some(true));
            assert_eq!(vehicle.arrives(0), ["arrived 0"], "an old waypoint does not count again");
            assert_eq!(vehicle.arrives(1), ["arrived 1", "land: mission complete"]);
            assert_eq!(vehicle.reports(Landed::NAME), ["landed", "complete"]);
            assert_eq!(vehicle.after(10 * SECOND), NOTHING);
        }
    }

    #[test]
    fn stays_tells_what_it_carries_and_slows_down_between_waypoints() {
        let picture = |command| PayloadCommand { command, params: [5.0, f64::NAN, 1.0, 0.0, 0.0, 0.0, 0.0] };
        let errands = vec![
            Errand {
                before: 1,
                stay_s: 10.0,
                speed_m_s: Some(1.5),
                payload: vec![picture(206), picture(2000)],
            },
            Errand { before: 2, stay_s: 3.0, ..Errand::default() },
        ];
        let mut vehicle = Vehicle::in_the_air(&AgentConfig { errands, ..config() });
        let limit = |vehicle: &Vehicle| Limits::of(ME, vehicle.program.stated()).speed_m_s();
        vehicle.reports(Planned::NAME);
        assert_eq!(limit(&vehicle), f64::INFINITY);
        assert_eq!(vehicle.arrives(0), ["arrived 0"]);
        assert_eq!(vehicle.after(9 * SECOND), NOTHING);
        assert_eq!(vehicle.after(SECOND), ["payload", "payload", "goto 1", "plan: waypoint"]);
        let told = Payload::read(vehicle.last(Payload::NAME)).unwrap();
        assert_eq!((told.command, told.param1, told.param2, told.param3), (2000, Some(5.0), None, Some(1.0)));
        assert_eq!(limit(&vehicle), 1.5);
        vehicle.reports(Planned::NAME);
        assert_eq!(vehicle.arrives(1), ["arrived 1"]);
        assert_eq!(limit(&vehicle), f64::INFINITY);
        assert_eq!(vehicle.after(3 * SECOND), ["land: mission complete"]);
    }

    #[test]
    fn a_stay_ends_with_an_order_and_the_mission_goes_on_after_it() {
        let errands = vec![Errand { before: 1, stay_s: 10.0, ..Errand::default() }];
        let mut vehicle = Vehicle::in_the_air(&AgentConfig { errands, ..config() });
        vehicle.reports(Planned::NAME);
        vehicle.arrives(0);
        vehicle.is_ordered(What::Return);
        vehicle.reports(Planned::NAME);
        assert_eq!(vehicle.after(20 * SECOND).iter().filter(|event| event.starts_with("goto")).count(), 0);
        assert_eq!(vehicle.arrives(-1), ["arrived -1", "land: ordered by the operator"]);
    }

    #[test]
    fn fails_when_the_vehicle_cannot_take_off() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(Ready::NAME);
        vehicle.reports(Takeoff::NAME);
        let refused = CommandFailed { why: "Arm: denied".into() }.at(ME);
        assert_eq!(vehicle.hears(refused), ["command_failed: Arm: denied", "failed: Arm: denied"]);
    }

    #[test]
    fn fails_when_the_autopilot_lands_by_itself() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.reports(Landed::NAME), ["landed", "failed: the autopilot landed by itself"]);
    }
}

mod before_take_off {
    use super::*;

    #[test]
    fn take_off_waits_until_the_vehicle_is_ready() {
        let mut vehicle = Vehicle::new(&config());
        assert_eq!(vehicle.reports(Takeoff::NAME), NOTHING);
        assert_eq!(vehicle.reports(Ready::NAME), ["ready", "takeoff"]);
    }

    #[test]
    fn take_off_waits_again_once_a_check_fails() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(Ready::NAME);
        assert!(vehicle.may(Takeoff::NAME));
        vehicle.reports(Unready::NAME);
        assert_eq!(vehicle.reports(Takeoff::NAME), NOTHING);
        assert_eq!(vehicle.reports(Ready::NAME), ["ready", "takeoff"]);
    }

    #[test]
    fn a_vehicle_that_has_taken_off_takes_off_again_only_from_the_ground() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(Ready::NAME);
        vehicle.reports(Takeoff::NAME);
        assert!(!vehicle.may(Takeoff::NAME));
        vehicle.hears(CommandFailed { why: "Arm: denied".into() }.at(ME));
        let mut other = Vehicle::new(&config());
        other.reports(Ready::NAME);
        other.reports(Takeoff::NAME);
        other.program.remove("mission");
        other.reports(Landed::NAME);
        assert!(other.may(Takeoff::NAME));
    }

    #[test]
    fn an_order_to_return_on_the_ground_does_not_count_in_the_air() {
        let mut vehicle = Vehicle::new(&config());
        assert_eq!(vehicle.is_ordered(What::Return), ["order return", "return: ordered by the operator"]);
        vehicle.reports(Ready::NAME);
        vehicle.reports(Takeoff::NAME);
        assert_eq!(vehicle.reports(Airborne::NAME), ["airborne", "goto 0", "plan: waypoint"]);
        let home = ["battery_low", "return: battery low", "goto -1", "plan: waypoint"];
        assert_eq!(vehicle.reports(BatteryLow::NAME), home, "it was still returning");
    }

    #[test]
    fn a_remote_request_takes_the_vehicle_off_once_it_is_ready() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.program.put_proxy("ground/1#launch", &Bid::new().request(mine(Takeoff::NAME)));
        assert_eq!(vehicle.happened(), NOTHING);
        assert_eq!(vehicle.reports(Ready::NAME), ["ready", "takeoff"]);
    }
}

mod pilot {
    use super::*;

    #[test]
    fn blocks_every_movement_until_the_vehicle_is_handed_back() {
        let moves =
            [Goto::NAME, Plan::NAME, Advance::NAME, Enter::NAME, Hold::NAME, Land::NAME, Return::NAME];
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(moves.map(|verb| vehicle.may(verb)), [true; 7]);
        assert_eq!(vehicle.reports(PilotTook::NAME), ["pilot"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert_eq!(moves.map(|verb| vehicle.may(verb)), [false; 7]);
        assert_eq!(vehicle.is_ordered(What::HandBack), ["order hand_back", "hand_back", "advance"]);
        assert_eq!(moves.map(|verb| vehicle.may(verb)), [true; 7]);
    }

    #[test]
    fn goes_before_an_empty_battery() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.reports(PilotTook::NAME);
        assert_eq!(vehicle.reports(BatteryCritical::NAME), ["battery_critical"]);
        assert_eq!(
            vehicle.is_ordered(What::HandBack),
            ["order hand_back", "hand_back", "land: battery nearly empty"]
        );
    }
}

mod path {
    use super::*;

    fn unplannable() -> Event {
        Unplannable { leg: 0, why: "walled in".into(), zone: None }.at(ME)
    }

    #[test]
    fn a_waypoint_without_one_is_tried_three_times_then_the_vehicle_lands_and_fails() {
        let mut vehicle = Vehicle::in_the_air(&config());
        for _ in 0..2 {
            assert_eq!(vehicle.hears(unplannable()), ["unplannable: walled in"]);
            assert_eq!(vehicle.after(SECOND - CYCLE), NOTHING);
            assert_eq!(vehicle.after(CYCLE), ["plan: waypoint"]);
        }
        assert_eq!(vehicle.hears(unplannable()), ["unplannable: walled in", "land: walled in"]);
        assert_eq!(vehicle.reports(Landed::NAME), ["landed", "failed: walled in"]);
    }

    #[test]
    fn found_at_a_later_try_is_flown_and_the_next_waypoint_has_all_its_tries() {
        let mut vehicle = Vehicle::in_the_air(&config());
        for _ in 0..2 {
            vehicle.hears(unplannable());
            vehicle.after(SECOND);
        }
        assert_eq!(vehicle.reports(Planned::NAME), ["planned", "advance"]);
        assert_eq!(vehicle.arrives(0), ["arrived 0", "goto 1", "plan: waypoint"]);
        for _ in 0..2 {
            assert_eq!(vehicle.hears(unplannable()), ["unplannable: walled in"]);
            assert_eq!(vehicle.after(SECOND), ["plan: waypoint"]);
        }
    }

    #[test]
    fn is_followed_one_cycle_at_a_time() {
        let mut vehicle = Vehicle::on_its_way();
        for _ in 0..3 {
            assert_eq!(vehicle.after(CYCLE / 2), NOTHING);
            assert_eq!(vehicle.after(CYCLE / 2), ["advance"]);
        }
        vehicle.program.put_proxy("ground/1#freeze", &Bid::new().block(of::<Advance>(ME)));
        assert_eq!(vehicle.after(SECOND), NOTHING, "another node may hold the vehicle");
        vehicle.program.remove_proxy("ground/1#freeze");
        assert_eq!(vehicle.happened(), ["advance"]);
    }

    #[test]
    fn that_is_blocked_stops_the_vehicle_until_there_is_a_new_one() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.reports(PathBlocked::NAME), ["path_blocked", "plan: obstacle"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert!(!vehicle.may(Advance::NAME));
        assert_eq!(vehicle.hears(unplannable()), ["unplannable: walled in"]);
        assert_eq!(vehicle.after(SECOND), ["plan: waypoint"], "the waypoint is tried again");
        assert_eq!(vehicle.reports(Planned::NAME), ["planned", "advance"]);
    }

    #[test]
    fn is_planned_anew_when_the_vehicle_is_stuck_and_after_twelve_times_it_lands() {
        let mut vehicle = Vehicle::on_its_way();
        for _ in 0..12 {
            assert_eq!(vehicle.reports(Stuck::NAME), ["stuck", "plan: stuck"]);
        }
        let why = "stuck: no way past what stands around";
        assert_eq!(vehicle.reports(Stuck::NAME), ["stuck".to_owned(), format!("land: {why}")]);
        assert_eq!(vehicle.reports(Landed::NAME), ["landed".to_owned(), format!("failed: {why}")]);
    }

    #[test]
    fn may_be_planned_anew_twelve_times_for_each_waypoint() {
        let mut vehicle = Vehicle::on_its_way();
        for leg in 0..2 {
            for _ in 0..12 {
                assert_eq!(vehicle.reports(Stuck::NAME), ["stuck", "plan: stuck"]);
            }
            vehicle.arrives(leg);
        }
        assert_eq!(told(vehicle.last(Land::NAME)), "land: mission complete");
    }
}

mod await_place {
    use super::*;

    fn taken(leg: i64) -> Event {
        PlaceTaken { leg, by: "uav/4".into(), leaves: false }.at(ME)
    }

    #[test]
    fn a_vehicle_waits_for_who_has_its_place_and_goes_on_when_that_is_gone() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.hears(taken(0));
        assert_eq!(vehicle.after(19 * SECOND), NOTHING, "it has no leave to move");
        assert_eq!(vehicle.reports(PlaceFree::NAME), ["place_free", "advance"]);
    }

    #[test]
    fn it_waits_for_twenty_seconds_in_all_and_then_lands_and_says_for_whom_it_waited() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.hears(taken(0));
        vehicle.after(15 * SECOND);
        vehicle.reports(PlaceFree::NAME);
        vehicle.hears(taken(0));
        assert_eq!(vehicle.after(4 * SECOND), NOTHING);
        let why = "uav/4 stays where it was to land";
        assert_eq!(vehicle.after(SECOND), [format!("land: {why}")]);
        assert_eq!(vehicle.reports(Landed::NAME), ["landed".to_owned(), format!("failed: {why}")]);
        let mut vehicle = Vehicle::on_its_way();
        vehicle.hears(taken(0));
        vehicle.after(15 * SECOND);
        vehicle.arrives(0);
        vehicle.reports(Planned::NAME);
        vehicle.hears(taken(1));
        assert_eq!(vehicle.after(19 * SECOND), NOTHING, "for each waypoint anew");
    }

    #[test]
    fn who_is_on_its_way_elsewhere_is_waited_for_longer() {
        let leaves = || PlaceTaken { leg: 0, by: "uav/4".into(), leaves: true }.at(ME);
        let mut vehicle = Vehicle::on_its_way();
        vehicle.hears(leaves());
        assert_eq!(vehicle.after(89 * SECOND), NOTHING);
        vehicle.hears(taken(0));
        assert_eq!(vehicle.after(19 * SECOND), NOTHING, "it has landed there after all");
        assert_eq!(vehicle.after(SECOND), ["land: uav/4 stays where it was to land"]);
    }

    #[test]
    fn the_way_home_and_to_an_operators_point_is_not_waited_on() {
        for leg in [-1, -2] {
            let mut vehicle = Vehicle::on_its_way();
            vehicle.hears(taken(leg));
            assert!(vehicle.after(SECOND).contains(&"advance".to_owned()), "leg {leg}");
        }
    }
}

mod operator {
    use super::*;

    #[test]
    fn holds_the_vehicle_until_it_may_resume() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.is_ordered(What::Hold), ["order hold", "hold: ordered by the operator"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert_eq!(vehicle.is_ordered(What::Resume), ["order resume", "advance"]);
    }

    #[test]
    fn lands_the_vehicle() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.is_ordered(What::Land), ["order land", "land: ordered by the operator"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert_eq!(vehicle.reports(Landed::NAME), ["landed", "failed: ordered by the operator"]);
    }

    #[test]
    fn sends_the_vehicle_home_where_it_lands() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(
            vehicle.is_ordered(What::Return),
            ["order return", "return: ordered by the operator", "goto -1", "plan: waypoint"]
        );
        assert_eq!(*vehicle.last(Goto::NAME), {
            let home = mine(Goto::NAME).with("leg", bthreads::HOME_LEG).with("lands", true);
            at(home, [1.0, 2.0, RETURN_ALTITUDE_M])
        });
        assert_eq!(vehicle.reports(Planned::NAME), ["planned", "advance"]);
        assert_eq!(vehicle.arrives(-1), ["arrived -1", "land: ordered by the operator"]);
        assert_eq!(vehicle.reports(Landed::NAME), ["landed", "failed: ordered by the operator"]);
    }

    #[test]
    fn who_orders_a_held_vehicle_home_lets_it_move() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.is_ordered(What::Hold);
        vehicle.is_ordered(What::Return);
        assert_eq!(vehicle.reports(Planned::NAME), ["planned", "advance"]);
    }

    #[test]
    fn whoever_has_its_mission_behind_it_declines_to_go_on() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.is_ordered(What::Land);
        vehicle.reports(Landed::NAME);
        let said = vehicle.is_ordered(What::Resume);
        assert_eq!(said[0], "order resume");
        assert!(said[1].starts_with("declined") && said.len() == 2, "{said:?}");
        let why = vehicle.last(Declined::NAME).text("why").unwrap();
        assert_eq!(why, "its mission is over, and it stands on the ground");
        assert_eq!(vehicle.is_ordered(What::Resume), said, "and again");
    }

    #[test]
    fn is_not_heeded_when_the_order_is_unknown() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(mine(OrderTaken::NAME).with("what", "dance")), ["order dance"]);
        assert_eq!(vehicle.after(CYCLE), ["advance"]);
    }
}

mod battery {
    use super::*;

    #[test]
    fn when_low_sends_the_vehicle_home() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(
            vehicle.hears(BatteryLow { why: "battery charge unknown".into() }.at(ME)),
            [
                "battery_low: battery charge unknown",
                "return: battery charge unknown",
                "goto -1",
                "plan: waypoint"
            ]
        );
        assert_eq!(vehicle.reports(Planned::NAME), ["planned", "advance"]);
        assert_eq!(vehicle.arrives(-1), ["arrived -1", "land: battery charge unknown"]);
        assert_eq!(vehicle.reports(Landed::NAME), ["landed", "failed: battery charge unknown"]);
    }

    #[test]
    fn when_critical_lands_the_vehicle_and_nothing_sends_it_elsewhere() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.reports(BatteryLow::NAME);
        assert_eq!([Goto::NAME, Return::NAME].map(|verb| vehicle.may(verb)), [true; 2]);
        assert_eq!(
            vehicle.reports(BatteryCritical::NAME),
            ["battery_critical", "land: battery nearly empty"]
        );
        assert_eq!([Goto::NAME, Return::NAME].map(|verb| vehicle.may(verb)), [false; 2]);
        assert_eq!(vehicle.reports(FenceBreached::NAME), ["fence_breached"], "not even the geofence");
        assert_eq!(vehicle.after(SECOND), NOTHING);
    }
}

mod geofence {
    use super::*;

    #[test]
    fn lets_nobody_fly_to_a_waypoint_outside() {
        let waypoints = vec![[10.0, 0.0, 2.0], [30.0, 0.0, 2.0]];
        let mut vehicle = Vehicle::in_the_air(&AgentConfig { waypoints, ..config() });
        vehicle.reports(Planned::NAME);
        assert_eq!(vehicle.arrives(0), ["arrived 0"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        let may_go = |place| vehicle.allows(at(mine(Goto::NAME), place));
        assert!(may_go([20.0, 20.0, 10.0]));
        assert!(!may_go([20.1, 0.0, 2.0]) && !may_go([0.0, -20.1, 2.0]) && !may_go([0.0, 0.0, 10.1]));
    }

    #[test]
    fn sends_a_vehicle_outside_home() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(
            vehicle.reports(FenceBreached::NAME),
            ["fence_breached", "return: outside the geofence", "goto -1", "plan: waypoint"]
        );
        vehicle.reports(Planned::NAME);
        assert_eq!(vehicle.arrives(-1), ["arrived -1", "land: outside the geofence"]);
        assert_eq!(vehicle.reports(Landed::NAME), ["landed", "failed: outside the geofence"]);
    }
}

mod rally {
    use super::*;

    fn told(vehicle: &mut Vehicle, x: f64) {
        assert_eq!(vehicle.hears(Refuge { x, y: 1.0, z: 6.0 }.at(ME)), ["refuge"]);
    }

    #[test]
    fn a_return_leads_to_the_place_that_was_told_last() {
        let mut vehicle = Vehicle::on_its_way();
        told(&mut vehicle, 15.0);
        told(&mut vehicle, 17.0);
        vehicle.is_ordered(What::Return);
        let leads_to =
            |vehicle: &Vehicle| Goto::read(vehicle.last(Goto::NAME)).map(|goto| (goto.leg, goto.x));
        assert_eq!(leads_to(&vehicle), Some((-1, 17.0)));
        vehicle.reports(Planned::NAME);
        let elsewhere = Refuge { x: 15.0, y: 1.0, z: 6.0 }.at(ME);
        assert_eq!(vehicle.hears(elsewhere), ["refuge", "goto -1", "plan: waypoint"]);
        assert_eq!(leads_to(&vehicle), Some((-1, 15.0)));
        assert_eq!(vehicle.arrives(-1), ["arrived -1", "land: ordered by the operator"]);
    }
}

mod found_airborne {
    use super::*;

    #[test]
    fn the_vehicle_holds_until_it_may_resume_and_then_flies_its_mission() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(Ready::NAME);
        assert_eq!([Takeoff::NAME, Goto::NAME, Advance::NAME].map(|verb| vehicle.may(verb)), [true; 3]);
        assert_eq!(
            vehicle.reports(FoundAirborne::NAME),
            ["found_airborne", "hold: the agent started in the air"]
        );
        assert_eq!([Takeoff::NAME, Goto::NAME, Advance::NAME].map(|verb| vehicle.may(verb)), [false; 3]);
        assert_eq!(vehicle.is_ordered(What::Hold), ["order hold", "hold: ordered by the operator"]);
        assert_eq!([Takeoff::NAME, Goto::NAME, Advance::NAME].map(|verb| vehicle.may(verb)), [false; 3]);
        assert_eq!(vehicle.is_ordered(What::Resume), ["order resume", "goto 0", "plan: waypoint"]);
        assert_eq!(vehicle.reports(Planned::NAME), ["planned", "advance"]);
        assert_eq!(vehicle.arrives(0), ["arrived 0", "goto 1", "plan: waypoint"]);
        assert_eq!(vehicle.arrives(1), ["arrived 1", "land: mission complete"]);
        assert_eq!(vehicle.reports(Landed::NAME), ["landed", "complete"]);
    }

    #[test]
    fn the_vehicle_lands_when_ordered_to() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(FoundAirborne::NAME);
        assert_eq!(vehicle.is_ordered(What::Land), ["order land", "land: ordered by the operator"]);
        assert_eq!(vehicle.reports(Landed::NAME), ["landed", "failed: ordered by the operator"]);
    }
}

mod link_loss {
    use super::*;

    fn in_the_air(link_loss: LinkLossPolicy) -> Vehicle {
        let mut vehicle = Vehicle::in_the_air(&AgentConfig { link_loss, ..config() });
        vehicle.learns(joined(GROUND));
        vehicle
    }

    /// On the ground, with the ground station heard.
    fn grounded(link_loss: LinkLossPolicy) -> Vehicle {
        let mut vehicle = Vehicle::new(&AgentConfig { link_loss, ..config() });
        vehicle.learns(joined(GROUND));
        vehicle.reports(Ready::NAME);
        vehicle
    }

    /// What happens within a minute without the ground, and after how many seconds it begins.
    fn without_ground(vehicle: &mut Vehicle) -> Option<(u32, Vec<String>)> {
        assert_eq!(vehicle.learns(lost(GROUND, "")), ["peer_lost"]);
        (1..=60).map(|second| (second, vehicle.after(SECOND))).find(|(_, happened)| !happened.is_empty())
    }

    #[test]
    fn is_followed_by_what_the_policy_says_after_five_seconds() {
        assert_eq!(without_ground(&mut in_the_air(LinkLossPolicy::Continue)), None);

        let (after, happened) = without_ground(&mut in_the_air(LinkLossPolicy::Return)).unwrap();
        assert_eq!(after, 5);
        assert_eq!(happened, ["return: ground station lost", "goto -1", "plan: waypoint"]);

        let (after, happened) = without_ground(&mut in_the_air(LinkLossPolicy::Land)).unwrap();
        assert_eq!(after, 5);
        assert_eq!(happened, ["land: ground station lost"]);
    }

    #[test]
    fn means_nothing_when_the_ground_is_back_in_time() {
        let mut vehicle = in_the_air(LinkLossPolicy::Land);
        vehicle.learns(lost(GROUND, ""));
        assert_eq!(vehicle.after(4 * SECOND), NOTHING);
        assert_eq!(vehicle.learns(joined(GROUND)), ["peer_joined"]);
        assert_eq!(vehicle.after(60 * SECOND), NOTHING);
        assert_eq!(without_ground(&mut vehicle).unwrap().0, 5, "the patience begins anew");
    }

    #[test]
    fn counts_in_the_climb() {
        let mut vehicle = grounded(LinkLossPolicy::Return);
        vehicle.reports(Takeoff::NAME);
        vehicle.learns(lost(GROUND, ""));
        vehicle.after(3 * SECOND);
        assert_eq!(vehicle.reports(Airborne::NAME), ["airborne", "goto 0", "plan: waypoint"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert_eq!(vehicle.after(SECOND), ["return: ground station lost", "goto -1", "plan: waypoint"]);
    }

    #[test]
    fn counts_before_take_off_from_take_off_on() {
        let mut vehicle = grounded(LinkLossPolicy::Land);
        vehicle.learns(lost(GROUND, ""));
        assert_eq!(vehicle.after(60 * SECOND), NOTHING, "on the ground");
        vehicle.reports(Takeoff::NAME);
        assert_eq!(vehicle.after(4 * SECOND), NOTHING);
        assert_eq!(vehicle.after(SECOND), ["land: ground station lost"]);
    }

    #[test]
    fn counts_for_a_ground_that_never_was_heard() {
        let mut launched = Vehicle::in_the_air(&AgentConfig { link_loss: LinkLossPolicy::Land, ..config() });
        assert_eq!(launched.after(4 * SECOND), NOTHING);
        assert_eq!(launched.after(SECOND), ["land: ground station lost"]);

        let mut found = Vehicle::new(&AgentConfig { link_loss: LinkLossPolicy::Land, ..config() });
        found.reports(FoundAirborne::NAME);
        assert_eq!(found.after(5 * SECOND), ["land: ground station lost"]);

        let mut late = Vehicle::in_the_air(&AgentConfig { link_loss: LinkLossPolicy::Land, ..config() });
        late.learns(joined(GROUND));
        assert_eq!(late.after(60 * SECOND), NOTHING);
    }

    #[test]
    fn begins_anew_with_each_flight() {
        let mut vehicle = grounded(LinkLossPolicy::Land);
        vehicle.reports(Takeoff::NAME);
        vehicle.learns(lost(GROUND, ""));
        let refused = CommandFailed { why: "Arm: denied".into() }.at(ME);
        vehicle.hears(refused);
        assert_eq!(vehicle.after(60 * SECOND), NOTHING, "it never left the ground");
    }

    #[test]
    fn is_about_the_ground_alone() {
        let mut vehicle = in_the_air(LinkLossPolicy::Land);
        vehicle.learns(lost(LOWER, ""));
        assert_eq!(vehicle.after(60 * SECOND), NOTHING);
        vehicle.learns(lost(GROUND, ""));
        vehicle.learns(joined(LOWER));
        assert_eq!(vehicle.after(5 * SECOND), ["land: ground station lost"]);
    }
}

mod right_of_way {
    use super::*;

    const PLACE: [f64; 3] = [5.0, 0.0, 2.0];

    /// Facts about the vehicle's claim.
    fn confirmed() -> Event {
        Confirmed { bthread: bthreads::RIGHT_OF_WAY.into(), sync: 1 }.at(ME)
    }

    fn lapsed() -> Event {
        let home = NodeName::new(LOWER).unwrap();
        BlockLapsed { bthread: bthreads::RIGHT_OF_WAY.into(), home }.at(ME)
    }

    fn stalled(by: &str) -> Event {
        let event = mine(Enter::NAME).name().into();
        Stalled { event, by: format!("{by}#right_of_way").into() }.at(ME)
    }

    /// A vehicle that has just claimed the passage.
    fn claiming() -> Vehicle {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(at(mine(Passage::NAME), PLACE)), ["passage"]);
        vehicle
    }

    /// A vehicle whose claim is confirmed but stands against that of `other`.
    fn against(other: &str) -> Vehicle {
        let mut vehicle = claiming();
        let claim_of_other = Bid::new().block(EventSet::named(mine(Enter::NAME).name()));
        vehicle.program.put_proxy(format!("{other}#right_of_way"), &claim_of_other);
        assert_eq!(vehicle.learns(confirmed()), ["confirmed"]);
        assert_eq!(vehicle.learns(stalled(other)), ["stalled"]);
        vehicle
    }

    /// Whether the vehicle keeps others out of the passage, as they see it from another side.
    fn keeps_out(vehicle: &Vehicle) -> bool {
        [LOWER, HIGHER].iter().all(|other| {
            let enter = |x| at(Event::new(format!("{other}/enter")), [x, 1.0, 2.0]);
            assert!(vehicle.allows(enter(6.5)), "another place is free");
            !vehicle.allows(enter(6.2))
        })
    }

    #[test]
    fn is_claimed_then_confirmed_then_used_and_kept_until_the_passage_lies_behind() {
        let mut vehicle = claiming();
        assert!(keeps_out(&vehicle));
        assert_eq!(vehicle.after(SECOND), NOTHING, "no way without confirmation");
        assert_eq!(vehicle.learns(Confirmed { bthread: "mission".into(), sync: 1 }.at(ME)), ["confirmed"]);
        assert_eq!(vehicle.learns(confirmed()), ["confirmed", "enter", "advance"]);
        assert_eq!(*vehicle.last(Enter::NAME), at(mine(Enter::NAME), PLACE));
        assert_eq!(vehicle.after(CYCLE), ["advance"]);
        assert!(keeps_out(&vehicle));
        assert_eq!(vehicle.reports(Leave::NAME), ["leave"]);
        assert!(!keeps_out(&vehicle));
    }

    #[test]
    fn is_given_to_a_lower_number_and_claimed_again_when_that_has_left() {
        let mut vehicle = against(LOWER);
        assert!(!keeps_out(&vehicle));
        assert_eq!(vehicle.after(SECOND), NOTHING);
        vehicle.program.remove_proxy("uav/9#right_of_way");
        assert_eq!(vehicle.learns(Leave.at(LOWER)), ["uav/9/leave"]);
        assert!(keeps_out(&vehicle));
        assert!(!vehicle.may(Advance::NAME), "the new claim is to be confirmed too");
        assert_eq!(vehicle.learns(confirmed()), ["confirmed", "enter", "advance"]);
    }

    #[test]
    fn is_claimed_again_after_two_seconds_even_if_nobody_is_heard_to_leave() {
        let mut vehicle = against(LOWER);
        assert_eq!(vehicle.after(2 * SECOND - CYCLE), NOTHING);
        assert!(!keeps_out(&vehicle));
        assert_eq!(vehicle.after(CYCLE), NOTHING);
        assert!(keeps_out(&vehicle));
    }

    #[test]
    fn is_not_given_to_a_higher_number() {
        let mut vehicle = against(HIGHER);
        assert!(keeps_out(&vehicle));
        assert!(!vehicle.may(Advance::NAME));
        vehicle.program.remove_proxy("uav/11#right_of_way");
        assert_eq!(vehicle.happened(), ["enter"]);
    }

    #[test]
    fn is_to_be_confirmed_again_once_the_claim_has_lapsed() {
        let mut vehicle = against(HIGHER);
        assert_eq!(vehicle.learns(lapsed()), ["block_lapsed"]);
        vehicle.program.remove_proxy("uav/11#right_of_way");
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert_eq!(vehicle.learns(confirmed()), ["confirmed", "enter", "advance"]);
    }

    const WAY: &str = "5 0 2 0; 6 0 2 0; 7 0 2 0";

    fn announced(way: &str) -> Event {
        Passage { x: 5.0, y: 0.0, z: 2.0, way: Some(way.into()), here: None }.at(ME)
    }

    fn enters(node: &str, x: f64, heading: f64) -> Event {
        Enter { x, y: 0.0, z: 2.0, heading: Some(heading) }.at(node)
    }

    /// A vehicle that has entered a stretch of three places, eastward.
    fn inside() -> Vehicle {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.hears(announced(WAY));
        assert_eq!(vehicle.learns(confirmed())[..4], ["confirmed", "enter", "enter", "enter"]);
        assert!(vehicle.may(Advance::NAME));
        vehicle
    }

    #[test]
    fn a_stretch_is_entered_place_by_place_and_kept_from_those_who_come_against_or_across() {
        let vehicle = inside();
        for (heading, may) in [(0.0, true), (40.0, true), (90.0, false), (180.0, false)] {
            assert_eq!(vehicle.allows(enters(LOWER, 6.0, heading)), may, "{heading}");
        }
        assert!(vehicle.allows(enters(LOWER, 9.0, 180.0)), "beyond its end");
    }

    #[test]
    fn what_lies_behind_is_let_go_and_what_comes_to_light_is_claimed_before_it_is_flown() {
        let mut vehicle = inside();
        assert_eq!(vehicle.hears(announced("7 0 2 0")), ["passage"]);
        assert!(vehicle.allows(enters(LOWER, 5.0, 180.0)) && !vehicle.allows(enters(LOWER, 7.0, 180.0)));
        vehicle.hears(announced("7 0 2 0; 8 0 2 0; 9 0 2 0"));
        assert!(!vehicle.may(Advance::NAME));
        assert_eq!(vehicle.learns(confirmed())[..3], ["confirmed", "enter", "enter"]);
        assert!(vehicle.may(Advance::NAME));
    }

    /// An announcement by a vehicle that is there itself.
    fn announced_from(way: &str, node: &str, here: &str) -> Event {
        Passage { x: 5.0, y: 0.0, z: 2.0, way: Some(way.into()), here: Some(here.into()) }.at(node)
    }

    /// A vehicle that has entered three places, of which it claims two more in vain.
    fn stopped(announcement: Event) -> Vehicle {
        let mut vehicle = inside();
        let claim_of_other = Bid::new().block(EventSet::named(mine(Enter::NAME).name()));
        vehicle.program.put_proxy("uav/9#right_of_way", &claim_of_other);
        vehicle.hears(announcement);
        vehicle.learns(confirmed());
        vehicle
    }

    fn keeps_from(vehicle: &Vehicle, x: f64) -> bool {
        !vehicle.allows(enters(LOWER, x, 180.0))
    }

    #[test]
    fn another_that_goes_first_and_was_not_known_to_be_inside_is_let_out() {
        let way = "6 0 2 90; 6 1 2 90";
        let mut vehicle = inside();
        vehicle.hears(announced_from(way, LOWER, "6 0 2 90"));
        assert!(!vehicle.may(Advance::NAME) && keeps_from(&vehicle, 6.0), "it lets go when it stands");
        vehicle.after(2 * SECOND);
        assert!(!keeps_from(&vehicle, 6.0) && !vehicle.may(Advance::NAME));
        let mut vehicle = inside();
        vehicle.hears(announced_from("6 9 2 90", LOWER, "6 9 2 90"));
        vehicle.hears(announced_from("7 0 2 0", LOWER, "7 0 2 0"));
        assert!(vehicle.may(Advance::NAME), "elsewhere, or the same way");
        let way = "5 0 2 0; 6 0 2 0; 7 0 2 0";
        vehicle.hears(announced_from(way, ME, "5 0 2 0"));
        vehicle.hears(announced_from("7 0 2 180", HIGHER, "7 0 2 180"));
        assert!(keeps_from(&vehicle, 6.0) && vehicle.may(Advance::NAME), "that one does not go first");
        vehicle.hears(announced_from("7 0 2 180", LOWER, "7 0 2 180"));
        vehicle.after(2 * SECOND);
        assert!(!keeps_from(&vehicle, 7.0) && keeps_from(&vehicle, 5.0), "but where it is");
    }

    #[test]
    fn another_that_is_out_of_range_is_let_out_by_nobody() {
        for radio_range_m in [None, Some(15.0)] {
            let mut vehicle = Vehicle::in_the_air(&AgentConfig { radio_range_m, ..config() });
            vehicle.reports(Planned::NAME);
            vehicle.learns(joined(LOWER));
            vehicle.hears(announced_from("6 0 2 90; 6 1 2 90", LOWER, "6 0 2 90"));
            vehicle.learns(lost(LOWER, "right_of_way"));
            vehicle.hears(announced(WAY));
            vehicle.after(8 * SECOND);
            vehicle.learns(confirmed());
            vehicle.after(2 * SECOND);
            assert_eq!(vehicle.may(Advance::NAME), radio_range_m.is_some());
        }
    }

    #[test]
    fn who_is_inside_gives_in_to_others_inside_only() {
        let way = "7 0 2 0; 8 0 2 0; 9 0 2 0";
        let mut vehicle = stopped(announced_from(way, ME, "7.2 0 2 0"));
        vehicle.learns(stalled(LOWER));
        vehicle.after(8 * SECOND);
        assert!(keeps_from(&vehicle, 9.0), "the other is outside");
        vehicle.hears(announced_from("9 0 2 180", LOWER, "9 0 2 180"));
        vehicle.learns(stalled(LOWER));
        vehicle.after(2 * SECOND);
        assert!(!keeps_from(&vehicle, 9.0) && keeps_from(&vehicle, 7.0), "it is there itself");
        vehicle.after(2 * SECOND);
        assert!(keeps_from(&vehicle, 9.0), "it tries again");
        vehicle.learns(confirmed());
        vehicle.hears(Leave.at(LOWER));
        vehicle.learns(stalled(LOWER));
        vehicle.after(8 * SECOND);
        assert!(keeps_from(&vehicle, 9.0), "the other has left");
    }

    #[test]
    fn who_has_entered_and_stands_outside_lets_all_go() {
        let mut vehicle = stopped(announced("5 0 2 0; 6 0 2 0; 7 0 2 0; 8 0 2 0; 9 0 2 0"));
        vehicle.learns(stalled(LOWER));
        vehicle.after(SECOND);
        assert!(keeps_from(&vehicle, 5.0), "it may not stand yet");
        vehicle.after(SECOND);
        assert!(!keeps_from(&vehicle, 5.0) && !keeps_from(&vehicle, 9.0));
        assert!(!vehicle.may(Advance::NAME));
    }

    #[test]
    fn who_is_outside_insists_for_a_while_only_and_not_at_all_against_who_is_inside() {
        let mut outside = against(HIGHER);
        assert!(keeps_out(&outside));
        outside.after(3 * SECOND);
        assert!(!keeps_out(&outside));
        let mut outside = against(HIGHER);
        outside.hears(announced_from("6 0 2 180", HIGHER, "6 0 2 180"));
        outside.learns(stalled(HIGHER));
        assert!(!keeps_out(&outside));
    }

    #[test]
    fn way_is_made_for_who_goes_first_and_for_nobody_else() {
        let asks = |of: &str, right| InTheWay { of: of.into(), right }.at(ME);
        let mut vehicle = inside();
        vehicle.hears(announced_from(WAY, ME, "5 0 2 0"));
        assert_eq!(vehicle.hears(asks(LOWER, Right::Free)), ["in_the_way"], "it is inside");
        assert_eq!(vehicle.hears(asks(HIGHER, Right::Inside)), ["in_the_way"], "the lower number goes first");
        assert_eq!(vehicle.hears(asks(LOWER, Right::Inside)), ["in_the_way", "make_way"]);
        assert!(vehicle.may(Advance::NAME), "leave leads out of the way");
        assert_eq!(vehicle.hears(announced("5 0 2 0")), ["passage"]);
        assert!(vehicle.allows(enters(LOWER, 7.0, 180.0)), "it is there no more");
        vehicle.hears(Cornered { by: LOWER.into() }.at(ME));
        assert_eq!(vehicle.hears(asks(LOWER, Right::Inside)), ["in_the_way"], "the cornered goes first");
        assert_eq!(vehicle.hears(asks(LOWER, Right::Cornered)), ["in_the_way", "make_way"]);
        assert_eq!(vehicle.reports(OutOfTheWay::NAME)[0], "out_of_the_way");
    }

    #[test]
    fn ends_with_the_flight() {
        let mut vehicle = claiming();
        vehicle.is_ordered(What::Land);
        assert!(keeps_out(&vehicle), "a vehicle that lands in a passage fills it");
        vehicle.reports(Landed::NAME);
        assert!(!keeps_out(&vehicle));
    }
}

mod separation {
    use super::*;

    #[test]
    fn a_neighbour_too_close_stops_the_vehicle_until_it_is_clear() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(TooClose { other: LOWER.into() }.at(ME)), ["too_close"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert!(!vehicle.may(Advance::NAME));
        assert_eq!(vehicle.reports(Clear::NAME), ["clear", "advance"]);
    }
}

mod choosing {
    use skein_agent::PositionSource;

    use super::*;

    /// A vehicle with satellites and a lidar, the satellites preferred.
    fn vehicle() -> Vehicle {
        let position = vec![PositionSource::Autopilot, PositionSource::Lidar];
        Vehicle::new(&AgentConfig { position, ..config() })
    }

    fn found(source: &str) -> Event {
        SourceFound { source: source.into() }.at(ME)
    }

    fn lost(source: &str) -> Event {
        SourceLost { source: source.into(), why: "silent for 0.7 s".into() }.at(ME)
    }

    /// The sources that are flown by after an event, one after another.
    fn flown(vehicle: &mut Vehicle, event: Event) -> Vec<String> {
        let before = vehicle.log.len();
        vehicle.hears(event);
        let chosen = vehicle.log.iter().skip(before).filter_map(|event| Me::new(ME).read::<FlyBy>(event));
        chosen.map(|chosen| chosen.source.to_string()).collect()
    }

    #[test]
    fn the_first_source_that_can_be_flown_by_is_flown_and_dead_reckoning_without_one() {
        let mut vehicle = vehicle();
        assert_eq!(flown(&mut vehicle, found("autopilot")), NOTHING, "it flies by that already");
        assert_eq!(flown(&mut vehicle, found("lidar")), NOTHING);
        assert_eq!(flown(&mut vehicle, lost("autopilot")), ["lidar"]);
        assert_eq!(flown(&mut vehicle, lost("lidar")), ["dead_reckoning"]);
        assert_eq!(flown(&mut vehicle, found("lidar")), ["lidar"]);
        assert_eq!(flown(&mut vehicle, found("autopilot")), ["autopilot"]);
    }

    #[test]
    fn before_any_source_is_found_the_vehicle_stands_where_it_was_put() {
        assert_eq!(flown(&mut vehicle(), lost("autopilot")), NOTHING);
    }

    #[test]
    fn a_source_that_somebody_else_chose_stays_until_it_is_lost() {
        let mut vehicle = vehicle();
        vehicle.hears(found("autopilot"));
        vehicle.hears(found("lidar"));
        let choice = FlyBy { source: "lidar".into() }.at(ME);
        assert_eq!(flown(&mut vehicle, choice), ["lidar"], "and nothing is requested in its place");
        assert_eq!(flown(&mut vehicle, lost("lidar")), ["autopilot"]);
    }
}

mod positioning {
    use super::*;

    fn doubted() -> Event {
        PositionDoubted { why: "the position jumped by 8.0 m".into(), sigma_m: 8.0 }.at(ME)
    }

    #[test]
    fn a_doubted_position_stops_the_vehicle_until_it_is_trusted() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(
            vehicle.hears(doubted()),
            ["position_doubted: the position jumped by 8.0 m", "hold: the position jumped by 8.0 m"]
        );
        assert_eq!(vehicle.after(9 * SECOND), NOTHING);
        assert!(!vehicle.may(Advance::NAME) && !vehicle.may(Homeward::NAME));
        assert_eq!(vehicle.reports(PositionTrusted::NAME), ["position_trusted", "advance"]);
    }

    #[test]
    fn a_position_doubted_for_ten_seconds_lands_the_vehicle_and_once_more_when_it_is_handed_back() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.hears(doubted());
        assert_eq!(vehicle.after(10 * SECOND), ["land: the position jumped by 8.0 m"]);
        vehicle.hears(PilotTook { mode: "manual".into(), by: "pilot".into() }.at(ME));
        // The mission ended with the landing, and ends so again.
        let (hold, land) = ("hold: the position jumped by 8.0 m", "land: the position jumped by 8.0 m");
        assert_eq!(vehicle.is_ordered(What::HandBack), ["order hand_back", "hand_back", hold, land]);
    }

    #[test]
    fn a_vehicle_on_its_way_down_is_not_held() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.is_ordered(What::Land);
        assert_eq!(vehicle.hears(doubted()), ["position_doubted: the position jumped by 8.0 m"]);
        assert_eq!(vehicle.after(10 * SECOND), NOTHING);
    }
}

mod sleep {
    use super::*;

    #[test]
    fn an_agent_that_did_not_run_leaves_its_vehicle_alone_until_it_is_handed_back() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(Slept { seconds: 3.0 }.at(ME)), ["slept"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert!(!vehicle.may(Advance::NAME) && !vehicle.may(Land::NAME));
        assert_eq!(vehicle.is_ordered(What::HandBack), ["order hand_back", "hand_back", "advance"]);
    }
}

mod one_name {
    use super::*;

    #[test]
    fn a_name_that_another_process_has_too_holds_the_vehicle_until_it_is_resumed() {
        let mut vehicle = Vehicle::on_its_way();
        let told = vehicle.learns(DuplicateName { incarnation: 4 }.at(ME));
        let hold = "hold: another process has this vehicle's name; end one of them, then resume";
        assert_eq!(told, ["duplicate_name", hold]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert!(!vehicle.may(Advance::NAME) && !vehicle.may(Takeoff::NAME) && vehicle.may(Homeward::NAME));
        assert_eq!(vehicle.is_ordered(What::Resume), ["order resume", "advance"]);
        let again = vehicle.learns(DuplicateName { incarnation: 4 }.at(ME));
        assert_eq!(again, ["duplicate_name", hold], "it goes on while the other is there");
    }
}

mod return_home {
    use super::*;

    #[test]
    fn a_vehicle_on_its_way_down_is_not_sent_home() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.is_ordered(What::Land);
        assert_eq!(vehicle.reports(FenceBreached::NAME), ["fence_breached", "return: outside the geofence"]);
    }

    #[test]
    fn an_order_to_land_on_the_ground_does_not_count_in_the_air() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(Ready::NAME);
        vehicle.is_ordered(What::HandBack);
        vehicle.is_ordered(What::Land);
        vehicle.reports(Takeoff::NAME);
        let happened = vehicle.reports(BatteryLow::NAME);
        assert!(happened.contains(&"goto -1".into()), "{happened:?}");
    }

    #[test]
    fn who_turned_home_while_climbing_is_led_nowhere_else_once_it_is_up() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(Ready::NAME);
        vehicle.reports(Takeoff::NAME);
        let home = ["battery_low", "return: battery low", "goto -1", "plan: waypoint"];
        assert_eq!(vehicle.reports(BatteryLow::NAME), home);
        assert_eq!(vehicle.reports(Airborne::NAME), ["airborne"]);
        let why = "declined: it is not free to go: on the ground, climbing, landing or returning";
        assert_eq!(
            vehicle.hears(OrderTaken::go_to([4.0, 3.0, 2.0], "the operator").given_aboard().at(ME)),
            ["order goto", why]
        );
    }
}

mod holder {
    use super::*;

    const KEPT: &str = "held: nobody held it";

    fn order(what: What, by: &str) -> Event {
        OrderTaken::plain(what, by).at(ME)
    }

    fn handover(what: What, by: &str) -> Event {
        Handover { what, by: by.into(), to: None }.at(ME)
    }

    fn holder(vehicle: &Vehicle) -> Option<&str> {
        vehicle.program.state_of::<Holder>(Holder::NAME).unwrap().holder()
    }

    /// On its way, held by Anna.
    fn annas() -> Vehicle {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(order(What::Resume, "Anna")), ["order resume", KEPT]);
        assert_eq!(holder(&vehicle), Some("Anna"));
        vehicle
    }

    #[test]
    fn whoever_orders_first_holds_the_vehicle_and_others_do_not_set_it_going() {
        let vehicle = annas();
        for what in What::those(|what| what.needs_holder() && what.reaches_vehicle()) {
            assert!(!vehicle.allows(order(what, "Ben")), "{what} of another");
            assert!(vehicle.allows(order(what, "Anna")), "{what} of the holder");
            assert!(
                vehicle.allows(OrderTaken::plain(what, "script/x").given_aboard().at(ME)),
                "{what} aboard"
            );
        }
        let load = |by: &str| Load { name: None, script: "{}".into(), by: Some(by.into()) }.at(ME);
        assert!(!vehicle.allows(load("Ben")) && vehicle.allows(load("Anna")));
        assert!(!vehicle.allows(mine(OrderTaken::NAME).with("what", "resume")), "one that names nobody");
    }

    #[test]
    fn anybody_holds_returns_and_lands_it_and_does_not_hold_it_for_that() {
        for what in What::those(|what| what.is_for_safety() && !what.is_for_all()) {
            let mut vehicle = annas();
            assert!(vehicle.hears(order(what, "Ben")).iter().any(|event| event.ends_with("ordered by Ben")));
            assert_eq!(holder(&vehicle), Some("Anna"));
            let mut unheld = Vehicle::on_its_way();
            unheld.hears(order(what, "Ben"));
            assert_eq!(holder(&unheld), None);
        }
    }

    #[test]
    fn it_is_asked_for_and_given_and_taken() {
        let mut vehicle = annas();
        assert_eq!(vehicle.hears(handover(What::Ask, "Ben")), ["handover ask", "held: Ben asks for it"]);
        assert_eq!(holder(&vehicle), Some("Anna"));
        let give =
            |by: &str, to: &str| Handover { what: What::Give, by: by.into(), to: Some(to.into()) }.at(ME);
        assert_eq!(vehicle.hears(give("Ben", "Ben")), ["handover give"], "it is not his to give");
        assert_eq!(vehicle.hears(give("Anna", "Ben")), ["handover give", "held: Anna has given it"]);
        assert!(vehicle.allows(order(What::Resume, "Ben")) && !vehicle.allows(order(What::Resume, "Anna")));
        let taken = ["handover take", "held: Anna has taken it from Ben"];
        assert_eq!(vehicle.hears(handover(What::Take, "Anna")), taken);
        assert_eq!(vehicle.hears(handover(What::Ask, "Ben")), ["handover ask", "held: Ben asks for it"]);
        assert_eq!(
            vehicle.hears(handover(What::Release, "Anna")),
            ["handover release", "held: Anna has let it go"]
        );
        assert_eq!(holder(&vehicle), Some("Ben"), "whoever asks for it is next");
    }

    #[test]
    fn a_holder_who_is_not_heard_of_holds_it_no_more() {
        let mut vehicle = annas();
        let nearly = HOLDING_LASTS - SECOND;
        vehicle.after(nearly);
        vehicle.hears(handover(What::Keep, "Ben"));
        vehicle.hears(handover(What::Keep, "Anna"));
        vehicle.after(nearly);
        assert_eq!(holder(&vehicle), Some("Anna"), "she has been heard of meanwhile");
        let gone = vehicle.after(2 * SECOND);
        assert!(gone.contains(&"held: Anna was not heard of for 30 s".to_owned()), "{gone:?}");
        assert_eq!(holder(&vehicle), None);
        assert!(vehicle.allows(order(What::Resume, "Ben")));
    }

    #[test]
    fn an_order_that_names_nobody_is_declined_and_does_nothing() {
        let mut vehicle = Vehicle::on_its_way();
        let goto = at(mine(OrderTaken::NAME), [4.0, 3.0, 2.0]).with("what", "goto");
        let [order, declined] = &vehicle.hears(goto)[..] else { panic!("it did more than decline") };
        assert_eq!(order, "order goto");
        assert!(declined.starts_with("declined: it names nobody: set `by`"), "{declined}");
    }

    #[test]
    fn nobody_holds_it_by_a_name_that_is_none() {
        let mut vehicle = Vehicle::on_its_way();
        for name in ["", &"x".repeat(65)] {
            vehicle.hears(order(What::Resume, name));
            vehicle.hears(handover(What::Take, name));
            assert_eq!(holder(&vehicle), None);
        }
    }
}

mod reposition {
    use super::*;

    const POINT: [f64; 3] = [4.0, 3.0, 2.0];

    fn goto() -> Event {
        OrderTaken::go_to(POINT, "the operator").given_aboard().at(ME)
    }

    #[test]
    fn the_vehicle_goes_where_it_is_told_hovers_there_and_resumes_its_mission() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(goto()), ["order goto", "goto -2", "plan: waypoint"]);
        let Goto { x, y, z, .. } = Goto::read(vehicle.last(Goto::NAME)).unwrap();
        assert_eq!([x, y, z], POINT);
        assert_eq!(vehicle.hears(Planned { leg: -2, length_m: 5.0 }.at(ME)), ["planned -2", "advance"]);
        assert_eq!(vehicle.arrives(-2), ["arrived -2"]);
        assert_eq!(vehicle.after(10 * SECOND), NOTHING, "it does not go on by itself");
        assert_eq!(vehicle.is_ordered(What::Resume), ["order resume", "goto 0", "plan: waypoint"]);
    }

    #[test]
    fn a_vehicle_on_hold_is_free_to_go() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.is_ordered(What::Hold);
        assert!(!vehicle.may(Advance::NAME));
        vehicle.hears(goto());
        assert_eq!(vehicle.hears(Planned { leg: -2, length_m: 5.0 }.at(ME)), ["planned -2", "advance"]);
    }

    #[test]
    fn a_point_outside_the_fence_is_declined_and_the_mission_goes_on() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(
            vehicle.hears(OrderTaken::go_to([1e4, 0.0, 2.0], "the operator").given_aboard().at(ME)),
            ["order goto"]
        );
        let declined = vehicle.after(2 * SECOND);
        assert!(declined.iter().any(|event| event.starts_with("declined: ")), "{declined:?}");
        assert!(vehicle.may(Advance::NAME));
    }

    #[test]
    fn a_point_without_a_way_is_declined_and_the_vehicle_stays_in_the_air() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.hears(goto());
        let unplannable = || Unplannable { leg: -2, why: "walled in".into(), zone: None }.at(ME);
        for _ in 0..2 {
            vehicle.hears(unplannable());
            vehicle.after(SECOND);
        }
        assert_eq!(vehicle.hears(unplannable()), ["unplannable: walled in", "declined: walled in"]);
        assert_eq!(vehicle.is_ordered(What::Resume), ["order resume", "goto 0", "plan: waypoint"]);
    }

    #[test]
    fn a_vehicle_on_the_ground_or_on_its_way_down_declines() {
        let mut grounded = Vehicle::new(&config());
        assert!(grounded.hears(goto())[1].starts_with("declined: it is not free"));
        let mut landing = Vehicle::on_its_way();
        landing.is_ordered(What::Land);
        assert!(landing.hears(goto())[1].starts_with("declined: it is not free"));
    }
}

mod right_of_way_without_the_lost {
    use super::*;

    /// In a fleet of five, whose others are all heard.
    fn in_reach() -> Vehicle {
        with_radio_to(None)
    }

    fn with_radio_to(radio_range_m: Option<f64>) -> Vehicle {
        let roster = [ME, LOWER, HIGHER, "uav/12", "ground/1", "script/operator"].map(str::to_owned);
        let config = AgentConfig { roster: roster.to_vec(), radio_range_m, ..config() };
        let mut vehicle = Vehicle::in_the_air(&config);
        for other in [LOWER, HIGHER, "uav/12", "ground/1"] {
            vehicle.learns(joined(other));
        }
        vehicle.after(2 * SECOND);
        vehicle.reports(Planned::NAME);
        vehicle
    }

    fn loses(vehicle: &mut Vehicle, other: &str, released: &str) {
        vehicle.learns(lost(other, released));
    }

    /// The homes whose confirmation a claim waits for.
    fn asks(vehicle: &mut Vehicle) -> Vec<&'static str> {
        vehicle.hears(at(mine(Passage::NAME), [5.0, 0.0, 2.0]));
        let bids = vehicle.program.bids();
        let claim = bids.into_iter().find(|(name, ..)| *name == "right_of_way").unwrap().1.blocks().clone();
        let asked = |other: &&str| claim.could_match_home(other);
        [LOWER, HIGHER, "uav/12"].into_iter().filter(asked).collect()
    }

    #[test]
    fn everyone_in_reach_is_asked() {
        assert_eq!(asks(&mut in_reach()), [LOWER, HIGHER, "uav/12"]);
    }

    #[test]
    fn one_that_is_lost_without_a_claim_is_done_without() {
        let mut vehicle = in_reach();
        loses(&mut vehicle, HIGHER, "hold");
        assert_eq!(asks(&mut vehicle), [LOWER, "uav/12"]);
    }

    #[test]
    fn one_that_is_lost_with_a_claim_is_waited_for() {
        let mut vehicle = in_reach();
        loses(&mut vehicle, HIGHER, "hold right_of_way");
        assert_eq!(asks(&mut vehicle), [LOWER, HIGHER, "uav/12"]);
    }

    #[test]
    fn one_that_is_lost_with_a_claim_closes_only_what_it_claimed() {
        for (place, is_closed) in [([5.0, 0.0, 2.0], true), ([45.0, 0.0, 2.0], false)] {
            let mut vehicle = in_reach();
            vehicle.hears(at(Event::new(format!("{HIGHER}/passage")), place));
            loses(&mut vehicle, HIGHER, "hold right_of_way");
            assert_eq!(asks(&mut vehicle).contains(&HIGHER), is_closed, "{place:?}");
        }
    }

    #[test]
    fn where_radio_is_short_nobody_is_asked_who_is_not_heard() {
        let mut vehicle = with_radio_to(Some(15.0));
        for other in [HIGHER, "uav/12", "ground/1"] {
            loses(&mut vehicle, other, "right_of_way");
        }
        assert_eq!(asks(&mut vehicle), [LOWER]);
    }

    #[test]
    fn without_most_of_the_fleet_everyone_is_waited_for() {
        let mut vehicle = in_reach();
        for other in [LOWER, HIGHER, "uav/12"] {
            loses(&mut vehicle, other, "");
        }
        assert_eq!(asks(&mut vehicle), [LOWER, HIGHER, "uav/12"]);
    }

    #[test]
    fn claims_cross_before_they_count_when_two_sides_meet() {
        let mut vehicle = in_reach();
        loses(&mut vehicle, HIGHER, "");
        vehicle.learns(joined(HIGHER));
        assert!(asks(&mut vehicle).is_empty(), "it claims at once");
        vehicle.after(2 * SECOND);
        assert!(!vehicle.may(Advance::NAME));
    }
}

#[test]
fn a_vehicle_that_has_lost_its_promises_says_so_and_stays_until_an_operator_lets_it_go() {
    let mut vehicle = Vehicle::new(&config());
    let lost = bthreads::LostPromises::new(Me::new(ME), "the file is cut short");
    vehicle.program.add("lost_promises", lost);
    let told = vehicle.reports(Ready::NAME);
    assert_eq!(told, ["hold: its promises are lost: the file is cut short", "ready"]);
    assert_eq!(vehicle.is_ordered(What::Hold), ["order hold", "hold: ordered by the operator"]);
    assert!(!vehicle.may(Takeoff::NAME));
    vehicle.is_ordered(What::Resume);
    assert!(vehicle.may(Takeoff::NAME));
}

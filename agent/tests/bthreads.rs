//! A vehicle's b-threads, run together: what they make of what the vehicle and the fleet report.

use std::time::Duration;

use skein_agent::{
    AgentConfig, Envelope, Fence, Me, Planners,
    bthreads::{self, LinkLossPolicy},
};
use skein_bp::{Bid, Event, EventSet, Program, ProgramConfig};
use skein_dbp::facts::{BLOCK_LAPSED, CONFIRMED, DUPLICATE_NAME, PEER_JOINED, PEER_LOST, STALLED};
use skein_mav::Datum;
use skein_wire::vocabulary::{self, *};

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
        takeoff_height_m: 2.0,
        return_altitude_m: RETURN_ALTITUDE_M,
        lidar: true,
        fence: Fence { min: [-20.0, -20.0, 0.0], max: [20.0, 20.0, 10.0] },
        airspace: Default::default(),
        envelope: Envelope::default(),
        planners: Planners::default(),
        link_loss: LinkLossPolicy::Continue,
        scripts: Vec::new(),
        behaviours: Default::default(),
        lease: SECOND,
        authority: skein_wire::standard_authority(),
        kept: skein_dbp::Kept::default(),
        seed: 1,
    }
}

fn mine(verb: &str) -> Event {
    vocabulary::event(ME, verb)
}

fn at(verb: Event, [x, y, z]: [f64; 3]) -> Event {
    verb.with("x", x).with("y", y).with("z", z)
}

/// What the tests compare: the verb, with the datum that matters; other nodes are named.
fn told(event: &Event) -> String {
    let verb = Me::new(ME).verb(event).unwrap_or(event.name()).to_owned();
    match (event.text("why"), event.text("what"), event.int("leg")) {
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
        assert_eq!(vehicle.reports(READY), ["ready"]);
        assert_eq!(vehicle.reports(TAKEOFF), ["takeoff"]);
        assert_eq!(vehicle.reports(AIRBORNE), ["airborne", "goto 0", "plan: waypoint"]);
        vehicle
    }

    /// Moving along a path to the first waypoint.
    fn on_its_way() -> Self {
        let mut vehicle = Self::in_the_air(&config());
        assert_eq!(vehicle.reports(PLANNED), ["planned", "advance"]);
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
        self.hears(mine(ARRIVED).with("leg", leg))
    }

    fn is_ordered(&mut self, what: &str) -> Vec<String> {
        self.hears(order(ME, what))
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
            assert_eq!(*vehicle.last(GOTO), {
                let goto = mine(GOTO).with("leg", 0_i64).with("lands", false);
                at(goto, [10.0, 0.0, 2.0])
            });
            assert_eq!(vehicle.reports(PLANNED), ["planned", "advance"]);
            assert_eq!(vehicle.arrives(0), ["arrived 0", "goto 1", "plan: waypoint"]);
            assert_eq!(vehicle.last(GOTO).bool("lands"), Some(true));
            assert_eq!(vehicle.arrives(0), ["arrived 0"], "an old waypoint does not count again");
            assert_eq!(vehicle.arrives(1), ["arrived 1", "land: mission complete"]);
            assert_eq!(vehicle.reports(LANDED), ["landed", "complete"]);
            assert_eq!(vehicle.after(10 * SECOND), NOTHING);
        }
    }

    #[test]
    fn fails_when_the_vehicle_cannot_take_off() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(READY);
        vehicle.reports(TAKEOFF);
        let refused = mine(COMMAND_FAILED).with("why", "Arm: denied");
        assert_eq!(vehicle.hears(refused), ["command_failed: Arm: denied", "failed: Arm: denied"]);
    }

    #[test]
    fn fails_when_the_autopilot_lands_by_itself() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.reports(LANDED), ["landed", "failed: the autopilot landed by itself"]);
    }
}

mod before_take_off {
    use super::*;

    #[test]
    fn take_off_waits_until_the_vehicle_is_ready() {
        let mut vehicle = Vehicle::new(&config());
        assert_eq!(vehicle.reports(TAKEOFF), NOTHING);
        assert_eq!(vehicle.reports(READY), ["ready", "takeoff"]);
    }

    #[test]
    fn take_off_waits_again_once_a_check_fails() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(READY);
        assert!(vehicle.may(TAKEOFF));
        vehicle.reports(UNREADY);
        assert_eq!(vehicle.reports(TAKEOFF), NOTHING);
        assert_eq!(vehicle.reports(READY), ["ready", "takeoff"]);
    }

    #[test]
    fn a_vehicle_that_has_taken_off_takes_off_again_only_from_the_ground() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(READY);
        vehicle.reports(TAKEOFF);
        assert!(!vehicle.may(TAKEOFF));
        vehicle.hears(mine(COMMAND_FAILED).with("why", "Arm: denied"));
        let mut other = Vehicle::new(&config());
        other.reports(READY);
        other.reports(TAKEOFF);
        other.program.remove("mission");
        other.reports(LANDED);
        assert!(other.may(TAKEOFF));
    }

    #[test]
    fn an_order_to_return_on_the_ground_does_not_count_in_the_air() {
        let mut vehicle = Vehicle::new(&config());
        assert_eq!(vehicle.is_ordered("return"), ["order return", "return: ordered by the operator"]);
        vehicle.reports(READY);
        vehicle.reports(TAKEOFF);
        assert_eq!(vehicle.reports(AIRBORNE), ["airborne", "goto 0", "plan: waypoint"]);
        let home = ["battery_low", "return: battery low", "goto -1", "plan: waypoint"];
        assert_eq!(vehicle.reports(BATTERY_LOW), home, "it was still returning");
    }

    #[test]
    fn a_remote_request_takes_the_vehicle_off_once_it_is_ready() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.program.put_proxy("ground/1#launch", &Bid::new().request(mine(TAKEOFF)));
        assert_eq!(vehicle.happened(), NOTHING);
        assert_eq!(vehicle.reports(READY), ["ready", "takeoff"]);
    }
}

mod pilot {
    use super::*;

    #[test]
    fn blocks_every_movement_until_the_vehicle_is_handed_back() {
        let moves = [GOTO, PLAN, ADVANCE, ENTER, HOLD, LAND, RETURN];
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(moves.map(|verb| vehicle.may(verb)), [true; 7]);
        assert_eq!(vehicle.reports(PILOT), ["pilot"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert_eq!(moves.map(|verb| vehicle.may(verb)), [false; 7]);
        assert_eq!(vehicle.is_ordered("hand_back"), ["order hand_back", "hand_back", "advance"]);
        assert_eq!(moves.map(|verb| vehicle.may(verb)), [true; 7]);
    }

    #[test]
    fn goes_before_an_empty_battery() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.reports(PILOT);
        assert_eq!(vehicle.reports(BATTERY_CRITICAL), ["battery_critical"]);
        assert_eq!(
            vehicle.is_ordered("hand_back"),
            ["order hand_back", "hand_back", "land: battery nearly empty"]
        );
    }
}

mod path {
    use super::*;

    fn unplannable() -> Event {
        mine(UNPLANNABLE).with("why", "walled in")
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
        assert_eq!(vehicle.reports(LANDED), ["landed", "failed: walled in"]);
    }

    #[test]
    fn found_at_a_later_try_is_flown_and_the_next_waypoint_has_all_its_tries() {
        let mut vehicle = Vehicle::in_the_air(&config());
        for _ in 0..2 {
            vehicle.hears(unplannable());
            vehicle.after(SECOND);
        }
        assert_eq!(vehicle.reports(PLANNED), ["planned", "advance"]);
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
        vehicle.program.put_proxy("ground/1#freeze", &Bid::new().block(vocabulary::of(ME, ADVANCE)));
        assert_eq!(vehicle.after(SECOND), NOTHING, "another node may hold the vehicle");
        vehicle.program.remove_proxy("ground/1#freeze");
        assert_eq!(vehicle.happened(), ["advance"]);
    }

    #[test]
    fn that_is_blocked_stops_the_vehicle_until_there_is_a_new_one() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.reports(PATH_BLOCKED), ["path_blocked", "plan: obstacle"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert!(!vehicle.may(ADVANCE));
        assert_eq!(vehicle.hears(unplannable()), ["unplannable: walled in"]);
        assert_eq!(vehicle.after(SECOND), ["plan: waypoint"], "the waypoint is tried again");
        assert_eq!(vehicle.reports(PLANNED), ["planned", "advance"]);
    }

    #[test]
    fn is_planned_anew_when_the_vehicle_is_stuck_and_after_twelve_times_it_lands() {
        let mut vehicle = Vehicle::on_its_way();
        for _ in 0..12 {
            assert_eq!(vehicle.reports(STUCK), ["stuck", "plan: stuck"]);
        }
        let why = "stuck: no way past what stands around";
        assert_eq!(vehicle.reports(STUCK), ["stuck".to_owned(), format!("land: {why}")]);
        assert_eq!(vehicle.reports(LANDED), ["landed".to_owned(), format!("failed: {why}")]);
    }

    #[test]
    fn may_be_planned_anew_twelve_times_for_each_waypoint() {
        let mut vehicle = Vehicle::on_its_way();
        for leg in 0..2 {
            for _ in 0..12 {
                assert_eq!(vehicle.reports(STUCK), ["stuck", "plan: stuck"]);
            }
            vehicle.arrives(leg);
        }
        assert_eq!(told(vehicle.last(LAND)), "land: mission complete");
    }
}

mod operator {
    use super::*;

    #[test]
    fn holds_the_vehicle_until_it_may_resume() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.is_ordered("hold"), ["order hold", "hold: ordered by the operator"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert_eq!(vehicle.is_ordered("resume"), ["order resume", "advance"]);
    }

    #[test]
    fn lands_the_vehicle() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.is_ordered("land"), ["order land", "land: ordered by the operator"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert_eq!(vehicle.reports(LANDED), ["landed", "failed: ordered by the operator"]);
    }

    #[test]
    fn sends_the_vehicle_home_where_it_lands() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(
            vehicle.is_ordered("return"),
            ["order return", "return: ordered by the operator", "goto -1", "plan: waypoint"]
        );
        assert_eq!(*vehicle.last(GOTO), {
            let home = mine(GOTO).with("leg", bthreads::HOME_LEG).with("lands", true);
            at(home, [1.0, 2.0, RETURN_ALTITUDE_M])
        });
        assert_eq!(vehicle.reports(PLANNED), ["planned", "advance"]);
        assert_eq!(vehicle.arrives(-1), ["arrived -1", "land: ordered by the operator"]);
        assert_eq!(vehicle.reports(LANDED), ["landed", "failed: ordered by the operator"]);
    }

    #[test]
    fn who_orders_a_held_vehicle_home_lets_it_move() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.is_ordered("hold");
        vehicle.is_ordered("return");
        assert_eq!(vehicle.reports(PLANNED), ["planned", "advance"]);
    }

    #[test]
    fn is_not_heeded_when_the_order_is_unknown() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.is_ordered("dance"), ["order dance"]);
        assert_eq!(vehicle.after(CYCLE), ["advance"]);
    }
}

mod battery {
    use super::*;

    #[test]
    fn when_low_sends_the_vehicle_home() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(
            vehicle.reports(BATTERY_LOW),
            ["battery_low", "return: battery low", "goto -1", "plan: waypoint"]
        );
        assert_eq!(vehicle.reports(PLANNED), ["planned", "advance"]);
        assert_eq!(vehicle.arrives(-1), ["arrived -1", "land: battery low"]);
        assert_eq!(vehicle.reports(LANDED), ["landed", "failed: battery low"]);
    }

    #[test]
    fn when_critical_lands_the_vehicle_and_nothing_sends_it_elsewhere() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.reports(BATTERY_LOW);
        assert_eq!([GOTO, RETURN].map(|verb| vehicle.may(verb)), [true; 2]);
        assert_eq!(vehicle.reports(BATTERY_CRITICAL), ["battery_critical", "land: battery nearly empty"]);
        assert_eq!([GOTO, RETURN].map(|verb| vehicle.may(verb)), [false; 2]);
        assert_eq!(vehicle.reports(FENCE_BREACHED), ["fence_breached"], "not even the geofence");
        assert_eq!(vehicle.after(SECOND), NOTHING);
    }
}

mod geofence {
    use super::*;

    #[test]
    fn lets_nobody_fly_to_a_waypoint_outside() {
        let waypoints = vec![[10.0, 0.0, 2.0], [30.0, 0.0, 2.0]];
        let mut vehicle = Vehicle::in_the_air(&AgentConfig { waypoints, ..config() });
        vehicle.reports(PLANNED);
        assert_eq!(vehicle.arrives(0), ["arrived 0"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        let may_go = |place| vehicle.allows(at(mine(GOTO), place));
        assert!(may_go([20.0, 20.0, 10.0]));
        assert!(!may_go([20.1, 0.0, 2.0]) && !may_go([0.0, -20.1, 2.0]) && !may_go([0.0, 0.0, 10.1]));
    }

    #[test]
    fn sends_a_vehicle_outside_home() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(
            vehicle.reports(FENCE_BREACHED),
            ["fence_breached", "return: outside the geofence", "goto -1", "plan: waypoint"]
        );
        vehicle.reports(PLANNED);
        assert_eq!(vehicle.arrives(-1), ["arrived -1", "land: outside the geofence"]);
        assert_eq!(vehicle.reports(LANDED), ["landed", "failed: outside the geofence"]);
    }
}

mod found_airborne {
    use super::*;

    #[test]
    fn the_vehicle_holds_until_it_may_resume_and_then_flies_its_mission() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(READY);
        assert_eq!([TAKEOFF, GOTO, ADVANCE].map(|verb| vehicle.may(verb)), [true; 3]);
        assert_eq!(vehicle.reports(FOUND_AIRBORNE), ["found_airborne", "hold: the agent started in the air"]);
        assert_eq!([TAKEOFF, GOTO, ADVANCE].map(|verb| vehicle.may(verb)), [false; 3]);
        assert_eq!(vehicle.is_ordered("hold"), ["order hold", "hold: ordered by the operator"]);
        assert_eq!([TAKEOFF, GOTO, ADVANCE].map(|verb| vehicle.may(verb)), [false; 3]);
        assert_eq!(vehicle.is_ordered("resume"), ["order resume", "goto 0", "plan: waypoint"]);
        assert_eq!(vehicle.reports(PLANNED), ["planned", "advance"]);
        assert_eq!(vehicle.arrives(0), ["arrived 0", "goto 1", "plan: waypoint"]);
        assert_eq!(vehicle.arrives(1), ["arrived 1", "land: mission complete"]);
        assert_eq!(vehicle.reports(LANDED), ["landed", "complete"]);
    }

    #[test]
    fn the_vehicle_lands_when_ordered_to() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(FOUND_AIRBORNE);
        assert_eq!(vehicle.is_ordered("land"), ["order land", "land: ordered by the operator"]);
        assert_eq!(vehicle.reports(LANDED), ["landed", "failed: ordered by the operator"]);
    }
}

mod link_loss {
    use super::*;

    fn in_the_air(link_loss: LinkLossPolicy) -> Vehicle {
        Vehicle::in_the_air(&AgentConfig { link_loss, ..config() })
    }

    fn fact(fact: &str, node: &str) -> Event {
        mine(fact).with("node", node)
    }

    /// What happens within a minute without the ground, and after how many seconds it begins.
    fn without_ground(vehicle: &mut Vehicle) -> Option<(u32, Vec<String>)> {
        assert_eq!(vehicle.learns(fact(PEER_LOST, GROUND)), ["peer_lost"]);
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
        vehicle.learns(fact(PEER_LOST, GROUND));
        assert_eq!(vehicle.after(4 * SECOND), NOTHING);
        assert_eq!(vehicle.learns(fact(PEER_JOINED, GROUND)), ["peer_joined"]);
        assert_eq!(vehicle.after(60 * SECOND), NOTHING);
        assert_eq!(without_ground(&mut vehicle).unwrap().0, 5, "the patience begins anew");
    }

    #[test]
    fn is_about_the_ground_alone() {
        let mut vehicle = in_the_air(LinkLossPolicy::Land);
        vehicle.learns(fact(PEER_LOST, LOWER));
        assert_eq!(vehicle.after(60 * SECOND), NOTHING);
        vehicle.learns(fact(PEER_LOST, GROUND));
        vehicle.learns(fact(PEER_JOINED, LOWER));
        assert_eq!(vehicle.after(5 * SECOND), ["land: ground station lost"]);
    }
}

mod right_of_way {
    use super::*;

    const PLACE: [f64; 3] = [5.0, 0.0, 2.0];

    /// A fact about the vehicle's claim.
    fn claim(fact: &str) -> Event {
        mine(fact).with("bthread", "right_of_way")
    }

    fn stalled(by: &str) -> Event {
        let enter = mine(ENTER).name().to_owned();
        mine(STALLED).with("event", enter).with("by", format!("{by}#right_of_way"))
    }

    /// A vehicle that has just claimed the passage.
    fn claiming() -> Vehicle {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(at(mine(PASSAGE), PLACE)), ["passage"]);
        vehicle
    }

    /// A vehicle whose claim is confirmed but stands against that of `other`.
    fn against(other: &str) -> Vehicle {
        let mut vehicle = claiming();
        let claim_of_other = Bid::new().block(EventSet::named(mine(ENTER).name()));
        vehicle.program.put_proxy(format!("{other}#right_of_way"), &claim_of_other);
        assert_eq!(vehicle.learns(claim(CONFIRMED)), ["confirmed"]);
        assert_eq!(vehicle.learns(stalled(other)), ["stalled"]);
        vehicle
    }

    /// Whether the vehicle keeps others out of the passage, as they see it from another side.
    fn keeps_out(vehicle: &Vehicle) -> bool {
        [LOWER, HIGHER].iter().all(|other| {
            let enter = |x| at(vocabulary::event(other, ENTER), [x, 1.0, 2.0]);
            assert!(vehicle.allows(enter(8.5)), "another passage is free");
            !vehicle.allows(enter(7.5))
        })
    }

    #[test]
    fn is_claimed_then_confirmed_then_used_and_kept_until_the_passage_lies_behind() {
        let mut vehicle = claiming();
        assert!(keeps_out(&vehicle));
        assert_eq!(vehicle.after(SECOND), NOTHING, "no way without confirmation");
        assert_eq!(vehicle.learns(mine(CONFIRMED).with("bthread", "mission")), ["confirmed"]);
        assert_eq!(vehicle.learns(claim(CONFIRMED)), ["confirmed", "enter", "advance"]);
        assert_eq!(*vehicle.last(ENTER), at(mine(ENTER), PLACE));
        assert_eq!(vehicle.after(CYCLE), ["advance"]);
        assert!(keeps_out(&vehicle));
        assert_eq!(vehicle.reports(LEAVE), ["leave"]);
        assert!(!keeps_out(&vehicle));
    }

    #[test]
    fn is_given_to_a_lower_number_and_claimed_again_when_that_has_left() {
        let mut vehicle = against(LOWER);
        assert!(!keeps_out(&vehicle));
        assert_eq!(vehicle.after(SECOND), NOTHING);
        vehicle.program.remove_proxy("uav/9#right_of_way");
        assert_eq!(vehicle.learns(vocabulary::event(LOWER, LEAVE)), ["uav/9/leave"]);
        assert!(keeps_out(&vehicle));
        assert!(!vehicle.may(ADVANCE), "the new claim is to be confirmed too");
        assert_eq!(vehicle.learns(claim(CONFIRMED)), ["confirmed", "enter", "advance"]);
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
        assert!(!vehicle.may(ADVANCE));
        vehicle.program.remove_proxy("uav/11#right_of_way");
        assert_eq!(vehicle.happened(), ["enter"]);
    }

    #[test]
    fn is_to_be_confirmed_again_once_the_claim_has_lapsed() {
        let mut vehicle = against(HIGHER);
        assert_eq!(vehicle.learns(claim(BLOCK_LAPSED)), ["block_lapsed"]);
        vehicle.program.remove_proxy("uav/11#right_of_way");
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert_eq!(vehicle.learns(claim(CONFIRMED)), ["confirmed", "enter", "advance"]);
    }

    #[test]
    fn ends_with_the_flight() {
        let mut vehicle = claiming();
        vehicle.is_ordered("land");
        assert!(keeps_out(&vehicle), "a vehicle that lands in a passage fills it");
        vehicle.reports(LANDED);
        assert!(!keeps_out(&vehicle));
    }
}

mod separation {
    use super::*;

    #[test]
    fn a_neighbour_too_close_stops_the_vehicle_until_it_is_clear() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(mine(TOO_CLOSE).with("other", LOWER)), ["too_close"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert!(!vehicle.may(ADVANCE));
        assert_eq!(vehicle.reports(CLEAR), ["clear", "advance"]);
    }
}

mod sleep {
    use super::*;

    #[test]
    fn an_agent_that_did_not_run_leaves_its_vehicle_alone_until_it_is_handed_back() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(mine(SLEPT).with("seconds", 3.0)), ["slept"]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert!(!vehicle.may(ADVANCE) && !vehicle.may(LAND));
        assert_eq!(vehicle.is_ordered("hand_back"), ["order hand_back", "hand_back", "advance"]);
    }
}

mod one_name {
    use super::*;

    #[test]
    fn a_name_that_another_process_has_too_holds_the_vehicle_until_it_is_resumed() {
        let mut vehicle = Vehicle::on_its_way();
        let told = vehicle.learns(mine(DUPLICATE_NAME).with("incarnation", 4));
        let hold = "hold: another process has this vehicle's name; end one of them, then resume";
        assert_eq!(told, ["duplicate_name", hold]);
        assert_eq!(vehicle.after(SECOND), NOTHING);
        assert!(!vehicle.may(ADVANCE) && !vehicle.may(TAKEOFF) && vehicle.may(HOMEWARD));
        assert_eq!(vehicle.is_ordered("resume"), ["order resume", "advance"]);
        let again = vehicle.learns(mine(DUPLICATE_NAME).with("incarnation", 4));
        assert_eq!(again, ["duplicate_name", hold], "it goes on while the other is there");
    }
}

mod return_home {
    use super::*;

    #[test]
    fn a_vehicle_on_its_way_down_is_not_sent_home() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.is_ordered("land");
        assert_eq!(vehicle.reports(FENCE_BREACHED), ["fence_breached", "return: outside the geofence"]);
    }

    #[test]
    fn an_order_to_land_on_the_ground_does_not_count_in_the_air() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(READY);
        vehicle.is_ordered("hand_back");
        vehicle.is_ordered("land");
        vehicle.reports(TAKEOFF);
        let happened = vehicle.reports(BATTERY_LOW);
        assert!(happened.contains(&"goto -1".into()), "{happened:?}");
    }

    #[test]
    fn who_turned_home_while_climbing_is_led_nowhere_else_once_it_is_up() {
        let mut vehicle = Vehicle::new(&config());
        vehicle.reports(READY);
        vehicle.reports(TAKEOFF);
        let home = ["battery_low", "return: battery low", "goto -1", "plan: waypoint"];
        assert_eq!(vehicle.reports(BATTERY_LOW), home);
        assert_eq!(vehicle.reports(AIRBORNE), ["airborne"]);
        let why = "declined: it is not free to go: on the ground, landing or returning";
        assert_eq!(vehicle.hears(at(order(ME, "goto"), [4.0, 3.0, 2.0])), ["order goto", why]);
    }
}

mod reposition {
    use super::*;

    const POINT: [f64; 3] = [4.0, 3.0, 2.0];

    fn goto() -> Event {
        at(order(ME, "goto"), POINT)
    }

    #[test]
    fn the_vehicle_goes_where_it_is_told_hovers_there_and_resumes_its_mission() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(goto()), ["order goto", "goto -2", "plan: waypoint"]);
        let [x, y, z] = ["x", "y", "z"].map(|axis| vehicle.last(GOTO).real(axis));
        assert_eq!([x, y, z], POINT.map(Some));
        assert_eq!(vehicle.hears(mine(PLANNED).with("leg", -2)), ["planned -2", "advance"]);
        assert_eq!(vehicle.arrives(-2), ["arrived -2"]);
        assert_eq!(vehicle.after(10 * SECOND), NOTHING, "it does not go on by itself");
        assert_eq!(vehicle.is_ordered("resume"), ["order resume", "goto 0", "plan: waypoint"]);
    }

    #[test]
    fn a_vehicle_on_hold_is_free_to_go() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.is_ordered("hold");
        assert!(!vehicle.may(ADVANCE));
        vehicle.hears(goto());
        assert_eq!(vehicle.hears(mine(PLANNED).with("leg", -2)), ["planned -2", "advance"]);
    }

    #[test]
    fn a_point_outside_the_fence_is_declined_and_the_mission_goes_on() {
        let mut vehicle = Vehicle::on_its_way();
        assert_eq!(vehicle.hears(at(order(ME, "goto"), [1e4, 0.0, 2.0])), ["order goto"]);
        let declined = vehicle.after(2 * SECOND);
        assert!(declined.iter().any(|event| event.starts_with("declined: ")), "{declined:?}");
        assert!(vehicle.may(ADVANCE));
    }

    #[test]
    fn a_point_without_a_way_is_declined_and_the_vehicle_stays_in_the_air() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.hears(goto());
        let unplannable = || mine(UNPLANNABLE).with("leg", -2).with("why", "walled in");
        for _ in 0..2 {
            vehicle.hears(unplannable());
            vehicle.after(SECOND);
        }
        assert_eq!(vehicle.hears(unplannable()), ["unplannable: walled in", "declined: walled in"]);
        assert_eq!(vehicle.is_ordered("resume"), ["order resume", "goto 0", "plan: waypoint"]);
    }

    #[test]
    fn a_vehicle_on_the_ground_or_on_its_way_down_declines() {
        let mut grounded = Vehicle::new(&config());
        assert!(grounded.hears(goto())[1].starts_with("declined: it is not free"));
        let mut landing = Vehicle::on_its_way();
        landing.is_ordered("land");
        assert!(landing.hears(goto())[1].starts_with("declined: it is not free"));
    }
}

mod right_of_way_without_the_lost {
    use super::*;

    /// In a fleet of five, whose others are all heard.
    fn in_reach() -> Vehicle {
        let roster = [ME, LOWER, HIGHER, "uav/12", "ground/1", "script/operator"].map(str::to_owned);
        let config = AgentConfig { roster: roster.to_vec(), ..config() };
        let mut vehicle = Vehicle::in_the_air(&config);
        for other in [LOWER, HIGHER, "uav/12", "ground/1"] {
            vehicle.learns(mine(PEER_JOINED).with("node", other));
        }
        vehicle.after(2 * SECOND);
        vehicle.reports(PLANNED);
        vehicle
    }

    fn loses(vehicle: &mut Vehicle, other: &str, released: &str) {
        vehicle.learns(mine(PEER_LOST).with("node", other).with("released", released));
    }

    /// The homes whose confirmation a claim waits for.
    fn asks(vehicle: &mut Vehicle) -> Vec<&'static str> {
        vehicle.hears(at(mine(PASSAGE), [5.0, 0.0, 2.0]));
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
        vehicle.learns(mine(PEER_JOINED).with("node", HIGHER));
        assert!(asks(&mut vehicle).is_empty(), "it claims at once");
        vehicle.after(2 * SECOND);
        assert!(!vehicle.may(ADVANCE));
    }
}

//! The navigator without behavioural programming: one loop and one state machine around the same pipeline.
//!
//! It is what the b-threads are compared with (Wang 2023, the second experiment). It hears the same reports as they
//! do and orders the same acts, at the same rates: takes off when the checks pass, flies the waypoints in turn, plans
//! anew around what is in the way, goes home on a low battery and from beyond the fence, and lands. But it knows only
//! its own vehicle: nobody can hold it from afar or order it about, and it yields to nobody in a narrow passage.

use std::time::Duration;

use skein_agent::bthreads::{escape, mission, navigation, path_planning, return_home};
use skein_agent::{AgentConfig, Me, Mind};
use skein_bp::{Event, Origin, Program};
use skein_dbp::{Happened, Node};
use skein_wire::event::{
    self, Advance, Airborne, Arrived, BatteryCritical, BatteryLow, Clear, CommandFailed, Complete,
    Declared as _, Failed, FenceBreached, FoundAirborne, Hold, Homeward, Land, Landed, PathBlocked,
    PilotTook, Plan, PlanReason, Planned, PositionDoubted, PositionTrusted, Ready, Slept, Stuck, Takeoff,
    TooClose, Unplannable, Unready,
};

/// The navigator's name in the trace.
const NAME: &str = "sequential";

/// The state machine.
#[derive(Clone, Debug)]
pub struct Sequential {
    me: Me,
    /// The `goto` of each waypoint, in order.
    waypoints: Vec<Event>,
    /// The `goto` home.
    home: Event,
    stage: Stage,
    way: Way,
    /// Whether the checks before take-off pass.
    ready: bool,
    /// Whether a neighbour is inside the emergency distance.
    too_close: bool,
    is_lost: bool,
    /// Escapes from local minima on the way to this waypoint.
    escapes: u8,
    acts: Vec<Event>,
}

/// Where the flight stands.
#[derive(Clone, Debug, PartialEq)]
enum Stage {
    Grounded,
    Climbing,
    Flying {
        leg: usize,
    },
    Returning {
        why: String,
    },
    Landing {
        failure: Option<String>,
    },
    /// Somebody else has the vehicle.
    Taken,
    Over,
}

/// Where the path to the waypoint stands.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    None,
    Wanted { why: PlanReason, attempt: u8, due: Duration },
    Asked { attempt: u8 },
    Known { leave_due: Duration },
}

impl Sequential {
    /// The navigator of a vehicle that stands on the ground: over its waypoints, landing at the last, and home where
    /// it must.
    pub fn new(config: &AgentConfig) -> Self {
        let (me, [x, y, _]) = (Me::new(&config.node), config.home);
        Self {
            waypoints: mission::gotos(&me, &config.waypoints),
            home: return_home::goto(&me, [x, y, config.return_altitude_m]),
            me,
            stage: Stage::Grounded,
            way: Way::None,
            ready: false,
            too_close: false,
            is_lost: false,
            escapes: 0,
            acts: Vec::new(),
        }
    }

    /// Takes in a report of the vehicle's body.
    fn take_in(&mut self, now: Duration, report: &Event) {
        let why = || event::why(report).unwrap_or("no reason given").to_owned();
        let arrived_at = Arrived::read(report).map(|arrived| arrived.leg);
        let is_under_way = matches!(self.stage, Stage::Flying { .. } | Stage::Returning { .. });
        match (self.me.verb(report).unwrap_or_default(), &self.stage) {
            (verb @ (Ready::NAME | Unready::NAME), _) => self.ready = verb == Ready::NAME,
            (verb @ (TooClose::NAME | Clear::NAME), _) => self.too_close = verb == TooClose::NAME,
            (verb @ (PositionDoubted::NAME | PositionTrusted::NAME), _) => {
                self.is_lost = verb == PositionDoubted::NAME;
            }
            (Airborne::NAME, Stage::Climbing) => self.fly(now, 0),
            (Arrived::NAME, Stage::Flying { leg }) if arrived_at == i64::try_from(*leg).ok() => {
                self.fly(now, leg + 1);
            }
            (Arrived::NAME, Stage::Returning { why }) if arrived_at == Some(return_home::HOME_LEG) => {
                self.land(Some(why.clone()));
            }
            (Planned::NAME, _) if is_under_way => self.way = Way::Known { leave_due: now },
            (Unplannable::NAME, _) if is_under_way => self.plan_again(now, why()),
            (PathBlocked::NAME, _) if is_under_way => self.plan(PlanReason::Obstacle, now),
            (Stuck::NAME, _) if is_under_way && self.escapes < escape::ATTEMPTS => {
                self.escapes += 1;
                self.plan(PlanReason::Stuck, now);
            }
            (Stuck::NAME, _) if is_under_way => {
                self.land(Some("stuck: no way past what stands around".to_owned()));
            }
            (BatteryLow::NAME, Stage::Climbing | Stage::Flying { .. }) => self.go_home(now, "battery low"),
            (FenceBreached::NAME, Stage::Flying { .. }) => self.go_home(now, "outside the geofence"),
            (BatteryCritical::NAME, Stage::Climbing | Stage::Flying { .. } | Stage::Returning { .. }) => {
                self.land(Some("battery nearly empty".to_owned()));
            }
            (verb @ (PilotTook::NAME | Slept::NAME | FoundAirborne::NAME), _) => {
                if verb == FoundAirborne::NAME {
                    self.acts.push(self.me.event(Hold { why: "the agent started in the air".into() }));
                }
                (self.stage, self.way) = (Stage::Taken, Way::None);
            }
            (CommandFailed::NAME, Stage::Climbing) => self.end(Some(why())),
            (Landed::NAME, Stage::Landing { failure }) => self.end(failure.clone()),
            (Landed::NAME, Stage::Taken) => self.end(Some("somebody else flew it".to_owned())),
            (Landed::NAME, Stage::Climbing | Stage::Flying { .. } | Stage::Returning { .. }) => {
                self.end(Some("the autopilot landed by itself".to_owned()));
            }
            _ => {}
        }
    }

    /// The events to happen now, in this order; none until something is heard or due.
    fn step(&mut self, now: Duration) -> Vec<Event> {
        if self.stage == Stage::Grounded && self.ready {
            self.stage = Stage::Climbing;
            self.acts.push(self.me.event(Takeoff));
        }
        match self.way {
            Way::Wanted { why, attempt, due } if now >= due => {
                self.way = Way::Asked { attempt };
                self.acts.push(self.me.event(Plan { why }));
            }
            Way::Known { leave_due } if now >= leave_due && !self.too_close && !self.is_lost => {
                self.way = Way::Known { leave_due: now + navigation::CYCLE };
                let homeward = matches!(self.stage, Stage::Returning { .. });
                self.acts.push(if homeward {
                    self.me.event(Homeward)
                } else {
                    self.me.event(Advance::ANYWHERE)
                });
            }
            _ => {}
        }
        std::mem::take(&mut self.acts)
    }

    /// Flies to waypoint `leg`, or lands after the last.
    fn fly(&mut self, now: Duration, leg: usize) {
        match self.waypoints.get(leg).cloned() {
            Some(goto) => self.head_for(now, goto, Stage::Flying { leg }),
            None => self.land(None),
        }
    }

    fn go_home(&mut self, now: Duration, why: &str) {
        self.head_for(now, self.home.clone(), Stage::Returning { why: why.to_owned() });
    }

    fn head_for(&mut self, now: Duration, goto: Event, stage: Stage) {
        self.stage = stage;
        self.escapes = 0;
        self.acts.push(goto);
        self.plan(PlanReason::Waypoint, now);
    }

    fn plan(&mut self, why: PlanReason, now: Duration) {
        self.way = Way::Wanted { why, attempt: 1, due: now };
    }

    fn plan_again(&mut self, now: Duration, why: String) {
        match self.way {
            Way::Asked { attempt } if attempt < path_planning::ATTEMPTS => {
                let due = now + path_planning::PAUSE;
                self.way = Way::Wanted { why: PlanReason::Waypoint, attempt: attempt + 1, due };
            }
            _ => self.land(Some(why)),
        }
    }

    fn land(&mut self, failure: Option<String>) {
        self.way = Way::None;
        self.acts.push(self.me.event(Land { why: failure.as_deref().unwrap_or("mission complete").into() }));
        self.stage = Stage::Landing { failure };
    }

    fn end(&mut self, failure: Option<String>) {
        (self.stage, self.way) = (Stage::Over, Way::None);
        self.acts.push(match failure {
            None => self.me.event(Complete),
            Some(why) => self.me.event(Failed { why: why.into() }),
        });
    }
}

impl Mind for Sequential {
    fn load(&self, _: &mut Program, _: &AgentConfig) {}

    fn hear(&mut self, now: Duration, report: Event, _: &mut Node) {
        self.take_in(now, &report);
    }

    fn decide(&mut self, now: Duration, node: &mut Node) -> Vec<Happened> {
        // What the others do is nothing to it.
        node.take_selections();
        let home = node.name().clone();
        let happened = |event| Happened {
            event,
            home: home.clone(),
            seq: 0,
            term: 0,
            origin: Origin::Internal,
            requested_by: vec![NAME.into()],
            choice: None,
            at: now,
        };
        self.step(now).into_iter().map(happened).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fly::agent_configs;
    use crate::scenario::Scenario;

    /// The navigator and a clock; every report is answered with the verbs of what is then done.
    struct Loop {
        navigator: Sequential,
        me: Me,
        now: Duration,
    }

    impl Loop {
        fn new() -> Self {
            let scenario = Scenario::built_in("open", Some(1), 1).expect("it is built in");
            let [config] = agent_configs(&scenario).try_into().expect("one vehicle");
            let waypoints = vec![[10.0, 0.0, 2.0], [10.0, 10.0, 2.0]];
            let navigator = Sequential::new(&AgentConfig { waypoints, ..config });
            Self { navigator, me: Me::new("uav/1"), now: Duration::ZERO }
        }

        /// On its way to the first waypoint, with a path.
        fn under_way() -> Self {
            let mut vehicle = Self::new();
            for verb in [Ready::NAME, Airborne::NAME, Planned::NAME] {
                vehicle.after(Event::new(vehicle.me.event_name(verb)));
            }
            vehicle
        }

        fn after(&mut self, report: Event) -> Vec<String> {
            self.navigator.take_in(self.now, &report);
            self.wait(0)
        }

        fn wait(&mut self, ms: u64) -> Vec<String> {
            self.now += Duration::from_millis(ms);
            let acts = self.navigator.step(self.now);
            acts.iter().map(|act| self.me.verb(act).unwrap_or_default().to_owned()).collect()
        }

        fn hears(&mut self, verb: &str) -> Vec<String> {
            self.after(Event::new(self.me.event_name(verb)))
        }

        fn arrives(&mut self, leg: i64) -> Vec<String> {
            self.after(self.me.event(Arrived { leg }))
        }
    }

    #[test]
    fn it_flies_its_waypoints_in_turn_and_lands() {
        let mut vehicle = Loop::new();
        assert!(vehicle.wait(1000).is_empty(), "the checks have not passed");
        assert_eq!(vehicle.hears(Ready::NAME), [Takeoff::NAME]);
        assert_eq!(vehicle.hears(Airborne::NAME), ["goto", Plan::NAME]);
        assert_eq!(vehicle.hears(Planned::NAME), [Advance::NAME]);
        assert!(vehicle.wait(80).is_empty());
        assert_eq!(vehicle.wait(20), [Advance::NAME]);
        assert!(vehicle.arrives(1).is_empty(), "that is not where it is going");
        assert_eq!(vehicle.arrives(0), ["goto", Plan::NAME]);
        assert_eq!(vehicle.hears(Planned::NAME), [Advance::NAME]);
        assert_eq!(vehicle.arrives(1), [Land::NAME]);
        assert_eq!(vehicle.hears(Landed::NAME), [Complete::NAME]);
        assert!(vehicle.hears(Ready::NAME).is_empty(), "there is nothing left to fly for");
    }

    #[test]
    fn it_does_not_move_along_a_blocked_path() {
        let mut vehicle = Loop::under_way();
        assert_eq!(vehicle.hears(PathBlocked::NAME), [Plan::NAME]);
        assert!(vehicle.wait(500).is_empty());
        assert_eq!(vehicle.hears(Planned::NAME), [Advance::NAME]);
    }

    #[test]
    fn a_waypoint_without_a_path_is_tried_three_times() {
        let mut vehicle = Loop::under_way();
        vehicle.hears(PathBlocked::NAME);
        for _ in 0..2 {
            assert!(vehicle.hears(Unplannable::NAME).is_empty());
            assert_eq!(vehicle.wait(1000), [Plan::NAME]);
        }
        assert_eq!(vehicle.hears(Unplannable::NAME), [Land::NAME]);
        assert_eq!(vehicle.hears(Landed::NAME), [Failed::NAME]);
    }

    #[test]
    fn it_gives_up_a_waypoint_that_it_is_stuck_before() {
        let mut vehicle = Loop::under_way();
        for _ in 0..escape::ATTEMPTS {
            assert_eq!(vehicle.hears(Stuck::NAME), [Plan::NAME]);
            vehicle.hears(Planned::NAME);
        }
        assert_eq!(vehicle.hears(Stuck::NAME), [Land::NAME]);
    }

    #[test]
    fn a_low_battery_brings_it_home() {
        let mut vehicle = Loop::under_way();
        assert_eq!(vehicle.hears(BatteryLow::NAME), ["goto", Plan::NAME]);
        assert_eq!(vehicle.hears(Planned::NAME), [Homeward::NAME]);
        assert_eq!(vehicle.arrives(return_home::HOME_LEG), [Land::NAME]);
        assert_eq!(vehicle.hears(Landed::NAME), [Failed::NAME]);
    }

    #[test]
    fn it_waits_while_a_neighbour_is_too_close() {
        let mut vehicle = Loop::under_way();
        assert!(vehicle.hears(TooClose::NAME).is_empty());
        assert!(vehicle.wait(500).is_empty());
        assert_eq!(vehicle.hears(Clear::NAME), [Advance::NAME]);
    }

    #[test]
    fn what_a_pilot_has_taken_it_leaves_alone() {
        let mut vehicle = Loop::under_way();
        assert!(vehicle.hears(PilotTook::NAME).is_empty());
        assert!(vehicle.wait(10_000).is_empty());
        assert!(vehicle.hears(PathBlocked::NAME).is_empty());
        assert_eq!(vehicle.hears(Landed::NAME), [Failed::NAME]);
    }
}

//! The rule that reads well and is wrong: enter a passage in which nobody has been heard to be.
//!
//! Between another's `enter` and the news of it, two that arrive together both find the passage empty. It is flown
//! beside [`RightOfWay`](skein_agent::bthreads::RightOfWay).

use std::collections::BTreeMap;

use serde::Serialize;
use skein_agent::stretch::Stretch;
use skein_agent::{AgentConfig, Me, Mind, bthreads, precedence};
use skein_bp::{BThread, Bid, Context, Event, Program};
use skein_wire::event::{Advance, Declared, Enter, Homeward, Landed, Leave, Passage, of_every_vehicle};

/// The behaviour of a vehicle that shares passages by this rule.
#[derive(Debug)]
pub struct Naive;

impl Mind for Naive {
    fn load(&self, program: &mut Program, config: &AgentConfig) {
        bthreads::load_with(program, config, NaiveRightOfWay::new(Me::new(&config.node)));
    }
}

/// Enters a passage as soon as nobody is heard to be in it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct NaiveRightOfWay {
    me: Me,
    /// Who was heard to enter and not yet to leave: the `enter`s of each vehicle.
    inside: BTreeMap<String, Vec<Event>>,
    /// The stretch that lies ahead, as it was announced last.
    ahead: Stretch,
    /// What of it was entered.
    entered: Stretch,
    /// The place of it to enter next.
    next: usize,
}

impl NaiveRightOfWay {
    /// The b-thread of vehicle `me`.
    #[must_use]
    pub fn new(me: Me) -> Self {
        Self { me, inside: BTreeMap::new(), ahead: Stretch::default(), entered: Stretch::default(), next: 0 }
    }
}

impl BThread for NaiveRightOfWay {
    fn bid(&self) -> Option<Bid> {
        let me = &self.me;
        let bid = Bid::new()
            .priority(precedence::COLLISION)
            .wait_for(of_every_vehicle::<(Enter, Leave, Landed)>())
            .wait_for(me.any::<Passage>());
        if self.ahead.is_part_of(&self.entered) {
            return Some(bid);
        }
        let against = self.ahead.against();
        let taken = self.inside.values().flatten().any(|enter| against.contains(enter));
        let bid = bid.block(me.any::<(Advance, Homeward)>());
        Some(if taken { bid } else { self.ahead.enter(self.next, me).into_iter().fold(bid, Bid::request) })
    }

    fn resume(&mut self, event: &Event, _: &mut Context) {
        let mine = event.home() == self.me.name();
        match event.kind() {
            Passage::NAME => {
                (self.ahead, self.next) = (Stretch::read(event).unwrap_or_default(), 0);
            }
            Enter::NAME if !mine => {
                self.inside.entry(event.home().to_owned()).or_default().push(event.clone())
            }
            Enter::NAME => {
                self.next += 1;
                if self.ahead.enter(self.next, &self.me).is_none() {
                    self.entered = self.ahead.clone();
                }
            }
            _ if !mine => drop(self.inside.remove(event.home())),
            _ => (self.ahead, self.entered) = (Stretch::default(), Stretch::default()),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use skein_bp::ProgramConfig;
    use skein_sim::fly::agent_configs;
    use skein_sim::scenario::Scenario;
    use skein_wire::event::{Airborne, Planned, Ready, Takeoff};

    use super::*;

    const ME: &str = "uav/2";
    const LOWER: &str = "uav/1";
    const HIGHER: &str = "uav/3";
    const PLACE: [f64; 3] = [5.0, 0.0, 2.0];

    /// An event of this type without data.
    fn named<D: Declared>(node: &str) -> Event {
        Event::new(format!("{node}/{}", D::NAME))
    }

    fn at(event: Event, [x, y, z]: [f64; 3]) -> Event {
        event.with("x", x).with("y", y).with("z", z)
    }

    /// The second of three vehicles, on its way to its first waypoint.
    struct Vehicle {
        program: Program,
        now: Duration,
    }

    impl Vehicle {
        fn on_its_way() -> Self {
            let scenario = Scenario::built_in("open", Some(3), 1).expect("it is built in");
            let mut program = Program::new(ProgramConfig::vehicle(1));
            Naive.load(&mut program, &agent_configs(&scenario)[1]);
            let mut vehicle = Self { program, now: Duration::ZERO };
            for event in [Ready.at(ME), Takeoff.at(ME), Airborne.at(ME)] {
                vehicle.hears(event);
            }
            assert_eq!(vehicle.hears(named::<Planned>(ME)), [named::<Planned>(ME), named::<Advance>(ME)]);
            vehicle
        }

        fn happened(&mut self) -> Vec<Event> {
            let selections = self.program.superstep(self.now).expect("it comes to rest");
            selections.into_iter().map(|selection| selection.event).collect()
        }

        fn hears(&mut self, event: Event) -> Vec<Event> {
            self.program.enqueue(event);
            self.happened()
        }

        fn learns(&mut self, event: Event) -> Vec<Event> {
            self.program.occurred(event);
            self.happened()
        }

        fn after(&mut self, wait: Duration) -> Vec<Event> {
            self.now += wait;
            self.happened()
        }
    }

    #[test]
    fn enters_at_once_when_nobody_is_heard_inside_and_blocks_nobody() {
        let mut vehicle = Vehicle::on_its_way();
        let passage = at(named::<Passage>(ME), PLACE);
        assert_eq!(vehicle.hears(passage.clone()), [passage, at(named::<Enter>(ME), PLACE)]);
        assert_eq!(vehicle.after(Duration::from_millis(100)), [named::<Advance>(ME)]);
        let other = at(named::<Enter>(LOWER), PLACE);
        assert!(vehicle.hears(other.clone()).contains(&other), "two are inside");
    }

    #[test]
    fn waits_until_all_who_were_heard_to_enter_the_same_passage_have_left_or_landed() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.learns(at(named::<Enter>(LOWER), [6.0, 1.0, 2.0]));
        vehicle.learns(at(named::<Enter>(HIGHER), PLACE));
        let passage = at(named::<Passage>(ME), PLACE);
        assert_eq!(vehicle.hears(passage.clone()), [passage]);
        assert!(vehicle.after(Duration::from_secs(1)).is_empty());
        vehicle.learns(named::<Leave>(LOWER));
        assert!(vehicle.hears(named::<Advance>(ME)).is_empty(), "it has no leave to move");
        let happened = vehicle.learns(named::<Landed>(HIGHER));
        assert!(happened.contains(&at(named::<Enter>(ME), PLACE)), "{happened:?}");
    }

    #[test]
    fn does_not_mind_another_passage() {
        let mut vehicle = Vehicle::on_its_way();
        vehicle.learns(at(named::<Enter>(LOWER), [15.0, 1.0, 2.0]));
        let passage = at(named::<Passage>(ME), PLACE);
        assert_eq!(vehicle.hears(passage.clone()), [passage, at(named::<Enter>(ME), PLACE)]);
    }
}

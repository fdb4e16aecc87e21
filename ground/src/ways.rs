//! The ways that vehicles still have to fly and the scripts that they were sent, as far as they have told.

use std::collections::BTreeMap;

use skein_bp::script::Assignment;
use skein_dbp::{Happened, NodeName};
use skein_wire::event::{Declared as _, Goto, Land, Load, OrderTaken, Rerouted, Return, Takeoff, What};
use skein_wire::{Readiness, Route, State};

/// Each vehicle's way.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ways(BTreeMap<NodeName, Way>);

#[derive(Clone, Debug, Default)]
struct Way {
    /// The mission that it was configured with, until it has told of a route (ENU, metres).
    points: Vec<[f64; 3]>,
    is_route: bool,
    bound: Bound,
    is_held: bool,
    /// The scripts that it was sent, by the names that they run under.
    scripts: BTreeMap<String, Assignment>,
}

/// Where a vehicle is bound for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Bound {
    /// It has told of nothing yet: it stands before its mission, or this station has come late.
    #[default]
    Unknown,
    /// The point of its mission with this number.
    Leg(usize),
    /// A place that an operator has named.
    Place([f64; 3]),
    Home,
    Down,
}

impl Ways {
    /// Takes in what has happened at a vehicle.
    pub(crate) fn note(&mut self, happened: &Happened) {
        let (event, home) = (&happened.event, &happened.home);
        if let Some(Rerouted { way, .. }) = Rerouted::read(event) {
            if let Ok(route) = way.parse::<Route>() {
                let way = self.0.entry(home.clone()).or_default();
                (way.points, way.is_route, way.bound) = (route.points().to_vec(), true, Bound::Leg(0));
            }
        } else if let Some(Goto { leg, x, y, z, .. }) = Goto::read(event) {
            let bound = match usize::try_from(leg) {
                Ok(leg) => Bound::Leg(leg),
                Err(_) if leg == -1 => Bound::Home,
                Err(_) => Bound::Place([x, y, z]),
            };
            self.0.entry(home.clone()).or_default().bound = bound;
        } else if let Some(order) = OrderTaken::read(event) {
            let way = self.0.entry(home.clone()).or_default();
            way.is_held = order.what == What::Hold || way.is_held && !order.what.releases();
        } else if let Some(Load { name: Some(name), script, .. }) = Load::read(event) {
            if let Ok(assignment) = Assignment::from_json(&script) {
                self.0.entry(home.clone()).or_default().scripts.insert(name.to_string(), assignment);
            }
        } else {
            let bound = match event.kind() {
                Takeoff::NAME => Bound::Leg(0),
                Return::NAME => Bound::Home,
                Land::NAME => Bound::Down,
                _ => return,
            };
            if let Some(way) = self.0.get_mut(home) {
                way.bound = bound;
            }
        }
    }

    /// Takes in the mission that a vehicle is configured with.
    pub(crate) fn note_readiness(&mut self, said: &Readiness) {
        let way = self.0.entry(said.node.clone()).or_default();
        if !way.is_route && way.points != said.mission {
            way.points.clone_from(&said.mission);
        }
    }

    /// Whether an operator holds it in its place.
    pub(crate) fn is_held(&self, vehicle: &NodeName) -> bool {
        self.0.get(vehicle).is_some_and(|way| way.is_held)
    }

    /// The scripts that run on a vehicle in this state, of those that it was sent while this station listened.
    pub(crate) fn scripts(&self, vehicle: &NodeName, state: &State) -> Vec<Assignment> {
        let sent = self.0.get(vehicle).map(|way| &way.scripts);
        state.scripts.iter().filter_map(|name| sent?.get(name).cloned()).collect()
    }

    /// The points that a vehicle in this state still has to fly (ENU, metres), `home` being where it took off; none if it
    /// has told of none.
    pub(crate) fn ahead(
        &self,
        vehicle: &NodeName,
        state: &State,
        home: Option<[f64; 3]>,
    ) -> Option<Vec<[f64; 3]>> {
        let way = self.0.get(vehicle)?;
        let [x, y, z] = state.position.into();
        let points = match way.bound {
            Bound::Unknown if state.armed => state.path.last().map(|end| vec![(*end).into()])?,
            Bound::Unknown => way.points.clone(),
            Bound::Leg(leg) => way.points.get(leg..).unwrap_or_default().to_vec(),
            Bound::Place(place) => vec![place],
            Bound::Home => home.map(|[x, y, _]| vec![[x, y, z]])?,
            Bound::Down => vec![[x, y, z]],
        };
        (!points.is_empty()).then_some(points)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use nalgebra::Vector3;
    use skein_bp::{Event, Origin};
    use skein_wire::event::Text;

    use super::*;

    const MISSION: [[f64; 3]; 3] = [[10.0, 0.0, 3.0], [20.0, 0.0, 3.0], [30.0, 0.0, 3.0]];

    fn happened(event: Event, home: &NodeName) -> Happened {
        let (home, origin) = (home.clone(), Origin::Occurred);
        Happened {
            event,
            home,
            seq: 1,
            term: 0,
            origin,
            requested_by: Vec::new(),
            choice: None,
            at: Duration::ZERO,
        }
    }

    struct Told {
        ways: Ways,
        state: State,
    }

    impl Told {
        fn new() -> Self {
            let node = NodeName::new("uav/1").unwrap();
            let mut ways = Ways::default();
            ways.note_readiness(&Readiness {
                node: node.clone(),
                incarnation: 1,
                home: [0.0; 3],
                datum: [0.0; 3],
                checks: Vec::new(),
                mission: MISSION.to_vec(),
            });
            Self { ways, state: State { position: Vector3::new(5.0, 1.0, 3.0), ..State::new(node) } }
        }

        fn ahead(&self) -> Option<Vec<[f64; 3]>> {
            self.ways.ahead(&self.state.node, &self.state, Some([0.0; 3]))
        }
    }

    #[test]
    fn a_vehicle_on_the_ground_has_its_mission_before_it() {
        let mut told = Told::new();
        assert_eq!(told.ahead().unwrap(), MISSION);
        told.state.armed = true;
        assert_eq!(told.ahead(), None, "a station that came late does not know how far it has come");
        told.state.path = vec![Vector3::new(7.0, 0.0, 3.0), Vector3::new(20.0, 0.0, 3.0)];
        assert_eq!(told.ahead().unwrap(), [[20.0, 0.0, 3.0]], "but where it heads now");
    }

    #[test]
    fn what_it_tells_moves_it_along() {
        let mut told = Told::new();
        told.state.armed = true;
        let node = told.state.node.clone();
        let goto = |leg, [x, y, z]: [f64; 3]| Goto { leg, lands: false, x, y, z };
        let events = [
            (goto(1, MISSION[1]).at(&node), MISSION[1..].to_vec()),
            (goto(-2, [1.0, 2.0, 4.0]).at(&node), vec![[1.0, 2.0, 4.0]]),
            (goto(2, MISSION[2]).at(&node), MISSION[2..].to_vec()),
            (
                Rerouted { way: Text::from("1 1 3; 2 2 3"), by: Text::from("Anna") }.at(&node),
                vec![[1.0, 1.0, 3.0], [2.0, 2.0, 3.0]],
            ),
            (Return { why: Text::from("ordered") }.at(&node), vec![[0.0, 0.0, 3.0]]),
            (Land { why: Text::from("ordered") }.at(&node), vec![[5.0, 1.0, 3.0]]),
        ];
        for (event, ahead) in events {
            told.ways.note(&happened(event.clone(), &node));
            assert_eq!(told.ahead().unwrap(), ahead, "{event}");
        }
    }
}

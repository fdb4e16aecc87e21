//! An operator's order: one type from console, script and scenario to the vehicle.

use std::fmt;

use skein_bp::Event;
use skein_dbp::NodeName;

use crate::event::{Declared as _, Handover, Load, OrderGiven, OrderTaken, Text, Unload, What};
use crate::route::Route;

/// Whom an order is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Who {
    /// Every vehicle of the roster.
    All,
    These(Vec<NodeName>),
}

/// An operator's order: its word, whom it is for, and what some words need beyond that.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    what: What,
    who: Who,
    with: With,
}

/// The needs of a word.
#[derive(Clone, Debug, PartialEq)]
enum With {
    Nothing,
    Place(Destination),
    Way(Route),
    Script(SentScript),
    /// The name of a script, or of a person or program.
    Name(Text),
}

/// Where to go, metres ENU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Destination {
    pub x: f64,
    pub y: f64,
    /// Up; none to keep the height that each vehicle has.
    pub z: Option<f64>,
}

/// A script as it is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SentScript {
    /// The name it will run under.
    pub name: Text,
    /// The script and the values of its parameters, as JSON.
    pub text: Text,
}

/// The fields of an order in a message or a file, beside its word and whom it is for.
#[derive(Clone, Debug, Default)]
pub struct Details {
    pub point: Option<Destination>,
    pub points: Option<Vec<[f64; 3]>>,
    /// The indices of those of `points` that are targets.
    pub stops: Option<Vec<usize>>,
    pub script: Option<SentScript>,
    pub name: Option<String>,
}

impl Order {
    /// The order of a word that needs no more. Whoever is given one that needs more declines it.
    #[must_use]
    pub fn new(what: What, who: Who) -> Self {
        Self { what, who, with: With::Nothing }
    }

    /// Fly there and hover until resumed. Several vehicles spread out around it.
    #[must_use]
    pub fn go_to(who: Who, place: Destination) -> Self {
        Self { what: What::GoTo, who, with: With::Place(place) }
    }

    /// Fly this instead of what is left of the mission, and land under the last point.
    #[must_use]
    pub fn route(vehicle: NodeName, way: Route) -> Self {
        Self { what: What::Route, who: Who::only(vehicle), with: With::Way(way) }
    }

    /// Run a script beside whatever you do.
    #[must_use]
    pub fn load(who: Who, script: SentScript) -> Self {
        Self { what: What::Load, who, with: With::Script(script) }
    }

    /// Run the script of this name no more.
    #[must_use]
    pub fn unload(who: Who, name: &str) -> Self {
        Self { what: What::Unload, who, with: With::Name(name.into()) }
    }

    /// Give a vehicle that one holds to another person or program.
    #[must_use]
    pub fn give(who: Who, to: &str) -> Self {
        Self { what: What::Give, who, with: With::Name(to.into()) }
    }

    /// Puts an order together from what a message or a file says.
    ///
    /// # Errors
    /// The field that is missing, or wrong, for people.
    pub fn read(what: What, who: Who, details: Details) -> Result<Self, String> {
        let Details { point, points, stops, script, name } = details;
        Ok(match what {
            What::Launch if who != Who::All => {
                return Err("a launch is for all: vehicles take off in turn".into());
            }
            what if what.is_for_all() && who != Who::All => {
                return Err("what is decided together is for all".into());
            }
            What::Load => Self::load(who, script.ok_or("`load` needs a `script`: {script, with}")?),
            What::Unload => Self::unload(who, &name.ok_or("`unload` needs the `name` of a script")?),
            What::Give => Self::give(who, &name.ok_or("`give` needs the `name` of a person or program")?),
            What::GoTo => {
                let place = point.ok_or("`goto` needs a `point`: [x, y, z or null], metres")?;
                if ![Some(place.x), Some(place.y), place.z].into_iter().flatten().all(f64::is_finite) {
                    return Err("`point` must be finite numbers".into());
                }
                Self::go_to(who, place)
            }
            What::Route => {
                let points = points.ok_or("`route` needs `points`: [[x, y, z], ...], metres")?;
                let route = Route::new(points).map_err(|error| error.to_string())?;
                let way = if let Some(stops) = stops { route.with_targets(&stops) } else { route };
                match who {
                    Who::These(mut vehicles) if vehicles.len() == 1 => Self::route(vehicles.remove(0), way),
                    // Two on one way would meet at its end.
                    _ => return Err("a route is for one vehicle: name it in `to`".into()),
                }
            }
            what => Self::new(what, who),
        })
    }

    pub fn what(&self) -> What {
        self.what
    }

    pub fn who(&self) -> &Who {
        &self.who
    }

    /// Where a `goto` leads.
    pub fn place(&self) -> Option<Destination> {
        if let With::Place(place) = self.with { Some(place) } else { None }
    }

    /// The points of a `route`.
    pub fn way(&self) -> Option<&Route> {
        if let With::Way(way) = &self.with { Some(way) } else { None }
    }

    /// The name of the script that it is about.
    pub fn script(&self) -> Option<&str> {
        match &self.with {
            With::Script(script) => Some(&script.name),
            With::Name(name) if self.what.is_about_script() => Some(name),
            _ => None,
        }
    }

    /// The order as `by` gives it to `who`: a vehicle or [`OrderGiven::ALL`]. The place of a `goto` is each vehicle's own
    /// ([`OrderGiven::at_place`]).
    #[must_use]
    pub fn given(&self, who: &str, by: &str) -> OrderGiven {
        let mut given = OrderGiven::plain(self.what, who, by);
        match &self.with {
            With::Nothing | With::Place(_) => {}
            With::Way(way) => given.way = Some(way.to_string().as_str().into()),
            With::Script(script) => {
                (given.name, given.script) = (Some(script.name.clone()), Some(script.text.clone()));
            }
            With::Name(name) if self.what == What::Give => given.to = Some(name.clone()),
            With::Name(name) => given.name = Some(name.clone()),
        }
        given
    }
}

impl OrderGiven {
    /// The event by which it comes to a vehicle; none if the station itself carries it out, or if it lacks what its word
    /// needs.
    #[must_use]
    pub fn brought_to(self, vehicle: &NodeName) -> Option<Event> {
        let Self { what, by, to, name, script, x, y, z, way, .. } = self;
        Some(match what {
            What::Load => Load { name, script: script?, by: Some(by) }.at(vehicle),
            What::Unload => Unload { name: name?, by: Some(by) }.at(vehicle),
            what if what.is_handover() => Handover { what, by, to }.at(vehicle),
            what if what.reaches_vehicle() => {
                OrderTaken { x, y, z, way, ..OrderTaken::plain(what, &by) }.at(vehicle)
            }
            _ => return None,
        })
    }
}

impl Who {
    #[must_use]
    pub fn only(vehicle: NodeName) -> Self {
        Self::These(vec![vehicle])
    }

    /// Whether it is for `vehicle`.
    pub fn includes(&self, vehicle: &NodeName) -> bool {
        match self {
            Self::All => true,
            Self::These(vehicles) => vehicles.contains(vehicle),
        }
    }
}

impl fmt::Display for Who {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str(OrderGiven::ALL),
            Self::These(vehicles) => {
                let names: Vec<&str> = vehicles.iter().map(NodeName::as_str).collect();
                f.write_str(&names.join(", "))
            }
        }
    }
}

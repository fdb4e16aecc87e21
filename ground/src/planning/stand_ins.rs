//! The targets of vehicles that are lost or have failed, and who visits them in their place.

use std::collections::BTreeMap;
use std::time::Duration;

use nalgebra::Vector3;
use skein_dbp::facts::{PeerJoined, PeerLost};
use skein_dbp::{Happened, NodeName};
use skein_wire::Route;
use skein_wire::event::{Arrived, Complete, Declared as _, Failed, Rerouted};

/// A vehicle that has been silent for this long is not reckoned with any more.
const LOST_AFTER: Duration = Duration::from_secs(5);

/// The rest of each vehicle's task, as far as it has told.
#[derive(Clone, Debug, Default, PartialEq)]
struct Task {
    /// The places it is to be at, each with the number of its leg, in order (ENU, metres).
    stops: Vec<(usize, Vector3<f64>)>,
    /// The one who has sent it there.
    by: String,
}

/// Targets that go to others in place of a vehicle.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Orphaned {
    pub(crate) of: NodeName,
    /// ENU, metres.
    pub(crate) targets: Vec<Vector3<f64>>,
    /// The one who has sent it there.
    pub(crate) by: String,
}

/// A vehicle that is not to visit places any more, because whom it stands in for has come back.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CalledOff {
    pub(crate) vehicle: NodeName,
    /// All that it still has to do (ENU, metres).
    pub(crate) left: Vec<Vector3<f64>>,
    pub(crate) by: String,
}

/// Follows what vehicles tell of their routes.
#[derive(Clone, Debug)]
pub(crate) struct StandIns {
    station: NodeName,
    tasks: BTreeMap<NodeName, Task>,
    /// Since when vehicles are not heard.
    silent_since: BTreeMap<NodeName, Duration>,
    /// The stand-ins, for whom and at which places.
    standing: Vec<(NodeName, NodeName, Vec<Vector3<f64>>)>,
}

impl StandIns {
    /// Those of the vehicles of this station.
    pub(crate) fn new(station: NodeName) -> Self {
        Self { station, tasks: BTreeMap::new(), silent_since: BTreeMap::new(), standing: Vec::new() }
    }

    /// The targets of those who have been silent for too long by now.
    pub(crate) fn due(&mut self, now: Duration) -> Vec<Orphaned> {
        let is_due = |since: &Duration| now >= *since + LOST_AFTER;
        let lost: Vec<_> = self
            .silent_since
            .iter()
            .filter(|(_, since)| is_due(since))
            .map(|(node, _)| node.clone())
            .collect();
        self.silent_since.retain(|_, since| !is_due(since));
        lost.iter().filter_map(|node| self.orphaned(node)).collect()
    }

    /// Takes in what has happened; gives back the targets that somebody else is to visit at once.
    pub(crate) fn note(&mut self, now: Duration, happened: &Happened) -> Option<Orphaned> {
        let (event, home) = (&happened.event, &happened.home);
        if let Some(Rerouted { way, by }) = Rerouted::read(event)
            && let Ok(route) = way.parse::<Route>()
        {
            let stops = route.targets().map(|(leg, place)| (leg, place.into())).collect();
            self.tasks.insert(home.clone(), Task { stops, by: by.to_string() });
        } else if let Some(Arrived { leg, .. }) = Arrived::read(event) {
            if let (Some(task), Ok(leg)) = (self.tasks.get_mut(home), usize::try_from(leg)) {
                task.stops.retain(|(stop, _)| *stop > leg);
            }
        } else if event.kind() == Complete::NAME {
            self.tasks.remove(home);
        } else if event.kind() == Failed::NAME {
            return self.orphaned(home);
        } else if let Some(lost) = PeerLost::read(event).filter(|_| *home == self.station) {
            self.silent_since.insert(lost.node, now);
        }
        None
    }

    /// The vehicle is there again, if this is what has happened: whoever stands in for it need not go there any more.
    pub(crate) fn returned(&mut self, happened: &Happened) -> Vec<CalledOff> {
        let joined = PeerJoined::read(&happened.event).filter(|_| happened.home == self.station);
        let Some(PeerJoined { node, .. }) = joined else { return Vec::new() };
        self.silent_since.remove(&node);
        let (over, standing) = std::mem::take(&mut self.standing)
            .into_iter()
            .partition::<Vec<_>, _>(|(_, lost, _)| *lost == node);
        self.standing = standing;
        over.into_iter().filter_map(|(vehicle, _, places)| self.called_off(vehicle, &places)).collect()
    }

    fn called_off(&self, vehicle: NodeName, places: &[Vector3<f64>]) -> Option<CalledOff> {
        let task = self.tasks.get(&vehicle)?;
        let ahead = || task.stops.iter().map(|(_, place)| *place);
        let left: Vec<_> = ahead().filter(|place| !places.contains(place)).collect();
        // What has been visited is, and who has nothing else to do may as well look.
        let is_worth_it = !left.is_empty() && left.len() < task.stops.len();
        is_worth_it.then(|| CalledOff { vehicle, left, by: task.by.clone() })
    }

    fn orphaned(&self, of: &NodeName) -> Option<Orphaned> {
        let task = self.tasks.get(of).filter(|task| !task.stops.is_empty())?;
        if self.standing.iter().any(|(_, lost, _)| lost == of) {
            return None;
        }
        let targets = task.stops.iter().map(|(_, place)| *place).collect();
        Some(Orphaned { of: of.clone(), targets, by: task.by.clone() })
    }

    /// The places where a vehicle still has to be (ENU, metres).
    pub(crate) fn ahead(&self, vehicle: &NodeName) -> Vec<Vector3<f64>> {
        let stops = self.tasks.get(vehicle).map(|task| task.stops.as_slice()).unwrap_or_default();
        stops.iter().map(|(_, place)| *place).collect()
    }

    /// Whether a vehicle has told of a route.
    pub(crate) fn knows(&self, vehicle: &NodeName) -> bool {
        self.tasks.contains_key(vehicle)
    }

    /// `vehicle` has been sent to places in place of one that is lost.
    pub(crate) fn stands_in(&mut self, vehicle: NodeName, lost: NodeName, places: Vec<Vector3<f64>>) {
        self.standing.push((vehicle, lost, places));
    }
}

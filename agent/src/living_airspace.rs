//! The living airspace: what is closed beside what the vehicle's configuration closes, because somebody has drawn it
//! on the map and has not removed it.

use std::time::Duration;

use nalgebra::{Vector2, Vector3};
use skein_planning::airspace::{Airspace, Area, KeepOut, NoFlyPrism, NoFlyZone, StayInside, ThreatZone};
use skein_wire::event::{Limit, ZoneKind};
use skein_wire::{Limits, Outline, Zone};

use crate::config::AgentConfig;
use crate::report::Report;

/// A zone that begins to count later is left, and kept out of, so much earlier, and earlier by the time that the way
/// out takes.
const LEAD_S: f64 = 5.0;
/// Nearer to a border than this nobody is said to have crossed it, m.
const CROSSED_M: f64 = 0.3;

/// The zones that a vehicle has regard for, and what its configuration closes.
#[derive(Debug)]
pub struct LivingAirspace {
    fixed: Airspace,
    /// All that is closed, as of the last look.
    closed: Airspace,
    /// Time since 1970 at this vehicle's time zero.
    epoch: Duration,
    cruise_m_s: f64,
    drawn: Vec<Drawn>,
    /// Whether other zones count than when that was asked last.
    has_changed: bool,
}

/// A zone.
#[derive(Debug)]
struct Drawn {
    zone: Zone,
    /// What it closes, without margin; nothing of a rally point, nor of a limit of height everywhere.
    closed: KeepOut,
    counts: bool,
    /// Whether the vehicle is in what it closes.
    is_inside: bool,
}

impl LivingAirspace {
    /// That of a vehicle for which nothing is drawn yet.
    pub fn new(config: &AgentConfig) -> Self {
        let (fixed, closed) = (config.airspace.clone(), config.airspace.clone());
        let (epoch, cruise_m_s) = (config.epoch, config.envelope.cruise_m_s);
        Self { fixed, closed, epoch, cruise_m_s, drawn: Vec::new(), has_changed: false }
    }

    /// The vehicle has regard for these zones from now on, and for no others.
    pub fn draw(&mut self, zones: Vec<Zone>) {
        let mut before = std::mem::take(&mut self.drawn);
        let place = |before: &[Drawn], zone: &Zone| before.iter().position(|drawn| drawn.zone == *zone);
        let known = |zone: Zone| match place(&before, &zone) {
            Some(index) => before.swap_remove(index),
            None => Drawn::new(zone),
        };
        self.drawn = zones.into_iter().map(known).collect();
        self.has_changed = true;
    }

    /// Looks at the time, for a vehicle that is there. Gives whether other zones count than before.
    pub fn look(&mut self, now: Duration, position: Option<&Vector3<f64>>) -> bool {
        let now_s = (self.epoch + now).as_secs_f64();
        let mut has_changed = std::mem::take(&mut self.has_changed);
        for drawn in &mut self.drawn {
            let [from_s, until_s] = drawn.zone.hours_s();
            let depth_m = position.map_or(0.0, |position| -drawn.closed.bare_room_m(position)).max(0.0);
            let lead_s = LEAD_S + depth_m / self.cruise_m_s;
            let counts = from_s - lead_s <= now_s && now_s < until_s;
            has_changed |= std::mem::replace(&mut drawn.counts, counts) != counts;
        }
        if has_changed {
            let drawn = self.drawn.iter().filter(|drawn| drawn.counts).map(|drawn| closed_by(&drawn.zone));
            self.closed = self.fixed.clone();
            drawn.for_each(|closed| self.closed.include(closed));
        }
        has_changed
    }

    /// News of a vehicle in the air that is there.
    pub fn watch(&mut self, position: &Vector3<f64>) -> Vec<Report> {
        let mut reports = Vec::new();
        for drawn in self.drawn.iter_mut().filter(|drawn| drawn.counts || drawn.is_inside) {
            let name = || drawn.zone.name().to_owned();
            let room_m = if drawn.counts { drawn.closed.bare_room_m(position) } else { f64::INFINITY };
            match drawn.is_inside {
                false if room_m < -CROSSED_M => reports.push(Report::InZone(name())),
                true if room_m > 0.0 => reports.push(Report::OutOfZone(name())),
                _ => continue,
            }
            drawn.is_inside = !drawn.is_inside;
        }
        reports
    }

    fn counting(&self) -> impl Iterator<Item = &Zone> {
        self.drawn.iter().filter(|drawn| drawn.counts).map(|drawn| &drawn.zone)
    }

    /// All that is closed, as of the last look.
    pub fn closed(&self) -> &Airspace {
        &self.closed
    }

    /// The rally points that are drawn, ENU, m.
    pub fn rally(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.counting().filter_map(|zone| match (zone.outline(), zone.heights_m()) {
            (Outline::Point([x, y]), [height_m, _]) => Some([*x, *y, height_m]),
            _ => None,
        })
    }

    /// These limits, and those of height that are drawn for everywhere.
    pub fn limits(&self, stated: &Limits) -> Limits {
        let everywhere = self.counting().filter(|zone| *zone.outline() == Outline::Everywhere);
        everywhere.fold(stated.clone(), |limits, zone| {
            let [low_m, high_m] = zone.heights_m();
            let limit = match zone.kind() {
                ZoneKind::NotAbove => Limit { max_z: Some(low_m), ..Limit::NONE },
                _ => Limit { min_z: Some(high_m), ..Limit::NONE },
            };
            limits.with(&format!("zone `{}`", zone.name()), &limit)
        })
    }

    /// The zone that counts and has a place in it, with its margin, or else lies in the straight way there.
    pub fn in_the_way(&self, from: &Vector3<f64>, to: &Vector3<f64>, margin_m: f64) -> Option<&str> {
        let counting = || self.drawn.iter().filter(|drawn| drawn.counts);
        let holds_end = |drawn: &&Drawn| drawn.closed.bare_room_m(to) < margin_m;
        let is_crossed = |drawn: &&Drawn| drawn.closed.inside_m(from, to) > 0.0;
        let found = counting().find(holds_end).or_else(|| counting().find(is_crossed));
        found.map(|drawn| drawn.zone.name())
    }
}

impl Drawn {
    fn new(zone: Zone) -> Self {
        let closed = KeepOut::new(closed_by(&zone), 0.0, 0.0);
        Self { zone, closed, counts: false, is_inside: false }
    }
}

/// The region that a zone closes.
pub fn closed_by(zone: &Zone) -> Airspace {
    let [floor_m, ceiling_m] = zone.heights_m();
    let area = match zone.outline() {
        Outline::Everywhere | Outline::Point(_) => return Airspace::default(),
        Outline::Circle { centre, radius_m } => {
            let (centre, radius_m) = (Vector2::from(*centre), *radius_m);
            Area::Round(NoFlyZone { centre, radius_m, floor_m, ceiling_m })
        }
        Outline::Polygon(corners) => {
            let corners = corners.iter().map(|corner| Vector2::from(*corner)).collect();
            Area::Cornered(NoFlyPrism { corners, floor_m, ceiling_m })
        }
    };
    let mut closed = Airspace::default();
    match (zone.kind(), area) {
        (ZoneKind::StayInside, area) => closed.stay_inside.push(StayInside { any_of: vec![area] }),
        (ZoneKind::NotBelow, area) => closed.low.push(area),
        (ZoneKind::Threat, Area::Round(NoFlyZone { centre, radius_m, .. })) => {
            closed.threats.push(ThreatZone { centre, radius_m });
        }
        (_, Area::Round(zone)) => closed.no_fly.push(zone),
        (_, Area::Cornered(zone)) => closed.prisms.push(zone),
    }
    closed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config_file::Config;

    fn airspace(epoch_s: u64, zones: &[&str]) -> LivingAirspace {
        let config = Config::example().unwrap().agent;
        let config =
            AgentConfig { epoch: Duration::from_secs(epoch_s), airspace: Airspace::default(), ..config };
        let mut airspace = LivingAirspace::new(&config);
        airspace.draw(zones.iter().map(|zone| zone.parse().unwrap()).collect());
        airspace
    }

    fn room_m(airspace: &LivingAirspace, place: [f64; 3]) -> f64 {
        KeepOut::new(airspace.closed().clone(), 0.0, 0.0).room_m(&place.into())
    }

    #[test]
    fn each_kind_closes_what_it_says() {
        let square = "[[0,0],[10,0],[10,10],[0,10]]";
        let closed = |kind: &str, place: [f64; 3]| {
            let mut airspace = airspace(0, &[&format!(r#"{{"name":"a",{kind}}}"#)]);
            assert!(airspace.look(Duration::ZERO, None));
            room_m(&airspace, place)
        };
        let no_fly = format!(r#""kind":"no_fly","corners_m":{square},"ceiling_m":8"#);
        assert_eq!((closed(&no_fly, [5.0, 3.0, 6.0]), closed(&no_fly, [5.0, 3.0, 9.0])), (-2.0, 1.0));
        let inside = format!(r#""kind":"stay_inside","corners_m":{square}"#);
        assert_eq!((closed(&inside, [5.0, 3.0, 6.0]), closed(&inside, [5.0, 13.0, 6.0])), (3.0, -3.0));
        let above = r#""kind":"not_above","centre_m":[0,0],"radius_m":20,"height_m":5"#;
        assert_eq!((closed(above, [0.0, 0.0, 6.0]), closed(above, [0.0, 0.0, 3.0])), (-1.0, 2.0));
        let below = r#""kind":"not_below","centre_m":[0,0],"radius_m":20,"height_m":5"#;
        assert_eq!((closed(below, [0.0, 0.0, 6.0]), closed(below, [0.0, 0.0, 3.0])), (1.0, -2.0));
        let threat = r#""kind":"threat","centre_m":[0,0],"radius_m":5"#;
        assert_eq!((closed(threat, [0.0, 0.0, 6.0]), closed(threat, [3.0, 0.0, 0.0])), (1.0, -2.0));
        assert_eq!(closed(r#""kind":"rally","centre_m":[0,0],"height_m":5"#, [0.0, 0.0, 5.0]), f64::INFINITY);
        assert_eq!(closed(r#""kind":"not_above","height_m":5"#, [0.0, 0.0, 9.0]), f64::INFINITY);
    }

    #[test]
    fn a_limit_of_height_everywhere_is_one_of_the_vehicles_limits_and_a_rally_point_a_place() {
        let high = r#"{"name":"high","kind":"not_above","height_m":12}"#;
        let point = r#"{"name":"barn","kind":"rally","centre_m":[1,2],"height_m":5}"#;
        let mut airspace = airspace(0, &[high, point]);
        airspace.look(Duration::ZERO, None);
        let low = Limits::of("uav/1", []).with("script", &Limit { max_z: Some(20.0), ..Limit::NONE });
        let limits = airspace.limits(&low);
        assert_eq!(limits.region().1[2], 12.0);
        assert_eq!(limits.in_words(), ["zone `high` limits z to at most 12 m"]);
        assert_eq!(airspace.rally().collect::<Vec<_>>(), [[1.0, 2.0, 5.0]]);
    }

    #[test]
    fn a_curfew_counts_from_a_little_before_it_begins_for_who_is_deep_inside_earlier_until_it_ends() {
        let curfew =
            r#"{"name":"a","kind":"no_fly","centre_m":[0,0],"radius_m":30,"from_s":1100,"until_s":1200}"#;
        let mut airspace = airspace(1000, &[curfew]);
        let (far, deep) = (Vector3::new(90.0, 0.0, 3.0), Vector3::new(0.0, 0.0, 3.0));
        let at = Duration::from_secs;
        assert!(airspace.look(at(0), Some(&far)), "it is new");
        assert_eq!(*airspace.closed(), Airspace::default());
        assert!(!airspace.look(at(94), Some(&far)));
        assert!(airspace.look(at(94), Some(&deep)), "it takes 10 s to leave");
        assert!(airspace.look(at(94), Some(&far)), "whoever is outside may yet pass");
        assert!(airspace.look(at(95), Some(&far)));
        assert_eq!(airspace.closed().no_fly.len(), 1);
        assert!(airspace.look(at(200), Some(&far)));
        assert_eq!(*airspace.closed(), Airspace::default());
    }

    #[test]
    fn whoever_is_in_a_zone_says_so_once_and_once_that_it_has_left() {
        let mut airspace = airspace(0, &[r#"{"name":"pond","kind":"no_fly","centre_m":[0,0],"radius_m":5}"#]);
        airspace.look(Duration::ZERO, None);
        let mut watch = |x| airspace.watch(&Vector3::new(x, 0.0, 3.0));
        assert_eq!([watch(6.0), watch(4.9)], [vec![], vec![]]);
        assert_eq!(watch(4.0), [Report::InZone("pond".into())]);
        assert_eq!(watch(4.0), []);
        assert_eq!(watch(5.1), [Report::OutOfZone("pond".into())]);
        watch(0.0);
        airspace.draw(Vec::new());
        assert_eq!(airspace.watch(&Vector3::zeros()), [], "nobody is in what is not there");
    }

    #[test]
    fn the_zone_that_holds_the_end_of_a_way_is_named_before_one_that_it_crosses() {
        let zone =
            |name, x| format!(r#"{{"name":"{name}","kind":"no_fly","centre_m":[{x},0],"radius_m":5}}"#);
        let mut airspace = airspace(0, &[&zone("near", 20), &zone("far", 40)]);
        airspace.look(Duration::ZERO, None);
        let to = |x| airspace.in_the_way(&Vector3::new(0.0, 0.0, 3.0), &Vector3::new(x, 0.0, 3.0), 1.0);
        assert_eq!([to(10.0), to(14.5), to(30.0), to(40.0)], [None, Some("near"), Some("near"), Some("far")]);
    }
}

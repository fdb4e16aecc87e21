//! From MAVLink items to the route of a multirotor.

use std::collections::HashMap;
use std::f64::consts::TAU;

use nalgebra::Vector3;
use skein_agent::{LONGEST_STAY_S, SLOWEST_M_S};
use skein_mav::{Datum, Geodetic};
use skein_planning::airspace::{Airspace, KeepOut};

use super::command::{self, Kind};
use super::item::{Item, Part};
use super::{Allowances, Ends, Mission, MissionError, Payload, Warning, Waypoint};
use crate::element::{Element, Verdict};

/// Distance from the world's datum up to which a plan's home means that place, in metres.
const SAME_PLACE_M: f64 = 10_000.0;
/// A take-off item this near to home takes off from home, in metres.
const AT_HOME_M: f64 = 1.0;
/// A landing this near to the last waypoint is there, in metres.
const SAME_SPOT_M: f64 = 0.1;
/// Longer legs are flown if that is meant, in metres.
pub const LONG_LEG_M: f64 = 1000.0;
/// Neighbours of which one height is above the sea and the other above home differ by no more, unless that is
/// meant, in metres.
const MIXED_HEIGHTS_M: f64 = 30.0;
/// Warnings that are listed: to know the line of each takes a walk through the file.
const MOST_WARNINGS: usize = 100;
/// Refusals after which no more is looked at: to know the line of each takes a walk through the file.
const MOST_REFUSALS: usize = 100;
/// Items and waypoints that jumps and turns may add to those that are written.
const MOST_ADDED: usize = 10_000;
/// Corners of a circle that is flown.
const CORNERS: u32 = 12;
/// Most turns of a loiter.
const MOST_TURNS: f64 = 100.0;
const DAY_S: f64 = LONGEST_STAY_S;
const FASTEST_M_S: f64 = 100.0;
/// A plan's take-off height, for who does something before the first take-off item, in metres.
const FIRST_HEIGHT_M: f64 = 3.0;

/// Where a height counts from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Zero {
    Sea,
    Home,
    Terrain,
}

/// A route under way, and what is known of the file that it is read from.
pub struct Draft {
    pub datum: Datum,
    home: Geodetic,
    /// The plan says how high home is.
    knows_home_height: bool,
    allowances: Allowances,
    mission: Mission,
    speed_m_s: Option<f64>,
    payload: Vec<Payload>,
    most_waypoints: usize,
    /// A landing or a return has been read: nothing flies after it.
    ended: bool,
    /// The last height with where it counts from.
    last: Option<(Zero, f64)>,
    pub airspace: Airspace,
    pub rally: Vec<Vector3<f64>>,
    /// The first place whose height is above the terrain, in words.
    pub above_terrain: Option<String>,
    pub warnings: Vec<Warning>,
    pub elements: Vec<Element>,
    refusals: usize,
    /// The first thing that is wrong.
    pub fault: Option<MissionError>,
}

impl Draft {
    /// A route from a home in degrees whose height may not be given. It is flown where it is drawn if that is
    /// near the `known` datum, or else from the world's origin.
    pub fn new(
        latitude: f64,
        longitude: f64,
        height_m: Option<f64>,
        known: Option<Datum>,
        allowances: Allowances,
    ) -> Self {
        let at_home = Datum::from_degrees(latitude, longitude, height_m.unwrap_or(0.0));
        let home = at_home.place();
        let near = |datum: &Datum| datum.to_enu(&home).xy().norm() <= SAME_PLACE_M;
        let datum = known.filter(near).unwrap_or(at_home);
        let ground = datum.to_enu(&home);
        let mission = Mission { home: ground.xy().push(0.0), ..Mission::default() };
        Self {
            datum,
            home,
            knows_home_height: height_m.is_some(),
            allowances,
            mission,
            speed_m_s: None,
            payload: Vec::new(),
            most_waypoints: 0,
            ended: false,
            last: None,
            airspace: Airspace::default(),
            rally: Vec::new(),
            above_terrain: None,
            warnings: Vec::new(),
            elements: Vec::new(),
            refusals: 0,
            fault: None,
        }
    }

    /// The place of a latitude and a longitude in degrees, on the ground.
    pub fn ground(&self, latitude: f64, longitude: f64) -> Vector3<f64> {
        let place = Datum::from_degrees(latitude, longitude, self.home.height_m).place();
        self.datum.to_enu(&place).xy().push(0.0)
    }

    /// Adds an element to the account; gives its number.
    pub fn element(&mut self, what: String, line: usize, verdict: Verdict, why: &str) -> usize {
        self.elements.push(Element { what, file: None, line, verdict, why: why.to_owned(), count: 1 });
        self.elements.len() - 1
    }

    /// An element is refused; the first fault is the file's.
    pub fn refuse(&mut self, element: usize, error: MissionError) {
        if let Some(element) = self.elements.get_mut(element)
            && element.verdict != Verdict::Refused
        {
            (element.verdict, element.why) = (Verdict::Refused, error.to_string());
        }
        self.refusals += 1;
        self.fault.get_or_insert(error);
    }

    /// So much is wrong that the rest is not looked at.
    pub fn is_hopeless(&self) -> bool {
        self.refusals >= MOST_REFUSALS
    }

    pub fn warn(&mut self, warning: impl FnOnce() -> Warning) {
        match self.warnings.len() {
            ..MOST_WARNINGS => self.warnings.push(warning()),
            MOST_WARNINGS => {
                let Warning { file, line, .. } = warning();
                let message = "from here on, warnings are not listed".to_owned();
                self.warnings.push(Warning { file, line, message });
            }
            _ => {}
        }
    }

    /// Adds a place to land at; it must be where the fence lets vehicles fly.
    pub fn add_rally_point(&mut self, at: Vector3<f64>) -> Result<(), &'static str> {
        let zones = KeepOut::new(self.airspace.clone(), 0.0, 0.0);
        if zones.room_m(&at) < 0.0 {
            return Err("a place where `geoFence` lets vehicles fly");
        }
        self.rally.push(at);
        Ok(())
    }

    /// Home is where the geofence lets vehicles fly.
    pub fn check_home(&mut self, element: usize, error: impl FnOnce(&str) -> MissionError) {
        let zones = KeepOut::new(self.airspace.clone(), 0.0, 0.0);
        if zones.room_m(&self.mission.home) < 0.0 {
            self.refuse(element, error("a home where `geoFence` lets vehicles fly"));
        }
    }

    /// Flies all items, with their jumps.
    pub fn fly(&mut self, items: &[Item<'_>]) {
        self.most_waypoints = items.len() + MOST_ADDED;
        let zones = KeepOut::new(self.airspace.clone(), 0.0, 0.0);
        for index in self.order(items) {
            let Some(item) = items.get(index).filter(|_| !self.is_hopeless()) else { break };
            let before = self.mission.waypoints.len();
            let flown = self.item(item).and_then(|outcome| {
                self.check_zones(item, before, &zones)?;
                Ok(outcome)
            });
            match flown {
                Ok((verdict, why)) => self.settle(item.element, verdict, why),
                Err(error) => self.refuse(item.element, error),
            }
        }
    }

    /// The mission, if the items made one.
    pub fn finish(mut self, none: impl FnOnce() -> MissionError) -> (Self, Mission) {
        if self.mission.waypoints.is_empty() && self.fault.is_none() {
            self.fault = Some(none());
        }
        self.mission.last_payload = std::mem::take(&mut self.payload);
        let mission = std::mem::take(&mut self.mission);
        (self, mission)
    }

    /// The best of what an element's items come to, unless it is refused.
    fn settle(&mut self, element: usize, verdict: Verdict, why: &str) {
        let Some(element) = self.elements.get_mut(element) else { return };
        if verdict > element.verdict {
            element.verdict = verdict;
        }
        if element.why.is_empty() {
            element.why = why.to_owned();
        }
    }

    /// Numbers of the items in the order in which they are flown.
    fn order(&mut self, items: &[Item<'_>]) -> Vec<usize> {
        let numbered: HashMap<u64, usize> =
            items.iter().enumerate().map(|(i, item)| (item.number, i)).collect();
        let mut left: HashMap<usize, u32> = HashMap::new();
        let (mut order, mut next) = (Vec::new(), 0);
        let mut steps = 0;
        while let Some(item) = items.get(next) {
            steps += 1;
            if self.is_hopeless() {
                break;
            }
            if steps > items.len() + MOST_ADDED {
                let expected = format!("at most {MOST_ADDED} items that are flown again");
                self.refuse(item.element, item.origin.error(Part::Whole, expected, "more"));
                break;
            }
            next += 1;
            match jump(item, &numbered) {
                None => order.push(next - 1),
                Some(Err(error)) => self.refuse(item.element, error),
                Some(Ok((target, times))) => {
                    self.settle(item.element, Verdict::Honoured, "");
                    let left = left.entry(next - 1).or_insert(times);
                    if *left > 0 {
                        *left -= 1;
                        next = target;
                    }
                }
            }
        }
        order
    }

    /// Refuses an item that leads where the fence does not; `before` is how many waypoints there were before
    /// it.
    fn check_zones(&self, item: &Item<'_>, before: usize, zones: &KeepOut) -> Result<(), MissionError> {
        let added = self.mission.waypoints.get(before..).unwrap_or_default();
        let Some(Waypoint { position: at, .. }) =
            added.iter().find(|waypoint| zones.room_m(&waypoint.position) < 0.0)
        else {
            return Ok(());
        };
        let is_out = self.airspace.stay_inside.iter().any(|area| area.room_m(at) < 0.0);
        let (expected, found) = match is_out {
            true => ("a place inside the zones that `geoFence` includes", "one outside"),
            false => ("a place outside the zones that `geoFence` excludes", "one inside"),
        };
        let found = format!("{found}, {:.1} m east and {:.1} m north of the origin", at.x, at.y);
        Err(item.origin.error(Part::Whole, expected, found))
    }

    /// Takes an item in; says what becomes of it.
    fn item(&mut self, item: &Item<'_>) -> Result<(Verdict, &'static str), MissionError> {
        let Some((_, kind)) = command::of(item.command) else {
            let expected = "a command that moves a multirotor: 16 waypoint, 17 to 19 loiter, 20 return, 21 land, 22 \
                            take-off; or one of a camera or another payload";
            return Err(item.origin.error(Part::Command, expected, item.command.to_string()));
        };
        if self.ended && !matches!(kind, Kind::Payload | Kind::Harmless(_) | Kind::Speed | Kind::Jump) {
            const WHY: &str = "comes after the landing or return and is not flown";
            self.warn(|| item.origin.warning(Part::Command, WHY));
            return Ok((Verdict::Harmless, WHY));
        }
        match kind {
            Kind::Waypoint => self.stay(item, false)?,
            Kind::Spline => {
                const WHY: &str = "a spline waypoint is flown as a plain one";
                self.warn(|| item.origin.warning(Part::Command, WHY));
                self.stay(item, false)?;
                return Ok((Verdict::Honoured, WHY));
            }
            Kind::LoiterTime => self.stay(item, true)?,
            Kind::LoiterToHeight => self.fly_to(item, 0.0, true)?,
            Kind::LoiterTurns => self.turns(item)?,
            Kind::LoiterUnlimited => {
                const WHY: &str = "an unlimited loiter is flown as a waypoint with a landing";
                self.warn(|| item.origin.warning(Part::Command, WHY));
                self.fly_to(item, 0.0, true)?;
                self.ended = true;
                return Ok((Verdict::Honoured, WHY));
            }
            Kind::Takeoff => self.takeoff(item)?,
            Kind::Land => self.land(item)?,
            Kind::Return => {
                self.mission.ends = Ends::Return;
                self.ended = true;
            }
            Kind::Delay => self.delay(item)?,
            Kind::Speed => return self.change_speed(item),
            Kind::Payload => {
                self.payload.push(Payload { command: item.command, params: item.params });
                return Ok((Verdict::Honoured, "told as an event `payload`"));
            }
            Kind::Harmless(why) => return Ok((Verdict::Harmless, why)),
            Kind::Jump => {}
            Kind::Refused => {
                let expected = "a command that a flight of a multirotor has";
                return Err(item.origin.error(Part::Command, expected, command::in_words(item.command)));
            }
        }
        Ok((Verdict::Honoured, ""))
    }

    /// A place at which the first parameter says how long to stay.
    fn stay(&mut self, item: &Item<'_>, is_loiter: bool) -> Result<(), MissionError> {
        let hold_s = item.number_in(0, 0.0, DAY_S, "seconds")?;
        self.fly_to(item, hold_s, is_loiter)
    }

    fn fly_to(&mut self, item: &Item<'_>, hold_s: f64, is_loiter: bool) -> Result<(), MissionError> {
        let position = self.position(item, is_loiter)?;
        self.push(item, position, hold_s)
    }

    /// The place of an item, at its height; 0, 0 is where the item before it ends, and so is none for a
    /// loiter.
    fn position(&mut self, item: &Item<'_>, is_loiter: bool) -> Result<Vector3<f64>, MissionError> {
        let is_none = item.params[4].is_nan() || item.params[5].is_nan();
        let is_here = item.is_unset(4) && item.is_unset(5);
        if is_none && !(is_here && is_loiter) {
            return Err(item.origin.error(Part::Parameter(4), "a latitude and a longitude", "null"));
        }
        if !is_here {
            let ground = self.place(item)?;
            if item.keeps_height() {
                const WHY: &str = "an altitude of 0 keeps the height of the item before, as with ArduPilot";
                self.warn(|| item.origin.warning(Part::Parameter(6), WHY));
                return Ok(ground.xy().push(self.here().z));
            }
            return Ok(ground.xy().push(self.height(item)?));
        }
        let here = self.here();
        if item.is_unset(6) { Ok(here) } else { Ok(here.xy().push(self.height(item)?)) }
    }

    /// Where the last item has led.
    fn here(&self) -> Vector3<f64> {
        let start = self.mission.home.xy().push(self.mission.takeoff_height_m.unwrap_or(FIRST_HEIGHT_M));
        self.mission.waypoints.last().map_or(start, |last| last.position)
    }

    /// The place of the item's latitude and longitude, on the ground.
    fn place(&self, item: &Item<'_>) -> Result<Vector3<f64>, MissionError> {
        let latitude = item.number_in(4, -90.0, 90.0, "degrees")?;
        let longitude = item.number_in(5, -180.0, 180.0, "degrees")?;
        Ok(self.ground(latitude, longitude))
    }

    /// Height above home, in metres.
    fn height(&mut self, item: &Item<'_>) -> Result<f64, MissionError> {
        let altitude = item.params[6];
        if altitude.is_nan() {
            return Err(item.mismatch(6, "a number"));
        }
        let (zero, height) = match item.frame {
            0 | 5 if !self.knows_home_height => {
                let expected = "a height of `plannedHomePosition`, from which one above the sea could count";
                return Err(item.origin.error(
                    Part::Frame,
                    expected,
                    "an altitude above the sea, and none of home",
                ));
            }
            0 | 5 => (Zero::Sea, altitude - self.home.height_m),
            3 | 6 => (Zero::Home, altitude),
            10 | 11 => (Zero::Terrain, altitude),
            frame => {
                let expected = "0 (above sea level), 3 or 6 (above home) or 10 (above terrain)";
                return Err(item.origin.error(Part::Frame, expected, frame.to_string()));
            }
        };
        if height <= 0.0 {
            return Err(item.mismatch(6, "an altitude above home's ground"));
        }
        if zero == Zero::Terrain && self.above_terrain.is_none() {
            self.above_terrain =
                Some(item.origin.warning(Part::Frame, "counts heights from the terrain").to_string());
        }
        let zero = if item.follows_terrain { Zero::Terrain } else { zero };
        self.compare(item, zero, height)?;
        self.last = Some((zero, height));
        Ok(height)
    }

    /// Neighbours that count from the sea and from home must agree on where home is.
    fn compare(&self, item: &Item<'_>, zero: Zero, height: f64) -> Result<(), MissionError> {
        let Some((before, height_before)) = self.last else { return Ok(()) };
        let is_mixed = matches!((before, zero), (Zero::Sea, Zero::Home) | (Zero::Home, Zero::Sea));
        let apart_m = (height - height_before).abs();
        if !is_mixed || apart_m <= MIXED_HEIGHTS_M || self.allowances.mixed_heights {
            return Ok(());
        }
        let expected = format!(
            "a height that fits the item before, {height_before} m above home, as one counts from the sea and the \
             other from home (--mixed-heights flies it)"
        );
        Err(item.origin.error(Part::Parameter(6), expected, format!("{height} m above home")))
    }

    fn takeoff(&mut self, item: &Item<'_>) -> Result<(), MissionError> {
        let height = self.height(item)?;
        self.mission.takeoff_height_m.get_or_insert(height);
        if self.is_here(item) {
            return Ok(());
        }
        let ground = self.place(item)?;
        if (ground - self.mission.home).xy().norm() > AT_HOME_M || !self.mission.waypoints.is_empty() {
            self.push(item, ground.xy().push(height), 0.0)?;
        }
        Ok(())
    }

    fn land(&mut self, item: &Item<'_>) -> Result<(), MissionError> {
        self.ended = true;
        if self.is_here(item) {
            return Ok(());
        }
        let ground = self.place(item)?;
        let last = self.mission.waypoints.last().map(|w| w.position.z);
        let Some(height) = last.or(self.mission.takeoff_height_m) else {
            return Err(item.origin.error(
                Part::Whole,
                "a take-off or a waypoint before the landing",
                "none",
            ));
        };
        // It lands where it is then.
        if last.is_some() && (self.here() - ground).xy().norm() < SAME_SPOT_M {
            return Ok(());
        }
        self.push(item, ground.xy().push(height), 0.0)
    }

    /// A take-off or landing gives no place, for which null and 0, 0 both stand.
    fn is_here(&self, item: &Item<'_>) -> bool {
        item.params[4].is_nan() || item.params[5].is_nan() || (item.params[4] == 0.0 && item.params[5] == 0.0)
    }

    /// Circles of a radius around a place, as polygons.
    fn turns(&mut self, item: &Item<'_>) -> Result<(), MissionError> {
        let turns = item.number_in(0, 0.0, MOST_TURNS, "turns")?;
        let radius_m = item.number_in(2, -LONG_LEG_M / 2.0, LONG_LEG_M / 2.0, "metres")?;
        let centre = self.position(item, true)?;
        if radius_m == 0.0 || turns == 0.0 {
            return self.push(item, centre, 0.0);
        }
        let from = self.here() - centre;
        let start = from.y.atan2(from.x);
        for corner in 0..=(turns * f64::from(CORNERS)).ceil() as u32 {
            // A positive radius is flown clockwise.
            let angle = start - radius_m.signum() * f64::from(corner) / f64::from(CORNERS) * TAU;
            let offset = Vector3::new(angle.cos(), angle.sin(), 0.0) * radius_m.abs();
            self.push(item, centre + offset, 0.0)?;
        }
        Ok(())
    }

    fn delay(&mut self, item: &Item<'_>) -> Result<(), MissionError> {
        if item.params[0] < 0.0 {
            return Err(item.mismatch(0, "seconds, and no time of day"));
        }
        let delay_s = item.number_in(0, 0.0, DAY_S, "seconds")?;
        match self.mission.waypoints.last_mut() {
            Some(last) => last.hold_s += delay_s,
            None => self.mission.delay_s += delay_s,
        }
        Ok(())
    }

    fn change_speed(&mut self, item: &Item<'_>) -> Result<(Verdict, &'static str), MissionError> {
        // MAVLink: -1 means "as it is", -2 "as the autopilot likes".
        let speed = item.params[1];
        if speed > 0.0 {
            if matches!(item.params[0], 2.0 | 3.0) {
                return Ok((Verdict::Harmless, "a speed of climb or descent is the vehicle's own"));
            }
            if !(SLOWEST_M_S..=FASTEST_M_S).contains(&speed) {
                return Err(item.mismatch(1, format!("a speed from {SLOWEST_M_S} to {FASTEST_M_S} m/s")));
            }
            self.speed_m_s = Some(speed);
            return Ok((Verdict::Honoured, ""));
        }
        Ok((Verdict::Harmless, "the speed stays as it is"))
    }

    fn push(&mut self, item: &Item<'_>, position: Vector3<f64>, hold_s: f64) -> Result<(), MissionError> {
        let here = self.here();
        let leg_m = (position - here).xy().norm();
        let payload = std::mem::take(&mut self.payload);
        if self.mission.waypoints.len() > self.most_waypoints {
            let expected = format!("at most {MOST_ADDED} places of turns and jumps");
            return Err(item.origin.error(Part::Whole, expected, "more"));
        }
        self.mission.waypoints.push(Waypoint {
            position,
            hold_s,
            speed_m_s: self.speed_m_s,
            payload,
            scan: item.scan,
        });
        if leg_m <= LONG_LEG_M || self.allowances.long_legs {
            return Ok(());
        }
        let expected = format!("a place within {LONG_LEG_M} m of the one before (--long-legs flies further)");
        Err(item.origin.error(Part::Parameter(4), expected, format!("one {leg_m:.0} m away")))
    }
}

/// The item that a jump leads to, and how often; `None` for what is no jump.
fn jump(item: &Item<'_>, numbered: &HashMap<u64, usize>) -> Option<Result<(usize, u32), MissionError>> {
    if command::of(item.command).map(|(_, kind)| kind) != Some(Kind::Jump) {
        return None;
    }
    let target = numbered.get(&(item.params[0].max(0.0) as u64)).copied();
    let Some(target) = target else {
        return Some(Err(item.mismatch(0, "the number of an item")));
    };
    if item.params[1] < 0.0 {
        let expected = "how often to jump; a mission that never ends is not flown";
        return Some(Err(item.mismatch(1, expected)));
    }
    Some(item.number_in(1, 0.0, 1000.0, "jumps").map(|times| (target, times as u32)))
}

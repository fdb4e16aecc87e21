//! Obstacles that move: found in a lidar's returns, followed from scan to scan, and predicted with growing uncertainty.
//!
//! Motion is horizontal. The height of a return is that of the lidar's plane, which pitches and climbs with the
//! vehicle: seen from there every trunk goes up and down.

use std::time::Duration;

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::map::ClearanceMap;
use crate::separation::Neighbour;

/// The rules by which returns are grouped and followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingConfig {
    /// Neighbouring returns further apart than this are of two things, metres.
    pub gap_m: f64,
    /// The widest thing that can move, metres.
    pub widest_m: f64,
    /// Of fewer returns than this no place is known.
    pub fewest_returns: usize,
    /// Returns that are further than this from a circle, root mean square, are of nothing round, metres.
    pub roundness_m: f64,
    /// A thing is found again within this distance of where it was expected, metres.
    pub gate_m: f64,
    /// Standard deviation of a place that is seen, metres.
    pub seen_sigma_m: f64,
    /// Standard deviation of the velocity of what is seen for the first time, m/s.
    pub first_sigma_m_s: f64,
    /// Spectral density of the acceleration of what moves, m2/s3: of one that has gone straight on, the velocity is
    /// uncertain by its square root after a second unseen, m/s.
    pub unsteadiness: f64,
    /// What stands where it was first seen has something within this distance of what was seen of it first, metres.
    pub stays_m: f64,
    /// Slower than this a thing stands still, m/s.
    pub slowest_m_s: f64,
    /// A thing moves once it is this far from where it was first seen, metres, and the map has nothing there any more
    /// ...
    pub moved_m: f64,
    /// ... or once it is so far from there that no part of a trunk that comes into view could explain it, metres.
    pub surely_moved_m: f64,
    /// Seen less often than this it may be anything.
    pub fewest_sightings: u32,
    /// Mean distance from where it was expected beyond which it is not one thing, metres.
    pub most_surprise_m: f64,
    /// Things unseen for this long are forgotten, seconds.
    pub forget_s: f64,
    /// What has moved and stands is taken for something that moves for so much longer, seconds ...
    pub rests_s: f64,
    /// ... and for so much longer where it fills a passage: it may be about to leave.
    pub fills_s: f64,
    /// It fills a passage if there is something within this distance on opposite sides of it, metres.
    pub room_m: f64,
}

impl Default for MovingConfig {
    fn default() -> MovingConfig {
        MovingConfig {
            gap_m: 0.4,
            widest_m: 1.5,
            fewest_returns: 6,
            roundness_m: 0.06,
            gate_m: 0.8,
            seen_sigma_m: 0.08,
            first_sigma_m_s: 1.0,
            unsteadiness: 0.5,
            stays_m: 0.3,
            slowest_m_s: 0.3,
            moved_m: 0.7,
            surely_moved_m: 1.2,
            fewest_sightings: 6,
            most_surprise_m: 0.2,
            forget_s: 1.5,
            rests_s: 2.0,
            fills_s: 20.0,
            room_m: 1.9,
        }
    }
}

/// A thing that is followed.
#[derive(Clone, Copy, Debug)]
struct Track {
    id: u32,
    first_seen: Vector3<f64>,
    /// The place on its surface that was seen first.
    first_surface: Vector3<f64>,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    spread: Spread,
    radius_m: f64,
    seen: Duration,
    sightings: u32,
    /// The distance from where it was expected to where it was seen lately, metres.
    surprise_m: f64,
    /// When it moved last, if it ever did.
    moved: Option<Duration>,
    /// Whether it moves, or may be about to.
    is_mover: bool,
}

/// The covariance of place and velocity along an axis, m2, m2/s and m2/s2: the same along both, and between them none.
#[derive(Clone, Copy, Debug)]
struct Spread {
    place: f64,
    both: f64,
    velocity: f64,
}

impl Spread {
    /// Of one that goes straight on, but for an acceleration that is white noise.
    fn later(self, by_s: f64, unsteadiness: f64) -> Spread {
        Spread {
            place: self.place
                + by_s * (2.0 * self.both + by_s * self.velocity)
                + unsteadiness * by_s.powi(3) / 3.0,
            both: self.both + by_s * self.velocity + unsteadiness * by_s * by_s / 2.0,
            velocity: self.velocity + unsteadiness * by_s,
        }
    }

    /// Of one whose place is seen with a variance; and the shares of the surprise that correct place and velocity.
    fn seen(self, variance: f64) -> (Spread, [f64; 2]) {
        let gains = [self.place, self.both].map(|part| part / (self.place + variance));
        let unexplained = 1.0 - gains[0];
        let spread = Spread {
            place: self.place * unexplained,
            both: self.both * unexplained,
            velocity: self.velocity - gains[1] * self.both,
        };
        (spread, gains)
    }
}

impl Track {
    fn new(id: u32, now: Duration, thing: &Thing, config: &MovingConfig) -> Track {
        let [place, velocity] = [config.seen_sigma_m, config.first_sigma_m_s].map(|sigma| sigma * sigma);
        Track {
            id,
            first_seen: thing.centre,
            first_surface: thing.surface,
            position: thing.centre,
            velocity: Vector3::zeros(),
            spread: Spread { place, both: 0.0, velocity },
            radius_m: thing.radius_m,
            seen: now,
            sightings: 1,
            surprise_m: 0.0,
            moved: None,
            is_mover: false,
        }
    }

    fn expected(&self, now: Duration) -> Vector3<f64> {
        self.position + self.velocity * self.unseen_s(now)
    }

    fn spread_at(&self, now: Duration, config: &MovingConfig) -> Spread {
        self.spread.later(self.unseen_s(now), config.unsteadiness)
    }

    fn unseen_s(&self, now: Duration) -> f64 {
        now.saturating_sub(self.seen).as_secs_f64()
    }

    /// The same that is seen again: a Kalman filter of one that goes straight on.
    fn found(self, now: Duration, thing: &Thing, config: &MovingConfig) -> Track {
        let (spread, [place_share, velocity_share]) =
            self.spread_at(now, config).seen(config.seen_sigma_m * config.seen_sigma_m);
        let expected = self.expected(now).xy().push(thing.centre.z);
        let surprise = thing.centre - expected;
        Track {
            position: expected + surprise * place_share,
            velocity: self.velocity + surprise * velocity_share,
            spread,
            radius_m: thing.radius_m.max(0.8 * self.radius_m),
            seen: now,
            sightings: self.sightings + 1,
            surprise_m: 0.7 * self.surprise_m + 0.3 * surprise.norm(),
            ..self
        }
    }

    /// Whether it moves now.
    ///
    /// Whatever moves has left the place where it was first seen: in the `map` what was seen of it there is free,
    /// though a map takes its time to clear. The centre of what stands may seem to move as more of it comes into
    /// view, but not far; its surface does not.
    fn moves(&self, map: &ClearanceMap, config: &MovingConfig) -> bool {
        let way_m = (self.position - self.first_seen).xy().norm();
        let has_left = way_m > config.surely_moved_m
            || (way_m > config.moved_m && map.clearance(&self.first_surface) > config.stays_m);
        self.sightings >= config.fewest_sightings
            && self.surprise_m < config.most_surprise_m
            && self.velocity.norm() > config.slowest_m_s
            && has_left
    }

    /// Whether what stands leaves no room beside it.
    fn fills_a_passage(&self, map: &ClearanceMap, config: &MovingConfig) -> bool {
        // Nearer than this it is seen itself.
        let own_m = self.radius_m + 0.2;
        let around = map.obstacles_around(&self.position, config.room_m);
        let sides: Vec<_> = around
            .points()
            .map(|point| (point - self.position).xy())
            .filter(|offset| offset.norm() > own_m)
            .filter_map(|offset| offset.try_normalize(1e-6))
            .collect();
        // More than 120 degrees apart.
        sides.iter().any(|one| sides.iter().any(|other| one.dot(other) < -0.5))
    }

    /// Takes stock of whether it moves, or may be about to.
    fn judge(&mut self, now: Duration, map: &ClearanceMap, config: &MovingConfig) {
        if self.moves(map, config) {
            self.moved = Some(now);
        }
        self.is_mover = self.moved.is_some_and(|moved| {
            let rests_s = now.saturating_sub(moved).as_secs_f64();
            rests_s < config.rests_s || (rests_s < config.fills_s && self.fills_a_passage(map, config))
        });
    }
}

/// A round thing in the returns of one scan.
#[derive(Clone, Copy, Debug)]
struct Thing {
    centre: Vector3<f64>,
    radius_m: f64,
    /// A place on the side that is seen.
    surface: Vector3<f64>,
}

/// Follows what moves.
#[derive(Clone, Debug)]
pub struct Tracker {
    config: MovingConfig,
    tracks: Vec<Track>,
    /// Ids count down, for those of vehicles count up.
    next_id: u32,
}

impl Tracker {
    /// A tracker that has seen nothing.
    pub fn new(config: MovingConfig) -> Tracker {
        Tracker { config, tracks: Vec::new(), next_id: u32::MAX }
    }

    /// Takes in the returns of a scan (ENU, metres), in the order of its rays, and the map of what stands.
    ///
    /// Costs the number of returns plus that of things seen times that of things followed.
    pub fn look(&mut self, now: Duration, returns: &[Vector3<f64>], map: &ClearanceMap) {
        let config = self.config;
        let mut lost: Vec<Track> = std::mem::take(&mut self.tracks);
        lost.retain(|track| track.unseen_s(now) < config.forget_s);
        for thing in self.things(returns) {
            let surprise = |track: &Track| (thing.centre - track.expected(now)).xy().norm();
            let nearest = (0..lost.len()).min_by(|a, b| surprise(&lost[*a]).total_cmp(&surprise(&lost[*b])));
            let mut track = match nearest.filter(|index| surprise(&lost[*index]) < config.gate_m) {
                Some(index) => lost.swap_remove(index).found(now, &thing, &config),
                None => {
                    self.next_id = self.next_id.wrapping_sub(1);
                    Track::new(self.next_id, now, &thing, &config)
                }
            };
            track.judge(now, map, &config);
            self.tracks.push(track);
        }
        self.tracks.append(&mut lost);
    }

    /// What moves, or has just stopped, where it is expected `now`. Its uncertainty has grown since it was last seen,
    /// and it keeps no distance.
    pub fn moving(&self, now: Duration) -> impl Iterator<Item = Neighbour> + '_ {
        self.tracks.iter().filter(|track| track.is_mover).map(move |track| Neighbour {
            id: track.id,
            position: track.expected(now),
            velocity: track.velocity,
            sigma_m: track.spread_at(now, &self.config).place.sqrt(),
            age_s: 0.0,
            radius_m: track.radius_m,
            cooperative: false,
        })
    }

    /// Every narrow thing in the returns.
    fn things(&self, returns: &[Vector3<f64>]) -> Vec<Thing> {
        let MovingConfig { gap_m, widest_m, fewest_returns, roundness_m, .. } = self.config;
        let mut groups: Vec<Vec<Vector3<f64>>> = Vec::new();
        for point in returns {
            match groups.last_mut() {
                Some(group) if group.last().is_some_and(|last| (point - last).norm() < gap_m) => {
                    group.push(*point);
                }
                _ => groups.push(vec![*point]),
            }
        }
        // The last ray is beside the first.
        if groups.len() > 1
            && let (Some(last), Some(first)) = (groups.last().and_then(|g| g.last()), returns.first())
            && (first - last).norm() < gap_m
            && let Some(mut last) = groups.pop()
            && let Some(first) = groups.first_mut()
        {
            last.append(first);
            *first = last;
        }
        let narrow = |group: &&Vec<Vector3<f64>>| {
            let ends = group.first().zip(group.last());
            group.len() >= fewest_returns && ends.is_some_and(|(a, b)| (a - b).norm() < widest_m)
        };
        let round = |group: &Vec<Vector3<f64>>| {
            let (centre, radius_m) = circle(group)?;
            let surface = *group.get(group.len() / 2)?;
            let off = |point: &Vector3<f64>| (point - centre).xy().norm() - radius_m;
            let squares: f64 = group.iter().map(|point| off(point) * off(point)).sum();
            let is_round = (squares / group.len() as f64).sqrt() < roundness_m;
            (is_round && radius_m < widest_m / 2.0).then_some(Thing { centre, radius_m, surface })
        };
        groups.iter().filter(narrow).filter_map(round).collect()
    }
}

/// The circle through points in a plane, by least squares (Kasa 1976).
///
/// The centre of a round thing is the same from wherever it is seen; that of the part that is seen is not.
fn circle(points: &[Vector3<f64>]) -> Option<(Vector3<f64>, f64)> {
    let middle = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for point in points {
        let offset: Vector2<f64> = (point - middle).xy();
        let row = Vector3::new(offset.x, offset.y, 1.0);
        normal += row * row.transpose();
        right += row * offset.norm_squared();
    }
    let solution = normal.lu().solve(&right)?;
    let centre = Vector3::new(solution.x / 2.0, solution.y / 2.0, 0.0);
    let radius_m = (solution.z + centre.norm_squared()).max(0.0).sqrt();
    radius_m.is_finite().then_some((middle + centre, radius_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::local::vfh::direction;
    use crate::map::VoxelMapConfig;

    /// What 720 rays from `eye` return of a pillar.
    fn seen(eye: &Vector3<f64>, pillar: &Vector3<f64>, radius_m: f64) -> Vec<Vector3<f64>> {
        let offset = pillar - eye;
        let cast = |ray: u32| {
            let u = direction(f64::from(ray) * std::f64::consts::TAU / 720.0);
            let (along, aside) = (u.dot(&offset), u.x * offset.y - u.y * offset.x);
            let inside = radius_m * radius_m - aside * aside;
            (inside > 0.0 && along > 0.0).then(|| eye + u * (along - inside.sqrt()))
        };
        (0..720).filter_map(cast).collect()
    }

    fn free() -> ClearanceMap {
        ClearanceMap::new(VoxelMapConfig::default(), Vector3::new(0.0, 0.0, 5.0), 2.5).unwrap()
    }

    fn at(tick: u64) -> Duration {
        Duration::from_millis(100 * tick)
    }

    #[test]
    fn a_circle_is_found_from_the_part_that_is_seen() {
        let pillar = Vector3::new(3.0, 1.0, 2.0);
        let (centre, radius_m) = circle(&seen(&Vector3::new(0.0, 0.0, 2.0), &pillar, 0.3)).unwrap();
        assert!((centre - pillar).norm() < 1e-6 && (radius_m - 0.3).abs() < 1e-6, "{centre:?} {radius_m}");
    }

    #[test]
    fn what_moves_is_found_with_its_velocity_and_predicted() {
        let mut tracker = Tracker::new(MovingConfig::default());
        let place = |tick: u64| Vector3::new(4.0, -3.0 + 0.12 * tick as f64, 3.0);
        for tick in 0..20 {
            tracker.look(at(tick), &seen(&Vector3::new(0.0, 0.0, 3.0), &place(tick), 0.25), &free());
        }
        let found: Vec<_> = tracker.moving(at(19)).collect();
        let [thing] = found.as_slice() else { panic!("{found:?}") };
        assert!((thing.velocity - Vector3::new(0.0, 1.2, 0.0)).norm() < 0.1, "{thing:?}");
        // Behind a tree for half a second.
        let later = tracker.moving(at(24)).next().unwrap();
        assert!((later.position - place(24)).norm() < 0.15, "{later:?}");
        assert!(later.sigma_m > thing.sigma_m + 0.1);
        assert!(!later.cooperative);
        tracker.look(at(40), &[], &free());
        assert_eq!(tracker.moving(at(40)).count(), 0, "it is gone");
    }

    #[test]
    fn a_trunk_does_not_move_when_the_vehicle_climbs() {
        let mut tracker = Tracker::new(MovingConfig::default());
        for tick in 0..20 {
            let eye = Vector3::new(0.0, 0.0, 2.0 + 0.15 * tick as f64);
            tracker.look(at(tick), &seen(&eye, &Vector3::new(4.0, -1.0, eye.z), 0.25), &free());
        }
        assert_eq!(tracker.moving(at(19)).count(), 0);
    }

    #[test]
    fn what_still_stands_where_it_was_first_seen_has_not_moved() {
        let mut tracker = Tracker::new(MovingConfig::default());
        let place = |tick: u64| Vector3::new(4.1, -1.9 + 0.12 * tick as f64, 3.1);
        let mut map = free();
        seen(&Vector3::new(0.0, 0.0, 3.1), &place(0), 0.25).iter().for_each(|point| map.insert(point));
        for tick in 0..10 {
            tracker.look(at(tick), &seen(&Vector3::new(0.0, 0.0, 3.1), &place(tick), 0.25), &map);
        }
        assert_eq!(tracker.moving(at(9)).count(), 0);
    }

    #[test]
    fn what_stands_does_not_move_because_the_vehicle_does() {
        let mut tracker = Tracker::new(MovingConfig::default());
        for tick in 0..60 {
            let eye = Vector3::new(-4.0 + 0.2 * tick as f64, 1.5, 3.0);
            tracker.look(at(tick), &seen(&eye, &Vector3::new(0.0, 0.0, 3.0), 0.5), &free());
            assert_eq!(tracker.moving(at(tick)).count(), 0, "at {eye:?}");
        }
    }

    #[test]
    fn a_wall_does_not_move() {
        let mut tracker = Tracker::new(MovingConfig::default());
        for tick in 0..30 {
            let wall: Vec<_> = (0..40)
                .map(|k| Vector3::new(3.0, -2.0 + 0.1 * f64::from(k), 3.0 + 0.05 * tick as f64))
                .collect();
            tracker.look(at(tick), &wall, &free());
            assert_eq!(tracker.moving(at(tick)).count(), 0);
        }
    }

    /// For how long a cart that has come from the side is taken for one that moves once it stands, in seconds.
    fn rests_s(map: &ClearanceMap) -> f64 {
        let (mut tracker, eye) = (Tracker::new(MovingConfig::default()), Vector3::new(0.1, 0.1, 3.1));
        let place = |tick: u64| Vector3::new(4.1, -2.9 + 0.1 * tick.min(30) as f64, 3.1);
        let last = (0..300).filter(|tick| {
            tracker.look(at(*tick), &seen(&eye, &place(*tick), 0.4), map);
            tracker.moving(at(*tick)).count() > 0
        });
        last.last().map_or(0.0, |tick| 0.1 * tick as f64 - 3.0)
    }

    #[test]
    fn what_stops_is_soon_taken_for_what_stands_but_not_where_it_fills_a_passage() {
        let MovingConfig { rests_s: soon_s, fills_s, .. } = MovingConfig::default();
        let in_the_open = rests_s(&free());
        assert!((soon_s..soon_s + 1.0).contains(&in_the_open), "{in_the_open} s");
        let mut door = free();
        for step in 0..10 {
            let y = 1.5 + 0.2 * f64::from(step);
            door.insert(&Vector3::new(4.1, y, 3.1));
            door.insert(&Vector3::new(4.1, 0.2 - y, 3.1));
        }
        let in_a_door = rests_s(&door);
        assert!((fills_s..fills_s + 1.0).contains(&in_a_door), "{in_a_door} s");
    }
}

//! The hard safety filter: the last word on a velocity before it is flown.

use nalgebra::{Vector2, Vector3};

use super::Neighbour;
use super::halfspace::{HalfSpace, nearest_2d, nearest_3d};
use crate::local::braking::stopping_speed;

/// Violations smaller than this are rounding, m/s.
const TOLERANCE_M_S: f64 = 1e-9;
/// A place that position errors alone make too near is left within about this time, seconds: nobody flees a number.
const UNSURE_S: f64 = 3.0;
/// A vehicle that needs no time to stop is taken to need this, seconds.
const LEAST_STOP_S: f64 = 0.05;

/// Distances to keep, and how the vehicle moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterConfig {
    /// `D`: distance to keep between the centres of two vehicles, metres.
    pub separation_m: f64,
    /// `r`: distance to keep from the vehicle's centre to obstacles, metres: hull radius and margin.
    pub obstacle_clearance_m: f64,
    /// Obstacle points stand for columns that reach this far above and below them, metres: a planar lidar
    /// sees one layer.
    pub obstacle_half_height_m: f64,
    /// Fastest velocity let through, m/s.
    pub max_speed_m_s: f64,
    /// `a`: deceleration that can be relied on, m/s2.
    pub decel_m_s2: f64,
    /// `t`: time from a state to the vehicle braking because of it, seconds: age of the state, tick, lag of
    /// the autopilot.
    pub latency_s: f64,
    /// `j`: the most by which the acceleration changes, m/s3; none if it changes at once.
    pub jerk_m_s3: Option<f64>,
    /// Hull radius that `separation_m` is meant for, metres; larger neighbours are kept further away by the
    /// difference.
    pub hull_radius_m: f64,
    /// Standard deviations of the relative position by which the distance is widened.
    pub sigmas: f64,
    /// Most by which it is widened so, metres: who knows less of its place holds, and lands.
    pub error_max_m: f64,
    /// Age at which a neighbour's state is no longer fresh, seconds: from then on its ghost grows.
    pub fresh_s: f64,
    /// Speed with which the ghost of a neighbour grows that has fallen silent, m/s.
    pub ghost_growth_m_s: f64,
    /// Most that a ghost grows, metres.
    pub ghost_max_m: f64,
    /// Vertical distances between vehicles count for as much less: downwash makes a vehicle this much taller
    /// than wide.
    pub vertical_stretch: f64,
}

impl Default for FilterConfig {
    fn default() -> Self {
        FilterConfig {
            separation_m: 1.2,
            obstacle_clearance_m: 0.45,
            obstacle_half_height_m: 0.6,
            max_speed_m_s: 3.0,
            decel_m_s2: 2.0,
            latency_s: 0.5,
            jerk_m_s3: None,
            hull_radius_m: 0.25,
            sigmas: 2.0,
            error_max_m: 4.0,
            fresh_s: 0.4,
            ghost_growth_m_s: 0.5,
            ghost_max_m: 3.0,
            vertical_stretch: 1.5,
        }
    }
}

impl FilterConfig {
    /// Two vehicles that know of one another's place and keep their distance both do not limit one another beyond
    /// this, centre to centre, metres: `separation + 2 v (t + v / 2a)` at the greatest speed `v`, and what it takes to
    /// cease to accelerate.
    pub fn reach_m(&self) -> f64 {
        self.separation_m + 2.0 * self.longest_stop_m()
    }

    /// Obstacles do not limit the vehicle beyond this distance from its centre, metres.
    pub fn obstacle_reach_m(&self) -> f64 {
        self.obstacle_clearance_m + self.longest_stop_m()
    }

    /// The way to a stop of a vehicle that flies and accelerates as fast as it may, metres.
    fn longest_stop_m(&self) -> f64 {
        let (fastest, stop) = (self.max_speed_m_s, stop_s(self.max_speed_m_s, self));
        fastest * stop + nearer_m(fastest, self.decel_m_s2, stop, self)
    }
}

/// The vehicle's own motion, and what it wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Position now (ENU, metres).
    pub position: Vector3<f64>,
    /// Velocity now (ENU, m/s).
    pub velocity: Vector3<f64>,
    /// Acceleration now (ENU, m/s2).
    pub acceleration: Vector3<f64>,
    /// Standard deviation of the position, metres.
    pub sigma_m: f64,
    /// Velocity that the planners want (ENU, m/s).
    pub desired: Vector3<f64>,
    /// Whether height is held by the autopilot, so that only the horizontal velocity can be changed.
    pub planar: bool,
}

/// The cause that limits a velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The neighbour with this id.
    Neighbour(u32),
    /// The obstacle point at this place of the list.
    Obstacle(usize),
    /// The speed limit alone.
    Speed,
}

/// The filter's outcome.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Nothing: the velocity is the desired one.
    Clear,
    /// The velocity was changed, to satisfy this limit among others: the one that the desired velocity
    /// violated most.
    Limited(Cause),
    /// No velocity satisfies all limits. The one given violates them least.
    Infeasible {
        /// The limit violated most by standing still.
        by: Cause,
        /// By how much the velocity given violates limits, m/s.
        excess_m_s: f64,
    },
    /// A number in the input was not finite. The velocity is zero.
    Unsound,
}

/// A velocity that may be flown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filtered {
    /// The velocity (ENU, m/s). In planar flight its z is that of the desired velocity, untouched.
    pub velocity: Vector3<f64>,
    pub outcome: Outcome,
}

/// A limit `normal . v <= bound` and where it comes from.
#[derive(Clone, Copy, Debug)]
struct Limit {
    space: HalfSpace<3>,
    cause: Cause,
}

/// The velocity nearest to the desired one with which this vehicle can still stop in time.
///
/// A vehicle that is told to brake flies on for the latency `t` and then stops along its own velocity `v` with
/// the deceleration `a`. On the way it comes nearer to what lies in the unit direction `n` by its *stop*, `S = n . v (t
/// + |v| / 2a)`, at most. Since it is no faster than `s = min(v_max, |v| + a t)` when it brakes, its stop stays
/// within the reach `h` if `n . v <= h / (t + s / 2a)`: a half-space. Nor is it told to fly faster than it could stop
/// straight on, `n . v <= sqrt((a t)^2 + 2 a h) - a t`. With `g` for the gap:
///
/// | what, at distance `d` | gap | reach `h` for `g >= 0` |
/// |---|---|---|
/// | obstacle | `g = d - r` | `g` |
/// | neighbour that keeps its distance too | `g = d - D` | `min(g / 2, g - S_j) + w^2 / 4a`: half the gap for each, less if the neighbour has come to need more; `w` is the speed with which it leads away, less `a t` |
/// | neighbour that does not | `g = d - D` | `g`, and `n . v_j` added to the bound if it comes nearer |
///
/// For `g < 0` the bound is `g / t` (half that when shared): the vehicle must leave, at leisure (`g / 3 s`) as far as
/// it is too near only by the errors of both positions. `D` is widened by what is not
/// known of the neighbour, see [`distance_kept_m`]. Distances between vehicles are stretched vertically.
///
/// A vehicle that accelerates towards it at `n . w` and changes that by no more than the jerk `j` goes on doing so for
/// `T = n . w / j`: what it comes nearer by then, and needs longer to stop, is taken from a gap that is left, `n . v T
/// + n . w T (T / 3 + (t + |v| / 2a) / 2)`.
///
/// **Guarantee.** As long as `S_i + S_j <= g` for each two vehicles, all of them can brake at once and none comes
/// nearer to another than `D`: `d` shrinks by no more than both stops, and `a` is needed in one direction only, so all
/// limits are kept by the same braking. The reaches of two add up to the gap at most, so vehicles that follow the
/// filter stay in such states; one that cannot take on what satisfies its limits within `t` brakes along its own
/// velocity, by which every stop grows shorter by the way that it flies. Zero velocity satisfies every bound with `g
/// >= 0` against what stands or cooperates: there is a feasible velocity as long as distances have been kept. What is
/// flown beyond `t` of lag, below `a` of braking and outside the position errors is not covered.
///
/// Something that comes nearer and does not keep its distance may leave no velocity that can be had in time, nor be
/// kept by braking: then the vehicle gives way as fast as it can.
///
/// When no velocity is feasible, limits are relaxed in this order, each by as little as possible and equally:
/// those of neighbours (obstacles do not give way), then all. The caller should climb or land by rank. If the
/// input is not finite, the velocity is zero.
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::separation::{FilterConfig, Motion, Outcome, filter};
///
/// let motion = Motion {
///     position: Vector3::new(0.0, 0.0, 3.0),
///     velocity: Vector3::zeros(),
///     acceleration: Vector3::zeros(),
///     sigma_m: 0.0,
///     desired: Vector3::new(2.0, 0.0, 0.0),
///     planar: true,
/// };
/// let wall = [Vector3::new(0.95, 0.0, 3.0)];
/// let filtered = filter(&motion, &[], &wall, &FilterConfig::default());
/// assert!(matches!(filtered.outcome, Outcome::Limited(_)));
/// assert!(filtered.velocity.x < 0.8);
/// ```
pub fn filter(
    motion: &Motion,
    neighbours: &[Neighbour],
    obstacles: &[Vector3<f64>],
    config: &FilterConfig,
) -> Filtered {
    let numbers = motion.position.iter().chain(motion.velocity.iter()).chain(motion.desired.iter());
    let sound = numbers.chain([&motion.sigma_m]).copied().all(f64::is_finite);
    if !sound || !neighbours.iter().all(Neighbour::is_sound) {
        return Filtered { velocity: Vector3::zeros(), outcome: Outcome::Unsound };
    }
    let stop = motion.stop_s(config);
    let mut limits: Vec<Limit> = Vec::with_capacity(neighbours.len() + 16);
    limits.extend(neighbours.iter().map(|neighbour| neighbour_limit(motion, neighbour, stop, config)));
    limits.extend(
        obstacles
            .iter()
            .enumerate()
            .filter_map(|(at, point)| obstacle_limit(motion, at, point, stop, config)),
    );
    if motion.planar { solve_planar(motion, &limits, config) } else { solve(motion, &limits, config) }
}

impl Motion {
    /// Seconds of its present approach that a vehicle needs to stop: `t + s / 2a`.
    fn stop_s(&self, config: &FilterConfig) -> f64 {
        let fastest = (self.velocity.norm() + config.decel_m_s2 * config.latency_s).min(config.max_speed_m_s);
        stop_s(fastest, config)
    }

    /// The gap in a unit direction that is left once the vehicle has ceased to accelerate there, metres; see
    /// [`filter`]. `stop` is [`Motion::stop_s`].
    fn left_m(&self, gap_m: f64, normal: &Vector3<f64>, stop: f64, config: &FilterConfig) -> f64 {
        let (speed, accel) = (normal.dot(&self.velocity), normal.dot(&self.acceleration));
        let nearer_m = nearer_m(speed, accel.max(0.0), stop, config).max(0.0);
        if gap_m > 0.0 { (gap_m - nearer_m).max(0.0) } else { gap_m }
    }
}

/// The way that a vehicle that accelerates needs to stop beyond that of one that does not, metres; see [`filter`].
fn nearer_m(speed_m_s: f64, accel_m_s2: f64, stop: f64, config: &FilterConfig) -> f64 {
    let lasts_s = config.jerk_m_s3.map_or(0.0, |jerk| accel_m_s2 / jerk);
    lasts_s * (speed_m_s + accel_m_s2 * (lasts_s / 3.0 + stop / 2.0))
}

/// The way of a vehicle of this speed until it stands, for each m/s of its velocity in a direction: `t + |v| / 2a`,
/// seconds.
fn stop_s(speed_m_s: f64, config: &FilterConfig) -> f64 {
    config.latency_s + speed_m_s / (2.0 * config.decel_m_s2)
}

/// Fastest approach that can be stopped within `reach_m`; negative if that is.
fn approach(reach_m: f64, stop_s: f64, config: &FilterConfig) -> f64 {
    if reach_m < 0.0 {
        return reach_m / config.latency_s.max(LEAST_STOP_S);
    }
    (reach_m / stop_s.max(LEAST_STOP_S)).min(stopping_speed(reach_m, config.decel_m_s2, config.latency_s))
}

/// The bound of a vehicle that is too near by a gap below zero, of which so much is for position errors alone:
/// negative.
fn leave(gap_m: f64, error_m: f64, config: &FilterConfig) -> f64 {
    let surely_m = (gap_m + error_m).min(0.0);
    surely_m / config.latency_s.max(LEAST_STOP_S) + (gap_m - surely_m) / UNSURE_S
}

/// A bound for a vehicle that lags behind its commands: while it is faster than the bound, it is told to be
/// as much slower, but not to turn back.
fn led(bound: f64, speed: f64) -> f64 {
    if bound > 0.0 && speed > bound { (2.0 * bound - speed).max(0.0) } else { bound }
}

/// The distance that a vehicle whose position has the standard deviation `sigma_m` keeps from a neighbour, centre to
/// centre, metres:
///
/// `D = separation + min(e_max, k sqrt(sigma_i^2 + sigma_j^2)) + a_j u^2 / 2 + min(g_max, c (age - fresh)) + larger`
///
/// `k` standard deviations for the errors of both positions; what the neighbour may have done since it was heard that
/// straight on does not foretell, with an acceleration of `a_j` for `u = min(age, fresh)`; the growth `c` of the
/// ghost of one that is silent; and what the neighbour's hull is larger.
pub fn distance_kept_m(sigma_m: f64, neighbour: &Neighbour, config: &FilterConfig) -> f64 {
    let unheard_s = neighbour.age_s.clamp(0.0, config.fresh_s);
    let swerve = 0.5 * config.decel_m_s2 * unheard_s * unheard_s;
    let ghost = (config.ghost_growth_m_s * silent_s(neighbour, config)).min(config.ghost_max_m);
    let larger = (neighbour.radius_m - config.hull_radius_m).max(0.0);
    config.separation_m + error_m(sigma_m, neighbour, config) + swerve + ghost + larger
}

/// The distance kept for the errors of both positions, metres.
fn error_m(sigma_m: f64, neighbour: &Neighbour, config: &FilterConfig) -> f64 {
    (config.sigmas * sigma_m.hypot(neighbour.sigma_m)).min(config.error_max_m)
}

/// For how long a neighbour's state has no longer been fresh, seconds.
fn silent_s(neighbour: &Neighbour, config: &FilterConfig) -> f64 {
    (neighbour.age_s - config.fresh_s).max(0.0)
}

fn neighbour_limit(motion: &Motion, neighbour: &Neighbour, stop: f64, config: &FilterConfig) -> Limit {
    let offset = neighbour.predicted() - motion.position;
    let stretch = config.vertical_stretch.max(1.0);
    let squashed = Vector3::new(offset.x, offset.y, offset.z / stretch);
    let distance = squashed.norm();
    // Two at one place have no direction between them; any will do, and noise parts them.
    let towards = squashed.try_normalize(1e-6).unwrap_or_else(Vector3::x);
    // Gradient of the stretched distance.
    let gradient = Vector3::new(towards.x, towards.y, towards.z / stretch);
    let steepness = gradient.norm();
    let normal = gradient / steepness;
    let gap = distance - distance_kept_m(motion.sigma_m, neighbour, config);
    let gap = motion.left_m(gap, &normal, stop, config);

    let leads_away = gradient.dot(&neighbour.velocity);
    let error = error_m(motion.sigma_m, neighbour, config);
    let bound = if gap < 0.0 {
        let share = if neighbour.cooperative { 0.5 } else { 1.0 };
        let theirs = if neighbour.cooperative { 0.0 } else { leads_away.min(0.0) };
        theirs + share * leave(gap, error, config)
    } else if neighbour.cooperative {
        approach(shared_reach(gap, leads_away, neighbour.velocity.norm(), config), stop, config)
    } else {
        leads_away.min(0.0) + approach(gap, stop, config)
    };
    Limit { space: HalfSpace { normal, bound: bound / steepness }, cause: Cause::Neighbour(neighbour.id) }
}

/// This vehicle's reach towards a neighbour that keeps its distance too, flies at `speed_m_s`, and leads away at
/// `leads_away_m_s`, negative if it comes nearer; metres.
fn shared_reach(gap_m: f64, leads_away_m_s: f64, speed_m_s: f64, config: &FilterConfig) -> f64 {
    let half = 0.5 * gap_m;
    if leads_away_m_s > 0.0 {
        // What is left of it if the neighbour brakes from now on, when this vehicle begins to.
        let left_m_s = (leads_away_m_s - config.decel_m_s2 * config.latency_s).max(0.0);
        return half + left_m_s * left_m_s / (4.0 * config.decel_m_s2);
    }
    let its_stop = -leads_away_m_s * stop_s(speed_m_s, config);
    half.min(gap_m - its_stop).max(0.0)
}

/// `None` for points that are too far away to matter, or not finite.
fn obstacle_limit(
    motion: &Motion,
    at: usize,
    point: &Vector3<f64>,
    stop: f64,
    config: &FilterConfig,
) -> Option<Limit> {
    let mut offset = point - motion.position;
    let above = offset.z.abs() - config.obstacle_half_height_m;
    offset.z = if above > 0.0 { above.copysign(offset.z) } else { 0.0 };
    let reach = config.obstacle_reach_m();
    let squared = offset.norm_squared();
    if squared.is_nan() || squared > reach * reach {
        return None;
    }
    let distance = squared.sqrt();
    let normal = offset.try_normalize(1e-6)?;
    let gap = motion.left_m(distance - config.obstacle_clearance_m, &normal, stop, config);
    let bound = approach(gap, stop, config);
    Some(Limit { space: HalfSpace { normal, bound }, cause: Cause::Obstacle(at) })
}

/// Height cannot be changed: what the vertical velocity does to a limit is given, and the rest is horizontal.
fn solve_planar(motion: &Motion, limits: &[Limit], config: &FilterConfig) -> Filtered {
    let mut flat = Vec::with_capacity(limits.len());
    for Limit { space, cause } in limits {
        let level = Vector2::new(space.normal.x, space.normal.y);
        let share = level.norm();
        // Something straight above or below is not avoided by moving sideways; the share keeps the bound
        // finite.
        if share > 0.05 {
            let bound = (space.bound - space.normal.z * motion.velocity.z) / share;
            if bound < config.max_speed_m_s {
                let bound = bound.max(-config.max_speed_m_s);
                flat.push((HalfSpace { normal: level / share, bound }, *cause));
            }
        }
    }
    let wanted = Vector2::new(motion.desired.x, motion.desired.y);
    let now = Vector2::new(motion.velocity.x, motion.velocity.y);
    let (velocity, outcome) = choose(now, wanted, &flat, config, nearest_2d);
    Filtered { velocity: Vector3::new(velocity.x, velocity.y, motion.desired.z), outcome }
}

fn solve(motion: &Motion, limits: &[Limit], config: &FilterConfig) -> Filtered {
    let limits: Vec<_> = limits
        .iter()
        .filter(|limit| limit.space.bound < config.max_speed_m_s)
        .map(|limit| {
            let bound = limit.space.bound.max(-config.max_speed_m_s);
            (HalfSpace { bound, ..limit.space }, limit.cause)
        })
        .collect();
    let (velocity, outcome) = choose(motion.velocity, motion.desired, &limits, config, nearest_3d);
    Filtered { velocity, outcome }
}

type Vector<const D: usize> = nalgebra::SVector<f64, D>;

/// The velocity to fly for one that is flying at `now`: what satisfies the limits, and braking where that cannot be
/// had in time.
fn choose<const D: usize>(
    now: Vector<D>,
    wanted: Vector<D>,
    limits: &[(HalfSpace<D>, Cause)],
    config: &FilterConfig,
    nearest: impl Fn(Vector<D>, f64, &[HalfSpace<D>]) -> Option<Vector<D>>,
) -> (Vector<D>, Outcome) {
    let change_m_s = config.decel_m_s2 * config.latency_s;
    let ahead: Vec<_> = limits
        .iter()
        .map(|(space, cause)| {
            (HalfSpace { bound: led(space.bound, space.normal.dot(&now)), ..*space }, *cause)
        })
        .collect();
    let (velocity, outcome) = relax(wanted, &ahead, config, nearest);
    let reached = now + shortened(velocity - now, change_m_s);
    let braked = now - shortened(now, change_m_s);
    let excess = |velocity: &Vector<D>| worst(limits, velocity).map_or(0.0, |(excess, _)| excess);
    let into_obstacles = |velocity: &Vector<D>| {
        let obstacles = limits.iter().filter(|(_, cause)| !matches!(cause, Cause::Neighbour(_)));
        obstacles.map(|(space, _)| space.excess(velocity)).fold(0.0, f64::max)
    };
    // Whoever must give way to something that comes nearer does not do so by standing still; but it does so into
    // nothing that stands.
    let serves = |by: f64| {
        excess(&Vector::zeros()) <= TOLERANCE_M_S
            || excess(&braked) < by
            || into_obstacles(&braked) + TOLERANCE_M_S < into_obstacles(&reached)
    };
    match worst(limits, &reached) {
        Some((by, cause)) if by > TOLERANCE_M_S && matches!(outcome, Outcome::Limited(_)) && serves(by) => {
            (braked, Outcome::Limited(cause))
        }
        _ => (velocity, outcome),
    }
}

fn shortened<const D: usize>(vector: Vector<D>, length: f64) -> Vector<D> {
    let norm = vector.norm();
    if norm > length { vector * (length / norm) } else { vector }
}

/// Solves, and if there is no solution relaxes the neighbours' limits, then all.
fn relax<const D: usize>(
    wanted: Vector<D>,
    limits: &[(HalfSpace<D>, Cause)],
    config: &FilterConfig,
    nearest: impl Fn(Vector<D>, f64, &[HalfSpace<D>]) -> Option<Vector<D>>,
) -> (Vector<D>, Outcome) {
    let radius = config.max_speed_m_s;
    let relaxed = |neighbours_by: f64, obstacles_by: f64| {
        let spaces: Vec<_> = limits
            .iter()
            .map(|(space, cause)| {
                let by = if matches!(cause, Cause::Neighbour(_)) { neighbours_by } else { obstacles_by };
                HalfSpace { bound: space.bound + by, ..*space }
            })
            .collect();
        nearest(wanted, radius, &spaces)
    };
    if let Some(velocity) = relaxed(0.0, 0.0) {
        let outcome = match worst(limits, &wanted) {
            Some((excess, cause)) if excess > TOLERANCE_M_S => Outcome::Limited(cause),
            _ if wanted.norm() > radius => Outcome::Limited(Cause::Speed),
            _ => Outcome::Clear,
        };
        return (velocity, outcome);
    }
    let Some((most, by)) = worst(limits, &Vector::zeros()) else { return (Vector::zeros(), Outcome::Clear) };
    // Standing still violates no limit by more than `most`, so relaxing by a little more must succeed.
    let most = most.max(0.0) + 1e-6;
    let least = |most: f64, solve: &dyn Fn(f64) -> Option<Vector<D>>| -> Option<(Vector<D>, f64)> {
        let mut found = (solve(most)?, most);
        let mut infeasible = 0.0;
        for _ in 0..24 {
            let middle = 0.5 * (infeasible + found.1);
            match solve(middle) {
                Some(velocity) => found = (velocity, middle),
                None => infeasible = middle,
            }
        }
        Some(found)
    };
    let neighbours_give = |by: f64| relaxed(by, 0.0);
    // Where standing still is too near to an obstacle, it is left, though into neighbours: relaxed by this they count
    // for nothing.
    let found = least(most, &neighbours_give)
        .or_else(|| least(most + 2.0 * radius, &neighbours_give))
        .or_else(|| least(most, &|by| relaxed(by, by)));
    let (velocity, excess_m_s) = found.unwrap_or((Vector::zeros(), most));
    (velocity, Outcome::Infeasible { by, excess_m_s })
}

/// The limit that `v` violates most, and by how much.
fn worst<const D: usize>(limits: &[(HalfSpace<D>, Cause)], v: &Vector<D>) -> Option<(f64, Cause)> {
    limits.iter().map(|(space, cause)| (space.excess(v), *cause)).max_by(|a, b| a.0.total_cmp(&b.0))
}

//! The vector field histogram as a local planner: which bearing to fly, from a lidar's returns (Xu 2023; the cost is
//! that of VFH+, Ulrich and Borenstein 1998).

mod follower;

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use nalgebra::Vector3;

pub use follower::{Follower, Step};

/// A detour for comfort turns from the target by no more than this, radians.
const DETOUR: f64 = FRAC_PI_4;
/// A bearing this near to the one chosen last is the same choice, and may turn from the target by so much more,
/// radians.
const SAME_CHOICE: f64 = 0.2;
/// One that stands nearer to something than its safety radius may leave by what is so much nearer still, metres: not
/// every way out leads straight away.
const WAY_OUT_M: f64 = 0.1;

/// The settings by which the histogram is made and read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VfhConfig {
    /// Sectors of a turn, 4 or more.
    pub sectors: usize,
    /// `dmin`: returns nearer than this are the vehicle's own frame, metres.
    pub near_m: f64,
    /// `dmax`: returns further than this count for nothing, metres.
    pub far_m: f64,
    /// A sector whose density is less than this is free, metres.
    pub low_m: f64,
    /// One whose density is more than this is blocked, metres; what lies between is uncertain.
    pub high_m: f64,
    /// Distance that the vehicle's centre keeps from what bounds an opening, metres.
    pub safety_radius_m: f64,
    /// Distance that it keeps where an opening is wide enough, and leads about where the target is, metres.
    pub comfort_radius_m: f64,
    /// Cost of a radian between the bearing and the target's; more than the other two together, or it turns in circles.
    pub target_weight: f64,
    /// Cost of a radian between the bearing and the one that is flown.
    pub heading_weight: f64,
    /// Cost of a radian between the bearing and the one that was chosen last.
    pub previous_weight: f64,
}

impl VfhConfig {
    /// The published histogram: 12 sectors of 30 degrees.
    pub fn published() -> VfhConfig {
        VfhConfig { sectors: 12, low_m: 0.3, high_m: 0.8, ..VfhConfig::default() }
    }
}

impl Default for VfhConfig {
    /// Sectors of 5 degrees: between trunks two metres apart, 30 degrees are all blocked.
    fn default() -> VfhConfig {
        VfhConfig {
            sectors: 72,
            near_m: 0.15,
            far_m: 5.0,
            low_m: 0.5,
            high_m: 1.5,
            safety_radius_m: 0.6,
            comfort_radius_m: 0.9,
            target_weight: 5.0,
            heading_weight: 2.0,
            previous_weight: 2.0,
        }
    }
}

/// The state of a sector, by its density alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SectorState {
    /// 0 in the paper.
    Free,
    /// 2 in the paper.
    Blocked,
    /// 4 in the paper, which flies around it as if it were blocked.
    Uncertain,
}

/// The density of each sector of a turn. Sectors are counted counter-clockwise from east.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    densities_m: Vec<f64>,
    nearest_m: Vec<f64>,
}

impl Histogram {
    /// The histogram around `origin` of the returns at `points` (ENU, metres) of a lidar that casts `rays` in a turn.
    ///
    /// Each return at a horizontal distance `d` in `[dmin, dmax]` adds `dmax - d` to its sector (Xu 2023). The sum is
    /// divided by the sector's rays, so that thresholds depend neither on their number nor on that of the sectors.
    ///
    /// Of a lidar that pitches with its vehicle the returns of the ground are to be left out before.
    pub fn of(origin: &Vector3<f64>, points: &[Vector3<f64>], rays: usize, config: &VfhConfig) -> Histogram {
        let sectors = config.sectors.max(4);
        let share = sectors as f64 / rays.max(sectors) as f64;
        let mut histogram =
            Histogram { densities_m: vec![0.0; sectors], nearest_m: vec![f64::INFINITY; sectors] };
        for point in points {
            let offset = point - origin;
            let distance_m = offset.xy().norm();
            if !(config.near_m..=config.far_m).contains(&distance_m) {
                continue;
            }
            let sector = sector_of(bearing(&offset), sectors);
            histogram.densities_m[sector] += (config.far_m - distance_m) * share;
            histogram.nearest_m[sector] = histogram.nearest_m[sector].min(distance_m);
        }
        histogram
    }

    /// Distance to the nearest return, metres; infinite without one.
    pub fn nearest_m(&self) -> f64 {
        self.nearest_m.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The density of each sector, metres: 0 is empty, and `dmax` is full of what is at hand.
    pub fn densities_m(&self) -> &[f64] {
        &self.densities_m
    }

    /// Each sector by its density: `H < low` free, `low <= H <= high` uncertain, `H > high` blocked.
    pub fn states(&self, config: &VfhConfig) -> Vec<SectorState> {
        let state = |density_m: &f64| match *density_m {
            density_m if density_m < config.low_m => SectorState::Free,
            density_m if density_m > config.high_m => SectorState::Blocked,
            _ => SectorState::Uncertain,
        };
        self.densities_m.iter().map(state).collect()
    }
}

/// Decides the uncertain sectors: one stays what it was, unless both its neighbours are surely otherwise.
///
/// `was_blocked` has each sector's last decision. Without one an uncertain sector counts as blocked, as in the paper.
pub fn decide(states: &[SectorState], was_blocked: Option<&[bool]>) -> Vec<bool> {
    let count = states.len();
    let decided = |(k, state): (usize, &SectorState)| match state {
        SectorState::Free => false,
        SectorState::Blocked => true,
        SectorState::Uncertain => {
            let neighbours = [states[(k + count - 1) % count], states[(k + 1) % count]];
            let was = was_blocked.and_then(|was| was.get(k)).copied().unwrap_or(true);
            let otherwise = if was { SectorState::Free } else { SectorState::Blocked };
            was != neighbours.iter().all(|state| *state == otherwise)
        }
    };
    states.iter().enumerate().map(decided).collect()
}

/// Bearings that lead through between obstacles, with a distance to spare on both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opening {
    /// The rightmost bearing, radians counter-clockwise from east.
    pub from: f64,
    /// Its width from there, counter-clockwise, radians; a turn where nothing is blocked.
    pub width: f64,
}

impl Opening {
    /// The bearings to choose from: its edges, and the target's if it lies inside.
    fn candidates(&self, target: f64) -> impl Iterator<Item = f64> + use<> {
        let is_inside = (target - self.from).rem_euclid(TAU) <= self.width;
        [self.from, self.from + self.width].into_iter().chain(is_inside.then_some(target))
    }
}

/// Every opening: runs of free sectors that are wide enough to keep `radius_m`, at the distance of the nearest return
/// in the blocked sectors that bound them.
pub fn openings(histogram: &Histogram, blocked: &[bool], radius_m: f64) -> Vec<Opening> {
    let count = blocked.len();
    let Some(first) = blocked.iter().position(|blocked| *blocked) else {
        return vec![Opening { from: -PI, width: TAU }];
    };
    let step = TAU / count as f64;
    // What a boundary takes of the opening: the angle under which the radius is seen at its distance.
    let margin = |sector: usize| {
        let nearest_m = histogram.nearest_m[sector % count];
        (radius_m / nearest_m).min(1.0).asin()
    };
    let mut found = Vec::new();
    let mut right = first;
    // Around once, from blocked sector to blocked sector.
    for left in (first + 1)..=(first + count) {
        if !blocked[left % count] {
            continue;
        }
        let free = left - right - 1;
        let margins = [margin(right), margin(left)];
        let width = free as f64 * step - margins[0] - margins[1];
        if free > 0 && width >= 0.0 {
            found.push(Opening { from: (right + 1) as f64 * step + margins[0], width });
        }
        right = left;
    }
    found
}

/// The planner: what it has decided before keeps it from wavering.
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::local::vfh::{Vfh, VfhConfig};
///
/// let mut vfh = Vfh::new(VfhConfig::default());
/// // A wall two metres to the east, two metres wide.
/// let wall: Vec<_> = (-10..=10).map(|k| Vector3::new(2.0, 0.1 * f64::from(k), 3.0)).collect();
/// vfh.look(&Vector3::new(0.0, 0.0, 3.0), &wall, 72);
/// let bearing = vfh.steer(0.1, None).unwrap();
/// assert!(bearing > 0.5 && bearing < 1.3, "around its left end: {bearing}");
/// ```
#[derive(Clone, Debug)]
pub struct Vfh {
    config: VfhConfig,
    blocked: Option<Vec<bool>>,
    /// Those that leave the comfort radius, then those that leave `kept_m`.
    openings: [Vec<Opening>; 2],
    kept_m: f64,
    chosen: Option<f64>,
}

impl Vfh {
    /// A planner that has seen nothing, and takes all to be free.
    pub fn new(config: VfhConfig) -> Vfh {
        let all = vec![Opening { from: -PI, width: TAU }];
        Vfh {
            config,
            blocked: None,
            openings: [all.clone(), all],
            kept_m: config.safety_radius_m,
            chosen: None,
        }
    }

    /// Takes in the returns of a scan, as [`Histogram::of`] does.
    pub fn look(&mut self, origin: &Vector3<f64>, points: &[Vector3<f64>], rays: usize) {
        let histogram = Histogram::of(origin, points, rays, &self.config);
        let blocked = decide(&histogram.states(&self.config), self.blocked.as_deref());
        self.kept_m = self.config.safety_radius_m.min(histogram.nearest_m() - WAY_OUT_M).max(0.0);
        self.openings = [self.config.comfort_radius_m, self.kept_m]
            .map(|radius_m| openings(&histogram, &blocked, radius_m));
        self.blocked = Some(blocked);
    }

    /// The bearing to fly towards a target at the bearing `target`, while `heading` is flown (none at rest); all in
    /// radians counter-clockwise from east. `None` where no opening is left.
    ///
    /// The edges of each opening are candidates, and the target if it lies in one; openings that leave the comfort
    /// radius come first, as long as they lead within about an eighth of a turn of the target. The least
    /// `mu1 |c - target| + mu2 |c - heading| + mu3 |c - previous|` wins (Ulrich and Borenstein 1998).
    pub fn steer(&mut self, target: f64, heading: Option<f64>) -> Option<f64> {
        let VfhConfig { target_weight, heading_weight, previous_weight, .. } = self.config;
        let previous = self.chosen;
        let apart = |from: Option<f64>, to: f64| from.map_or(0.0, |from| wrapped(from - to).abs());
        let cost = |bearing: f64| {
            target_weight * apart(Some(target), bearing)
                + heading_weight * apart(heading, bearing)
                + previous_weight * apart(previous, bearing)
        };
        let best = |openings: &[Opening], within: f64| {
            let all = openings.iter().flat_map(|opening| opening.candidates(target)).map(wrapped);
            let slack = |candidate: f64| {
                let is_kept =
                    previous.is_some_and(|previous| wrapped(candidate - previous).abs() < SAME_CHOICE);
                if is_kept { SAME_CHOICE } else { 0.0 }
            };
            let near =
                all.filter(|candidate| wrapped(candidate - target).abs() <= within + slack(*candidate));
            near.min_by(|a, b| cost(*a).total_cmp(&cost(*b)))
        };
        let [comfortable, safe] = &self.openings;
        self.chosen = best(comfortable, DETOUR).or_else(|| best(safe, PI));
        self.chosen
    }

    /// Distance that every opening of the newest scan leaves, metres: the safety radius, or less where the vehicle is
    /// nearer than that to something.
    pub fn kept_m(&self) -> f64 {
        self.kept_m
    }

    /// Forgets what it has chosen: somebody else moves the vehicle.
    pub fn rest(&mut self) {
        self.chosen = None;
    }
}

/// The horizontal bearing of a direction, radians counter-clockwise from east, in `[-pi, pi]`.
pub fn bearing(direction: &Vector3<f64>) -> f64 {
    direction.y.atan2(direction.x)
}

/// The horizontal unit vector of a bearing.
pub fn direction(bearing: f64) -> Vector3<f64> {
    let (sin, cos) = bearing.sin_cos();
    Vector3::new(cos, sin, 0.0)
}

fn sector_of(bearing: f64, sectors: usize) -> usize {
    let turn = bearing.rem_euclid(TAU) / TAU;
    ((turn * sectors as f64) as usize).min(sectors - 1)
}

/// The same angle in `[-pi, pi)`.
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What 720 rays return of upright trunks `(x, y, radius)` around the origin.
    fn scan(trunks: &[(f64, f64, f64)]) -> Vec<Vector3<f64>> {
        let cast = |ray: u32| {
            let u = direction(f64::from(ray) * TAU / 720.0);
            let hit = |&(x, y, r): &(f64, f64, f64)| {
                let (along, aside) = (u.x * x + u.y * y, u.x * y - u.y * x);
                let inside = r * r - aside * aside;
                (inside >= 0.0 && along > 0.0).then(|| along - inside.sqrt())
            };
            trunks.iter().filter_map(hit).min_by(f64::total_cmp).map(|range| u * range)
        };
        (0..720).filter_map(cast).collect()
    }

    fn steered(trunks: &[(f64, f64, f64)], target: f64, config: VfhConfig) -> Option<f64> {
        let mut vfh = Vfh::new(config);
        vfh.look(&Vector3::zeros(), &scan(trunks), 720);
        vfh.steer(target, None)
    }

    #[test]
    fn one_that_stands_too_near_to_something_finds_a_way_out() {
        // Beside a trunk, at less than the safety radius, with others about.
        let trunks = [(0.1, 0.65, 0.25), (1.6, 0.9, 0.4), (-1.4, -0.9, 0.4), (-1.2, 0.8, 0.3)];
        let config = VfhConfig { safety_radius_m: 0.45, ..VfhConfig::default() };
        let out = steered(&trunks, -0.6, config).expect("a way out");
        assert!((-1.8..-0.1).contains(&out), "{out}");
        let mut vfh = Vfh::new(config);
        vfh.look(&Vector3::zeros(), &scan(&trunks), 720);
        assert!(vfh.kept_m() < 0.35, "{}", vfh.kept_m());
    }

    #[test]
    fn a_return_counts_by_how_near_it_is_and_only_between_the_two_ranges() {
        let config = VfhConfig::published();
        // 60 rays a sector; the second sector of 30 degrees.
        let at = |range: f64| direction(0.7) * range;
        let points = [at(2.0), at(4.5), at(0.1), at(5.1)];
        let histogram = Histogram::of(&Vector3::zeros(), &points, 720, &config);
        assert!((histogram.densities_m()[1] - (3.0 + 0.5) / 60.0).abs() < 1e-12);
        assert_eq!(histogram.densities_m().iter().filter(|density| **density > 0.0).count(), 1);
    }

    #[test]
    fn the_published_histogram_of_a_pillar_ahead() {
        // 0.5 m thick at 1.5 m: 39 degrees wide, so it fills most of the sectors on both sides of east.
        let config = VfhConfig::published();
        let histogram = Histogram::of(&Vector3::zeros(), &scan(&[(1.5, 0.0, 0.5)]), 720, &config);
        let states = histogram.states(&config);
        assert_eq!(states[0], SectorState::Blocked);
        assert_eq!(states[11], SectorState::Blocked);
        assert!(states[1..11].iter().all(|state| *state == SectorState::Free));
    }

    #[test]
    fn an_uncertain_sector_stays_what_it_was_unless_both_neighbours_are_otherwise() {
        use SectorState::{Blocked, Free, Uncertain};
        let decided = |right, left, was: bool| decide(&[right, Uncertain, left, Free], Some(&[was; 4]))[1];
        for (right, left, was, is) in [
            (Free, Free, true, false),
            (Free, Blocked, true, true),
            (Blocked, Blocked, true, true),
            (Uncertain, Free, true, true),
            (Blocked, Blocked, false, true),
            (Free, Blocked, false, false),
            (Free, Free, false, false),
            (Uncertain, Blocked, false, false),
        ] {
            assert_eq!(decided(right, left, was), is, "{right:?} {left:?}, was blocked: {was}");
        }
        assert_eq!(decide(&[Uncertain; 4], None), [true; 4], "nothing is known of it");
    }

    #[test]
    fn where_nothing_is_the_target_is_flown_to() {
        for target in [-3.0, -1.0, 0.0, 2.5] {
            assert!((steered(&[], target, VfhConfig::default()).unwrap() - target).abs() < 1e-12);
        }
    }

    #[test]
    fn an_obstacle_ahead_is_passed_on_the_side_of_the_target() {
        let config = VfhConfig::default();
        let left = steered(&[(2.0, 0.0, 0.4)], 0.05, config).unwrap();
        let right = steered(&[(2.0, 0.0, 0.4)], -0.05, config).unwrap();
        assert!(left > 0.4 && left < 1.1, "{left}");
        assert!((left + right).abs() < 0.1, "and as far on the other side: {right}");
    }

    #[test]
    fn a_gap_too_narrow_for_the_safety_radius_is_no_opening() {
        // 1.2 m apart, at 1.5 m.
        let gate = [(1.5, 1.0, 0.4), (1.5, -1.0, 0.4)];
        let with = |radius_m| VfhConfig {
            safety_radius_m: radius_m,
            comfort_radius_m: radius_m,
            ..VfhConfig::default()
        };
        assert!(steered(&gate, 0.0, with(0.4)).unwrap().abs() < 0.1);
        assert!(steered(&gate, 0.0, with(0.8)).unwrap().abs() > 0.8);
    }

    #[test]
    fn a_wide_opening_is_passed_at_a_comfortable_distance_and_a_narrow_one_all_the_same() {
        let config = VfhConfig { safety_radius_m: 0.4, ..VfhConfig::default() };
        // The target is half a metre beside the right pillar.
        let steered =
            |gap_m: f64| steered(&[(2.0, gap_m - 0.2, 0.4), (2.0, -1.0, 0.4)], -0.05, config).unwrap();
        assert!(steered(3.0) > 0.1, "{}", steered(3.0));
        assert!(steered(1.6).abs() < 0.1, "{}", steered(1.6));
    }

    #[test]
    fn walled_in_there_is_no_way() {
        let ring: Vec<_> =
            (0..24).map(|k| direction(f64::from(k) * TAU / 24.0) * 1.5).map(|p| (p.x, p.y, 0.3)).collect();
        assert_eq!(steered(&ring, 0.3, VfhConfig::default()), None);
    }

    #[test]
    fn of_two_equal_ways_the_one_chosen_before_is_kept() {
        let mut vfh = Vfh::new(VfhConfig::default());
        vfh.look(&Vector3::zeros(), &scan(&[(2.0, 0.0, 0.4)]), 720);
        let left = vfh.steer(0.1, None).unwrap();
        assert!(left > 0.0);
        assert!(
            (vfh.steer(-0.05, None).unwrap() - left).abs() < 0.2,
            "a little to the right changes nothing"
        );
        vfh.rest();
        assert!(vfh.steer(-0.05, None).unwrap() < 0.0, "but for one that begins anew");
    }

    fn trunk() -> impl Strategy<Value = (f64, f64, f64)> {
        (0.0..TAU, 1.0..5.0_f64, 0.1..0.6_f64).prop_map(|(bearing, distance, radius)| {
            let centre = direction(bearing) * (distance + radius);
            (centre.x, centre.y, radius)
        })
    }

    proptest! {
        /// Straight on along the bearing no trunk that blocks its sector is nearer than the safety radius, but for
        /// the width of a sector.
        #[test]
        fn the_bearing_keeps_the_safety_radius(trunks in prop::collection::vec(trunk(), 0..8), target in -PI..PI) {
            let config = VfhConfig { low_m: 0.0, high_m: 0.0, ..VfhConfig::default() };
            if let Some(bearing) = steered(&trunks, target, config) {
                let u = direction(bearing);
                for point in scan(&trunks) {
                    let (along, distance_m) = (point.dot(&u), point.norm());
                    if along > 0.0 && distance_m <= config.far_m {
                        let kept_m = (point - u * along).norm();
                        let sector_m = distance_m * TAU / config.sectors as f64;
                        prop_assert!(kept_m + sector_m >= config.safety_radius_m.min(distance_m), "{kept_m} from {point:?}");
                    }
                }
            }
        }

        /// Turning the world turns the answer, by whole sectors.
        #[test]
        fn it_does_not_matter_where_east_is(trunks in prop::collection::vec(trunk(), 1..6), sectors in 1..71_usize) {
            let config = VfhConfig::default();
            let turn = sectors as f64 * TAU / config.sectors as f64;
            let points = scan(&trunks);
            let turned: Vec<_> = points
                .iter()
                .map(|p| direction(bearing(p) + turn + 1e-9) * p.norm())
                .collect();
            let count = |points: &[Vector3<f64>]| {
                let histogram = Histogram::of(&Vector3::zeros(), points, 720, &config);
                openings(&histogram, &decide(&histogram.states(&config), None), config.safety_radius_m).len()
            };
            // Rays that lie on a border may fall on either side of it.
            prop_assert!(count(&points).abs_diff(count(&turned)) <= 1);
        }
    }
}

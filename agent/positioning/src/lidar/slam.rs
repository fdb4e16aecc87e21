//! Localisation and mapping by a lidar: what a vehicle uses.

use nalgebra::{Isometry2, Matrix3, Vector2, Vector3};

use super::closure::{Closing, Closure};
use super::key_frames::{KeyFrame, KeyFrames};
use super::level::{LevelScan, Prediction};
use super::local_map::LocalMap;
use super::matching::{Match, refine};
use super::pose_graph::{Solve, composed, turned};
use super::relocation::{Relocated, Relocation};
use crate::PlanarFix;

/// Fewer returns tell nothing of where the vehicle is.
const LEAST_RETURNS: usize = 15;
/// Share of the returns that lie on the map, at least; the rest may be of what was not seen before.
const LEAST_SHARE: f64 = 0.3;
/// A scan of which less than this share is on the map is kept, unless the nearest that is kept was taken from as near as
/// this, m and rad.
const NEW_SHARE: f64 = 0.7;
const SAME_VIEW: (f64, f64) = (0.3, 0.3);
/// A match does not move further from where the motion since the last leads, m and rad.
const FURTHEST_STEP: (f64, f64) = (0.8, 0.25);
/// The map is drawn anew when the vehicle has moved so far, m.
const REDRAW_M: f64 = 1.0;
/// Scans in a row that fit nowhere before the place is lost.
const MISSES: u32 = 4;
/// A lost vehicle searches so many times as much in a step as one that looks for loops.
const LOST_TIMES: usize = 4;
/// Least variance that a match adds to the errors of the frames' poses, m² and rad²: surfaces are not quite as drawn.
const LEAST_EDGE: (f64, f64) = (0.004 * 0.004, 0.0004 * 0.0004);

/// Bounds on effort and memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlamConfig {
    /// A scan is kept when the nearest that is kept is this far away, m.
    pub spacing_m: f64,
    /// Scans that are kept, at most; beyond, those nearest to others go. Each takes up to 50 kB.
    pub most_key_frames: usize,
    /// Error of motion without a scan, as a share of the distance.
    pub odometry_share: f64,
    /// Squares of places that a search looks at in a step: some 0.2 us each.
    pub search_per_step: usize,
    /// Block products of the pose graph in a step: some 0.1 us each.
    pub products_per_step: usize,
}

impl Default for SlamConfig {
    fn default() -> Self {
        Self {
            spacing_m: 1.5,
            most_key_frames: 1000,
            odometry_share: 0.05,
            search_per_step: 600,
            products_per_step: 2000,
        }
    }
}

/// Whether the vehicle's place is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// No scan yet.
    #[default]
    Waiting,
    Tracking,
    /// Too little is in sight; the place is carried on by the prediction.
    Blind,
    /// The scans do not fit the map; a place where they do is searched for.
    Lost,
}

/// Its health, for whoever chooses between sources.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Health {
    pub state: State,
    /// Unit vector in the world along which the newest scan told nothing.
    pub degenerate: Option<Vector2<f64>>,
    /// Share of the newest scan that lay on the map, 0 to 1.
    pub share: f64,
    pub key_frames: usize,
    /// Whether the newest step did no more than match: it neither kept the scan nor worked on loops.
    pub is_plain: bool,
    /// Loops closed so far. Each can move the place by what had drifted.
    pub loops: usize,
    /// Times the place was lost and found again.
    pub found_again: usize,
    /// Memory that key frames and map take, bytes.
    pub bytes: usize,
}

/// Where the vehicle was at the newest scan.
#[derive(Clone, Copy, Debug)]
struct Last {
    /// On the map.
    pose: Isometry2<f64>,
    /// As it was predicted.
    predicted: Isometry2<f64>,
}

/// A map that grows with the flight, and the vehicle's place on it.
///
/// The frame is the world's as far as the first prediction knew it: the first scan is kept at the predicted pose with
/// its covariance, and no fix is surer of the world than that. From then on only the *change* of the predictions is
/// used, to begin each match.
#[derive(Clone, Debug)]
pub struct Slam {
    config: SlamConfig,
    frames: KeyFrames,
    map: LocalMap,
    members: Vec<usize>,
    /// Variance of the path from the reference frame to each, m².
    apart: Vec<f64>,
    drawn_at: Vector2<f64>,
    /// The frame whose errors the place shares.
    reference: usize,
    last: Option<Last>,
    misses: u32,
    closure: Closure,
    relocation: Option<Relocation>,
    solve: Option<Solve>,
    shared: Matrix3<f64>,
    health: Health,
}

impl Slam {
    pub fn new(config: SlamConfig) -> Self {
        Self {
            config,
            frames: KeyFrames::default(),
            map: LocalMap::new(&Vector2::zeros()),
            members: Vec::new(),
            apart: Vec::new(),
            drawn_at: Vector2::zeros(),
            reference: 0,
            last: None,
            misses: 0,
            closure: Closure::default(),
            relocation: None,
            solve: None,
            shared: Matrix3::zeros(),
            health: Health::default(),
        }
    }

    pub fn health(&self) -> &Health {
        &self.health
    }

    /// The scans that are kept and where they were taken, oldest first.
    pub fn key_frames(&self) -> &[KeyFrame] {
        self.frames.all()
    }

    /// Where the vehicle was at the newest scan, on the map.
    pub fn pose(&self) -> Option<&Isometry2<f64>> {
        self.last.as_ref().map(|last| &last.pose)
    }

    /// What the newest fix shares with those before and after it: the error of the map, which no number of fixes averages
    /// out. East, north (m²) and heading (rad²). The rest of a fix's covariance is its own.
    pub fn shared(&self) -> &Matrix3<f64> {
        &self.shared
    }

    /// Takes in a scan and what was predicted for its moment. `None` while the place is not known by the scan.
    pub fn step(&mut self, scan: &LevelScan, prediction: &Prediction) -> Option<PlanarFix> {
        let predicted = prediction.planar();
        if !is_sound(&predicted, &prediction.covariance) {
            return None;
        }
        self.health.is_plain = self.solve.is_none();
        self.advance_solve();
        let fix = match self.last {
            Some(last) => {
                let pose = last.pose * (last.predicted.inverse() * predicted);
                self.last = Some(Last { pose, predicted });
                self.locate(scan, &pose, prediction)
            }
            None => {
                self.begin(scan, prediction);
                None
            }
        };
        self.health.key_frames = self.frames.all().len();
        self.health.bytes = self.frames.bytes() + self.map.bytes();
        fix
    }

    fn begin(&mut self, scan: &LevelScan, prediction: &Prediction) {
        if scan.returns.len() < LEAST_RETURNS {
            return;
        }
        let pose = prediction.planar();
        let frame = KeyFrame::new(pose, prediction.covariance, prediction.covariance, &scan.returns);
        self.frames.add(frame, None);
        self.last = Some(Last { pose, predicted: pose });
        self.health.state = State::Tracking;
        self.draw(0);
    }

    fn locate(
        &mut self,
        scan: &LevelScan,
        guess: &Isometry2<f64>,
        prediction: &Prediction,
    ) -> Option<PlanarFix> {
        if scan.returns.len() < LEAST_RETURNS {
            self.health.state = State::Blind;
            return None;
        }
        if self.health.state == State::Lost {
            self.search(scan, guess, prediction);
            return None;
        }
        let Some(found) = refine(&self.map, &scan.returns, guess).filter(|found| fits(found, guess)) else {
            self.miss();
            return None;
        };
        self.track(scan, &found, prediction)
    }

    /// Goes on from a match.
    fn track(&mut self, scan: &LevelScan, found: &Match, prediction: &Prediction) -> Option<PlanarFix> {
        (self.misses, self.health.state) = (0, State::Tracking);
        (self.health.share, self.health.degenerate) = (found.share, found.degenerate);
        self.last = self.last.map(|last| Last { pose: found.pose, ..last });
        let position = found.pose.translation.vector;
        let fix = self.fix(scan, found);
        let is_new = self.is_new(found);
        let is_far = (position - self.drawn_at).norm() > REDRAW_M;
        if is_new {
            self.keep(scan, found, prediction);
        } else if is_far {
            self.redraw(&position);
        }
        self.close_loops();
        self.health.is_plain &= !is_new && !is_far && !self.closure.is_busy();
        Some(fix)
    }

    fn miss(&mut self) {
        self.health.share = 0.0;
        self.misses += 1;
        if self.misses >= MISSES {
            self.health.state = State::Lost;
        }
    }

    /// The place in the world: the match's own error, and that of the frame it is told from.
    fn fix(&mut self, scan: &LevelScan, found: &Match) -> PlanarFix {
        let base = &self.frames.all()[self.reference];
        let relative = base.pose.inverse() * found.pose;
        self.shared = composed(&base.pose, &base.covariance, &relative, &Matrix3::zeros());
        PlanarFix {
            stamp: scan.stamp,
            position: found.pose.translation.vector,
            heading_rad: found.pose.rotation.angle(),
            covariance: self.shared + found.covariance,
        }
    }

    /// Whether a scan shows what those that are kept do not.
    fn is_new(&self, found: &Match) -> bool {
        let away = self.members.iter().map(|at| {
            let moved = self.frames.all()[*at].pose.inverse() * found.pose;
            (moved.translation.vector.norm(), moved.rotation.angle().abs())
        });
        let is_far = away.clone().all(|(off_m, _)| off_m > self.config.spacing_m);
        let is_same = |(off_m, turned): (f64, f64)| off_m < SAME_VIEW.0 && turned < SAME_VIEW.1;
        is_far || found.share < NEW_SHARE && !away.into_iter().any(is_same)
    }

    /// Keeps a scan where it was matched.
    fn keep(&mut self, scan: &LevelScan, found: &Match, prediction: &Prediction) {
        let base = &self.frames.all()[self.reference];
        let relative = base.pose.inverse() * found.pose;
        let back = turned(&base.pose).transpose();
        let matched = back * found.covariance * back.transpose();
        let moved = self.moved(&relative, prediction);
        // Along what the match does not tell, the motion since the reference does.
        let both = sum_of_information(&matched, &moved).unwrap_or(moved);
        let (place, heading) = LEAST_EDGE;
        let measured = if found.is_whole { matched } else { both };
        let measured = measured + Matrix3::from_diagonal(&Vector3::new(place, place, heading));
        let covariance = composed(&base.pose, &base.covariance, &relative, &measured);
        self.add(scan, &found.pose, covariance, prediction, (relative, measured));
    }

    fn add(
        &mut self,
        scan: &LevelScan,
        pose: &Isometry2<f64>,
        covariance: Matrix3<f64>,
        prediction: &Prediction,
        (relative, measured): (Isometry2<f64>, Matrix3<f64>),
    ) {
        let frame = KeyFrame::new(*pose, covariance, prediction.covariance, &scan.returns);
        let at = self.frames.add(frame, Some((self.reference, relative, measured)));
        self.draw(at);
        if self.frames.all().len() > self.config.most_key_frames {
            self.forget(at);
        }
    }

    /// Makes room for one more.
    fn forget(&mut self, newest: usize) {
        self.frames.forget_one(&[newest]);
        (self.solve, self.relocation) = (None, None);
        self.closure = Closure::default();
        self.draw(self.frames.all().len() - 1);
    }

    /// Covariance of the motion from the reference frame, on its axes: what the predictions say, and no less than
    /// odometry errs.
    fn moved(&self, relative: &Isometry2<f64>, prediction: &Prediction) -> Matrix3<f64> {
        let base = &self.frames.all()[self.reference];
        let grown = (prediction.covariance - base.predicted).symmetric_eigen();
        let grown_by = grown.eigenvalues.map(|value| value.max(0.0));
        let grown = grown.eigenvectors * Matrix3::from_diagonal(&grown_by) * grown.eigenvectors.transpose();
        let back = turned(&base.pose).transpose();
        let share = self.config.odometry_share;
        let least_m = share * relative.translation.vector.norm() + 0.01;
        let least = Vector3::new(least_m * least_m, least_m * least_m, (0.2 * share).powi(2));
        back * grown * back.transpose() + Matrix3::from_diagonal(&least)
    }

    /// Draws the map about the vehicle of the frames that agree with `start`, and takes the nearest for reference.
    fn draw(&mut self, start: usize) {
        let place = self.last.map_or(Vector2::zeros(), |last| last.pose.translation.vector);
        self.apart = self.frames.apart(start);
        self.reference = self.frames.nearest(&place, start, &self.apart);
        self.members = self.frames.draw(&mut self.map, &place, start, &self.apart);
        self.drawn_at = place;
    }

    fn redraw(&mut self, place: &Vector2<f64>) {
        let start = self.frames.nearest(place, self.reference, &self.apart);
        self.draw(start);
    }

    fn close_loops(&mut self) {
        let closing = Closing { frames: &self.frames, from: self.reference, apart: &self.apart };
        let Some(found) = self.closure.advance(&closing, self.config.search_per_step) else { return };
        self.frames.close(found.from, found.to, found.relative, found.covariance);
        self.health.loops += 1;
        self.begin_solve();
    }

    fn begin_solve(&mut self) {
        let poses = self.frames.all().iter().map(|frame| frame.pose).collect();
        let Some(first) = self.frames.all().first() else { return };
        self.solve = Some(Solve::new(poses, first.covariance, self.frames.edges().to_vec()));
    }

    fn advance_solve(&mut self) {
        let Some(solve) = &mut self.solve else { return };
        if !solve.advance(self.config.products_per_step) {
            return;
        }
        let solve = self.solve.take();
        let Some(solve) = solve.filter(Solve::has_settled) else { return };
        let before = self.frames.all()[self.reference].pose;
        self.frames.correct(solve.solution());
        let shift = self.frames.all()[self.reference].pose * before.inverse();
        self.last = self.last.map(|last| Last { pose: shift * last.pose, ..last });
        self.draw(self.reference);
    }

    /// Searches on for a place where the scans fit; gives up in the end and begins a map of its own.
    fn search(&mut self, scan: &LevelScan, guess: &Isometry2<f64>, prediction: &Prediction) {
        // It may have been something that passed by.
        let near = refine(&self.map, &scan.returns, guess).filter(|found| fits(found, guess));
        if near.is_some_and(|found| found.share > 0.6) {
            self.found_again(guess, self.reference);
            return;
        }
        let base = self.frames.all()[self.reference].predicted;
        let frames = &self.frames;
        let relocation = self
            .relocation
            .get_or_insert_with(|| Relocation::new(frames, scan, guess, &(prediction.covariance - base)));
        match relocation.advance(frames, guess, LOST_TIMES * self.config.search_per_step) {
            Relocated::Searching => {}
            Relocated::At { pose, frame } => self.found_again(&pose, frame),
            Relocated::Nowhere => self.begin_anew(scan, guess, prediction),
        }
    }

    fn found_again(&mut self, pose: &Isometry2<f64>, frame: usize) {
        self.last = self.last.map(|last| Last { pose: *pose, ..last });
        (self.relocation, self.misses, self.health.state) = (None, 0, State::Tracking);
        self.health.found_again += 1;
        self.draw(frame);
    }

    /// Keeps a scan where the prediction says, and goes on from there.
    fn begin_anew(&mut self, scan: &LevelScan, guess: &Isometry2<f64>, prediction: &Prediction) {
        let base = &self.frames.all()[self.reference];
        let relative = base.pose.inverse() * guess;
        let moved = self.moved(&relative, prediction);
        let covariance = composed(&base.pose, &base.covariance, &relative, &moved);
        (self.relocation, self.misses, self.health.state) = (None, 0, State::Tracking);
        self.add(scan, guess, covariance, prediction, (relative, moved));
    }
}

fn is_sound(pose: &Isometry2<f64>, covariance: &Matrix3<f64>) -> bool {
    let place = pose.translation.vector;
    let numbers = [place.x, place.y, pose.rotation.angle()];
    numbers.iter().chain(covariance.iter()).all(|number| number.is_finite() && number.abs() < 1e7)
}

fn fits(found: &Match, guess: &Isometry2<f64>) -> bool {
    let moved = guess.inverse() * found.pose;
    let (place_m, turn_rad) = FURTHEST_STEP;
    let is_near = moved.translation.vector.norm() < place_m && moved.rotation.angle().abs() < turn_rad;
    is_near && found.share >= LEAST_SHARE
}

/// Covariance of what two independent measurements say together.
fn sum_of_information(one: &Matrix3<f64>, other: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let both = (one.try_inverse()? + other.try_inverse()?).try_inverse()?;
    Some((both + both.transpose()) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lidar::synthetic::{Flight, World};

    /// The result of a flight.
    #[derive(Debug, Default)]
    struct Flown {
        fixes: usize,
        worst_m: f64,
        last_m: f64,
        /// Fixes of which a part is beyond 3 sigma.
        beyond: usize,
        sum_of_squares: f64,
        /// Along x, at the end, m.
        sigma_along_m: f64,
    }

    struct Run {
        slam: Slam,
        flight: Flight,
        seed: u64,
        flown: Flown,
    }

    impl Run {
        fn new(start: Isometry2<f64>, seed: u64) -> Self {
            let (slam, flight) = (Slam::new(SlamConfig::default()), Flight::new(start, seed));
            Self { slam, flight, seed, flown: Flown::default() }
        }

        fn look(&mut self, world: &World, to: Isometry2<f64>) -> Option<PlanarFix> {
            self.seed += 1000;
            let prediction = self.flight.fly(to);
            let scan = LevelScan::new(&world.scan(&to, self.seed).sweep(), &prediction, |_| false);
            let fix = self.slam.step(&scan, &prediction)?;
            let off = fix.position - to.translation.vector;
            let turned = nalgebra::Rotation2::new(fix.heading_rad - to.rotation.angle()).angle();
            let sigma = fix.covariance.diagonal().map(f64::sqrt);
            let error = off.push(turned).component_div(&sigma);
            let flown = &mut self.flown;
            flown.fixes += 1;
            flown.worst_m = flown.worst_m.max(off.norm());
            flown.last_m = off.norm();
            flown.beyond += usize::from(error.abs().max() > 3.0);
            flown.sum_of_squares += error.norm_squared() / 3.0;
            flown.sigma_along_m = sigma.x;
            Some(fix)
        }

        /// Along a line of places, 0.4 m a tenth of a second, looking ahead.
        fn fly(&mut self, world: &World, places: &[[f64; 2]]) {
            for leg in places.windows(2) {
                let (from, to) = (Vector2::from(leg[0]), Vector2::from(leg[1]));
                let (way, steps) = (to - from, ((to - from).norm() / 0.4).ceil());
                for step in 1..=steps as u32 {
                    let pose = Isometry2::new(from + way * f64::from(step) / steps, way.y.atan2(way.x));
                    self.look(world, pose);
                }
            }
        }
    }

    fn start(place: [f64; 2], heading: f64) -> Isometry2<f64> {
        Isometry2::new(Vector2::from(place), heading)
    }

    #[test]
    fn a_wood_of_trunks_is_crossed() {
        for seed in 0..3 {
            let forest = World::forest(seed, 100.0, 0.03);
            let mut run = Run::new(start([0.0, 0.0], 0.0), seed);
            run.fly(&forest, &[[0.0, 0.0], [100.0, 0.0]]);
            let flown = &run.flown;
            assert!(flown.worst_m < 0.3 && flown.fixes > 245, "{flown:?}");
            assert!(flown.beyond * 100 <= flown.fixes, "{flown:?}");
        }
    }

    #[test]
    fn aisles_of_a_warehouse_close_to_a_loop() {
        // Up one aisle, down the other, twice; all racks look alike.
        let warehouse = World::warehouse(80.0, 4, 7);
        let ring = [[0.0, 0.0], [70.0, 0.0], [70.0, 12.0], [0.0, 12.0], [0.0, 0.0]];
        let mut run = Run::new(start([0.0, 0.0], 0.0), 5);
        run.fly(&warehouse, &ring);
        run.fly(&warehouse, &ring[..2]);
        let (flown, health) = (&run.flown, run.slam.health());
        assert!(health.state == State::Tracking && health.loops > 0, "{health:?}");
        assert!(flown.last_m < 0.3, "{flown:?}");
        assert!(flown.beyond * 100 <= flown.fixes, "{flown:?}");
    }

    #[test]
    fn along_a_smooth_corridor_sigma_grows_and_shrinks_where_it_ends() {
        // The ends are seen from 40 m at most.
        let mut corridor = World::corridor(200.0, 3.0, 0.0);
        corridor.walls.push([Vector2::new(-100.0, -3.0), Vector2::new(-100.0, 3.0)]);
        corridor.trunks.push((Vector2::new(-95.0, 1.0), 0.3));
        let mut run = Run::new(start([-90.0, 0.0], 0.0), 9);
        run.fly(&corridor, &[[-90.0, 0.0], [-70.0, 0.1]]);
        let seen = run.flown.sigma_along_m;
        assert!(seen < 0.1, "{seen}");
        let fixes = run.flown.fixes;
        run.flown = Flown::default();
        run.fly(&corridor, &[[-70.0, 0.1], [10.0, 0.0]]);
        let (flown, health) = (&run.flown, run.slam.health());
        assert!(fixes > 45 && flown.fixes > 190, "{flown:?} {health:?}");
        assert!(health.degenerate.unwrap().x.abs() > 0.99 && flown.sigma_along_m > 10.0, "{flown:?}");
        let newest = run.slam.key_frames().last().unwrap();
        let [along_m, across_m] = [0, 1].map(|axis| newest.covariance[(axis, axis)].sqrt());
        assert!(run.slam.shared()[(0, 0)].sqrt() < 10.0, "the map is surer than what a scan tells");
        assert!(along_m > 0.2 && across_m < 0.6 && along_m < 10.0, "{along_m} {across_m}");
        assert!(flown.beyond * 100 <= flown.fixes, "{flown:?}");
    }

    #[test]
    fn a_vehicle_that_has_lost_its_place_finds_it_again() {
        let forest = World::forest(11, 40.0, 0.03);
        let mut run = Run::new(start([0.0, 0.0], 0.0), 2);
        run.fly(&forest, &[[0.0, 0.0], [30.0, 0.0]]);
        // The prediction is suddenly 3 m and 0.3 rad off.
        let away = Isometry2::new(Vector2::new(2.0, 2.2), 0.3);
        run.flight.mislead(&away);
        for _ in 0..100 {
            run.look(&forest, start([30.0, 0.0], 0.0));
        }
        let (flown, health) = (&run.flown, run.slam.health());
        assert!(health.state == State::Tracking && health.found_again == 1, "{health:?}");
        assert!(flown.worst_m < 0.3 && flown.beyond == 0, "{flown:?}");
    }

    #[test]
    fn blindness_is_told_and_carried_over() {
        let forest = World::forest(12, 40.0, 0.03);
        let mut run = Run::new(start([0.0, 0.0], 0.0), 3);
        run.fly(&forest, &[[0.0, 0.0], [10.0, 0.0]]);
        run.fly(&World::default(), &[[10.0, 0.0], [14.0, 0.0]]);
        assert_eq!(run.slam.health().state, State::Blind);
        run.fly(&forest, &[[14.0, 0.0], [20.0, 0.0]]);
        assert_eq!(run.slam.health().state, State::Tracking);
        assert!(run.flown.worst_m < 0.2);
    }

    #[test]
    fn memory_is_bounded() {
        let forest = World::forest(13, 60.0, 0.03);
        let mut run = Run::new(start([0.0, 0.0], 0.0), 4);
        run.slam = Slam::new(SlamConfig { most_key_frames: 12, ..SlamConfig::default() });
        run.fly(&forest, &[[0.0, 0.0], [60.0, 0.0]]);
        assert!(run.slam.key_frames().len() <= 12);
        assert!(run.flown.worst_m < 0.3 && run.flown.fixes > 145, "{:?}", run.flown);
    }

    #[test]
    fn nothing_that_is_predicted_makes_it_fall() {
        let forest = World::forest(14, 20.0, 0.03);
        let mut run = Run::new(start([0.0, 0.0], 0.0), 6);
        run.fly(&forest, &[[0.0, 0.0], [3.0, 0.0]]);
        let good = run.flight.fly(start([3.0, 0.0], 0.0));
        let scan = LevelScan::new(&forest.scan(&start([3.0, 0.0], 0.0), 1).sweep(), &good, |_| false);
        for wrong in [f64::NAN, f64::INFINITY, 1e300] {
            let place = Prediction { position: Vector3::repeat(wrong), ..good };
            let sure = Prediction { covariance: Matrix3::repeat(wrong), ..good };
            assert!(run.slam.step(&scan, &place).is_none() && run.slam.step(&scan, &sure).is_none());
        }
        assert!(run.slam.step(&scan, &good).is_some());
        assert!(run.slam.step(&LevelScan::default(), &good).is_none());
    }
}

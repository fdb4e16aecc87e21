//! Legs that are longer than the map's window, as guidance flies them: without a stop.

use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector3};
use skein_agent::pipeline::guidance::Guidance;
use skein_agent::pipeline::layers::Layers;
use skein_agent::pipeline::perception::{Perception, Pose};
use skein_agent::pipeline::surroundings::Surroundings;
use skein_agent::positioning::Motion;
use skein_agent::{Envelope, Fence, LocalPlanner, Planners, Report, Waypoint};
use skein_mav::SetPoint;
use skein_wire::Scan;

const FENCE: Fence = Fence { min: [-20.0, -60.0, 0.0], max: [400.0, 60.0, 30.0] };
const CRUISE_M_S: f64 = 5.0;

/// A vehicle that moves as its set-points say, with a wall across part of its way.
struct Flight {
    guidance: Guidance,
    perception: Perception,
    now: Duration,
    motion: Motion,
    /// Seen where the ray meets it: a wall at this x, from minus to plus this y.
    wall_m: Option<[f64; 2]>,
    speeds_m_s: Vec<f64>,
    reports: Vec<Report>,
}

impl Flight {
    fn to(target: Vector3<f64>, local: LocalPlanner) -> Self {
        let envelope = Envelope { cruise_m_s: CRUISE_M_S, brake_m_s2: 3.5, ..Envelope::default() };
        let start = Vector3::new(0.0, 0.0, 3.0);
        let layers = Layers::of(&envelope, FENCE, Planners { local, ..Planners::default() });
        let mut guidance = Guidance::new(envelope, layers);
        guidance.head_for(Waypoint { leg: 0, target, lands: true, is_home: false, beyond_s: None });
        Self {
            guidance,
            perception: Perception::new(&FENCE, Vector3::zeros(), [2.0, 7.0]).unwrap(),
            now: Duration::from_secs(1),
            motion: Motion::new(start, Vector3::zeros(), [0.05; 3]),
            wall_m: None,
            speeds_m_s: Vec::new(),
            reports: Vec::new(),
        }
    }

    fn range(&self, angle: f64) -> f32 {
        let position = self.motion.position;
        let Some([x, half_m]) = self.wall_m else { return f32::INFINITY };
        let range = (x - position.x) / angle.cos();
        let hits = range > 0.0 && (position.y + range * angle.sin()).abs() <= half_m;
        if hits && range < 40.0 { range as f32 } else { f32::INFINITY }
    }

    fn looks(&mut self) {
        let angle_step = std::f64::consts::TAU / 720.0;
        let scan = Scan {
            stamp: self.now,
            angle_min: 0.0,
            angle_step,
            max_range_m: 40.0,
            ranges_m: (0..720).map(|ray| self.range(f64::from(ray) * angle_step)).collect(),
            up_m: None,
            down_m: None,
            upright_m: Vec::new(),
        };
        let pose = Pose { position: self.motion.position, attitude: UnitQuaternion::identity() };
        self.perception.take_in(&scan, &pose, &[], &[]);
        let (returns, map) = (self.perception.returns(), self.perception.map());
        self.guidance.steering.look(self.now, &pose.position, returns, 720, map);
    }

    fn plans(&mut self) {
        let answer = self.guidance.plan(false, &self.motion, self.perception.map_mut(), &[]);
        self.reports.extend(answer);
    }

    fn flies_for(&mut self, seconds: f64) -> &mut Self {
        for tick in 0..(seconds * 50.0) as u32 {
            self.now += Duration::from_millis(20);
            self.guidance.grant_leave(self.now);
            self.reports.extend(self.guidance.go_on_planning(self.perception.map_mut()));
            if tick % 5 == 0 {
                self.looks();
                let told = self.guidance.look_ahead(self.now, &self.motion, self.perception.map_mut(), &[]);
                if tick == 0 || told.contains(&Report::PathBlocked) {
                    self.plans();
                }
                self.reports.extend(told);
            }
            self.moves();
        }
        self
    }

    fn moves(&mut self) {
        let surroundings = Surroundings {
            map: self.perception.map(),
            sees: true,
            rays: self.perception.rays(),
            obstacles: self.perception.obstacles(),
            neighbours: &[],
            first: &[],
            rank: 0,
        };
        let velocity = match self.guidance.steer(self.now, &self.motion, &surroundings) {
            SetPoint::Planar { vx, vy, .. } => Vector3::new(vx, vy, 0.0),
            SetPoint::Velocity { velocity, .. } => velocity,
            SetPoint::Position { .. } => Vector3::zeros(),
        };
        self.speeds_m_s.push(velocity.norm());
        self.motion = Motion::new(self.motion.position + velocity * 0.02, velocity, [0.05; 3]);
    }

    fn has_arrived(&self) -> bool {
        self.reports.contains(&Report::Arrived { leg: 0 })
    }
}

#[test]
fn a_leg_of_300_m_is_flown_without_slowing_down() {
    let (mut pulled, mut gentle) = (
        Flight::to(Vector3::new(300.0, 10.0, 3.0), LocalPlanner::Apf),
        Flight::to(Vector3::new(300.0, 10.0, 3.0), LocalPlanner::Vfh),
    );
    pulled.flies_for(70.0);
    gentle.flies_for(90.0);
    // From five seconds after the start to so long before the end.
    let cruise = |flight: &Flight, from_s: usize, to_s: usize| {
        flight.speeds_m_s[50 * from_s..50 * to_s].iter().copied().fold(f64::INFINITY, f64::min)
    };
    assert!(pulled.has_arrived() && gentle.has_arrived());
    assert!(cruise(&pulled, 3, 55) > 0.98 * CRUISE_M_S, "{}", cruise(&pulled, 3, 55));
    assert!(cruise(&gentle, 15, 50) > 0.95 * CRUISE_M_S, "{}", cruise(&gentle, 15, 50));
}

#[test]
fn a_wall_that_stands_beyond_the_first_window_is_gone_around() {
    let mut flight = Flight::to(Vector3::new(200.0, 0.0, 3.0), LocalPlanner::Apf);
    flight.wall_m = Some([90.0, 12.0]);
    flight.flies_for(60.0);
    assert!(flight.has_arrived(), "{:?} {:?}", flight.motion.position, flight.reports);
}

#[test]
fn a_planner_that_brakes_gently_flies_as_fast_as_the_rays_see_the_way_free() {
    let mut flight = Flight::to(Vector3::new(200.0, 0.0, 3.0), LocalPlanner::Vfh);
    flight.wall_m = Some([60.0, 40.0]);
    flight.flies_for(30.0);
    let fastest = flight.speeds_m_s.iter().copied().fold(0.0, f64::max);
    assert!(fastest > 3.5, "{fastest}");
    let hardest = flight.speeds_m_s.windows(2).map(|pair| pair[0] - pair[1]).fold(0.0, f64::max);
    assert!(hardest <= 0.858 * 0.02, "it is braked for within 5 degrees: {} m/s2", hardest / 0.02);
    assert!(flight.motion.position.x < 59.7);
    assert_eq!(flight.guidance.steering.hard_brakes.count, 0);
}

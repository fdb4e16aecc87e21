//! Limits on motion that b-threads state, as guidance keeps them.

use std::time::Duration;

use nalgebra::{UnitQuaternion, Vector3};
use skein_agent::pipeline::allowed::Allowed;
use skein_agent::pipeline::guidance::Guidance;
use skein_agent::pipeline::layers::Layers;
use skein_agent::pipeline::perception::{Perception, Pose};
use skein_agent::pipeline::surroundings::Surroundings;
use skein_agent::positioning::Motion;
use skein_agent::{Envelope, Fence, Planners, Report, Waypoint};
use skein_mav::SetPoint;
use skein_planning::separation::Neighbour;
use skein_wire::event::{Declared as _, Limit};
use skein_wire::{Limits, Scan};

const FENCE: Fence = Fence { min: [-60.0, -60.0, 0.0], max: [60.0, 60.0, 30.0] };
const ME: &str = "uav/1";

/// A vehicle that flies, as well as guidance wants it to: it moves as its set-points say.
struct Flight {
    guidance: Guidance,
    perception: Perception,
    now: Duration,
    motion: Motion,
    others: Vec<Neighbour>,
}

impl Flight {
    fn from(place: [f64; 3]) -> Self {
        let envelope = Envelope::default();
        let perception = Perception::new(&FENCE, Vector3::from(place), [0.6, 12.0]).unwrap();
        Self {
            guidance: Guidance::new(envelope, Layers::of(&envelope, FENCE, Planners::default())),
            perception,
            now: Duration::from_secs(1),
            motion: Motion::new(place.into(), Vector3::zeros(), [0.05, 0.05, 0.1]),
            others: Vec::new(),
        }
    }

    fn limited_by(mut self, limits: &[Limit]) -> Self {
        let stated: Vec<_> = limits.iter().map(|limit| limit.clone().at(ME)).collect();
        let limits = Limits::of(ME, stated.iter().map(|event| ("rule", event)));
        self.guidance.limit(Allowed::from(&limits));
        self
    }

    fn heads_for(mut self, [x, y, z]: [f64; 3], is_home: bool) -> Self {
        let target = Vector3::new(x, y, z);
        self.guidance.head_for(Waypoint { leg: 0, target, lands: false, is_home, beyond_s: None });
        self
    }

    fn plans(&mut self) -> Option<Report> {
        let map = self.perception.map_mut();
        let answer = self.guidance.plan(false, &self.motion, map, &[]);
        answer.or_else(|| (0..500).find_map(|_| self.guidance.go_on_planning(map)))
    }

    /// Sees that nothing is around.
    fn looks(&mut self) {
        let scan = Scan {
            stamp: self.now,
            angle_min: 0.0,
            angle_step: std::f64::consts::TAU / 720.0,
            max_range_m: 20.0,
            ranges_m: vec![f32::INFINITY; 720],
            up_m: None,
            down_m: None,
            upright_m: Vec::new(),
        };
        let pose = Pose { position: self.motion.position, attitude: UnitQuaternion::identity() };
        self.perception.take_in(&scan, &pose, &[], &[]);
    }

    fn tick(&mut self) -> SetPoint {
        self.now += Duration::from_millis(20);
        let surroundings = Surroundings {
            map: self.perception.map(),
            sees: true,
            rays: self.perception.rays(),
            obstacles: &[],
            neighbours: &self.others,
            first: &self.others,
            rank: 0,
        };
        let set_point = self.guidance.steer(self.now, &self.motion, &surroundings);
        let (velocity, height_m) = match set_point {
            SetPoint::Planar { vx, vy, z, .. } => (Vector3::new(vx, vy, 0.0), Some(z)),
            SetPoint::Velocity { velocity, .. } => (velocity, None),
            SetPoint::Position { position, .. } => (Vector3::zeros(), Some(position.z)),
        };
        let mut place = self.motion.position + velocity * 0.02;
        place.z = height_m.map_or(place.z, |height_m| place.z + (height_m - place.z).clamp(-0.02, 0.02));
        self.motion = Motion::new(place, velocity, [0.05, 0.05, 0.1]);
        set_point
    }

    /// Flies for so long with leave; gives back all places, and what was reported.
    fn flies_for(&mut self, seconds: f64) -> (Vec<Vector3<f64>>, Vec<Report>) {
        let (mut places, mut reports) = (Vec::new(), Vec::new());
        for tick in 0..(seconds * 50.0) as u32 {
            self.guidance.grant_leave(self.now);
            if tick % 5 == 0 {
                self.looks();
                let (map, motion) = (self.perception.map_mut(), self.motion);
                for report in self.guidance.look_ahead(self.now, &motion, map, &[]) {
                    if report == Report::PathBlocked {
                        reports.extend(self.plans());
                    }
                    reports.push(report);
                }
            }
            self.tick();
            places.push(self.motion.position);
        }
        (places, reports)
    }
}

fn ceiling(max_z: f64) -> Limit {
    Limit { max_z: Some(max_z), ..Limit::NONE }
}

#[test]
fn a_vehicle_above_a_ceiling_goes_down_on_its_way_and_arrives_under_the_waypoint() {
    let mut flight =
        Flight::from([0.0, 0.0, 6.0]).limited_by(&[ceiling(4.0)]).heads_for([20.0, 0.0, 6.0], false);
    assert!(matches!(flight.plans(), Some(Report::Planned { .. })));
    let (places, reports) = flight.flies_for(14.0);
    assert!(places[200..].iter().all(|place| place.z <= 4.0), "{:?}", places[200]);
    assert!(reports.contains(&Report::Arrived { leg: 0 }), "{reports:?}");
}

#[test]
fn a_limit_that_comes_and_goes_on_the_way_lowers_the_vehicle_and_lets_it_rise_again() {
    let mut flight = Flight::from([0.0, 0.0, 6.0]).heads_for([50.0, 0.0, 6.0], false);
    flight.plans();
    let (before, _) = flight.flies_for(3.0);
    assert!(before.last().unwrap().x > 4.0 && before.iter().all(|place| (place.z - 6.0).abs() < 0.1));
    let mut flight = flight.limited_by(&[ceiling(4.0), ceiling(5.0)]);
    let (during, _) = flight.flies_for(5.0);
    let lowest = during.last().unwrap();
    assert!(lowest.z <= 4.0 && lowest.x > before.last().unwrap().x + 5.0, "{lowest}");
    let mut flight = flight.limited_by(&[]);
    let (after, reports) = flight.flies_for(12.0);
    assert!((after.last().unwrap().z - 6.0).abs() < 0.3, "{:?}", after.last());
    assert!(reports.contains(&Report::Arrived { leg: 0 }), "{reports:?}");
}

#[test]
fn a_vehicle_that_waits_above_a_ceiling_goes_down_and_one_that_is_held_stays() {
    let over = |held: bool| {
        let mut flight = Flight::from([0.0, 0.0, 6.0]).limited_by(&[ceiling(4.0)]);
        if held {
            flight.guidance.hold();
        }
        for _ in 0..300 {
            flight.tick();
        }
        flight.motion.position.z
    };
    assert!(over(false) <= 4.0);
    assert!((over(true) - 6.0).abs() < 0.01);
}

#[test]
fn the_way_home_is_flown_as_if_there_were_no_limit() {
    let slow = Limit { speed_m_s: Some(0.5), ..ceiling(4.0) };
    let mut flight = Flight::from([0.0, 0.0, 6.0]).limited_by(&[slow]).heads_for([20.0, 0.0, 6.0], true);
    flight.plans();
    let (places, _) = flight.flies_for(8.0);
    assert!(
        places.iter().all(|place| place.z > 5.5) && places.last().unwrap().x > 15.0,
        "{:?}",
        places.last()
    );
}

#[test]
fn the_slowest_limit_counts_and_is_no_standstill() {
    let speed = |speed_m_s| Limit { speed_m_s: Some(speed_m_s), ..Limit::NONE };
    let mut flight = Flight::from([0.0, 0.0, 6.0])
        .limited_by(&[speed(0.3), speed(2.0)])
        .heads_for([20.0, 0.0, 6.0], false);
    flight.plans();
    let (places, reports) = flight.flies_for(20.0);
    let fastest = places.windows(2).map(|pair| (pair[1] - pair[0]).norm() * 50.0).fold(0.0, f64::max);
    assert!(fastest <= 0.301, "{fastest}");
    assert!(places.last().unwrap().x > 4.0 && !reports.contains(&Report::Stuck), "{reports:?}");
}

#[test]
fn a_way_stays_in_the_region_and_a_waypoint_beyond_it_has_none() {
    let region = Limit { max_x: Some(10.0), min_y: Some(-2.0), ..Limit::NONE };
    let mut flight = Flight::from([0.0, 0.0, 6.0])
        .limited_by(std::slice::from_ref(&region))
        .heads_for([20.0, 0.0, 6.0], false);
    let refused = flight.plans();
    assert!(
        matches!(&refused, Some(Report::Unplannable { why, .. }) if why.contains("limits")),
        "{refused:?}"
    );
    let mut flight = Flight::from([0.0, 0.0, 6.0]).limited_by(&[region]).heads_for([10.0, 20.0, 6.0], false);
    flight.plans();
    let (places, reports) = flight.flies_for(12.0);
    assert!(places.iter().all(|place| place.x <= 10.0 && place.y >= -2.0));
    assert!(reports.contains(&Report::Arrived { leg: 0 }), "{reports:?} {:?}", places.last());
}

#[test]
fn a_vehicle_that_flies_towards_a_side_when_it_is_closed_brakes_before_it() {
    let mut flight = Flight::from([0.0, 0.0, 6.0]).heads_for([50.0, 0.0, 6.0], false);
    flight.plans();
    flight.flies_for(2.0);
    let wall = flight.motion.position.x + 3.0;
    let mut flight = flight.limited_by(&[Limit { max_x: Some(wall), ..Limit::NONE }]);
    let (places, _) = flight.flies_for(6.0);
    assert!(places.iter().all(|place| place.x <= wall), "{:?}", places.last());
}

#[test]
fn limits_that_contradict_one_another_stop_a_vehicle_where_it_is() {
    let floor = Limit { min_z: Some(5.0), ..Limit::NONE };
    let mut flight =
        Flight::from([0.0, 0.0, 6.0]).limited_by(&[ceiling(4.0), floor]).heads_for([20.0, 0.0, 6.0], false);
    flight.plans();
    let (places, reports) = flight.flies_for(6.0);
    assert!(places.iter().all(|place| (place - places[0]).norm() < 0.1), "{:?}", places.last());
    assert!(!reports.contains(&Report::Stuck), "who may not move is not stuck");
    assert!(!flight.guidance.has_somewhere_to_fly());
}

#[test]
fn avoiding_outranks_every_limit() {
    let speed = Limit { speed_m_s: Some(0.3), min_x: Some(-0.1), max_x: Some(0.1), ..Limit::NONE };
    let mut flight = Flight::from([0.0, 0.0, 6.0]).limited_by(&[speed]);
    flight.others = vec![Neighbour {
        id: 1,
        position: Vector3::new(1.0, 0.0, 6.0),
        velocity: Vector3::zeros(),
        sigma_m: 0.05,
        age_s: 0.0,
        radius_m: 0.25,
        cooperative: true,
    }];
    for _ in 0..100 {
        flight.tick();
    }
    let place = flight.motion.position;
    assert!(place.x < -0.2, "it makes room beyond its limits: {place}");
}

//! The whole way from lidar rays to velocities: eight vehicles cross a forest that they do not know, on crossing lines.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use skein_planning::global::{Potential, astar, simplify};
use skein_planning::local::{apf, braking};
use skein_planning::map::{ClearanceMap, RayEnd, Sectors, VoxelMapConfig};
use skein_planning::{Path, Region};

use super::kinematics::{Flight, Pilot, Swarm, Vehicle, gaussian, uniform};

const RAYS: u32 = 720;
const LIDAR_M: f64 = 40.0;

#[derive(Clone, Copy)]
struct Tree {
    x: f64,
    y: f64,
    radius: f64,
}

/// About 0.046 trees per square metre, at least 2.7 m apart.
fn forest(rng: &mut ChaCha8Rng) -> Vec<Tree> {
    let mut trees: Vec<Tree> = Vec::new();
    for _ in 0..20_000 {
        let (x, y, radius) = (uniform(rng, 3.0, 57.0), uniform(rng, 0.0, 40.0), uniform(rng, 0.3, 0.6));
        let apart = |other: &Tree| (x - other.x).hypot(y - other.y) - radius - other.radius > 2.7 - 0.9;
        if trees.len() < 110 && trees.iter().all(apart) {
            trees.push(Tree { x, y, radius });
        }
    }
    trees
}

/// Sees, plans and follows, with the crate's defaults.
struct Navigator {
    trees: Vec<Tree>,
    goal: Vector3<f64>,
    map: ClearanceMap,
    scratch: astar::Astar,
    path: Option<Path>,
    station_m: f64,
    speed_m_s: f64,
    free_m: f64,
    seen: Vec<Vector3<f64>>,
    ticks: u32,
    rng: ChaCha8Rng,
}

impl Navigator {
    fn new(trees: Vec<Tree>, start: Vector3<f64>, goal: Vector3<f64>, seed: u64) -> Navigator {
        let config = VoxelMapConfig { size_m: [76.0, 56.0, 8.0], ..VoxelMapConfig::default() };
        let mut map = ClearanceMap::new(config, Vector3::new(30.0, 20.0, 4.0), 2.5).unwrap();
        map.track(start.z);
        Navigator {
            trees,
            goal,
            map,
            scratch: astar::Astar::default(),
            path: None,
            station_m: 0.0,
            speed_m_s: 0.0,
            free_m: 0.0,
            seen: Vec::new(),
            ticks: seed as u32 % 5,
            rng: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// A scan from the true position, laid out around the believed one.
    fn scan(&mut self, position: &Vector3<f64>, truth: &Vector3<f64>) {
        let mut rays = Vec::new();
        let mut sectors = Sectors::new(*position);
        for k in 0..RAYS {
            let angle = f64::from(k) * std::f64::consts::TAU / f64::from(RAYS);
            let ahead = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let mut range = LIDAR_M;
            for tree in &self.trees {
                let (dx, dy) = (tree.x - truth.x, tree.y - truth.y);
                let (along, aside) = (dx * ahead.x + dy * ahead.y, dx * ahead.y - dy * ahead.x);
                if along > 0.0 && aside.abs() < tree.radius {
                    range = range.min(along - (tree.radius * tree.radius - aside * aside).sqrt());
                }
            }
            let hit = range < LIDAR_M;
            let point = position + ahead * (range + if hit { 0.03 * gaussian(&mut self.rng) } else { 0.0 });
            rays.push(RayEnd { point, hit });
            if hit {
                sectors.add(point);
            }
        }
        self.map.integrate(*position, &rays);
        self.seen = sectors.points().collect();
    }

    fn replan(&mut self, position: &Vector3<f64>) {
        let config = astar::AstarConfig::default();
        let request = astar::Request {
            start: *position,
            goal: self.goal,
            potential: &Potential::default(),
            discs: &[],
            within: Region::EVERYWHERE,
        };
        self.path = astar::plan(&mut self.map, &request, &config, &mut self.scratch)
            .ok()
            .map(|plan| simplify(&self.map, &plan.path, config.comfort_m));
        self.station_m = 0.0;
    }
}

impl Pilot for Navigator {
    fn decide(&mut self, position: &Vector3<f64>, truth: &Vector3<f64>) -> (Vector3<f64>, Vec<Vector3<f64>>) {
        self.ticks += 1;
        if self.ticks.is_multiple_of(5) || self.seen.is_empty() {
            self.scan(position, truth);
        }
        if self.ticks.is_multiple_of(10) {
            self.replan(position);
        }
        let Some(path) = &self.path else { return (Vector3::zeros(), self.seen.clone()) };
        if self.ticks.is_multiple_of(5) {
            let ahead = path.point_at(self.station_m + 1.0) - position;
            self.free_m = self.map.voxels().sensed_free_m(position, &ahead, 12.0);
        }
        let config = braking::BrakingConfig::default();
        let (cap, _) = braking::speed_cap(path, self.station_m, self.free_m, &config);
        self.speed_m_s = braking::ramp(self.speed_m_s, cap, 0.02, &config);
        let guidance = apf::follow(
            &self.map,
            path,
            self.station_m,
            position,
            self.speed_m_s,
            1.0,
            &apf::ApfConfig::default(),
        );
        self.station_m = guidance.station_m;
        let mut velocity = guidance.velocity;
        velocity.z = (self.goal.z - position.z).clamp(-0.5, 0.5);
        (velocity, self.seen.clone())
    }
}

fn cross(seed: u64) -> Flight {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let trees = forest(&mut rng);
    let lanes = [0, 1, 2, 3, 4, 5, 6, 7].map(|lane| 2.5 + 5.0 * f64::from(lane));
    let mut vehicles = Vec::new();
    let mut pilots: Vec<Box<dyn Pilot>> = Vec::new();
    for (k, lane) in lanes.iter().enumerate() {
        let height = 3.0 + uniform(&mut rng, -0.5, 0.5);
        let start = Vector3::new(0.0, *lane, height);
        let goal = Vector3::new(60.0, lanes[(k * 3 + 5) % 8], height);
        vehicles.push(Vehicle::new(start, goal));
        pilots.push(Box::new(Navigator::new(trees.clone(), start, goal, seed * 8 + k as u64)));
    }
    let mut swarm = Swarm::new(vehicles, seed);
    swarm.pilots = pilots;
    for tree in &trees {
        for k in 0..64 {
            let angle = f64::from(k) * std::f64::consts::TAU / 64.0;
            let outline =
                Vector3::new(tree.x + tree.radius * angle.cos(), tree.y + tree.radius * angle.sin(), 3.0);
            swarm.obstacles.push(outline);
        }
    }
    swarm.fly_home(120.0)
}

#[test]
fn eight_vehicles_cross_a_forest_and_touch_nothing() {
    let flight = cross(1);
    println!("forest: {flight:?}");
    assert!(flight.arrived, "{flight:?}");
    assert!(flight.min_separation_m >= 1.05, "{flight:?}");
    assert!(flight.min_clearance_m >= 0.3, "{flight:?}");
}

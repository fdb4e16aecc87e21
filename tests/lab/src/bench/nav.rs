//! Navigation: what one tick of a vehicle's pipeline costs, from a scan of 720 rays to the set-point, with 20
//! neighbours; and where the time goes. In CPU time, so that what else the computer does is not in it.

use std::time::Duration;

use anyhow::Context as _;
use clap::Args;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use serde_json::json;
use skein_agent::pipeline::guidance::Guidance;
use skein_agent::pipeline::layers::Layers;
use skein_agent::pipeline::perception::{Other, Perception, Pose};
use skein_agent::pipeline::surroundings::Surroundings;
use skein_agent::positioning::Motion;
use skein_agent::{AgentConfig, Report, Waypoint};
use skein_mav::SetPoint;
use skein_planning::separation::{self, FilterConfig, Neighbour, filter};
use skein_sim::cli::Exit;
use skein_sim::fly::agent_configs;
use skein_sim::scenario::Scenario;
use skein_sim::summary::PlanTimes;
use skein_world::{Lidar, Scene};

use crate::cpu_time;
use crate::task::Task;

/// Neighbours around the vehicle.
const NEIGHBOURS: usize = 20;
/// Their least and greatest distance, metres.
const AROUND_M: [f64; 2] = [3.0, 9.0];
/// Navigation cycles begin this often.
const CYCLE: Duration = Duration::from_millis(100);
/// Standard deviations of position, metres, and velocity, m/s.
const SIGMA: [f64; 3] = [0.05, 0.05, 0.1];
/// Height of the flight, metres.
const HEIGHT_M: f64 = 3.0;

/// CPU times of each part, milliseconds.
#[derive(Default)]
struct Times {
    map: Vec<f64>,
    look: Vec<f64>,
    steer: Vec<f64>,
    filter: Vec<f64>,
    tick: Vec<f64>,
    plan: Vec<f64>,
}

/// The same, summed up.
#[derive(Serialize)]
struct Figures {
    tick_ms: PlanTimes,
    map_ms: PlanTimes,
    look_ahead_ms: PlanTimes,
    steer_ms: PlanTimes,
    filter_ms: PlanTimes,
    plan_ms: PlanTimes,
}

#[derive(Args)]
pub struct Nav {
    /// Ticks.
    #[arg(long, value_name = "N", default_value_t = 2000)]
    ticks: usize,
    /// The seed of forest and neighbours.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
}

impl Task for Nav {
    const NAME: &'static str = "nav";
    const ABOUT: &'static str = "One tick of a vehicle's navigation: map from a scan of 720 rays, local plan, safety filter with 20 neighbours";

    fn run(&self, as_json: bool) -> anyhow::Result<Exit> {
        let Self { ticks, seed } = *self;
        let times = measure(ticks, seed)?;
        let (plans, rays) = (times.plan.len(), 720);
        let figures = Figures {
            tick_ms: PlanTimes::of(times.tick),
            map_ms: PlanTimes::of(times.map),
            look_ahead_ms: PlanTimes::of(times.look),
            steer_ms: PlanTimes::of(times.steer),
            filter_ms: PlanTimes::of(times.filter),
            plan_ms: PlanTimes::of(times.plan),
        };
        if as_json {
            let mut object =
                json!({ "ticks": ticks, "rays": rays, "neighbours": NEIGHBOURS, "plans": plans });
            if let (Some(all), serde_json::Value::Object(parts)) =
                (object.as_object_mut(), serde_json::to_value(&figures)?)
            {
                all.extend(parts);
            }
            println!("{object}");
            return Ok(Exit::Done);
        }
        println!("{ticks} ticks with a scan, {NEIGHBOURS} neighbours; CPU time in ms: mean, p99, most");
        let rows = [
            ("one tick", figures.tick_ms),
            ("  map from the scan", figures.map_ms),
            ("  look along the path", figures.look_ahead_ms),
            ("  velocity", figures.steer_ms),
            ("    of it the filter", figures.filter_ms),
            ("a path, when needed", figures.plan_ms),
        ];
        for (name, PlanTimes { mean, p99, max }) in rows {
            println!("{name:<24} {mean:>8.3} {p99:>8.3} {max:>8.3}");
        }
        Ok(Exit::Done)
    }
}

/// Flies one vehicle through the forest, to and fro, among others that keep around it.
fn measure(ticks: usize, seed: u64) -> anyhow::Result<Times> {
    let scenario = Scenario::built_in("forest", Some(1), seed)?;
    let config = agent_configs(&scenario).into_iter().next().context("nobody flies")?;
    let plan = scenario.vehicles.first().context("nobody flies")?;
    let mut flight = Flight::new(&scenario.scene, &config, seed)?;
    let mut lidar = Lidar::new(plan.model.lidar.context("it has no lidar")?, seed, 1);
    let ends = [plan.goal(), plan.start];
    let mut times = Times::default();
    for tick in 0..ticks {
        if tick == 0 || flight.has_arrived {
            let leg = flight.legs;
            flight.head_for(ends[leg % ends.len()], &mut times)?;
        }
        flight.tick(CYCLE * u32::try_from(tick)?, &mut lidar, &mut times)?;
    }
    Ok(times)
}

/// A vehicle that flies what its pipeline says.
struct Flight<'a> {
    scene: &'a Scene,
    perception: Perception,
    guidance: Guidance,
    filter: FilterConfig,
    motion: Motion,
    rng: ChaCha8Rng,
    legs: usize,
    has_arrived: bool,
}

impl<'a> Flight<'a> {
    fn new(scene: &'a Scene, config: &AgentConfig, seed: u64) -> anyhow::Result<Self> {
        let home = Vector3::from(config.home);
        let position = Vector3::new(home.x, home.y, HEIGHT_M);
        Ok(Self {
            scene,
            perception: Perception::new(&config.fence, home, [0.6, 2.0 * HEIGHT_M])?,
            guidance: Guidance::new(
                config.envelope,
                Layers::of(&config.envelope, config.fence, config.planners),
            ),
            filter: FilterConfig { max_speed_m_s: config.envelope.cruise_m_s, ..FilterConfig::default() },
            motion: Motion::new(position, Vector3::zeros(), SIGMA),
            rng: ChaCha8Rng::seed_from_u64(seed),
            legs: 0,
            has_arrived: false,
        })
    }

    fn head_for(&mut self, goal: Vector3<f64>, times: &mut Times) -> anyhow::Result<()> {
        self.legs += 1;
        self.has_arrived = false;
        let target = Vector3::new(goal.x, goal.y, HEIGHT_M);
        self.guidance.head_for(Waypoint {
            leg: self.legs as i64,
            target,
            lands: true,
            is_home: false,
            beyond_s: None,
        });
        self.plan(times)
    }

    fn plan(&mut self, times: &mut Times) -> anyhow::Result<()> {
        let since = cpu_time::this_thread()?;
        let map = self.perception.map_mut();
        let mut report = self.guidance.plan(false, &self.motion, map, &[]);
        while report.is_none() {
            report = self.guidance.go_on_planning(map);
        }
        times.plan.push(ms_since(since)?);
        Ok(())
    }

    fn tick(&mut self, now: Duration, lidar: &mut Lidar, times: &mut Times) -> anyhow::Result<()> {
        let neighbours: Vec<Neighbour> = (0..).take(NEIGHBOURS).map(|id| self.neighbour(id)).collect();
        let pose =
            Isometry3::from_parts(Translation3::from(self.motion.position), UnitQuaternion::identity());
        let seen = skein_world::Surroundings { scene: self.scene, hulls: &[], own: 0 };
        let scan = lidar.scan(now, &pose, &seen);
        let other = |neighbour: &Neighbour| Other { position: neighbour.predicted(), off_m: 0.0 };
        let others: Vec<_> = neighbours.iter().map(other).collect();

        let began = cpu_time::this_thread()?;
        let pose = Pose { position: self.motion.position, attitude: UnitQuaternion::identity() };
        self.perception.take_in(&scan, &pose, &others, &[]);
        let mapped = cpu_time::this_thread()?;
        self.guidance.grant_leave(now);
        let reports = self.guidance.look_ahead(now, &self.motion, self.perception.map_mut(), &[]);
        let looked = cpu_time::this_thread()?;
        let surroundings = Surroundings {
            sees: true,
            rays: self.perception.rays(),
            map: self.perception.map(),
            obstacles: self.perception.obstacles(),
            neighbours: &neighbours,
            first: &neighbours,
            rank: 0,
        };
        let set_point = self.guidance.steer(now, &self.motion, &surroundings);
        let steered = cpu_time::this_thread()?;
        let request = separation::Motion {
            position: self.motion.position,
            velocity: self.motion.velocity,
            acceleration: Vector3::zeros(),
            sigma_m: self.motion.position_sigma_m(),
            desired: velocity(&set_point),
            planar: true,
        };
        std::hint::black_box(filter(&request, &neighbours, self.perception.obstacles(), &self.filter));
        times.filter.push(ms_since(steered)?);
        times.map.push(ms(mapped - began));
        times.look.push(ms(looked - mapped));
        times.steer.push(ms(steered - looked));
        times.tick.push(ms(steered - began));

        self.motion.velocity = velocity(&set_point);
        self.motion.position += self.motion.velocity * CYCLE.as_secs_f64();
        self.has_arrived = reports.iter().any(|report| matches!(report, Report::Arrived { .. }));
        if reports.iter().any(|report| matches!(report, Report::PathBlocked | Report::Stuck)) {
            self.plan(times)?;
        }
        Ok(())
    }

    /// One that flies along somewhere around the vehicle.
    fn neighbour(&mut self, id: u32) -> Neighbour {
        let [near_m, far_m] = AROUND_M;
        let mut share = || f64::from(self.rng.next_u32()) / f64::from(u32::MAX);
        let (sin, cos) = (std::f64::consts::TAU * share()).sin_cos();
        let distance_m = near_m + (far_m - near_m) * share();
        Neighbour {
            id,
            position: self.motion.position + Vector3::new(cos, sin, 0.0) * distance_m,
            velocity: self.motion.velocity,
            sigma_m: 0.05,
            age_s: 0.1 * share(),
            radius_m: 0.25,
            cooperative: true,
        }
    }
}

/// The velocity that the set-point asks for; the bench keeps its height.
fn velocity(set_point: &SetPoint) -> Vector3<f64> {
    match *set_point {
        SetPoint::Planar { vx, vy, .. } => Vector3::new(vx, vy, 0.0),
        SetPoint::Velocity { velocity, .. } => Vector3::new(velocity.x, velocity.y, 0.0),
        _ => Vector3::zeros(),
    }
}

fn ms_since(since: Duration) -> anyhow::Result<f64> {
    Ok(ms(cpu_time::this_thread()? - since))
}

fn ms(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}

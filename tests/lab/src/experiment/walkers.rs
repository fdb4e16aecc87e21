//! Walkers: people who tell nobody where they go, among vehicles that see them by lidar alone.

use std::collections::VecDeque;
use std::time::Duration;

use clap::Args;
use nalgebra::Vector3;
use serde_json::json;
use skein_agent::{Envelope, LocalPlanner};
use skein_sim::cli::Controller;
use skein_sim::fly::{Swarm, Trial};
use skein_sim::scenario::Scenario;
use skein_sim::summary::Summary;
use skein_world::{Obstacle, Scene};

use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;
use crate::statistics::mean;

const SCENARIO: &str = include_str!("walkers.toml");
const RUNS: usize = 100;
/// The fewest people in a world, and how many numbers of them there are.
const FEWEST: u64 = 2;
const NUMBERS: u64 = 5;
/// A touch is judged by what was seen for so long before it.
const REMEMBERED: Duration = Duration::from_secs(6);
/// Who comes no nearer of itself than so fast is walked into, m/s.
const RESTS_M_S: f64 = 0.2;
/// Between two moments of a braking vehicle that are looked at, s.
const STEP_S: f64 = 0.02;

#[derive(Args)]
pub struct Walkers {
    /// Worlds, whose seeds are 1 to N; world N has 2 to 6 walkers.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
    /// Fly by the vector field histogram in place of the potential field.
    #[arg(long)]
    vfh: bool,
}

/// A world of this experiment.
///
/// # Errors
/// The scenario is not sound.
pub fn world(seed: u64) -> anyhow::Result<Scenario> {
    let number = FEWEST + seed % NUMBERS;
    let text = format!("{SCENARIO}\n[[walker]]\nnumber = {number}\n");
    Ok(Scenario::from_toml(&text, "walkers.toml", None, seed)?)
}

/// A touch of a vehicle and something that moves.
#[derive(Clone, Debug, PartialEq)]
struct Touch {
    seed: u64,
    vehicle: usize,
    walker: String,
    at_s: f64,
    /// How fast the vehicle came nearer of itself, m/s.
    approach_m_s: f64,
    /// Whether it could have been avoided by braking.
    avoidable: bool,
}

struct Flight {
    summary: Summary,
    touches: Vec<Touch>,
}

impl Experiment for Walkers {
    const NAME: &'static str = "walkers";
    const ABOUT: &'static str =
        "people who tell nobody where they go: touches that braking would have avoided";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds: Vec<u64> = (1..=self.runs as u64).collect();
        let flights = runs::in_turn("worlds", &seeds, |seed| {
            let mut scenario = world(*seed)?;
            scenario.planners.local = if self.vfh { LocalPlanner::Vfh } else { LocalPlanner::Apf };
            fly(&scenario)
        })?;
        Ok(judge(&flights))
    }
}

fn judge(flights: &[Flight]) -> Report {
    let mut report = Report::default();
    let arrived = flights.iter().filter(|flight| flight.summary.succeeded).count();
    let touches: Vec<&Touch> = flights.iter().flat_map(|flight| &flight.touches).collect();
    let avoidable = touches.iter().filter(|touch| touch.avoidable).count();
    let others: u64 = flights
        .iter()
        .map(|flight| flight.summary.collisions.obstacle + flight.summary.collisions.vehicle)
        .sum::<u64>()
        .saturating_sub(touches.len() as u64);
    let times: Vec<f64> = flights.iter().map(|flight| flight.summary.flight_time_s.mean).collect();
    let nearest = flights.iter().filter_map(|flight| flight.summary.min_clearance_m).reduce(f64::min);
    report.goal("worlds in which all arrive", arrived as f64, Bound::Exactly(flights.len() as f64));
    report.goal("touches of walkers that braking would have avoided", avoidable as f64, Bound::Exactly(0.0));
    report.goal("other collisions", others as f64, Bound::Exactly(0.0));
    report.number("worlds", flights.len());
    report.number("arrived", arrived);
    report.number("touches", touches.len());
    report.number("avoidable", avoidable);
    report.number("walked_into", touches.len() - avoidable);
    report.number("other_collisions", others);
    report.number("min_clearance_m", nearest);
    report.number("flight_time_s", mean(&times));
    let failed = flights.iter().filter(|flight| !flight.summary.succeeded);
    let failed: Vec<_> = failed
        .map(|flight| json!({ "seed": flight.summary.seed, "reason": flight.summary.reason }))
        .collect();
    report.number("failed", failed);
    let rows = touches.iter().map(|touch| {
        vec![
            touch.seed.to_string(),
            (touch.vehicle + 1).to_string(),
            touch.walker.clone(),
            format!("{:.1}", touch.at_s),
            format!("{:.2}", touch.approach_m_s),
            if touch.avoidable { "could have braked" } else { "was walked into" }.to_owned(),
        ]
    });
    report.table(
        "Touches",
        &["seed", "vehicle", "walker", "at, s", "came nearer at, m/s", "the vehicle"],
        rows.collect::<Vec<Vec<String>>>(),
    );
    report
}

fn fly(scenario: &Scenario) -> anyhow::Result<Flight> {
    let envelope =
        skein_sim::fly::agent_configs(scenario).first().map_or(Envelope::DEFAULT, |it| it.envelope);
    let mut referees: Vec<Referee> = (0..scenario.vehicles.len()).map(|_| Referee::default()).collect();
    let mut touches = Vec::new();
    let flown = Trial::new(scenario, Controller::Bp).fly(&mut |swarm, _| {
        for (vehicle, referee) in referees.iter_mut().enumerate() {
            let touch = referee.look(swarm, vehicle, &envelope);
            touches.extend(touch.map(|touch| Touch { seed: scenario.seed, ..touch }));
        }
    })?;
    Ok(Flight { summary: flown.summary, touches })
}

/// A vehicle in the air at one moment.
#[derive(Clone, Copy, Debug)]
struct Moment {
    at: Duration,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
}

/// Remembers how a vehicle flew of late, and judges its end.
#[derive(Debug, Default)]
struct Referee {
    moments: VecDeque<Moment>,
    has_ended: bool,
}

impl Referee {
    fn look(&mut self, swarm: &Swarm, vehicle: usize, envelope: &Envelope) -> Option<Touch> {
        let state = swarm.simulation().vehicle(vehicle).filter(|_| !self.has_ended)?;
        let (at, motion) = (swarm.now(), state.motion);
        if state.crashed {
            self.has_ended = true;
            return self.judge(swarm.simulation().scene(), vehicle, envelope);
        }
        if state.airborne {
            self.moments.push_back(Moment { at, position: motion.position, velocity: motion.velocity });
        }
        while self.moments.front().is_some_and(|first| first.at + REMEMBERED < at) {
            self.moments.pop_front();
        }
        None
    }

    /// Of which walker the touch was, if of one, and whose fault. A vehicle that came no nearer of itself was walked
    /// into. Else it is its fault if, from some moment from which on it has seen the walker, it could have braked
    /// along its way, as late as it answers, and would have come to rest untouched.
    fn judge(&self, scene: &Scene, vehicle: usize, envelope: &Envelope) -> Option<Touch> {
        let last = self.moments.back()?;
        let far_m = |walker: &Obstacle| walker.signed_distance(&last.position.into());
        let walker = scene.moving().min_by(|a, b| far_m(a).total_cmp(&far_m(b)))?;
        // In a tick of 20 ms nothing comes further than this.
        if far_m(walker) > envelope.hull_m + 0.2 {
            return None;
        }
        let towards = (walker.pose.translation.vector - last.position).xy().try_normalize(1e-6);
        let approach_m_s = towards.map_or(0.0, |towards| towards.dot(&last.velocity.xy()));
        let stands = scene.obstacles().iter().filter(|obstacle| obstacle.way.is_none());
        let stands = Scene::new("what stands", stands.cloned().collect());
        let seen = self.moments.iter().rev().take_while(|moment| sees(&stands, moment, walker));
        let could_brake = seen.into_iter().any(|moment| stops_untouched(moment, walker, envelope));
        Some(Touch {
            seed: 0,
            vehicle,
            walker: walker.name.clone(),
            at_s: last.at.as_secs_f64(),
            approach_m_s,
            avoidable: approach_m_s > RESTS_M_S && could_brake,
        })
    }
}

/// The walker as it is at some time.
fn walker_at(walker: &Obstacle, at: Duration) -> Obstacle {
    let mut then = walker.clone();
    if let Some(way) = &walker.way {
        then.pose.translation.vector = way.at(at);
    }
    then
}

/// Whether nothing that stands hides the walker from the vehicle.
fn sees(stands: &Scene, moment: &Moment, walker: &Obstacle) -> bool {
    let mut there = walker_at(walker, moment.at).pose.translation.vector;
    there.z = moment.position.z;
    let offset = there - moment.position;
    let distance_m = offset.norm();
    let direction = offset / distance_m.max(1e-6);
    stands.cast_ray(&moment.position.into(), &direction, distance_m).is_none()
}

/// Whether a vehicle that brakes from a moment on comes to rest without touching the walker.
fn stops_untouched(moment: &Moment, walker: &Obstacle, envelope: &Envelope) -> bool {
    let speed_m_s = moment.velocity.norm();
    let stop_s = envelope.latency_s + speed_m_s / envelope.brake_m_s2;
    let steps = (stop_s / STEP_S).ceil() as u32;
    (0..=steps).map(|step| f64::from(step) * STEP_S).all(|since_s| {
        let braked_s = (since_s - envelope.latency_s).max(0.0).min(speed_m_s / envelope.brake_m_s2);
        let unbraked_s = since_s.min(envelope.latency_s);
        let along_s =
            unbraked_s + braked_s - 0.5 * envelope.brake_m_s2 * braked_s * braked_s / speed_m_s.max(1e-6);
        let place = moment.position + moment.velocity * along_s;
        let then = walker_at(walker, moment.at + Duration::from_secs_f64(since_s));
        then.signed_distance(&place.into()) > envelope.hull_m
    })
}

#[cfg(test)]
mod tests {
    use skein_world::Way;

    use super::*;

    fn person(x: f64, velocity: Vector3<f64>) -> Obstacle {
        let person = Obstacle::trunk("person", x, 0.0, 0.25, 1.8);
        let from = person.pose.translation.vector;
        person.on(Way::straight(from, velocity))
    }

    /// The verdict on a vehicle that flies along x, 50 times a second, until it touches a person.
    fn verdict(speed_m_s: f64, person: Obstacle, hidden: bool) -> Touch {
        let mut referee = Referee::default();
        let mut scene = Scene::new("field", vec![person.clone()]);
        if hidden {
            let wall = Obstacle::block("wall", Vector3::new(3.0, -0.6, 1.0), Vector3::new(2.0, 0.4, 2.0));
            scene = scene.with_more([wall]);
        }
        for tick in 0..500 {
            let at = Duration::from_millis(20 * tick);
            let position = Vector3::new(speed_m_s * at.as_secs_f64(), 0.0, 1.0);
            scene.move_on(at);
            if walker_at(&person, at).signed_distance(&position.into()) < 0.25 {
                break;
            }
            referee.moments.push_back(Moment { at, position, velocity: Vector3::x() * speed_m_s });
        }
        referee.judge(&scene, 0, &Envelope::DEFAULT).expect("they have met")
    }

    #[test]
    fn who_flies_into_somebody_in_plain_sight_could_have_braked() {
        assert!(verdict(2.0, person(8.0, Vector3::zeros()), false).avoidable);
    }

    #[test]
    fn who_stands_is_walked_into() {
        assert!(!verdict(0.0, person(3.0, Vector3::new(-1.0, 0.0, 0.0)), false).avoidable);
    }

    #[test]
    fn who_is_stepped_in_front_of_from_behind_a_wall_could_not_have_braked() {
        let mut steps_out = person(2.4, Vector3::new(0.0, 1.5, 0.0));
        steps_out = steps_out.on(Way::straight(Vector3::new(2.4, -1.7, 0.9), Vector3::new(0.0, 1.5, 0.0)));
        assert!(!verdict(2.0, steps_out.clone(), true).avoidable);
        assert!(verdict(2.0, steps_out, false).avoidable, "without the wall it could");
    }

    #[test]
    fn a_world_is_flown_and_everyone_arrives() {
        let report = Walkers { runs: 1, vfh: false }.run().expect("it can be flown");
        assert!(report.is_reached(), "{report}");
    }
}

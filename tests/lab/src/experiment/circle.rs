//! Circle tracking: the cascade PID with a variable integral against the same with a plain one (Zhang 2019, control).

use std::f64::consts::TAU;
use std::time::Duration;

use clap::Args;
use nalgebra::{Vector2, Vector3};
use serde_json::json;
use skein_mav::{Command, Companion, CompanionConfig, FlightMode, SetPoint};
use skein_world::{
    PositionErrors, PositionIntegral, Scene, Simulation, SimulationConfig, VehicleModel, VehicleSetup,
    WindConfig,
};

use crate::figure::{Figure, Line, Style};
use crate::numbers::one_or_more;
use crate::report::{Bound, Report};
use crate::reported::Experiment;
use crate::runs;
use crate::statistics::{mean, root_mean_square};

const RUNS: usize = 20;
/// The circle: its radius in metres, and how fast it is flown, m/s.
const RADIUS_M: f64 = 1.5;
const SPEED_M_S: f64 = 0.6;
const LAPS: f64 = 3.0;
const HEIGHT_M: f64 = 2.0;
/// From where the vehicle takes off to where it joins the circle, m.
const AWAY_M: f64 = 6.0;
/// The circle's first point is waited at for so long, s.
const JOINING_S: f64 = 8.0;
/// Errors count from when the vehicle is first this near to where it shall be, m: overshoot counts, the way there
/// does not.
const JOINED_M: f64 = 0.5;
/// Steps of the world between two set-points: 50 a second.
const STEPS_PER_TICK: u32 = 5;
const TICKS_BEFORE_OFFBOARD: u32 = 25;
/// No command takes longer than this, s.
const PATIENCE_S: f64 = 20.0;

const INTEGRALS: [(&str, PositionIntegral); 3] = [
    ("variable integral", PositionIntegral::Variable),
    ("plain integral", PositionIntegral::Plain),
    ("no integral", PositionIntegral::None),
];

/// A flight: when, where it should have been and where it was, at every tick since it joined the circle.
struct Flight(Vec<(f64, Vector2<f64>, Vector2<f64>)>);

impl Flight {
    fn errors_m(&self) -> Vec<f64> {
        self.0.iter().map(|(_, wanted, was)| (was - wanted).norm()).collect()
    }
}

#[derive(Args)]
pub struct Circle {
    /// Flights, whose seeds are 1 to N.
    #[arg(long, value_name = "N", default_value_t = RUNS, value_parser = one_or_more())]
    runs: usize,
}

impl Experiment for Circle {
    const NAME: &'static str = "circle";
    const ABOUT: &'static str = "a circle by cascade PID: variable integral against a plain one (Zhang 2019)";

    fn run(&self) -> anyhow::Result<Report> {
        let seeds: Vec<u64> = (1..=self.runs as u64).collect();
        let flights = runs::in_turn("flights", &seeds, |seed| {
            INTEGRALS.iter().map(|(_, integral)| fly(*integral, *seed)).collect::<anyhow::Result<Vec<_>>>()
        })?;
        let mut report = Report::default();
        report.number("runs", seeds.len());
        let mut rows = Vec::new();
        let mut found = Vec::new();
        for (index, (name, _)) in INTEGRALS.iter().enumerate() {
            let errors: Vec<Vec<f64>> =
                flights.iter().filter_map(|flight| flight.get(index)).map(Flight::errors_m).collect();
            let rms_m = mean(&errors.iter().map(|errors| root_mean_square(errors)).collect::<Vec<_>>());
            let greatest = |errors: &Vec<f64>| errors.iter().copied().fold(0.0, f64::max);
            let max_m = mean(&errors.iter().map(greatest).collect::<Vec<_>>());
            report.number(&name.replace(' ', "_"), json!({ "rms_m": rms_m, "max_m": max_m }));
            rows.push(vec![(*name).to_owned(), format!("{rms_m:.3}"), format!("{max_m:.3}")]);
            found.push((rms_m, max_m));
        }
        report.table(
            "Tracking a circle: means over the runs of each run's error",
            &["position loop", "RMS, m", "greatest, m"],
            rows,
        );
        if let [variable, plain, ..] = found.as_slice() {
            report.goal(
                "RMS error, share of that of the plain integral",
                variable.0 / plain.0,
                Bound::Below(1.0),
            );
            report.goal(
                "greatest error, share of that of the plain integral",
                variable.1 / plain.1,
                Bound::Below(1.0),
            );
        }
        if let Some(first) = flights.first() {
            report.figure("circle", map(first));
            report.figure("error", errors_over_time(first));
        }
        Ok(report)
    }
}

/// The place where the vehicle shall be `since_s` after it was first sent to the circle.
fn reference(since_s: f64) -> Vector2<f64> {
    let angle = (since_s - JOINING_S).max(0.0) * SPEED_M_S / RADIUS_M;
    Vector2::new(angle.cos(), angle.sin()) * RADIUS_M
}

/// One vehicle under its autopilot alone, flown by position set-points.
struct Rig {
    simulation: Simulation,
    companion: Companion,
}

impl Rig {
    fn tick(&mut self, set_point: Option<SetPoint>) {
        let now = self.simulation.now();
        self.companion.tick(now);
        if let Some(set_point) = set_point {
            self.companion.set_point(now, set_point);
        }
        let bytes = self.companion.take_output();
        self.simulation.send(0, &bytes);
        (0..STEPS_PER_TICK).for_each(|_| self.simulation.step());
        let bytes = self.simulation.receive(0);
        self.companion.receive(self.simulation.now(), &bytes);
        while self.companion.poll_event().is_some() {}
    }

    /// Commands until something is so.
    fn until(
        &mut self,
        what: &str,
        command: Option<Command>,
        set_point: Option<SetPoint>,
        is_so: impl Fn(&Companion) -> bool,
    ) -> anyhow::Result<()> {
        let end = self.simulation.now() + Duration::from_secs_f64(PATIENCE_S);
        if let Some(command) = command {
            self.companion.command(self.simulation.now(), command);
        }
        while !is_so(&self.companion) {
            anyhow::ensure!(self.simulation.now() < end, "not {what} after {PATIENCE_S} s");
            self.tick(set_point);
        }
        Ok(())
    }

    fn position(&self) -> Option<Vector2<f64>> {
        Some(self.simulation.vehicle(0)?.motion.position.xy())
    }
}

fn fly(integral: PositionIntegral, seed: u64) -> anyhow::Result<Flight> {
    let mut model = VehicleModel::built_in("x500")?;
    model.control.position_integral = integral;
    let scene = Scene::new("hall", Vec::new());
    let datum = *scene.datum();
    let start = Vector3::new(RADIUS_M + AWAY_M, 0.0, 0.0);
    let wind = WindConfig { mean: Vector3::new(0.3, 0.2, 0.0), gust_sigma_m_s: 0.2, ..WindConfig::default() };
    let vehicles = vec![VehicleSetup {
        model,
        position: start,
        yaw: 0.0,
        system_id: 1,
        position_errors: PositionErrors::default(),
    }];
    let mut rig = Rig {
        simulation: Simulation::new(SimulationConfig { scene, vehicles, seed, wind }),
        companion: Companion::new(CompanionConfig::new(1, datum)),
    };
    let to = |place: Vector2<f64>| SetPoint::Position {
        position: Vector3::new(place.x, place.y, HEIGHT_M),
        yaw: None,
    };
    let is = |mode| move |companion: &Companion| companion.telemetry().mode == mode;
    rig.until("ready to arm", None, None, |companion| companion.telemetry().ready_to_arm)?;
    rig.until("armed", Some(Command::Arm), None, |companion| companion.telemetry().armed)?;
    rig.until("climbing", Some(Command::Takeoff { height_m: HEIGHT_M }), None, is(FlightMode::Takeoff))?;
    rig.until("holding", None, None, is(FlightMode::Hold))?;
    // The autopilot wants to see set-points before it follows them.
    (0..TICKS_BEFORE_OFFBOARD).for_each(|_| rig.tick(Some(to(start.xy()))));
    rig.until("in offboard", Some(Command::Offboard), Some(to(start.xy())), is(FlightMode::Offboard))?;
    let since = rig.simulation.now();
    let mut flown = Vec::new();
    loop {
        let t = (rig.simulation.now() - since).as_secs_f64();
        if t > JOINING_S + LAPS * TAU * RADIUS_M / SPEED_M_S {
            return Ok(Flight(flown));
        }
        let wanted = reference(t);
        rig.tick(Some(to(wanted)));
        if let Some(was) = rig.position()
            && (!flown.is_empty() || (was - wanted).norm() < JOINED_M)
        {
            flown.push((t, wanted, was));
        }
    }
}

/// The variable integral is drawn last: on the circle it flies as the plain one does, and hides it.
fn map(flights: &[Flight]) -> Figure {
    let circle =
        (0..=72).map(|k| f64::from(k) * TAU / 72.0).map(|a| (RADIUS_M * a.cos(), RADIUS_M * a.sin()));
    let reference = Line { name: "wanted".to_owned(), style: Style::Reference, points: circle.collect() };
    let line = |((name, _), flight): (&(&str, PositionIntegral), &Flight)| Line {
        name: (*name).to_owned(),
        style: Style::Solid,
        points: flight.0.iter().map(|(_, _, was)| (was.x, was.y)).collect(),
    };
    Figure {
        x: "east, m".to_owned(),
        y: "north, m".to_owned(),
        is_map: true,
        lines: std::iter::once(reference).chain(INTEGRALS.iter().zip(flights).rev().map(line)).collect(),
    }
}

fn errors_over_time(flights: &[Flight]) -> Figure {
    let line = |((name, _), flight): (&(&str, PositionIntegral), &Flight)| Line {
        name: (*name).to_owned(),
        style: Style::Solid,
        points: flight.0.iter().map(|(t, wanted, was)| (*t, (was - wanted).norm())).collect(),
    };
    Figure {
        x: "time, s".to_owned(),
        y: "distance from where it should be, m".to_owned(),
        is_map: false,
        lines: INTEGRALS.iter().zip(flights).rev().map(line).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variable_integral_overshoots_less_than_the_plain_one() {
        let report = Circle { runs: 1 }.run().expect("it can be flown");
        assert!(report.is_reached(), "{report}");
    }
}

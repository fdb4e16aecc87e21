//! Handling: reads the parameters that tell how quickly the autopilot follows set-points.

use std::collections::BTreeMap;

use skein_mav::{Companion, Dialect, Handling, MavEvent};
use skein_wire::Check;

use super::check::{passes, waits};
use crate::config::Envelope;

/// The parameters, each with its value once it has been told; `None` inside if the autopilot has none.
#[derive(Debug, Default)]
pub struct HandlingParameters {
    /// The make whose parameters these are.
    make: Option<&'static str>,
    told: BTreeMap<&'static str, Option<f64>>,
}

impl HandlingParameters {
    /// Asks for the parameters once the autopilot is heard, and when it is heard again.
    pub fn ask(&mut self, companion: &mut Companion) {
        let make = companion.telemetry().connected.then(|| companion.dialect().name());
        if make.is_some() && make != self.make {
            self.make = make;
            self.told.clear();
            let names = companion.dialect().handling_parameters();
            names.iter().for_each(|name| companion.read_parameter(name));
        }
    }

    /// Takes in the autopilot's answers.
    pub fn hear(&mut self, event: &MavEvent, dialect: &dyn Dialect) {
        let (name, value) = match event {
            MavEvent::ParameterRead { name, value } => (name, Some(value.as_f64())),
            MavEvent::ParameterMissing { name } => (name, None),
            MavEvent::HeartbeatLost => {
                self.make = None;
                return;
            }
            _ => return,
        };
        if let Some(known) = dialect.handling_parameters().iter().find(|known| **known == name) {
            self.told.insert(known, value);
        }
    }

    fn is_told(&self, dialect: &dyn Dialect) -> bool {
        dialect.handling_parameters().iter().all(|name| self.told.contains_key(name))
    }

    /// The envelope of a vehicle that is configured like this, as far as its autopilot can fly it.
    pub fn within(&self, configured: Envelope, dialect: &dyn Dialect) -> Envelope {
        let value = |name: &str| self.told.get(name).copied().flatten();
        let Some(Handling { brake_m_s2, latency_s, jerk_m_s3 }) = dialect.handling(&value) else {
            return configured;
        };
        let jerks = [configured.jerk_m_s3, jerk_m_s3].into_iter().flatten();
        Envelope {
            brake_m_s2: configured.brake_m_s2.min(brake_m_s2),
            latency_s: configured.latency_s.max(latency_s),
            jerk_m_s3: jerks.reduce(f64::min),
            ..configured
        }
    }

    /// The check before take-off that it is known, with the envelope that is flown.
    pub fn check(&self, flown: &Envelope, dialect: &dyn Dialect) -> Check {
        if !self.is_told(dialect) {
            return waits("envelope", "the autopilot's handling is not told yet", "wait, or check the link");
        }
        let Envelope { cruise_m_s, brake_m_s2, latency_s, jerk_m_s3, .. } = flown;
        let jerk = jerk_m_s3.map_or_else(String::new, |jerk| format!(", {jerk} m/s³"));
        passes(
            "envelope",
            format!("{cruise_m_s} m/s, stops with {brake_m_s2:.1} m/s² after {latency_s:.2} s{jerk}"),
        )
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)] // A test fails by panicking.
mod tests {
    use skein_mav::{DIALECTS, ParameterValue};
    use skein_wire::CheckState;

    use super::*;

    /// The envelope that is flown on this make with these parameters, and whether it is known.
    fn flown(make: &str, values: &[(&str, Option<f32>)]) -> (Envelope, CheckState) {
        let dialect = DIALECTS.into_iter().find(|dialect| dialect.name() == make).unwrap();
        let mut parameters = HandlingParameters::default();
        for (name, value) in values {
            let name = (*name).to_owned();
            let event = match value {
                Some(value) => MavEvent::ParameterRead { name, value: ParameterValue::Real(*value) },
                None => MavEvent::ParameterMissing { name },
            };
            parameters.hear(&event, dialect);
        }
        let envelope = parameters.within(Envelope { brake_m_s2: 3.5, ..Envelope::default() }, dialect);
        (envelope, parameters.check(&envelope, dialect).state)
    }

    #[test]
    fn a_stock_px4_lags_and_a_sharper_one_less() {
        let (stock, state) = flown("PX4", &[("MPC_XY_VEL_P_ACC", Some(1.8)), ("MPC_ACC_HOR", Some(3.0))]);
        assert_eq!((stock.brake_m_s2, state), (2.5, CheckState::Passes));
        assert!((0.69..0.72).contains(&stock.latency_s), "{}", stock.latency_s);
        let (sharp, _) = flown("PX4", &[("MPC_XY_VEL_P_ACC", Some(4.0)), ("MPC_ACC_HOR", Some(1.5))]);
        assert!(sharp.latency_s < 0.45 && sharp.brake_m_s2 == 1.5, "{sharp:?}");
    }

    #[test]
    fn an_arducopter_takes_time_to_cease_to_accelerate() {
        let values = [("WPNAV_ACCEL", Some(100.0)), ("PSC_JERK_XY", Some(4.0))];
        let (slow, state) = flown("ArduPilot", &values);
        assert_eq!((slow.brake_m_s2, slow.jerk_m_s3, state), (1.0, Some(4.0), CheckState::Passes));
        let (stock, state) = flown("ArduPilot", &[("WPNAV_ACCEL", None), ("PSC_JERK_XY", None)]);
        assert_eq!((stock.brake_m_s2, stock.latency_s, stock.jerk_m_s3), (2.5, 0.6, Some(5.0)));
        assert_eq!(state, CheckState::Passes, "one that lacks them counts as stock");
    }

    #[test]
    fn an_autopilot_without_such_a_velocity_loop_flies_as_configured_once_that_is_known() {
        let (envelope, state) = flown("PX4", &[("MPC_XY_VEL_P_ACC", None), ("MPC_ACC_HOR", Some(5.0))]);
        assert_eq!((envelope.brake_m_s2, envelope.latency_s, state), (3.5, 0.3, CheckState::Passes));
        assert_eq!(flown("PX4", &[]).1, CheckState::Waits);
    }
}

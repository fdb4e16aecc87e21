//! Failsafes: reads the autopilot's own failsafe parameters before take-off and refuses unsafe ones.

use skein_mav::{AutopilotKind, Companion, MavEvent, ParameterValue};

/// What the autopilot must do by itself once set-points stop, and how soon.
const CHECKS: [Check; 2] = [
    Check {
        parameter: "COM_OF_LOSS_T",
        is_safe: |seconds| (0.0..=2.0).contains(&seconds),
        expected: "at most 2 s without set-points",
    },
    Check {
        parameter: "COM_OBL_RC_ACT",
        // Manual (2), terminate (6) and disarm (7) drop the vehicle when its agent dies.
        is_safe: |action| [0.0, 1.0, 3.0, 4.0, 5.0].contains(&action),
        expected: "position, altitude, return, land or hold (0, 1, 3, 4, 5)",
    },
];

struct Check {
    parameter: &'static str,
    is_safe: fn(f64) -> bool,
    expected: &'static str,
}

/// What is known of the autopilot's failsafe parameters.
#[derive(Debug, Default)]
pub struct Failsafes {
    asked: bool,
    answers: [Option<Result<(), String>>; CHECKS.len()],
}

impl Failsafes {
    /// Asks for the parameters, once the autopilot is heard.
    pub fn ask(&mut self, companion: &mut Companion) {
        if !self.asked && companion.telemetry().connected {
            self.asked = true;
            for check in &CHECKS {
                companion.read_parameter(check.parameter);
            }
        }
    }

    /// Takes in the autopilot's answers. PX4 is asked again for what it does not tell; an autopilot of another kind has
    /// other parameters.
    pub fn hear(&mut self, event: &MavEvent, autopilot: Option<AutopilotKind>) {
        let (name, value) = match event {
            MavEvent::ParameterRead { name, value } => (name, Some(*value)),
            MavEvent::ParameterMissing { name } => (name, None),
            _ => return,
        };
        let checks = CHECKS.iter().zip(&mut self.answers).filter(|(check, _)| check.parameter == name);
        for (check, answer) in checks {
            *answer = Some(match value.map(ParameterValue::as_f64) {
                Some(value) if (check.is_safe)(value) => Ok(()),
                Some(value) => Err(format!("{name} is {value}, expected {}", check.expected)),
                None if autopilot == Some(AutopilotKind::Px4) => {
                    self.asked = false;
                    Err(format!("{name} cannot be read, expected {}", check.expected))
                }
                None => Ok(()),
            });
        }
    }

    /// Whether every check has been answered, and well.
    #[must_use]
    pub fn are_sound(&self) -> bool {
        self.answers.iter().all(|answer| matches!(answer, Some(Ok(()))))
    }

    /// The unsafe parameter, if one was found.
    #[must_use]
    pub fn complaint(&self) -> Option<&str> {
        self.answers.iter().flatten().find_map(|answer| answer.as_ref().err()).map(String::as_str)
    }
}

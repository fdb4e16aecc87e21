//! Failsafes: reads the autopilot's own failsafe parameters before take-off and refuses unsafe ones.

use skein_mav::{Companion, MavEvent, ParameterValue};

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

    /// Takes in the autopilot's answers. One that lacks a parameter has another way to say it and is not refused.
    pub fn hear(&mut self, event: &MavEvent) {
        match event {
            MavEvent::ParameterRead { name, value } => self.answer(name, Some(*value)),
            MavEvent::ParameterMissing { name } => self.answer(name, None),
            _ => {}
        }
    }

    fn answer(&mut self, name: &str, value: Option<ParameterValue>) {
        for (check, answer) in CHECKS.iter().zip(&mut self.answers) {
            if check.parameter == name {
                let unsafe_value = value.map(ParameterValue::as_f64).filter(|value| !(check.is_safe)(*value));
                *answer = Some(match unsafe_value {
                    None => Ok(()),
                    Some(value) => Err(format!("{name} is {value}, expected {}", check.expected)),
                });
            }
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

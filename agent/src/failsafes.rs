//! Failsafes: reads the autopilot's own failsafe parameters before take-off and refuses unsafe ones. Its dialect lists
//! them.

use skein_mav::{Companion, Dialect, MavEvent};

/// What is known of the autopilot's failsafe parameters.
#[derive(Debug, Default)]
pub struct Failsafes {
    asked: bool,
    /// Each parameter asked for, and what was made of its value.
    answers: Vec<(&'static str, Option<Result<(), String>>)>,
}

impl Failsafes {
    /// Asks for the parameters, once the autopilot is heard.
    pub fn ask(&mut self, companion: &mut Companion) {
        if self.asked || !companion.telemetry().connected {
            return;
        }
        self.asked = true;
        let parameters = companion.dialect().failsafes().iter().map(|failsafe| failsafe.parameter);
        if self.answers.is_empty() {
            self.answers = parameters.clone().map(|parameter| (parameter, None)).collect();
        }
        parameters.for_each(|parameter| companion.read_parameter(parameter));
    }

    /// Takes in the autopilot's answers. A parameter that it must have, and does not tell, is asked for again.
    pub fn hear(&mut self, event: &MavEvent, dialect: &dyn Dialect) {
        let (name, value) = match event {
            MavEvent::ParameterRead { name, value } => (name, Some(*value)),
            MavEvent::ParameterMissing { name } => (name, None),
            _ => return,
        };
        let failsafe = dialect.failsafes().iter().find(|failsafe| failsafe.parameter == name);
        let answer = self.answers.iter_mut().find(|(parameter, _)| parameter == name);
        if let (Some(failsafe), Some((_, answer))) = (failsafe, answer) {
            let judgement = failsafe.judge(value);
            self.asked &= value.is_some() || judgement.is_ok();
            *answer = Some(judgement);
        }
    }

    /// Whether every parameter has been told, and is safe.
    #[must_use]
    pub fn are_sound(&self) -> bool {
        self.asked && self.answers.iter().all(|(_, answer)| matches!(answer, Some(Ok(()))))
    }

    /// The unsafe parameter, if one was found.
    #[must_use]
    pub fn complaint(&self) -> Option<&str> {
        self.answers.iter().find_map(|(_, answer)| answer.as_ref()?.as_ref().err()).map(String::as_str)
    }
}

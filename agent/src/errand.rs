//! An errand: what a vehicle does before it sets out for a waypoint, and how it flies there.

use std::time::Duration;

use serde::{Deserialize, Deserializer, Serialize};
use skein_bp::Event;
use skein_wire::event::{Limit, Payload};

use crate::field::number;
use crate::me::Me;

/// Slower vehicles cannot be told from stuck ones, m/s.
pub const SLOWEST_M_S: f64 = 0.3;
/// The longest stay, s.
pub const LONGEST_STAY_S: f64 = 86_400.0;

/// Before and on the way to a waypoint.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Errand {
    /// Number of the waypoint from 0; one more than the last is the landing.
    pub before: usize,
    /// The stay before it sets out, s.
    #[serde(default, deserialize_with = "stay_s", skip_serializing_if = "is_zero")]
    pub stay_s: f64,
    /// The greatest speed on the way there, m/s.
    #[serde(default, deserialize_with = "speed_m_s", skip_serializing_if = "Option::is_none")]
    pub speed_m_s: Option<f64>,
    /// Commands to what it carries, once the stay is over.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub payload: Vec<PayloadCommand>,
}

/// A MAVLink command to a camera, a servo or something else on board.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PayloadCommand {
    /// `MAV_CMD`.
    pub command: u16,
    /// Not a number where there is none.
    pub params: [f64; 7],
}

impl Errand {
    pub fn stay(&self) -> Duration {
        Duration::from_secs_f64(self.stay_s.clamp(0.0, LONGEST_STAY_S))
    }

    /// The limit that the vehicle flies under on its way.
    pub fn limit(&self, me: &Me) -> Option<Event> {
        self.speed_m_s.map(|speed| me.event(Limit { speed_m_s: Some(speed.max(SLOWEST_M_S)), ..Limit::NONE }))
    }
}

impl PayloadCommand {
    pub fn event(&self, me: &Me) -> Event {
        let [param1, param2, param3, param4, param5, param6, param7] =
            self.params.map(|param| Some(param).filter(|param| param.is_finite()));
        let command = i64::from(self.command);
        me.event(Payload { command, param1, param2, param3, param4, param5, param6, param7 })
    }
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(stay_s: &f64) -> bool {
    *stay_s == 0.0
}

fn stay_s<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    number(deserializer, "0 to 86400", |value| (0.0..=LONGEST_STAY_S).contains(&value))
}

fn speed_m_s<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    number(deserializer, "0.3 or more", |value| value >= SLOWEST_M_S).map(Some)
}

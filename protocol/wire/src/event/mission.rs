//! Where a vehicle's flight and mission stand.

use super::Text;

skein_bp::words! {
    /// How serious a line of the autopilot is (RFC 5424), the most serious first.
    pub enum Severity {
        /// The system is unusable.
        Emergency = "emergency",
        /// Act at once.
        Alert = "alert",
        /// A primary system fails.
        Critical = "critical",
        /// A secondary system fails.
        Error = "error",
        /// Possible trouble ahead.
        Warning = "warning",
        /// Unusual, not an error.
        Notice = "notice",
        Info = "info",
    }
}

skein_bp::events! {
    /// The stages of a flight, and what interrupts it.
    pub const MISSION;

    /// Preflight checks pass.
    Ready = "ready", Own;
    /// A preflight check does not pass: told when that begins, and when others do not.
    Unready = "unready", Own {
        /// The checks that do not pass, in words.
        why: Text,
    }
    /// The vehicle is in the air at its take-off height.
    Airborne = "airborne", Own;
    /// The vehicle stands on the ground, disarmed.
    Landed = "landed", Own;
    /// The autopilot has written a line. Its events, as PX4 has them, come as numbers.
    AutopilotSays = "autopilot_says", Own {
        severity: Severity,
        text: Text,
        /// How often, since it was told last.
        times: i64 ["", 1.0..=f64::INFINITY],
    }
    /// The mission is complete and the vehicle is on the ground.
    Complete = "complete", Anyone;
    /// The mission ended without reaching its goal.
    Failed = "failed", Anyone {
        why: Text,
    }
    /// A command to what the vehicle carries, as a MAVLink mission gives it: to a camera, a servo, a winch.
    Payload = "payload", Own {
        /// `MAV_CMD`.
        command: i64,
        param1: Option<f64>,
        param2: Option<f64>,
        param3: Option<f64>,
        param4: Option<f64>,
        param5: Option<f64>,
        param6: Option<f64>,
        param7: Option<f64>,
    }
    /// Somebody else flies the vehicle.
    PilotTook = "pilot", Own {
        /// The flight mode.
        mode: Text,
        /// Who: `pilot`, `autopilot: ` and its words, or `station: ` and its order.
        by: Text,
    }
    /// The agent did not run for too long for what it knew and what it had said to count.
    Slept = "slept", Own {
        seconds: f64 ["s", 0.0..=f64::INFINITY],
    }
    /// The agent started while its vehicle was in the air.
    FoundAirborne = "found_airborne", Own;
    /// The autopilot refused or never answered a command.
    CommandFailed = "command_failed", Own {
        /// The command, and the answer.
        why: Text,
    }
}

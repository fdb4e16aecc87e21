//! `MAV_CMD`: what an item of a mission asks of a multirotor.

/// The fate of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Waypoint,
    Spline,
    LoiterUnlimited,
    LoiterTurns,
    LoiterTime,
    LoiterToHeight,
    Return,
    Land,
    Takeoff,
    Delay,
    Jump,
    Speed,
    /// Something on board does it, and the vehicle flies on: it is told as an event.
    Payload,
    /// It changes nothing about the flight, for this reason.
    Harmless(&'static str),
    /// It would change the flight, and is not flown.
    Refused,
}

/// `MAV_CMD_NAV_WAYPOINT`.
pub const WAYPOINT: u64 = 16;
/// `MAV_CMD_NAV_RETURN_TO_LAUNCH`.
pub const RETURN_TO_LAUNCH: u64 = 20;
/// `MAV_CMD_NAV_LAND`.
pub const LAND: u64 = 21;
/// `MAV_CMD_NAV_TAKEOFF`.
pub const TAKEOFF: u64 = 22;
/// `MAV_CMD_NAV_DELAY`.
pub const DELAY: u64 = 93;
/// `MAV_CMD_DO_CHANGE_SPEED`.
pub const CHANGE_SPEED: u64 = 178;

/// Numbers, names and kinds.
const COMMANDS: &[(u16, &str, Kind)] = &[
    (16, "waypoint", Kind::Waypoint),
    (17, "unlimited loiter", Kind::LoiterUnlimited),
    (18, "loiter turns", Kind::LoiterTurns),
    (19, "loiter time", Kind::LoiterTime),
    (20, "return to launch", Kind::Return),
    (21, "landing", Kind::Land),
    (22, "take-off", Kind::Takeoff),
    (31, "loiter to altitude", Kind::LoiterToHeight),
    (34, "orbit", Kind::Refused),
    (80, "region of interest", Kind::Payload),
    (82, "spline waypoint", Kind::Spline),
    (84, "VTOL take-off", Kind::Takeoff),
    (85, "VTOL landing", Kind::Land),
    (92, "guided mode", Kind::Refused),
    (93, "delay", Kind::Delay),
    (94, "payload placement", Kind::Refused),
    (112, "delay of a condition", Kind::Harmless("it delays what does not move the vehicle")),
    (113, "change of altitude", Kind::Refused),
    (114, "distance condition", Kind::Harmless("it delays what does not move the vehicle")),
    (115, "yaw", Kind::Harmless("the nose points where the vehicle's planners say")),
    (176, "mode", Kind::Refused),
    (177, "jump", Kind::Jump),
    (178, "change of speed", Kind::Speed),
    (179, "home", Kind::Refused),
    (181, "relay", Kind::Payload),
    (182, "repeated relay", Kind::Payload),
    (183, "servo", Kind::Payload),
    (184, "repeated servo", Kind::Payload),
    (185, "flight termination", Kind::Refused),
    (189, "start of the landing", Kind::Harmless("it marks a place in the list")),
    (191, "go-around", Kind::Refused),
    (192, "reposition", Kind::Refused),
    (193, "pause", Kind::Refused),
    (194, "reverse", Kind::Refused),
    (195, "region of interest", Kind::Payload),
    (196, "region of interest", Kind::Payload),
    (197, "no region of interest", Kind::Payload),
    (200, "camera control", Kind::Payload),
    (201, "region of interest", Kind::Payload),
    (202, "camera configuration", Kind::Payload),
    (203, "camera control", Kind::Payload),
    (204, "mount configuration", Kind::Payload),
    (205, "mount control", Kind::Payload),
    (206, "camera trigger distance", Kind::Payload),
    (207, "fence switch", Kind::Harmless("a fence holds from take-off to landing")),
    (208, "parachute", Kind::Refused),
    (209, "motor test", Kind::Refused),
    (210, "inverted flight", Kind::Refused),
    (211, "gripper", Kind::Payload),
    (212, "autotune", Kind::Refused),
    (214, "camera trigger interval", Kind::Payload),
    (216, "sprayer", Kind::Payload),
    (220, "mount control", Kind::Payload),
    (221, "guided master", Kind::Refused),
    (222, "guided limits", Kind::Refused),
    (223, "engine control", Kind::Refused),
    (300, "mission start", Kind::Refused),
    (400, "arming", Kind::Refused),
    (530, "camera mode", Kind::Payload),
    (531, "camera zoom", Kind::Payload),
    (532, "camera focus", Kind::Payload),
    (533, "storage", Kind::Payload),
    (534, "camera source", Kind::Payload),
    (600, "jump tag", Kind::Refused),
    (601, "jump to a tag", Kind::Refused),
    (1000, "gimbal", Kind::Payload),
    (1001, "gimbal control", Kind::Payload),
    (2000, "image capture", Kind::Payload),
    (2001, "end of image capture", Kind::Payload),
    (2003, "camera trigger", Kind::Payload),
    (2004, "camera track", Kind::Payload),
    (2500, "video capture", Kind::Payload),
    (2501, "end of video capture", Kind::Payload),
    (3000, "VTOL transition", Kind::Harmless("a multirotor has one way of flying")),
    (5000, "fence return point", Kind::Refused),
    (5001, "fence corner to stay inside of", Kind::Refused),
    (5002, "fence corner to stay out of", Kind::Refused),
    (5003, "fence circle to stay inside of", Kind::Refused),
    (5004, "fence circle to stay out of", Kind::Refused),
    (5100, "rally point", Kind::Refused),
    (42600, "winch", Kind::Payload),
];

/// The name and kind of a command that is known.
pub fn of(command: u64) -> Option<(&'static str, Kind)> {
    let known = COMMANDS.iter().find(|(number, ..)| u64::from(*number) == command);
    known.map(|(_, name, kind)| (*name, *kind))
}

/// The number with its name.
pub fn in_words(command: u64) -> String {
    of(command).map_or_else(|| command.to_string(), |(name, _)| format!("{command} {name}"))
}

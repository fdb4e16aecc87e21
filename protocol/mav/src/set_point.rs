//! Set-points: what a companion asks the autopilot to fly, many times a second.

use mavlink::dialects::common::{
    MavFrame, PositionTargetTypemask as Mask, SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use nalgebra::Vector3;

use crate::axes;
use crate::geodesy::LocalFrame;

/// A wish, in the world's ENU frame. `yaw` is counter-clockwise from east, radians; `None` leaves the heading
/// alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SetPoint {
    /// Velocity in three axes.
    Velocity {
        /// In m/s.
        velocity: Vector3<f64>,
        /// Heading, rad.
        yaw: Option<f64>,
    },
    /// Planar flight: velocity in x and y with position in z, in one set-point (P2, offboard control).
    Planar {
        /// Velocity east, m/s.
        vx: f64,
        /// Velocity north, m/s.
        vy: f64,
        /// Height above the world's datum, m.
        z: f64,
        /// Heading, rad.
        yaw: Option<f64>,
    },
    Position {
        /// In m.
        position: Vector3<f64>,
        /// Heading, rad.
        yaw: Option<f64>,
    },
}

impl SetPoint {
    /// Heading asked for, rad.
    pub fn yaw(&self) -> Option<f64> {
        match self {
            Self::Velocity { yaw, .. } | Self::Planar { yaw, .. } | Self::Position { yaw, .. } => *yaw,
        }
    }

    /// Whether every number is finite. A live NaN stops a vehicle in flight.
    pub fn is_finite(&self) -> bool {
        let numbers = match self {
            Self::Velocity { velocity, .. } => *velocity,
            Self::Planar { vx, vy, z, .. } => Vector3::new(*vx, *vy, *z),
            Self::Position { position, .. } => *position,
        };
        numbers.iter().all(|number| number.is_finite()) && self.yaw().is_none_or(f64::is_finite)
    }

    /// Encodes the set-point for the autopilot of `target_system`. Positions need its local frame: `None`
    /// without.
    pub(crate) fn encode(
        &self,
        target_system: u8,
        local: Option<&LocalFrame>,
        time_boot_ms: u32,
    ) -> Option<SET_POSITION_TARGET_LOCAL_NED_DATA> {
        let mut mask = ignore_acceleration() | Mask::POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE;
        let mut position = Vector3::zeros();
        let mut velocity = Vector3::zeros();
        match self {
            Self::Velocity { velocity: wish, .. } => {
                mask |= ignore_position();
                velocity = axes::enu_to_ned(wish);
            }
            Self::Planar { vx, vy, z, .. } => {
                mask |= Mask::POSITION_TARGET_TYPEMASK_X_IGNORE
                    | Mask::POSITION_TARGET_TYPEMASK_Y_IGNORE
                    | Mask::POSITION_TARGET_TYPEMASK_VZ_IGNORE;
                velocity = axes::enu_to_ned(&Vector3::new(*vx, *vy, 0.0));
                position = local?.position_to_local(&Vector3::new(0.0, 0.0, *z));
            }
            Self::Position { position: wish, .. } => {
                mask |= ignore_velocity();
                position = local?.position_to_local(wish);
            }
        }
        let yaw = self.yaw().map(axes::swap_yaw);
        if yaw.is_none() {
            mask |= Mask::POSITION_TARGET_TYPEMASK_YAW_IGNORE;
        }
        Some(SET_POSITION_TARGET_LOCAL_NED_DATA {
            time_boot_ms,
            target_system,
            target_component: 1,
            coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
            type_mask: mask,
            x: position.x as f32,
            y: position.y as f32,
            z: position.z as f32,
            vx: velocity.x as f32,
            vy: velocity.y as f32,
            vz: velocity.z as f32,
            yaw: yaw.unwrap_or(0.0) as f32,
            ..Default::default()
        })
    }

    /// Decodes a message at the autopilot's end. `None` for a frame or a choice of axes that is not one of
    /// the three kinds, or a number that is not finite: the autopilot then flies on without it.
    pub(crate) fn decode(message: &SET_POSITION_TARGET_LOCAL_NED_DATA, local: &LocalFrame) -> Option<Self> {
        if message.coordinate_frame != MavFrame::MAV_FRAME_LOCAL_NED
            || !message.type_mask.contains(ignore_acceleration())
        {
            return None;
        }
        let mask = message.type_mask;
        let yaw = (!mask.contains(Mask::POSITION_TARGET_TYPEMASK_YAW_IGNORE))
            .then(|| axes::swap_yaw(f64::from(message.yaw)));
        let position = local.position_to_world(&axes::vector(message.x, message.y, message.z));
        let velocity = axes::ned_to_enu(&axes::vector(message.vx, message.vy, message.vz));
        let position_mask = mask & ignore_position();
        let velocity_mask = mask & ignore_velocity();
        let planar_position =
            Mask::POSITION_TARGET_TYPEMASK_X_IGNORE | Mask::POSITION_TARGET_TYPEMASK_Y_IGNORE;
        let set_point = if position_mask.is_empty() {
            Self::Position { position, yaw }
        } else if position_mask == ignore_position() && velocity_mask.is_empty() {
            Self::Velocity { velocity, yaw }
        } else if position_mask == planar_position
            && (velocity_mask - Mask::POSITION_TARGET_TYPEMASK_VZ_IGNORE).is_empty()
        {
            Self::Planar { vx: velocity.x, vy: velocity.y, z: position.z, yaw }
        } else {
            return None;
        };
        set_point.is_finite().then_some(set_point)
    }
}

fn ignore_position() -> Mask {
    Mask::POSITION_TARGET_TYPEMASK_X_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_Y_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_Z_IGNORE
}

fn ignore_velocity() -> Mask {
    Mask::POSITION_TARGET_TYPEMASK_VX_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_VY_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_VZ_IGNORE
}

fn ignore_acceleration() -> Mask {
    Mask::POSITION_TARGET_TYPEMASK_AX_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_AY_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_AZ_IGNORE
}

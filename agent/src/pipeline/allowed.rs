//! The motion that is allowed: the limits of the vehicle's b-threads, as the pipeline keeps them.

use nalgebra::Vector3;
use skein_planning::Region;
use skein_planning::local::apf;
use skein_planning::local::braking::stopping_speed;
use skein_wire::Limits;

use crate::config::Envelope;

/// Kept from the sides of the region where there is room for it, so that nothing sways across them, m.
const INSET_M: f64 = 0.2;
/// Speed at which a vehicle goes back into the region, at most, m/s.
const BACK_M_S: f64 = 0.5;
/// Limits that leave less than this above home do not keep a vehicle from taking off, m.
const LEAST_CLIMB_M: f64 = 1.0;

/// The motion allowed to a vehicle while nothing more important moves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowed {
    /// Greatest speed, m/s.
    pub speed_m_s: f64,
    /// Where to fly, ENU.
    pub region: Region,
    /// Nowhere: the limits contradict one another.
    pub nowhere: bool,
}

/// The velocity wanted before others are considered (ENU, m/s), and the height it leads to (m).
#[derive(Clone, Copy, Debug)]
pub(super) struct Wish {
    pub(super) velocity: Vector3<f64>,
    pub(super) height_m: f64,
}

impl Allowed {
    /// Without limits.
    pub const ANYTHING: Self = Self { speed_m_s: f64::INFINITY, region: Region::EVERYWHERE, nowhere: false };

    /// The height above home to take off to, where `wanted_m` is.
    pub fn takeoff_height_m(&self, wanted_m: f64, home_z_m: f64) -> f64 {
        wanted_m.min((self.inset().max.z - home_z_m).max(LEAST_CLIMB_M))
    }

    /// A wish of a vehicle at `position`, as far as it is allowed.
    pub(super) fn part_of(&self, wish: Wish, position: &Vector3<f64>, envelope: &Envelope) -> Wish {
        if *self == Self::ANYTHING {
            return wish;
        }
        let Wish { mut velocity, height_m } = wish;
        let region = self.inset();
        let allowed_m = region.clamp_height(&Vector3::new(0.0, 0.0, height_m)).z;
        let is_beyond = region.clamp_height(position) != *position;
        if allowed_m != height_m || is_beyond {
            velocity.z = allowed_m - position.z;
        }
        for axis in 0..2 {
            let up = outward(region.max[axis] - position[axis], envelope);
            let down = outward(position[axis] - region.min[axis], envelope);
            velocity[axis] = velocity[axis].min(up).max(-down);
        }
        let level = apf::limited(velocity.xy().push(0.0), self.speed_m_s);
        velocity.z = velocity.z.clamp(-self.speed_m_s, self.speed_m_s);
        Wish { velocity: level.xy().push(velocity.z), height_m: allowed_m }
    }

    fn inset(&self) -> Region {
        let Region { min, max } = self.region;
        let inset = ((max - min) / 2.0).map(|half| half.clamp(0.0, INSET_M));
        Region { min: min + inset, max: max - inset }
    }
}

impl From<&Limits> for Allowed {
    fn from(limits: &Limits) -> Self {
        if limits.contradiction().is_some() {
            return Self { nowhere: true, ..Self::ANYTHING };
        }
        let (min, max) = limits.region();
        Self {
            speed_m_s: limits.speed_m_s(),
            region: Region { min: min.into(), max: max.into() },
            nowhere: false,
        }
    }
}

/// The greatest speed towards a side that is so far away, m/s; negative beyond it.
fn outward(room_m: f64, envelope: &Envelope) -> f64 {
    if room_m < 0.0 {
        room_m.max(-BACK_M_S)
    } else {
        stopping_speed(room_m, envelope.brake_m_s2, envelope.latency_s)
    }
}

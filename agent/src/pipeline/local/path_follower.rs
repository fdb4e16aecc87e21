//! The seam of local planners.

use nalgebra::Vector3;
use skein_planning::{
    Path,
    airspace::KeepOut,
    local::{braking::BrakingConfig, vfh::Step},
    map::ClearanceMap,
};

use crate::config::Envelope;

/// The set-point loop's period.
pub const TICK_S: f64 = 0.02;

/// A place on a path, and the vehicle near it.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    pub path: &'a Path,
    /// The vehicle's place along the path at the last call, m.
    pub station_m: f64,
    /// Where the vehicle is, m ENU.
    pub position: &'a Vector3<f64>,
}

/// Turns a path into the velocity to fly now.
pub trait PathFollower: std::fmt::Debug + Send {
    /// The braking and acceleration under this planner.
    fn braking(&self) -> &BrakingConfig;

    /// The vehicle is of this envelope from now on.
    fn handle(&mut self, envelope: &Envelope);

    /// The velocity that follows the path, no faster than `cap_m_s`. `attraction` is 1, and less while a local
    /// minimum is escaped from.
    fn follow(&mut self, place: &Place<'_>, cap_m_s: f64, attraction: f64, map: &ClearanceMap) -> Step;

    /// Takes in the obstacle points of a scan of `rays` rays that was taken at `origin`, and what is closed; metres
    /// ENU.
    fn look(
        &mut self,
        origin: &Vector3<f64>,
        returns: &[Vector3<f64>],
        rays: usize,
        closed: Option<&KeepOut>,
    ) {
        let _ = (origin, returns, rays, closed);
    }

    /// The set-point on its way to `wanted`, for a planner that flies gently.
    fn ease(&self, wanted: Vector3<f64>) -> Vector3<f64> {
        wanted
    }

    /// Hears which set-point was sent in the end.
    fn flew(&mut self, set_point: &Vector3<f64>) {
        let _ = set_point;
    }

    /// There is no path to be followed now.
    fn pause(&mut self) {}

    /// Somebody else moves the vehicle, or nobody.
    fn rest(&mut self) {
        self.pause();
    }
}

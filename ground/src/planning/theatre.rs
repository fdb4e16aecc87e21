//! The air that is planned for.

use nalgebra::Vector3;
use skein_planning::airspace::Airspace;
use skein_swarm::route::{Craft, UnfitCraft};

/// The air that is planned for: its box, terrain, threats and zones, and the vehicles in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Theatre {
    pub airspace: Airspace,
    pub craft: Craft,
}

/// Why no plan can be made for vehicles or an airspace.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnfitTheatre {
    #[error(transparent)]
    Craft(#[from] UnfitCraft),
    #[error(
        "`min_m` and `max_m` are no box: expected finite numbers, and each of `max_m` above that of `min_m`"
    )]
    Box,
}

impl Theatre {
    /// The obstacles of `airspace` in a box (ENU, metres).
    ///
    /// # Errors
    /// The box is none, or a number of `craft` is not what it must be.
    pub fn new(
        airspace: Airspace,
        (lower, upper): (Vector3<f64>, Vector3<f64>),
        craft: Craft,
    ) -> Result<Self, UnfitTheatre> {
        craft.check()?;
        let is_box =
            (0..3).all(|axis| lower[axis] < upper[axis]) && (upper - lower).iter().all(|m| m.is_finite());
        if !is_box {
            return Err(UnfitTheatre::Box);
        }
        Ok(Self { airspace: Airspace { lower, upper, ..airspace }, craft })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_plan_can_be_made_for_is_named() {
        let space = (Vector3::zeros(), Vector3::repeat(9.0));
        assert!(Theatre::new(Airspace::default(), space, Craft::default()).is_ok());
        let craft = Craft { climb_m_s: 0.0, ..Craft::default() };
        let wrong = Theatre::new(Airspace::default(), space, craft).unwrap_err().to_string();
        assert!(wrong.contains("`climb_m_s` is 0"), "{wrong}");
        let flat = (Vector3::zeros(), Vector3::new(9.0, 9.0, 0.0));
        assert_eq!(Theatre::new(Airspace::default(), flat, Craft::default()), Err(UnfitTheatre::Box));
    }
}

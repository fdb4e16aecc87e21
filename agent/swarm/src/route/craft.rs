//! The abilities of a vehicle, and the distances that its routes keep.

use serde::{Deserialize, Serialize};

use super::weights::RouteCost;

/// Routes keep vehicles so many times as far apart as their safety filters do.
const APART: f64 = 1.8;
/// Routes keep as far from zones as a vehicle flies in this time at cruise, s, and from the ground in that one.
const STRAY_S: f64 = 0.3;
const CLEARANCE_S: f64 = 1.5;
/// Share of the height of take-off at which routes may begin.
const BEGINS_AT: f64 = 0.7;

/// The abilities of a fleet's vehicles, and the distances that a plan keeps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Craft {
    /// Speed of cruise, m/s.
    pub cruise_m_s: f64,
    /// Rate of climb and descent, m/s.
    pub climb_m_s: f64,
    /// Time that a vehicle flies on a full battery, s; 0 if that is not known: then no plan minds the battery.
    pub endurance_s: f64,
    /// Distance between vehicles under way, centre to centre, m.
    pub separation_m: f64,
    /// Distance between vehicles that arrive at one target, m.
    pub spacing_m: f64,
    /// Height above the ground, m.
    pub clearance_m: f64,
    /// Distance from zones, m.
    pub margin_m: f64,
    /// All that is in the battery costs as much as this share of the way that it lasts for.
    pub energy_weight: f64,
    /// A turn by a right angle costs so many times the distance that vehicles keep.
    pub turn_weight: f64,
}

/// A number of a [`Craft`] is not what it must be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{field}` is {value}: expected {expected}")]
pub struct UnfitCraft {
    field: &'static str,
    value: f64,
    expected: &'static str,
}

impl Default for Craft {
    /// A small quadrotor.
    fn default() -> Self {
        Self {
            cruise_m_s: 3.0,
            climb_m_s: 1.5,
            endurance_s: 0.0,
            separation_m: 2.5,
            spacing_m: 5.0,
            clearance_m: 2.0,
            margin_m: 1.5,
            energy_weight: 0.1,
            turn_weight: 0.5,
        }
    }
}

impl Craft {
    /// One with a hull of this radius that takes off to this height, and whose safety filter keeps `separation_m` from
    /// others: metres, m/s, s.
    pub fn of_body(
        (cruise_m_s, climb_m_s): (f64, f64),
        endurance_s: f64,
        separation_m: f64,
        hull_m: f64,
        takeoff_m: f64,
    ) -> Self {
        let separation_m = APART * separation_m;
        Self {
            cruise_m_s,
            climb_m_s,
            endurance_s,
            separation_m,
            spacing_m: 2.0 * separation_m,
            clearance_m: (BEGINS_AT * takeoff_m).min(CLEARANCE_S * cruise_m_s),
            margin_m: hull_m + STRAY_S * cruise_m_s,
            ..Self::default()
        }
    }

    /// The height that vehicles take off to, metres, as far as the clearance tells: of vehicles whose cruise limits it, less.
    pub fn takeoff_m(&self) -> f64 {
        self.clearance_m / BEGINS_AT
    }

    /// The weights of a route's cost for a vehicle with this share of its battery left.
    pub fn cost(&self, battery: f64) -> RouteCost {
        let scaled = RouteCost::scaled(self.cruise_m_s, self.climb_m_s, self.separation_m, self.clearance_m);
        let left_s = if self.endurance_s > 0.0 { self.endurance_s * battery } else { f64::INFINITY };
        let energy_weight_m =
            if left_s.is_finite() { self.energy_weight * left_s * self.cruise_m_s } else { 0.0 };
        RouteCost {
            endurance_s: left_s,
            energy_weight_m,
            smoothness_weight_m: self.turn_weight * self.separation_m,
            border_m: self.margin_m,
            ..scaled
        }
    }

    /// # Errors
    /// [`UnfitCraft`].
    pub fn check(&self) -> Result<(), UnfitCraft> {
        let above = [
            ("cruise_m_s", self.cruise_m_s),
            ("climb_m_s", self.climb_m_s),
            ("separation_m", self.separation_m),
            ("spacing_m", self.spacing_m),
            ("clearance_m", self.clearance_m),
        ];
        let not_below = [
            ("endurance_s", self.endurance_s),
            ("margin_m", self.margin_m),
            ("energy_weight", self.energy_weight),
            ("turn_weight", self.turn_weight),
        ];
        let unfit = |expected, is_fit: fn(f64) -> bool| {
            move |(field, value): &(&'static str, f64)| {
                (!is_fit(*value)).then_some(UnfitCraft { field, value: *value, expected })
            }
        };
        let wrong =
            above.iter().find_map(unfit("a number above 0", |value| value > 0.0 && value.is_finite()));
        let wrong = wrong.or_else(|| {
            not_below
                .iter()
                .find_map(unfit("a number not below 0", |value| value >= 0.0 && value.is_finite()))
        });
        wrong.map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_route_can_be_made_for_is_named() {
        assert_eq!(Craft::default().check(), Ok(()));
        let wrong = Craft { climb_m_s: 0.0, ..Craft::default() }.check().unwrap_err().to_string();
        assert_eq!(wrong, "`climb_m_s` is 0: expected a number above 0");
        let wrong = Craft { margin_m: -1.0, ..Craft::default() }.check().unwrap_err().to_string();
        assert!(wrong.contains("`margin_m` is -1"), "{wrong}");
    }

    #[test]
    fn a_battery_that_is_half_full_lasts_half_as_long_and_one_that_nobody_knows_for_ever() {
        let craft = Craft { endurance_s: 600.0, ..Craft::default() };
        assert_eq!(craft.cost(0.5).endurance_s, 300.0);
        let unknown = Craft::default().cost(0.0);
        assert!(unknown.endurance_s.is_infinite() && unknown.energy_weight_m == 0.0);
    }
}

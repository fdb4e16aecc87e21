//! What is drawn on the map for vehicles.

use super::Text;

skein_bp::words! {
    /// What a zone is.
    pub enum ZoneKind {
        /// Nobody flies in it.
        NoFly = "no_fly",
        /// Nobody flies outside of it.
        StayInside = "stay_inside",
        /// A place that is seen or shot at from the ground: a hemisphere. Nobody flies in it.
        Threat = "threat",
        /// Nobody flies higher over it.
        NotAbove = "not_above",
        /// Nobody flies lower over it, but to take off and to land.
        NotBelow = "not_below",
        /// A vehicle that returns may land there.
        Rally = "rally",
    }
}

// A table that is filled in begins with one.
#[allow(clippy::derivable_impls)]
impl Default for ZoneKind {
    fn default() -> Self {
        Self::NoFly
    }
}

skein_bp::words! {
    /// What has become of a zone at a vehicle.
    pub enum ZoneState {
        /// The vehicle has regard for it from now on.
        Regarded = "regarded",
        /// It does not any more: whoever has drawn it has removed it.
        Removed = "removed",
        /// The vehicle is in it, and leaves.
        Inside = "inside",
        /// It has left it.
        Outside = "outside",
    }
}

skein_bp::events! {
    /// The airspace as it is drawn.
    pub const AIRSPACE;

    /// Fly without regard to something that is drawn on the map. Nobody requests it: whoever draws a zone blocks it, and
    /// while that holds the vehicle has regard for the zone. Its way down and home stay free.
    Disregard = "disregard", Anyone {
        /// The zone, as JSON.
        zone: Text,
    }
    /// News of a zone.
    ZoneNews = "zone", Own {
        name: Text,
        state: ZoneState,
        /// Whose zone it is, such as `ground/main`, if that is news.
        of: Option<Text>,
    }
}

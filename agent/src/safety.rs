//! The events that are for a vehicle's safety.

use skein_bp::EventSet;
use skein_wire::event::{Catalogue, Goto};

use crate::bthreads::HOME_LEG;
use crate::me::Me;

/// What no remote b-thread can block, and only the operator's gateway can request; the waypoint at home is part of
/// it, for without it `return` would lead nowhere.
pub(crate) fn safety_events(me: &Me, events: &Catalogue) -> EventSet {
    me.any_in(events.own()).or(me.any::<Goto>().and(Goto::leg(HOME_LEG)))
}

#[cfg(test)]
mod tests {
    use skein_wire::event::Homeward;

    use super::*;
    use crate::bthreads::OPERATOR_LEG;

    #[test]
    fn from_afar_nobody_blocks_the_way_home_and_anybody_with_a_say_any_other() {
        let me = Me::new("uav/1");
        let goto = |leg: i64| me.event(Goto { leg, lands: true, x: 0.0, y: 0.0, z: 2.0 });
        let safety = safety_events(&me, &Catalogue::standard());
        assert!(safety.contains(&goto(HOME_LEG)) && safety.contains(&me.event(Homeward)));
        assert!(!safety.contains(&goto(OPERATOR_LEG)) && !safety.contains(&goto(0)));
    }
}

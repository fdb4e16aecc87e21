//! The events that a vehicle's safety hangs on.

use skein_bp::EventSet;
use skein_wire::vocabulary::{GOTO, OWN};

use crate::bthreads::HOME_LEG;
use crate::me::Me;

/// What no remote b-thread can block, and only the operator's gateway can request; the waypoint at home is part of
/// it, for without it `return` would lead nowhere.
pub(crate) fn safety_events(me: &Me) -> EventSet {
    let home = me.any(GOTO).and(EventSet::field_is("leg", HOME_LEG));
    me.any_of(&OWN).or(home)
}

#[cfg(test)]
mod tests {
    use skein_wire::vocabulary::HOMEWARD;

    use super::*;
    use crate::bthreads::OPERATOR_LEG;

    #[test]
    fn from_afar_nobody_blocks_the_way_home_and_anybody_with_a_say_any_other() {
        let me = Me::new("uav/1");
        let goto = |leg: i64| me.event(GOTO).with("leg", leg);
        let safety = safety_events(&me);
        assert!(safety.contains(&goto(HOME_LEG)) && safety.contains(&me.event(HOMEWARD)));
        assert!(!safety.contains(&goto(OPERATOR_LEG)) && !safety.contains(&goto(0)));
    }
}

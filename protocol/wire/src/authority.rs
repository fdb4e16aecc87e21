//! The rights that a fleet grants unless it is configured otherwise.

use skein_bp::EventSet;
use skein_dbp::{Authority, Grant, Lift, NewRoster, NodeName, Role, Roster};

use crate::event::{
    Abort, Advance, Disregard, Enter, Events as _, Goto, Handover, Launch, Load, OrderTaken, SWARM, Takeoff,
    Unload, of_every_vehicle,
};

/// First chunk of a vehicle's name.
const VEHICLE: &str = "uav";

/// The roster of the first term: the ground station, which coordinates, and the vehicles of the fleet.
pub fn joint_roster<'a>(ground: NodeName, fleet: impl IntoIterator<Item = &'a NodeName>) -> Roster {
    let vehicles = fleet.into_iter().filter(|node| node.kind() == VEHICLE).cloned();
    Roster::first(ground, vehicles)
}

/// Ground stations and operators' scripts order and hold vehicles, draw zones, change the roster and lift blocks. Ground stations
/// alone launch, for a launch takes two messages there. Vehicles
/// claim passages from one another, keep a joint launch back until they are ready, and may call one off.
pub fn standard_authority() -> Authority {
    let joint = || EventSet::from(format!("{SWARM}/**"));
    let orders = |of_vehicle: EventSet| of_vehicle.or(NewRoster::any_of("*/*")).or(Lift::any_of("*/*"));
    let station = Grant {
        request: orders(of_every_vehicle::<(Takeoff, OrderTaken, Handover, Load, Unload)>()).or(joint()),
        block: of_every_vehicle::<(Takeoff, Goto, Advance, Disregard)>().or(Enter::any_of("*/*")).or(joint()),
    };
    let operator = Grant {
        request: orders(of_every_vehicle::<(OrderTaken, Handover, Load, Unload)>()).or(Abort::any_of(SWARM)),
        ..station.clone()
    };
    let vehicle = Grant {
        request: Abort::any_of(SWARM),
        // Whoever claims a passage asks the ground station too.
        block: Enter::any_of("*/*").or(Launch::any_of(SWARM)),
    };
    let role = |name: &str, nodes: &[&str], grant: &Grant| Role {
        name: name.to_owned(),
        nodes: nodes.iter().map(|pattern| (*pattern).into()).collect(),
        grant: grant.clone(),
    };
    let roles = vec![
        role("ground", &["ground/*"], &station),
        role("operator", &["operator/*", "script/*"], &operator),
        role("vehicle", &["uav/*"], &vehicle),
    ];
    Authority::new(roles, None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::{Declared as _, What};

    #[test]
    fn vehicles_may_claim_passages_and_not_hold_one_another() {
        let authority = standard_authority();
        let vehicle = NodeName::new("uav/2").unwrap();
        let claim = EventSet::any_of(["uav/1/enter", "uav/30/enter", "ground/main/enter"])
            .and(EventSet::region([0.0; 3], [6.0; 3]));
        assert!(authority.may_block(&vehicle, "right_of_way", &claim));
        assert!(!authority.may_block(&vehicle, "right_of_way", &of_every_vehicle::<Advance>()));
        assert!(!authority.may_request(&vehicle, "x", &OrderTaken::plain(What::Land, "x").at("uav/1")));
        assert!(authority.may_request(&vehicle, "x", &"swarm/abort".into()));
        let script = NodeName::new("script/operator").unwrap();
        assert!(authority.may_request(&script, "x", &OrderTaken::plain(What::Land, "x").at("uav/1")));
        assert!(!authority.may_request(&script, "x", &Takeoff.at("uav/1")), "a launch takes two messages");
        assert!(!authority.may_request(&script, "x", &Launch.at(SWARM)));
        let stranger = NodeName::new("camera/1").unwrap();
        assert!(!authority.may_block(&stranger, "x", &claim));
    }
}

//! The clock on the wall, over real Zenoh sessions.

use skein_sim::cli::Clock;
use skein_tests::{flight, fly};

#[test]
fn a_swarm_flies_in_real_time_over_zenoh_from_fresh_inputs_only() {
    let _turn = crate::turn::turn();
    let mut flight = flight("open", 1);
    flight.clock = Clock::Real;
    flight.speed = 2.0;
    let summary = fly(flight);
    assert_eq!(summary.reason, None);
    assert!(summary.events.remote > 0 && summary.network.messages > 0);
    for vehicle in &summary.per_vehicle {
        assert!(vehicle.oldest_input_ms <= 200.0, "{}: {} ms", vehicle.id, vehicle.oldest_input_ms);
    }
}

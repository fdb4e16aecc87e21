//! The swarm as processes over real Zenoh, and what a fault does to it. `skein-lab campaign processes` runs these at
//! more moments, and all the others.

use skein_lab::campaign::processes::trial::{Fault, run};
use skein_sim::cli::Network;

/// Each test has network ports of its own.
fn try_out(fault: Fault, port_offset: u16, network: Network) {
    let folder = tempfile::tempdir().unwrap();
    let trial = run(fault, 1, folder.path(), port_offset, network).unwrap();
    if !trial.violations.is_empty() {
        let logs = folder.path().join("logs");
        for log in std::fs::read_dir(logs).unwrap() {
            let path = log.unwrap().path();
            println!("--- {}\n{}", path.display(), std::fs::read_to_string(&path).unwrap_or_default());
        }
        panic!("{fault:?} at {:.1} s: {:?}", trial.at_s, trial.violations);
    }
}

#[test]
fn without_its_ground_station_every_vehicle_finishes_and_the_recording_is_readable() {
    let _turn = crate::turn::turn();
    try_out(Fault::GroundKilled, 4000, Network::Peer);
}

#[test]
fn a_vehicle_that_is_cut_off_from_the_router_shares_the_window_with_nobody_and_comes_back() {
    let _turn = crate::turn::turn();
    try_out(Fault::NodeCut, 4600, Network::Router);
}

//! A fleet of processes with certificates.

use std::path::Path;
use std::time::{Duration, Instant};

use skein_sim::autopilots::Autopilots;
use skein_sim::cli::{Network, Setup};
use skein_sim::processes::Processes;
use skein_sim::scenario::{Overrides, Scenario};
use skein_wire::NodeName;

use crate::logs::Logs;

/// Lets the world go on until something is so.
fn await_that(what: &str, processes: &mut Processes, mut done: impl FnMut(&mut Processes) -> bool) {
    let start = Instant::now();
    while !done(processes) {
        assert!(start.elapsed() < Duration::from_secs(180), "waited in vain until {what}");
        processes.step();
    }
}

fn holds(log: &Path, words: &str) -> bool {
    std::fs::read_to_string(log).is_ok_and(|log| log.contains(words))
}

#[test]
fn who_starts_with_anothers_certificate_is_refused_and_with_its_own_the_fleet_flies_over_tls() {
    let _turn = crate::turn::turn();
    let folder = tempfile::tempdir().unwrap();
    let _logs = Logs::of(folder.path());
    let overrides = Overrides { vehicles: Some(2), ..Overrides::default() };
    let scenario = Scenario::open("open", &overrides, 1).unwrap();
    let setup = Setup { network: Network::Peer, launch_on_order: false, secure: true, port_offset: 5200 };
    let mut processes = Processes::prepare(&scenario, folder.path(), setup, &Autopilots::default()).unwrap();
    let [ground, one, two] = ["ground/main", "uav/1", "uav/2"].map(|node| NodeName::new(node).unwrap());
    processes.start_node(&ground).unwrap();
    processes.start_node(&one).unwrap();

    let config = folder.path().join("uav-2.toml");
    let own = std::fs::read_to_string(&config).unwrap();
    let stolen = own.replace("certificates/uav-2.", "certificates/uav-1.");
    assert_ne!(stolen, own);
    std::fs::write(&config, stolen).unwrap();
    processes.start_node(&two).unwrap();
    await_that("a process ends by itself", &mut processes, |processes| processes.ended().is_some());
    let refused = processes.ended();
    assert!(refused.as_ref().is_some_and(|ended| ended.starts_with("uav/2")), "{refused:?}");
    let log = processes.log_of(&two);
    assert!(holds(&log, "is the certificate of uav/1, and this node is uav/2"), "{}", log.display());

    std::fs::write(&config, own).unwrap();
    processes.start_node(&two).unwrap();
    // Whoever takes off has heard the ground station's order. Where the computer is slow, a vehicle may call that off.
    for vehicle in [one, two] {
        await_that(&format!("{vehicle} is told to take off"), &mut processes, |processes| {
            holds(&processes.log_of(&vehicle), &format!("{vehicle}/takeoff"))
        });
    }
    await_that("the mission is over", &mut processes, |processes| {
        holds(&processes.log_of(&ground), "mission over")
    });
    let has_flown = |index| {
        let vehicle = processes.world().simulation().vehicle(index);
        vehicle.is_some_and(|vehicle| !vehicle.flight_time.is_zero())
    };
    assert!(has_flown(0) || has_flown(1), "nobody has flown");
    assert_eq!(processes.ended(), None);
    processes.end();
}

//! The swarm as processes over real Zenoh, and what a fault does to it. `skein-lab campaign processes` runs these at
//! more moments, and all the others.

use std::time::{Duration, Instant};

use skein_lab::bench::hold::{DiskFault, Holds, Measured, Swarm};
use skein_lab::campaign::processes::trial::{Fault, run};
use skein_sim::autopilots::Autopilots;
use skein_sim::cli::{Network, Setup};
use skein_sim::processes::{Processes, Programs};
use skein_sim::scenario::{Overrides, Scenario};

use crate::logs::Logs;

/// Each test has network ports of its own.
fn try_out(fault: Fault, port_offset: u16, network: Network) {
    let folder = tempfile::tempdir().unwrap();
    let _logs = Logs::of(folder.path());
    let trial = run(fault, 1, folder.path(), port_offset, network).unwrap();
    assert!(trial.violations.is_empty(), "{fault:?} at {:.1} s: {:?}", trial.at_s, trial.violations);
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

#[test]
fn while_the_disk_of_all_fails_it_is_said_and_every_hold_is_answered_within_a_second() {
    let _turn = crate::turn::turn();
    if !nix::unistd::Uid::effective().is_root() {
        skein_tests::skipped("root, to mount a small disk");
        return;
    }
    for (fault, port_offset) in DiskFault::all().iter().zip((4700..).step_by(25)) {
        let swarm = Swarm { vehicles: 2, disk: Some(*fault), garbage: false, port_offset };
        let times_ms = Holds { swarm, holds: 10, deep_script: false }.measure().unwrap().times_ms;
        assert_eq!(times_ms.len(), 10);
        assert!(times_ms.iter().all(|ms| *ms < 1000.0), "{fault:?}: {times_ms:?}");
    }
}

#[test]
fn beside_a_member_of_garbage_and_scripts_that_are_too_deep_every_hold_is_answered_within_a_second() {
    let _turn = crate::turn::turn();
    let swarm = Swarm { vehicles: 2, disk: None, garbage: true, port_offset: 4850 };
    let Measured { times_ms, beside } = Holds { swarm, holds: 10, deep_script: true }.measure().unwrap();
    assert_eq!(times_ms.len(), 10);
    assert!(times_ms.iter().all(|ms| *ms < 1000.0), "{times_ms:?}");
    assert!(beside.garbage > 1_000_000 && beside.scripts_refused > 0, "{beside:?}");
}

/// The folder of a flight in which the mission's thread of the first vehicle hangs a second after take-off.
fn with_slow_agent(scenario: &Scenario, folder: &std::path::Path, port_offset: u16) -> Processes {
    let setup = Setup { network: Network::Peer, port_offset, launch_on_order: false, secure: false };
    let slow = std::env::current_exe().unwrap().parent().unwrap().parent().unwrap().join("slow-agent");
    assert!(slow.is_file(), "{} is not built: cargo build --workspace", slow.display());
    let mut swarm = Processes::prepare(scenario, folder, setup, &Autopilots::default())
        .unwrap()
        .running(Programs { agent: Some(slow), ground: None });
    let config = folder.join("uav-1.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    let dawdles = "[behaviours]\ndawdle = { after_s = 4.0, for_s = 600.0 }\n\n[fence]";
    let changed = text.replacen("[fence]", dawdles, 1);
    assert_ne!(changed, text);
    std::fs::write(&config, changed).unwrap();
    swarm.start_all().unwrap();
    swarm
}

#[test]
fn a_vehicle_whose_mission_hangs_avoids_hovers_and_lands() {
    let _turn = crate::turn::turn();
    let folder = tempfile::tempdir().unwrap();
    let _logs = Logs::of(folder.path());
    let overrides = Overrides { vehicles: Some(3), ..Overrides::default() };
    let scenario = Scenario::open("antipodal", &overrides, 1).unwrap();
    let mut swarm = with_slow_agent(&scenario, folder.path(), 4900);
    let began = Instant::now();
    let (mut silent, mut hovered, mut landed) = (None, false, false);
    while !landed && began.elapsed() < Duration::from_secs(120) {
        swarm.step();
        assert_eq!(swarm.ended(), None);
        let state = swarm.world().heard(0);
        if silent.is_none() && state.is_some_and(|state| state.waiting_for.contains("no decision for")) {
            silent = Some(Instant::now());
        }
        let vehicle = swarm.world().simulation().vehicle(0).unwrap();
        if let Some(silent) = silent {
            let seconds = silent.elapsed().as_secs_f64();
            if (3.0..9.0).contains(&seconds) {
                assert!(vehicle.airborne, "it is down after {seconds} s");
                hovered |= vehicle.motion.velocity.norm() < 0.3
                    && state.is_some_and(|state| state.mode == "offboard");
            }
            landed = !vehicle.airborne;
        }
    }
    let log = std::fs::read_to_string(folder.path().join("logs/uav-1.log")).unwrap();
    assert!(hovered && landed, "silent: {silent:?}, hovered: {hovered}, landed: {landed}\n{log}");
    assert!(log.contains("its mission has decided nothing"), "{log}");
    assert_eq!(swarm.world().simulation().truth().collisions_vehicle, 0);
}

//! One seed is one run, whoever built the program.

use std::path::PathBuf;
use std::process::Command;

use skein_tests::{flight, fly, skipped};

#[test]
fn one_seed_twice_is_one_run_and_another_seed_is_another() {
    for scenario in ["open", "window"] {
        let first = fly(flight(scenario, 3)).trace_hash;
        assert_eq!(first, fly(flight(scenario, 3)).trace_hash, "{scenario}");
        assert_ne!(first, fly(flight(scenario, 4)).trace_hash, "{scenario}");
    }
}

/// The release build to compare with is named by `SKEIN_RELEASE_SIM`, because one that happens to lie about may be old.
#[test]
fn a_release_build_and_this_build_agree() {
    let Some(release) = std::env::var_os("SKEIN_RELEASE_SIM").map(PathBuf::from) else {
        return skipped("SKEIN_RELEASE_SIM, the path of a release build of skein-sim");
    };
    for scenario in ["forest", "window"] {
        let folder = tempfile::tempdir().unwrap();
        let output = Command::new(&release)
            .args(["fly", scenario, "--seed", "5", "--clock", "lockstep", "--headless", "--out"])
            .arg(folder.path())
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let summary = std::fs::read_to_string(folder.path().join("summary.json")).unwrap();
        let hash = fly(flight(scenario, 5)).trace_hash.unwrap();
        assert!(summary.contains(&hash), "{scenario}: this build's {hash} is not in {summary}");
    }
}

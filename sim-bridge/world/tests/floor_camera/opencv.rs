//! What OpenCV finds in the same images.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::process::{Command, Stdio};

use nalgebra::{Isometry3, Vector2};
use skein_positioning::markers::{Detection, Lens, Solver};
use skein_world::ImageFaults;

use super::{FOCAL_PX, LENS, MIDDLE_PX, SIDE_M, body, camera, floor, found, mounting, noisy, picture, truth};

/// A marker that OpenCV found, and how far off its own pose of it is, pixels.
struct Theirs {
    detection: Detection,
    off_px: f64,
}

/// The Python that has OpenCV: `SKEIN_PYTHON`, or `python3`.
fn python() -> Option<String> {
    let python = std::env::var("SKEIN_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let found = Command::new(&python).args(["-c", "import cv2.aruco"]).stderr(Stdio::null()).status();
    if found.is_ok_and(|status| status.success()) {
        return Some(python);
    }
    let _ = writeln!(std::io::stderr(), "skipped: needs Python with cv2");
    None
}

fn poses() -> Vec<Isometry3<f64>> {
    let pose = |n: u32| {
        let turn = f64::from(n);
        let at = [1.2 + 0.1 * turn, 1.8 - 0.07 * turn, 0.7 + 0.2 * turn];
        body(at, 0.15 * turn.sin(), 0.12 * turn.cos(), 0.8 * turn)
    };
    (0..8).map(pose).collect()
}

/// What OpenCV finds in the images of the poses, by the number of the pose.
fn theirs(python: &str, poses: &[Isometry3<f64>], faults: &ImageFaults) -> Vec<Vec<Theirs>> {
    let folder = tempfile::tempdir().unwrap();
    let Lens::Radial { k, p } = LENS else { unreachable!() };
    let numbers =
        [[SIDE_M].as_slice(), &FOCAL_PX, &MIDDLE_PX, &k[..2], &p, &k[2..3], &[640.0, 480.0]].concat();
    let mut command = Command::new(python);
    command.arg(format!("{}/../../tests/python/find_markers.py", env!("CARGO_MANIFEST_DIR")));
    command.args(numbers.iter().map(f64::to_string));
    for (n, pose) in poses.iter().enumerate() {
        let file = folder.path().join(n.to_string());
        std::fs::write(&file, picture(pose, faults, n as u64).pixels).unwrap();
        command.arg(file);
    }
    let output = command.stderr(Stdio::inherit()).output().unwrap();
    assert!(output.status.success());
    let mut found: Vec<Vec<Theirs>> = poses.iter().map(|_| Vec::new()).collect();
    for line in String::from_utf8(output.stdout).unwrap().lines() {
        let numbers: Vec<f64> = line.split(' ').map(|number| number.parse().unwrap()).collect();
        let corners = std::array::from_fn(|n| Vector2::new(numbers[2 + 2 * n], numbers[3 + 2 * n]));
        let detection = Detection { id: numbers[1] as u32, corners, errors: 0 };
        found[numbers[0] as usize].push(Theirs { detection, off_px: numbers[10] });
    }
    found
}

#[test]
fn what_opencv_finds_is_found_and_its_corners_are_no_nearer_to_the_truth() {
    let Some(python) = python() else { return };
    let poses = poses();
    for faults in [ImageFaults::default(), noisy()] {
        for (n, (pose, theirs)) in poses.iter().zip(theirs(&python, &poses, &faults)).enumerate() {
            let ours: BTreeMap<u32, Detection> =
                found(&picture(pose, &faults, n as u64)).into_iter().map(|found| (found.id, found)).collect();
            let (mut off_theirs, mut off_ours) = (0.0_f64, 0.0_f64);
            for Theirs { detection, .. } in &theirs {
                let mine = ours.get(&detection.id);
                let mine = mine.unwrap_or_else(|| panic!("image {n}: marker {} is not found", detection.id));
                let corners =
                    mine.corners.iter().zip(detection.corners).zip(truth(pose, detection.id).unwrap());
                for ((ours, theirs), truth) in corners {
                    let off = (ours - truth).norm();
                    assert!(off < 0.3, "image {n}, marker {}: {off} px off", detection.id);
                    off_theirs = off_theirs.max((theirs - truth).norm());
                    off_ours = off_ours.max((ours - truth).norm());
                }
            }
            assert!(
                !theirs.is_empty() && off_ours <= off_theirs + 0.02,
                "image {n}: {off_ours}, {off_theirs}"
            );
        }
    }
}

#[test]
fn from_one_marker_the_pose_is_no_farther_off_than_opencvs() {
    let Some(python) = python() else { return };
    let poses = poses();
    let solver = Solver::new(camera(), mounting());
    for found in theirs(&python, &poses, &noisy()) {
        for Theirs { detection, off_px } in found {
            let sighting = solver.solve(&floor(), &[detection]).unwrap();
            assert!(sighting.best.rms_px <= off_px + 1e-4, "{} and {off_px}", sighting.best.rms_px);
        }
    }
}

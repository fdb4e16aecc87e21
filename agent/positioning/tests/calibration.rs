//! Calibrations as other people's tools write them.

use nalgebra::Vector3;
use skein_positioning::markers::{Camera, Lens, NoCalibration};

/// As OpenCV's calibration samples write it: a matrix has a tag and may be on one line.
fn opencv(distortion: &str) -> String {
    format!(
        "%YAML:1.0\n---\ncalibration_time: \"Fri 02 Jan 2026\"\nimage_width: 640\nimage_height: 480\nflags: 0\n\
         camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 4.2e+02, 0., 3.2e+02, 0.,\n       \
         4.1e+02, 2.4e+02, 0., 0., 1. ]\n{distortion}\n"
    )
}

fn coefficients(numbers: &str, count: usize) -> String {
    format!(
        "distortion_coefficients: !!opencv-matrix\n   rows: {count}\n   cols: 1\n   dt: d\n   data: [ {numbers} ]"
    )
}

#[test]
fn opencv_s_and_ros_s_files_give_the_same_camera() {
    let theirs = Camera::from_calibration(&opencv(&coefficients("-2.0e-01, 5.e-02, .001, -5e-4, 0.", 5)));
    let ros = "image_width: 640\nimage_height: 480\ncamera_name: down\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
               data: [420, 0, 320, 0, 410, 240, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  \
               rows: 1\n  cols: 5\n  data: [-0.2, 0.05, 0.001, -0.0005, 0]\nrectification_matrix:\n  rows: 3\n  \
               cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n";
    let expected = Lens::Radial { k: [-0.2, 0.05, 0.0, 0.0, 0.0, 0.0], p: [0.001, -0.0005] };
    let camera = Camera::new([640, 480], [420.0, 410.0], [320.0, 240.0], expected).unwrap();
    assert_eq!(theirs, Ok(camera.clone()));
    assert_eq!(Camera::from_calibration(ros), Ok(camera.clone()));
    // As `rostopic echo` prints the message.
    let message = "header:\n  seq: 3\nheight: 480\nwidth: 640\ndistortion_model: \"plumb_bob\"\n\
                   D: [-0.2, 0.05, 0.001, -0.0005, 0.0]\nK: [420.0, 0.0, 320.0, 0.0, 410.0, 240.0, 0.0, 0.0, 1.0]\n---\n";
    assert_eq!(Camera::from_calibration(message), Ok(camera));
}

#[test]
fn each_model_of_a_lens_is_read() {
    for (text, expected) in [
        (opencv(""), Lens::NONE),
        (
            opencv(&coefficients("0.1, -0.2, 0., 0.", 4)),
            Lens::Radial { k: [0.1, -0.2, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] },
        ),
        (
            opencv(&coefficients("0.1, 0.2, 0.01, 0.02, 0.3, 0.4, 0.5, 0.6", 8)),
            Lens::Radial { k: [0.1, 0.2, 0.3, 0.4, 0.5, 0.6], p: [0.01, 0.02] },
        ),
        (
            opencv(&format!("{}\nfisheye_model: 1", coefficients("0.1, 0.02, 0.003, 0.", 4))),
            Lens::Fisheye([0.1, 0.02, 0.003, 0.0]),
        ),
        (
            opencv(&format!("{}\ndistortion_model: equidistant", coefficients("0.1, 0., 0., 0.", 4))),
            Lens::Fisheye([0.1, 0.0, 0.0, 0.0]),
        ),
    ] {
        let camera = Camera::from_calibration(&text).unwrap();
        assert_eq!(*camera.lens(), expected, "{text}");
        assert_eq!(camera.project(&Vector3::new(0.0, 0.0, 2.0)), Some([320.0, 240.0].into()));
    }
}

#[test]
fn a_file_that_is_no_calibration_is_refused_by_its_field() {
    let good = opencv("");
    let thin_prism = coefficients("0.1, 0.2, 0., 0., 0.3, 0., 0., 0., 0.4, 0.5, 0., 0.", 12);
    for (text, words) in [
        (good.replace("image_width: 640\n", ""), "`image_width` is missing"),
        (good.replace("640", "640.5"), "whole number of pixels"),
        (good.replace("640", "-1"), "whole number of pixels"),
        (good.replace("camera_matrix", "other_matrix"), "`camera_matrix` is missing"),
        (good.replace("4.2e+02, 0.,", "4.2e+02, 3.,"), "`camera_matrix` is"),
        (good.replace("4.2e+02", "0."), "focal length"),
        (opencv(&thin_prism), "thin prism"),
        (opencv("distortion_model: division"), "distortion_model"),
        ("a: [1, 2".into(), "no YAML"),
        ("just words".into(), "no YAML"),
        (String::new(), "`image_width` is missing"),
    ] {
        let error = Camera::from_calibration(&text).unwrap_err();
        assert!(error.to_string().contains(words), "{error} for {text}");
    }
    assert_eq!(Camera::from_calibration("image_height: 4"), Err(NoCalibration::Missing("image_width")));
}

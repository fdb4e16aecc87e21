//! The floor camera: its images show what is there, and markers are found in them.

mod opencv;
mod pose;

use std::sync::OnceLock;

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use skein_positioning::markers::{self, Camera, Detection, Dictionary, Layout, Lens, Placed};
use skein_world::{FloorCamera, Glare, ImageFaults, Picture, View};

const SIDE_M: f64 = 0.18;
const FOCAL_PX: [f64; 2] = [420.0, 418.0];
const MIDDLE_PX: [f64; 2] = [321.5, 237.0];
const LENS: Lens = Lens::Radial { k: [-0.12, 0.03, -0.004, 0.0, 0.0, 0.0], p: [0.0006, -0.0004] };

fn camera() -> Camera {
    Camera::new([640, 480], FOCAL_PX, MIDDLE_PX, LENS).unwrap()
}

/// The camera with the rays of its pixels, which take long to look up.
fn floor_camera() -> &'static FloorCamera {
    static CAMERA: OnceLock<FloorCamera> = OnceLock::new();
    CAMERA.get_or_init(|| FloorCamera::new(camera()))
}

/// The paper's floor: 100 markers of 18 cm, 36 cm from centre to centre.
fn floor() -> Layout {
    let placed = (1..=100_u32).map(|id| {
        let (column, row) = ((id - 1) % 10, (id - 1) / 10);
        Placed {
            id,
            side_m: SIDE_M,
            to_world: Isometry3::translation(f64::from(column) * 0.36, f64::from(row) * 0.36, 0.0),
        }
    });
    Layout::new(Dictionary::named("original").unwrap(), placed).unwrap()
}

/// A camera under a body's centre, the image's top to the nose.
fn mounting() -> Isometry3<f64> {
    let down = Matrix3::new(0.0, -1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
    Isometry3::from_parts(Translation3::new(0.02, 0.0, -0.03), UnitQuaternion::from_matrix(&down))
}

fn body(position: [f64; 3], roll: f64, pitch: f64, yaw: f64) -> Isometry3<f64> {
    Isometry3::from_parts(position.into(), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
}

fn picture(body: &Isometry3<f64>, faults: &ImageFaults, seed: u64) -> Picture {
    floor_camera().render(&floor(), &View::at(body * mounting()), faults, seed)
}

fn found(picture: &Picture) -> Vec<Detection> {
    markers::detect(&picture.grey().unwrap(), floor().dictionary())
}

/// Where the corners of a marker are in the image.
fn truth(body: &Isometry3<f64>, id: u32) -> Option<[Vector2<f64>; 4]> {
    let to_camera = (body * mounting()).inverse();
    let mut corners = [Vector2::zeros(); 4];
    for (corner, at) in corners.iter_mut().zip(floor().get(id)?.corners()) {
        *corner = camera().project(&(to_camera * Point3::from(at)).coords)?;
    }
    Some(corners)
}

/// The markers whose corners are all well within the image.
fn in_sight(body: &Isometry3<f64>) -> Vec<u32> {
    let is_inside =
        |corner: &Vector2<f64>| (4.0..635.0).contains(&corner.x) && (4.0..475.0).contains(&corner.y);
    let is_seen = |id: &u32| truth(body, *id).is_some_and(|corners| corners.iter().all(is_inside));
    (1..=100).filter(is_seen).collect()
}

fn level(picture: &Picture, at: Vector2<f64>) -> u8 {
    picture.pixels[at.y.round() as usize * picture.width + at.x.round() as usize]
}

fn noisy() -> ImageFaults {
    ImageFaults { noise: 4.0, defocus_px: 0.7, ..ImageFaults::default() }
}

#[test]
fn cells_floor_and_paper_have_their_brightness() {
    let body = body([1.4, 1.5, 1.2], 0.05, -0.1, 0.4);
    let picture = picture(&body, &ImageFaults::default(), 0);
    let to_camera = (body * mounting()).inverse();
    let at = |x: f64, y: f64| {
        let pixel = camera().project(&(to_camera * Point3::new(x, y, 0.0)).coords).unwrap();
        level(&picture, pixel)
    };
    let original = Dictionary::named("original").unwrap();
    let cell_m = SIDE_M / 7.0;
    // Marker 45 is at (1.44, 1.44).
    for row in 0..7_usize {
        for column in 0..7_usize {
            let [right, down] = [column, row].map(|n| (n as f64 - 3.0) * cell_m);
            let expected = if original.is_white(45, row, column).unwrap() { 215 } else { 30 };
            assert_eq!(at(1.44 + right, 1.44 - down), expected, "row {row}, column {column}");
        }
    }
    assert_eq!(at(1.44 + 4.0 * cell_m, 1.44), 215, "the paper");
    assert_eq!(at(1.62, 1.62), 150, "the floor");
}

#[test]
fn markers_are_found_with_their_corners() {
    for (n, height) in [0.7, 1.0, 1.5, 2.0, 3.0].into_iter().enumerate() {
        let body = body([1.4, 1.6, height], 0.08, -0.12, 0.5 * n as f64);
        let seen = found(&picture(&body, &noisy(), n as u64));
        let ids: Vec<u32> = seen.iter().map(|marker| marker.id).collect();
        assert!(in_sight(&body).iter().all(|id| ids.contains(id)), "{height} m: {ids:?}");
        for marker in &seen {
            for (corner, true_corner) in marker.corners.iter().zip(truth(&body, marker.id).unwrap()) {
                let off = (corner - true_corner).norm();
                assert!(off < 0.3, "{height} m, marker {}: {off} px off", marker.id);
            }
        }
    }
}

#[test]
fn motion_blurs_along_the_way_and_glare_hides_what_it_covers() {
    let body = body([1.44, 1.44, 1.0], 0.0, 0.0, 0.0);
    let sharp = found(&picture(&body, &noisy(), 1)).len();
    let mut view = View::at(body * mounting());
    view.velocity = Vector3::new(2.0, 0.0, 0.0);
    let blurred = ImageFaults { exposure_s: 0.06, ..noisy() };
    let smeared = floor_camera().render(&floor(), &view, &blurred, 1);
    assert!(found(&smeared).len() < sharp, "12 cm in one exposure");
    let slow = ImageFaults { exposure_s: 0.004, ..noisy() };
    let hardly = found(&floor_camera().render(&floor(), &view, &slow, 1));
    assert_eq!(hardly.len(), sharp);
    // The middle of the exposure is the moment of the image.
    let off = hardly[0].corners[0] - truth(&body, hardly[0].id).unwrap()[0];
    assert!(off.norm() < 0.4, "{off}");

    let glare = Glare { at: Vector3::new(1.44, 1.44, 0.0), radius_m: 0.12, strength: 600.0 };
    let glaring = ImageFaults { glare: vec![glare], ..noisy() };
    let left = found(&picture(&body, &glaring, 1));
    assert!(left.iter().all(|marker| marker.id != 45) && left.len() + 1 >= sharp.min(2), "{left:?}");
    assert_eq!(level(&picture(&body, &glaring, 1), truth(&body, 45).unwrap()[0]), 255);
}

#[test]
fn equal_seeds_give_equal_images_and_noise_is_as_strong_as_asked_for() {
    let body = body([9.0, 9.0, 1.0], 0.0, 0.0, 0.0);
    let faults = ImageFaults { noise: 4.0, ..ImageFaults::default() };
    let one = picture(&body, &faults, 5);
    assert_eq!(one, picture(&body, &faults, 5));
    assert_ne!(one, picture(&body, &faults, 6));
    let mean = one.pixels.iter().map(|pixel| f64::from(*pixel)).sum::<f64>() / one.pixels.len() as f64;
    let square = one.pixels.iter().map(|pixel| (f64::from(*pixel) - mean).powi(2)).sum::<f64>();
    let sigma = (square / one.pixels.len() as f64).sqrt();
    assert!((mean - 150.0).abs() < 0.1 && (sigma - 4.0).abs() < 0.15, "{mean} {sigma}");
}

//! A camera's calibration, and a layout of markers with the sheets that are printed of it.

use nalgebra::Vector3;
use skein_positioning::markers::sheet::{Paper, pages, to_pdf};
use skein_positioning::markers::{Camera, Layout};

use crate::target::{Allowed, Reached, Target};

// A floor of few bytes has many markers, and a page each.
pub const TARGET: Target =
    Target { name: "cameras", allowed: Allowed { bytes: 64 << 20, per_byte: 2000 }, read, seeds };

fn read(input: &[u8]) -> Reached {
    let text = String::from_utf8_lossy(input);
    if let Ok(camera) = Camera::from_calibration(&text) {
        // The axis is seen in the middle, whatever the lens.
        let seen = camera.project(&Vector3::new(0.0, 0.0, 1.0));
        assert!(seen.is_some_and(|pixel| (pixel - camera.middle()).norm() < 1e-6));
        return Reached::read(camera.width() == 7);
    }
    let Ok(layout) = toml::from_str::<Layout>(&text) else { return Reached::Refused };
    let again: Layout = toml::from_str(&layout.to_toml()).expect("what was written is read");
    assert_eq!(again.markers().count(), layout.markers().count());
    if let Ok(pages) = pages(&layout, Paper::for_layout(&layout)) {
        assert_eq!(pages.iter().flat_map(|page| page.ids()).count(), layout.markers().count());
        assert!(to_pdf(&pages).starts_with(b"%PDF"));
        assert!(pages.iter().all(|page| page.to_svg().ends_with("</svg>\n")));
    }
    Reached::Read
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let opencv = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   \
                  cols: 3\n   dt: d\n   data: [ 420., 0., 320., 0., 420., 240., 0., 0., 1. ]\n\
                  distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ .1, 0., 0., 0. ]\n";
    let layout = "dictionary = \"4x4_50\"\n[[floor]]\nfirst_id = 0\ncolumns = 3\nrows = 2\nside_m = 0.1\npitch_m = 0.2\n\
                  [[marker]]\nid = 20\nside_m = 0.2\nposition = [1.0, 2.0, 0.5]\nroll_deg = 90\n";
    vec![("opencv.yaml", opencv.into()), ("layout.toml", layout.into())]
}

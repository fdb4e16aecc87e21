//! Square black and white markers (Zhang 2019, section 2): their dictionaries, where they lie, how a camera sees them,
//! and from where it does.
//!
//! ```
//! use nalgebra::Isometry3;
//! use skein_positioning::markers::{Camera, Dictionary, Grey, Layout, Lens, Solver, detect};
//!
//! let layout = Layout::new(Dictionary::named("original")?, [])?;
//! let camera = Camera::new([640, 480], [420.0, 420.0], [319.5, 239.5], Lens::NONE)?;
//! let solver = Solver::new(camera, Isometry3::identity());
//! let pixels = vec![200; 640 * 480];
//! let seen = detect(&Grey::new(&pixels, 640, 480)?, layout.dictionary());
//! assert_eq!(solver.solve(&layout, &seen), None, "nothing is seen on an empty floor");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod blobs;
mod calibration;
mod camera;
mod cells;
mod detect;
mod dictionary;
mod edges;
mod grey;
mod homography;
mod layout;
mod plane;
mod pose;
mod quadrilateral;
pub mod sheet;
mod threshold;

pub use self::calibration::NoCalibration;
pub use self::camera::{Camera, Lens, NoCamera};
pub use self::detect::{Detection, detect};
pub use self::dictionary::{Dictionary, Identity, UnknownDictionary};
pub use self::grey::{Grey, NoImage};
pub use self::layout::{Layout, LayoutError, Placed};
pub use self::pose::{Sighting, Solution, Solver};

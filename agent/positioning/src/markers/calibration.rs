//! A camera's calibration as OpenCV (`FileStorage`) and ROS (`camera_info`) write it, in YAML.

use std::collections::BTreeMap;

use serde::Deserialize;
use thiserror::Error;

use super::camera::{Camera, Lens, NoCamera};

/// The text describes no camera.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum NoCalibration {
    #[error("it is no YAML: {0}")]
    Yaml(String),
    #[error(
        "`{0}` is missing; expected image_width, image_height, camera_matrix and distortion_coefficients"
    )]
    Missing(&'static str),
    #[error("`{field}` is {value}; expected {expected}")]
    Field { field: &'static str, value: String, expected: &'static str },
    #[error(transparent)]
    Camera(#[from] NoCamera),
}

/// A number, a word or a matrix; whatever else a file holds is passed over.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum Value {
    Number(f64),
    Word(String),
    Matrix {
        data: Vec<f64>,
    },
    /// ROS 1 messages printed by `rostopic` have bare lists.
    List(Vec<f64>),
    #[allow(dead_code)] // It is only told apart.
    Other(serde::de::IgnoredAny),
}

impl Camera {
    /// Reads a calibration that OpenCV's or ROS's tools wrote.
    ///
    /// # Errors
    /// The field that is missing or wrong.
    pub fn from_calibration(text: &str) -> Result<Self, NoCalibration> {
        let fields = fields(text)?;
        let width = side(&fields, "image_width", &["imagewidth", "width"])?;
        let height = side(&fields, "image_height", &["imageheight", "height"])?;
        let matrix = list(&fields, &["cameramatrix", "k", "intrinsicmatrix"])
            .ok_or(NoCalibration::Missing("camera_matrix"))?;
        let [fx, skew, cx, _, fy, cy, ..] = matrix[..] else { return Err(wrong_matrix(matrix)) };
        if matrix.len() != 9 || skew.abs() > 1e-6 * fx.abs() {
            return Err(wrong_matrix(matrix));
        }
        let lens = lens(&fields)?;
        Ok(Self::new([width, height], [fx, fy], [cx, cy], lens)?)
    }
}

/// The fields by name, without what tells `image_Width`, `imageWidth` and `image_width` apart.
fn fields(text: &str) -> Result<BTreeMap<String, Value>, NoCalibration> {
    // OpenCV's first line has a colon where YAML has a space, and its tags name types that YAML does not know.
    let text: String = text
        .trim_start_matches('\u{feff}')
        .lines()
        .filter(|line| !line.starts_with('%') && line.trim_end() != "---" && line.trim_end() != "...")
        .map(|line| line.replace("!!opencv-matrix", "") + "\n")
        .collect();
    let fields: BTreeMap<String, Value> =
        serde_saphyr::from_str(&text).map_err(|error| NoCalibration::Yaml(error.to_string()))?;
    let plain = |name: String| name.to_lowercase().replace('_', "");
    Ok(fields.into_iter().map(|(name, value)| (plain(name), value)).collect())
}

fn wrong_matrix(matrix: &[f64]) -> NoCalibration {
    let value = format!("{matrix:?}");
    NoCalibration::Field { field: "camera_matrix", value, expected: "[fx, 0, cx, 0, fy, cy, 0, 0, 1]" }
}

fn side(
    fields: &BTreeMap<String, Value>,
    field: &'static str,
    names: &[&str],
) -> Result<usize, NoCalibration> {
    match names.iter().find_map(|name| fields.get(*name)) {
        None => Err(NoCalibration::Missing(field)),
        // Camera::new says what size is too large.
        Some(Value::Number(number)) if *number >= 1.0 && number.fract() == 0.0 => Ok(*number as usize),
        Some(value) => Err(NoCalibration::Field {
            field,
            value: format!("{value:?}"),
            expected: "a whole number of pixels",
        }),
    }
}

fn list<'a>(fields: &'a BTreeMap<String, Value>, names: &[&str]) -> Option<&'a Vec<f64>> {
    match names.iter().find_map(|name| fields.get(*name))? {
        Value::Matrix { data } | Value::List(data) => Some(data),
        _ => None,
    }
}

fn lens(fields: &BTreeMap<String, Value>) -> Result<Lens, NoCalibration> {
    let none = Vec::new();
    let d = list(fields, &["distortioncoefficients", "distcoeffs", "d"]).unwrap_or(&none);
    let model = match fields.get("distortionmodel") {
        Some(Value::Word(word)) => Some(word.as_str()),
        _ => None,
    };
    let is_fisheye = matches!(model, Some("equidistant" | "fisheye"))
        || matches!(fields.get("fisheyemodel"), Some(Value::Number(flag)) if *flag != 0.0);
    if let Some(word) = model.filter(|word| {
        !matches!(*word, "" | "none" | "plumb_bob" | "rational_polynomial" | "equidistant" | "fisheye")
    }) {
        let expected = "plumb_bob, rational_polynomial, equidistant or fisheye";
        return Err(NoCalibration::Field { field: "distortion_model", value: word.to_owned(), expected });
    }
    if is_fisheye {
        return match d[..] {
            [] => Ok(Lens::Fisheye([0.0; 4])),
            [k1, k2, k3, k4] => Ok(Lens::Fisheye([k1, k2, k3, k4])),
            _ => Err(wrong_lens(d, "four numbers for a fisheye lens")),
        };
    }
    // k1, k2, p1, p2, k3, k4, k5, k6; beyond are a thin prism and a tilted sensor.
    if !matches!(d.len(), 0 | 4 | 5 | 8 | 12 | 14) || d.iter().skip(8).any(|more| *more != 0.0) {
        return Err(wrong_lens(d, "4, 5 or 8 numbers; a thin prism or tilted sensor is not modelled"));
    }
    let at = |index: usize| d.get(index).copied().unwrap_or(0.0);
    Ok(Lens::Radial { k: [at(0), at(1), at(4), at(5), at(6), at(7)], p: [at(2), at(3)] })
}

fn wrong_lens(d: &[f64], expected: &'static str) -> NoCalibration {
    NoCalibration::Field { field: "distortion_coefficients", value: format!("{d:?}"), expected }
}

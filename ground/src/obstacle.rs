//! An obstacle, as browsers and rehearsals are told of it.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use skein_wire::{Form, Solid};

/// Something that stands in the world: its form, and where its middle is (ENU, metres; a quaternion x, y, z, w).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Obstacle {
    #[serde(flatten)]
    form: FormView,
    position: [f64; 3],
    #[serde(default = "upright")]
    orientation: [f64; 4],
}

/// The form of an obstacle, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "form", rename_all = "snake_case")]
pub enum FormView {
    /// The whole size.
    Box {
        size: [f64; 3],
    },
    /// About its own z axis.
    Cylinder {
        radius: f64,
        height: f64,
    },
    Sphere {
        radius: f64,
    },
}

fn upright() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

impl From<&Solid> for Obstacle {
    fn from(solid: &Solid) -> Self {
        Self {
            form: match solid.form {
                Form::Box(size) => FormView::Box { size: size.into() },
                Form::Cylinder { radius, height } => FormView::Cylinder { radius, height },
                Form::Sphere { radius } => FormView::Sphere { radius },
            },
            position: solid.pose.translation.vector.into(),
            orientation: solid.pose.rotation.coords.into(),
        }
    }
}

impl Obstacle {
    /// The body that it describes.
    ///
    /// # Errors
    /// The field at fault, and what was expected there.
    pub fn solid(&self) -> Result<Solid, (&'static str, &'static str)> {
        let is_length = |length: &f64| length.is_finite() && *length > 0.0;
        let (field, is_sound, form) = match self.form {
            FormView::Box { size } => ("size", size.iter().all(is_length), Form::Box(size.into())),
            FormView::Cylinder { radius, height } => {
                ("radius", is_length(&radius) && is_length(&height), Form::Cylinder { radius, height })
            }
            FormView::Sphere { radius } => ("radius", is_length(&radius), Form::Sphere { radius }),
        };
        if !is_sound {
            return Err((field, "expected lengths above 0 m"));
        }
        if !self.position.iter().all(|metres| metres.is_finite()) {
            return Err(("position", "expected three finite numbers"));
        }
        let [x, y, z, w] = self.orientation;
        let turn = Quaternion::new(w, x, y, z);
        if !(0.5..2.0).contains(&turn.norm()) {
            return Err(("orientation", "expected a quaternion of length 1: x, y, z, w"));
        }
        let place = Translation3::from(Vector3::from(self.position));
        Ok(Solid { form, pose: Isometry3::from_parts(place, UnitQuaternion::from_quaternion(turn)) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_is_the_same_after_it_was_told_of_and_a_wrong_one_is_refused_by_its_field() {
        let pose = Isometry3::new(Vector3::new(1.0, -2.0, 3.0), Vector3::new(0.1, 0.2, 0.3));
        for form in [
            Form::Box(Vector3::new(1.0, 2.0, 3.0)),
            Form::Cylinder { radius: 0.3, height: 4.0 },
            Form::Sphere { radius: 2.0 },
        ] {
            let solid = Solid { form, pose };
            let told = Obstacle::from(&solid).solid().unwrap();
            assert_eq!(told.form, form);
            assert!((told.pose.to_homogeneous() - pose.to_homogeneous()).norm() < 1e-12);
        }
        let flat = Solid { form: Form::Box(Vector3::new(1.0, 2.0, 0.0)), pose };
        assert_eq!(Obstacle::from(&flat).solid().unwrap_err().0, "size");
    }
}

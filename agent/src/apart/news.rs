//! Control's words to the mission.

use nalgebra::Vector3;
use skein_wire::event::What;

use super::newest::Newest;
use crate::{neighbours::Neighbour, report::Report, scripts::Circumstances};

/// Control's findings, and the state of the vehicle.
#[derive(Clone, Debug, Default)]
pub struct News {
    pub reports: Newest<Report>,
    /// The newest, if there is a new one.
    pub body: Option<Body>,
    /// The newest order of whoever is at this vehicle's own computer.
    pub order: Option<What>,
}

/// The state of the vehicle, as far as the mission needs it.
#[derive(Clone, Debug, Default)]
pub struct Body {
    /// Whether it is on its way down.
    pub is_landing: bool,
    /// Why it is not ready to take off, if so.
    pub complaint: Option<String>,
    pub here: Option<Here>,
}

/// Where the vehicle is, and what is around it: see [`Circumstances`].
#[derive(Clone, Debug)]
pub struct Here {
    pub position: Vector3<f64>,
    pub is_flown: bool,
    pub ahead: Option<Vector3<f64>>,
    pub battery: Option<f64>,
    pub neighbours: Vec<Neighbour>,
}

impl News {
    /// Adds what is newer.
    pub fn merge(&mut self, newer: Self) {
        self.reports.extend(newer.reports);
        self.body = newer.body.or(self.body.take());
        self.order = newer.order.or(self.order);
    }
}

impl From<Circumstances<'_>> for Here {
    fn from(here: Circumstances<'_>) -> Self {
        let Circumstances { position, is_flown, ahead, battery, neighbours } = here;
        Self { position, is_flown, ahead, battery, neighbours: neighbours.to_vec() }
    }
}

impl Here {
    pub fn circumstances(&self) -> Circumstances<'_> {
        let Self { position, is_flown, ahead, battery, ref neighbours } = *self;
        Circumstances { position, is_flown, ahead, battery, neighbours }
    }
}

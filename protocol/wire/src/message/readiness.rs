//! A vehicle's checks before take-off, on `readiness/<node>`: also of one that does not know yet where it is.

use skein_bp::Bound;
use skein_dbp::NodeName;

use super::field::{
    Result, at_most, finite, node, out_of_range, place, required, same_variants, text, words,
};
use super::record::{Addressee, Kind, Record};
use crate::decode_error::DecodeError;
use crate::proto;
use crate::route::Route;

/// The checks of a vehicle before take-off, and what its places are relative to.
#[derive(Clone, Debug, PartialEq)]
pub struct Readiness {
    pub node: NodeName,
    pub incarnation: u64,
    /// Its pad, metres ENU.
    pub home: [f64; 3],
    /// The world's origin as this vehicle is configured: latitude and longitude, degrees, and height, metres.
    pub datum: [f64; 3],
    /// All checks, in the order in which people look at them; only the first [`Readiness::MAX_CHECKS`]
    /// travel.
    pub checks: Vec<Check>,
    /// The points of the mission that it is configured with, metres ENU; only the first [`Route::MOST_POINTS`] travel.
    pub mission: Vec<[f64; 3]>,
}

/// One check before take-off.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Check {
    /// Its name: one word, or that of a parameter of the autopilot.
    pub name: String,
    pub state: CheckState,
    /// The value found, or the fault, in words.
    pub value: String,
    /// The remedy; empty if it passes.
    pub advice: String,
}

/// The result of a check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CheckState {
    Passes,
    Fails,
    /// Not known yet.
    #[default]
    Waits,
}

impl Readiness {
    /// So many checks travel.
    pub const MAX_CHECKS: usize = 64;

    /// Whether all checks pass.
    pub fn is_ready(&self) -> bool {
        self.faults().next().is_none()
    }

    /// The checks that do not pass.
    pub fn faults(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|check| check.state != CheckState::Passes)
    }
}

impl CheckState {
    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Passes => "passes",
            Self::Fails => "fails",
            Self::Waits => "waits",
        }
    }
}

impl Record for Readiness {
    const KIND: Kind = Kind {
        word: "readiness",
        addressee: Addressee::All,
        every_node_listens: true,
        bytes: Bound::BoardBytes,
    };

    fn sender(&self) -> Option<&NodeName> {
        Some(&self.node)
    }
}

same_variants!(CheckState, proto::CheckState: Waits, Passes, Fails);

impl From<&Readiness> for proto::Readiness {
    fn from(readiness: &Readiness) -> Self {
        let check = |check: &Check| proto::Check {
            name: words(&check.name),
            state: proto::CheckState::from(check.state).into(),
            value: words(&check.value),
            advice: words(&check.advice),
        };
        let [latitude_deg, longitude_deg, height_m] = readiness.datum;
        Self {
            node: text(&readiness.node),
            incarnation: readiness.incarnation,
            home: Some(readiness.home.into()),
            datum: Some(proto::Datum { latitude_deg, longitude_deg, height_m }),
            checks: readiness.checks.iter().take(Readiness::MAX_CHECKS).map(check).collect(),
            mission: readiness.mission.iter().take(Route::MOST_POINTS).map(|point| (*point).into()).collect(),
        }
    }
}

impl TryFrom<proto::Readiness> for Readiness {
    type Error = DecodeError;

    fn try_from(readiness: proto::Readiness) -> Result<Self> {
        at_most("Readiness.checks", readiness.checks.len(), Self::MAX_CHECKS, "at most 64 checks")?;
        let points = readiness.mission;
        at_most("Readiness.mission", points.len(), Route::MOST_POINTS, "at most 64 points")?;
        let datum = required("Readiness.datum", readiness.datum)?;
        let within = |field, given: f64, most: f64| {
            if given.abs() <= most {
                Ok(given)
            } else {
                Err(out_of_range(field, given, "degrees on the earth"))
            }
        };
        let check = |check: proto::Check| Check {
            // One of a later version does not pass as far as this one can tell.
            state: check.state().into(),
            name: words(check.name),
            value: words(check.value),
            advice: words(check.advice),
        };
        Ok(Self {
            node: node("Readiness.node", &readiness.node)?,
            incarnation: readiness.incarnation,
            home: place("Readiness.home", &required("Readiness.home", readiness.home)?)?.into(),
            datum: [
                within("Readiness.datum", datum.latitude_deg, 90.0)?,
                within("Readiness.datum", datum.longitude_deg, 180.0)?,
                finite("Readiness.datum", datum.height_m)?,
            ],
            checks: readiness.checks.into_iter().map(check).collect(),
            mission: points
                .iter()
                .map(|point| place("Readiness.mission", point).map(Into::into))
                .collect::<Result<_>>()?,
        })
    }
}

//! An airspace as files write it: the `[airspace]` table of a vehicle's configuration and of a scenario.

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::{Airspace, Area, HeightGrid, Mountain, NoFlyPrism, NoFlyZone, StayInside, ThreatZone};

/// Terrain, threats and no-fly zones; metres east, north and up of the world's origin.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AirspaceTable {
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mountain: Vec<MountainTable>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub threat: Vec<ThreatTable>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub no_fly: Vec<NoFlyTable>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stay_inside: Vec<StayInsideTable>,
    /// Heights of the ground.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub terrain: Option<TerrainTable>,
}

/// A mountain; see [`Mountain`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MountainTable {
    centre_m: [f64; 2],
    height_m: f64,
    /// Eastwards and northwards.
    slope_m: [f64; 2],
}

/// A threat; see [`ThreatZone`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThreatTable {
    centre_m: [f64; 2],
    radius_m: f64,
}

/// A no-fly zone: a circle or a polygon, at all heights unless it says otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoFlyTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    centre_m: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    radius_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    corners_m: Vec<[f64; 2]>,
    #[serde(default = "lowest_m", skip_serializing_if = "is_infinite")]
    floor_m: f64,
    #[serde(default = "highest_m", skip_serializing_if = "is_infinite")]
    ceiling_m: f64,
}

/// Areas of which the vehicle stays inside one; each is described as a no-fly zone is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StayInsideTable {
    any_of: Vec<NoFlyTable>,
}

/// Heights on a grid; see [`HeightGrid`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TerrainTable {
    corner_m: [f64; 2],
    spacing_m: f64,
    heights_m: Vec<Vec<f64>>,
}

/// A fault in an airspace.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`airspace.{field}`: {problem}")]
pub struct AirspaceError {
    /// The field at fault, such as `no_fly[1]`.
    pub field: String,
    pub problem: String,
}

fn lowest_m() -> f64 {
    f64::NEG_INFINITY
}

fn highest_m() -> f64 {
    f64::INFINITY
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_infinite(height_m: &f64) -> bool {
    height_m.is_infinite()
}

impl AirspaceTable {
    /// The airspace that it describes, without a box.
    pub fn check(&self) -> Result<Airspace, AirspaceError> {
        let mut airspace = Airspace::default();
        for (index, table) in self.mountain.iter().enumerate() {
            let [east, north] = table.slope_m;
            require(
                is_finite(&table.centre_m)
                    && is_length(east)
                    && is_length(north)
                    && is_length(table.height_m),
                || format!("mountain[{index}]"),
                "expected a centre, and a height and slopes above 0",
            )?;
            airspace.mountains.push(Mountain {
                centre: table.centre_m.into(),
                height_m: table.height_m,
                slope_m: table.slope_m.into(),
            });
        }
        for (index, table) in self.threat.iter().enumerate() {
            require(
                is_finite(&table.centre_m) && is_length(table.radius_m),
                || format!("threat[{index}]"),
                "expected a centre, and a radius above 0",
            )?;
            airspace.threats.push(ThreatZone { centre: table.centre_m.into(), radius_m: table.radius_m });
        }
        for (index, table) in self.no_fly.iter().enumerate() {
            match table.area(|| format!("no_fly[{index}]"))? {
                Area::Round(zone) => airspace.no_fly.push(zone),
                Area::Cornered(zone) => airspace.prisms.push(zone),
            }
        }
        for (index, table) in self.stay_inside.iter().enumerate() {
            let field = || format!("stay_inside[{index}]");
            require(!table.any_of.is_empty(), field, "expected at least one area in `any_of`")?;
            let any_of = table.any_of.iter().map(|area| area.area(field)).collect::<Result<_, _>>()?;
            airspace.stay_inside.push(StayInside { any_of });
        }
        if let Some(TerrainTable { corner_m, spacing_m, heights_m }) = &self.terrain {
            let grid = HeightGrid::new((*corner_m).into(), *spacing_m, heights_m);
            let wrong = |error: super::HeightGridError| AirspaceError {
                field: "terrain".to_owned(),
                problem: error.to_string(),
            };
            airspace.heights = Some(grid.map_err(wrong)?);
        }
        Ok(airspace)
    }

    /// The table that describes an airspace.
    pub fn of(airspace: &Airspace) -> AirspaceTable {
        let round = airspace.no_fly.iter().map(NoFlyTable::round);
        let cornered = airspace.prisms.iter().map(NoFlyTable::cornered);
        let inside =
            |zone: &StayInside| StayInsideTable { any_of: zone.any_of.iter().map(NoFlyTable::of).collect() };
        let mountain = |mountain: &Mountain| MountainTable {
            centre_m: mountain.centre.into(),
            height_m: mountain.height_m,
            slope_m: mountain.slope_m.into(),
        };
        let threat =
            |zone: &ThreatZone| ThreatTable { centre_m: zone.centre.into(), radius_m: zone.radius_m };
        AirspaceTable {
            mountain: airspace.mountains.iter().map(mountain).collect(),
            threat: airspace.threats.iter().map(threat).collect(),
            no_fly: round.chain(cornered).collect(),
            stay_inside: airspace.stay_inside.iter().map(inside).collect(),
            terrain: airspace.heights.as_ref().map(|heights| TerrainTable {
                corner_m: heights.corner().into(),
                spacing_m: heights.spacing_m(),
                heights_m: heights.rows().map(<[f64]>::to_vec).collect(),
            }),
        }
    }
}

impl NoFlyTable {
    fn round(zone: &NoFlyZone) -> Self {
        let NoFlyZone { centre, radius_m, floor_m, ceiling_m } = *zone;
        let corners_m = Vec::new();
        Self { centre_m: Some(centre.into()), radius_m: Some(radius_m), corners_m, floor_m, ceiling_m }
    }

    fn cornered(zone: &NoFlyPrism) -> Self {
        let corners_m = zone.corners.iter().map(|corner| (*corner).into()).collect();
        let (floor_m, ceiling_m) = (zone.floor_m, zone.ceiling_m);
        Self { centre_m: None, radius_m: None, corners_m, floor_m, ceiling_m }
    }

    fn of(area: &Area) -> Self {
        match area {
            Area::Round(zone) => Self::round(zone),
            Area::Cornered(zone) => Self::cornered(zone),
        }
    }

    fn area(&self, field: impl Fn() -> String) -> Result<Area, AirspaceError> {
        let (floor_m, ceiling_m) = (self.floor_m, self.ceiling_m);
        require(floor_m < ceiling_m, &field, "expected `floor_m` below `ceiling_m`")?;
        match (self.centre_m, self.radius_m, &self.corners_m[..]) {
            (Some(centre_m), Some(radius_m), []) => {
                let is_sound = is_finite(&centre_m) && is_length(radius_m);
                require(is_sound, &field, "expected a centre, and a radius above 0")?;
                Ok(Area::Round(NoFlyZone { centre: centre_m.into(), radius_m, floor_m, ceiling_m }))
            }
            (None, None, corners_m) if !corners_m.is_empty() => {
                let is_sound = corners_m.len() > 2 && corners_m.iter().all(is_finite);
                require(is_sound, &field, "expected three corners or more")?;
                let corners = corners_m.iter().map(|corner| Vector2::from(*corner)).collect();
                Ok(Area::Cornered(NoFlyPrism { corners, floor_m, ceiling_m }))
            }
            _ => Err(AirspaceError {
                field: field(),
                problem: "expected either `centre_m` and `radius_m` or `corners_m`".to_owned(),
            }),
        }
    }
}

fn require(holds: bool, field: impl Fn() -> String, problem: &str) -> Result<(), AirspaceError> {
    if holds { Ok(()) } else { Err(AirspaceError { field: field(), problem: problem.to_owned() }) }
}

fn is_finite(place: &[f64; 2]) -> bool {
    place.iter().all(|coordinate| coordinate.is_finite())
}

fn is_length(length_m: f64) -> bool {
    length_m > 0.0 && length_m.is_finite()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn no_fly(centre_m: Option<[f64; 2]>, radius_m: Option<f64>, corners_m: &[[f64; 2]]) -> AirspaceTable {
        let corners_m = corners_m.to_vec();
        let zone = NoFlyTable { centre_m, radius_m, corners_m, floor_m: lowest_m(), ceiling_m: 9.0 };
        AirspaceTable { no_fly: vec![zone], ..AirspaceTable::default() }
    }

    #[test]
    fn an_airspace_is_what_its_table_describes_and_the_other_way_round() {
        let mut table = no_fly(Some([1.0, 2.0]), Some(3.0), &[]);
        table.no_fly.extend(no_fly(None, None, &[[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]).no_fly);
        table.threat = vec![ThreatTable { centre_m: [7.0, 8.0], radius_m: 2.0 }];
        table.mountain = vec![MountainTable { centre_m: [5.0, 5.0], height_m: 6.0, slope_m: [1.0, 2.0] }];
        table.stay_inside =
            vec![StayInsideTable { any_of: no_fly(Some([0.0, 0.0]), Some(90.0), &[]).no_fly }];
        let heights_m = vec![vec![0.0, 1.0], vec![2.0, 3.0]];
        table.terrain = Some(TerrainTable { corner_m: [0.0, 0.0], spacing_m: 5.0, heights_m });
        let airspace = table.check().unwrap();
        assert_eq!((airspace.no_fly.len(), airspace.prisms.len(), airspace.threats.len()), (1, 1, 1));
        assert_eq!(AirspaceTable::of(&airspace), table);
    }

    #[test]
    fn what_is_no_zone_is_named() {
        for wrong in [
            no_fly(Some([1.0, 2.0]), None, &[]),
            no_fly(Some([1.0, 2.0]), Some(-1.0), &[]),
            no_fly(Some([f64::NAN, 2.0]), Some(1.0), &[]),
            no_fly(None, None, &[[0.0, 0.0], [1.0, 1.0]]),
            no_fly(Some([1.0, 2.0]), Some(1.0), &[[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]),
        ] {
            assert_eq!(wrong.check().unwrap_err().field, "no_fly[0]");
        }
        let nowhere = vec![StayInsideTable { any_of: Vec::new() }];
        let wrong = AirspaceTable { stay_inside: nowhere, ..AirspaceTable::default() };
        assert_eq!(wrong.check().unwrap_err().field, "stay_inside[0]");
    }
}

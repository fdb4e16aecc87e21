//! Seeing a whole area: a boustrophedon, as an ox ploughs, shared among vehicles.

mod field;
mod lines;
mod share;
mod tour;
mod ways;

use nalgebra::Vector2;
use skein_planning::airspace::Airspace;

use self::field::Field;
use self::lines::{Cell, Line, across, cells, directions, extent, rows, share_seen};
use self::share::{cut_evenly, vehicles_for};
use self::tour::tours;

/// Lines end this far inside the area, metres: a vehicle that turns there stays inside. No further than half
/// a swath; less where an area is too narrow for it, and where more than one part would come of it.
const MARGINS_M: [f64; 5] = [1.0, 0.5, 0.25, 0.1, 0.0];
/// Lines are drawn closer until this share of an area is seen.
const SEEN: f64 = 0.98;
/// Drafts that are worked out to whole ways.
const MOST_TOURS: usize = 6;
/// An area that is narrower than this encloses nothing, metres.
const NARROWEST_M: f64 = 1e-6;

/// Why an area cannot be covered.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CoverageError {
    #[error(
        "an area of {corners} corners encloses nothing; give at least three, not in a line and all finite"
    )]
    NoArea { corners: usize },
    #[error("a swath of {swath_m} m; expected a width above 0")]
    Swath { swath_m: f64 },
    #[error("no vehicle to cover the area; expected at least one")]
    NoVehicles,
    #[error("no line has room: the area is closed at {height_m} m; expected some of it outside of all zones")]
    Closed { height_m: f64 },
    #[error(
        "zones and narrow places leave {parts} parts of the area between which no way leads inside it, for {vehicles} vehicles; give each part a vehicle, or leave parts out"
    )]
    Parts { parts: usize, vehicles: usize },
}

/// An area that is to be seen.
#[derive(Clone, Copy, Debug)]
pub struct Area<'a> {
    /// Corners of a simple polygon in order, either way round (ENU, metres).
    pub corners: &'a [Vector2<f64>],
    /// Height of the lines, metres.
    pub height_m: f64,
    /// Zones and terrain that lines keep off; its box counts for nothing.
    pub airspace: &'a Airspace,
}

/// Routes over an area, one for each vehicle, that together bring nearly every point of it within half a
/// swath of one, and lead nowhere but over the area, outside of what is closed (Choset and Pignon 1998).
///
/// The lines are parallel, at equal distances of at most `swath_m`, along the edge of the area for which they
/// are flown soonest. Where the area has notches and holes, they are cut into cells; each is flown
/// alternately one way and the other, and then the nearest next, by the shortest way inside the area. The
/// whole is cut into pieces that take equally long, `leg_s` being the time for a leg of some length in
/// metres, so that all vehicles are done at the same time.
///
/// `O(lines corners + places^2 corners)`, with some places for each cell, each reflex corner and each zone.
///
/// ```
/// use nalgebra::Vector2;
/// use skein_planning::airspace::Airspace;
/// use skein_swarm::coverage::{Area, cover};
///
/// let corners = [(0.0, 0.0), (40.0, 0.0), (40.0, 20.0), (0.0, 20.0)].map(|(x, y)| Vector2::new(x, y));
/// let field = Area { corners: &corners, height_m: 3.0, airspace: &Airspace::default() };
/// let routes = cover(&field, 10.0, 1, &|leg_m| 2.0 + leg_m)?;
/// assert_eq!(routes[0].len(), 4, "two lines there and back, 5 m from the edges");
/// assert_eq!(routes[0][0], Vector2::new(1.0, 5.0));
/// # Ok::<(), skein_swarm::coverage::CoverageError>(())
/// ```
///
/// # Errors
/// The area, the swath or the number of vehicles is none; nothing of the area is open; it is in more parts
/// than there are vehicles.
pub fn cover(
    area: &Area<'_>,
    swath_m: f64,
    vehicles: usize,
    leg_s: &dyn Fn(f64) -> f64,
) -> Result<Vec<Vec<Vector2<f64>>>, CoverageError> {
    let Area { corners, height_m, airspace } = *area;
    if swath_m.is_nan() || swath_m <= 0.0 {
        return Err(CoverageError::Swath { swath_m });
    }
    if vehicles == 0 {
        return Err(CoverageError::NoVehicles);
    }
    if !encloses_something(corners) {
        return Err(CoverageError::NoArea { corners: corners.len() });
    }
    let mut field = Field::new(corners, height_m, airspace);
    let ways = best_tours(&mut field, swath_m, leg_s).ok_or(CoverageError::Closed { height_m })?;
    let parts = ways.len();
    if parts > vehicles {
        return Err(CoverageError::Parts { parts, vehicles });
    }
    let times_s: Vec<f64> = ways.iter().map(|way| time_s(way, leg_s)).collect();
    let counts = vehicles_for(&times_s, vehicles);
    Ok(ways.iter().zip(counts).flat_map(|(way, count)| cut_evenly(way, count, leg_s)).collect())
}

fn encloses_something(corners: &[Vector2<f64>]) -> bool {
    let is_wide = |along: &Vector2<f64>| {
        let [low, high] = extent(corners, &across(along));
        high - low > NARROWEST_M
    };
    corners.iter().flat_map(|corner| corner.iter()).all(|c| c.is_finite())
        && !directions(corners).is_empty()
        && directions(corners).iter().all(is_wide)
}

/// Lines along a direction, and what is seen from them.
struct Draft {
    along: Vector2<f64>,
    rows: Vec<Vec<Line>>,
    seen: f64,
    /// Time for the lines and from each to the next, if that is beside it.
    lines_s: f64,
}

/// A way over each part of the field.
struct Tours {
    ways: Vec<Vec<Vector2<f64>>>,
    seen: f64,
    time_s: f64,
}

impl Tours {
    /// More is better: enough is seen, in one part, soon; or else much.
    fn merit(&self) -> (bool, bool, f64) {
        let is_enough = self.seen >= SEEN;
        (is_enough, self.ways.len() == 1, if is_enough { -self.time_s } else { self.seen })
    }
}

/// A way over each part of the field, of which there are as few as can be; `None` if no line has room.
fn best_tours(
    field: &mut Field<'_>,
    swath_m: f64,
    leg_s: &dyn Fn(f64) -> f64,
) -> Option<Vec<Vec<Vector2<f64>>>> {
    let places = field.places();
    let mut best: Option<Tours> = None;
    for margin_m in MARGINS_M {
        field.set_margin(margin_m.min(0.5 * swath_m));
        for Draft { along, rows, seen, .. } in drafts(field, swath_m, &places, leg_s) {
            let cells: Vec<Cell> = cells(field, &along, &rows);
            let ways = tours(field, &cells);
            let time_s = ways.iter().map(|way| time_s(way, leg_s)).sum();
            let tours = Tours { ways, seen, time_s };
            if best.as_ref().is_none_or(|known| tours.merit() > known.merit()) {
                best = Some(tours);
            }
        }
        if best.as_ref().is_some_and(|best| best.merit() >= (true, true, f64::NEG_INFINITY)) {
            break;
        }
    }
    best.map(|best| best.ways)
}

/// The drafts that may be best: those in which enough is seen and that take the least time; else those in
/// which most is seen.
fn drafts(
    field: &Field<'_>,
    swath_m: f64,
    places: &[Vector2<f64>],
    leg_s: &dyn Fn(f64) -> f64,
) -> Vec<Draft> {
    let along = directions(field.corners()).into_iter();
    let drafts = along.flat_map(|along| drafts_along(field, along, swath_m, places, leg_s));
    let mut drafts: Vec<Draft> = drafts.filter(|draft| draft.lines_s > 0.0).collect();
    drafts.sort_by(|one, other| {
        let missing = |draft: &Draft| (SEEN - draft.seen).max(0.0);
        missing(one).total_cmp(&missing(other)).then(one.lines_s.total_cmp(&other.lines_s))
    });
    drafts.truncate(MOST_TOURS);
    drafts
}

/// The lines in a direction: as few as let enough be seen, and one more, since an odd number of them ends
/// elsewhere than an even one.
fn drafts_along(
    field: &Field<'_>,
    along: Vector2<f64>,
    swath_m: f64,
    places: &[Vector2<f64>],
    leg_s: &dyn Fn(f64) -> f64,
) -> Vec<Draft> {
    let [low, high] = extent(field.corners(), &across(&along));
    let fewest = ((high - low) / swath_m - 1e-9).ceil().max(1.0) as usize;
    let with = |count: usize| {
        let rows = rows(field, &along, count);
        let seen = share_seen(places, &rows, 0.5 * swath_m);
        let turn_s = leg_s((high - low) / count as f64);
        let times_s = rows.iter().flatten().map(|[rear, front]| leg_s((front - rear).norm()) + turn_s);
        Draft { along, seen, lines_s: times_s.sum(), rows }
    };
    let mut best = with(fewest);
    let mut count = fewest;
    while best.seen < SEEN && count < 2 * fewest + 3 {
        count += 1;
        let closer = with(count);
        if closer.seen > best.seen {
            best = closer;
        }
    }
    vec![with(count + 1), best]
}

fn time_s(way: &[Vector2<f64>], leg_s: &dyn Fn(f64) -> f64) -> f64 {
    way.windows(2).map(|leg| leg_s((leg[1] - leg[0]).norm())).sum()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::Rotation2;
    use proptest::prelude::*;
    use skein_planning::airspace::{KeepOut, NoFlyPrism, NoFlyZone};

    use super::*;

    /// A vehicle at 3 m/s that comes to a stop at each end.
    fn leg_s(leg_m: f64) -> f64 {
        2.0 + leg_m / 3.0
    }

    fn covered(
        corners: &[Vector2<f64>],
        airspace: &Airspace,
        swath_m: f64,
        vehicles: usize,
    ) -> Vec<Vec<Vector2<f64>>> {
        cover(&Area { corners, height_m: 3.0, airspace }, swath_m, vehicles, &leg_s).unwrap()
    }

    fn field<const N: usize>(corners: [(f64, f64); N]) -> Vec<Vector2<f64>> {
        corners.map(|(x, y)| Vector2::new(x, y)).to_vec()
    }

    /// The field of a farm around a yard with houses.
    fn around_a_yard() -> Vec<Vector2<f64>> {
        field([
            (0.0, 0.0),
            (50.0, 0.0),
            (50.0, 45.0),
            (35.0, 45.0),
            (35.0, 15.0),
            (20.0, 15.0),
            (20.0, 45.0),
            (0.0, 45.0),
        ])
    }

    fn as_zone(corners: &[Vector2<f64>]) -> NoFlyPrism {
        NoFlyPrism { corners: corners.to_vec(), floor_m: f64::NEG_INFINITY, ceiling_m: f64::INFINITY }
    }

    fn nearest_m(routes: &[Vec<Vector2<f64>>], place: &Vector2<f64>) -> f64 {
        let to_leg = |leg: &[Vector2<f64>]| {
            let way = leg[1] - leg[0];
            let share = ((place - leg[0]).dot(&way) / way.norm_squared().max(1e-12)).clamp(0.0, 1.0);
            (leg[0] + way * share - place).norm()
        };
        routes.iter().flat_map(|route| route.windows(2)).map(to_leg).fold(f64::INFINITY, f64::min)
    }

    /// The share of the area, less its zones, that is seen from the routes; on another grid than they are
    /// made by.
    fn seen(
        corners: &[Vector2<f64>],
        airspace: &Airspace,
        swath_m: f64,
        routes: &[Vec<Vector2<f64>>],
    ) -> f64 {
        let (zone, closed) = (as_zone(corners), KeepOut::new(airspace.clone(), 0.0, 0.0));
        let grid = (0..150).flat_map(|i| (0..150).map(move |j| Vector2::new(f64::from(i), f64::from(j))));
        let places = grid.map(|at| at * 0.83 - Vector2::new(60.3, 60.7));
        let inside = |place: &Vector2<f64>| {
            zone.off_outline_m(*place) < 0.0 && closed.bare_room_m(&place.push(3.0)) >= 0.0
        };
        let places: Vec<_> = places.filter(inside).collect();
        let seen = places.iter().filter(|place| nearest_m(routes, place) <= 0.5 * swath_m).count();
        seen as f64 / places.len() as f64
    }

    /// No leg leads out of the area or into a zone.
    fn stays_inside(corners: &[Vector2<f64>], airspace: &Airspace, routes: &[Vec<Vector2<f64>>]) -> bool {
        let (zone, closed) = (as_zone(corners), KeepOut::new(airspace.clone(), 0.0, 0.0));
        let is_inside = |place: &Vector2<f64>| {
            zone.off_outline_m(*place) <= 0.03 && closed.bare_room_m(&place.push(3.0)) >= 0.0
        };
        let points = |leg: &[Vector2<f64>]| {
            (0..=50).map(|k| leg[0].lerp(&leg[1], f64::from(k) / 50.0)).collect::<Vec<_>>()
        };
        routes.iter().flat_map(|route| route.windows(2)).flat_map(points).all(|place| is_inside(&place))
    }

    /// A polygon with notches, star-shaped or as a comb, about the origin.
    fn area() -> impl Strategy<Value = Vec<Vector2<f64>>> {
        let star = prop::collection::vec(20.0..60.0_f64, 3..10).prop_map(|radii| {
            let corners = radii.len() as f64;
            let corner = |(k, radius): (usize, &f64)| {
                let (sin, cos) = (TAU * k as f64 / corners + 0.3).sin_cos();
                Vector2::new(radius * cos, radius * sin)
            };
            radii.iter().enumerate().map(corner).collect::<Vec<_>>()
        });
        let comb = (prop::collection::vec(5.0..50.0_f64, 3..7), 8.0..14.0_f64, -3.0..3.0_f64);
        let comb = comb.prop_map(|(depths, tooth_m, turn)| {
            let width_m = tooth_m * depths.len() as f64;
            let teeth = depths.iter().enumerate().flat_map(|(k, depth)| {
                let (from, to) = (k as f64 * tooth_m, (k + 1) as f64 * tooth_m);
                [Vector2::new(from, *depth), Vector2::new(to, *depth)]
            });
            let base = [Vector2::new(width_m, -10.0), Vector2::new(0.0, -10.0)];
            let turn = Rotation2::new(turn);
            teeth.chain(base).map(|corner| turn * (corner - Vector2::new(0.5 * width_m, 10.0))).collect()
        });
        prop_oneof![star, comb]
    }

    /// A round zone, and a triangular one.
    fn zones() -> impl Strategy<Value = Airspace> {
        let place = || (-25.0..25.0_f64, -25.0..25.0_f64).prop_map(|(x, y)| Vector2::new(x, y));
        (place(), 1.0..5.0_f64, place(), 2.0..6.0_f64).prop_map(|(centre, radius_m, at, size_m)| {
            let triangle =
                [(0.0, 0.0), (1.0, 0.2), (0.4, 1.0)].map(|(x, y)| at + Vector2::new(x, y) * size_m);
            let (floor_m, ceiling_m) = (0.0, 10.0);
            Airspace {
                no_fly: vec![NoFlyZone { centre, radius_m, floor_m, ceiling_m }],
                prisms: vec![NoFlyPrism { corners: triangle.to_vec(), floor_m, ceiling_m }],
                ..Airspace::default()
            }
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]
        #[test]
        fn nearly_all_of_any_area_is_seen_and_nothing_else_flown_over(
            corners in area(),
            airspace in zones(),
            swath_m in 3.0..12.0_f64,
            vehicles in 1..6_usize,
        ) {
            let area = Area { corners: &corners, height_m: 3.0, airspace: &airspace };
            let routes = match cover(&area, swath_m, vehicles, &leg_s) {
                Err(CoverageError::Parts { parts, .. }) if parts > vehicles => return Ok(()),
                routes => routes.unwrap(),
            };
            prop_assert_eq!(routes.len(), vehicles);
            prop_assert!(stays_inside(&corners, &airspace, &routes));
            let share = seen(&corners, &airspace, swath_m, &routes);
            prop_assert!(share > 0.97, "{share} seen");
        }

        #[test]
        fn all_take_equally_long(corners in area(), swath_m in 4.0..30.0_f64, vehicles in 1..6_usize) {
            let routes = covered(&corners, &Airspace::default(), swath_m, vehicles);
            prop_assert_eq!(routes.len(), vehicles);
            let times_s: Vec<f64> = routes.iter().map(|route| time_s(route, &leg_s)).collect();
            let [least_s, most_s] = [f64::min, f64::max].map(|of| times_s.iter().copied().reduce(of).unwrap());
            // A leg that is cut is stopped at twice.
            prop_assert!(most_s - least_s < 2.0 * leg_s(0.0) + 1e-6, "{times_s:?}");
            for pair in routes.windows(2) {
                prop_assert_eq!(pair[0].last(), pair[1].first());
            }
        }
    }

    #[test]
    fn lines_over_a_field_with_a_notch_stop_at_it_and_the_ways_between_them_go_around() {
        let corners = around_a_yard();
        for vehicles in 1..5 {
            let routes = covered(&corners, &Airspace::default(), 6.0, vehicles);
            let over_the_yard = |place: Vector2<f64>| place.x > 20.0 && place.x < 35.0 && place.y > 15.0;
            let legs = routes.iter().flat_map(|route| route.windows(2));
            let mut points =
                legs.flat_map(|leg| (0..=100).map(|k| leg[0].lerp(&leg[1], f64::from(k) / 100.0)));
            assert!(points.all(|place| !over_the_yard(place)));
            let share = seen(&corners, &Airspace::default(), 6.0, &routes);
            assert!(share > 0.97, "{share}");
        }
    }

    #[test]
    fn a_zone_within_a_field_is_a_hole_that_lines_go_around() {
        let corners = field([(0.0, 0.0), (60.0, 0.0), (60.0, 40.0), (0.0, 40.0)]);
        let zone =
            NoFlyZone { centre: Vector2::new(30.0, 20.0), radius_m: 8.0, floor_m: 0.0, ceiling_m: 10.0 };
        let airspace = Airspace { no_fly: vec![zone], ..Airspace::default() };
        let routes = covered(&corners, &airspace, 6.0, 2);
        assert!(stays_inside(&corners, &airspace, &routes));
        assert!(seen(&corners, &airspace, 6.0, &routes) > 0.97);
        let above = Airspace { no_fly: vec![NoFlyZone { floor_m: 6.0, ..zone }], ..Airspace::default() };
        let over = covered(&corners, &above, 6.0, 1);
        assert!(nearest_m(&over, &zone.centre) < 3.1, "what is closed higher up is flown under");
    }

    #[test]
    fn a_field_in_two_parts_takes_two_vehicles() {
        let corners = field([(0.0, 0.0), (60.0, 0.0), (60.0, 20.0), (0.0, 20.0)]);
        let wall = field([(20.0, -5.0), (25.0, -5.0), (25.0, 25.0), (20.0, 25.0)]);
        let wall = NoFlyPrism { corners: wall, floor_m: 0.0, ceiling_m: 10.0 };
        let airspace = Airspace { prisms: vec![wall], ..Airspace::default() };
        let area = Area { corners: &corners, height_m: 3.0, airspace: &airspace };
        assert_eq!(cover(&area, 5.0, 1, &leg_s), Err(CoverageError::Parts { parts: 2, vehicles: 1 }));
        let routes = cover(&area, 5.0, 3, &leg_s).unwrap();
        let east = routes.iter().filter(|route| route[0].x > 25.0).count();
        assert_eq!(east, 2, "the larger part has two of three");
        let closed = Airspace { prisms: vec![as_zone(&corners)], ..Airspace::default() };
        let area = Area { airspace: &closed, ..area };
        assert_eq!(cover(&area, 5.0, 1, &leg_s), Err(CoverageError::Closed { height_m: 3.0 }));
    }

    #[test]
    fn a_neck_that_is_narrower_than_the_margins_is_flown_through() {
        let corners = field([
            (0.0, 0.0),
            (20.0, 0.0),
            (20.0, 9.5),
            (30.0, 9.5),
            (30.0, 0.0),
            (50.0, 0.0),
            (50.0, 20.0),
            (30.0, 20.0),
            (30.0, 10.5),
            (20.0, 10.5),
            (20.0, 20.0),
            (0.0, 20.0),
        ]);
        let routes = covered(&corners, &Airspace::default(), 5.0, 1);
        assert_eq!(routes.len(), 1);
        assert!(stays_inside(&corners, &Airspace::default(), &routes));
    }

    #[test]
    fn lines_run_along_the_longer_side_however_it_lies() {
        for angle in [0.0, 0.7, 2.0] {
            let turn = Rotation2::new(angle);
            let corners = field([(0.0, 0.0), (40.0, 0.0), (40.0, 20.0), (0.0, 20.0)]);
            let corners: Vec<_> = corners.iter().map(|corner| turn * corner).collect();
            let routes = covered(&corners, &Airspace::default(), 5.0, 1);
            let length_m: f64 = routes[0].windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
            assert!((length_m - (4.0 * 38.0 + 3.0 * 5.0)).abs() < 0.2, "{length_m}");
        }
    }

    #[test]
    fn what_encloses_nothing_is_refused() {
        let try_cover = |corners: &[Vector2<f64>], swath_m, vehicles| {
            cover(&Area { corners, height_m: 3.0, airspace: &Airspace::default() }, swath_m, vehicles, &leg_s)
        };
        let line = field([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)]);
        for area in [&line[..0], &line[..2], &line] {
            assert_eq!(try_cover(area, 1.0, 1), Err(CoverageError::NoArea { corners: area.len() }));
        }
        assert_eq!(
            try_cover(&[Vector2::new(f64::NAN, 0.0)], 1.0, 1),
            Err(CoverageError::NoArea { corners: 1 })
        );
        let triangle = field([(0.0, 0.0), (4.0, 0.0), (4.0, 2.0)]);
        assert_eq!(try_cover(&triangle, 0.0, 1), Err(CoverageError::Swath { swath_m: 0.0 }));
        assert_eq!(try_cover(&triangle, 1.0, 0), Err(CoverageError::NoVehicles));
    }
}

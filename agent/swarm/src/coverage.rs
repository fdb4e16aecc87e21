//! Seeing a whole area: a boustrophedon, as an ox ploughs, shared among vehicles.

use nalgebra::{Rotation2, Vector2};

/// Corners closer together than this are one corner, metres.
const SAME_CORNER_M: f64 = 1e-6;

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
}

/// Routes over an area, one for each vehicle, that together bring every point of it within half a swath of one,
/// measured across the lines (Choset and Pignon 1998, without their cells).
///
/// `area` has the corners of a simple polygon in order (ENU, metres), either way round. The lines are parallel, at
/// equal distances of at most `swath_m`, along the direction in which they are fewest, and flown alternately one way
/// and the other. The way along them is cut into pieces of equal length, so that all vehicles are done at the same
/// time. Where the area is not convex, a line may cross a gap in it.
///
/// `O(corners^2 + lines corners)`.
///
/// ```
/// use nalgebra::Vector2;
/// use skein_swarm::coverage::cover;
///
/// let field = [(0.0, 0.0), (40.0, 0.0), (40.0, 20.0), (0.0, 20.0)].map(|(x, y)| Vector2::new(x, y));
/// let routes = cover(&field, 10.0, 1)?;
/// assert_eq!(routes[0].len(), 4, "two lines there and back, 5 m from the edges");
/// assert_eq!(routes[0][0].y, 5.0);
/// # Ok::<(), skein_swarm::coverage::CoverageError>(())
/// ```
pub fn cover(
    area: &[Vector2<f64>],
    swath_m: f64,
    vehicles: usize,
) -> Result<Vec<Vec<Vector2<f64>>>, CoverageError> {
    if swath_m.is_nan() || swath_m <= 0.0 {
        return Err(CoverageError::Swath { swath_m });
    }
    if vehicles == 0 {
        return Err(CoverageError::NoVehicles);
    }
    let nothing = CoverageError::NoArea { corners: area.len() };
    if !area.iter().all(|corner| corner.iter().all(|c| c.is_finite())) {
        return Err(nothing);
    }
    let along = direction_of_least_width(area).ok_or(nothing)?;
    let level = Rotation2::rotation_between(&along, &Vector2::x());
    let turned: Vec<_> = area.iter().map(|corner| level * corner).collect();
    let way: Vec<_> = plough(&turned, swath_m).iter().map(|point| level.inverse() * point).collect();
    Ok(cut_evenly(&way, vehicles))
}

/// The unit direction across which the area is narrowest: that of an edge of its convex hull. `None` if it encloses
/// nothing.
fn direction_of_least_width(area: &[Vector2<f64>]) -> Option<Vector2<f64>> {
    let hull = convex_hull(area);
    let width_along = |direction: &Vector2<f64>| {
        let across = hull.iter().map(|corner| direction.perp(corner));
        across.clone().fold(f64::NEG_INFINITY, f64::max) - across.fold(f64::INFINITY, f64::min)
    };
    let edges = hull.iter().zip(hull.iter().cycle().skip(1));
    let directions = edges.filter_map(|(from, to)| (to - from).try_normalize(SAME_CORNER_M));
    let narrowest = directions.min_by(|one, other| width_along(one).total_cmp(&width_along(other)))?;
    (width_along(&narrowest) > SAME_CORNER_M).then_some(narrowest)
}

/// Corners of the convex hull, counter-clockwise (Andrew 1979).
fn convex_hull(points: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|one, other| one.x.total_cmp(&other.x).then(one.y.total_cmp(&other.y)));
    let half = |points: &mut dyn Iterator<Item = &Vector2<f64>>| {
        let mut chain: Vec<Vector2<f64>> = Vec::new();
        for point in points {
            while let [.., before, last] = chain.as_slice()
                && (last - before).perp(&(point - last)) <= 0.0
            {
                chain.pop();
            }
            chain.push(*point);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut sorted.iter());
    hull.extend(half(&mut sorted.iter().rev()));
    hull
}

/// Lines along x over the area, flown in turn to the east and to the west.
fn plough(area: &[Vector2<f64>], swath_m: f64) -> Vec<Vector2<f64>> {
    let south = area.iter().map(|corner| corner.y).fold(f64::INFINITY, f64::min);
    let north = area.iter().map(|corner| corner.y).fold(f64::NEG_INFINITY, f64::max);
    let lines = ((north - south) / swath_m - 1e-9).ceil().max(1.0);
    let strip_m = (north - south) / lines;
    let mut way = Vec::new();
    for line in 0..lines as usize {
        let low = south + line as f64 * strip_m;
        let middle = low + 0.5 * strip_m;
        if let Some((west, east)) = extent_in_strip(area, low, low + strip_m) {
            let ends = [Vector2::new(west, middle), Vector2::new(east, middle)];
            way.extend(if line % 2 == 0 { ends } else { [ends[1], ends[0]] });
        }
    }
    way
}

/// From where to where the area reaches along x between two heights.
fn extent_in_strip(area: &[Vector2<f64>], low: f64, high: f64) -> Option<(f64, f64)> {
    let mut extent: Option<(f64, f64)> = None;
    for (from, to) in area.iter().zip(area.iter().cycle().skip(1)) {
        let (below, above) = if from.y <= to.y { (from, to) } else { (to, from) };
        if above.y < low || below.y > high {
            continue;
        }
        let rise = above.y - below.y;
        let at = |y: f64| {
            let share = if rise > 0.0 { ((y - below.y) / rise).clamp(0.0, 1.0) } else { 0.0 };
            below.x + (above.x - below.x) * share
        };
        let ends = if rise > 0.0 { [at(low), at(high)] } else { [below.x, above.x] };
        for x in ends {
            let (west, east) = extent.unwrap_or((x, x));
            extent = Some((west.min(x), east.max(x)));
        }
    }
    extent
}

/// Cuts a way into pieces of equal length.
fn cut_evenly(way: &[Vector2<f64>], pieces: usize) -> Vec<Vec<Vector2<f64>>> {
    let length_m: f64 = way.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
    let piece_m = length_m / pieces as f64;
    let mut routes: Vec<Vec<_>> = vec![Vec::new(); pieces];
    let Some(start) = way.first() else { return routes };
    routes[0].push(*start);
    let (mut piece, mut flown_m) = (0, 0.0);
    for leg in way.windows(2) {
        let leg_m = (leg[1] - leg[0]).norm();
        while piece + 1 < pieces && (piece + 1) as f64 * piece_m <= flown_m + leg_m {
            let share = if leg_m > 0.0 { ((piece + 1) as f64 * piece_m - flown_m) / leg_m } else { 0.0 };
            let cut = leg[0] + (leg[1] - leg[0]) * share;
            routes[piece].push(cut);
            piece += 1;
            routes[piece].push(cut);
        }
        routes[piece].push(leg[1]);
        flown_m += leg_m;
    }
    routes
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;

    fn length_m(route: &[Vector2<f64>]) -> f64 {
        route.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum()
    }

    fn contains(area: &[Vector2<f64>], point: &Vector2<f64>) -> bool {
        let crosses = |(from, to): &(&Vector2<f64>, &Vector2<f64>)| {
            (from.y > point.y) != (to.y > point.y)
                && point.x < from.x + (to.x - from.x) * (point.y - from.y) / (to.y - from.y)
        };
        area.iter().zip(area.iter().cycle().skip(1)).filter(crosses).count() % 2 == 1
    }

    fn distance_m(route: &[Vector2<f64>], point: &Vector2<f64>) -> f64 {
        let to_leg = |leg: &[Vector2<f64>]| {
            let way = leg[1] - leg[0];
            let share = ((point - leg[0]).dot(&way) / way.norm_squared().max(1e-12)).clamp(0.0, 1.0);
            (leg[0] + way * share - point).norm()
        };
        route.windows(2).map(to_leg).fold(f64::INFINITY, f64::min)
    }

    /// A star-shaped polygon, convex or not.
    fn area() -> impl Strategy<Value = Vec<Vector2<f64>>> {
        prop::collection::vec(20.0..60.0_f64, 3..9).prop_map(|radii| {
            let corners = radii.len() as f64;
            let corner = |(k, radius): (usize, &f64)| {
                let (sin, cos) = (TAU * k as f64 / corners + 0.3).sin_cos();
                Vector2::new(radius * cos + 100.0, radius * sin - 50.0)
            };
            radii.iter().enumerate().map(corner).collect()
        })
    }

    proptest! {
        #[test]
        fn every_point_comes_within_half_a_swath(
            area in area(),
            swath_m in 4.0..30.0_f64,
            vehicles in 1..6_usize,
            places in prop::collection::vec((40.0..160.0_f64, -110.0..10.0_f64), 60),
        ) {
            let routes = cover(&area, swath_m, vehicles).unwrap();
            for (x, y) in places {
                let place = Vector2::new(x, y);
                if contains(&area, &place) {
                    let nearest = routes.iter().map(|route| distance_m(route, &place)).fold(f64::INFINITY, f64::min);
                    prop_assert!(nearest <= 0.5 * swath_m + 1e-6, "{nearest} m from {place}");
                }
            }
        }

        #[test]
        fn all_fly_equally_far(area in area(), swath_m in 4.0..30.0_f64, vehicles in 1..6_usize) {
            let routes = cover(&area, swath_m, vehicles).unwrap();
            prop_assert_eq!(routes.len(), vehicles);
            let whole: f64 = routes.iter().map(|route| length_m(route)).sum();
            for route in &routes {
                prop_assert!((length_m(route) - whole / vehicles as f64).abs() < 1e-6);
            }
            for pair in routes.windows(2) {
                prop_assert_eq!(pair[0].last(), pair[1].first());
            }
        }
    }

    #[test]
    fn every_line_is_flown_whole_and_by_one_after_another() {
        let field = [(0.0, 0.0), (50.0, 0.0), (50.0, 30.0), (0.0, 30.0)].map(|(x, y)| Vector2::new(x, y));
        let routes = cover(&field, 6.0, 3).unwrap();
        for line in 0..5 {
            let y = 3.0 + 6.0 * f64::from(line);
            let legs = routes.iter().flat_map(|route| route.windows(2));
            let on_line = legs.filter(|leg| leg.iter().all(|end| (end.y - y).abs() < 1e-9));
            let flown_m: f64 = on_line.map(|leg| (leg[1] - leg[0]).norm()).sum();
            assert!((flown_m - 50.0).abs() < 1e-9, "line {line}: {flown_m} m");
        }
    }

    #[test]
    fn lines_run_along_the_longer_side_however_it_lies() {
        for angle in [0.0, 0.7, 2.0] {
            let turn = Rotation2::new(angle);
            let field = [(0.0, 0.0), (40.0, 0.0), (40.0, 20.0), (0.0, 20.0)];
            let field = field.map(|(x, y)| turn * Vector2::new(x, y));
            let routes = cover(&field, 5.0, 1).unwrap();
            assert!((length_m(&routes[0]) - (4.0 * 40.0 + 3.0 * 5.0)).abs() < 1e-9);
        }
    }

    #[test]
    fn what_encloses_nothing_is_refused() {
        let line = [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)].map(|(x, y)| Vector2::new(x, y));
        for area in [&line[..0], &line[..2], &line] {
            assert_eq!(cover(area, 1.0, 1), Err(CoverageError::NoArea { corners: area.len() }));
        }
        assert_eq!(cover(&[Vector2::new(f64::NAN, 0.0)], 1.0, 1), Err(CoverageError::NoArea { corners: 1 }));
        let field = [(0.0, 0.0), (4.0, 0.0), (4.0, 2.0)].map(|(x, y)| Vector2::new(x, y));
        assert_eq!(cover(&field, 0.0, 1), Err(CoverageError::Swath { swath_m: 0.0 }));
        assert_eq!(cover(&field, 1.0, 0), Err(CoverageError::NoVehicles));
    }
}

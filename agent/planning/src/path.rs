//! A path: a polyline with its arc length.

use nalgebra::Vector3;

/// Points closer together than this are one point (metres).
const SAME_POINT_M: f64 = 1e-9;

/// A polyline in the world frame (ENU, metres), parametrised by arc length from its start, its *station*.
///
/// A path has at least one point and only finite coordinates; neighbouring points differ.
///
/// ```
/// use nalgebra::Vector3;
/// use skein_planning::Path;
///
/// let path = Path::new(vec![Vector3::zeros(), Vector3::new(4.0, 0.0, 0.0), Vector3::new(4.0, 3.0, 0.0)]).unwrap();
/// assert_eq!(path.length_m(), 7.0);
/// assert_eq!(path.point_at(5.0), Vector3::new(4.0, 1.0, 0.0));
/// assert_eq!(path.project(&Vector3::new(2.0, -1.0, 0.0)).station_m, 2.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    points: Vec<Vector3<f64>>,
    stations: Vec<f64>,
}

/// Where a point falls on a path: the result of [`Path::project`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Arc length from the path's start to `point`, metres.
    pub station_m: f64,
    /// The nearest point of the path.
    pub point: Vector3<f64>,
    /// Distance from the projected point to `point`, metres.
    pub distance_m: f64,
}

/// A bend of a path at one of its inner points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Arc length from the path's start, metres.
    pub station_m: f64,
    /// Cosine of the angle by which the direction turns: 1 is straight on, -1 is back the way it came.
    pub turn_cos: f64,
}

impl Path {
    /// A path through `points`, in order. Repeated points are dropped.
    ///
    /// `None` if there is no point, or a coordinate is not finite.
    pub fn new(points: Vec<Vector3<f64>>) -> Option<Path> {
        if points.iter().any(|point| !point.iter().all(|c| c.is_finite())) {
            return None;
        }
        let mut kept: Vec<Vector3<f64>> = Vec::with_capacity(points.len());
        let mut stations = Vec::with_capacity(points.len());
        let mut station = 0.0;
        for point in points {
            match kept.last() {
                Some(last) => {
                    let step = (point - last).norm();
                    if step < SAME_POINT_M {
                        continue;
                    }
                    station += step;
                }
                None => station = 0.0,
            }
            kept.push(point);
            stations.push(station);
        }
        (!kept.is_empty()).then_some(Path { points: kept, stations })
    }

    /// The path that stays at a point.
    pub(crate) fn at(point: Vector3<f64>) -> Path {
        Path { points: vec![point], stations: vec![0.0] }
    }

    /// The points, in order; at least one.
    pub fn points(&self) -> &[Vector3<f64>] {
        &self.points
    }

    /// The station of each point, metres, in order.
    pub fn stations(&self) -> &[f64] {
        &self.stations
    }

    /// The first point.
    pub fn start(&self) -> Vector3<f64> {
        self.points.first().copied().unwrap_or_default()
    }

    /// The last point.
    pub fn end(&self) -> Vector3<f64> {
        self.points.last().copied().unwrap_or_default()
    }

    /// Arc length of the whole path, metres.
    pub fn length_m(&self) -> f64 {
        self.stations.last().copied().unwrap_or(0.0)
    }

    /// The point at a station; stations beyond the ends give the ends.
    pub fn point_at(&self, station_m: f64) -> Vector3<f64> {
        match self.leg_at(station_m) {
            Some(leg) => leg.point_at(station_m),
            None => self.start(),
        }
    }

    /// Unit direction of travel at a station (at a corner, that of the leg that begins there); zero for a
    /// path of one point.
    pub fn direction_at(&self, station_m: f64) -> Vector3<f64> {
        self.leg_at(station_m).map_or_else(Vector3::zeros, |leg| leg.direction())
    }

    /// The nearest point of the path; of equally near ones the first.
    pub fn project(&self, point: &Vector3<f64>) -> Projection {
        self.project_within(point, 0.0, self.length_m())
    }

    /// The nearest point of the path between two stations; of equally near ones the first.
    ///
    /// A follower that passes the stretch around its last station does not jump where the path comes near
    /// itself again.
    pub fn project_within(&self, point: &Vector3<f64>, from_m: f64, to_m: f64) -> Projection {
        let from = from_m.clamp(0.0, self.length_m());
        let to = to_m.clamp(from, self.length_m());
        let at = |station_m: f64| {
            let on_path = self.point_at(station_m);
            Projection { station_m, point: on_path, distance_m: (point - on_path).norm() }
        };
        let mut best = at(from);
        for leg in self.legs() {
            if leg.to_m < from || leg.from_m > to {
                continue;
            }
            let along = (point - leg.start).dot(&leg.direction());
            let station = (leg.from_m + along).clamp(leg.from_m.max(from), leg.to_m.min(to));
            let on_leg = leg.point_at(station);
            let distance_m = (point - on_leg).norm();
            if distance_m < best.distance_m {
                best = Projection { station_m: station, point: on_leg, distance_m };
            }
        }
        best
    }

    /// The bends, in order of station.
    pub fn corners(&self) -> impl Iterator<Item = Corner> + '_ {
        self.legs().zip(self.legs().skip(1)).map(|(before, after)| Corner {
            station_m: after.from_m,
            turn_cos: before.direction().dot(&after.direction()),
        })
    }

    fn legs(&self) -> impl Iterator<Item = Leg> + '_ {
        self.points.windows(2).zip(self.stations.windows(2)).filter_map(|(ends, stations)| {
            match (ends, stations) {
                ([start, end], [from_m, to_m]) => {
                    Some(Leg { start: *start, end: *end, from_m: *from_m, to_m: *to_m })
                }
                _ => None,
            }
        })
    }

    fn leg_at(&self, station_m: f64) -> Option<Leg> {
        let after = self.stations.partition_point(|station| *station <= station_m);
        let first = after.saturating_sub(1).min(self.points.len().saturating_sub(2));
        self.legs().nth(first)
    }
}

struct Leg {
    start: Vector3<f64>,
    end: Vector3<f64>,
    from_m: f64,
    to_m: f64,
}

impl Leg {
    fn direction(&self) -> Vector3<f64> {
        (self.end - self.start) / (self.to_m - self.from_m)
    }

    fn point_at(&self, station_m: f64) -> Vector3<f64> {
        let share = ((station_m - self.from_m) / (self.to_m - self.from_m)).clamp(0.0, 1.0);
        self.start + (self.end - self.start) * share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(points: &[[f64; 3]]) -> Path {
        Path::new(points.iter().map(|p| Vector3::from(*p)).collect()).unwrap()
    }

    #[test]
    fn repeated_points_are_dropped_and_nonsense_refused() {
        let path = path(&[[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
        assert_eq!(path.points().len(), 2);
        assert!(Path::new(vec![]).is_none());
        assert!(Path::new(vec![Vector3::new(0.0, f64::NAN, 0.0)]).is_none());
    }

    #[test]
    fn a_path_of_one_point_stays_there() {
        let path = path(&[[1.0, 2.0, 3.0]]);
        assert_eq!(path.length_m(), 0.0);
        assert_eq!(path.point_at(5.0), Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(path.direction_at(0.0), Vector3::zeros());
        assert_eq!(path.project(&Vector3::new(1.0, 2.0, 5.0)).distance_m, 2.0);
    }

    #[test]
    fn stations_beyond_the_ends_give_the_ends() {
        let path = path(&[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
        assert_eq!(path.point_at(-1.0), path.start());
        assert_eq!(path.point_at(9.0), path.end());
        assert_eq!(path.direction_at(9.0), Vector3::x());
    }

    #[test]
    fn projecting_within_a_stretch_does_not_jump_to_the_way_back() {
        let there_and_back = path(&[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        let point = Vector3::new(3.0, 0.9, 0.0);
        assert!((there_and_back.project(&point).station_m - 18.0).abs() < 1e-12);
        assert!((there_and_back.project_within(&point, 2.0, 5.0).station_m - 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_right_angle_is_a_corner_of_cosine_zero() {
        let path = path(&[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0]]);
        let corners: Vec<_> = path.corners().collect();
        assert_eq!(corners, vec![Corner { station_m: 2.0, turn_cos: 0.0 }]);
    }
}

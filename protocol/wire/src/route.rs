//! A route: points that a vehicle is to fly one after another.

use std::fmt;
use std::str::FromStr;

/// Points in the order in which they are flown, metres ENU: at least one, at most [`Route::MOST_POINTS`].
///
/// Those that are its *targets* are reached whatever comes; the others, written with a `~`, are only the way there, and
/// whoever finds a better one may leave them out. The last is a target.
///
/// ```
/// use skein_wire::Route;
///
/// let route: Route = "1 2 3; 4.5 -2 3".parse()?;
/// assert_eq!(route.points(), [[1.0, 2.0, 3.0], [4.5, -2.0, 3.0]]);
/// assert_eq!(route.to_string(), "1 2 3; 4.5 -2 3");
/// let route: Route = "~1 2 3; 4.5 -2 3".parse()?;
/// assert_eq!((route.points().len(), route.targets().count()), (2, 1));
/// # Ok::<(), skein_wire::UnfitRoute>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    points: Vec<[f64; 3]>,
    /// Whether each point is only the way to the next target.
    is_way: Vec<bool>,
}

/// Why points are no route.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnfitRoute {
    #[error("a route of {0} points: expected 1 to {most}", most = Route::MOST_POINTS)]
    Length(usize),
    #[error("point {number}, `{text}`: expected three numbers of at most 100 km: metres east, north and up")]
    Point { number: usize, text: String },
    #[error("the route ends with a point that is only the way: expected a target")]
    End,
}

/// Stands before a point that is only the way to the next target.
const WAY: &str = "~";

/// No vehicle flies further than this from the world's origin, m.
const FURTHEST_M: f64 = 1e5;

impl Route {
    /// So many points travel in one order.
    pub const MOST_POINTS: usize = 64;

    /// # Errors
    /// There are none or too many, or one is not finite, or beyond 100 km.
    pub fn new(points: Vec<[f64; 3]>) -> Result<Self, UnfitRoute> {
        if !(1..=Self::MOST_POINTS).contains(&points.len()) {
            return Err(UnfitRoute::Length(points.len()));
        }
        let is_unfit =
            |point: &[f64; 3]| point.iter().any(|metres| !(-FURTHEST_M..=FURTHEST_M).contains(metres));
        match points.iter().position(is_unfit) {
            Some(index) => Err(UnfitRoute::Point { number: index + 1, text: written(&points[index]) }),
            None => Ok(Self { is_way: vec![false; points.len()], points }),
        }
    }

    /// The same route, of which only the points with these numbers, from 0, are targets, and the last.
    #[must_use]
    pub fn with_targets(self, targets: &[usize]) -> Self {
        let last = self.points.len() - 1;
        let is_way = (0..=last).map(|index| index < last && !targets.contains(&index)).collect();
        Self { is_way, ..self }
    }

    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// The points that are reached whatever comes, each with its number, from 0.
    pub fn targets(&self) -> impl Iterator<Item = (usize, [f64; 3])> + '_ {
        let points = self.points.iter().copied().enumerate().zip(&self.is_way);
        points.filter(|(_, is_way)| !**is_way).map(|(point, _)| point)
    }
}

fn written([x, y, z]: &[f64; 3]) -> String {
    format!("{x} {y} {z}")
}

impl fmt::Display for Route {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let point =
            |(point, is_way): (_, &bool)| format!("{}{}", if *is_way { WAY } else { "" }, written(point));
        f.write_str(&self.points.iter().zip(&self.is_way).map(point).collect::<Vec<_>>().join("; "))
    }
}

impl FromStr for Route {
    type Err = UnfitRoute;

    fn from_str(text: &str) -> Result<Self, UnfitRoute> {
        let parts = || text.split(';').map(str::trim).take(Self::MOST_POINTS + 1);
        let points = parts().enumerate().map(|(index, written)| {
            let point = written.strip_prefix(WAY).unwrap_or(written);
            let metres: Option<Vec<f64>> = point.split_whitespace().map(|word| word.parse().ok()).collect();
            let text = written.chars().take(64).collect();
            metres
                .and_then(|metres| metres.try_into().ok())
                .ok_or(UnfitRoute::Point { number: index + 1, text })
        });
        let route = Self::new(points.collect::<Result<_, _>>()?)?;
        let is_way: Vec<bool> = parts().map(|point| point.starts_with(WAY)).collect();
        if is_way.last() == Some(&true) { Err(UnfitRoute::End) } else { Ok(Self { is_way, ..route }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_route_is_told_with_the_point_at_fault() {
        let fault = |text: &str| text.parse::<Route>().unwrap_err().to_string();
        assert!(fault("").contains("point 1, ``"));
        assert!(fault("1 2 3; 4 5").contains("point 2, `4 5`"));
        assert!(fault("1 2 3; nan 5 1").contains("point 2"));
        assert!(fault("1 2 inf").contains("point 1"));
        assert!(fault("1 2 100001").contains("at most 100 km"));
        assert!(fault(&["1 2 3"; 70].join("; ")).contains("expected 1 to 64"));
        assert_eq!(Route::new(Vec::new()), Err(UnfitRoute::Length(0)));
        assert!(fault("1 2 3; ~4 5 6").contains("expected a target"));
        assert!(fault("1 2 3; ~~4 5 6").contains("point 2, `~~4 5 6`"));
    }

    #[test]
    fn what_is_only_the_way_is_told_from_targets_and_reads_back() {
        let route = Route::new(vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]).unwrap();
        assert_eq!(route.targets().count(), 3);
        let route = route.with_targets(&[1]);
        assert_eq!(route.to_string(), "~1 2 3; 4 5 6; 7 8 9");
        assert_eq!(route.to_string().parse(), Ok(route.clone()));
        assert_eq!(route.targets().map(|(index, _)| index).collect::<Vec<_>>(), [1, 2]);
    }
}

//! A route: points that a vehicle is to fly one after another.

use std::fmt;
use std::str::FromStr;

/// Points in the order in which they are flown, metres ENU: at least one, at most [`Route::MOST_POINTS`].
///
/// ```
/// use skein_wire::Route;
///
/// let route: Route = "1 2 3; 4.5 -2 3".parse()?;
/// assert_eq!(route.points(), [[1.0, 2.0, 3.0], [4.5, -2.0, 3.0]]);
/// assert_eq!(route.to_string(), "1 2 3; 4.5 -2 3");
/// # Ok::<(), skein_wire::UnfitRoute>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Route(Vec<[f64; 3]>);

/// Why points are no route.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnfitRoute {
    #[error("a route of {0} points: expected 1 to {most}", most = Route::MOST_POINTS)]
    Length(usize),
    #[error("point {number}, `{text}`: expected three numbers of at most 100 km: metres east, north and up")]
    Point { number: usize, text: String },
}

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
            None => Ok(Self(points)),
        }
    }

    pub fn points(&self) -> &[[f64; 3]] {
        &self.0
    }
}

fn written([x, y, z]: &[f64; 3]) -> String {
    format!("{x} {y} {z}")
}

impl fmt::Display for Route {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.iter().map(written).collect::<Vec<_>>().join("; "))
    }
}

impl FromStr for Route {
    type Err = UnfitRoute;

    fn from_str(text: &str) -> Result<Self, UnfitRoute> {
        let points = text.split(';').enumerate().map(|(index, point)| {
            let metres: Option<Vec<f64>> = point.split_whitespace().map(|word| word.parse().ok()).collect();
            let text = point.trim().chars().take(64).collect();
            metres
                .and_then(|metres| metres.try_into().ok())
                .ok_or(UnfitRoute::Point { number: index + 1, text })
        });
        Self::new(points.take(Self::MOST_POINTS + 1).collect::<Result<_, _>>()?)
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
    }
}

//! The box that a swarm searches.

/// A box: least and greatest value of each dimension, and what else is known of it.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchSpace {
    lower: Vec<f64>,
    upper: Vec<f64>,
    chain: usize,
    centre: Vec<f64>,
}

/// Why a box cannot be searched.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SearchSpaceError {
    #[error(
        "{lower} lower bounds and {upper} upper bounds, expected as many of one as of the other, and at least one"
    )]
    Lengths { lower: usize, upper: usize },
    #[error("dimension {dimension} runs from {lower} to {upper}, expected finite bounds in rising order")]
    Bounds { dimension: usize, lower: f64, upper: f64 },
    #[error("{dimensions} dimensions cannot be cut into chains of {chain}; give a length that divides them")]
    Chain { dimensions: usize, chain: usize },
    #[error("a centre of {numbers} numbers, expected {dimensions}: one for each dimension")]
    Centre { dimensions: usize, numbers: usize },
}

impl SearchSpace {
    /// A box of dimensions that have nothing to do with one another.
    pub fn new(lower: Vec<f64>, upper: Vec<f64>) -> Result<SearchSpace, SearchSpaceError> {
        if lower.len() != upper.len() || lower.is_empty() {
            return Err(SearchSpaceError::Lengths { lower: lower.len(), upper: upper.len() });
        }
        for (dimension, (&lower, &upper)) in lower.iter().zip(&upper).enumerate() {
            if !(lower.is_finite() && upper.is_finite() && lower < upper) {
                return Err(SearchSpaceError::Bounds { dimension, lower, upper });
            }
        }
        let centre = lower.iter().zip(&upper).map(|(l, u)| 0.5 * (l + u)).collect();
        Ok(SearchSpace { lower, upper, chain: 1, centre })
    }

    /// The same box, of which every `chain` successive dimensions are one quantity along a line, as the offsets of a
    /// route's waypoints are: neighbours belong together. [`super::Improved`] makes use of that.
    pub fn in_chains_of(self, chain: usize) -> Result<SearchSpace, SearchSpaceError> {
        let dimensions = self.dimensions();
        if chain == 0 || !dimensions.is_multiple_of(chain) {
            return Err(SearchSpaceError::Chain { dimensions, chain });
        }
        Ok(SearchSpace { chain, ..self })
    }

    /// The same box with another centre than its middle: where a good position is to be expected, as the direct way
    /// is for a route. It is brought into the box. [`super::Improved`] escapes towards it.
    pub fn about(self, centre: Vec<f64>) -> Result<SearchSpace, SearchSpaceError> {
        if centre.len() != self.dimensions() {
            return Err(SearchSpaceError::Centre { dimensions: self.dimensions(), numbers: centre.len() });
        }
        let centre = centre.iter().enumerate().map(|(k, value)| self.clamp(k, *value)).collect();
        Ok(SearchSpace { centre, ..self })
    }

    pub fn dimensions(&self) -> usize {
        self.lower.len()
    }

    /// Successive dimensions that belong together; 1 unless said.
    pub fn chain(&self) -> usize {
        self.chain
    }

    pub fn centre(&self) -> &[f64] {
        &self.centre
    }

    /// The least values.
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// The greatest values.
    pub fn upper(&self) -> &[f64] {
        &self.upper
    }

    pub(super) fn width(&self, dimension: usize) -> f64 {
        self.upper[dimension] - self.lower[dimension]
    }

    /// Moves a value of a dimension to the nearest one inside.
    pub(super) fn clamp(&self, dimension: usize, value: f64) -> f64 {
        value.clamp(self.lower[dimension], self.upper[dimension])
    }
}

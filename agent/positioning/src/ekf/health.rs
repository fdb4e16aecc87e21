//! Health: what a filter is corrected by, how well it agrees, and since when it does not.

use std::time::Duration;

/// A source of corrections.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Aid {
    Markers,
    Lidar,
    Satellites,
    Flow,
    Range,
    Pressure,
    Rest,
    Heading,
}

impl Aid {
    pub const ALL: [Self; 8] = [
        Self::Markers,
        Self::Lidar,
        Self::Satellites,
        Self::Flow,
        Self::Range,
        Self::Pressure,
        Self::Rest,
        Self::Heading,
    ];
}

/// The record of one source.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fused {
    /// When the newest measurement was made.
    pub measured: Option<Duration>,
    /// When the newest one was made that corrected the state.
    pub fused: Option<Duration>,
    /// Since when every one has been further off than noise explains.
    pub off_since: Option<Duration>,
    /// Measurements in a row that noise explains.
    pub fits: u64,
    /// The squared innovation of the newest by its covariance, per degree of freedom: 1 on the mean where covariances
    /// are honest.
    pub ratio: f64,
    /// Measurements that corrected the state, and that were further off than noise explains.
    pub taken: u64,
    pub refused: u64,
    /// Measurements that came too late, or were no numbers.
    pub unusable: u64,
}

/// The same of all sources.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Health([Fused; Aid::ALL.len()]);

impl Health {
    pub fn of(&self, aid: Aid) -> &Fused {
        &self.0[aid as usize]
    }

    pub(super) fn note(&mut self, aid: Aid, stamp: Duration, weighed: Weighed, is_fused: bool) {
        let fused = &mut self.0[aid as usize];
        fused.measured = fused.measured.max(Some(stamp));
        fused.ratio = weighed.ratio;
        if weighed.passed {
            fused.off_since = None;
            fused.fits += 1;
        } else {
            fused.refused += 1;
            fused.fits = 0;
            fused.off_since.get_or_insert(stamp);
        }
        if weighed.passed && is_fused {
            fused.taken += 1;
            fused.fused = fused.fused.max(Some(stamp));
        }
    }

    pub(super) fn note_unusable(&mut self, aid: Aid) {
        self.0[aid as usize].unusable += 1;
    }
}

/// A measurement against what was expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Weighed {
    pub(super) ratio: f64,
    /// Whether noise explains it.
    pub(super) passed: bool,
}

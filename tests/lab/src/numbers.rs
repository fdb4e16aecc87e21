//! Numbers on the command line.

use std::time::Duration;

use clap::builder::RangedU64ValueParser;

/// A count that is not 0.
pub fn one_or_more() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..)
}

/// A time in seconds that is not 0.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let time = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    time.filter(|time| !time.is_zero()).ok_or_else(|| "expected a number above 0".to_owned())
}

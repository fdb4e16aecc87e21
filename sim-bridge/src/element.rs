//! An account of a file by others: what of it is honoured, what does not matter, what is refused.

use serde::Serialize;

/// An element of a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Element {
    /// Its place in the file and its kind, such as `mission.items[3]: 16 waypoint`.
    pub what: String,
    /// The file that it stands in, where that may be another one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Line from 1, of the first.
    pub line: usize,
    pub verdict: Verdict,
    /// Its fate, or the fault in it; empty where that is plain.
    pub why: String,
    /// Number of those of one name and one fate.
    pub count: usize,
}

/// The fate of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It has no effect on where and when vehicles fly.
    Harmless,
    /// It is flown as the file says, or as `why` says.
    Honoured,
    /// The file is not flown because of it.
    Refused,
}

//! The account of a world file: what of it counts, what does not matter, and what could not be read.

use std::collections::HashMap;
use std::fmt;

use super::place::Place;
use super::text::Element;

/// Kinds of elements that are listed.
const MOST_ENTRIES: usize = 1000;

/// The fate of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// It counts.
    Honoured,
    /// It does not change where it is safe to fly.
    Harmless,
    /// It does, but could not be read: the world lacks it.
    Refused,
}

/// Elements of one name and one fate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// The place of the first.
    pub place: Place,
    /// Their name after that of what holds them, such as `link/collision`.
    pub element: String,
    pub verdict: Verdict,
    /// The oddity, or why it was refused; empty of what there is nothing to say about.
    pub note: String,
    pub count: usize,
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.note)?;
        if self.count > 1 {
            write!(f, " ({} times)", self.count)?;
        }
        Ok(())
    }
}

/// All elements of a world file and of those that it includes, but for what is inside of harmless ones.
#[derive(Debug, Clone, Default)]
pub struct Account {
    /// In the order in which they were first met; at most 1000.
    pub entries: Vec<Entry>,
    /// Number of elements of none of these.
    pub unlisted: usize,
    /// Number of those refused, listed or not.
    refused: usize,
    numbers: HashMap<(String, Verdict, String), usize>,
}

impl Account {
    /// Entries about which something is to be said, and which do no harm.
    pub fn notes(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(|entry| entry.verdict == Verdict::Harmless && !entry.note.is_empty())
    }

    /// All that the world lacks.
    pub fn refused(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter().filter(|entry| entry.verdict == Verdict::Refused)
    }

    /// Number of elements that the world lacks.
    pub fn count_refused(&self) -> usize {
        self.refused
    }

    pub(super) fn honour(&mut self, element: Element<'_>) {
        self.enter(element, Verdict::Honoured, String::new());
    }

    pub(super) fn pass(&mut self, element: Element<'_>) {
        self.enter(element, Verdict::Harmless, String::new());
    }

    /// The same, with something to say about it.
    pub(super) fn note(&mut self, element: Element<'_>, note: impl Into<String>) {
        self.enter(element, Verdict::Harmless, note.into());
    }

    pub(super) fn refuse(&mut self, element: Element<'_>, why: impl Into<String>) {
        self.enter(element, Verdict::Refused, why.into());
    }

    /// An element that the format has not.
    pub(super) fn pass_unknown(&mut self, element: Element<'_>) {
        self.note(element, format!("<{}> is not of the format; left out", element.name()));
    }

    fn enter(&mut self, element: Element<'_>, verdict: Verdict, note: String) {
        self.refused += usize::from(verdict == Verdict::Refused);
        let next = self.entries.len();
        let number = *self.numbers.entry((element.path(), verdict, note.clone())).or_insert(next);
        if let Some(entry) = self.entries.get_mut(number) {
            entry.count += 1;
        } else if next < MOST_ENTRIES {
            self.entries.push(Entry {
                place: element.place(),
                element: element.path(),
                verdict,
                note,
                count: 1,
            });
        } else {
            self.unlisted += 1;
            self.numbers.remove(&(element.path(), verdict, note));
        }
    }
}

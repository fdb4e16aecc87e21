//! The names of b-threads that have ended, which go on counting when they are used again.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::bound::Bound;

/// The synchronisation points that each name saw.
#[derive(Clone, Debug, Default)]
pub(super) struct Ended {
    seen: BTreeMap<Arc<str>, u64>,
    /// No name that is not known saw more.
    forgotten: u64,
}

impl Ended {
    /// Number of names that are known.
    pub(super) fn len(&self) -> usize {
        self.seen.len()
    }

    pub(super) fn note(&mut self, name: Arc<str>, sync: u64) {
        self.seen.insert(name, sync);
        if self.seen.len() > Bound::EndedNames.most() {
            let greatest = std::mem::take(&mut self.seen).into_values().max().unwrap_or(0);
            self.forgotten = self.forgotten.max(greatest);
        }
    }

    /// The synchronisation points that `name` saw, or more; it runs again.
    pub(super) fn take(&mut self, name: &str) -> u64 {
        self.seen.remove(name).unwrap_or(self.forgotten)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_was_forgotten_goes_on_above_what_it_saw() {
        let mut ended = Ended::default();
        assert_eq!(ended.take("a"), 0);
        ended.note("a".into(), 7);
        for number in 0..10 * Bound::EndedNames.stated() {
            ended.note(format!("b{number}").into(), 3);
            assert!(ended.seen.len() <= Bound::EndedNames.stated());
        }
        assert_eq!(ended.take("a"), 7);
    }
}

//! A tray in which the newest thing of each kind waits to be taken, in the order in which they came.

use std::mem::discriminant;
use std::time::Duration;

/// Things of a few kinds that wait, each with its time; no more of them than there are kinds.
#[derive(Clone, Debug)]
pub struct Newest<T>(Vec<(Duration, T)>);

impl<T> Default for Newest<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Newest<T> {
    /// Puts a thing of this time behind all that wait, in the place of one of its kind.
    pub fn put(&mut self, at: Duration, thing: T) {
        let kind = discriminant(&thing);
        self.0.retain(|(_, waiting)| discriminant(waiting) != kind);
        self.0.push((at, thing));
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<T> Extend<(Duration, T)> for Newest<T> {
    fn extend<I: IntoIterator<Item = (Duration, T)>>(&mut self, things: I) {
        things.into_iter().for_each(|(at, thing)| self.put(at, thing));
    }
}

impl<T> IntoIterator for Newest<T> {
    type Item = (Duration, T);
    type IntoIter = std::vec::IntoIter<(Duration, T)>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Report;

    #[test]
    fn of_each_kind_the_newest_waits_at_its_place() {
        let mut waiting = Newest::default();
        assert!(waiting.is_empty());
        let unready = |why: &str| Report::Unready(why.to_owned());
        for ms in 0..1000 {
            let at = Duration::from_millis(ms);
            let reports = [unready(&ms.to_string()), Report::Landed, Report::PathBlocked, Report::Airborne];
            waiting.extend(reports.map(|report| (at, report)));
        }
        waiting.put(Duration::from_secs(2), Report::Landed);
        let left: Vec<_> = waiting.into_iter().map(|(_, report)| report).collect();
        assert_eq!(left, [unready("999"), Report::PathBlocked, Report::Airborne, Report::Landed]);
    }
}

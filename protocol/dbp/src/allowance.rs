//! The allowance of one member here: so much at once, and so much more with time.

use std::time::Duration;

use skein_bp::Bound;

/// A member's use of two bounds: on what may be at once, and on what is added each second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Allowance {
    used: usize,
    /// When what was used was counted down last.
    since: Duration,
}

impl Allowance {
    /// Uses one more, if there is one left at `now`.
    pub(crate) fn take(&mut self, now: Duration, at_once: Bound, per_second: Bound) -> bool {
        let passed_ms = usize::try_from(now.saturating_sub(self.since).as_millis()).unwrap_or(usize::MAX);
        let regained = passed_ms.saturating_mul(per_second.most()) / 1000;
        // Who uses nothing regains nothing for later.
        if regained > 0 || self.used == 0 {
            self.used = self.used.saturating_sub(regained);
            self.since = now;
        }
        let left = self.used < at_once.most();
        self.used += usize::from(left);
        left
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn so_much_at_once_and_so_much_with_time() {
        let mut allowance = Allowance::default();
        let mut taken = |ms: u64, tries: usize| {
            let now = Duration::from_millis(ms);
            (0..tries).filter(|_| allowance.take(now, Bound::FactsAtOnce, Bound::FactsPerSecond)).count()
        };
        assert_eq!(taken(0, 1000), Bound::FactsAtOnce.stated());
        let in_a_second = (1..=1000).map(|ms| taken(ms, 1)).sum::<usize>();
        assert!((30..=Bound::FactsPerSecond.stated()).contains(&in_a_second), "{in_a_second}");
        assert_eq!(taken(1_000_000, 1000), Bound::FactsAtOnce.stated());
    }

    #[test]
    fn what_is_not_used_is_not_saved_up() {
        let mut allowance = Allowance::default();
        let mut takes =
            |ms: u64| allowance.take(Duration::from_millis(ms), Bound::LivesPerSecond, Bound::LivesPerSecond);
        assert_eq!((0..6).filter(|_| takes(100)).count(), Bound::LivesPerSecond.stated());
        assert!(!takes(200), "one comes back 200 ms after it was used, and not after the start");
        assert!(takes(300));
    }
}

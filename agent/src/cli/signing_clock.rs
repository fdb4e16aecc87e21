//! The time of signatures on the autopilot's link: later than in every life before, whatever this computer's clock
//! says.

use std::path::Path;
use std::time::{Duration, SystemTime};

use skein_disk::{Background, SigningTimeStore};
use skein_mav::{Signing, SigningTime};
use skein_wire::{NodeName, Saver, Store as _};

/// The time that is kept is so far ahead of the present: after a power cut the next life begins after all that this one
/// has signed.
const AHEAD: Duration = Duration::from_secs(60);
/// It is kept anew this often.
const KEEP_EVERY: Duration = Duration::from_secs(20);

/// Keeps the time of signatures on a disk.
pub struct SigningClock {
    saver: Saver<u64>,
    began: SigningTime,
    next: Duration,
}

impl SigningClock {
    /// Sets the time at which this life begins, and keeps it; `clock` is this computer's, and `done` is called when
    /// something has been kept, or could not be.
    ///
    /// # Errors
    /// There is no thread for the disk.
    pub fn start(
        signing: &mut Signing,
        folder: &Path,
        node: &NodeName,
        clock: SystemTime,
        done: impl Fn() + Send + 'static,
    ) -> std::io::Result<Self> {
        let (mut store, kept) = SigningTimeStore::open(folder, node);
        let kept = kept.unwrap_or_else(|lost| {
            tracing::error!("{lost}");
            0
        });
        let since_1970 = clock.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let began = SigningTime::of_units(kept).max(SigningTime::of_clock(since_1970));
        signing.began = began;
        // On disk before the first signature, if the disk takes it.
        store.save(&began.after(AHEAD).units());
        Ok(Self { saver: Saver::new(Box::new(Background::new(store, done)?)), began, next: KEEP_EVERY })
    }

    /// Goes on with keeping it.
    pub fn go_on(&mut self, now: Duration) {
        if now >= self.next {
            self.next = now + KEEP_EVERY;
            self.saver.put(now, self.began.after(now + AHEAD).units());
        }
        self.saver.go_on(now);
    }

    /// Why it is not kept.
    pub fn trouble(&self) -> Option<&str> {
        self.saver.trouble()
    }
}

#[cfg(test)]
mod tests {
    use skein_mav::SigningKey;

    use super::*;

    #[test]
    fn a_life_signs_later_than_the_one_before_whatever_the_clock_says() {
        let folder = tempfile::tempdir().unwrap();
        let node = NodeName::new("uav/1").unwrap();
        let key = SigningKey::new([7; 32]);
        let mut signing = Signing { key, link_id: 0, refuses_unsigned: true, began: SigningTime::default() };
        let mut start = |clock| {
            let clock = SigningClock::start(&mut signing, folder.path(), &node, clock, || {}).unwrap();
            (clock, signing.began)
        };
        let set = SystemTime::UNIX_EPOCH + Duration::from_secs(1_800_000_000);
        let (mut clock, first) = start(set);
        assert_eq!(first, SigningTime::of_clock(Duration::from_secs(1_800_000_000)));
        // It ends after an hour, at once; then the clock has lost its battery.
        let hour = Duration::from_secs(3600);
        clock.go_on(hour);
        while !clock.saver.go_on(hour) {
            std::thread::yield_now();
        }
        let (_, second) = start(SystemTime::UNIX_EPOCH);
        assert!(second >= first.after(hour), "{second:?} is not after {first:?} and an hour");
        // One that ends before anything else was kept has been counted as well.
        let (_, third) = start(SystemTime::UNIX_EPOCH);
        assert!(third > second);
    }
}

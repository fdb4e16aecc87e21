//! When hits that nothing saw again are given up.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::Duration;

/// Time is counted in steps of this share of the time constant.
const STEPS: f64 = 32.0;
/// A stamp is the step of a hit modulo this, plus one. The span is eight time constants: about twice what lies
/// at most between the hit that a look-up finds and the look-up itself.
const SPAN: u64 = 255;

/// The step in which a voxel was last hit, as its cell keeps it; 0 of what does not fade.
pub(super) type Stamp = u8;

/// The clock of a map's hits, and the queue in which they wait to be looked up.
///
/// A voxel is queued when its first hit comes, for the earliest time at which this could have faded; twice if it was
/// made known otherwise meanwhile and is then hit anew, which does no harm.
/// Later hits are only stamped; that one came is found out when the voxel is looked up, and it is queued anew.
/// So a hit costs nothing more, and neither does time in which nothing is due.
#[derive(Clone, Debug)]
pub(super) struct Fading {
    step_s: f64,
    now: u64,
    /// Evidence of a voxel's first hit: none fades sooner.
    first: i8,
    queue: BinaryHeap<Reverse<LookUp>>,
}

/// That a voxel is to be looked up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct LookUp {
    step: u64,
    /// The voxel's place in memory.
    pub offset: u32,
}

impl Fading {
    /// Hits fade with the time constant `tau_s`; `first` is the evidence of a first hit.
    pub fn new(tau_s: f64, first: i8) -> Fading {
        Fading { step_s: tau_s / STEPS, now: 0, first, queue: BinaryHeap::new() }
    }

    /// Sets the clock, which never runs backwards.
    pub fn advance(&mut self, now: Duration) {
        self.now = self.now.max((now.as_secs_f64() / self.step_s) as u64);
    }

    /// The stamp of a hit now on a voxel that bears the stamp `before`, which is queued unless it is.
    pub fn hit(&mut self, offset: usize, before: Stamp) -> Stamp {
        if self.step_s.is_infinite() {
            return 0;
        }
        if before == 0 {
            self.enqueue(offset as u32, self.now.saturating_add(life(self.first)));
        }
        (self.now % SPAN) as Stamp + 1
    }

    /// Takes the next voxel that is due out of the queue.
    pub fn next(&mut self) -> Option<LookUp> {
        let due = self.queue.peek().is_some_and(|Reverse(next)| next.step <= self.now);
        if due { self.queue.pop().map(|Reverse(next)| next) } else { None }
    }

    /// Whether a voxel that was looked up has faded, given its stamp and its evidence; if not, it is queued
    /// again.
    pub fn has_faded(&mut self, found: LookUp, stamp: Stamp, evidence: i8) -> bool {
        // Between the hit and the step it was queued for lies less than a span, however late it is now.
        let age = (found.step + SPAN + 1 - u64::from(stamp)) % SPAN;
        let due = found.step.saturating_sub(age) + life(evidence);
        if due > self.now {
            // A hit may still come and may be all that counts later on.
            self.enqueue(found.offset, due.min(self.now.saturating_add(life(self.first))));
        }
        due <= self.now
    }

    /// Follows voxels to their new places in memory; those without one are dropped.
    pub fn relocate(&mut self, to: impl Fn(usize) -> Option<usize>) {
        let moved = |Reverse(LookUp { step, offset })| {
            to(offset as usize).map(|offset| Reverse(LookUp { step, offset: offset as u32 }))
        };
        self.queue = self.queue.drain().filter_map(moved).collect();
    }

    /// Voxels in the queue.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.queue.len()
    }

    fn enqueue(&mut self, offset: u32, step: u64) {
        self.queue.push(Reverse(LookUp { step, offset }));
    }
}

/// Steps until `evidence exp(-t / tau)` falls below 1.
fn life(evidence: i8) -> u64 {
    (f64::from(evidence.max(1)).ln() * STEPS).ceil() as u64
}

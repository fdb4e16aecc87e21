//! Many runs, a few at a time.

use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Runs of an experiment at once.
const THREADS: usize = 2;

/// Does `run` with each of `cases` and gives back what came of each, in their order. A terminal shows how far it is.
///
/// # Errors
/// The first error, in the order of the cases; the others are not begun any more once there is one.
pub fn in_turn<C: Sync, R: Send>(
    what: &str,
    cases: &[C],
    run: impl Fn(&C) -> anyhow::Result<R> + Sync,
) -> anyhow::Result<Vec<R>> {
    at_once(THREADS, what, cases, run)
}

/// The same with so many runs at once; as many as this computer has processors if `None`.
///
/// # Errors
/// As [`in_turn`].
pub fn by_jobs<C: Sync, R: Send>(
    jobs: Option<usize>,
    what: &str,
    cases: &[C],
    run: impl Fn(&C) -> anyhow::Result<R> + Sync,
) -> anyhow::Result<Vec<R>> {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    at_once(jobs.unwrap_or(processors).max(1), what, cases, run)
}

fn at_once<C: Sync, R: Send>(
    threads: usize,
    what: &str,
    cases: &[C],
    run: impl Fn(&C) -> anyhow::Result<R> + Sync,
) -> anyhow::Result<Vec<R>> {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let results: Vec<Mutex<Option<anyhow::Result<R>>>> = cases.iter().map(|_| Mutex::new(None)).collect();
    let work = || {
        while let Some((case, place)) = {
            let index = next.fetch_add(1, Ordering::Relaxed);
            cases.get(index).zip(results.get(index))
        } {
            let result = run(case);
            if result.is_err() {
                next.store(cases.len(), Ordering::Relaxed);
            }
            if let Ok(mut place) = place.lock() {
                *place = Some(result);
            }
            show_progress(what, done.fetch_add(1, Ordering::Relaxed) + 1, cases.len());
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads.min(cases.len()) {
            scope.spawn(work);
        }
    });
    // What was not begun comes after the error that is why.
    results.into_iter().filter_map(|place| place.into_inner().ok().flatten()).collect()
}

fn show_progress(what: &str, done: usize, of: usize) {
    if std::io::stderr().is_terminal() {
        let end = if done == of { "\n" } else { "" };
        eprint!("\r{what}: {done} of {of}{end}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_the_order_of_the_cases() {
        let cases: Vec<u64> = (0..50).collect();
        let squares = in_turn("squares", &cases, |case| Ok(case * case)).expect("none fails");
        assert_eq!(squares, cases.iter().map(|case| case * case).collect::<Vec<_>>());
    }

    #[test]
    fn an_error_ends_it() {
        let error = in_turn("runs", &[1, 2, 3], |case| {
            anyhow::ensure!(*case != 2, "case 2 fails");
            Ok(())
        });
        assert_eq!(error.expect_err("one fails").to_string(), "case 2 fails");
    }
}

//! Independent runs on as many threads as there are processors.

use std::{
    num::NonZero,
    sync::{
        atomic::{AtomicBool, AtomicUsize, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    thread,
    time::Duration,
};

use crate::{Failure, Result};

/// Time between two calls of `idle` in [`for_each`] while no work finishes.
const PATIENCE: Duration = Duration::from_millis(200);

/// Returns the number of threads to use by default.
pub fn processors() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get)
}

/// Applies `work` to every item on `threads` threads. `progress` is called on the calling thread with the number of finished tasks. The distribution
/// over threads does not affect the results.
///
/// # Errors
/// The first failure in the order of the items that were tried; no new task begins after a failure.
pub fn sweep<T: Sync, R: Send>(
    items: &[T],
    threads: usize,
    work: impl Fn(&T) -> Result<R> + Sync,
    progress: impl Fn(usize),
) -> Result<Vec<R>> {
    let stop = AtomicBool::new(false);
    let mut results: Vec<Option<Result<R>>> = items.iter().map(|_| None).collect();
    let mut done = 0;
    let tried = |item: &T| {
        let result = work(item);
        stop.fetch_or(result.is_err(), Ordering::Relaxed);
        result
    };
    let keep = |index: usize, result| {
        results[index] = Some(result);
        done += 1;
        progress(done);
        Ok(())
    };
    for_each(items, threads, &stop, tried, keep, || {})?;
    let lost = || Failure::new("sweep", "a worker thread ended unexpectedly", "Report this to the developers");
    if let Some(Err(failure)) = results.iter().flatten().find(|result| result.is_err()) {
        return Err(failure.clone());
    }
    results.into_iter().map(|result| result.unwrap_or_else(|| Err(lost()))).collect()
}

/// Applies `work` to every item on `threads` threads, and passes index and result of each to `finished` on the calling thread, in the order in which
/// they finish. No new task begins once `stop` is true or `finished` fails; tasks in progress are completed. While no task finishes, `idle` is
/// called a few times per second.
///
/// # Errors
/// The first failure of `finished`.
pub fn for_each<T: Sync, R: Send>(
    items: &[T],
    threads: usize,
    stop: &AtomicBool,
    work: impl Fn(&T) -> R + Sync,
    mut finished: impl FnMut(usize, R) -> Result<()>,
    mut idle: impl FnMut(),
) -> Result<()> {
    let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let threads = threads.clamp(1, items.len().max(1));
    let (sender, receiver) = mpsc::sync_channel(threads);
    let mut outcome = Ok(());
    thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next, failed, work) = (sender.clone(), &next, &failed, &work);
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) && !failed.load(Ordering::Relaxed) {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(index) else { break };
                    let _ = sender.send((index, work(item)));
                }
            });
        }
        drop(sender);
        loop {
            match receiver.recv_timeout(PATIENCE) {
                Ok((index, result)) if outcome.is_ok() => {
                    outcome = finished(index, result);
                    failed.fetch_or(outcome.is_err(), Ordering::Relaxed);
                }
                Ok(_) => {}
                Err(RecvTimeoutError::Timeout) => idle(),
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
    });
    outcome
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn results_keep_order_and_progress_counts_all_items() {
        let items: Vec<u64> = (0..100).collect();
        for threads in [1, 2, 7, 1000] {
            let seen = Cell::new(0);
            let squares = sweep(&items, threads, |item| Ok(item * item), |done| seen.set(done)).unwrap();
            assert_eq!(squares, items.iter().map(|item| item * item).collect::<Vec<_>>());
            assert_eq!(seen.get(), 100);
        }
        assert_eq!(sweep(&[] as &[u8], 2, |_| Ok(()), |_| {}), Ok(Vec::new()));
    }

    #[test]
    fn failure_stops_the_sweep_and_is_returned() {
        let items: Vec<usize> = (0..1000).collect();
        let tried = AtomicUsize::new(0);
        let work = |item: &usize| {
            tried.fetch_add(1, Ordering::Relaxed);
            if *item == 3 { Err(Failure::new("run 3", "diverged", "")) } else { Ok(*item) }
        };
        assert_eq!(sweep(&items, 2, work, |_| {}).unwrap_err().what, "run 3");
        assert!(tried.load(Ordering::Relaxed) < 1000);
    }

    #[test]
    fn stopped_work_completes_the_tasks_in_progress() {
        let items: Vec<usize> = (0..1000).collect();
        let (stop, mut seen) = (AtomicBool::new(false), Vec::new());
        let finished = |index: usize, value: usize| {
            seen.push((index, value));
            stop.fetch_or(seen.len() == 5, Ordering::Relaxed);
            Ok(())
        };
        for_each(&items, 2, &stop, |item| 2 * item, finished, || {}).unwrap();
        assert!((5..1000).contains(&seen.len()) && seen.iter().all(|(index, value)| *value == 2 * index), "{seen:?}");
        let full = || Err(Failure::new("disk", "is full", ""));
        let failure = for_each(&items, 2, &AtomicBool::new(false), |item| *item, |_, _| full(), || {}).unwrap_err();
        assert_eq!(failure.what, "disk");
    }
}

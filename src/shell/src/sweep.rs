//! Independent runs on as many threads as there are processors; results in the order of the tasks.

use std::{
    num::NonZero,
    sync::{
        Mutex,
        atomic::{AtomicBool, AtomicUsize, Ordering},
        mpsc,
    },
    thread,
};

use crate::{Failure, Result};

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
    let next = AtomicUsize::new(0);
    let stop = AtomicBool::new(false);
    let results: Mutex<Vec<Option<Result<R>>>> = Mutex::new(items.iter().map(|_| None).collect());
    let (sender, receiver) = mpsc::channel();
    thread::scope(|scope| {
        for _ in 0..threads.clamp(1, items.len().max(1)) {
            let (sender, next, stop, results, work) = (sender.clone(), &next, &stop, &results, &work);
            scope.spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(index) else { break };
                    let result = work(item);
                    stop.fetch_or(result.is_err(), Ordering::Relaxed);
                    if let Ok(mut results) = results.lock() {
                        results[index] = Some(result);
                    }
                    let _ = sender.send(());
                }
            });
        }
        drop(sender);
        (1..).zip(receiver.iter()).for_each(|(done, ())| progress(done));
    });
    let lost = || Failure::new("sweep", "a worker thread ended unexpectedly", "Report this to the developers");
    let results = results.into_inner().map_err(|_| lost())?;
    if let Some(Err(failure)) = results.iter().flatten().find(|result| result.is_err()) {
        return Err(failure.clone());
    }
    results.into_iter().map(|result| result.unwrap_or_else(|| Err(lost()))).collect()
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
}

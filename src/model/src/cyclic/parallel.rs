//! Parallel execution of the nodal diameters, with progress reports from the calling thread.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use rayon::Yield;

use crate::Result;
use crate::progress::{Listener, ReductionStage, report};

/// Runs `work` for 0 .. `count` on all threads of the pool. Each call receives a function to be called at the end of
/// each of its `steps` steps.
///
/// # Errors
/// The error of the first index whose work failed; work that has not begun by then is skipped.
pub(super) fn for_each<T: Send>(
    count: usize,
    steps: usize,
    (stage, listener): (ReductionStage, Listener<'_>),
    work: impl Fn(usize, &dyn Fn()) -> Result<T> + Sync,
) -> Result<Vec<T>> {
    let (sender, receiver) = channel();
    let slots: Vec<Mutex<Option<Result<T>>>> = (0..count).map(|_| Mutex::new(None)).collect();
    let failed = AtomicBool::new(false);
    let (slots_ref, failed_ref, work_ref) = (&slots, &failed, &work);
    rayon::in_place_scope(|scope| {
        for index in 0..count {
            let sender = sender.clone();
            scope.spawn(move |_| {
                if failed_ref.load(Ordering::Relaxed) {
                    return;
                }
                // The receiver lives until all senders are dropped.
                let result = work_ref(index, &|| sender.send(()).unwrap_or_default());
                if result.is_err() {
                    failed_ref.store(true, Ordering::Relaxed);
                }
                *slots_ref[index].lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(result);
            });
        }
        drop(sender);
        let mut done = 0;
        loop {
            // A caller that is itself a thread of the pool must work instead of waiting.
            if rayon::yield_now() == Some(Yield::Executed) {
                done += receiver.try_iter().count();
            } else {
                match receiver.recv_timeout(Duration::from_millis(20)) {
                    Ok(()) => done += 1,
                    Err(RecvTimeoutError::Timeout) => continue,
                    Err(RecvTimeoutError::Disconnected) => break,
                }
            }
            report(listener, stage, done, count * steps);
        }
    });
    let mut results = Vec::with_capacity(count);
    let mut skipped = false;
    for slot in slots {
        match slot.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
            Some(result) => results.push(result?),
            None => skipped = true,
        }
    }
    debug_assert!(!skipped, "items are skipped only after another item has failed");
    Ok(results)
}

//! Threads that share the sectors of a step.
//!
//! The threads are created at initialisation. Between two jobs they poll for the next one for a short time, and then
//! wait without using the processor. They end when the [`Workers`] are dropped.

use std::any::Any;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

/// Number of times that a thread polls before it waits without using the processor.
const SPINS: u32 = 2000;

/// A job that each thread runs once.
type Job<'a> = &'a (dyn Fn() + Sync);

/// Threads that run jobs together with the thread that calls them. Without threads, the caller runs jobs alone.
#[derive(Debug, Default)]
pub(crate) struct Workers {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// Data that the threads share with the caller.
#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    /// Number of jobs so far.
    jobs: AtomicU64,
    /// Number of threads that run the current job, or that have not started.
    active: AtomicUsize,
    /// Signals a job, or the end of the threads.
    has_job: Condvar,
    /// Signals that no thread runs the job any more.
    is_idle: Condvar,
}

#[derive(Default)]
struct State {
    /// The current job, which further threads may begin.
    job: Option<Job<'static>>,
    /// Number of waiting threads.
    waiting: usize,
    /// True if the threads must end.
    ends: bool,
    /// Panic of a thread during the current job.
    panic: Option<Box<dyn Any + Send>>,
}

impl Workers {
    /// Creates `count` threads in addition to the caller, and waits until they run. A thread allocates memory when it starts,
    /// which must not happen during a step.
    ///
    /// # Errors
    /// If the system cannot create a thread. The threads that were created end.
    pub(crate) fn new(count: usize) -> io::Result<Self> {
        let mut workers = Self::default();
        for _ in 0..count {
            let shared = Arc::clone(&workers.shared);
            shared.active.fetch_add(1, Ordering::Relaxed);
            let thread = thread::Builder::new().name("tiprub".into()).spawn(move || shared.work())?;
            workers.threads.push(thread);
        }
        workers.shared.close();
        Ok(workers)
    }

    /// Number of threads in addition to the caller.
    pub(crate) fn count(&self) -> usize {
        self.threads.len()
    }

    /// Runs a job once in the caller, and once in each thread that begins before the caller has finished. Does not
    /// allocate.
    ///
    /// # Panics
    /// If the job panics in any thread.
    pub(crate) fn run(&self, job: Job) {
        if self.threads.is_empty() {
            return job();
        }
        // SAFETY: only the lifetime changes. `close` returns after the last use of the job by another thread, and nothing
        // between here and there unwinds, so the job outlives all uses.
        let shared = unsafe { std::mem::transmute::<Job<'_>, Job<'static>>(job) };
        self.shared.open(shared);
        let own = catch_unwind(AssertUnwindSafe(job)).err();
        let other = self.shared.close();
        if let Some(panic) = own.or(other) {
            resume_unwind(panic);
        }
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        self.shared.lock().ends = true;
        self.shared.has_job.notify_all();
        for thread in self.threads.drain(..) {
            // A thread catches the panics of its jobs.
            drop(thread.join());
        }
    }
}

impl Clone for Workers {
    /// Returns workers without threads: a copy of a simulation runs jobs in the caller until it is initialised.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets the threads begin a job.
    fn open(&self, job: Job<'static>) {
        let mut state = self.lock();
        state.job = Some(job);
        self.jobs.fetch_add(1, Ordering::Release);
        let waiting = state.waiting;
        drop(state);
        if waiting > 0 {
            self.has_job.notify_all();
        }
    }

    /// Ends the current job: no further thread begins it. Waits for those that run it, and returns the panic of one of
    /// them.
    fn close(&self) -> Option<Box<dyn Any + Send>> {
        self.lock().job = None;
        spin_until(|| self.active.load(Ordering::Acquire) == 0);
        let mut state = self.lock();
        while self.active.load(Ordering::Acquire) > 0 {
            state = self.is_idle.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state.panic.take()
    }

    /// Runs jobs until the threads end.
    fn work(&self) {
        self.finish(None);
        let mut seen = 0;
        while let Some(job) = self.next_job(&mut seen) {
            self.finish(catch_unwind(AssertUnwindSafe(job)).err());
        }
    }

    /// Finishes the current job in a thread, which may have panicked.
    fn finish(&self, panic: Option<Box<dyn Any + Send>>) {
        let mut state = self.lock();
        state.panic = state.panic.take().or(panic);
        if self.active.fetch_sub(1, Ordering::Release) == 1 {
            self.is_idle.notify_one();
        }
    }

    /// Waits for a job after the first `seen` ones and begins it; `None` if the threads must end.
    fn next_job(&self, seen: &mut u64) -> Option<Job<'static>> {
        loop {
            spin_until(|| self.jobs.load(Ordering::Acquire) != *seen);
            let mut state = self.lock();
            while self.jobs.load(Ordering::Acquire) == *seen && !state.ends {
                state.waiting += 1;
                state = self.has_job.wait(state).unwrap_or_else(PoisonError::into_inner);
                state.waiting -= 1;
            }
            if state.ends {
                return None;
            }
            *seen = self.jobs.load(Ordering::Acquire);
            if state.job.is_some() {
                self.active.fetch_add(1, Ordering::Acquire);
                return state.job;
            }
        }
    }
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Shared").finish_non_exhaustive()
    }
}

/// Polls until a condition holds, but only for a short time.
fn spin_until(has_changed: impl Fn() -> bool) {
    for _ in 0..SPINS {
        if has_changed() {
            return;
        }
        std::hint::spin_loop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn every_item_of_every_job_is_done_once() {
        for count in [0, 1, 3] {
            let workers = Workers::new(count).unwrap();
            for job in 0..2000 {
                let mut items = [0; 36];
                let rest = Mutex::new(items.iter_mut());
                workers.run(&|| {
                    while let Some(item) = { rest.lock().unwrap().next() } {
                        *item += job;
                    }
                });
                assert_eq!(items, [job; 36]);
            }
        }
    }

    #[test]
    fn panic_in_any_thread_reaches_the_caller() {
        let workers = Workers::new(2).unwrap();
        let caller = thread::current().id();
        let has_panicked = AtomicBool::new(false);
        let job = || {
            // The caller waits until another thread has panicked.
            while thread::current().id() == caller && !has_panicked.load(Ordering::Acquire) {
                thread::yield_now();
            }
            if thread::current().id() != caller {
                has_panicked.store(true, Ordering::Release);
                panic!("in a thread");
            }
        };
        let panic = catch_unwind(AssertUnwindSafe(|| workers.run(&job))).unwrap_err();
        assert_eq!(panic.downcast_ref(), Some(&"in a thread"));
        let panic = catch_unwind(AssertUnwindSafe(|| workers.run(&|| panic!("in all")))).unwrap_err();
        assert_eq!(panic.downcast_ref(), Some(&"in all"));
        let done = AtomicUsize::new(0);
        workers.run(&|| {
            done.fetch_add(1, Ordering::Relaxed);
        });
        assert!(done.into_inner() > 0, "the threads still run jobs");
    }
}

//! Hostile calls, counted.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::ERROR;

/// Cases tried, for the summary.
static CASES: AtomicUsize = AtomicUsize::new(0);

/// Count cases that were refused as they should be.
pub fn count(cases: usize) {
    CASES.fetch_add(cases, Ordering::Relaxed);
}

/// A call must have ended in Error, with a message that names the reason.
#[track_caller]
pub fn refused(status: i32, log: &str, reason: &str) {
    count(1);
    assert!(status == ERROR, "status {status} instead of Error: {log}");
    assert!(log.contains(reason), "the message does not say \"{reason}\": {log}");
}

/// Tell how many.
pub fn summary(name: &str) {
    println!("{name}: {} hostile cases so far, all refused as they should be", CASES.load(Ordering::Relaxed));
}

//! Counters of hostile calls.

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::ERROR;

/// Number of cases tried, for the summary.
static CASES: AtomicUsize = AtomicUsize::new(0);

/// Counts cases that were rejected as expected.
pub fn count(cases: usize) {
    CASES.fetch_add(cases, Ordering::Relaxed);
}

/// Checks that a call ended in Error, with a message that contains the reason.
#[track_caller]
pub fn refused(status: i32, log: &str, reason: &str) {
    count(1);
    assert!(status == ERROR, "status {status} instead of Error: {log}");
    assert!(log.contains(reason), "the message does not say \"{reason}\": {log}");
}

/// Prints the number of cases.
pub fn summary(name: &str) {
    println!("{name}: {} hostile cases so far, all refused as they should be", CASES.load(Ordering::Relaxed));
}

//! Processor time of the calling thread.

use std::time::Duration;

/// Description of the measured time.
pub const MEANING: &str =
    if cfg!(unix) { "processor time of the stepping thread" } else { "wall time, as there is no processor clock" };

/// Returns the processor time that this thread has used.
#[cfg(unix)]
pub fn now() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec.unsigned_abs(), u32::try_from(time.tv_nsec).unwrap_or(0))
}

/// Returns the wall time since the first call.
#[cfg(not(unix))]
pub fn now() -> Duration {
    static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    START.get_or_init(std::time::Instant::now).elapsed()
}

#[cfg(test)]
mod tests {
    #[test]
    fn clock_advances_during_work() {
        let before = super::now();
        let mut sum = 0.0_f64;
        for i in 0..2_000_000 {
            sum += f64::from(i).sqrt();
        }
        assert!(sum > 0.0 && super::now() > before);
    }
}

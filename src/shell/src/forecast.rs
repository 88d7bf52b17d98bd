//! Progress of long work, and the remaining time, estimated from the time that the finished part took.
//!
//! Work is planned in units (internal steps, answers, runs) of several kinds, which differ in seconds per unit. The first estimate uses the given
//! rate. Each finished piece of work measures the rate of its kind, and corrects the rates of the other kinds in the same proportion. The displayed
//! fraction never decreases, and reaches 1 only at the end.

use std::{
    cell::RefCell,
    time::{Duration, Instant},
};

use crate::console::{Console, Task};

/// Number of parts of a progress bar.
const PARTS: u64 = 1000;
/// Fraction of the work, or time (s), after which another line is written to a log.
const LINE_SHARE: f64 = 0.1;
const LINE_AFTER: Duration = Duration::from_secs(30);
/// Time after which the first line is written to a log.
const FIRST_LINE_AFTER: Duration = Duration::from_secs(2);
/// Largest displayed fraction before the work is finished.
const MOST_SHOWN: f64 = 0.999;
/// Shortest duration (s) that is announced.
const LONG: f64 = 20.0;

/// Work of one kind.
#[derive(Debug, Clone, Copy, Default)]
struct WorkKind {
    planned: f64,
    done: f64,
    seconds: f64,
}

/// Planned and finished work.
#[derive(Debug, Clone)]
pub struct WorkPlan {
    kinds: Vec<WorkKind>,
    /// Rate (s per unit) before anything is measured.
    rate: f64,
    /// Largest fraction displayed so far.
    shown: f64,
}

impl WorkPlan {
    /// Creates an empty plan; `rate` is in seconds per unit.
    pub fn new(rate: f64) -> Self {
        Self { kinds: Vec::new(), rate, shown: 0.0 }
    }

    /// Plans more work of a kind.
    pub fn plan(&mut self, kind: usize, units: f64) {
        self.kind(kind).planned += units;
    }

    /// Records finished work of a kind that took `seconds` (s).
    pub fn done(&mut self, kind: usize, units: f64, seconds: f64) {
        let own = self.kind(kind);
        own.done += units;
        own.seconds += seconds;
        own.planned = own.planned.max(own.done);
    }

    fn kind(&mut self, kind: usize) -> &mut WorkKind {
        if self.kinds.len() <= kind {
            self.kinds.resize(kind + 1, WorkKind::default());
        }
        &mut self.kinds[kind]
    }

    /// Returns the estimated time of the remaining work (s).
    pub fn remaining(&self) -> f64 {
        let measured = self.kinds.iter().filter(|kind| kind.done > 0.0);
        let (units, seconds) = measured.fold((0.0, 0.0), |(units, all), kind| (units + kind.done, all + kind.seconds));
        let usual = if units > 0.0 { seconds / units } else { self.rate };
        let left = |kind: &WorkKind| {
            let rate = if kind.done > 0.0 { kind.seconds / kind.done } else { usual };
            (kind.planned - kind.done) * rate
        };
        self.kinds.iter().map(left).sum()
    }

    /// Returns the finished fraction of the work, measured in time: it never decreases, and stays below 1 until everything is finished.
    pub fn share(&mut self) -> f64 {
        let spent: f64 = self.kinds.iter().map(|kind| kind.seconds).sum();
        let is_done = self.kinds.iter().all(|kind| kind.done >= kind.planned);
        let now = if is_done { 1.0 } else { spent / (spent + self.remaining()).max(f64::MIN_POSITIVE) };
        self.shown = self.shown.max(if is_done { now } else { now.min(MOST_SHOWN) });
        self.shown
    }
}

/// Work plan with a progress display.
#[derive(Debug)]
pub struct Forecast {
    task: Task,
    title: String,
    state: RefCell<ForecastState>,
}

#[derive(Debug)]
struct ForecastState {
    ledger: WorkPlan,
    /// Time at which the last work finished.
    last: Instant,
    /// Fraction and time of the last line.
    line: (f64, Instant),
    /// True once a line has been written.
    has_line: bool,
}

impl Forecast {
    /// Displays planned work, and announces its duration if it is long.
    pub fn new(console: &Console, title: &str, ledger: WorkPlan) -> Self {
        let seconds = ledger.remaining();
        if seconds >= LONG {
            console.print_progress(format_args!("{title}: about {} (first estimate)", duration(seconds)));
        }
        let (last, line) = (Instant::now(), (0.0, Instant::now()));
        let task = console.task(title, Some(PARTS));
        Self {
            task,
            title: title.to_owned(),
            state: RefCell::new(ForecastState { ledger, last, line, has_line: false }),
        }
    }

    /// Plans more work of a kind.
    pub fn plan(&self, kind: usize, units: f64) {
        self.state.borrow_mut().ledger.plan(kind, units);
    }

    /// Records work of a kind that has finished since the last call. For parallel work, the time is that of all threads together.
    pub fn done(&self, kind: usize, units: f64) {
        let mut state = self.state.borrow_mut();
        let now = Instant::now();
        let seconds = (now - state.last).as_secs_f64();
        state.last = now;
        state.ledger.done(kind, units, seconds);
        let (share, left) = (state.ledger.share(), state.ledger.remaining());
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 ≤ share ≤ 1")]
        self.task.at((share * PARTS as f64) as u64);
        let text = format!("{:.0} %, about {} left", (100.0 * share).floor(), duration(left));
        self.task.now(&format!("{}: {text}", self.title));
        let after = if state.has_line { LINE_AFTER } else { FIRST_LINE_AFTER };
        if share - state.line.0 >= LINE_SHARE || now - state.line.1 >= after {
            state.has_line = true;
            state.line = (share, now);
            self.task.line(&text);
        }
    }

    /// Finishes the display, even if not all planned work was done.
    pub fn finish(self) {
        self.task.at(PARTS);
        self.task.line("100 %");
    }
}

/// Formats a duration with the accuracy of a forecast: "4 s", "40 s", "3 min", "2.5 h".
pub fn duration(seconds: f64) -> String {
    match seconds {
        _ if seconds < 10.0 => format!("{:.0} s", seconds.ceil()),
        _ if seconds < 90.0 => format!("{:.0} s", 10.0 * (seconds / 10.0).ceil()),
        _ if seconds < 5400.0 => format!("{:.0} min", (seconds / 60.0).ceil()),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First estimates that are wrong by factors, and kinds whose rates differ by a factor of a hundred.
    #[test]
    fn progress_never_falls_and_ends_at_one_for_any_first_estimate() {
        let truth = |kind: usize, index: usize| [0.01, 1.0, 0.1][kind] * (1.0 + 0.5 * (index % 3) as f64);
        for rate in [1e-4, 1.0, 1e4] {
            let mut ledger = WorkPlan::new(rate);
            let work: Vec<(usize, f64)> =
                (0..60).map(|index| ([0, 2, 1][index / 20], 1.0 + (index % 4) as f64)).collect();
            work.iter().for_each(|(kind, units)| ledger.plan(*kind, *units));
            let mut last = ledger.share();
            for (index, (kind, units)) in work.iter().enumerate() {
                ledger.done(*kind, *units, units * truth(*kind, index));
                let share = ledger.share();
                assert!(share >= last && (share < 1.0 || index == 59), "{index}: {share} after {last}");
                last = share;
            }
            assert!((last - 1.0).abs() < 1e-12 && ledger.remaining() == 0.0, "{last}");
        }
    }

    #[test]
    fn remaining_time_follows_measured_speed() {
        let mut ledger = WorkPlan::new(1.0);
        ledger.plan(0, 10.0);
        ledger.plan(1, 10.0);
        assert!((ledger.remaining() - 20.0).abs() < 1e-12);
        // Five times slower than estimated; this applies to both kinds until the second is measured.
        ledger.done(0, 2.0, 10.0);
        assert!((ledger.remaining() - 5.0 * 18.0).abs() < 1e-12);
        ledger.done(1, 1.0, 0.5);
        assert!((ledger.remaining() - (8.0 * 5.0 + 9.0 * 0.5)).abs() < 1e-12);
        // Work that is added later.
        ledger.plan(1, 1.0);
        assert!((ledger.remaining() - (8.0 * 5.0 + 10.0 * 0.5)).abs() < 1e-12);
    }

    #[test]
    fn forecasts_are_rounded_to_few_digits() {
        assert_eq!([2.3, 12.0, 61.0, 200.0, 9000.0].map(duration), ["3 s", "20 s", "70 s", "4 min", "2.5 h"]);
    }
}

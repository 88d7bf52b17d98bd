//! Cases that must fail: they prove that the judge sees what it should. Run by name only (`--case judge`).

use std::time::Duration;

use super::super::{Case, Check, Expected, Happened};

/// One case per way to fail.
pub fn cases() -> Vec<Case> {
    let right = || Expected::right("two and two are five");
    vec![
        Case::new("judge/wrong", right(), |_| Happened::answer(vec![Check::relative("2 + 2", 4.0, 5.0, 1e-9)])),
        Case::new("judge/refused", right(), |_| Happened::refused("no")),
        Case::new("judge/not-refused", Expected::refused(["five"]), |_| {
            Happened::answer(vec![Check::so("it ran", true)])
        }),
        Case::new("judge/unnamed", Expected::refused(["five"]), |_| Happened::refused("no")),
        Case::new("judge/panic", right(), |_| panic!("on purpose")),
        Case::new("judge/abort", right(), |_| std::process::abort()),
        Case::new("judge/overflow", right(), |_| Happened::answer(vec![Check::at_most("depth", descend(1), 0.0)])),
        Case::new("judge/exit", right(), |_| std::process::exit(0)),
        Case::new("judge/hang", right(), |_| {
            loop {
                std::thread::sleep(Duration::from_secs(1));
            }
        })
        .within(1.0),
    ]
}

/// Until the stack ends.
#[expect(unconditional_recursion, reason = "on purpose")]
fn descend(depth: u64) -> f64 {
    let room = std::hint::black_box([depth as f64; 512]);
    descend(depth + 1) + std::hint::black_box(room)[usize::try_from(depth % 512).unwrap_or(0)]
}

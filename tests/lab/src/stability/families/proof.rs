//! Cases that must fail: they test the judge itself. Run by name only (`--case judge`).

use std::time::Duration;

use tiprub_core::scene::method::Solver;

use super::{
    super::{CaseEnd, Check, Expected, StabilityCase, models::StabilityMethod},
    decay::{self, Released},
    disk::{Mirrored, Still},
    free::Impact,
    heat::HeatedBlades,
    plates::Balance,
    turning::{Flank, PressedRotor, Travelling},
};

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    [ways(), faults()].into_iter().flatten().collect()
}

/// Returns cases with small faults of mechanics: the scene and the parameters of the closed form differ by them.
fn faults() -> Vec<StabilityCase> {
    let method = StabilityMethod::exact(Solver::Lcp);
    let case = |name: &str, work: fn(StabilityMethod) -> tiprub_core::Result<Vec<Check>>| {
        StabilityCase::new(format!("judge/{name}"), Expected::right("a wrong result"), move |_| {
            CaseEnd::of(work(method))
        })
    };
    vec![
        case("damping-of-blades-10%", |method| Released { method, turned: 0.45, ratio: 0.055, reported: 0.05 }.blade()),
        case("damping-of-blades-0.1%", |method| {
            Released { method, turned: 0.0, ratio: 0.05005, reported: 0.05 }.blade()
        }),
        case("damping-of-a-ring-10%", |method| decay::ring(method, 2, 0.055, 0.05)),
        case("speed-1%", |method| PressedRotor { method, order: 3, speed: 1300.0, factor: 1.01, early: 0.0 }.run()),
        case("rotor-a-step-early", |method| {
            PressedRotor { method, order: 3, speed: 1300.0, factor: 1.0, early: 1.0 }.run()
        }),
        case("load-a-step-early", |method| Travelling { method, order: 2, ratio: 0.3, early: 1.0 }.run()),
        case("slope-of-a-lobe-1%", |method| Flank { method, slope: 0.05, share: 1.01 }.run()),
        case("coupling-of-sectors-1%", |method| Still { method, sectors: 8, friction: 0.0, coupling: 8.08e6 }.run()),
        case("disk-not-mirrored", |method| Mirrored { method, sectors: 8, conjugate: false }.run()),
        case("heat-1%", |method| HeatedBlades { method, friction: 0.15, speed: 1300.0, share: 1.01 }.run()),
        case("impact-loses-momentum-1%", |method| {
            Impact { method, speed: 1.0, mass: 1.0, friction: 0.15, along: 0.5, share: 1.01 }.run()
        }),
        case("momentum-1e-9", |method| Balance { method, friction: 0.15, speed: 1.0, share: 1.0 + 1e-9 }.run()),
    ]
}

/// Returns one case for each way to fail.
fn ways() -> Vec<StabilityCase> {
    let right = || Expected::right("2 + 2 = 5");
    vec![
        StabilityCase::new("judge/wrong", right(), |_| CaseEnd::answer(vec![Check::relative("2 + 2", 4.0, 5.0, 1e-9)])),
        StabilityCase::new("judge/refused", right(), |_| CaseEnd::refused("no")),
        StabilityCase::new("judge/not-refused", Expected::refused(["five"]), |_| {
            CaseEnd::answer(vec![Check::so("it ran", true)])
        }),
        StabilityCase::new("judge/unnamed", Expected::refused(["five"]), |_| CaseEnd::refused("no")),
        StabilityCase::new("judge/panic", right(), |_| panic!("deliberate panic")),
        StabilityCase::new("judge/abort", right(), |_| std::process::abort()),
        StabilityCase::new("judge/overflow", right(), |_| {
            CaseEnd::answer(vec![Check::at_most("depth", descend(1), 0.0)])
        }),
        StabilityCase::new("judge/exit", right(), |_| std::process::exit(0)),
        StabilityCase::new("judge/hang", right(), |_| {
            loop {
                std::thread::sleep(Duration::from_secs(1));
            }
        })
        .within(1.0),
    ]
}

/// Recurses until the stack overflows.
#[expect(unconditional_recursion, reason = "on purpose")]
fn descend(depth: u64) -> f64 {
    let room = std::hint::black_box([depth as f64; 512]);
    descend(depth + 1) + std::hint::black_box(room)[usize::try_from(depth % 512).unwrap_or(0)]
}

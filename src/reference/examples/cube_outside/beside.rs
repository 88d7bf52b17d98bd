//! Comparison of a table of another program with one of our methods.

use tiprub_reference::compare::{agreement, relative_l2, windowed};
use tiprub_reference::cube::history::CubeHistory;
use tiprub_reference::cube::outside;
use tiprub_reference::cube::scene::{CubeSetting, Mass};
use tiprub_reference::methods::{CubeMethod, augmented};
use tiprub_reference::surface::SurfaceKind;

use super::run;

/// End of the contact of node 1 (s).
const TOUCHING: f64 = 3.58e-4;

/// Compares with `words`: METHOD (a, b, c) SURFACE (facets, spline) MASS (consistent, lumped) FRICTION STEP
/// [STIFFNESS of c, N/m, and the ratio of that of corners to it].
pub fn compare(path: &str, words: &[&str]) {
    let text = std::fs::read_to_string(path).expect("the table can be read");
    let [method, surface, mass, friction, step, rest @ ..] = words else { panic!("too few words") };
    let number = |word: &str| -> f64 { word.parse().expect("a number") };
    let setting = CubeSetting {
        surface: if *surface == "facets" { SurfaceKind::Facets } else { SurfaceKind::Spline },
        mass: if *mass == "lumped" { Mass::Lumped } else { Mass::Consistent },
        friction: number(friction),
        ..CubeSetting::default()
    };
    let theirs = outside::read(&text, setting.speed).expect("the table is sound");
    let end = theirs.times[theirs.times.len() - 1];
    let method = match *method {
        "a" => CubeMethod::Film(Default::default()),
        "b" => CubeMethod::Bipotential,
        _ => CubeMethod::Augmented(augmented::AugmentedOptions {
            penalty: number(rest[0]),
            corners: number(rest[1]),
            tolerance: 1.0,
        }),
    };
    // Recorded as often as the table, so that both are interpolated alike.
    let stride = (1..).find(|k| (*k as f64 + 0.5) * number(step) > theirs.step).expect("some multiple");
    let ours = run(method, setting, number(step), end + number(step), stride);
    println!("{path} / {}", words.join(" "));
    print(&theirs, &ours, setting.speed, end);
}

fn print(theirs: &CubeHistory, ours: &CubeHistory, speed: f64, end: f64) {
    let found = agreement(theirs, ours, speed, TOUCHING.min(end), end);
    let percent = |values: [f64; 3]| values.map(|x| format!("{:.3} %", 100.0 * x)).join(", ");
    println!("  touching: u1x, slowing, u1z {}", percent(found.touching));
    for (from, to) in [(0.0, 1.2e-4), (1.2e-4, TOUCHING.min(end))] {
        println!("  {:.2} to {:.3} ms: {}", from * 1e3, to * 1e3, percent(within(theirs, ours, speed, from, to)));
    }
    println!("  to {:.3} ms: {}", end * 1e3, percent(found.contact));
    println!(
        "  λ1 windows {:.2} %, peak {:+.2} %, impulse {:+.3} %; left impulse {:+.3} %; speed {:+.4} %",
        100.0 * found.windows,
        100.0 * found.peak,
        100.0 * found.impulse,
        100.0 * found.left_impulse,
        100.0 * found.exit
    );
    let largest = |history: &CubeHistory| {
        windowed(&history.times, &history.first_force(), 2e-5, TOUCHING).iter().fold(0.0, |a: f64, x| a.max(*x))
    };
    println!("  largest 20 µs mean of λ1: {:.0} N, {:.0} N", largest(theirs), largest(ours));
}

fn within(theirs: &CubeHistory, ours: &CubeHistory, speed: f64, from: f64, to: f64) -> [f64; 3] {
    let at: Vec<f64> = (1..=200).map(|i| from + (to - from) * f64::from(i) / 200.0).collect();
    [0, 1, 2].map(|component| {
        let lag = if component == 1 { speed } else { 0.0 };
        let series = |history: &CubeHistory| -> Vec<f64> {
            history.first(component).iter().zip(&history.times).map(|(u, t)| u + lag * t).collect()
        };
        relative_l2((&theirs.times, &series(theirs)), (&ours.times, &series(ours)), &at)
    })
}

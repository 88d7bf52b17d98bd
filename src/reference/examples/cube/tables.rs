//! Results of the comparison as Markdown.

use tiprub_reference::compare::{WINDOW, agreement, asymmetry, exit_speed, relative_l2, windowed};
use tiprub_reference::cube::history::CubeHistory;
use tiprub_reference::cube::scene::{CubeSetting, Mass};
use tiprub_reference::methods::{CubeMethod, penalty};

use super::run;

/// Returns the last time of contact of node 1 (s).
fn released(history: &CubeHistory) -> f64 {
    let last = history.first_force().iter().rposition(|force| *force > 0.0).unwrap_or(0);
    history.times[last]
}

/// Prints every pair of runs.
pub fn pairs(named: &[(&str, CubeHistory)], speed: f64) {
    let touching = released(&named[0].1);
    let contact = named[0].1.last_contact().unwrap_or(0.0);
    println!("node 1 touches until {:.4} ms, the cube until {:.4} ms (of a)\n", touching * 1e3, contact * 1e3);
    println!(
        "| pair | u1x | slowing of u1y | u1z | u1x, whole contact | slowing | u1z | u1y itself | λ1 in windows | peak | impulse | left face | exit speed |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for (i, (first, b)) in named.iter().enumerate() {
        for (second, a) in &named[i + 1..] {
            let found = agreement(a, b, speed, touching, contact);
            let percent = |x: f64| format!("{:.2} %", 100.0 * x);
            let signed = |x: f64| format!("{:+.2} %", 100.0 * x);
            let cells: Vec<String> = found
                .touching
                .iter()
                .chain(&found.contact)
                .chain([&found.path, &found.windows])
                .map(|x| percent(*x))
                .chain([found.peak, found.impulse, found.left_impulse, found.exit].map(signed))
                .collect();
            println!("| {second} / {first} | {} |", cells.join(" | "));
        }
    }
}

/// Prints the readings of the figures, run by run.
pub fn readings(named: &[(&str, CubeHistory)]) {
    println!(
        "\n| run | u1x least, largest (mm) | u1z least, largest (mm) | peak λ1, means over 2 µs and 20 µs (N) | node 1 until (ms) | cube until (ms) | exit (m/s) | asymmetry ux, λ | deepest (µm) | steps (s), preparation (s) |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (name, history) in named {
        let span = |component: usize| {
            let values = history.first(component);
            let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(*x), b.max(*x)));
            format!("{:.3}, {:.3}", low * 1e3, high * 1e3)
        };
        let peak = |length: f64| {
            let means = windowed(&history.times, &history.first_force(), length, 1e-3);
            means.iter().fold(0.0, |a: f64, x| a.max(*x))
        };
        let [moved, force] = asymmetry(history, history.times.last().copied().unwrap_or(0.0));
        println!(
            "| {name} | {} | {} | {:.0}, {:.0} | {:.3} | {:.3} | {:.3} | {moved:.1e}, {force:.1e} | {:.1e} | {:.1}, {:.1} |",
            span(0),
            span(2),
            peak(2e-6),
            peak(WINDOW),
            released(history) * 1e3,
            history.last_contact().unwrap_or(0.0) * 1e3,
            exit_speed(history),
            history.penetration.iter().fold(0.0, |a: f64, x| a.max(*x)) * 1e6,
            history.processor_time,
            history.preparation_time
        );
    }
}

/// Prints errors over h relative to the finest run of a, on the same mesh and spline.
pub fn convergence(mass: Mass) {
    let setting = CubeSetting { mass, ..CubeSetting::default() };
    // Node 1 has left the rings by this time.
    let end = 5e-4;
    let explicit: &[(f64, usize)] = match mass {
        Mass::Lumped => &[(8e-7, 1), (4e-7, 5), (2e-7, 10), (1e-7, 20), (5e-8, 40), (2.5e-8, 80)],
        Mass::Consistent => &[(4e-7, 5), (2e-7, 10)],
    };
    let film = CubeMethod::Film(Default::default());
    let film: Vec<CubeHistory> = explicit.iter().map(|(h, stride)| run(film, setting, *h, end, *stride)).collect();
    let implicit: Vec<CubeHistory> = [(2e-6, 1), (1e-6, 2), (5e-7, 4), (2.5e-7, 8)]
        .map(|(h, stride)| run(CubeMethod::Bipotential, setting, h, end, stride))
        .into();
    let stiff = penalty::PenaltyOptions { stiffness: 5e9, ..penalty::PenaltyOptions::default() };
    let mut others: Vec<CubeHistory> = [(2e-6, 1), (1e-6, 2)]
        .map(|(h, stride)| run(CubeMethod::Augmented(Default::default()), setting, h, end, stride))
        .into();
    if mass == Mass::Lumped {
        others.push(run(CubeMethod::Penalty(Default::default()), setting, 1e-7, end, 20));
        let mut stiffer = run(CubeMethod::Penalty(stiff), setting, 1e-7, end, 20);
        stiffer.method.push_str(", ten times stiffer");
        others.push(stiffer);
    }
    let (finest, other) = (&film[film.len() - 1], &implicit[implicit.len() - 1]);
    let touching = released(finest);
    let contact = end;
    println!(
        "| method | h (µs) | u1x | slowing of u1y | u1z | u1x to 0.5 ms | λ1 in windows | impulse | speed at 0.5 ms | total energy at 0.5 ms (J) | processor time (s) |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
    for history in film.iter().chain(&implicit).chain(&others) {
        let found = agreement(history, finest, setting.speed, touching, contact);
        println!(
            "| {} | {:.3} | {:.3} % | {:.3} % | {:.3} % | {:.3} % | {:.2} % | {:+.3} % | {:+.4} % | {:.2} | {:.1} |",
            history.method,
            history.step * 1e6,
            100.0 * found.touching[0],
            100.0 * found.touching[1],
            100.0 * found.touching[2],
            100.0 * found.contact[0],
            100.0 * found.windows,
            100.0 * found.impulse,
            100.0 * found.exit,
            history.total().last().copied().unwrap_or(f64::NAN),
            history.processor_time
        );
    }
    let at: Vec<f64> = (1..=400).map(|i| f64::from(i) * touching / 400.0).collect();
    let meet = relative_l2((&finest.times, &finest.first(0)), (&other.times, &other.first(0)), &at);
    println!("\nfinest a and finest b: u1x {:.4} % apart while node 1 touches", 100.0 * meet);
}

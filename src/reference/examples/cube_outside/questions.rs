//! Two questions about method a: the gaps with consistent mass, and the effect of turning normals on the energy.

use tiprub_reference::cube::OUTER_RADIUS;
use tiprub_reference::cube::history::CubeHistory;
use tiprub_reference::cube::scene::{CubeSetting, Mass};
use tiprub_reference::methods::{CubeMethod, film};
use tiprub_reference::surface::SurfaceKind;

use super::run;

/// Prints the penetration of film with the contacts chosen as in the paper, and with the whole complementarity
/// problem.
pub fn gaps() {
    println!(
        "| mass | surface | contacts | h (µs) | deepest (m) | speed at 0.3 ms (m/s) | CPU (s) |\n|---|---|---|---|---|---|---|"
    );
    for (mass, surface, step) in [
        (Mass::Consistent, SurfaceKind::Spline, 4e-7),
        (Mass::Consistent, SurfaceKind::Spline, 2e-7),
        (Mass::Consistent, SurfaceKind::Facets, 4e-7),
        (Mass::Lumped, SurfaceKind::Spline, 4e-7),
    ] {
        for complementary in [false, true] {
            let options = film::FilmOptions { complementary, ..film::FilmOptions::default() };
            let setting = CubeSetting { mass, surface, ..CubeSetting::default() };
            let history = run(CubeMethod::Film(options), setting, step, 3e-4, 1);
            println!(
                "| {mass:?} | {surface:?} | {} | {:.1} | {:.2e} | {:.4} | {:.1} |",
                if complementary { "complementarity" } else { "the paper's" },
                step * 1e6,
                history.penetration.iter().fold(0.0, |a: f64, x| a.max(*x)),
                -history.velocity[history.velocity.len() - 1][1],
                history.processor_time
            );
        }
    }
}

/// Prints the energy gain of sliding on a curved surface: at the rate v² h/R per impulse, because the force of t_n
/// acts along the normal of t_{n+1}. 50 m/s, no friction.
pub fn turning() {
    println!(
        "| h (µs) | total at 2.1 ms (J) | lowest (J) | normal impulse (N·s) | v² h I/R (J) | total less that (J) |"
    );
    println!("|---|---|---|---|---|---|");
    let speed = 50.0;
    for (step, stride) in [(8e-7, 1), (4e-7, 2), (2e-7, 4), (1e-7, 8)] {
        let setting = CubeSetting { speed, friction: 0.0, ..CubeSetting::default() };
        let history: CubeHistory = run(CubeMethod::Film(Default::default()), setting, step, 2.1e-3, stride);
        let (total, interval) = (history.total(), step * stride as f64);
        let impulse: f64 = history.forces.iter().map(|sides| sides[0] + sides[1]).sum::<f64>() * interval;
        let gain = speed * speed * step * impulse / OUTER_RADIUS;
        let last = total[total.len() - 1];
        println!(
            "| {:.1} | {last:.3} | {:.3} | {impulse:.3} | {gain:.3} | {:.3} |",
            step * 1e6,
            total.iter().fold(f64::MAX, |a, x| a.min(*x)),
            last - gain
        );
    }
}

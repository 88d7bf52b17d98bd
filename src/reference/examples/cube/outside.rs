//! CalculiX's displacements of node 1 beside ours.

use tiprub_reference::compare::relative_l2;
use tiprub_reference::cube::history::History;
use tiprub_reference::cube::scene::{Mass, Setting};
use tiprub_reference::methods::Method;
use tiprub_reference::surface::SurfaceKind;

use super::run;

/// End of the rebounds of the first touch in CalculiX's solution (s).
const REBOUNDED: f64 = 1.2e-4;

/// Times and displacements of node 1 of the cube out of a CalculiX `.dat` file.
fn read(path: &str) -> (Vec<f64>, Vec<[f64; 3]>) {
    let text = std::fs::read_to_string(path).expect("the .dat file can be read");
    let (mut times, mut moved, mut expects) = (Vec::new(), Vec::new(), false);
    for line in text.lines() {
        if line.contains("displacements (vx,vy,vz) for set N_CUBE") {
            times.push(line.rsplit(' ').next().and_then(|word| word.parse().ok()).expect("a time"));
            expects = true;
            continue;
        }
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        if expects && numbers.len() == 4 {
            moved.push([numbers[1], numbers[2], numbers[3]]);
            expects = false;
        }
    }
    (times, moved)
}

/// Print how far node 1 is from CalculiX's, which has consistent mass, facets and large displacements.
pub fn compare(path: &str) {
    let (times, moved) = read(path);
    let end = times.last().copied().expect("at least one increment");
    let friction = if path.contains("frictionless") { 0.0 } else { 0.15 };
    println!("CalculiX: {} increments to {:.4} ms, µ = {friction}", times.len(), end * 1e3);
    let settings = [
        (SurfaceKind::Facets, Mass::Consistent),
        (SurfaceKind::Facets, Mass::Lumped),
        (SurfaceKind::Spline, Mass::Consistent),
    ];
    for (surface, mass) in settings {
        let setting = Setting { surface, mass, friction, ..Setting::default() };
        for method in [Method::Bipotential, Method::Augmented(Default::default())] {
            let history: History = run(method, setting, 1e-6, end, 1);
            // Before REBOUNDED CalculiX's node 1 still jumps on the ring.
            for (from, to) in [(0.0, REBOUNDED), (REBOUNDED, end), (0.0, end)] {
                let at: Vec<f64> = (1..=200).map(|i| from + (to - from) * f64::from(i) / 200.0).collect();
                let apart = [0, 1, 2].map(|i| {
                    let lag = if i == 1 { setting.speed } else { 0.0 };
                    let theirs: Vec<f64> = moved.iter().zip(&times).map(|(u, t)| u[i] + lag * t).collect();
                    let ours: Vec<f64> =
                        history.first(i).iter().zip(&history.times).map(|(u, t)| u + lag * t).collect();
                    100.0 * relative_l2((&history.times, &ours), (&times, &theirs), &at)
                });
                println!(
                    "{} {surface:?} {mass:?}, {:.2} to {:.2} ms: u1x {:.2} %, slowing of u1y {:.2} %, u1z {:.2} %",
                    history.method,
                    from * 1e3,
                    to * 1e3,
                    apart[0],
                    apart[1],
                    apart[2]
                );
            }
        }
    }
}

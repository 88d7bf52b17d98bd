//! CalculiX's displacements of node 1 beside ours, and as a table.

use std::path::Path;

use tiprub_reference::compare::relative_l2;
use tiprub_reference::cube::history::History;
use tiprub_reference::cube::scene::{Mass, Setting};
use tiprub_reference::methods::Method;
use tiprub_reference::surface::SurfaceKind;

use super::run;

/// End of the rebounds of the first touch in CalculiX's solution (s).
const REBOUNDED: f64 = 1.2e-4;

/// What a CalculiX `.dat` file says of node 1 of the cube.
struct Theirs {
    times: Vec<f64>,
    displacements: Vec<[f64; 3]>,
    /// Contact pressures (Pa), one per time.
    pressures: Vec<f64>,
}

fn read(path: &str) -> Theirs {
    let text = std::fs::read_to_string(path).expect("the .dat file can be read");
    let mut theirs = Theirs { times: Vec::new(), displacements: Vec::new(), pressures: Vec::new() };
    let (mut in_displacements, mut in_contact) = (false, false);
    for line in text.lines() {
        if line.contains(" for ") {
            in_displacements = line.contains("displacements (vx,vy,vz) for set N_CUBE");
            in_contact = line.contains("contact stress");
            if in_displacements {
                theirs.times.push(line.rsplit(' ').next().and_then(|word| word.parse().ok()).expect("a time"));
                theirs.pressures.push(0.0);
            }
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.len() != 4 || words[0] != "1" {
            continue;
        }
        let numbers: [f64; 3] = core::array::from_fn(|i| words[i + 1].parse().expect("a number"));
        if in_displacements {
            theirs.displacements.push(numbers);
        } else if in_contact {
            // Contact of an increment comes after its displacements.
            *theirs.pressures.last_mut().expect("an increment") = numbers[0];
        }
    }
    theirs
}

/// Print how far node 1 is from CalculiX's, which has consistent mass, facets and large displacements.
/// `stiffness` is the
/// pressure per overclosure of its run (Pa/m): by pressure over stiffness its node lies inside the ring, which is added to u1x.
pub fn compare(directory: &Path, path: &str, stiffness: f64) {
    let Theirs { times, mut displacements, pressures } = read(path);
    let mut table = String::from("t,u1x,u1y,u1z,pressure\n");
    for ((t, [x, y, z]), pressure) in times.iter().zip(&displacements).zip(&pressures) {
        table.push_str(&format!("{t:e},{x:e},{y:e},{z:e},{pressure:e}\n"));
    }
    std::fs::write(directory.join("cube_calculix.csv"), table).expect("a CSV file can be written");
    displacements.iter_mut().zip(&pressures).for_each(|(u, pressure)| u[0] += pressure / stiffness);
    let end = times.last().copied().expect("at least one increment");
    let friction = if path.contains("frictionless") { 0.0 } else { 0.15 };
    println!("CalculiX: {} increments to {:.4} ms, µ = {friction}", times.len(), end * 1e3);
    let settings = [(SurfaceKind::Facets, Mass::Consistent), (SurfaceKind::Spline, Mass::Consistent)];
    for (surface, mass) in settings {
        let setting = Setting { surface, mass, friction, ..Setting::default() };
        for method in [Method::Bipotential, Method::Augmented(Default::default())] {
            let history: History = run(method, setting, 1e-6, end, 1);
            // Before REBOUNDED CalculiX's node 1 still jumps on the ring.
            for (from, to) in [(0.0, REBOUNDED), (REBOUNDED, end), (0.0, end)] {
                let at: Vec<f64> = (1..=200).map(|i| from + (to - from) * f64::from(i) / 200.0).collect();
                let apart = [0, 1, 2].map(|i| {
                    let lag = if i == 1 { setting.speed } else { 0.0 };
                    let theirs: Vec<f64> = displacements.iter().zip(&times).map(|(u, t)| u[i] + lag * t).collect();
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

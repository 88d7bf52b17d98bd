//! Displacements of node 1 by CalculiX compared with ours, and as a table.

use std::path::Path;

use tiprub_reference::compare::relative_l2;
use tiprub_reference::cube::calculix;
use tiprub_reference::cube::cube_mesh;
use tiprub_reference::cube::history::CubeHistory;
use tiprub_reference::cube::outside::COLUMNS;
use tiprub_reference::cube::scene::{CubeSetting, Mass};
use tiprub_reference::methods::CubeMethod;
use tiprub_reference::surface::SurfaceKind;

use super::run;

/// End of the rebounds after the first contact in the solution of CalculiX (s).
const REBOUNDED: f64 = 1.2e-4;

/// Contents of a CalculiX `.dat` file of the cube.
#[derive(Default)]
struct CalculixResults {
    times: Vec<f64>,
    /// Displacements of node 1 (m).
    displacements: Vec<[f64; 3]>,
    /// Contact pressures of node 1 (Pa), one per time.
    pressures: Vec<f64>,
    /// Normal forces on the left face (N), one per time.
    left: Vec<f64>,
}

fn read(path: &str) -> CalculixResults {
    let text = std::fs::read_to_string(path).expect("the .dat file can be read");
    let cube = cube_mesh();
    let mut theirs = CalculixResults::default();
    let (mut in_displacements, mut in_contact) = (false, false);
    for line in text.lines() {
        if line.contains(" for ") {
            in_displacements = line.contains("displacements (vx,vy,vz) for set N_CUBE");
            in_contact = line.contains("contact stress");
            if in_displacements {
                theirs.times.push(line.rsplit(' ').next().and_then(|word| word.parse().ok()).expect("a time"));
                theirs.pressures.push(0.0);
                theirs.left.push(0.0);
            }
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        let Some(node) = words.first().and_then(|word| word.parse::<usize>().ok()) else { continue };
        if words.len() != 4 || !(in_displacements && node == 1 || in_contact) {
            continue;
        }
        let numbers: [f64; 3] = core::array::from_fn(|i| words[i + 1].parse().expect("a number"));
        if in_displacements {
            theirs.displacements.push(numbers);
            continue;
        }
        // The contact results of an increment follow its displacements.
        let last = theirs.times.len() - 1;
        if node == 1 {
            theirs.pressures[last] = numbers[0];
        }
        if cube.sets["MASTER_LEFT"].contains(&(node - 1)) {
            theirs.left[last] += numbers[0] * calculix::area(&cube, node - 1);
        }
    }
    theirs
}

/// Prints the difference of node 1 from CalculiX, which has consistent mass and facets, and writes its table.
/// `stiffness` is the pressure per overclosure of its run (Pa/m): its node is inside the ring by pressure over
/// stiffness, which is added to u1x.
pub fn compare(directory: &Path, path: &str, stiffness: f64) {
    let CalculixResults { times, mut displacements, pressures, left } = read(path);
    let corner = calculix::area(&cube_mesh(), 0);
    let mut table = format!("{COLUMNS}\n");
    for (i, t) in times.iter().enumerate() {
        let ([x, y, z], first) = (displacements[i], pressures[i] * corner);
        table.push_str(&format!("{t:e},{x:e},{y:e},{z:e},{first:.6e},{:.6e},0\n", left[i]));
    }
    std::fs::write(directory.join("cube_calculix.csv"), table).expect("a CSV file can be written");
    displacements.iter_mut().zip(&pressures).for_each(|(u, pressure)| u[0] += pressure / stiffness);
    let end = times.last().copied().expect("at least one increment");
    let friction = if path.contains("frictionless") { 0.0 } else { 0.15 };
    println!("CalculiX: {} increments to {:.4} ms, µ = {friction}", times.len(), end * 1e3);
    let settings = [(SurfaceKind::Facets, Mass::Consistent), (SurfaceKind::Spline, Mass::Consistent)];
    for (surface, mass) in settings {
        let setting = CubeSetting { surface, mass, friction, ..CubeSetting::default() };
        for method in [CubeMethod::Bipotential, CubeMethod::Augmented(Default::default())] {
            let history: CubeHistory = run(method, setting, 1e-6, end, 1);
            // Before REBOUNDED, node 1 of CalculiX still rebounds on the ring.
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

//! A blade that rubs a coating turn after turn, through the public interface: the groove, its ledger, no allocation.

use std::f64::consts::TAU;

use tiprub_core::contact::coating::{BladeTip, CoatedProblem, Coating};
use tiprub_core::scene::settings::CoatingSettings;
use tiprub_test_models::{self as models, go, real, started};

use crate::counting::allocations_of;

const MODULUS: f64 = 2e9;
const YIELD: f64 = 1e7;
const HARDENING: f64 = 5e8;
const THICKNESS: f64 = 5e-3;
const RADIUS: f64 = 0.25;
const AXIAL: [f64; 3] = [0.0, 0.02, 0.045];
/// Width of the tip around the circumference (m).
const WIDTH: f64 = 4e-3;

fn settings() -> CoatingSettings {
    CoatingSettings {
        thickness: THICKNESS,
        modulus: MODULUS,
        yield_stress: YIELD,
        hardening: HARDENING,
        cells_around: 360,
        cells_along: 20,
        contact_width: Some(WIDTH),
        cutting: None,
    }
}

/// Performs one step of a blade whose tip would have the gap `gap` without contact; returns the work of the wear (J).
fn rub(coating: &mut Coating, problem: &mut CoatedProblem, angle: f64, gap: f64) -> f64 {
    problem.clear();
    coating.locate(problem, &[angle; 3]);
    for i in 0..3 {
        for j in 0..3 {
            problem.delassus[(i, j)] = if i == j { 2e-8 } else { 2e-9 };
        }
        problem.gaps[i] = gap;
    }
    assert!(problem.solve().solved);
    coating.commit(problem)
}

/// Uniform wear around a steep cone: 2π r̄ L of the mean radius, times the depth, and its work.
#[test]
fn uniform_wear_of_a_cone_has_the_closed_form_volume() {
    let radii = AXIAL.map(|z| 0.1 + 4.0 * z);
    let mut coating = Coating::new(&settings(), &BladeTip::new(&AXIAL, &radii, 1e-4), 1).unwrap();
    let (mut problem, mut work) = (coating.problem(1), 0.0);
    for cell in 0..360 {
        problem.clear();
        coating.locate(&mut problem, &[(f64::from(cell) + 0.5) * TAU / 360.0; 3]);
        // Rigid nodes.
        problem.gaps.fill(-4e-4);
        assert!(problem.solve().solved);
        work += coating.commit(&problem);
    }
    // On the hardening line σ = Y + Kε_p = E(ε − ε_p).
    let plastic = (MODULUS * 4e-4 / THICKNESS - YIELD) / (MODULUS + HARDENING);
    let area = TAU * (0.1 + 4.0 * 0.5 * 0.045) * 0.045;
    let (depth, stored) = (plastic * THICKNESS, YIELD * plastic + 0.5 * HARDENING * plastic * plastic);
    let (volume, energy) = (depth * area, stored * area * THICKNESS);
    assert!((coating.largest_wear_depth() / depth - 1.0).abs() < 1e-12);
    assert!((coating.worn_volume() / volume - 1.0).abs() < 1e-12, "{:e} of {volume:e} m3", coating.worn_volume());
    assert!((work / energy - 1.0).abs() < 1e-12, "{work} of {energy} J");
}

#[test]
fn a_blade_cuts_a_groove_and_then_runs_free_in_it() {
    let mut coating = Coating::new(&settings(), &BladeTip::new(&AXIAL, &[RADIUS; 3], WIDTH), 1).unwrap();
    let mut problem = coating.problem(1);
    let depth = |angle: f64| 4e-4 * angle.cos(); // An eccentric rotor.
    let mut works = [0.0; 3];
    let allocations = allocations_of(|| {
        for work in &mut works {
            for step in 0..720 {
                let angle = f64::from(step) * TAU / 720.0 + 1e-3;
                *work += rub(&mut coating, &mut problem, angle, -depth(angle));
            }
        }
    });
    assert_eq!(allocations, 0, "while stepping");
    // The second turn meets the groove of the first one, whose slope supports less of the tip than fresh coating: it
    // penetrates slightly deeper.
    assert!(works[0] > 1.0, "{works:?} J");
    assert!(works[1] < 5e-3 * works[0] && works[2] < 0.5 * works[1], "{works:?} J");
    // The work of the wear is stored completely in the cells: Y·ε_p + K·ε_p²/2 of their volume.
    let volume = RADIUS * TAU / 360.0 * (0.045 / 20.0) * THICKNESS;
    let stored = |cell: usize| {
        let plastic = coating.wear_depth(cell) / THICKNESS;
        volume * (YIELD * plastic + 0.5 * HARDENING * plastic * plastic)
    };
    let total: f64 = (0..360 * 20).map(stored).sum();
    assert!((total - works.iter().sum::<f64>()).abs() < 1e-12 * total, "{total} J, {works:?} J");
    // Worn where the rotor comes close, unworn on the opposite side.
    for cell in 0..360 * 20 {
        let depth = depth((f64::from(u32::try_from(cell % 360).unwrap()) + 0.5) * TAU / 360.0);
        let worn = coating.wear_depth(cell);
        assert!(worn <= depth.max(0.0) + 1e-5 && (depth > 0.0 || worn < 1e-12), "cell {cell}: {worn} of {depth}");
    }
    assert!(coating.largest_wear_depth() > 1e-4, "{}", coating.largest_wear_depth());
}

/// Returns the depth of a rigid tip below the unworn surface at an angle, in one pass over a bump (m).
fn pressed(angle: f64) -> f64 {
    8e-4 * (angle.cos() - 0.6)
}

/// Returns ∫F dθ over the pass (N rad) and the volume worn (m³) of a coating without cells, by quadrature.
fn of_a_continuum() -> [f64; 2] {
    let (reach, half) = (0.6_f64.acos(), 0.5 * WIDTH / RADIUS);
    let plastic = |depth: f64| ((MODULUS * depth / THICKNESS - YIELD) / (MODULUS + HARDENING)).max(0.0);
    let length = AXIAL[2] * RADIUS;
    let mean = |from: f64, to: f64, count: i32, of: &dyn Fn(f64) -> f64| {
        let at = |index: i32| from + (to - from) * (f64::from(index) + 0.5) / f64::from(count);
        (0..count).map(|index| of(at(index))).sum::<f64>() * (to - from) / f64::from(count)
    };
    // The largest depth to which a point has been pressed while the tip, now at an angle, has been over it.
    let deepest = |place: f64, now: f64| pressed(0.0_f64.clamp(place - half, now.min(place + half)));
    let stress = |place: f64, now: f64| (MODULUS * (pressed(now) / THICKNESS - plastic(deepest(place, now)))).max(0.0);
    let force = |now: f64| mean(now - half, now + half, 200, &|place| length * stress(place, now));
    let worn = |place: f64| length * THICKNESS * plastic(deepest(place, f64::INFINITY));
    [mean(-reach, reach, 2000, &force), mean(-reach - half, reach + half, 20_000, &worn)]
}

/// A tip passes a bump once: force, and with it friction heat, and volume against the continuum, on finer and finer cells.
#[test]
fn force_and_volume_converge_as_cells_become_narrow() {
    let exact = of_a_continuum();
    let mut errors: Vec<[f64; 2]> = Vec::new();
    println!("| cells | force | volume |");
    for cells_around in [90, 180, 360, 720, 1440] {
        let settings = CoatingSettings { cells_around, cells_along: 3, ..settings() };
        let mut coating = Coating::new(&settings, &BladeTip::new(&AXIAL, &[RADIUS; 3], WIDTH), 1).unwrap();
        let (mut problem, mut force, mut work) = (coating.problem(1), 0.0, 0.0);
        let steps = 23_040;
        for step in 0..steps {
            // Not synchronous with the cells.
            let angle = (f64::from(step) / f64::from(steps) - 0.5) * TAU + 1e-5;
            if pressed(angle) <= 0.0 {
                continue;
            }
            problem.clear();
            coating.locate(&mut problem, &[angle; 3]);
            problem.gaps[..3].fill(-pressed(angle));
            assert!(problem.solve().solved);
            force += problem.coating[..3].iter().sum::<f64>() * TAU / f64::from(steps);
            work += coating.commit(&problem);
        }
        assert!(work > YIELD * coating.worn_volume(), "{work}");
        let off = [force / exact[0] - 1.0, coating.worn_volume() / exact[1] - 1.0];
        println!("| {cells_around} | {:.4} | {:.4} |", off[0], off[1]);
        errors.push(off.map(f64::abs));
    }
    // Second order, down to the errors of the quadrature and the steps.
    for quantity in 0..2 {
        assert!(errors[0][quantity] > 12.0 * errors[2][quantity], "{errors:?}");
    }
    assert!(
        errors[2..].iter().flatten().zip([3e-3, 3e-3, 5e-4, 5e-4, 5e-4, 5e-4]).all(|(off, most)| *off < most),
        "{errors:?}"
    );
}

/// Whole scenes: the result of a rub does not depend on the number of cells of its coating.
#[test]
fn heat_force_and_volume_of_a_scene_converge_with_its_cells() {
    println!("| cells | friction loss (J) | worn volume (mm3) | wear energy (J) | residual |");
    let runs = [250, 500, 1000, 2000].map(|cells| {
        let mut scene = models::rub(12);
        let coating = models::coating_of(1.5e-4, [cells, 7]);
        scene.settings.contacts[0].coating = Some(coating);
        scene.settings.outputs.energies = true;
        let mut run = started(&scene);
        (0..40).for_each(|_| go(&mut run, 1e-4));
        let found = ["friction_loss", "worn_volume", "wear_energy"].map(|name| real(&run, name));
        let residual = real(&run, "energy_residual_relative");
        println!("| {cells} | {:.4} | {:.3} | {:.4} | {residual:.1e} |", found[0], 1e9 * found[1], found[2]);
        assert!(residual.abs() < 1e-12, "{residual:e}");
        assert!(found[1] > 0.0);
        found
    });
    for (cells, most) in [(1, 1.5e-2), (2, 3e-3)] {
        for quantity in 0..3 {
            let off = (runs[cells][quantity] / runs[3][quantity] - 1.0).abs();
            assert!(off < most, "{cells}, {quantity}: {off:e}");
        }
    }
}

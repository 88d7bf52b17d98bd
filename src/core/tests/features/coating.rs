//! A blade that rubs a coating turn after turn, through the public interface: the groove, its ledger, no allocation.

use std::f64::consts::TAU;

use tiprub_core::laws::coating::{CoatedProblem, Coating};
use tiprub_core::settings::CoatingSettings;

use crate::counting::allocations_of;

const MODULUS: f64 = 2e9;
const YIELD: f64 = 1e7;
const HARDENING: f64 = 5e8;
const THICKNESS: f64 = 5e-3;
const RADIUS: f64 = 0.25;
const AXIAL: [f64; 3] = [0.0, 0.02, 0.045];

fn settings() -> CoatingSettings {
    CoatingSettings {
        thickness: THICKNESS,
        modulus: MODULUS,
        yield_stress: YIELD,
        hardening: HARDENING,
        cells_around: 360,
        cells_along: 20,
        cutting: None,
    }
}

/// One step of a blade whose tip would stand at `gap` without contact; returns the work of the wear (J).
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

/// All around a steep cone, evenly deep: 2π r̄ L of the mean radius, times the depth, and its work.
#[test]
fn what_is_worn_off_a_cone_has_the_volume_of_the_cone() {
    let radii = AXIAL.map(|z| 0.1 + 4.0 * z);
    let mut coating = Coating::new(&settings(), &AXIAL, &radii, 1).unwrap();
    let (mut problem, mut work) = (coating.problem(1), 0.0);
    for cell in 0..360 {
        problem.clear();
        coating.locate(&mut problem, &[(f64::from(cell) + 0.5) * TAU / 360.0; 3]);
        // Nodes that do not yield.
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
    let mut coating = Coating::new(&settings(), &AXIAL, &[RADIUS; 3], 1).unwrap();
    let mut problem = coating.problem(1);
    let depth = |angle: f64| 4e-4 * angle.cos(); // an eccentric rotor
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
    // The second turn meets the groove of the first one, where the same prediction wears nothing more.
    assert!(works[0] > 1.0, "{works:?} J");
    assert!(works[1] < 1e-9 * works[0] && works[2] < 1e-9 * works[0], "{works:?} J");
    // All the work of the wear is in the cells: Y·ε_p + K·ε_p²/2 of their volume.
    let volume = RADIUS * TAU / 360.0 * (0.045 / 20.0) * THICKNESS;
    let stored = |cell: usize| {
        let plastic = coating.wear_depth(cell) / THICKNESS;
        volume * (YIELD * plastic + 0.5 * HARDENING * plastic * plastic)
    };
    let total: f64 = (0..coating.cells()).map(stored).sum();
    assert!((total - works.iter().sum::<f64>()).abs() < 1e-12 * total, "{total} J, {works:?} J");
    // Worn where the rotor comes close, untouched opposite.
    for cell in 0..coating.cells() {
        let (angle, _) = coating.centre(cell);
        let depth = depth(angle);
        let worn = coating.wear_depth(cell);
        assert!(worn <= depth.max(0.0) + 1e-5 && (depth > 0.0 || worn < 1e-12), "cell {cell}: {worn} of {depth}");
    }
    assert!(coating.largest_wear_depth() > 1e-4, "{}", coating.largest_wear_depth());
}

//! The coating against the hand-derived law; balances of energy and virtual work; geometry, groups and state.

use nalgebra::DMatrix;
use proptest::prelude::*;

mod semidefinite;
mod solution;

use solution::{materials, p_matrix};

use super::*;

const THICKNESS: f64 = 0.8;

fn material(
    modulus: f64,
    yield_stress: f64,
    hardening: f64,
    cells_around: usize,
    cells_along: usize,
) -> CoatingSettings {
    CoatingSettings {
        thickness: THICKNESS,
        modulus,
        yield_stress,
        hardening,
        cells_around,
        cells_along,
        contact_width: None,
        cutting: None,
    }
}

/// A tip on radius 1, as wide as a cell.
fn tip(settings: &CoatingSettings, axial: &[f64]) -> BladeTip {
    BladeTip::new(axial, &vec![1.0; axial.len()], TAU / real(settings.cells_around))
}

/// One blade with nodes at z = 0, 1, ...
fn coating(settings: &CoatingSettings, nodes: usize) -> Coating {
    let axial: Vec<f64> = (0..nodes).map(real).collect();
    Coating::new(settings, &tip(settings, &axial).with_extent([-0.2, real(nodes) - 0.8]), 1).unwrap()
}

/// The middle of a cell, where a tip as wide as a cell covers only this cell.
fn middle(settings: &CoatingSettings) -> f64 {
    0.5 * TAU / real(settings.cells_around)
}

fn set_wear(coating: &mut Coating, plastic: &[f64]) {
    let bytes: Vec<u8> =
        (0..coating.plastic.len()).flat_map(|cell| plastic[cell % plastic.len()].to_le_bytes()).collect();
    coating.restore(&mut StateReader::new(&bytes));
}

/// Moves the node of the rod as prescribed, without flexibility, so that the gap stays. Returns the force.
fn press(coating: &mut Coating, penetration: f64) -> f64 {
    let mut problem = coating.problem(1);
    coating.locate(&mut problem, &[TAU / 16.0]);
    problem.gaps[0] = -penetration;
    assert!(problem.solve().solved);
    assert!((problem.gaps[0] + penetration).abs() < 1e-15);
    coating.commit(&problem);
    problem.coating[0]
}

#[test]
fn load_unload_reload_follows_the_law() {
    let (e, y, k) = (7e9, 2e7, 3e8);
    let mut coating = coating(&material(e, y, k, 8, 1), 1);
    let area = std::f64::consts::TAU / 8.0 * 0.4;
    let mut check = |strain: f64, stress: f64| {
        let force = press(&mut coating, strain * THICKNESS);
        assert!(
            (force - area * stress).abs() < 1e-12 * area * (y + stress),
            "strain {strain}: {}",
            force / area - stress
        );
    };
    let yields = y / e;
    check(-1e-3, 0.0);
    check(0.5 * yields, 0.5 * y);
    check(0.999 * yields, 0.999 * y);
    // Beyond the yield point with the tangent EK/(E + K), for any number of steps.
    let tangent = e * k / (e + k);
    check(2.0 * yields, y + tangent * yields);
    check(5.0 * yields, y + tangent * 4.0 * yields);
    // The maximum stress is also Y + Kε_p, which determines ε_p; unloading along E reaches zero at ε_p.
    let top = y + tangent * 4.0 * yields;
    let plastic = (top - y) / k;
    assert!((plastic - (5.0 * yields - top / e)).abs() < 1e-15, "both ways to ε_p agree");
    check(5.0 * yields - 0.3 * top / e, 0.7 * top);
    check(plastic + 1e-6, e * 1e-6);
    check(plastic - 1e-9, 0.0);
    check(0.0, 0.0);
    // Reloading along E up to the hardened yield stress, then on the same hardening line as before.
    check(plastic + 0.9 * top / e, 0.9 * top);
    check(6.0 * yields, y + tangent * 5.0 * yields);
    let after = tangent * 5.0 * yields / k;
    assert!((coating.largest_wear_depth() - after * THICKNESS).abs() < 1e-14);
    assert!((coating.worn_volume() - after * THICKNESS * area).abs() < 1e-14 * area);
}

#[test]
fn closed_cycle_work_is_plastic_plus_hardening_energy() {
    let (e, y, k) = (5.0, 0.4, 1.5);
    let mut coating = coating(&material(e, y, k, 8, 1), 1);
    let volume = std::f64::consts::TAU / 8.0 * 0.4 * THICKNESS;
    // Up to 0.35, back, up to 0.6, back: corners of the law are points of the path, so that the trapezoidal rule is exact.
    let worn = |strain: f64| (e * strain - y) / (e + k);
    let (first, second) = (worn(0.35), worn(0.6));
    let top = first + (y + k * first) / e;
    let path = [0.0, y / e, 0.2, 0.35, first, 0.0, first, top, 0.5, 0.6, second, 0.0];
    let (mut work, mut reported, mut before) = (0.0, 0.0, (0.0, 0.0));
    for strain in path {
        let mut problem = coating.problem(1);
        coating.locate(&mut problem, &[TAU / 16.0]);
        problem.gaps[0] = -strain * THICKNESS;
        assert!(problem.solve().solved);
        reported += coating.commit(&problem);
        let now = (strain * THICKNESS, problem.coating[0]);
        work += 0.5 * (now.1 + before.1) * (now.0 - before.0);
        before = now;
    }
    let expected = volume * (y * second + 0.5 * k * second * second);
    assert!((work - expected).abs() < 1e-14 && (reported - expected).abs() < 1e-14, "{work} {reported} {expected}");
    assert!(expected > 0.01);
}

/// Total force of all cells of a one-node blade at a penetration, by textbook return mapping.
fn return_mapping(settings: &CoatingSettings, plastic: &[f64], areas: &[f64], penetration: f64) -> f64 {
    let cell = |(plastic, area): (&f64, &f64)| {
        let strain = penetration / settings.thickness;
        let trial = settings.modulus * (strain - plastic);
        let over = trial - (settings.yield_stress + settings.hardening * plastic);
        let step = if over > 0.0 { over / (settings.modulus + settings.hardening) } else { 0.0 };
        area * (trial - settings.modulus * step).max(0.0)
    };
    plastic.iter().zip(areas).map(cell).sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn wear_never_decreases(
        settings in materials(),
        path in prop::collection::vec((-1.0..0.3_f64, -1.0..0.3_f64, -20.0..20.0_f64), 1..40),
    ) {
        let mut coating = coating(&settings, 2);
        let (mut before, mut volume) = (vec![0.0; coating.plastic.len()], 0.0);
        for (first, second, angle) in path {
            let mut problem = coating.problem(1);
            coating.locate(&mut problem, &[angle, angle + 0.1]);
            problem.delassus.copy_from_slice(&[1.0, 0.2, 0.3, 1.5]);
            problem.gaps.copy_from_slice(&[first, second]);
            prop_assert!(problem.solve().solved);
            let unchanged: Vec<f64> = (0..coating.plastic.len()).map(|cell| coating.wear_depth(cell)).collect();
            prop_assert_eq!(&unchanged, &before, "solving wears nothing");
            prop_assert!(coating.commit(&problem) >= 0.0);
            let after: Vec<f64> = (0..coating.plastic.len()).map(|cell| coating.wear_depth(cell)).collect();
            prop_assert!(before.iter().zip(&after).all(|(before, after)| after >= before && *after <= THICKNESS));
            prop_assert!(coating.worn_volume() >= volume);
            let largest = after.iter().copied().fold(0.0, f64::max);
            prop_assert_eq!(coating.largest_wear_depth().to_bits(), largest.to_bits());
            (before, volume) = (after, coating.worn_volume());
        }
    }
}

#[test]
fn interpolation_does_the_same_work_on_both_sides() {
    let settings = material(1.0, 0.1, 0.2, 100, 7);
    let axial = [0.03, 0.0, 0.011, 0.024]; // not in order
    let width = 1e-3; // a sixteenth of a cell
    let coating = Coating::new(&settings, &BladeTip::new(&axial, &[0.25, 0.26, 0.258, 0.252], width), 36).unwrap();
    let mut problem = coating.problem(1);
    coating.locate(&mut problem, &[0.1, 0.11, 0.09, 0.12]);
    let displacement = [0.3, -0.7, 0.45, 1.1];
    let forces = [1.0, 2.0, -3.0, 4.0, 0.5, -0.25, 7.0];
    let (mut on_cells, mut on_nodes) = (0.0, [0.0; 4]);
    for (contact, force) in problem.contacts.iter().zip(forces) {
        let moved: f64 = (0..2).map(|end| contact.weights[end] * displacement[contact.nodes[end]]).sum();
        on_cells += force * moved;
        (0..2).for_each(|end| on_nodes[contact.nodes[end]] += contact.weights[end] * force);
        assert!((contact.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }
    let by_nodes: f64 = on_nodes.iter().zip(displacement).map(|(force, moved)| force * moved).sum();
    assert!((on_cells - by_nodes).abs() < 1e-14);
    // A penetration that is linear in z is represented exactly, as is its resultant: solve with prescribed gaps.
    let depth = |z: f64| 0.02 + z;
    (0..4).for_each(|node| problem.gaps[node] = -depth(axial[node]));
    assert!(problem.solve().solved);
    for (row, (cell, force)) in coating.rows.iter().zip(problem.loaded_cells()) {
        assert!((force - width * row.width * depth(row.axial) / THICKNESS).abs() < 1e-15);
        assert!((coating.rows[cell / coating.around].axial - row.axial).abs() < 1e-15);
    }
    let total: f64 = problem.loaded_cells().map(|(_, force)| force).sum();
    let (sum, moment) = (0..4).fold((0.0, 0.0), |(sum, moment), node| {
        (sum + problem.coating[node], moment + problem.coating[node] * axial[node])
    });
    let centres = coating.rows.iter().zip(problem.loaded_cells()).map(|(row, (_, force))| row.axial * force);
    assert!((sum - total).abs() < 1e-15 && (moment - centres.sum::<f64>()).abs() < 1e-15);
    // All cells together have the area of the cone.
    let area: f64 = coating.rows.iter().map(|row| row.area * 100.0).sum();
    assert!((area / (std::f64::consts::TAU * 0.255 * 0.03) - 1.0).abs() < 5e-3, "{area}");
}

#[test]
fn cells_follow_the_angle_of_the_blade() {
    let width = 1e-3 * TAU / 10.0;
    let tip = BladeTip::new(&[0.0, 1.0], &[1.0; 2], width).with_extent([-0.2, 1.2]);
    let coating = Coating::new(&material(1.0, 0.1, 0.2, 10, 3), &tip, 1).unwrap();
    let cells = |first: f64, second: f64| {
        let mut problem = coating.problem(1);
        coating.locate(&mut problem, &[first, second]);
        problem.contacts.iter().map(|contact| contact.cell).collect::<Vec<_>>()
    };
    let cell = std::f64::consts::TAU / 10.0;
    assert_eq!(cells(0.5 * cell, 0.5 * cell), [0, 10, 20]);
    assert_eq!(cells(-0.5 * cell, -0.5 * cell), [9, 19, 29]);
    assert_eq!(cells(-1e-300, -1e-300), [9, 0, 19, 10, 29, 20], "half of it on each side of the seam");
    assert_eq!(cells(1000.0 * TAU + 3.5 * cell, 3.5 * cell), [3, 13, 23]);
    // Swept across the seam: the middle row is between its nodes; the outer rows are beyond the nodes at 0.2 and 0.8.
    assert_eq!(cells(-0.6 * cell, 1.0 * cell + 0.4 * cell), [9, 10, 21]);
    assert_eq!(cells(TAU - 0.6 * cell, 1.4 * cell), [9, 10, 21], "however the angles are wrapped");
    for index in 0..coating.plastic.len() {
        let angle = (real(index % 10) + 0.5) * cell;
        assert_eq!(cells(angle, angle)[index / 10], index);
    }
}

/// Fractions of cells by the overlap of intervals, for any angle and width.
#[test]
fn covered_cell_fractions_sum_to_the_tip_width() {
    let mut random = tiprub_test_models::SeededRandom(3);
    for _ in 0..3000 {
        let (around, angle) = (40, 30.0 * (random.unit() - 0.5));
        let width = random.scale(1e-3, 30.0);
        let mut found = Vec::new();
        covered(angle, width, around, |cell, share| found.push((cell, share)));
        assert!(real(found.len()) <= width.floor() + 2.0);
        assert!((found.iter().map(|(_, share)| share).sum::<f64>() - width).abs() < 1e-12 * (1.0 + width));
        let middle = angle / TAU * real(around);
        for cell in 0..around {
            let expected: f64 = (-4..=4)
                .map(|turn| {
                    let edge = real(cell) + f64::from(turn) * real(around);
                    ((edge + 1.0).min(middle + 0.5 * width) - edge.max(middle - 0.5 * width)).max(0.0)
                })
                .sum();
            let own: f64 = found.iter().filter(|(other, _)| *other == cell).map(|(_, share)| share).sum();
            assert!((own - expected).abs() < 1e-12 * (1.0 + middle.abs()), "{cell}: {own} {expected}");
        }
    }
}

/// At equal penetration an unworn coating returns the same force for any size of the cells and any position of the tip on them.
#[test]
fn force_does_not_depend_on_the_width_of_cells() {
    for (cells, angle) in [4, 7, 50, 720, 10_007].into_iter().flat_map(|cells| [0.1, 2.0, -3.3].map(|at| (cells, at))) {
        let settings = material(2.0, 0.3, 0.4, cells, 3);
        let tip = BladeTip::new(&[0.0, 1.0], &[1.0; 2], 0.2).with_extent([-0.2, 1.2]);
        let coating = Coating::new(&settings, &tip, 1).unwrap();
        let mut problem = coating.problem(1);
        coating.locate(&mut problem, &[angle, angle + 0.03]);
        problem.gaps.fill(-0.5 * THICKNESS);
        assert!(problem.solve().solved);
        let force: f64 = problem.coating.iter().sum();
        let expected = return_mapping(&settings, &[0.0], &[0.2 * 1.4], 0.5 * THICKNESS);
        assert!((force / expected - 1.0).abs() < 1e-12, "{cells} cells: {force} {expected}");
    }
}

/// A staggered rectangle of 60 × 2 mm in five patches; widths are 2 mm over the cosine of its stagger.
#[test]
fn patch_width_is_thickness_over_cosine_of_stagger() {
    for (stagger, radius) in [(0.0_f64, 0.25), (1.0, 0.25), (-1.0, 0.25), (1.0, 2.5)] {
        let (chord, thickness) = (0.06, 2e-3);
        let node = |index: usize| {
            let (along, share) = (chord * real(index) / 4.0, if index.is_multiple_of(4) { 0.125 } else { 0.25 });
            // On both sides of the angle at which counting restarts.
            let angle = (along * stagger.sin() / radius).rem_euclid(TAU);
            let (area, length) = (share * chord * thickness, share * chord);
            let position = [radius, angle, along * stagger.cos()];
            crate::scene::rom::ContactNode { position, area, length, ..crate::scene::rom::ContactNode::default() }
        };
        let nodes: Vec<_> = [3, 0, 4, 1, 2].map(node).into();
        let settings = material(1.0, 0.1, 0.1, 8, 2);
        let tip = BladeTip::of(&nodes.iter().collect::<Vec<_>>(), &settings);
        for width in &tip.widths {
            assert!((width * stagger.cos() / thickness - 1.0).abs() < 1e-12, "{width}");
        }
        let given = CoatingSettings { contact_width: Some(0.7), ..settings };
        assert_eq!(BladeTip::of(&nodes.iter().collect::<Vec<_>>(), &given).widths, [0.7; 5]);
        // One node alone: its area over the strip that it represents.
        let alone = BladeTip::of(&[&nodes[0]], &settings);
        let [low, high] = alone.extent;
        assert!((alone.widths[0] * (high - low) / nodes[0].area - 1.0).abs() < 1e-12);
    }
}

#[test]
fn hard_contact_carries_load_beyond_the_coating_thickness() {
    let settings = material(2.0, 0.3, 0.4, 4, 3);
    let coating = coating(&settings, 1);
    let areas: Vec<f64> = coating.rows.iter().map(|row| row.area).collect();
    let mut problem = coating.problem(1);
    coating.locate(&mut problem, &[0.1]);
    problem.delassus[(0, 0)] = 0.5;
    problem.gaps[0] = -10.0;
    assert!(problem.solve().solved);
    let crushed = return_mapping(&settings, &[0.0; 3], &areas, THICKNESS);
    assert!((problem.coating[0] - crushed).abs() < 1e-13 && crushed > 0.1);
    assert!((problem.hard[0] - ((10.0 - THICKNESS) / 0.5 - crushed)).abs() < 1e-12);
    assert_eq!((problem.gaps[0], problem.closed[0]), (-THICKNESS, true));
}

#[test]
fn wear_map_round_trips_bit_for_bit() {
    let settings = material(3.0, 0.1, 0.7, 16, 3);
    let mut worn = coating(&settings, 2);
    for step in 0..50 {
        let mut problem = worn.problem(1);
        worn.locate(&mut problem, &[0.37 * real(step), 0.37 * real(step) + 0.2]);
        problem.delassus.copy_from_slice(&[1.0, 0.2, 0.3, 1.5]);
        problem.gaps.copy_from_slice(&[-0.5 - 0.004 * real(step), 0.1 - 0.01 * real(step)]);
        assert!(problem.solve().solved);
        worn.commit(&problem);
    }
    let mut bytes = vec![0; 8 * worn.plastic.len()];
    let mut writer = StateWriter::new(&mut bytes);
    worn.save(&mut writer);
    assert_eq!(writer.written(), 8 * worn.plastic.len());
    let mut other = coating(&settings, 2);
    assert_ne!(other, worn);
    other.restore(&mut StateReader::new(&bytes));
    let bits = |coating: &Coating| coating.plastic.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&other), bits(&worn));
    assert_eq!(other.worn_volume().to_bits(), worn.worn_volume().to_bits());
    assert!(bits(&worn).iter().filter(|bits| **bits != 0).count() > 20);
    other.reset();
    assert_eq!(other, coating(&settings, 2));
}

#[test]
fn coupled_blades_contact_their_own_cells() {
    let settings = material(3.0, 0.1, 0.7, 16, 4);
    let axial = [0.0, 1.0];
    let coating = Coating::new(&settings, &BladeTip::new(&axial, &[1.0; 2], 0.5 * TAU / 16.0), 4).unwrap();
    let w = p_matrix(&[0.1, 0.9, -0.3, 0.4, 0.8, -0.5, 0.2, 0.6, 0.7, -0.2, 0.3, -0.8, 0.5, 0.1, -0.6, 0.9], 4);
    let gaps = [-0.4, 0.1, -0.9, -2.5];
    let solve = |blades: [usize; 2], w: &DMatrix<f64>| {
        let mut problem = coating.problem(3);
        for blade in blades {
            coating.locate(&mut problem, &[TAU / 4.0 * real(blade) + 0.2; 2]);
        }
        assert_eq!(problem.size, 4);
        for (place, blade) in blades.iter().enumerate() {
            for end in 0..2 {
                problem.gaps[2 * place + end] = gaps[2 * blade + end];
                for (other, column) in blades.iter().enumerate() {
                    (0..2).for_each(|j| {
                        problem.delassus[(2 * place + end, 2 * other + j)] = w[(2 * blade + end, 2 * column + j)];
                    });
                }
            }
        }
        assert!(problem.solve().solved);
        problem
    };
    let (forward, backward) = (solve([0, 1], &w), solve([1, 0], &w));
    for node in 0..4 {
        let other = (node + 2) % 4;
        assert!((forward.gaps[node] - backward.gaps[other]).abs() < 1e-13);
        assert!((forward.coating[node] - backward.coating[other]).abs() < 1e-13);
        assert!((forward.hard[node] - backward.hard[other]).abs() < 1e-13);
    }
    // The equation itself, including the coupling; without the coupling the result differs.
    for i in 0..4 {
        let moved: f64 = (0..4).map(|j| w[(i, j)] * (forward.coating[j] + forward.hard[j])).sum();
        assert!((forward.gaps[i] - gaps[i] - moved).abs() < 1e-13);
    }
    let mut alone = w.clone();
    alone.view_mut((0, 2), (2, 2)).fill(0.0);
    alone.view_mut((2, 0), (2, 2)).fill(0.0);
    assert!((solve([0, 1], &alone).gaps[0] - forward.gaps[0]).abs() > 1e-3);
    let mut worn = coating.clone();
    worn.commit(&forward);
    let places: Vec<usize> =
        (0..worn.plastic.len()).filter(|cell| worn.wear_depth(*cell) > 0.0).map(|c| c % 16).collect();
    assert!(!places.is_empty() && places.iter().all(|place| [0, 4].contains(place)), "{places:?}");
}

#[test]
fn rejects_invalid_coatings() {
    let settings = material(1.0, 0.1, 0.1, 8, 2);
    let refused = |result: Result<Coating>, part: &str| {
        let message = result.unwrap_err().to_string();
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    };
    let made = |axial: &[f64], blades: usize| Coating::new(&settings, &tip(&settings, axial), blades);
    refused(made(&[0.1], 1), "1 contact nodes per blade over an axial length of 0 m");
    refused(made(&[], 1), "0 contact nodes");
    refused(made(&[0.1, 0.0, 0.1], 1), "nodes 1 and 3 are at the same axial");
    refused(made(&[0.0, 1.0], 5), "8 x 2 cells for 5 blades");
    refused(made(&[0.0, f64::NAN], 1), "over an axial length of");
    let as_wide = |cells: f64, blades: usize| {
        Coating::new(&settings, &BladeTip::new(&[0.0, 1.0], &[1.0; 2], cells * TAU / 8.0), blades)
    };
    assert!(as_wide(2.999, 2).is_ok());
    refused(as_wide(3.001, 2), "the tip covers 3.001 cells, but the 2 blades share only 8");
    refused(as_wide(f64::INFINITY, 1), "the tip covers inf cells");
    refused(as_wide(f64::NAN, 1), "the tip covers NaN cells");
}

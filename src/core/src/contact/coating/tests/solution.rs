//! The solution of one step against bisection, every combination of branches, its own equations, and hard contact.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::*;
use crate::contact::active_set::ContactSolver;
use tiprub_test_models::SeededRandom;

pub fn materials() -> impl Strategy<Value = CoatingSettings> {
    let exponent = -2.0..2.0_f64;
    (exponent, 0.0..0.4_f64, prop_oneof![Just(0.0), 0.0..0.5_f64]).prop_map(|(exponent, yields, hardens)| {
        let modulus = 10.0_f64.powf(exponent);
        material(modulus, 0.01 * modulus + yields * modulus, hardens * modulus, 4, 3)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn one_node_agrees_with_bisection(
        settings in materials(),
        flexibility in 0.1..10.0_f64,
        gap in -3.0..0.5_f64,
        plastic in prop::collection::vec(prop_oneof![Just(0.0), 0.0..0.8_f64], 3),
    ) {
        let mut coating = coating(&settings, 1);
        set_wear(&mut coating, &[plastic[0], plastic[0], plastic[0], plastic[0], plastic[1], plastic[1], plastic[1],
            plastic[1], plastic[2], plastic[2], plastic[2], plastic[2]]);
        let areas: Vec<f64> = coating.rows.iter().map(|row| row.area).collect();
        let force = |gap: f64| return_mapping(&settings, &plastic, &areas, -gap);
        // g − g_p − W F(−g) grows with g.
        let (mut low, mut high) = (-5.0, 5.0);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if middle - gap - flexibility * force(middle) > 0.0 { high = middle } else { low = middle }
        }
        let expected = (0.5 * (low + high)).max(-THICKNESS);
        let hard = ((expected - gap) / flexibility - force(expected)).max(0.0);
        let hard = if expected > -THICKNESS { 0.0 } else { hard };
        let mut problem = coating.problem(1);
        coating.locate(&mut problem, &[1.0]);
        problem.delassus[(0, 0)] = flexibility;
        problem.gaps[0] = gap;
        prop_assert!(problem.solve().solved);
        prop_assert!((problem.gaps[0] - expected).abs() < 1e-12, "{} {expected}", problem.gaps[0]);
        prop_assert!((problem.coating[0] - force(expected)).abs() < 1e-10 * (1.0 + force(expected)));
        prop_assert!((problem.hard[0] - hard).abs() < 1e-10 * (1.0 + hard));
    }

    #[test]
    fn several_nodes_agree_with_exhaustive_search(
        settings in materials(),
        n in 2_usize..4,
        entries in prop::collection::vec(-1.0..1.0_f64, 9),
        gaps in prop::collection::vec(-3.0..0.5_f64, 3),
        plastic in prop::collection::vec(prop_oneof![Just(0.0), 0.0..0.8_f64], 12),
        guess in prop::collection::vec(any::<bool>(), 3),
        block in any::<bool>(),
    ) {
        let w = p_matrix(&entries, n);
        let mut coating = coating(&settings, n);
        set_wear(&mut coating, &plastic);
        let mut problem = coating.problem(1);
        coating.locate(&mut problem, &vec![middle(&settings); n]);
        problem.delassus.copy_from(&w);
        problem.gaps.copy_from_slice(&gaps[..n]);
        problem.closed.copy_from_slice(&guess[..n]);
        let expected = every_combination(&coating, &problem.contacts, &w, &gaps[..n]);
        // The path alone finds the same solution as block exchanges.
        let solved = if block { problem.solve().solved } else { problem.guess(); problem.follow_path() };
        prop_assert!(solved);
        for node in 0..n {
            let (gap, rods, hard) = expected[node];
            let scale = 1.0 + rods + hard;
            prop_assert!((problem.gaps[node] - gap).abs() < 1e-10, "gap {} {gap}", problem.gaps[node]);
            prop_assert!((problem.coating[node] - rods).abs() < 1e-9 * scale, "{} {rods}", problem.coating[node]);
            prop_assert!((problem.hard[node] - hard).abs() < 1e-9 * scale, "{} {hard}", problem.hard[node]);
            prop_assert!(problem.gaps[node] >= -THICKNESS && problem.hard[node] >= 0.0);
            prop_assert!(problem.hard[node] == 0.0 || problem.gaps[node] == -THICKNESS);
        }
        // After wear, the same prediction ends at the same place on the border between elastic and plastic.
        coating.commit(&problem);
        let forces = problem.coating.clone();
        problem.clear();
        coating.locate(&mut problem, &vec![middle(&settings); n]);
        problem.delassus.copy_from(&w);
        problem.gaps.copy_from_slice(&gaps[..n]);
        let outcome = problem.solve();
        prop_assert!(outcome.solved && outcome.factorisations < 30, "{outcome:?}");
        for node in 0..n {
            prop_assert!((problem.gaps[node] - expected[node].0).abs() < 1e-10);
            prop_assert!((problem.coating[node] - forces[node]).abs() < 1e-9 * (1.0 + forces[node]));
        }
    }

    #[test]
    fn many_cells_satisfy_the_equations_of_the_step(
        exponent in -4.0..6.0_f64,
        (yields, hardens) in (0.0..0.4_f64, prop_oneof![Just(0.0), 0.0..0.5_f64]),
        blades in 1_usize..4,
        entries in prop::collection::vec(-1.0..1.0_f64, 144),
        gaps in prop::collection::vec(-2.0..0.5_f64, 12),
        plastic in prop::collection::vec(prop_oneof![Just(0.0), 0.0..0.8_f64], 64),
    ) {
        let modulus = 10.0_f64.powf(exponent);
        let settings = material(modulus, yields * modulus, hardens * modulus, 8, 20);
        let mut coating = Coating::new(&settings, &tip(&settings, &[0.0, 0.3, 0.7, 1.0]), blades).unwrap();
        set_wear(&mut coating, &plastic);
        let w = p_matrix(&entries, 4 * blades);
        let mut problem = coating.problem(blades);
        for blade in 0..blades {
            coating.locate(&mut problem, &[real(blade), real(blade) + 0.1, real(blade), real(blade) - 0.1]);
        }
        problem.delassus.copy_from(&w);
        problem.gaps.copy_from_slice(&gaps[..4 * blades]);
        let outcome = problem.solve();
        prop_assert!(outcome.solved, "{outcome:?}");
        let force: Vec<f64> = problem.contacts.iter().map(|contact| {
            let depth = -(0..2).map(|end| contact.weights[end] * problem.gaps[contact.nodes[end]]).sum::<f64>();
            return_mapping(&settings, &[contact.plastic], &[contact.area], depth)
        }).collect();
        let mut nodal = vec![0.0; 4 * blades];
        for (contact, force) in problem.contacts.iter().zip(&force) {
            (0..2).for_each(|end| nodal[contact.nodes[end]] += contact.weights[end] * force);
        }
        let scale = 1.0 + nodal.iter().chain(&problem.hard).fold(0.0_f64, |scale, force| scale.max(*force));
        for i in 0..4 * blades {
            prop_assert!((nodal[i] - problem.coating[i]).abs() < 1e-8 * scale, "{} {}", nodal[i], problem.coating[i]);
            let moved: f64 = (0..4 * blades).map(|j| w[(i, j)] * (problem.coating[j] + problem.hard[j])).sum();
            prop_assert!((problem.gaps[i] - gaps[i] - moved).abs() < 1e-9 * scale);
            prop_assert!(problem.gaps[i] >= -THICKNESS && problem.hard[i] >= 0.0);
            prop_assert!(problem.hard[i] == 0.0 || problem.gaps[i] == -THICKNESS);
        }
        // Following the path leads to the same solution.
        let solution = problem.gaps.clone();
        problem.gaps.copy_from_slice(&gaps[..4 * blades]);
        problem.guess();
        prop_assert!(problem.follow_path());
        prop_assert!(problem.factorisations < 6 * problem.contacts.len(), "{}", problem.factorisations);
        for i in 0..4 * blades {
            prop_assert!((problem.gaps[i] - solution[i]).abs() < 1e-9 * scale);
        }
    }
}

/// A random matrix with positive definite symmetric part, hence a P-matrix.
pub fn p_matrix(entries: &[f64], n: usize) -> DMatrix<f64> {
    let a = DMatrix::from_fn(n, n, |i, j| entries[i * n + j]);
    let skew = DMatrix::from_fn(n, n, |i, j| 0.3 * (entries[i * n + j] - entries[j * n + i]));
    &a * a.transpose() + DMatrix::identity(n, n) * 0.05 + skew
}

/// (gap, rod force, hard force) of each node, from the full system in (g, F, λ) of every combination of branches.
fn every_combination(coating: &Coating, cells: &[CellContact], w: &DMatrix<f64>, gaps: &[f64]) -> Vec<(f64, f64, f64)> {
    let (n, c) = (gaps.len(), cells.len());
    let mut best = (f64::INFINITY, Vec::new());
    let mut interpolation = DMatrix::zeros(c, n);
    for (row, cell) in cells.iter().enumerate() {
        interpolation[(row, cell.nodes[0])] += cell.weights[0];
        interpolation[(row, cell.nodes[1])] += cell.weights[1];
    }
    for combination in 0..3_usize.pow(u32::try_from(c).unwrap()) * (1 << n) {
        let (closed, mut rest) = (combination % (1 << n), combination >> n);
        let branches: Vec<usize> = (0..c)
            .map(|_| {
                let branch = rest % 3;
                rest /= 3;
                branch
            })
            .collect();
        let mut system = DMatrix::zeros(2 * n + c, 2 * n + c);
        let mut right = DVector::zeros(2 * n + c);
        system.view_mut((0, 0), (n, n)).fill_with_identity();
        system.view_mut((0, n), (n, c)).copy_from(&(-w * interpolation.transpose()));
        system.view_mut((0, n + c), (n, n)).copy_from(&-w);
        right.rows_mut(0, n).copy_from_slice(gaps);
        for (row, cell) in cells.iter().enumerate() {
            let RodMaterial { modulus: e, yield_stress: y, hardening: k } = coating.rod;
            // F = area·(stress at zero strain + tangent·strain), implemented independently.
            let (stress, tangent) =
                [(0.0, 0.0), (-e * cell.plastic, e), (e * y / (e + k), e * k / (e + k))][branches[row]];
            system[(n + row, n + row)] = 1.0;
            for node in 0..n {
                system[(n + row, node)] = cell.area * tangent * interpolation[(row, node)] / THICKNESS;
            }
            right[n + row] = cell.area * stress;
        }
        for node in 0..n {
            let shut = closed >> node & 1 == 1;
            system[(n + c + node, if shut { node } else { n + c + node })] = 1.0;
            right[n + c + node] = if shut { -THICKNESS } else { 0.0 };
        }
        let Some(solution) = system.lu().solve(&right) else { continue };
        let violation = violation(coating, cells, &branches, &interpolation, solution.as_slice());
        if violation < best.0 {
            let rods = interpolation.transpose() * solution.rows(n, c);
            best = (violation, (0..n).map(|i| (solution[i], rods[i], solution[n + c + i])).collect());
        }
    }
    assert!(best.0 < 1e-11, "no combination holds: {}", best.0);
    best.1
}

/// Largest violation of the conditions of the branches by a solution.
fn violation(
    coating: &Coating,
    cells: &[CellContact],
    branches: &[usize],
    interpolation: &DMatrix<f64>,
    solution: &[f64],
) -> f64 {
    let n = interpolation.ncols();
    let strains = -interpolation * DVector::from_column_slice(&solution[..n]) / THICKNESS;
    let rods = cells.iter().zip(branches).zip(strains.iter()).map(|((cell, branch), strain)| {
        let elastic = strain - cell.plastic;
        let limit = (coating.rod.yield_stress + coating.rod.hardening * cell.plastic) / coating.rod.modulus;
        [elastic, (-elastic).max(elastic - limit), limit - elastic][*branch]
    });
    let nodes = (0..n).flat_map(|node| [-THICKNESS - solution[node], -solution[n + cells.len() + node]]);
    rods.chain(nodes).fold(0.0, f64::max)
}

/// Rods that reach the ends of their branches together, first unworn, then when wear has just stopped.
#[test]
fn path_handles_simultaneous_transitions_of_equal_rods() {
    let settings = material(50.0, 3.0, 5.0, 8, 20);
    let mut coating = Coating::new(&settings, &tip(&settings, &[0.0, 0.5, 1.0]), 1).unwrap();
    for gap in [-0.2, -0.6, -0.6, -0.6, -5.0, -5.0, -0.1] {
        let mut problem = coating.problem(1);
        coating.locate(&mut problem, &[middle(&settings); 3]);
        problem.delassus.fill_with_identity();
        problem.gaps.fill(gap);
        let mut path = problem.clone();
        path.guess();
        assert!(problem.solve().solved && path.follow_path());
        assert!(path.factorisations < 100, "{}", path.factorisations);
        for node in 0..3 {
            assert!((problem.gaps[node] - path.gaps[node]).abs() < 1e-14);
            assert!((problem.coating[node] - path.coating[node]).abs() < 1e-12);
            assert!((problem.hard[node] - path.hard[node]).abs() < 1e-12);
        }
        coating.commit(&problem);
    }
}

#[test]
fn stiff_and_soft_limits_are_hard_contact_and_no_contact() {
    let w = DMatrix::from_row_slice(3, 3, &[1.0, 0.3, -0.2, 0.25, 1.5, 0.4, -0.1, 0.3, 0.8]);
    let gaps = DVector::from_column_slice(&[-0.3, 0.1, -0.25]);
    let solve = |modulus: f64, extent: [f64; 2]| {
        let settings = material(modulus, modulus, 0.0, 4, 3);
        let coating = Coating::new(&settings, &tip(&settings, &[0.0, 1.0, 2.0]).with_extent(extent), 1).unwrap();
        let mut problem = coating.problem(1);
        coating.locate(&mut problem, &[middle(&settings); 3]);
        problem.delassus.copy_from(&w);
        problem.gaps.copy_from_slice(gaps.as_slice());
        assert!(problem.solve().solved);
        problem
    };
    // Rows at the nodes: the hard contact of each node. Rows beside the nodes: the hard contact of the interpolated gaps.
    for extent in [[-0.5, 2.5], [-0.2, 2.2]] {
        let rows = solve(1.0, extent).contacts;
        let mut n = DMatrix::zeros(3, 3);
        for (row, contact) in rows.iter().enumerate() {
            (0..2).for_each(|end| n[(row, contact.nodes[end])] += contact.weights[end]);
        }
        assert_eq!(n == DMatrix::identity(3, 3), extent[0] < -0.3);
        let mut hard = ContactSolver::new(3);
        hard.delassus.copy_from(&(&n * &w * n.transpose()));
        hard.gaps.copy_from_slice((&n * &gaps).as_slice());
        assert!(hard.lcp().solved);
        let expected = n.transpose() * DVector::from_column_slice(&hard.multipliers);
        // The deviation falls with 1/E until the rounding of stiffness times penetration takes over.
        for (modulus, tolerance) in [(1e4, 1e-3), (1e7, 1e-6), (1e10, 1e-6)] {
            let stiff = solve(modulus, extent);
            for node in 0..3 {
                let off = (stiff.coating[node] - expected[node]).abs();
                assert!(off < tolerance, "E = {modulus:e}, node {node}: off by {off:e}");
                assert!(stiff.hard[node].abs() < f64::MIN_POSITIVE);
            }
        }
        assert!(expected.amax() > 0.1);
    }
    let soft = solve(1e-12, [-0.2, 2.2]);
    for node in 0..3 {
        assert!(soft.coating[node] < 1e-11 && soft.hard[node] == 0.0);
        assert!((soft.gaps[node] - gaps[node]).abs() < 1e-11);
    }
}

#[test]
fn redundant_nodes_share_the_hard_contact() {
    let coating = coating(&material(2.0, 0.1, 0.1, 4, 3), 2);
    let mut problem = coating.problem(1);
    coating.locate(&mut problem, &[0.1; 2]);
    problem.delassus.fill(0.5); // both nodes always move together
    problem.gaps.fill(-5.0);
    assert!(problem.solve().solved);
    let total: f64 = problem.coating.iter().chain(&problem.hard).sum();
    assert!((total - (5.0 - THICKNESS) / 0.5).abs() < 1e-8, "{total}");
}

/// Lengths across the coating multiplied by a power of two: the same path, to the last bit.
#[test]
fn path_is_independent_of_the_unit_of_length() {
    let mut random = SeededRandom(12);
    for _ in 0..100 {
        let plastic: Vec<f64> = (0..9).map(|_| 0.2 * random.unit()).collect();
        let (w, gaps) = (p_matrix(random.matrix(6, 6).as_slice(), 6), random.matrix(6, 1) * 1.5);
        let found = [1.0, 2.0_f64.powi(-13), 2.0_f64.powi(20)].map(|unit| {
            let settings = CoatingSettings { thickness: unit * THICKNESS, ..material(5.0, 0.4, 0.6, 8, 9) };
            let mut coating = Coating::new(&settings, &tip(&settings, &[0.0, 0.5, 1.0]), 2).unwrap();
            set_wear(&mut coating, &plastic);
            let mut problem = coating.problem(2);
            (0..2).for_each(|blade| coating.locate(&mut problem, &[3.0 * real(blade); 3]));
            problem.delassus.copy_from(&(&w * unit));
            problem.gaps.copy_from_slice((&gaps * unit).as_slice());
            problem.guess();
            assert!(problem.follow_path());
            let bits =
                |values: &[f64], unit: f64| values.iter().map(|value| (value / unit).to_bits()).collect::<Vec<_>>();
            (problem.factorisations, bits(&problem.gaps, unit), bits(&problem.coating, 1.0), bits(&problem.hard, 1.0))
        });
        assert!(found[1] == found[0] && found[2] == found[0], "{found:?}");
    }
}

/// Equal nodes in a ring with equal loads, which push one neighbour out and draw the other in: many rods end together, again and again.
#[test]
fn path_does_not_cycle_when_rods_move_identically() {
    for (n, modulus, yields, pushes, draws) in [(3, 8.0, 0.25, 1.25, -0.75), (4, 64.0, 0.5, 1.75, -2.25)] {
        for (worn, depth) in [0.0, 0.25, 0.5].into_iter().flat_map(|worn| [0.25, 0.5, 1.0, 4.0, 8.0].map(|d| (worn, d)))
        {
            let axial: Vec<f64> = (0..n).map(real).collect();
            let settings = material(modulus, yields * modulus, 0.0, 8, 3);
            let tip = tip(&settings, &axial).with_extent([-0.5, real(n) - 0.5]);
            let mut coating = Coating::new(&settings, &tip, 1).unwrap();
            set_wear(&mut coating, &[worn]);
            let mut problem = coating.problem(1);
            coating.locate(&mut problem, &vec![middle(&settings); n]);
            problem.delassus.copy_from(&DMatrix::from_fn(n, n, |i, j| match (j + n - i) % n {
                0 => 1.0,
                1 => pushes,
                away if away + 1 == n => draws,
                _ => 0.0,
            }));
            problem.gaps.fill(-depth);
            problem.guess();
            assert!(problem.follow_path(), "{n} nodes, worn {worn}, {depth} deep: {}", problem.factorisations);
        }
    }
}

/// Rods that load and unload again: more exchanges than rods have branches.
#[test]
fn path_is_followed_through_repeated_unloading() {
    let mut random = SeededRandom(77);
    let mut most = 0.0_f64;
    for _ in 0..4 {
        let modulus = random.scale(1e-4, 1e2);
        let settings = material(modulus, random.unit() * 0.4 * modulus, random.unit() * 0.3 * modulus, 8, 1500);
        let mut coating = Coating::new(&settings, &tip(&settings, &[0.0, 0.3, 0.7, 1.0]), 1).unwrap();
        let worn: Vec<f64> = (0..64).map(|_| if random.unit() < 0.5 { 0.0 } else { 0.8 * random.unit() }).collect();
        set_wear(&mut coating, &worn);
        let (a, skew) = (random.matrix(4, 4), random.matrix(4, 4) * random.scale(0.1, 10.0));
        let w = &a * a.transpose() + DMatrix::identity(4, 4) * random.scale(1e-2, 1.0) + (&skew - skew.transpose());
        let mut problem = coating.problem(1);
        coating.locate(&mut problem, &[middle(&settings); 4]);
        problem.delassus.copy_from(&w);
        problem.gaps.copy_from_slice((random.matrix(4, 1) * 2.0).as_slice());
        problem.guess();
        assert!(problem.follow_path(), "{}", problem.factorisations);
        most = most.max(real(problem.factorisations) / real(4 + 2 * problem.contacts.len()));
    }
    assert!(most > 1.2, "{most}");
}

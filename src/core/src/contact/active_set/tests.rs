//! Pivoting against brute force, and its limits.

use super::*;
use proptest::prelude::*;

mod semidefinite;

/// Finds the solution by trying every active set, independently of pivoting rules.
fn brute_force(w: &DMatrix<f64>, g: &[f64]) -> Vec<f64> {
    let n = g.len();
    for set in 0..1_usize << n {
        let members: Vec<usize> = (0..n).filter(|i| set >> i & 1 == 1).collect();
        let sub = DMatrix::from_fn(members.len(), members.len(), |i, j| w[(members[i], members[j])]);
        let right = nalgebra::DVector::from_fn(members.len(), |i, _| -g[members[i]]);
        let solution = if members.is_empty() { Some(right) } else { sub.lu().solve(&right) };
        let Some(solution) = solution else { continue };
        let mut lambda = vec![0.0; n];
        for (index, member) in members.iter().enumerate() {
            lambda[*member] = solution[index];
        }
        let feasible = (0..n).all(|i| {
            let gap = g[i] + (0..n).map(|j| w[(i, j)] * lambda[j]).sum::<f64>();
            lambda[i] >= -1e-12 && (gap >= -1e-12)
        });
        if feasible {
            return lambda;
        }
    }
    panic!("no solution: not a P-matrix");
}

/// A random matrix with positive definite symmetric part, hence a P-matrix.
fn p_matrix(entries: &[f64], n: usize) -> DMatrix<f64> {
    let a = DMatrix::from_fn(n, n, |i, j| entries[i * n + j]);
    let skew = DMatrix::from_fn(n, n, |i, j| 0.3 * (entries[i * n + j] - entries[j * n + i]));
    &a * a.transpose() + DMatrix::identity(n, n) * 0.05 + skew
}

/// A problem with the matrix of the last one has the bits of a new problem, and needs no factorisation if the same contacts are active.
#[test]
fn kept_factor_gives_the_same_bits() {
    let mut random = tiprub_test_models::SeededRandom(5);
    let mut saved = 0;
    for case in 0..400 {
        let n = 1 + random.below(if case % 4 == 0 { 50 } else { 12 });
        let entries: Vec<f64> =
            (0..n * n).map(|_| random.signed() / f64::from(u32::try_from(n).unwrap()).sqrt()).collect();
        let w = p_matrix(&entries, n);
        let mut kept = ContactSolver::new(n);
        kept.delassus.copy_from(&w);
        let gaps: Vec<f64> = (0..n).map(|_| random.signed()).collect();
        kept.gaps.copy_from_slice(&gaps);
        assert!(kept.lcp().solved);
        for _ in 0..3 {
            let mut new = ContactSolver::new(n);
            new.delassus.copy_from(&w);
            let guess = kept.active.clone();
            let change = random.of(&[1e-6, 0.3]);
            new.gaps.iter_mut().zip(&gaps).for_each(|(new, gap)| *new = gap + change * random.signed());
            assert!(kept.begin_with_same_matrix());
            kept.gaps.copy_from_slice(&new.gaps);
            new.active.copy_from_slice(&guess);
            let [of_kept, of_new] = [kept.lcp(), new.lcp()];
            assert_eq!(
                (of_kept.solved, kept.multipliers.clone(), kept.gaps.clone()),
                (true, new.multipliers, new.gaps)
            );
            assert!(of_kept.factorisations <= of_new.factorisations);
            saved += of_new.factorisations - of_kept.factorisations;
        }
    }
    assert!(saved > 300, "{saved}");
}

/// Redundant contacts have no factor, and softened contacts change the matrix: it must be filled in again.
#[test]
fn changed_matrix_is_not_kept() {
    let mut solver = ContactSolver::new(2);
    solver.delassus.copy_from(&DMatrix::from_element(2, 2, 1.0));
    solver.gaps.copy_from_slice(&[-1.0, -1.0]);
    assert!(!solver.begin_with_same_matrix());
    assert!(solver.lcp().solved);
    assert!(!solver.begin_with_same_matrix());
    solver.delassus.copy_from(&DMatrix::identity(2, 2));
    solver.set_size(2);
    solver.gaps.copy_from_slice(&[-1.0, -1.0]);
    assert!(solver.lcp().solved && solver.begin_with_same_matrix());
    solver.set_size(2);
    assert!(!solver.begin_with_same_matrix());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    #[test]
    fn complementarity_solution_equals_brute_force(
        n in 1_usize..7,
        entries in prop::collection::vec(-1.0..1.0_f64, 49),
        gaps in prop::collection::vec(-1.0..1.0_f64, 7),
        warm in prop::collection::vec(any::<bool>(), 7),
    ) {
        let w = p_matrix(&entries, n);
        let mut solver = ContactSolver::new(n);
        solver.delassus.copy_from(&w);
        solver.gaps.copy_from_slice(&gaps[..n]);
        solver.active.copy_from_slice(&warm[..n]);
        let outcome = solver.lcp();
        prop_assert!(outcome.solved);
        let expected = brute_force(&w, &gaps[..n]);
        let scale = expected.iter().fold(1.0_f64, |a, b| a.max(b.abs()));
        for (found, expected) in solver.multipliers.iter().zip(&expected) {
            prop_assert!((found - expected).abs() < 1e-9 * scale, "{found} vs {expected}");
        }
    }
}

#[test]
fn coincident_nodes_share_one_constraint() {
    let mut solver = ContactSolver::new(3);
    solver.delassus.copy_from_slice(&[2.0, 2.0, 0.1, 2.0, 2.0, 0.1, 0.1, 0.1, 1.0]);
    solver.gaps.copy_from_slice(&[-1.0, -1.0, 0.5]);
    let outcome = solver.lcp();
    assert!(outcome.solved);
    assert!((solver.multipliers[0] + solver.multipliers[1] - 0.5).abs() < 1e-12);
    assert!(solver.gaps.iter().all(|gap| *gap >= 0.0));
}

#[test]
fn deepest_of_coincident_nodes_determines_the_force() {
    for (first, second) in [(-1.0, -2.0), (-2.0, -1.0), (-1.0, -1.0 - 1e-6)] {
        for warm in [[false; 2], [true; 2], [true, false], [false, true]] {
            let mut solver = ContactSolver::new(2);
            solver.delassus.fill(2.0);
            solver.gaps.copy_from_slice(&[first, second]);
            solver.active.copy_from_slice(&warm);
            assert!(solver.lcp().solved);
            let force = solver.multipliers[0] + solver.multipliers[1];
            let (deepest, shallow) = (first.min(second), first.max(second));
            assert!((force + 0.5 * deepest).abs() < 1e-9, "{first}, {second}: force {force}");
            let open = solver.gaps[0].max(solver.gaps[1]);
            assert!((open - (shallow - deepest)).abs() < 1e-9, "{first}, {second}: gaps {:?}", solver.gaps);
        }
    }
}

#[test]
fn stiff_nodes_beside_soft_ones_are_not_redundant() {
    let mut solver = ContactSolver::new(2);
    solver.delassus.copy_from_slice(&[1.0, 0.0, 0.0, 1e-14]);
    solver.gaps.copy_from_slice(&[-1.0, -1.0]);
    assert!(solver.lcp().solved);
    assert!((solver.multipliers[1] * 1e-14 - 1.0).abs() < 1e-12, "{:?}", solver.multipliers);
}

#[test]
fn film_ignores_penetration_caused_by_other_contacts() {
    // Pushing node 1 out pulls node 2 in, which complementarity detects and FILM does not.
    let mut solver = ContactSolver::new(2);
    solver.delassus.copy_from_slice(&[1.0, -0.9, -0.9, 1.0]);
    solver.gaps.copy_from_slice(&[-1.0, 0.1]);
    let mut exact = solver.clone();
    solver.film();
    assert!(solver.gaps[1] < -0.7 && solver.gaps[0].abs() < 1e-15);
    exact.lcp();
    assert!(exact.gaps.iter().all(|gap| *gap >= 0.0) && exact.multipliers.iter().all(|value| *value > 0.0));
}

/// Random P-matrices of the size of whole casings, some of them far from symmetric.
#[test]
fn large_problems_fulfil_complementarity() {
    let mut seed = 1_u64;
    let mut uniform = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / 9_007_199_254_740_992.0 * 2.0 - 1.0
    };
    for (size, skew) in [(48, 0.0), (48, 0.5), (48, 5.0), (168, 0.0), (168, 0.5), (168, 5.0)] {
        for modes in [size / 2, size, 2 * size] {
            let shapes = DMatrix::from_fn(size, modes, |_, _| uniform());
            let mut w = &shapes * shapes.transpose() + DMatrix::identity(size, size) * 1e-3;
            for (row, column) in (0..size).flat_map(|row| (0..row).map(move |column| (row, column))) {
                let value = skew * uniform();
                w[(row, column)] += value;
                w[(column, row)] -= value;
            }
            let g: Vec<f64> = (0..size).map(|_| uniform() - 0.3).collect();
            let mut solver = ContactSolver::new(size);
            solver.delassus.copy_from(&w);
            solver.gaps.copy_from_slice(&g);
            let outcome = solver.lcp();
            assert!(outcome.solved && outcome.factorisations <= 400, "{size} {skew} {modes}: {outcome:?}");
            for row in 0..size {
                let terms = || (0..size).map(|column| w[(row, column)] * solver.multipliers[column]);
                let gap = g[row] + terms().sum::<f64>();
                let scale = g[row].abs() + terms().map(f64::abs).sum::<f64>();
                let (multiplier, limit) = (solver.multipliers[row], 1e-10 * scale);
                assert!(multiplier >= 0.0 && gap >= -limit, "{size} {skew} {modes}: {multiplier}, {gap}");
                assert!(gap <= limit || multiplier == 0.0, "{size} {skew} {modes}: {multiplier}, {gap}");
            }
        }
    }
}

#[test]
fn unused_solver_capacity_does_not_change_the_result() {
    let entries: Vec<f64> = (0..49).map(|k| libm::sin(1.3 * f64::from(k * k))).collect();
    let w = p_matrix(&entries, 7);
    let g: Vec<f64> = (0..7).map(|k| libm::sin(f64::from(3 * k)) - 0.4).collect();
    let mut exact = ContactSolver::new(7);
    let mut roomy = ContactSolver::new(20);
    roomy.delassus.fill(f64::NAN);
    roomy.gaps.fill(f64::NAN);
    roomy.active.fill(true);
    roomy.multipliers.fill(1.0);
    roomy.set_size(7);
    roomy.active[..7].fill(false);
    for film in [false, true] {
        for solver in [&mut exact, &mut roomy] {
            solver.delassus.view_mut((0, 0), (7, 7)).copy_from(&w);
            solver.gaps[..7].copy_from_slice(&g);
        }
        let outcomes = [&mut exact, &mut roomy].map(|solver| if film { solver.film() } else { solver.lcp() });
        assert_eq!(outcomes[0], outcomes[1]);
        for node in 0..7 {
            assert_eq!(exact.multipliers[node].to_bits(), roomy.multipliers[node].to_bits());
            assert_eq!(exact.gaps[node].to_bits(), roomy.gaps[node].to_bits());
        }
        assert!(roomy.multipliers[7..].iter().all(|value| *value == 0.0));
    }
}

#[test]
fn effort_is_bounded_for_every_size() {
    assert_eq!(exchange_limit(14, false), 100 + 280 + 16_384);
    assert_eq!(exchange_limit(14, true), 100 + 280);
    assert!(exchange_limit(15, false) == BLOCK_LIMIT && exchange_limit(2000, true) == BLOCK_LIMIT);
    assert_eq!([14, 168, 256, 2000].map(drive_limit), [380, 3460, 5220, 656]);
}

#[test]
fn single_contact_pivoting_finds_the_same_solution() {
    for case in 0..200 {
        let n = 1 + case % 7;
        let entries: Vec<f64> = (0..49).map(|k| libm::sin(1.3 * f64::from(k * k) + case as f64)).collect();
        let gaps: Vec<f64> = (0..n).map(|k| libm::sin((3 * k + 2 * case) as f64)).collect();
        let mut block = ContactSolver::new(n);
        block.delassus.copy_from(&p_matrix(&entries, n));
        block.gaps.copy_from_slice(&gaps);
        let mut driven = block.clone();
        for node in 0..n {
            driven.active[node] = (case >> node) % 2 == 1;
        }
        assert!(block.lcp().solved && driven.drive_all(1.0, 1000).solved);
        let largest = block.multipliers.iter().fold(0.0_f64, |most, value| most.max(*value));
        for node in 0..n {
            assert!((block.multipliers[node] - driven.multipliers[node]).abs() <= 1e-11 * largest);
            assert!((block.gaps[node] - driven.gaps[node]).abs() <= 1e-11);
        }
    }
}

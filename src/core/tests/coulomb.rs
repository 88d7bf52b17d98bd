//! The Coulomb solver against Siconos, against the friction law, and against the frictionless solver.

#[path = "common/counting.rs"]
mod counting;

use nalgebra::DMatrix;
use tiprub_core::contact::active_set::ContactSolver;
use tiprub_core::contact::de_saxce::CoulombSolver;

const BLADE_MODES: usize = 29;
const CASING_MODES: usize = 24;

/// The random generator of tests/data/coulomb_siconos.py.
struct Lcg(u64);

impl Lcg {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / 9_007_199_254_740_992.0 * 2.0 - 1.0
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + 0.5 * (self.uniform() + 1.0) * (high - low)
    }

    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % limit
    }
}

/// Adds shapes · diag(flexibility) · shapesᵀ to the block that starts at `start`.
fn add_modes(w: &mut DMatrix<f64>, start: usize, shapes: &[Vec<f64>], flexibility: impl Fn(usize) -> f64) {
    for (i, a) in shapes.iter().enumerate() {
        for (j, b) in shapes.iter().enumerate() {
            let sum: f64 = a.iter().zip(b).enumerate().map(|(k, (a, b))| a * flexibility(k) * b).sum();
            w[(start + i, start + j)] += sum;
        }
    }
}

fn shapes(lcg: &mut Lcg, rows: usize, modes: usize) -> Vec<Vec<f64>> {
    (0..rows).map(|_| (0..modes).map(|_| lcg.uniform()).collect()).collect()
}

/// Returns blades of three contact nodes, each with separate modes, that rub a casing whose modes are common to all of
/// them.
fn blades_in_casing(contacts: usize, seed: u64) -> (DMatrix<f64>, Vec<f64>) {
    let mut lcg = Lcg(seed);
    let order = 3 * contacts;
    let mut w = DMatrix::zeros(order, order);
    for start in (0..order).step_by(9) {
        let blade = shapes(&mut lcg, 9, BLADE_MODES);
        add_modes(&mut w, start, &blade, |k| 2e-9 / ((k + 1) * (k + 1)) as f64);
    }
    let casing = shapes(&mut lcg, order, CASING_MODES);
    add_modes(&mut w, 0, &casing, |k| 4e-10 / (k + 1) as f64);
    let mut free = Vec::new();
    for _ in 0..contacts {
        free.push(1e-6 * lcg.uniform() - 7e-7);
        free.push(6e-7 * lcg.uniform() - 2e-7);
        free.push(3e-7 * lcg.uniform());
    }
    (w, free)
}

fn solver(w: &DMatrix<f64>, free: &[f64], friction: &[f64]) -> CoulombSolver {
    let mut solver = CoulombSolver::new(friction.len());
    solver.delassus.copy_from(w);
    solver.free.copy_from_slice(free);
    solver.friction.copy_from_slice(friction);
    solver
}

/// Returns the violation of Signorini's and Coulomb's laws, evaluated directly: the largest one relative to the terms
/// of displacements (by rows of W) and forces.
fn violation(w: &DMatrix<f64>, free: &[f64], friction: &[f64], r: &[f64]) -> f64 {
    let order = free.len();
    let terms = |row: usize| (0..order).map(move |j| w[(row, j)] * r[j]);
    let u: Vec<f64> = (0..order).map(|row| free[row] + terms(row).sum::<f64>()).collect();
    let size: Vec<f64> = (0..order).map(|row| free[row].abs() + terms(row).map(f64::abs).sum::<f64>()).collect();
    let mut worst = 0.0_f64;
    let mut note = |value: f64| worst = if value.is_nan() { f64::INFINITY } else { worst.max(value) };
    for (contact, mu) in friction.iter().enumerate() {
        let k = 3 * contact;
        let (r_t, u_t) = (r[k + 1].hypot(r[k + 2]), u[k + 1].hypot(u[k + 2]));
        if r[k] < 0.0 || r_t > mu * r[k] * (1.0 + 1e-14) {
            return f64::INFINITY;
        }
        note(-u[k] / size[k]);
        note((w[(k, k)] * r[k]).min(u[k]) / size[k]);
        // Either sticking, or the force is on the cone and opposes the slip.
        let slip = u_t / size[k + 1].max(size[k + 2]);
        let limit = mu * r[k];
        if limit > 0.0 && slip > 1e-12 {
            let off = (r[k + 1] + limit * u[k + 1] / u_t).hypot(r[k + 2] + limit * u[k + 2] / u_t);
            note((off / limit).min(1.0) * slip);
        }
    }
    worst
}

fn random_modes(lcg: &mut Lcg, contacts: usize, modes: usize) -> DMatrix<f64> {
    let mut w = DMatrix::zeros(3 * contacts, 3 * contacts);
    let modes = shapes(lcg, 3 * contacts, modes);
    add_modes(&mut w, 0, &modes, |_| 1.0);
    w
}

/// Returns random problems of many kinds; moving the bodies apart solves each of them.
fn random_problem(lcg: &mut Lcg, contacts: usize, kind: usize) -> (DMatrix<f64>, Vec<f64>) {
    let order = 3 * contacts;
    let mut w = match kind {
        0 => random_modes(lcg, contacts, 2 * order),
        1 => blades_in_casing(contacts, lcg.0).0 * 1e9,
        2 => random_modes(lcg, contacts, order / 2 + 1) + DMatrix::identity(order, order) * 1e-8,
        3 => random_modes(lcg, contacts, 24) * 0.1 + DMatrix::identity(order, order) * 1e-3,
        _ => random_modes(lcg, contacts, order + 3),
    };
    let mut free: Vec<f64> = (0..order).map(|k| if k % 3 == 0 { lcg.uniform() - 0.3 } else { lcg.uniform() }).collect();
    match kind {
        // Contacts of very different stiffness.
        4 | 5 => {
            let units: Vec<f64> = (0..contacts).map(|_| 10.0_f64.powf(lcg.between(-4.0, 0.0))).collect();
            for i in 0..order {
                free[i] *= units[i / 3];
                for j in 0..order {
                    w[(i, j)] *= units[i / 3] * units[j / 3];
                }
            }
        }
        // Coincident nodes: several contacts of one material point, with different gaps.
        6 => {
            for contact in 1..contacts {
                let twin = lcg.below(contact);
                if lcg.uniform() > 0.2 {
                    continue;
                }
                for i in 0..3 {
                    let row = w.row(3 * twin + i).into_owned();
                    w.set_row(3 * contact + i, &row);
                }
                for i in 0..3 {
                    let column = w.column(3 * twin + i).into_owned();
                    w.set_column(3 * contact + i, &column);
                    if lcg.uniform() > 0.0 {
                        free[3 * contact + i] = free[3 * twin + i];
                    }
                }
            }
        }
        // Coriolis terms.
        7 => {
            for i in 0..order {
                for j in 0..i {
                    let skew = 0.1 * lcg.uniform() * (w[(i, i)] * w[(j, j)]).sqrt();
                    w[(i, j)] += skew;
                    w[(j, i)] -= skew;
                }
            }
        }
        _ => {}
    }
    let flexibility = 10.0_f64.powf(lcg.between(-10.0, -6.0));
    let length = 10.0_f64.powf(lcg.between(-8.0, -3.0));
    (w * flexibility, free.iter().map(|value| value * length).collect())
}

#[test]
fn solves_all_random_problems() {
    let (mut lcg, mut reported) = (Lcg(20), 0.0_f64);
    for case in 0..1000 {
        let (kind, contacts) = (case % 8, 1 + lcg.below(30));
        let contacts = if kind == 1 { contacts.next_multiple_of(3) } else { contacts };
        let (w, free) = random_problem(&mut lcg, contacts, kind);
        let common = lcg.between(0.0, 1.5);
        let friction: Vec<f64> = match case / 8 % 4 {
            0 => (0..contacts).map(|_| lcg.between(0.0, 1.5)).collect(),
            1 => vec![0.1 * common; contacts],
            _ => vec![common; contacts],
        };
        let mut solver = solver(&w, &free, &friction);
        if case % 3 == 0 {
            solver.reactions.iter_mut().for_each(|value| *value = 500.0 * lcg.uniform());
        }
        let outcome = solver.solve(contacts);
        let worst = violation(&w, &free, &friction, &solver.reactions);
        let what = format!("case {case}, kind {kind}, {contacts} contacts, friction {common}");
        assert!(outcome.solved && outcome.residual <= 1e-12, "{what}: {outcome:?}");
        assert!(worst <= 2e-12, "{what}: violation {worst:e}");
        reported = reported.max(outcome.residual);
        let sum = |row: usize| free[row] + (0..3 * contacts).map(|j| w[(row, j)] * solver.reactions[j]).sum::<f64>();
        for row in 0..3 * contacts {
            let terms: f64 = (0..3 * contacts).map(|j| (w[(row, j)] * solver.reactions[j]).abs()).sum();
            assert!((solver.relative[row] - sum(row)).abs() <= 1e-13 * (terms + free[row].abs()), "{what}");
        }
    }
    assert!(reported > 1e-17, "residuals of 1000 problems are not all exactly zero: {reported:e}");
}

/// One row of the reference file.
struct Reference {
    contacts: usize,
    friction: f64,
    reactions: Vec<f64>,
}

fn references() -> Vec<Reference> {
    let rows = include_str!("data/coulomb_siconos.csv").lines().filter(|line| !line.starts_with('#'));
    rows.map(|line| {
        let fields: Vec<&str> = line.split(',').collect();
        Reference {
            contacts: fields[0].parse().unwrap(),
            friction: fields[1].parse().unwrap(),
            reactions: fields[4..].iter().map(|value| value.parse().unwrap()).collect(),
        }
    })
    .collect()
}

#[test]
fn agrees_with_siconos() {
    let references = references();
    assert_eq!(references.len(), 12);
    for Reference { contacts, friction, reactions } in references {
        let (w, free) = blades_in_casing(contacts, 1019 + contacts as u64);
        let mut solver = solver(&w, &free, &vec![friction; contacts]);
        let outcome = solver.solve(contacts);
        let largest = reactions.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let pairs = solver.reactions.iter().zip(&reactions);
        let off = pairs.fold(0.0_f64, |most, (ours, theirs)| most.max((ours - theirs).abs())) / largest;
        assert!(outcome.solved && off <= 1e-10, "{contacts} contacts, friction {friction}: {off:e}, {outcome:?}");
        // Fails if the solver becomes slower.
        assert!(outcome.sweeps <= 12 && outcome.factorisations <= 14, "{contacts}, {friction}: {outcome:?}");
    }
}

#[test]
fn next_step_starts_from_the_last() {
    for contacts in [12, 48, 168] {
        let (w, free) = blades_in_casing(contacts, 1019 + contacts as u64);
        let friction = vec![0.5; contacts];
        let mut solver = solver(&w, &free, &friction);
        assert!(solver.solve(contacts).solved);
        let again = solver.solve(contacts);
        assert!(again.solved && again.sweeps == 0 && again.factorisations == 0, "{again:?}");
        let mut lcg = Lcg(3);
        solver.free.iter_mut().for_each(|value| *value *= 1.0 + 1e-3 * lcg.uniform());
        let moved = solver.free.clone();
        let outcome = solver.solve(contacts);
        assert!(outcome.solved && outcome.factorisations <= 4, "{outcome:?}");
        assert!(violation(&w, &moved, &friction, &solver.reactions) <= 2e-12);
    }
}

#[test]
fn zero_friction_gives_the_linear_complementarity_problem() {
    for (contacts, seed) in [(3, 1), (12, 2), (48, 3), (168, 4)] {
        let (w, free) = blades_in_casing(contacts, seed);
        let mut coulomb = solver(&w, &free, &vec![0.0; contacts]);
        assert!(coulomb.solve(contacts).solved);
        let mut lcp = ContactSolver::new(contacts);
        lcp.delassus.copy_from(&DMatrix::from_fn(contacts, contacts, |i, j| w[(3 * i, 3 * j)]));
        lcp.gaps.copy_from_slice(&free.iter().copied().step_by(3).collect::<Vec<_>>());
        assert!(lcp.lcp().solved);
        let largest = lcp.multipliers.iter().fold(0.0_f64, |most, value| most.max(*value));
        for (contact, multiplier) in lcp.multipliers.iter().enumerate() {
            let reaction = &coulomb.reactions[3 * contact..3 * contact + 3];
            assert!((reaction[0] - multiplier).abs() <= 1e-11 * largest, "{contacts}: {reaction:?} vs {multiplier}");
            assert!(reaction[1] == 0.0 && reaction[2] == 0.0);
        }
    }
}

#[test]
fn coincident_nodes_carry_the_load_of_a_single_node() {
    let (block, displacement) = blades_in_casing(3, 1022);
    let single = |friction: f64| {
        let mut one = solver(&block.view((0, 0), (3, 3)).into_owned(), &displacement[..3], &[friction]);
        assert!(one.solve(1).solved);
        one.reactions
    };
    for friction in [0.0, 0.1, 0.5, 2.0] {
        let w = DMatrix::from_fn(21, 21, |i, j| block[(i % 3, j % 3)]);
        let free: Vec<f64> = (0..21).map(|k| displacement[k % 3]).collect();
        let mut seven = solver(&w, &free, &[friction; 7]);
        let outcome = seven.solve(7);
        assert!(outcome.solved, "{outcome:?}");
        for (k, expected) in single(friction).iter().enumerate() {
            let sum: f64 = (0..7).map(|contact| seven.reactions[3 * contact + k]).sum();
            assert!((sum - expected).abs() <= 1e-9 * single(friction)[0], "friction {friction}: {sum} vs {expected}");
        }
    }
}

#[test]
fn unsolvable_problems_end_finite_and_unsolved() {
    // A wall against a wall: no flexibility, and a penetration.
    let mut rigid = solver(&DMatrix::zeros(6, 6), &[-1e-6, 0.0, 0.0, 1e-6, 0.0, 0.0], &[0.5; 2]);
    let outcome = rigid.solve(2);
    assert!(!outcome.solved && rigid.reactions.iter().all(|value| value.is_finite()), "{outcome:?}");
    // A node pinched between two walls closer than it is thick: opening one contact closes the other.
    let pinched = DMatrix::from_fn(6, 6, |i, j| match (i, j) {
        (0, 3) | (3, 0) => -1e-9,
        _ if i % 3 == j % 3 => 1e-9,
        _ => 0.0,
    });
    let mut pinched = solver(&pinched, &[-1e-6, 0.0, 0.0, -1e-6, 0.0, 0.0], &[0.5; 2]);
    let outcome = pinched.solve(2);
    assert!(!outcome.solved && pinched.reactions.iter().all(|value| value.is_finite()), "{outcome:?}");
    let (w, free) = blades_in_casing(3, 1);
    for poison in [f64::NAN, f64::INFINITY] {
        let mut broken = solver(&w, &free, &[0.5; 3]);
        broken.free[4] = poison;
        let outcome = broken.solve(3);
        assert!(!outcome.solved && outcome.residual.is_infinite(), "{outcome:?}");
        assert!(broken.reactions.iter().all(|value| *value == 0.0));
        let mut broken = solver(&w, &free, &[0.5, poison, 0.5]);
        assert!(!broken.solve(3).solved);
        // A meaningless warm start is harmless.
        let mut warm = solver(&w, &free, &[0.5; 3]);
        warm.reactions[1] = poison;
        assert!(warm.solve(3).solved);
    }
}

#[test]
fn solver_uses_only_the_leading_block() {
    let (w, free) = blades_in_casing(12, 5);
    let mut exact = solver(&w, &free, &[0.4; 12]);
    let mut roomy = CoulombSolver::new(30);
    roomy.delassus.fill(f64::NAN);
    roomy.delassus.view_mut((0, 0), (36, 36)).copy_from(&w);
    roomy.free.fill(f64::NAN);
    roomy.free[..36].copy_from_slice(&free);
    roomy.friction[..12].fill(0.4);
    assert_eq!(exact.solve(12), roomy.solve(12));
    for k in 0..36 {
        assert_eq!(exact.reactions[k].to_bits(), roomy.reactions[k].to_bits());
        assert_eq!(exact.relative[k].to_bits(), roomy.relative[k].to_bits());
    }
}

#[test]
fn solution_is_independent_of_units() {
    // Lengths and forces scaled by powers of two: W 2^-16 to 2^10 times, hence 1e-14 to 1e-6 m/N.
    let (w, free) = blades_in_casing(12, 6);
    let mut plain = solver(&w, &free, &[0.7; 12]);
    let outcome = plain.solve(12);
    assert!(outcome.solved);
    for (length, force) in [(-12, 4), (8, -2), (0, 16), (-20, -20)] {
        let (length, force) = (2.0_f64.powi(length), 2.0_f64.powi(force));
        let free: Vec<f64> = free.iter().map(|value| value * length).collect();
        let mut scaled = solver(&(&w * (length / force)), &free, &[0.7; 12]);
        assert!(scaled.solve(12).solved);
        for (a, b) in plain.reactions.iter().zip(&scaled.reactions) {
            assert!((a * force - b).abs() <= 1e-11 * force * plain.reactions[0].abs().max(1e3), "{a} {b}");
        }
    }
}

#[test]
fn solving_does_not_allocate() {
    let (w, free) = blades_in_casing(48, 7);
    let mut coulomb = solver(&w, &free, &[0.9; 48]);
    let (hard, hard_free) = random_problem(&mut Lcg(11), 20, 2);
    let mut hard = solver(&hard, &hard_free, &[1.4; 20]);
    let mut lcp = ContactSolver::new(60);
    let mut outcomes = None;
    let allocations = counting::allocations_of(|| {
        let (first, second) = (coulomb.solve(48), hard.solve(20));
        lcp.set_size(40);
        for i in 0..40 {
            lcp.delassus[(i, i)] = 1.0;
            lcp.gaps[i] = free[3 * i];
        }
        outcomes = Some((first, second, lcp.lcp()));
    });
    let (first, second, third) = outcomes.unwrap();
    assert!(first.solved && first.fallback && second.fallback && third.solved);
    assert_eq!(allocations, 0);
}

/// Blades are stiffer along than across, and casings hardly yield sideways: the law must hold as accurately as
/// elsewhere.
#[test]
fn solves_contacts_with_small_tangential_flexibility() {
    let mut lcg = Lcg(31);
    for case in 0..200 {
        let (contacts, stiff) = (1 + lcg.below(12), 10.0_f64.powi(-1 - case % 6));
        let (mut w, mut free) = random_problem(&mut lcg, contacts, 0);
        let sideways = |row: usize| if row.is_multiple_of(3) { 1.0 } else { stiff };
        for i in 0..3 * contacts {
            free[i] *= sideways(i);
            (0..3 * contacts).for_each(|j| w[(i, j)] *= sideways(i) * sideways(j));
        }
        let friction = vec![lcg.between(0.05, 1.0); contacts];
        let mut solver = solver(&w, &free, &friction);
        let outcome = solver.solve(contacts);
        let worst = violation(&w, &free, &friction, &solver.reactions);
        assert!(outcome.solved && worst <= 2e-12, "case {case}, {stiff:e}: {worst:e}, {outcome:?}");
    }
}

//! Contact without friction: W is symmetric except for effects of rotation, and positive semidefinite of any rank. A solution exists if
//! some motion opens all contacts simultaneously, and it is found.

use super::*;
use proptest::test_runner::TestCaseResult;

/// Random numbers from −1 to 1.
struct SignedRandom(u64);

impl SignedRandom {
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / 4_503_599_627_370_496.0 - 1.0
    }
    fn unit(&mut self) -> f64 {
        0.5 * (self.signed() + 1.0)
    }
    /// Returns a number that is uniformly distributed in its logarithm, this number of decades on either side of 1.
    fn scale(&mut self, decades: f64) -> f64 {
        libm::exp10(decades * self.signed())
    }
}

/// Property of W that makes the problem hard.
#[derive(Debug, Clone, Copy, PartialEq)]
enum HardMatrix {
    Regular,
    FewModes,
    /// Own flexibilities over six powers of ten.
    StiffBesideSoft,
    StiffBesideSoftFewModes,
    /// One half of the contacts nearly equal to the other half.
    NearlyTwice,
    Twice,
    /// Modes over sixteen powers of ten.
    StiffModes,
    StiffModesFew,
    /// Smooth shapes with few waves.
    Smooth,
    /// With the skew-symmetric part of rotating structures.
    Turning,
}

const KINDS: [HardMatrix; 10] = [
    HardMatrix::Regular,
    HardMatrix::FewModes,
    HardMatrix::StiffBesideSoft,
    HardMatrix::StiffBesideSoftFewModes,
    HardMatrix::NearlyTwice,
    HardMatrix::Twice,
    HardMatrix::StiffModes,
    HardMatrix::StiffModesFew,
    HardMatrix::Smooth,
    HardMatrix::Turning,
];

impl HardMatrix {
    fn delassus(self, n: usize, random: &mut SignedRandom) -> DMatrix<f64> {
        let modes = match self {
            Self::FewModes | Self::StiffBesideSoftFewModes | Self::StiffModesFew | Self::Turning => n.div_ceil(2),
            Self::Smooth => n.div_ceil(3),
            _ => n + 2,
        };
        let wave = |row: usize, mode: usize| libm::cos(3.0 * row as f64 / n as f64 * mode as f64);
        let random_shapes = DMatrix::from_fn(n, modes, |_, _| random.signed());
        let mut shapes = if self == Self::Smooth { DMatrix::from_fn(n, modes, wave) } else { random_shapes };
        match self {
            Self::NearlyTwice | Self::Twice => {
                let apart = if self == Self::Twice { 0.0 } else { 1e-6 };
                for row in n.div_ceil(2)..n {
                    (0..modes)
                        .for_each(|mode| shapes[(row, mode)] = shapes[(row - n / 2, mode)] + apart * random.signed());
                }
            }
            Self::StiffModes | Self::StiffModesFew => {
                shapes.column_iter_mut().for_each(|mut mode| mode *= random.scale(4.0));
            }
            Self::StiffBesideSoft | Self::StiffBesideSoftFewModes => {
                shapes.row_iter_mut().for_each(|mut node| node *= random.scale(1.5));
            }
            _ => {}
        }
        let mut between = DMatrix::identity(modes, modes);
        if self == Self::Turning {
            for (row, column) in (0..modes).flat_map(|row| (0..row).map(move |column| (row, column))) {
                between[(row, column)] = 0.1 * random.signed();
                between[(column, row)] = -between[(row, column)];
            }
        }
        &shapes * between * shapes.transpose()
    }
}

/// Returns gaps that some forces open; a third of the contacts without force are exactly at zero.
fn solvable_gaps(w: &DMatrix<f64>, random: &mut SignedRandom) -> Vec<f64> {
    let n = w.nrows();
    let forces: Vec<f64> =
        (0..n).map(|node| if random.unit() < 0.5 { random.unit() / w[(node, node)] } else { 0.0 }).collect();
    let opened = |node: usize| (0..n).map(|other| w[(node, other)] * forces[other]).sum::<f64>();
    let mut gap = |node: usize| if forces[node] > 0.0 || random.unit() < 0.3 { 0.0 } else { random.unit() };
    (0..n).map(|node| gap(node) - opened(node)).collect()
}

/// Checks Signorini's law, up to a fraction of the terms that the gaps consist of.
fn check(w: &DMatrix<f64>, gaps: &[f64], solver: &ContactSolver) -> TestCaseResult {
    let scale = gaps.iter().fold(0.0_f64, |most, gap| most.max(gap.abs()));
    for (node, gap) in gaps.iter().enumerate() {
        let terms = || (0..gaps.len()).map(|other| w[(node, other)] * solver.multipliers[other]);
        let (after, size) = (gap + terms().sum::<f64>(), scale.max(terms().map(f64::abs).sum()));
        let left = if solver.multipliers[node] > 0.0 { after.abs() } else { (-after).max(0.0) };
        prop_assert!(left <= 1e-9 * size && solver.multipliers[node] >= 0.0, "contact {node}: {left:e} of {size:e}");
    }
    Ok(())
}

fn solved(kind: HardMatrix, n: usize, seed: u64) -> TestCaseResult {
    let mut random = SignedRandom(seed);
    (0..4).for_each(|_| {
        random.signed();
    });
    let w = kind.delassus(n, &mut random);
    let gaps = solvable_gaps(&w, &mut random);
    let mut solver = ContactSolver::new(n);
    solver.monotone = true;
    solver.delassus.copy_from(&w);
    solver.gaps.copy_from_slice(&gaps);
    solver.active.fill_with(|| random.unit() < 0.4);
    let outcome = solver.lcp();
    prop_assert!(outcome.solved, "{kind:?}, {n} contacts, seed {seed}: {outcome:?}");
    check(&w, &gaps, &solver)
}

#[test]
fn solves_every_solvable_frictionless_problem() {
    for kind in KINDS {
        for seed in 0..1200 {
            let n = 1 + usize::try_from(seed % 40).unwrap();
            solved(kind, n, 977 * seed + 31).unwrap_or_else(|problem| panic!("{kind:?}, {n}, {seed}: {problem}"));
        }
    }
}

/// One mode that closes one contact when it opens the other; and three contacts on which the forces 1, 1, 1 cause no motion.
#[test]
fn contacts_that_cannot_open_together_are_reported_unsolved() {
    let second = [[2.0, -1.0, -1.0], [-1.0, 2.0, -1.0], [-1.0, -1.0, 2.0]].concat();
    for (matrix, gaps) in [
        (vec![1.0, -1.0, -1.0, 1.0], vec![-1.0, -1.0]),
        (vec![1.0, -1.0, -1.0, 1.0], vec![-1.0, 1.0 - 1e-3]),
        (second, vec![-1.0, 0.5, 0.4]),
    ] {
        for monotone in [false, true] {
            let mut solver = ContactSolver::new(gaps.len());
            solver.monotone = monotone;
            solver.delassus.copy_from_slice(&matrix);
            solver.gaps.copy_from_slice(&gaps);
            let outcome = solver.lcp();
            assert!(!outcome.solved, "{matrix:?}, {gaps:?}: {:?}", solver.multipliers);
        }
    }
    // Exactly the capacity that they need.
    let mut solver = ContactSolver::new(2);
    solver.monotone = true;
    solver.delassus.copy_from_slice(&[1.0, -1.0, -1.0, 1.0]);
    solver.gaps.copy_from_slice(&[-1.0, 1.0]);
    assert!(solver.lcp().solved && (solver.multipliers[0] - solver.multipliers[1] - 1.0).abs() < 1e-9);
}

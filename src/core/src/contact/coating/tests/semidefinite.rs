//! More nodes than modes on a coating: W is singular, without friction. Solvable problems are solved.

use nalgebra::DMatrix;

use super::*;

/// Random numbers from 0 to 1.
struct UnitRandom(u64);

impl UnitRandom {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / 9_007_199_254_740_992.0
    }
}

/// One blade of `n` nodes on `modes` modes, pressed through a coating of that modulus onto the hard casing.
fn check(n: usize, modes: usize, modulus: f64, seed: u64) -> Result<(), String> {
    let mut random = UnitRandom(seed);
    (0..4).for_each(|_| {
        random.unit();
    });
    let settings = material(modulus, 0.05 * modulus, 0.1 * modulus, 4, n);
    let mut coating = coating(&settings, n);
    set_wear(&mut coating, &[0.0, 0.3, 0.1]);
    let shapes = DMatrix::from_fn(n, modes, |_, _| 2.0 * random.unit() - 1.0);
    let w = &shapes * shapes.transpose();
    let forces: Vec<f64> =
        (0..n).map(|node| if random.unit() < 0.5 { 2.0 * random.unit() / w[(node, node)] } else { 0.0 }).collect();
    let mut problem = coating.problem(1);
    coating.locate(&mut problem, &vec![middle(&settings); n]);
    problem.monotone = true;
    problem.delassus.copy_from(&w);
    for node in 0..n {
        let opened: f64 = (0..n).map(|other| w[(node, other)] * forces[other]).sum();
        let room = if forces[node] > 0.0 { 0.0 } else { random.unit() };
        problem.gaps[node] = room - THICKNESS - opened;
        problem.closed[node] = random.unit() < 0.4;
    }
    let gaps = problem.gaps.clone();
    if !problem.solve().solved {
        return Err("not solved".to_owned());
    }
    let scale = gaps.iter().fold(THICKNESS, |most: f64, gap| most.max(gap.abs()));
    for node in 0..n {
        let terms = || (0..n).map(|other| w[(node, other)] * (problem.coating[other] + problem.hard[other]));
        let size = scale.max(terms().map(f64::abs).sum());
        let off = (gaps[node] + terms().sum::<f64>() - problem.gaps[node]).abs();
        let depth = -THICKNESS - problem.gaps[node];
        let apart = if problem.hard[node] > 0.0 { depth.abs() } else { depth.max(0.0) };
        if off > 1e-9 * size || apart > 1e-12 || problem.hard[node] < 0.0 {
            return Err(format!("node {node}: off by {off:e} of {size:e}, {apart:e} from the hard casing"));
        }
    }
    let worst = problem.contacts.iter().map(|contact| {
        let strain = problem.strain(contact, &problem.gaps);
        (contact.area * coating.rod.stress(strain, contact.plastic).0 - problem.force(contact, &problem.gaps)).abs()
            / (contact.area * modulus)
    });
    let worst = worst.fold(0.0, f64::max);
    if worst > 1e-9 * scale { Err(format!("a rod's force is off by {worst:e}")) } else { Ok(()) }
}

#[test]
fn solves_every_solvable_frictionless_coating_problem() {
    let mut failures = Vec::new();
    for (kind, modulus) in [1e-3, 1.0, 1e3, 1e6].into_iter().enumerate() {
        for seed in 0..400_u64 {
            let n = 2 + usize::try_from(seed % 24).unwrap();
            for modes in [n.div_ceil(3), n.div_ceil(2), n + 2] {
                if let Err(problem) = check(n, modes, modulus, 7919 * seed + kind as u64) {
                    failures.push(format!("{n} nodes, {modes} modes, modulus {modulus:e}, seed {seed}: {problem}"));
                }
            }
        }
    }
    assert!(failures.is_empty(), "{} of 4800:\n{}", failures.len(), failures[..failures.len().min(20)].join("\n"));
}

/// One mode moves either node out of the hard casing as far as it moves the other in.
#[test]
fn rejects_nodes_stuck_on_the_hard_casing() {
    for monotone in [false, true] {
        let coating = coating(&material(1.0, 0.05, 0.1, 4, 2), 2);
        let mut problem = coating.problem(1);
        coating.locate(&mut problem, &[TAU / 8.0; 2]);
        problem.monotone = monotone;
        problem.delassus.copy_from_slice(&[1.0, -1.0, -1.0, 1.0]);
        problem.gaps.copy_from_slice(&[-3.0 * THICKNESS, -2.0 * THICKNESS]);
        assert!(!problem.solve().solved, "{:?}", problem.hard);
    }
}

//! The Coulomb solver against Siconos, against the law itself, and against the frictionless solver.

use nalgebra::DMatrix;
use tiprub_core::contact::coulomb::CoulombSolver;
use tiprub_core::contact::solver::ContactSolver;

const BLADE_MODES: usize = 29;
const CASING_MODES: usize = 24;

/// The generator of tests/data/coulomb_siconos.py.
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

/// Add shapes · diag(flexibility) · shapesᵀ to the block that starts at `start`.
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

/// Blades of three contact nodes, each with its own modes, rubbing a casing whose modes all of them share.
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

/// How far a state is from Signorini's and Coulomb's laws, written out as such: the worst share of the terms that
/// displacements (by rows of W) and forces are made of.
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
        // Sticking, or the force is on the cone and against the slip.
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

/// Random problems of many kinds; all of them can be solved by moving the bodies apart.
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
        // Coincident nodes: several contacts of the same material point, with gaps of their own.
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
    (w * 1e-9, free.iter().map(|value| value * 1e-6).collect())
}

#[test]
fn random_problems_are_all_solved() {
    let mut lcg = Lcg(20);
    let mut hist = vec![Vec::new(); 8];
    let mut stats = vec![(0usize, 0usize, 0usize, 0usize, 0.0f64); 8];
    for case in 0..1000 * std::env::var("MULT").map_or(1, |v| v.parse().unwrap()) {
        let (kind, contacts) = (case % 8, 1 + lcg.below(30));
        let contacts = if kind == 1 { contacts.next_multiple_of(3) } else { contacts };
        let (w, free) = random_problem(&mut lcg, contacts, kind);
        let common = lcg.between(0.0, 1.5);
        let friction: Vec<f64> = match case / 8 % 4 {
            0 => (0..contacts).map(|_| lcg.between(0.0, 1.5)).collect(),
            1 => vec![0.1 * common; contacts],
            _ => vec![common; contacts],
        };
        if std::env::var("ONLY").is_ok_and(|v| v.parse::<usize>().unwrap() != case) {
            if case % 3 == 0 {
                for _ in 0..3 * contacts {
                    lcg.uniform();
                }
            }
            continue;
        }
        let mut solver = solver(&w, &free, &friction);
        if case % 3 == 0 {
            solver.reactions.iter_mut().for_each(|value| *value = 500.0 * lcg.uniform());
        }
        let outcome = solver.solve(contacts);
        let worst = violation(&w, &free, &friction, &solver.reactions);
        if outcome.factorisations > 100 {
            println!("MANY {case} kind {kind} {}", outcome.factorisations);
            hist[kind].push(outcome.factorisations);
        }
        let s = &mut stats[kind];
        s.0 += 1;
        s.1 += usize::from(!outcome.solved);
        s.2 = s.2.max(outcome.sweeps);
        s.3 = s.3.max(outcome.factorisations);
        if outcome.solved {
            s.4 = s.4.max(worst);
        }
        if !outcome.solved {
            println!("{case} kind {kind} n {contacts} mu {common} {:?} {outcome:?} {worst:e}", case / 8 % 4);
        }
    }
    println!("{stats:?}");
    for mut h in hist {
        h.sort();
        println!("{} {:?}", h.len(), h);
    }
}

#[test]
fn scratch_probe() {
    let text = std::fs::read_to_string("/tmp/sic.csv").unwrap();
    for line in text.lines().filter(|l| !l.starts_with('#')) {
        let f: Vec<&str> = line.split(',').collect();
        let n: usize = f[0].parse().unwrap();
        let mu: f64 = f[1].parse().unwrap();
        let expected: Vec<f64> = f[4..].iter().map(|v| v.parse().unwrap()).collect();
        let (w, free) = blades_in_casing(n, 1019 + n as u64);
        let mut s = solver(&w, &free, &vec![mu; n]);
        let outcome = s.solve(n);
        let scale = expected.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let d = expected.iter().zip(&s.reactions).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        let stick = (0..n)
            .filter(|c| {
                let r = &s.reactions[3 * c..3 * c + 3];
                r[0] > 0.0 && r[1].hypot(r[2]) < mu * r[0] * (1.0 - 1e-9)
            })
            .count();
        let act = (0..n).filter(|c| s.reactions[3 * c] > 0.0).count();
        println!("{n} {mu} {outcome:?} diff {:e} scale {scale} active {act} stick {stick}", d / scale);
        let cold: Vec<f64> = (0..21)
            .map(|_| {
                s.reactions.fill(0.0);
                let t = std::time::Instant::now();
                s.solve(n);
                t.elapsed().as_secs_f64()
            })
            .collect();
        let keep = s.reactions.clone();
        let mut sweeps = (0, 0);
        let warm: Vec<f64> = (0..21)
            .map(|i| {
                s.reactions.copy_from_slice(&keep);
                for k in 0..3 * n {
                    s.free[k] = free[k] * (1.0 + 1e-3 * ((k * 7 + i * 13) % 11) as f64 / 11.0);
                }
                let t = std::time::Instant::now();
                let o = s.solve(n);
                sweeps = (o.sweeps, o.factorisations);
                t.elapsed().as_secs_f64()
            })
            .collect();
        let med = |mut v: Vec<f64>| {
            v.sort_by(f64::total_cmp);
            v[v.len() / 2] * 1e6
        };
        println!("    cold {:.1} us warm {:.1} us {sweeps:?}", med(cold), med(warm));
    }
}

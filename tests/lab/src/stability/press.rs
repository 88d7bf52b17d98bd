//! A round casing that closes on all blades and stays: the static solution is known for any scheme, step and solver.
//!
//! With u = Σ S_j f_j, S = C K⁻¹ Cᵀ the static flexibility, f_j = λ_j (n_j − µ t_j), contact at rest is 0 ≤ λ ⟂ g₀ + Wλ
//! ≥ 0 with W_ij = n_i·S_ij (n_j − µ t_j). The small problem is solved here by trying every set of closed contacts.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{Result, Rom, Scene, Simulation};

use super::{
    Check,
    models::{RADIUS, allowed},
    observe::{StabilityWatch, begin, real, set, steps},
};

/// Damping that brings the blades to rest.
const DAMPING: f64 = 0.3;

/// Fraction of the tolerance to which galerkin closes gaps, and therefore the accuracy of forces: with a margin for
/// stiffness that differs between nodes.
const PRECISION: f64 = 1e-3;

/// A casing that closes over `rise` seconds by gap and depth, and stays for `hold` seconds.
#[derive(Debug, Clone)]
pub(crate) struct Press {
    /// Rotor in a round rigid casing.
    pub scene: Scene,
    /// Depth beyond the clearance (m).
    pub depth: f64,
    /// Time to close (s).
    pub rise: f64,
    /// Time to come to rest (s).
    pub hold: f64,
    /// Allowed relative distance of λ, strain energy and torque from the static values.
    pub tolerance: f64,
}

/// Static forces of blades at rest.
#[derive(Debug, Clone)]
pub(crate) struct Static {
    /// λ of each node of a blade (N).
    pub multipliers: Vec<f64>,
    /// Strain energy of a blade (J).
    pub strain: f64,
}

impl Press {
    /// Creates a press of 0.05 mm, with 4 ms to close and 12 ms to come to rest.
    pub(crate) fn new(scene: Scene) -> Self {
        Self { scene, depth: 5e-5, rise: 4e-3, hold: 12e-3, tolerance: 1e-6 }
    }

    /// Returns the radius change at a time (m).
    fn change(&self, time: f64) -> f64 {
        let share = (time / self.rise).min(1.0);
        -(self.scene.settings.contacts[0].gap + self.depth) * 0.5 * (1.0 - (PI * share).cos())
    }

    /// Runs the scene and compares.
    ///
    /// # Errors
    /// A rejected scene.
    pub(crate) fn run(&self) -> Result<Vec<Check>> {
        let (simulation, watch) = self.march()?;
        let mut checks = Vec::new();
        checks.extend(watch.books_of(self.scene.settings.time.scheme));
        if self.scene.settings.contacts[0].solver != Solver::Film {
            checks.extend(watch.complementarity());
        } else if self.scene.roms[0].contact_nodes.len() > 1 {
            // With film, λ of nodes that push each other apart can become negative.
            checks.retain(|check| !check.what.contains("impact"));
        }
        checks.extend(self.compare(&simulation));
        Ok(checks)
    }

    fn march(&self) -> Result<(Simulation, StabilityWatch)> {
        let mut scene = self.scene.clone();
        scene.settings.structures[0].damping_ratio.get_or_insert(DAMPING);
        let step = scene.settings.time.step;
        scene.settings.experiment.communication_step = step;
        let (mut simulation, mut watch) = begin(&scene)?;
        watch.scale = watch.scale.max(self.depth);
        for index in 0..steps(self.rise + self.hold, step).max(400) {
            set(&mut simulation, "casing_radius_change", self.change(f64::from(index) * step))?;
            watch.step(&mut simulation, step)?;
        }
        Ok((simulation, watch))
    }

    fn compare(&self, simulation: &Simulation) -> Vec<Check> {
        let (rom, contact) = (&self.scene.roms[0], &self.scene.settings.contacts[0]);
        let sense = self.scene.settings.structures[0].speed.signum();
        let exact = pressed(rom, contact.friction * sense, self.depth);
        // Galerkin closes gaps to a fraction of its tolerance.
        let precise = PRECISION * allowed(&self.scene) / self.depth;
        let tolerance = self.tolerance + precise;
        let system = simulation.system();
        // The forces of galerkin are polynomials in time: means over the last step, which displacements follow.
        let mut means = vec![vec![0.0; rom.sectors]; rom.contact_nodes.len()];
        system.events().iter().for_each(|event| means[event.node][event.sector] = event.normal);
        let galerkin = self.scene.settings.time.scheme == Scheme::Galerkin;
        let multiplier =
            |node: usize, sector: usize| if galerkin { means[node][sector] } else { system.multiplier(node, sector) };
        let nodes = rom.contact_nodes.len();
        let scale = exact.multipliers.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let (mut off, mut alike, mut total) = (0.0_f64, 0.0_f64, 0.0);
        for sector in 0..rom.sectors {
            // Of coincident nodes only the sum of forces is determined.
            let sum: f64 = (0..nodes).map(|node| multiplier(node, sector)).sum();
            let first: f64 = (0..nodes).map(|node| multiplier(node, 0)).sum();
            alike = alike.max((sum - first).abs() / scale);
            total += sum;
            let each = (0..nodes).map(|node| (multiplier(node, sector) - exact.multipliers[node]).abs());
            let differs = if coincident(rom) {
                (sum - exact.multipliers.iter().sum::<f64>()).abs()
            } else {
                each.fold(0.0, f64::max)
            };
            off = off.max(differs / scale);
        }
        let mut checks = vec![
            Check::at_most("deviation of λ from the static solution", off, tolerance),
            Check::at_most("difference between sectors", alike, precise + if rom.is_cyclic() { 1e-9 } else { 0.0 }),
            Check::relative(
                "deviation of the strain energy from the static one",
                real(simulation, "strain_energy"),
                exact.strain * rom.sectors as f64,
                10.0 * tolerance,
            ),
        ];
        let force = real(simulation, "force_x").hypot(real(simulation, "force_y"));
        if rom.sectors > 1 {
            checks.push(Check::at_most("resultant force", force / total, 1e-9 + precise));
        }
        let torque = real(simulation, "torque") + contact.friction * sense * total * RADIUS;
        checks.push(Check::at_most(
            "deviation of the torque from −µΣλr",
            (torque / (total * RADIUS)).abs(),
            10.0 * tolerance,
        ));
        checks
    }
}

fn coincident(rom: &Rom) -> bool {
    let places: Vec<[f64; 3]> = rom.contact_nodes.iter().map(|node| node.position).collect();
    places.windows(2).any(|pair| pair[0].map(f64::to_bits) == pair[1].map(f64::to_bits))
}

/// Returns the directions of the nodes: normal and force per multiplier, `friction` with the sign of the speed.
fn directions(rom: &Rom, friction: f64) -> Vec<([f64; 3], [f64; 3])> {
    let each = rom.contact_nodes.iter().map(|node| {
        let length = (1.0 + node.meridional_slope * node.meridional_slope).sqrt();
        let normal = [-1.0 / length, 0.0, node.meridional_slope / length];
        (normal, [normal[0], -friction, normal[2]])
    });
    each.collect()
}

/// Returns the static flexibility of the contact rows (m/N).
fn flexibility(rom: &Rom) -> DMatrix<f64> {
    // Scaled first, because stiffness may span many orders of magnitude.
    let order = rom.order();
    let scale = DVector::from_fn(order, |i, _| 1.0 / rom.stiffness[(i, i)].sqrt());
    let scaled = DMatrix::from_fn(order, order, |i, j| scale[i] * rom.stiffness[(i, j)] * scale[j]);
    let map = DMatrix::from_fn(rom.contact_map.nrows(), order, |i, j| rom.contact_map[(i, j)] * scale[j]);
    let solved =
        scaled.lu().solve(&map.transpose()).unwrap_or_else(|| DMatrix::from_element(order, map.nrows(), f64::NAN));
    map * solved
}

/// Returns the static solution with the casing `depth` (m, radial) beyond the tips; `friction` with the sign of the
/// speed.
pub(crate) fn pressed(rom: &Rom, friction: f64, depth: f64) -> Static {
    let (along, flexible) = (directions(rom, friction), flexibility(rom));
    let count = along.len();
    let entry = |i: usize, j: usize| -> f64 {
        (0..3)
            .flat_map(|a| (0..3).map(move |b| (a, b)))
            .map(|(a, b)| along[i].0[a] * flexible[(3 * i + a, 3 * j + b)] * along[j].1[b])
            .sum()
    };
    let gap = |i: usize| depth * along[i].0[0];
    let multipliers = if coincident(rom) {
        // All nodes are equal: each carries an equal fraction of the force of a single one.
        vec![-gap(0) / entry(0, 0) / count as f64; count]
    } else {
        let delassus = DMatrix::from_fn(count, count, entry);
        (1..1_usize << count).find_map(|set| closed(&delassus, &gap, set)).unwrap_or_else(|| vec![f64::NAN; count])
    };
    let force = DVector::from_fn(3 * count, |row, _| multipliers[row / 3] * along[row / 3].1[row % 3]);
    Static { strain: 0.5 * force.dot(&(&flexible * &force)), multipliers }
}

/// Returns the solution with exactly these contacts closed, if there is one.
fn closed(delassus: &DMatrix<f64>, gap: &dyn Fn(usize) -> f64, set: usize) -> Option<Vec<f64>> {
    let count = delassus.nrows();
    let members: Vec<usize> = (0..count).filter(|node| set >> node & 1 == 1).collect();
    let matrix = DMatrix::from_fn(members.len(), members.len(), |i, j| delassus[(members[i], members[j])]);
    let right = DVector::from_fn(members.len(), |i, _| -gap(members[i]));
    let solved = matrix.lu().solve(&right)?;
    let mut multipliers = vec![0.0; count];
    members.iter().zip(solved.iter()).for_each(|(node, value)| multipliers[*node] = *value);
    let left = (0..count).map(|i| gap(i) + (0..count).map(|j| delassus[(i, j)] * multipliers[j]).sum::<f64>());
    let open = left.enumerate().all(|(i, left)| members.contains(&i) || left >= 0.0);
    (open && multipliers.iter().all(|value| *value >= 0.0)).then_some(multipliers)
}

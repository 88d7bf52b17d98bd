//! Augmented Lagrangian with Newmark's method, δ = 0.5 and α = 0.25, as in commercial codes.
//!
//! Contact is a penalty ε that is augmented by multipliers while a node penetrates by more than a tolerance; each
//! problem is solved by Newton's method (J. C. Simo, T. A. Laursen, Comput. Struct. 42 (1992) 97-116). Sticking
//! friction is elastic with ε and starts from the friction force of the last step. Contact forces take part in the
//! average acceleration like all other forces, so that nodes rebound.

use nalgebra::{DMatrix, DVector, Vector3};
use tiprub_model::{Error, Result};

use super::MethodRun;
use super::contact::{
    RingContact, SurfaceVectors, Vectors, add_to_loads, find, surface_at_rest, surface_forces, surface_of,
};
use super::operator::{BodyOperator, inner};
use super::recorder::{Recorder, StepEntry};
use crate::cube::history::CubeHistory;
use crate::cube::scene::CubeScene;
use crate::surface::is_zero;

/// Options of this method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AugmentedOptions {
    /// ε (N/m) per node.
    pub penalty: f64,
    /// Ratio of ε of the corner nodes of a face to that of the other nodes.
    pub corners: f64,
    /// Largest penetration that needs no further augmentation (m).
    pub tolerance: f64,
}

impl Default for AugmentedOptions {
    /// Returns a penalty of 24 times E·a of the 10 mm elements of the cube, so that a node under 2500 N penetrates by
    /// 5 µm, and a tolerance of a hundredth of the element.
    fn default() -> Self {
        Self { penalty: 5e8, corners: 1.0, tolerance: 1e-4 }
    }
}

/// Largest number of augmentations and updates of geometry per step.
const UPDATES: usize = 200;
/// Largest number of Newton iterations per problem.
const ITERATIONS: usize = 60;

/// Contact forces that carry over from one problem to the next: (side, master, global force).
type Memory = Vec<(usize, usize, [f64; 3])>;

/// Runs the scene.
///
/// # Errors
/// The errors of [`super::CubeMethod::run`].
pub(crate) fn run(scene: &CubeScene, run: &MethodRun, options: AugmentedOptions) -> Result<CubeHistory> {
    let mut recorder = Recorder::new(scene, run, "augmented");
    let h = run.step;
    let quarter = 0.25 * h * h;
    let operator = BodyOperator::new(scene, quarter)?;
    let mut problem = AugmentedProblem {
        scene,
        operator: &operator,
        rest: surface_at_rest(scene),
        quarter,
        options,
        friction_memory: Memory::new(),
    };
    recorder.prepared();
    let (mut now, mut velocity, mut acceleration) = (scene.rest(), scene.launch(), scene.rest());
    for step in 1..=run.steps() {
        // (M + h²/4 K) a₁ = C r − K (u₀ + h v₀ + h²/4 a₀), u₁ = u₀ + h v₀ + h²/4 (a₀ + a₁).
        let known: Vectors = core::array::from_fn(|i| {
            (0..now[i].len()).map(|dof| now[i][dof] + h * velocity[i][dof] + quarter * acceleration[i][dof]).collect()
        });
        let mut loads: Vectors = operator.elastic(&known).map(|force| force.into_iter().map(|f| -f).collect());
        let mut next = operator.solve(scene, &loads);
        let at_end = |a: &Vectors| -> Vectors {
            core::array::from_fn(|i| known[i].iter().zip(&a[i]).map(|(u, a)| u + quarter * a).collect())
        };
        let free = at_end(&next);
        let found = problem.solve(&surface_of(scene, &now), &surface_of(scene, &free), step)?;
        recorder.iterations(found.iterations);
        recorder.note_penetration(found.penetration);
        recorder.note_forces(&found.contacts, &found.forces);
        if !found.forces.iter().all(is_zero) {
            add_to_loads(scene, &surface_forces(scene, &found.contacts, &found.forces), 1.0, &mut loads);
            next = operator.solve(scene, &loads);
        }
        now = at_end(&next);
        for i in 0..3 {
            for dof in 0..now[i].len() {
                velocity[i][dof] += 0.5 * h * (acceleration[i][dof] + next[i][dof]);
            }
        }
        acceleration = next;
        if recorder.wants(step) {
            let elastic = operator.elastic(&now);
            recorder.record(&StepEntry {
                time: step as f64 * h,
                displacements: &now,
                cube_velocity: &velocity[0],
                kinetic: operator.kinetic(&velocity),
                strain: (0..3).map(|i| 0.5 * inner(&now[i], &elastic[i])).sum(),
            });
        }
    }
    Ok(recorder.finish())
}

struct AugmentedProblem<'a> {
    scene: &'a CubeScene,
    operator: &'a BodyOperator,
    rest: SurfaceVectors,
    quarter: f64,
    options: AugmentedOptions,
    friction_memory: Memory,
}

struct AugmentedSolution {
    contacts: Vec<RingContact>,
    forces: Vec<[f64; 3]>,
    iterations: usize,
    penetration: f64,
}

/// Returns the entry of a contact in a memory, in its frame.
fn recall(memory: &Memory, contact: &RingContact) -> Vector3<f64> {
    let same = |(side, master, _): &&(usize, usize, [f64; 3])| *side == contact.side && *master == contact.master;
    memory.iter().find(same).map_or_else(Vector3::zeros, |(_, _, force)| contact.local(*force).into())
}

fn memory(contacts: &[RingContact], forces: &[Vector3<f64>]) -> Memory {
    contacts
        .iter()
        .zip(forces)
        .map(|(contact, force)| (contact.side, contact.master, contact.global((*force).into())))
        .collect()
}

impl AugmentedProblem<'_> {
    /// Returns ε of a contact (N/m).
    fn penalty(&self, contact: &RingContact) -> f64 {
        let cube = &self.scene.bodies[0];
        let node = cube.contact[contact.side * self.scene.masters + contact.master];
        let corner = ["CORNERS_LEFT", "CORNERS_RIGHT"].iter().any(|set| cube.mesh.sets[*set].contains(&node));
        self.options.penalty * if corner { self.options.corners } else { 1.0 }
    }

    fn solve(&mut self, start: &SurfaceVectors, free: &SurfaceVectors, step: usize) -> Result<AugmentedSolution> {
        let masters = self.scene.masters;
        let mut moved = free.clone();
        let (mut multipliers, mut iterations, mut last) = (Memory::new(), 0, f64::NAN);
        for _ in 0..UPDATES {
            let contacts = find(self.scene, &self.rest, &moved, 1e-4);
            let offsets: Vec<Vector3<f64>> = contacts
                .iter()
                .map(|contact| {
                    let at =
                        |surface: &SurfaceVectors| Vector3::from(contact.local(contact.relative(masters, surface)));
                    let ahead = at(free);
                    let mut offset = ahead - at(start);
                    offset[0] = contact.gap + ahead[0] - at(&moved)[0];
                    offset
                })
                .collect();
            // Normal multipliers of the augmentation; the tangential ones are the friction of the last step.
            let given: Vec<Vector3<f64>> = contacts
                .iter()
                .map(|contact| {
                    let tangential = recall(&self.friction_memory, contact);
                    Vector3::new(recall(&multipliers, contact)[0], tangential[1], tangential[2])
                })
                .collect();
            let delassus = self.operator.delassus(&contacts, masters) * self.quarter;
            let penalties: Vec<f64> = contacts.iter().map(|contact| self.penalty(contact)).collect();
            let (forces, count) = self.newton(&delassus, &offsets, &given, &penalties, step)?;
            iterations += count;
            let local: Vec<[f64; 3]> = forces.iter().map(|force| (*force).into()).collect();
            let response = self.operator.surface_response(&surface_forces(self.scene, &contacts, &local));
            last = 0.0;
            for index in 0..3 {
                for i in 0..moved[index].len() {
                    for k in 0..3 {
                        let value = free[index][i][k] + self.quarter * response[index][i][k];
                        last = f64::max(last, (value - moved[index][i][k]).abs());
                        moved[index][i][k] = value;
                    }
                }
            }
            if last > 1e-12 {
                continue;
            }
            let penetration = find(self.scene, &self.rest, &moved, 0.0).iter().fold(0.0, |a: f64, c| a.max(-c.gap));
            if penetration <= self.options.tolerance {
                self.friction_memory = memory(&contacts, &forces);
                return Ok(AugmentedSolution { contacts, forces: local, iterations, penetration });
            }
            multipliers =
                memory(&contacts, &forces.iter().map(|force| Vector3::new(force[0], 0.0, 0.0)).collect::<Vec<_>>());
        }
        let problem =
            format!("no convergence in step {step} after {UPDATES} updates; surfaces still move by {last:.1e} m");
        Err(Error::invalid(
            "contact problem of the augmented Lagrangian method",
            problem,
            "Use a smaller step or a larger penalty",
        ))
    }

    /// Computes the forces r = P(λ − ε δ(r)) by Newton's method on the piecewise smooth law.
    fn newton(
        &self,
        delassus: &DMatrix<f64>,
        offsets: &[Vector3<f64>],
        given: &[Vector3<f64>],
        penalties: &[f64],
        step: usize,
    ) -> Result<(Vec<Vector3<f64>>, usize)> {
        let count = offsets.len();
        let mut forces: DVector<f64> = DVector::zeros(3 * count);
        for iteration in 1..=ITERATIONS {
            let moved = delassus * &forces;
            let mut jacobian = DMatrix::identity(3 * count, 3 * count);
            let mut residual = DVector::zeros(3 * count);
            for a in 0..count {
                let trial = given[a] - (offsets[a] + moved.fixed_rows::<3>(3 * a)) * penalties[a];
                let (law, slope) = law(trial, self.scene.setting.friction);
                residual.fixed_rows_mut::<3>(3 * a).copy_from(&(forces.fixed_rows::<3>(3 * a) - law));
                let rows = slope * delassus.rows(3 * a, 3) * penalties[a];
                let mut view = jacobian.rows_mut(3 * a, 3);
                view += rows;
            }
            if residual.amax() <= 1e-11 * forces.amax() {
                return Ok(((0..count).map(|a| forces.fixed_rows::<3>(3 * a).into_owned()).collect(), iteration));
            }
            let change = jacobian.lu().solve(&residual);
            forces -= change.ok_or_else(|| {
                Error::invalid(
                    "contact problem of the augmented Lagrangian method",
                    "its matrix is singular",
                    "Check the scene",
                )
            })?;
        }
        let problem = format!("Newton's method did not converge in {ITERATIONS} iterations in step {step}");
        Err(Error::invalid("contact problem of the augmented Lagrangian method", problem, "Use a smaller step"))
    }
}

/// Returns the force for a trial force and its derivative: no tension, tangential part limited to µ times the normal
/// one.
fn law(trial: Vector3<f64>, friction: f64) -> (Vector3<f64>, nalgebra::Matrix3<f64>) {
    let mut slope = nalgebra::Matrix3::zeros();
    if trial[0] <= 0.0 {
        return (Vector3::zeros(), slope);
    }
    slope[(0, 0)] = 1.0;
    let tangential = trial.yz();
    let (length, limit) = (tangential.norm(), friction * trial[0]);
    if length <= limit {
        slope[(1, 1)] = 1.0;
        slope[(2, 2)] = 1.0;
        return (trial, slope);
    }
    let unit = tangential / length;
    for i in 0..2 {
        slope[(1 + i, 0)] = friction * unit[i];
        for j in 0..2 {
            let own = if i == j { 1.0 } else { 0.0 };
            slope[(1 + i, 1 + j)] = limit / length * (own - unit[i] * unit[j]);
        }
    }
    (Vector3::new(trial[0], limit * unit[0], limit * unit[1]), slope)
}

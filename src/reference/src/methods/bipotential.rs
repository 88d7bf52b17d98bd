//! Bi-potential method of De Saxcé and Feng, implicit in time.
//!
//! G. De Saxcé, Z.-Q. Feng, Mathl Comput. Modelling 28 (1998) 225-245: contact and Coulomb friction together are one
//! inequality, solved by Uzawa's prediction r − ρ(δ + µ|δ_t| n) and its projection on Coulomb's cone. Sticking is
//! exact. The time integration is the trapezoidal rule in terms of displacements only, where the contact force of t_n
//! keeps the gap of t_{n+1} open,
//!
//! (M + h²/4 K)(u_{n+1} − 2u_n + u_{n−1}) = h² (C r_n − K u_n),
//!
//! which without contact conserves ½ vᵀMv + ½ ūᵀKū, v = (u_{n+1} − u_n)/h, ū = (u_{n+1} + u_n)/2, for every h, and
//! stops touching points without rebound. Feet, normals and weights are those of the end of the step.

use nalgebra::{DMatrix, Matrix3, Vector3};
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

/// Masters closer than this to a surface are included (m).
const MARGIN: f64 = 1e-4;
/// Sweeps end if no reaction changes by more than this fraction of the largest.
const TOLERANCE: f64 = 1e-11;
/// Largest number of sweeps per contact problem.
const SWEEPS: usize = 20_000;
/// Geometry is final if no surface point moves more than this (m).
const SETTLED: f64 = 1e-12;
/// Largest number of updates of the geometry per step.
const UPDATES: usize = 30;

/// Runs the scene.
///
/// # Errors
/// The errors of [`super::CubeMethod::run`].
pub(crate) fn run(scene: &CubeScene, run: &MethodRun) -> Result<CubeHistory> {
    let mut recorder = Recorder::new(scene, run, "bipotential");
    let (h, square) = (run.step, run.step * run.step);
    let operator = BodyOperator::new(scene, 0.25 * square)?;
    let mut problem =
        BipotentialProblem { scene, operator: &operator, rest: surface_at_rest(scene), square, previous: Vec::new() };
    recorder.prepared();
    let mut now = scene.rest();
    let mut change: Vectors = scene.launch().map(|v| v.iter().map(|v| h * v).collect());
    let mut elastic = operator.elastic(&now);
    for step in 0..=run.steps() {
        let mut loads: Vectors = core::array::from_fn(|i| elastic[i].iter().map(|f| -square * f).collect());
        let mut second = operator.solve(scene, &loads);
        let free = advanced(&now, &change, &second);
        let found = problem.solve(&surface_of(scene, &now), &surface_of(scene, &free), step)?;
        recorder.iterations(found.sweeps);
        recorder.note_penetration(found.penetration);
        recorder.note_forces(&found.contacts, &found.forces);
        let mut next = free;
        if !found.forces.iter().all(is_zero) {
            add_to_loads(scene, &surface_forces(scene, &found.contacts, &found.forces), square, &mut loads);
            second = operator.solve(scene, &loads);
            next = advanced(&now, &change, &second);
        }
        for index in 0..3 {
            change[index].iter_mut().zip(&second[index]).for_each(|(d, s)| *d += s);
        }
        let elastic_next = operator.elastic(&next);
        if recorder.wants(step) {
            let velocity: Vectors = core::array::from_fn(|i| change[i].iter().map(|d| d / h).collect());
            let strain = |i: usize| {
                let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + b).collect::<Vec<f64>>();
                0.125 * inner(&sum(&now[i], &next[i]), &sum(&elastic[i], &elastic_next[i]))
            };
            recorder.record(&StepEntry {
                time: step as f64 * h,
                displacements: &now,
                cube_velocity: &velocity[0],
                kinetic: operator.kinetic(&velocity),
                strain: (0..3).map(strain).sum(),
            });
        }
        (now, elastic) = (next, elastic_next);
    }
    Ok(recorder.finish())
}

/// Returns u_n + (u_n − u_{n−1}) + second difference.
fn advanced(now: &Vectors, change: &Vectors, second: &Vectors) -> Vectors {
    core::array::from_fn(|i| (0..now[i].len()).map(|dof| now[i][dof] + (change[i][dof] + second[i][dof])).collect())
}

struct BipotentialProblem<'a> {
    scene: &'a CubeScene,
    operator: &'a BodyOperator,
    rest: SurfaceVectors,
    square: f64,
    /// Reactions of the last step as initial values: (side, master, force in the frame).
    previous: Vec<(usize, usize, [f64; 3])>,
}

struct BipotentialSolution {
    contacts: Vec<RingContact>,
    forces: Vec<[f64; 3]>,
    sweeps: usize,
    penetration: f64,
}

impl BipotentialProblem<'_> {
    /// Computes the reactions that keep the gaps at the end of the step open, from surface displacements at its start
    /// and without contact.
    fn solve(&mut self, start: &SurfaceVectors, free: &SurfaceVectors, step: usize) -> Result<BipotentialSolution> {
        let masters = self.scene.masters;
        let mut moved = free.clone();
        let (mut sweeps, mut last) = (0, f64::NAN);
        for _ in 0..UPDATES {
            let contacts = find(self.scene, &self.rest, &moved, MARGIN);
            let offsets: Vec<Vector3<f64>> = contacts
                .iter()
                .map(|contact| {
                    // Gap linearised about its evaluation point; slip over the step.
                    let at =
                        |surface: &SurfaceVectors| Vector3::from(contact.local(contact.relative(masters, surface)));
                    let (base, ahead) = (at(start), at(free));
                    let mut offset = ahead - base;
                    offset[0] = contact.gap + ahead[0] - at(&moved)[0];
                    offset
                })
                .collect();
            let mut forces: Vec<[f64; 3]> = contacts.iter().map(|contact| self.remembered(contact)).collect();
            let delassus = self.operator.delassus(&contacts, masters) * self.square;
            sweeps += uzawa(&delassus, &offsets, self.scene.setting.friction, &mut forces, step)?;
            self.previous =
                contacts.iter().zip(&forces).map(|(contact, force)| (contact.side, contact.master, *force)).collect();
            let response = self.operator.surface_response(&surface_forces(self.scene, &contacts, &forces));
            last = 0.0;
            for index in 0..3 {
                for i in 0..moved[index].len() {
                    for k in 0..3 {
                        let value = free[index][i][k] + self.square * response[index][i][k];
                        last = f64::max(last, (value - moved[index][i][k]).abs());
                        moved[index][i][k] = value;
                    }
                }
            }
            if last < SETTLED {
                let penetration = find(self.scene, &self.rest, &moved, 0.0).iter().fold(0.0, |a: f64, c| a.max(-c.gap));
                return Ok(BipotentialSolution { contacts, forces, sweeps, penetration });
            }
        }
        let problem = format!("in step {step}, the foot points still move by {last:.1e} m after {UPDATES} updates");
        Err(Error::invalid("contact geometry of the bi-potential method", problem, "Use a smaller step"))
    }

    fn remembered(&self, contact: &RingContact) -> [f64; 3] {
        let same = |(side, master, _): &&(usize, usize, [f64; 3])| *side == contact.side && *master == contact.master;
        self.previous.iter().find(same).map_or([0.0; 3], |(_, _, force)| *force)
    }
}

/// Performs Uzawa's iteration, contact after contact, until reactions converge. `offsets` are gap and slip without
/// reactions. Returns the number of sweeps.
fn uzawa(
    delassus: &DMatrix<f64>,
    offsets: &[Vector3<f64>],
    friction: f64,
    forces: &mut [[f64; 3]],
    step: usize,
) -> Result<usize> {
    let count = offsets.len();
    for sweep in 0..SWEEPS {
        let (mut changed, mut largest) = (0.0_f64, 0.0_f64);
        for a in 0..count {
            let own: Matrix3<f64> = delassus.fixed_view::<3, 3>(3 * a, 3 * a).into_owned();
            let mut others = offsets[a];
            for b in (0..count).filter(|b| *b != a && !is_zero(&forces[*b])) {
                others += delassus.fixed_view::<3, 3>(3 * a, 3 * b) * Vector3::from(forces[b]);
            }
            let before = Vector3::from(forces[a]);
            let mut reaction = before;
            let rho = 1.0 / own.trace();
            for _ in 0..50 {
                let moved = others + own * reaction;
                let prediction = reaction - (moved + Vector3::x() * (friction * moved.yz().norm())) * rho;
                let next = projected(prediction, friction);
                let by = (next - reaction).amax();
                reaction = next;
                if by <= 0.1 * TOLERANCE * reaction.amax() {
                    break;
                }
            }
            forces[a] = reaction.into();
            changed = changed.max((reaction - before).amax());
            largest = largest.max(reaction.amax());
        }
        if changed <= TOLERANCE * largest {
            return Ok(sweep + 1);
        }
    }
    let problem = format!("Uzawa's iteration did not converge in {SWEEPS} sweeps in step {step}");
    Err(Error::invalid("contact problem of the bi-potential method", problem, "Use a smaller step"))
}

/// Projects a force on Coulomb's cone; the first component is the normal one.
pub(crate) fn projected(force: Vector3<f64>, friction: f64) -> Vector3<f64> {
    let (normal, tangential) = (force[0], force.yz().norm());
    if friction * tangential <= -normal {
        return Vector3::zeros();
    }
    if tangential <= friction * normal {
        return force;
    }
    let kept = (normal + friction * tangential) / (1.0 + friction * friction);
    let factor = friction * kept / tangential;
    Vector3::new(kept, force[1] * factor, force[2] * factor)
}

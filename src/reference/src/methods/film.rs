//! Central differences with forward-increment Lagrange multipliers: the algorithm of the paper (eqs 9 to 11).
//!
//! Sliding only: the direction of friction is that of the predicted displacement of the step, without the
//! displacement of the rings along z. As in Carpenter's paper, contacts whose multiplier is negative are released.

use nalgebra::{DMatrix, DVector};
use tiprub_model::{Error, Result};

use super::MethodRun;
use super::contact::{
    RingContact, SurfaceVectors, Vectors, add_to_loads, find, surface_at_rest, surface_forces, surface_of,
};
use super::operator::{BodyOperator, inner};
use super::recorder::{Recorder, StepEntry};
use crate::cube::history::CubeHistory;
use crate::cube::scene::CubeScene;

/// Options of this method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FilmOptions {
    /// True to release contacts with a negative multiplier and solve again for the others.
    pub release_tension: bool,
    /// True to solve the whole complementarity problem instead: masters that only the forces of others push in are
    /// included, too, and released ones may return. The paper does not do this.
    pub complementary: bool,
}

/// Masters closer than this are included in the complementarity problem (m).
const MARGIN: f64 = 1e-4;
/// A gap below the negative of this value (m) is a penetration in the complementarity problem.
const ROUNDING: f64 = 1e-14;
/// Largest number of exchanges of one contact in a complementarity problem.
const EXCHANGES: usize = 10_000;

impl Default for FilmOptions {
    fn default() -> Self {
        Self { release_tension: true, complementary: false }
    }
}

/// Runs the scene.
///
/// # Errors
/// The errors of [`super::CubeMethod::run`].
pub(crate) fn run(scene: &CubeScene, run: &MethodRun, options: FilmOptions) -> Result<CubeHistory> {
    let mut recorder = Recorder::new(scene, run, "film");
    let operator = BodyOperator::new(scene, 0.0)?;
    let rest = surface_at_rest(scene);
    operator.check_step(scene, run.step)?;
    recorder.prepared();
    let (h, square) = (run.step, run.step * run.step);
    // u₋₁ = u₀ − h v₀: initially there is neither strain nor contact.
    let mut now = scene.rest();
    let mut change: Vectors = scene.launch().map(|v| v.iter().map(|v| h * v).collect());
    for step in 0..=run.steps() {
        let elastic = operator.elastic(&now);
        let acceleration = operator.solve(scene, &elastic);
        for index in 0..3 {
            change[index].iter_mut().zip(&acceleration[index]).for_each(|(d, a)| *d -= square * a);
        }
        let predicted: Vectors =
            core::array::from_fn(|index| now[index].iter().zip(&change[index]).map(|(u, d)| u + d).collect());
        let moved = surface_of(scene, &predicted);
        let contacts = find(scene, &rest, &moved, if options.complementary { MARGIN } else { 0.0 });
        let mut forces = Vec::new();
        if !contacts.is_empty() {
            let slip = surface_of(scene, &change);
            forces = multipliers(scene, &operator, &contacts, &slip, square, options, &mut recorder)?;
            let mut loads = scene.rest();
            add_to_loads(scene, &surface_forces(scene, &contacts, &forces), square, &mut loads);
            let correction = operator.solve(scene, &loads);
            for index in 0..3 {
                change[index].iter_mut().zip(&correction[index]).for_each(|(d, c)| *d += c);
            }
        }
        let next: Vectors =
            core::array::from_fn(|index| now[index].iter().zip(&change[index]).map(|(u, d)| u + d).collect());
        recorder.note_forces(&contacts, &forces);
        if recorder.wants(step) {
            let velocity: Vectors = core::array::from_fn(|index| change[index].iter().map(|d| d / h).collect());
            let left = find(scene, &rest, &surface_of(scene, &next), 0.0);
            recorder.note_penetration(left.iter().fold(0.0, |largest, contact| largest.max(-contact.gap)));
            recorder.record(&StepEntry {
                time: step as f64 * h,
                displacements: &now,
                cube_velocity: &velocity[0],
                kinetic: operator.kinetic(&velocity),
                // With u_{n+1} as one factor, this energy plus the kinetic energy is conserved by central
                // differences.
                strain: (0..3).map(|index| 0.5 * inner(&next[index], &elastic[index])).sum(),
            });
        }
        now = next;
    }
    Ok(recorder.finish())
}

/// Solves eq. 11: λ from C_Nᵀ M⁻¹ C_NT h² λ = −g; returns forces (normal, tangential) in the frames.
fn multipliers(
    scene: &CubeScene,
    operator: &BodyOperator,
    contacts: &[RingContact],
    slip: &SurfaceVectors,
    square: f64,
    options: FilmOptions,
    recorder: &mut Recorder<'_>,
) -> Result<Vec<[f64; 3]>> {
    let directions: Vec<[f64; 3]> = contacts.iter().map(|contact| direction(scene, contact, slip)).collect();
    let delassus = operator.delassus(contacts, scene.masters);
    let entry = |a: usize, b: usize| -> f64 {
        square * (0..3).map(|j| delassus[(3 * a, 3 * b + j)] * directions[b][j]).sum::<f64>()
    };
    let solve = |active: &[usize]| -> Result<Vec<f64>> {
        if active.is_empty() {
            return Ok(Vec::new());
        }
        let matrix = DMatrix::from_fn(active.len(), active.len(), |i, j| entry(active[i], active[j]));
        let right = DVector::from_fn(active.len(), |i, _| -contacts[active[i]].gap);
        let solution = matrix.lu().solve(&right).ok_or_else(|| {
            Error::invalid("contact matrix of `film`", "it is singular", "Check the surfaces of the scene")
        })?;
        Ok(solution.iter().copied().collect())
    };
    let mut active: Vec<usize> = (0..contacts.len()).filter(|a| contacts[*a].gap < 0.0).collect();
    for _ in 0..EXCHANGES {
        recorder.iterations(1);
        let solution = solve(&active)?;
        let kept: Vec<usize> = if options.complementary {
            exchanged(&active, &solution, contacts, entry)
        } else {
            (0..active.len()).filter(|i| !options.release_tension || solution[*i] > 0.0).map(|i| active[i]).collect()
        };
        if kept == active {
            let mut forces = vec![[0.0; 3]; contacts.len()];
            for (multiplier, &contact) in solution.iter().zip(&active) {
                forces[contact] = directions[contact].map(|d| d * multiplier);
            }
            return Ok(forces);
        }
        active = kept;
    }
    let problem = format!("{} contacts did not converge after {EXCHANGES} exchanges", contacts.len());
    Err(Error::invalid("contact problem of `film`", problem, "Use a smaller step or less friction"))
}

/// Returns the active contacts after one exchange: the first contact that pulls or that would penetrate changes sides
/// (K. G. Murty's rule, which terminates for every P-matrix). Returns the same contacts if there is none.
fn exchanged(
    active: &[usize],
    multipliers: &[f64],
    contacts: &[RingContact],
    entry: impl Fn(usize, usize) -> f64,
) -> Vec<usize> {
    let wrong = (0..contacts.len()).find(|&a| match active.binary_search(&a) {
        Ok(place) => multipliers[place] < 0.0,
        Err(_) => {
            let pushed: f64 = active.iter().zip(multipliers).map(|(&b, multiplier)| entry(a, b) * multiplier).sum();
            contacts[a].gap + pushed < -ROUNDING
        }
    });
    let mut changed = active.to_vec();
    if let Some(a) = wrong {
        match active.binary_search(&a) {
            Ok(place) => {
                changed.remove(place);
            }
            Err(place) => changed.insert(place, a),
        }
    }
    changed
}

/// Returns the force per multiplier in the frame: the normal, and µ against the predicted sliding.
fn direction(scene: &CubeScene, contact: &RingContact, slip: &SurfaceVectors) -> [f64; 3] {
    let friction = scene.setting.friction;
    let master = slip[0][contact.side * scene.masters + contact.master];
    let mut relative = contact.relative(scene.masters, slip);
    relative[2] = master[2];
    let [_, along, across] = contact.local(relative);
    let length = along.hypot(across);
    if length == 0.0 || friction == 0.0 {
        return [1.0, 0.0, 0.0];
    }
    [1.0, -friction * along / length, -friction * across / length]
}

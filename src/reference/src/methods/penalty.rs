//! Central differences with a penalty: contact forces are springs between master and surface.

use tiprub_model::Result;

use super::MethodRun;
use super::contact::{RingContact, Vectors, add_to_loads, find, surface_at_rest, surface_forces, surface_of};
use super::operator::{BodyOperator, inner};
use super::recorder::{Recorder, StepEntry};
use crate::cube::history::CubeHistory;
use crate::cube::scene::CubeScene;

/// Options of this method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PenaltyOptions {
    /// Contact stiffness ε per node (N/m).
    pub stiffness: f64,
    /// Sliding speed below which friction is viscous (m/s).
    pub sticking_speed: f64,
}

impl Default for PenaltyOptions {
    /// Returns the penalty of the augmented Lagrangian; friction is regularised below 0.5 m/s.
    fn default() -> Self {
        Self { stiffness: 5e8, sticking_speed: 0.5 }
    }
}

/// Runs the scene.
///
/// # Errors
/// The errors of [`super::CubeMethod::run`].
pub(crate) fn run(scene: &CubeScene, run: &MethodRun, options: PenaltyOptions) -> Result<CubeHistory> {
    let mut recorder = Recorder::new(scene, run, "penalty");
    let operator = BodyOperator::new(scene, 0.0)?;
    let rest = surface_at_rest(scene);
    operator.check_step(scene, run.step)?;
    recorder.prepared();
    let h = run.step;
    let mut now = scene.rest();
    let mut velocity = scene.launch();
    for step in 0..=run.steps() {
        let elastic = operator.elastic(&now);
        let contacts = find(scene, &rest, &surface_of(scene, &now), 0.0);
        let slip = surface_of(scene, &velocity);
        let forces: Vec<[f64; 3]> = contacts
            .iter()
            .map(|contact| {
                spring(contact, contact.local(contact.relative(scene.masters, &slip)), scene.setting.friction, options)
            })
            .collect();
        let mut loads: Vectors = core::array::from_fn(|i| elastic[i].iter().map(|f| -f).collect());
        add_to_loads(scene, &surface_forces(scene, &contacts, &forces), 1.0, &mut loads);
        let acceleration = operator.solve(scene, &loads);
        for i in 0..3 {
            velocity[i].iter_mut().zip(&acceleration[i]).for_each(|(v, a)| *v += h * a);
        }
        let next: Vectors = core::array::from_fn(|i| now[i].iter().zip(&velocity[i]).map(|(u, v)| u + h * v).collect());
        let deepest = contacts.iter().fold(0.0, |largest: f64, contact| largest.max(-contact.gap));
        recorder.note_penetration(deepest);
        recorder.note_forces(&contacts, &forces);
        if recorder.wants(step) {
            recorder.record(&StepEntry {
                time: step as f64 * h,
                displacements: &now,
                cube_velocity: &velocity[0],
                kinetic: operator.kinetic(&velocity),
                strain: (0..3).map(|i| 0.5 * inner(&next[i], &elastic[i])).sum(),
            });
        }
        now = next;
    }
    Ok(recorder.finish())
}

fn spring(contact: &RingContact, sliding: [f64; 3], friction: f64, options: PenaltyOptions) -> [f64; 3] {
    let normal = -options.stiffness * contact.gap;
    let factor = -friction * normal / sliding[1].hypot(sliding[2]).max(options.sticking_speed);
    [normal, factor * sliding[1], factor * sliding[2]]
}

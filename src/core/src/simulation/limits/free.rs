//! Limits of a scene with a free master.
//!
//! Step limits are those of all structures. With sliding friction the contact problem of a step need not have one solution:
//! the undeformed master is moved along its flight, and the Delassus matrix of the nodes that are inside a surface there,
//! sliding along the velocity, is looked at. A node that friction alone jams is refused; a symmetric part that is not
//! positive definite is a warning, since it is sufficient and not necessary. Growth by sliding (flutter) is not looked
//! at: which contacts are closed, for how long and where is not known beforehand.

use nalgebra::DMatrix;

use super::{Limits, Parameters, Sense};
use crate::contact::free_gap::{FreeGap, tangent};
use crate::contact::gap::{GapLaw, Geometry, dot};
use crate::dynamics::modal::ModalModel;
use crate::settings::{Scheme, Solver};
use crate::simulation::compile::Compiled;
use crate::simulation::free::FreeParts;
use crate::stability::massless::MasslessLimit;
use crate::stability::{self, ContactDirections};
use crate::{Error, Result, shown};

/// The flight is looked at in this many places, this share of the extent apart.
const PLACES: u32 = 48;
const SPACING: f64 = 0.125;
/// And at these parts of the step.
const STEPS: [f64; 3] = [1.0, 0.25, 0.0625];
/// Eigenvalues above this (of a matrix with unit diagonal) are not negative.
const ROUNDING: f64 = -1e-10;

/// Nodes that are inside their surface somewhere on the flight.
struct Met {
    nodes: Vec<usize>,
    directions: ContactDirections,
    geometry: Geometry,
}

impl Compiled {
    pub(super) fn free_limits(&self, parameters: &Parameters, free: &FreeParts, law: &FreeGap) -> Limits {
        let step = self.expected_step(parameters.step);
        // Contacts of a free master may act along any direction.
        let unresolved = match parameters.scheme {
            Scheme::ModalExact => stability::unresolved::limit_along_axes(&self.model).min(self.unresolved(
                &[],
                parameters.scheme,
                |_| Vec::new(),
            )),
            _ => f64::INFINITY,
        };
        let resolved = stability::unresolved::check(step, unresolved, self.model.largest_frequency());
        let outcome = resolved.and_then(|()| self.free_warnings(parameters, free, law, step));
        let quiet = || Some(Sense { outcome: Ok(Vec::new()), ranges: Vec::new() });
        Limits {
            parameters: parameters.clone(),
            outcome,
            senses: [quiet(), quiet()],
            massless: MasslessLimit::NONE,
            casing: Vec::new(),
            unresolved,
        }
    }

    fn free_warnings(
        &self,
        parameters: &Parameters,
        free: &FreeParts,
        law: &FreeGap,
        step: f64,
    ) -> Result<Vec<String>> {
        let Parameters { friction, scheme, solver, velocity, .. } = *parameters;
        let mut warnings: Vec<String> =
            stability::check_step(self.model.largest_frequency(), scheme, step)?.into_iter().collect();
        for (pair, model) in free.pairs.iter().filter(|pair| pair.carrier.is_some()).zip(&free.carriers) {
            let name = &self.scene.settings.structures[pair.structure].name;
            let warning = stability::check_step(model.largest_frequency(), scheme, step)?;
            warnings.extend(warning.map(|warning| format!("{name}: {warning}")));
        }
        if friction == 0.0 || solver == Solver::Coulomb {
            return Ok(warnings);
        }
        let mut worst = 0.0_f64;
        for met in flight(law, velocity) {
            for part in STEPS {
                worst = worst.min(self.solvability(&met, parameters, free, law, part * step)?);
            }
        }
        if worst < ROUNDING {
            warnings.push(format!(
                "with µ = {friction} the contact problem cannot be shown to have one solution for all contacts that the flight \
                 of the undeformed structure leads to (the symmetric part of the Delassus matrix has the eigenvalue \
                 {worst:.2e} of its diagonal); a step whose problem is not solved is refused",
                friction = shown(friction)
            ));
        }
        Ok(warnings)
    }

    /// Lowest eigenvalue of the symmetric part of the Delassus matrix with unit diagonal.
    fn solvability(
        &self,
        met: &Met,
        parameters: &Parameters,
        free: &FreeParts,
        law: &FreeGap,
        step: f64,
    ) -> Result<f64> {
        let Parameters { friction, scheme, damping_ratio, .. } = *parameters;
        let mut model = self.model.with_nodes(&met.nodes);
        model.damping_ratios.fill(damping_ratio);
        let mut matrix = stability::delassus(&model, scheme, step, friction, &met.directions);
        for (carrier, modes) in free.carriers.iter().enumerate() {
            let mut seen = seen_by(carrier, modes, met, law);
            seen.damping_ratios.fill(parameters.slave_damping_ratios[carrier]);
            matrix += stability::delassus(&seen, scheme, step, friction, &met.directions);
        }
        let diagonal = matrix.diagonal();
        if let Some(jammed) = (0..met.nodes.len()).find(|member| diagonal[*member] <= 0.0) {
            let node = &self.master().1.contact_nodes[met.nodes[jammed]].name;
            return Err(Error::Unstable {
                problem: format!(
                    "with friction_coefficient µ = {friction} and an internal step of {step:.3e} s the contact of {node} alone has \
                     no unique solution on the flight: friction drives it into the surface",
                    friction = shown(friction)
                ),
                remedy: "Use less friction, another internal step, or the solver coulomb".to_owned(),
            });
        }
        let scaled = DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
            0.5 * (matrix[(i, j)] + matrix[(j, i)]) / (diagonal[i] * diagonal[j]).sqrt()
        });
        Ok(scaled.symmetric_eigenvalues().min())
    }
}

/// Where the undeformed master touches on its flight.
fn flight(law: &FreeGap, velocity: [f64; 3]) -> Vec<Met> {
    let speed = dot(velocity, velocity).sqrt();
    if speed == 0.0 {
        return Vec::new();
    }
    let nodes = law.nodes();
    // `largest` is a tenth of the extent.
    let spacing = 10.0 * SPACING * law.largest() / speed;
    let geometry = || GapLaw::Free(Box::new(law.clone())).geometry(1);
    let (mut gap, mut displacement) = (vec![0.0; nodes], vec![0.0; 3 * nodes]);
    let mut met = Vec::new();
    for place in 0..PLACES {
        let time = spacing * f64::from(place);
        for (row, value) in displacement.iter_mut().enumerate() {
            *value = time * velocity[row % 3];
        }
        let mut geometry = geometry();
        law.evaluate(&displacement, None, &mut geometry, &mut gap);
        // Beyond small displacements the master does not get there undeformed.
        let inside: Vec<usize> = (0..nodes).filter(|node| gap[*node] <= 0.0).collect();
        if inside.is_empty() {
            continue;
        }
        let direction = |node: &usize| {
            let normal = geometry.normal_at(*node);
            (normal, tangent(velocity, normal))
        };
        let directions = inside.iter().map(direction).collect();
        met.push(Met { nodes: inside, directions, geometry });
    }
    met
}

/// The modes of a carrier at the places of the contacts; zero for contacts with other surfaces.
fn seen_by(carrier: usize, modes: &ModalModel, met: &Met, law: &FreeGap) -> ModalModel {
    let mut contact_modes = DMatrix::zeros(3 * met.nodes.len(), modes.len());
    for (member, node) in met.nodes.iter().enumerate() {
        let Some(surface) = law.surface_of(*node).map(|index| &law.surfaces[index]) else { continue };
        if surface.carrier != Some(carrier) {
            continue;
        }
        for (point, weight) in surface.surface.weights(met.geometry.places[*node]).iter() {
            for component in 0..3 {
                let row = modes.contact_modes.row(3 * point + component) * weight;
                let mut target = contact_modes.row_mut(3 * member + component);
                target += row;
            }
        }
    }
    ModalModel { contact_modes, ..modes.clone() }
}

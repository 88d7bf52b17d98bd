//! Limits of a scene with a free master.
//!
//! The step limits are those of all structures. With sliding friction the contact problem of a step need not have exactly one solution: the
//! undeformed master is moved along its flight, and the Delassus matrix of the nodes that are inside a surface there, sliding along the
//! velocity, is checked. A node that friction alone locks is rejected; a symmetric part that is not positive definite causes a warning,
//! since the condition is sufficient and not necessary. Growth by sliding (flutter) is not checked: which contacts are closed, for how long
//! and where is unknown beforehand.

use nalgebra::DMatrix;

use super::{BodyLimits, Closing, Parameters};
use crate::geometry::Sliding;
use crate::geometry::open::OpenGap;
use crate::geometry::{GapLaw, Geometry, Vector3};
use crate::limits::finding::{Checked, ErrorKind, Finding, Subject, WarningKind};
use crate::limits::{self, ContactDirections, SlidingContacts};
use crate::math::vector::length;
use crate::modes::modal::ModalModel;
use crate::modes::modal::fill_ratios;
use crate::scene::method::Scheme;
use crate::simulation::compile::Compiled;
use crate::system::System;

/// Number of places at which the flight is checked, and their spacing as a fraction of the extent.
const PLACES: u32 = 48;
const SPACING: f64 = 0.125;
/// Fractions of the step that are checked.
const STEPS: [f64; 3] = [1.0, 0.25, 0.0625];
/// Flexibility below this fraction of the largest counts as zero.
const RIGID: f64 = 1e-9;
/// Eigenvalues above this (of a matrix with unit diagonal) count as not negative.
const ROUNDING: f64 = -1e-10;

/// Nodes that are inside their surface somewhere on the flight.
struct NodesInside {
    nodes: Vec<usize>,
    directions: ContactDirections,
    geometry: Geometry,
}

impl Compiled {
    pub(super) fn free_limits(&self, body: usize, parameters: &Parameters, system: &System) -> BodyLimits {
        let (step, model) = (self.expected_step(parameters.step), &self.bodies[body].model);
        let of = Subject::Body(body);
        // Contacts of free bodies may act along any direction.
        let own = std::iter::once_with(|| limits::unresolved::limit_along_axes(model));
        let unresolved = self.unresolved(body, own, parameters.scheme);
        // Adaptive steps that cannot be solved are halved.
        let outcome = if parameters.scheme.properties().adaptive {
            let rigid = rigid_directions(model, parameters.scheme);
            Ok(rigid.into_iter().map(|kind| kind.of(of)).collect())
        } else {
            let resolved = limits::unresolved::check(parameters.scheme, step, unresolved, model.largest_frequency());
            let flight = FlightCheck { compiled: self, system, body, parameters };
            resolved.map_err(|error| error.of(of)).and_then(|()| flight.warnings(step))
        };
        BodyLimits { outcome, unresolved, ..BodyLimits::new(of, Closing::of_run(self)) }
    }
}

/// Returns a warning if contact nodes without mass are rigid in some directions because of modes that follow contact immediately. Such
/// nodes need flexibility of their own, since they cannot yield when they are pressed together.
fn rigid_directions(model: &ModalModel, scheme: Scheme) -> Option<WarningKind> {
    let dynamic = model.dynamic_modes(scheme);
    let mut shapes = model.contact_modes.columns_range(dynamic..).into_owned();
    for (mut shape, frequency) in shapes.column_iter_mut().zip(&model.frequencies[dynamic..]) {
        shape /= *frequency;
    }
    let flexibility = (&shapes * shapes.transpose()).symmetric_eigenvalues();
    let rigid = flexibility.iter().filter(|value| **value <= RIGID * flexibility.max()).count();
    let (modes, directions) = (model.len() - dynamic, flexibility.len());
    (rigid > 0).then_some(WarningKind::RigidContact { scheme, modes, rigid, directions })
}

/// Check of a free body before its flight.
struct FlightCheck<'a> {
    compiled: &'a Compiled,
    system: &'a System,
    body: usize,
    parameters: &'a Parameters,
}

impl FlightCheck<'_> {
    fn warnings(&self, step: f64) -> Checked<Vec<Finding>> {
        let (compiled, scheme, of) = (self.compiled, self.parameters.scheme, Subject::Body(self.body));
        let largest = compiled.bodies[self.body].model.largest_frequency();
        let unresolved = limits::check_step(largest, scheme, step).map_err(|error| error.of(of))?;
        let mut warnings: Vec<Finding> = unresolved.into_iter().map(|kind| kind.of(of)).collect();
        warnings.extend(compiled.unresolved_carriers(self.body, scheme, step)?);
        let friction = self.parameters.friction_of(compiled, self.body);
        if friction == 0.0 || self.parameters.solver.sticks() {
            return Ok(warnings);
        }
        let pairs: Vec<usize> = compiled.plan.pairs_of(self.body).map(|(pair, _)| pair).collect();
        let mut laws: Vec<OpenGap> = Vec::new();
        for pair in &pairs {
            if let GapLaw::Open(gap) = self.system.pairs()[*pair].gap() {
                laws.push((**gap).clone());
            }
        }
        let carriers = pairs.iter().map(|pair| {
            let carrier = compiled.plan.pairs[*pair].carrier?;
            Some((carrier, compiled.control_modes_of(carrier, self.system.pairs()[*pair].gap())?))
        });
        let carriers: Vec<Option<(usize, ModalModel)>> = carriers.collect();
        let frictions: Vec<f64> = pairs.iter().map(|pair| self.parameters.friction[*pair]).collect();
        let mut worst = 0.0_f64;
        for met in flight(&mut laws, self.parameters.velocities[self.body].into(), &frictions, friction) {
            for part in STEPS {
                worst = worst.min(
                    self.solvability(&met, friction, &laws, &carriers, part * step).map_err(|error| error.of(of))?,
                );
            }
        }
        if worst < ROUNDING {
            warnings.push(WarningKind::FlightSolvability { friction, eigenvalue: worst }.of(of));
        }
        Ok(warnings)
    }

    /// Returns the lowest eigenvalue of the symmetric part of the Delassus matrix with unit diagonal.
    fn solvability(
        &self,
        met: &NodesInside,
        friction: f64,
        laws: &[OpenGap],
        carriers: &[Option<(usize, ModalModel)>],
        step: f64,
    ) -> Result<f64, ErrorKind> {
        let Parameters { scheme, damping_ratios, mode_damping, .. } = self.parameters;
        let mut model = self.compiled.bodies[self.body].model.with_nodes(&met.nodes);
        fill_ratios(&mut model.damping_ratios, damping_ratios[self.body], &mode_damping[self.body], 1);
        let mut matrix = limits::delassus(SlidingContacts::new(&model, friction, &met.directions), *scheme, step);
        for carrier in self.compiled.carriers_of(self.body) {
            let Some(mut seen) = seen_by(carrier, met, laws, carriers) else { continue };
            let place = self.compiled.bodies.len() + carrier;
            fill_ratios(&mut seen.damping_ratios, damping_ratios[place], &mode_damping[place], 1);
            matrix += limits::delassus(SlidingContacts::new(&seen, friction, &met.directions), *scheme, step);
        }
        let diagonal = matrix.diagonal();
        if let Some(jammed) = (0..met.nodes.len()).find(|member| diagonal[*member] <= 0.0) {
            return Err(ErrorKind::Jammed { friction, step, node: met.nodes[jammed] });
        }
        Ok(limits::lowest_eigenvalue(&matrix).unwrap_or(f64::NEG_INFINITY))
    }
}

/// Finds the contacts of the undeformed structure on its flight; slip directions are scaled by the ratio of the `frictions` of the pairs to
/// the largest.
fn flight(laws: &mut [OpenGap], velocity: Vector3, frictions: &[f64], largest: f64) -> Vec<NodesInside> {
    let speed = length(velocity);
    let Some(extent) = laws.first().map(|law| law.largest).filter(|_| speed != 0.0) else { return Vec::new() };
    let nodes = laws[0].positions.len();
    // `largest` is a tenth of the extent.
    let spacing = 10.0 * SPACING * extent / speed;
    let mut displacement = vec![0.0; 3 * nodes];
    let mut met = Vec::new();
    for place in 0..PLACES {
        let time = spacing * f64::from(place);
        for (row, value) in displacement.iter_mut().enumerate() {
            *value = time * velocity[row % 3];
        }
        let (mut geometry, mut gap) = (Geometry::new(nodes, true), vec![f64::INFINITY; nodes]);
        laws.iter_mut().for_each(|law| law.evaluate(&displacement, &[], None, &mut geometry, &mut gap));
        // Beyond small displacements the structure does not arrive undeformed.
        let inside: Vec<usize> = (0..nodes).filter(|node| gap[*node] <= 0.0).collect();
        if inside.is_empty() {
            continue;
        }
        let direction = |node: &usize| {
            let normal = geometry.normal_at(*node);
            let own = laws.iter().position(|law| law.nodes.contains(node)).map_or(largest, |law| frictions[law]);
            let share = if own < largest { own / largest } else { 1.0 };
            (normal, share * Sliding::new(velocity, normal).direction)
        };
        let directions = inside.iter().map(direction).collect();
        met.push(NodesInside { nodes: inside, directions, geometry });
    }
    met
}

/// Returns the modes of a carrier at the places of the contacts; zero for contacts with other surfaces.
fn seen_by(
    carrier: usize,
    met: &NodesInside,
    laws: &[OpenGap],
    carriers: &[Option<(usize, ModalModel)>],
) -> Option<ModalModel> {
    let of = |pair: usize| carriers[pair].as_ref().filter(|(own, _)| *own == carrier).map(|(_, modes)| modes);
    let first = (0..laws.len()).find_map(of)?;
    let mut contact_modes = DMatrix::zeros(3 * met.nodes.len(), first.len());
    for (member, node) in met.nodes.iter().enumerate() {
        let pair = laws.iter().position(|law| law.nodes.contains(node));
        let Some((law, modes)) = pair.and_then(|pair| Some((&laws[pair], of(pair)?))) else { continue };
        for (point, weight) in law.surface.weights(met.geometry.places[*node]).iter() {
            for component in 0..3 {
                let row = modes.contact_modes.row(3 * point + component) * weight;
                let mut target = contact_modes.row_mut(3 * member + component);
                target += row;
            }
        }
    }
    Some(ModalModel { contact_modes, ..first.clone() })
}

//! Checks of a rotating structure for one set of parameters: solvability, growth of sliding contact, and effects of casings.

use super::Parameters;
use super::known::{BodyChecks, CheckPart};
use crate::geometry::frame::PolarFrame;
use crate::geometry::spline::SplineGap;
use crate::geometry::{GapLaw, Vector3};
use crate::limits::finding::{Checked, ErrorKind, Finding, Subject, WarningKind};
use crate::limits::{self, ContactDirections};
use crate::math::real;
use crate::math::vector::vector3_at;
use crate::modes::cyclic::CyclicModel;
use crate::modes::modal::ModalModel;
use crate::modes::schemes::ModeCoefficients;
use crate::scene::method::Scheme;
use crate::scene::settings::Meridian;
use crate::simulation::clock::SAME_STEP;
use crate::simulation::compile::Compiled;
use crate::simulation::plan::PairPlan;
use crate::system::System;
use nalgebra::DMatrix;
use std::cell::LazyCell;

/// Up to this number of contact nodes, every combination is checked; for more nodes, single nodes, neighbouring pairs,
/// and all nodes together.
const ALL_COMBINATIONS_UP_TO: usize = 3;

/// Number of angles at which a flexible surface carrier is checked.
pub(super) const CARRIER_ANGLES: usize = 48;

pub(super) fn carrier_angle(place: usize) -> f64 {
    std::f64::consts::TAU * real(place) / real(CARRIER_ANGLES)
}

/// Returns the modes of the surface carrier along normals and tangents of `nodes` of a blade at `angle` (rad), nodes × modes; 0 for
/// nodes that do not face the carrier.
pub(super) fn carrier_at(
    law: &SplineGap,
    modes: &ModalModel,
    nodes: &[usize],
    angle: f64,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let zeros = || DMatrix::zeros(nodes.len(), modes.len());
    let mut seen = (zeros(), zeros());
    for (row, &node) in nodes.iter().enumerate().filter(|(_, node)| law.nodes.contains(node)) {
        let turned = angle + law.layout.angles[node * law.layout.lanes];
        let frame = PolarFrame::new(turned);
        let place = law.surface.locate(frame.fixed(Vector3::new(law.layout.radii[node], 0.0, law.layout.axial[node])));
        for (index, weight) in law.surface.weights(place).iter() {
            for mode in 0..modes.len() {
                let shape = frame.local(vector3_at(modes.contact_modes.column(mode).as_slice(), index));
                seen.0[(row, mode)] -= weight * shape[0];
                seen.1[(row, mode)] += weight * shape[1];
            }
        }
    }
    seen
}

/// Lowest eigenvalue of the symmetric part of the surface carrier's Delassus matrix, relative to the eigenvalue of
/// largest magnitude.
fn lowest_ratio(
    (normals, tangents): &(DMatrix<f64>, DMatrix<f64>),
    modes: &ModalModel,
    scheme: Scheme,
    step: f64,
    friction: f64,
) -> f64 {
    let compliance: Vec<f64> = modes.coefficients(scheme, step).iter().map(ModeCoefficients::load_compliance).collect();
    let forces = normals - tangents * friction;
    let weighted = DMatrix::from_fn(forces.nrows(), forces.ncols(), |i, mode| forces[(i, mode)] * compliance[mode]);
    let matrix = normals * weighted.transpose();
    let eigenvalues = ((&matrix + matrix.transpose()) * 0.5).symmetric_eigenvalues();
    let largest = eigenvalues.amax();
    if largest > 0.0 { eigenvalues.min() / largest } else { 0.0 }
}

/// A structure of a scene with some parameters, to be checked with all surfaces it touches.
pub(super) struct Checking<'a> {
    pub(super) compiled: &'a Compiled,
    system: &'a System,
    pub(super) body: usize,
    /// Contact nodes that can touch a surface.
    pub(super) nodes: Vec<usize>,
    /// Structures into which the contact problem with all sectors closed decouples: one uncoupled sector, or the nodal diameters as real
    /// structures; observed at these nodes.
    pub(super) models: Vec<ModalModel>,
    pub(super) parameters: &'a Parameters,
    /// Largest friction coefficient.
    pub(super) friction: f64,
    /// Stored results.
    pub(super) known: BodyChecks<'a>,
}

impl<'a> Checking<'a> {
    pub(super) fn new(
        compiled: &'a Compiled,
        system: &'a System,
        models: Vec<ModalModel>,
        parameters: &'a Parameters,
        known: BodyChecks<'a>,
    ) -> Self {
        let body = known.body;
        let own = compiled.body(body).1.contact_nodes.len();
        let meets = |node: &usize| compiled.plan.pairs_of(body).any(|(_, pair)| pair.nodes.contains(node));
        let nodes: Vec<usize> = (0..own).filter(meets).collect();
        let seen = |model: ModalModel| {
            let parts = model.contact_modes.nrows() / (3 * own);
            let places = (0..parts).flat_map(|part| nodes.iter().map(move |node| part * own + node));
            if nodes.len() == own { model } else { model.with_nodes(&places.collect::<Vec<_>>()) }
        };
        Self {
            models: models.into_iter().map(seen).collect(),
            friction: parameters.friction_of(compiled, body),
            compiled,
            system,
            body,
            nodes,
            parameters,
            known,
        }
    }

    pub(super) fn disk(&self) -> Option<&CyclicModel> {
        self.compiled.bodies[self.body].disk.as_ref()
    }

    /// Returns the surfaces that carriers deform: gap functions, and modes of the carriers at their control points.
    pub(super) fn carried(&self) -> Vec<(&SplineGap, usize, ModalModel)> {
        let carried = |(index, pair): (usize, &PairPlan)| {
            let (gap, carrier) = (self.system.pairs()[index].gap(), pair.carrier?);
            let GapLaw::Spline(spline) = gap else { return None };
            Some((&**spline, carrier, self.compiled.control_modes_of(carrier, gap)?))
        };
        self.compiled.plan.pairs_of(self.body).filter_map(carried).collect()
    }

    /// Returns the subject of findings about the structure.
    pub(super) fn subject(&self) -> Subject {
        Subject::Body(self.body)
    }

    /// Returns all warnings at the expected step (s), for both senses of slip. The findings `carriers` and `more` come
    /// last.
    pub(super) fn warnings(
        &self,
        step: f64,
        carriers: Option<WarningKind>,
        more: Vec<WarningKind>,
    ) -> Checked<Vec<Finding>> {
        let Parameters { scheme, step: largest, .. } = *self.parameters;
        let own = |error: ErrorKind| error.of(self.subject());
        let unresolved = limits::check_step(self.largest_frequency(), scheme, step).map_err(own)?;
        let senses: Vec<Vec<ContactDirections>> =
            self.models.iter().map(|model| [1.0, -1.0].map(|sense| self.directions(model, sense)).into()).collect();
        let solvable = || match self.disk() {
            Some(_) => limits::check_solvable_together(&self.models, scheme, largest, self.friction, &senses),
            None => limits::check_solvable(&self.models[0], scheme, largest, self.friction, &senses[0]),
        };
        let mut refused = None;
        let mut checked = || solvable().map_err(|error| refused = Some(error)).ok().map(|()| true);
        if self.known.get(CheckPart::Solvable, &[], &mut checked).is_none() {
            refused.map_or_else(solvable, Err).map_err(own)?;
        }
        let of_carriers = self.compiled.unresolved_carriers(self.body, scheme, step)?;
        let first = unresolved.into_iter().chain(self.not_looked_at()).map(|kind| kind.of(self.subject()));
        let last = carriers.into_iter().chain(more).map(|kind| kind.of(self.subject()));
        Ok(first.chain(of_carriers).chain(last).collect())
    }

    /// Returns the warning that growth is not checked, if there are more modes than its eigenproblems are solved for.
    pub(super) fn not_looked_at(&self) -> Option<WarningKind> {
        let modes = self.models.iter().map(ModalModel::len).max().unwrap_or(0);
        (self.friction != 0.0 && modes > limits::GROWTH_UP_TO)
            .then_some(WarningKind::GrowthUnchecked { scheme: self.parameters.scheme, modes })
    }

    /// Returns the warning of vibration that grows while all contact nodes of a blade cut, sliding in either sense.
    pub(super) fn cutting(&self) -> Option<WarningKind> {
        let (pair, _) = self.compiled.plan.pairs_of(self.body).next()?;
        let coating = self.system.coating(pair)?;
        let own = coating.cut_stiffness()?;
        let growth = |sense: f64| {
            let of = |model: &ModalModel| {
                let directions = self.directions(model, sense);
                let parts = directions.len() / own.nrows();
                let all = DMatrix::identity(parts, parts).kronecker(&own);
                let found = limits::cutting::growth(model, &directions, &all, coating.tangential_ratio())?;
                (found.rate > limits::GROWTH_NOISE / self.parameters.step).then_some(found)
            };
            self.models.iter().filter_map(of).max_by(|a, b| a.rate.total_cmp(&b.rate))
        };
        let fastest = || {
            let both = [1.0, -1.0].into_iter().filter_map(growth);
            both.max_by(|a, b| a.rate.total_cmp(&b.rate))
        };
        self.known.get(CheckPart::Cutting, &[], fastest).map(WarningKind::CuttingGrowth)
    }

    /// Checks whether the compliance of the surface carriers makes the contact problem unsolvable, at the expected step
    /// and at all other steps.
    pub(super) fn carriers(&self, expected: f64) -> Vec<(f64, Option<WarningKind>)> {
        let carried = self.carried();
        if self.friction == 0.0 || carried.is_empty() || self.parameters.solver.sticks() {
            return Vec::new();
        }
        let places = |(gap, _, modes): &(&SplineGap, usize, ModalModel)| {
            (0..CARRIER_ANGLES).map(|place| carrier_at(gap, modes, &gap.nodes, carrier_angle(place))).collect()
        };
        let places = LazyCell::new(|| carried.iter().map(places).collect::<Vec<Vec<_>>>());
        let compute = |step: f64| {
            let (mut worst, mut at) = (0.0, 0.0);
            for ((_, _, modes), places) in carried.iter().zip(places.iter()) {
                for (place, seen) in (0..).zip(places) {
                    for sense in [1.0, -1.0] {
                        let ratio = lowest_ratio(seen, modes, self.parameters.scheme, step, sense * self.friction);
                        if ratio < worst {
                            (worst, at) = (ratio, carrier_angle(place));
                        }
                    }
                }
            }
            Some([worst, at])
        };
        let worst_at = |step: f64| {
            let [eigenvalue, angle] = self.known.get(CheckPart::Carriers, &[step.to_bits()], || compute(step))?;
            let friction = self.friction;
            (eigenvalue < -1e-9).then_some(WarningKind::CasingSolvability { friction, step, eigenvalue, angle })
        };
        let largest = carried.iter().map(|(_, _, modes)| modes.largest_frequency()).fold(0.0, f64::max);
        let is_other = |step: &f64| (step - expected).abs() > SAME_STEP * expected;
        let mut steps: Vec<f64> = limits::growth_steps(largest, self.parameters.step).filter(is_other).collect();
        steps.push(expected);
        steps.sort_by(f64::total_cmp);
        steps.reverse();
        steps.into_iter().map(|step| (step, worst_at(step))).collect()
    }

    pub(super) fn largest_frequency(&self) -> f64 {
        self.models.iter().fold(0.0, |largest, model| f64::max(largest, model.largest_frequency()))
    }

    /// Normals and slip directions of the contact nodes of one of the models on a round casing; slip directions are scaled by the ratio of
    /// the friction coefficient to the largest one. Both parts of a nodal diameter have the same directions.
    pub(super) fn directions(&self, model: &ModalModel, sense: f64) -> ContactDirections {
        let rom = self.compiled.body(self.body).1;
        let nodes = self.nodes.iter().cycle().take(model.contact_modes.nrows() / 3);
        nodes
            .map(|node| {
                let contour = self.compiled.contact(self.pair_at(*node)).meridian == Meridian::Contour;
                let slope = if contour { rom.contact_nodes[*node].meridional_slope } else { 0.0 };
                let length = (1.0 + slope * slope).sqrt();
                let friction = self.friction_at(*node);
                let share = if friction < self.friction { friction / self.friction } else { 1.0 };
                (Vector3::new(-1.0 / length, 0.0, slope / length), Vector3::new(0.0, share * sense, 0.0))
            })
            .collect()
    }

    /// The pair of a contact node.
    fn pair_at(&self, node: usize) -> usize {
        let pair = self.compiled.plan.pairs_of(self.body).find(|(_, pair)| pair.nodes.contains(&node));
        pair.map_or(0, |(pair, _)| pair)
    }

    pub(super) fn friction_at(&self, node: usize) -> f64 {
        self.parameters.friction[self.pair_at(node)]
    }

    pub(super) fn normals(&self, model: &ModalModel) -> Vec<Vector3> {
        self.directions(model, 1.0).into_iter().map(|(normal, _)| normal).collect()
    }

    /// Sets of closed contact nodes: all combinations of a few; for many nodes each alone, neighbours, and all; for a disk, on all sectors,
    /// each alone and all.
    pub(super) fn combinations(&self) -> Vec<Vec<usize>> {
        let nodes = self.nodes.len();
        if self.disk().is_some() {
            let all = (nodes > 1).then(|| (0..nodes).collect());
            return (0..nodes).map(|node| vec![node]).chain(all).collect();
        }
        if nodes <= ALL_COMBINATIONS_UP_TO {
            let members = |set: usize| (0..nodes).filter(|node| set >> node & 1 == 1).collect();
            return (1..1 << nodes).map(members).collect();
        }
        let alone = (0..nodes).map(|node| vec![node]);
        let pairs = (1..nodes).map(|node| vec![node - 1, node]);
        alone.chain(pairs).chain([(0..nodes).collect()]).collect()
    }
}

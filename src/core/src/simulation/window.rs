//! Sums over one communication step: impulses, extremes, friction heat.

use tiprub_cosim::persist_fields;

use super::patches::HeatPatches;
use super::spline_surface::Lining;
use crate::geometry::Vector3;
use crate::modes::bank::ModalBank;
use crate::scene::settings::OutputSettings;
use crate::system::{Structure, System};

/// Sums and extremes of a master since the communication step began, `[node · lanes + lane]`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct BodyWindow {
    /// Smallest gap of every node (m).
    pub lowest: Vec<f64>,
    /// ∫λ dt per node (N·s).
    pub normal_impulse: Vec<f64>,
    /// ∫µλ dt per node (N·s).
    pub tangential_impulse: Vec<f64>,
    /// ∫F dt along fixed x, y, z (N·s).
    pub force_impulse: Vector3,
    /// ∫M dt about fixed x, y, z (N·m·s): through the centre of the shaft, or about the origin if there is no rotation.
    pub moment_impulse: Vector3,
}

/// Sums and extremes of a contact pair.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PairWindow {
    /// ∫F dt on the master, along x, y, z (N·s).
    pub force_impulse: Vector3,
    /// ∫M dt (N·m·s), about the same point as for the structure.
    pub moment_impulse: Vector3,
    /// Friction heat (J).
    pub friction_heat: f64,
    /// Friction heat per patch (J); empty if the scene has no patches.
    pub patch_heat: Vec<f64>,
    /// ∫M dt on the master about the origin (N·m·s); empty unless requested.
    pub casing_moment: Vec<f64>,
}

/// Sums of a surface carrier, per mode.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SupportWindow {
    /// ∫q dt.
    pub moved: Vec<f64>,
    /// Velocity when the communication step began.
    pub speeds: Vec<f64>,
    /// ∫M dt of the contact forces on the master, beyond that of the same forces on the mesh (N·m·s).
    pub lining: Vector3,
}

/// Sums and extremes since the communication step began.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StepWindow {
    /// Windows of the masters.
    pub bodies: Vec<BodyWindow>,
    /// Windows of the pairs.
    pub pairs: Vec<PairWindow>,
    /// Windows of the structures that carry surfaces; empty unless requested.
    pub supports: Vec<SupportWindow>,
    /// Friction heat (J).
    pub friction_heat: f64,
    /// Largest λ (N).
    pub normal_peak: f64,
}

persist_fields!(BodyWindow { lowest, normal_impulse, tangential_impulse, force_impulse.data.0, moment_impulse.data.0 });
persist_fields!(PairWindow { force_impulse.data.0, moment_impulse.data.0, friction_heat, patch_heat, casing_moment });
persist_fields!(SupportWindow { moved, speeds, lining.data.0 });
persist_fields!(StepWindow { bodies, pairs, supports, friction_heat, normal_peak });

impl StepWindow {
    /// Allocates sums for the contact nodes of all structures and the patches of all pairs.
    pub fn new(structures: &[Structure], patches: &[Option<HeatPatches>], outputs: &OutputSettings) -> Self {
        let body = |structure: &Structure| {
            let len = structure.gaps().len();
            BodyWindow {
                lowest: vec![f64::INFINITY; len],
                normal_impulse: vec![0.0; len],
                tangential_impulse: vec![0.0; len],
                force_impulse: Vector3::zeros(),
                moment_impulse: Vector3::zeros(),
            }
        };
        let pair = |patches: &Option<HeatPatches>| PairWindow {
            force_impulse: Vector3::zeros(),
            moment_impulse: Vector3::zeros(),
            friction_heat: 0.0,
            patch_heat: vec![0.0; patches.as_ref().map_or(0, HeatPatches::len)],
            casing_moment: vec![0.0; if outputs.casing_forces { 3 } else { 0 }],
        };
        let support = |structure: &Structure| {
            let modes = structure.bank().map_or(0, ModalBank::modes);
            SupportWindow { moved: vec![0.0; modes], speeds: vec![0.0; modes], lining: Vector3::zeros() }
        };
        let carriers = structures.iter().filter(|structure| outputs.support_reaction && structure.nodes() == 0);
        Self {
            bodies: structures.iter().filter(|structure| structure.nodes() > 0).map(body).collect(),
            pairs: patches.iter().map(pair).collect(),
            supports: carriers.map(support).collect(),
            friction_heat: 0.0,
            normal_peak: 0.0,
        }
    }

    /// Starts a new window, which includes the gaps at its beginning.
    pub fn open(&mut self, structures: &[Structure]) {
        for (body, structure) in self.bodies.iter_mut().zip(structures) {
            body.lowest.copy_from_slice(structure.gaps());
            body.normal_impulse.fill(0.0);
            body.tangential_impulse.fill(0.0);
            (body.force_impulse, body.moment_impulse) = (Vector3::zeros(), Vector3::zeros());
        }
        for pair in &mut self.pairs {
            (pair.force_impulse, pair.moment_impulse) = (Vector3::zeros(), Vector3::zeros());
            pair.friction_heat = 0.0;
            pair.patch_heat.fill(0.0);
            pair.casing_moment.fill(0.0);
        }
        let carriers = structures.iter().filter(|structure| structure.nodes() == 0);
        for (support, structure) in self.supports.iter_mut().zip(carriers) {
            support.moved.fill(0.0);
            support.lining = Vector3::zeros();
            for (mode, speed) in support.speeds.iter_mut().enumerate() {
                *speed = speed_of(structure, mode);
            }
        }
        (self.friction_heat, self.normal_peak) = (0.0, 0.0);
    }

    /// Adds the last internal step, of length `step` (s).
    pub fn add(&mut self, system: &System, (patches, linings): (&[Option<HeatPatches>], &[Option<Lining>]), step: f64) {
        for (body, structure) in self.bodies.iter_mut().zip(system.structures()) {
            for (lowest, gap) in body.lowest.iter_mut().zip(structure.lowest_gaps()) {
                *lowest = if *gap < *lowest { *gap } else { *lowest };
            }
        }
        let carriers = system.structures().iter().filter(|structure| structure.nodes() == 0);
        for (support, structure) in self.supports.iter_mut().zip(carriers) {
            for (mode, moved) in support.moved.iter_mut().enumerate() {
                // Forces of the step belong to its beginning.
                let (now, increment) = structure.modes().modal_state(mode, 0);
                *moved += step * (now - increment);
            }
        }
        for event in system.events() {
            self.normal_peak = self.normal_peak.max(event.peak);
        }
        for event in system.acted() {
            let index = system.structures()[event.structure].index(event.node, event.sector);
            let (body, pair) = (&mut self.bodies[event.structure], &mut self.pairs[event.pair]);
            body.normal_impulse[index] += event.normal * step;
            body.tangential_impulse[index] += event.tangential * step;
            for (sum, term) in [
                (&mut body.force_impulse, event.wrench.force),
                (&mut body.moment_impulse, event.wrench.moment),
                (&mut pair.force_impulse, event.wrench.force),
                (&mut pair.moment_impulse, event.wrench.moment),
            ] {
                *sum += step * term;
            }
            if !pair.casing_moment.is_empty() {
                let moment = event.wrench.point.cross(&event.wrench.force);
                pair.casing_moment.iter_mut().zip(&moment).for_each(|(sum, term)| *sum += step * term);
            }
            if let Some(lining) = linings.get(event.pair).and_then(Option::as_ref) {
                let moment = lining.moment(event.wrench.point, event.wrench.force);
                self.supports[lining.carrier].lining += step * moment;
            }
            self.friction_heat += event.friction_heat;
            pair.friction_heat += event.friction_heat;
            if let Some(patches) = &patches[event.pair] {
                let [x, y, z] = event.wrench.point.into();
                pair.patch_heat[patches.find(libm::atan2(y, x), z)] += event.friction_heat;
            }
        }
    }

    /// Smallest gaps of all structures, one after the other.
    pub(crate) fn all_lowest(&self) -> Vec<f64> {
        self.bodies.iter().flat_map(|body| &body.lowest).copied().collect()
    }
}

/// Velocity of a mode of a surface carrier.
pub(crate) fn speed_of(structure: &Structure, mode: usize) -> f64 {
    let step = structure.modes().step();
    if step > 0.0 { structure.modes().modal_state(mode, 0).1 / step } else { 0.0 }
}

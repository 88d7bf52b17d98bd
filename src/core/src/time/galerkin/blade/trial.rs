//! Scratch memory and results of trials of a blade.

use super::accept::{Advance, BeginNextStep, FindModalForces};
use super::contact_free::SlowModeGaps;
use super::follow::PathPoint;
use super::level::BladeLevel;
use super::meridional::FindMeridional;
use super::minima::{Search, SelectFollowed};
use super::reach::{Energy, FindClearance, FindReach};
use super::rows::BladeRows;
use super::solve::Attempt;
use super::start::FindStart;
use super::surface::FacedSurface;
use crate::geometry::layout::Layout;
use crate::math::octet::Eight;
use crate::math::simd::InstructionSet;
use crate::math::vector::{set_vector3_at, vector3_at};
use crate::system::EvaluatedBlocks;
use crate::time::galerkin::basis::MOST;
use crate::time::galerkin::parts::STORED_TIMES;
use crate::time::galerkin::record::ShaftBounds;
use crate::time::galerkin::state::SectorState;
use crate::time::galerkin::tables::HALVINGS;
use crate::time::galerkin::trial::TrialResult;
use nalgebra::Vector2;
use std::mem::replace;

/// Angles of the nodes of a sector in the frame of the rotor (rad), and their sines and cosines.
#[derive(Debug, Clone)]
pub(super) struct NodeAngles {
    angles: Vec<Eight>,
    sines: Vec<Eight>,
    cosines: Vec<Eight>,
}

impl NodeAngles {
    /// Computes the angles of the nodes of a sector.
    pub fn new(layout: &Layout, sector: usize) -> Self {
        let angles: Vec<f64> = layout.angles.chunks_exact(layout.lanes).map(|row| row[sector]).collect();
        let of = |values: &dyn Fn(f64) -> f64| {
            let mut target = vec![Eight::ZERO; Eight::blocks(angles.len())];
            Eight::spread(angles.iter().map(|angle| values(*angle)), 0.0, &mut target);
            target
        };
        Self { angles: of(&|angle| angle), sines: of(&libm::sin), cosines: of(&libm::cos) }
    }
}

/// Contacts at the start of a step, in blocks of nodes.
#[derive(Debug, Clone)]
pub(super) struct StartContacts {
    /// q and q̇.
    pub modes: [Vec<Eight>; 2],
    /// Forces along the closing and the circumferential displacement (N), and λ'.
    pub forces: [Vec<Eight>; 2],
    pub multipliers: Vec<Eight>,
    /// Change of λ' per second over the last step.
    pub slopes: Vec<Eight>,
    /// Displacements of the modes without inertia under the forces (m).
    pub held: [Vec<Eight>; 2],
    /// Closing and circumferential displacement (m), F (m) and σ.
    pub moved: [Vec<Eight>; 2],
    pub gaps: Vec<Eight>,
    pub sigma: Vec<Eight>,
    /// µ; negative if the node slides towards negative circumferential displacements.
    pub friction: Vec<Eight>,
    /// True if a contact force acts.
    pub pushed: bool,
}

/// Scratch memory and results of trials, in blocks of lanes; allocates only on creation.
#[derive(Debug, Clone)]
pub(crate) struct BladeTrial {
    pub(super) start: StartContacts,
    /// Contacts and modes at a time within the accepted step, and rates of the gaps (m/s).
    pub(super) sample: StartContacts,
    pub(super) rates: Vec<Eight>,
    /// Rates of the gaps at the previous time (m/s).
    pub(super) rates_before: Vec<Eight>,
    /// Angles of the nodes in the frame of the rotor (rad).
    pub(super) angles: Vec<Eight>,
    /// Sines and cosines of these angles.
    pub(super) directions_of_nodes: [Vec<Eight>; 2],
    /// Contact rows with a force in the tried step: index of the first block of their mode shapes, and coefficients of θᵃ of the
    /// force (N).
    pub(super) loaded_rows: Vec<(usize, [f64; MOST])>,
    /// Coefficients of θᵃ of the modal forces.
    pub(super) modal_forces: [Vec<Eight>; MOST],
    /// Modal displacements at the points.
    pub(super) modal: [Vec<Eight>; MOST],
    /// Closing and circumferential displacements (m).
    pub(super) moved: [Vec<Eight>; 2],
    /// Circumferential displacements about which the shape of the surface is expanded, relative to the motion without
    /// forces (m).
    pub(super) held: Vec<Eight>,
    /// Clearance including the shape (m), σ, and the coefficient of the squared circumferential displacement in F
    /// (1/m).
    pub(super) clear: Vec<Eight>,
    pub(super) sigma: Vec<Eight>,
    pub(super) bend: Vec<Eight>,
    /// F without forces, and the contribution of the curvature to F (m).
    pub(super) open: Vec<Eight>,
    pub(super) curved: Vec<Eight>,
    /// Circumferential displacements that the forces cause (m).
    pub(super) turned: Vec<Eight>,
    /// Components of the force per unit λ'.
    pub(super) directions: [Vec<Eight>; 2],
    /// F and circumferential displacements of all lanes per unit λ' of each lane.
    pub(super) closing: Vec<Eight>,
    pub(super) around: Vec<Eight>,
    /// Columns of the contact problem, and its members.
    pub(super) matrix: Vec<Eight>,
    pub(super) members: Vec<usize>,
    /// Masks of the members, of the lanes whose columns are computed, and of the open lanes that penetrate without
    /// forces.
    pub(super) active: Vec<u8>,
    pub(super) prepared: Vec<u8>,
    pub(super) later: Vec<u8>,
    /// Meridional displacements at the start of the step and at the points (m); zero unless the shaft can move.
    pub(super) meridional: Vec<Eight>,
    /// F, λ' and forces.
    pub(super) gaps: Vec<Eight>,
    pub(super) multipliers: Vec<Eight>,
    pub(super) forces: [Vec<Eight>; 2],
    /// Mask of the followed nodes, which may come closer between the points.
    pub(super) followed: Vec<u8>,
    /// Motion of the followed nodes at times within the step.
    pub(super) path: Vec<PathPoint>,
    /// Largest interpolation error of each mode.
    pub(super) mode_bounds: Vec<Eight>,
    /// Amplitude of each mode times its largest closing displacement of a node (m).
    pub(super) amplitudes: Vec<Eight>,
    /// Closing and circumferential displacements (m), each followed by the velocities (m/s).
    pub(super) path_moved: [Vec<Eight>; 2],
    /// Rows with an impulse error: index of the first block of the row in the error form, and the error (N·s).
    pub(super) error_rows: Vec<(usize, f64)>,
    /// Impulse errors along the closing displacement, then along the circumferential one (N·s).
    pub(super) impulses: Vec<Eight>,
    /// True if a contact force acts in the step.
    pub(super) pushes: bool,
    /// True if the modal forces are those of the tried step.
    pub(super) forces_known: bool,
    /// Largest interpolation error of the motion between the points of the tried step (m), if it is known.
    pub(super) unresolved: Option<f64>,
    /// Largest closing and circumferential displacements at any time without contact (m).
    pub(super) reach: [Vec<Eight>; 2],
    /// Amplitudes of the modes while no contact acts.
    pub(super) free_amplitudes: Vec<Eight>,
    /// Bounds on the distance of the closing displacements without contact from the cubics of the slow modes (m) per level of
    /// steps, and mask of the levels whose bounds are known.
    pub(super) cubic_errors: Vec<Vec<Eight>>,
    pub(super) cubic_errors_known: u16,
    /// Lower bounds of the gaps over the last step without a trial, or over an open step (m).
    pub(super) gap_bounds: Vec<Eight>,
    /// Gaps at the start and at the end of the last step without a trial.
    pub(super) slow_mode_gaps: [SlowModeGaps; 2],
    pub(super) instructions: InstructionSet,
    /// Blocks of nodes evaluated since the counts were last taken.
    pub(super) evaluated: EvaluatedBlocks,
}

impl BladeTrial {
    /// Allocates memory for a blade with these rows, and steps of up to `degree` points.
    pub fn new(rows: &BladeRows, degree: usize) -> Self {
        let (nodes, lanes) = (rows.blocks, degree * rows.blocks);
        let (of_nodes, of_lanes) = (|| vec![Eight::ZERO; nodes], || vec![Eight::ZERO; lanes]);
        let of_modes = || vec![Eight::ZERO; rows.mode_blocks];
        let count = degree * rows.nodes;
        Self {
            start: StartContacts::new(nodes, rows.mode_blocks),
            sample: StartContacts::new(nodes, rows.mode_blocks),
            rates: of_nodes(),
            rates_before: of_nodes(),
            angles: of_nodes(),
            directions_of_nodes: [of_nodes(), of_nodes()],
            loaded_rows: Vec::with_capacity(2 * rows.nodes),
            modal_forces: std::array::from_fn(|_| of_modes()),
            modal: std::array::from_fn(|_| of_modes()),
            moved: [of_lanes(), of_lanes()],
            held: of_nodes(),
            clear: of_lanes(),
            sigma: of_lanes(),
            bend: of_lanes(),
            open: of_lanes(),
            curved: of_lanes(),
            turned: of_lanes(),
            directions: [of_lanes(), of_lanes()],
            closing: vec![Eight::ZERO; lanes * 8 * lanes],
            around: vec![Eight::ZERO; lanes * 8 * lanes],
            matrix: vec![Eight::ZERO; (count + 1) * Eight::blocks(count)],
            members: Vec::with_capacity(count),
            active: vec![0; lanes],
            prepared: vec![0; lanes],
            later: vec![0; lanes],
            meridional: vec![Eight::ZERO; nodes + lanes],
            gaps: of_lanes(),
            multipliers: of_lanes(),
            forces: [of_lanes(), of_lanes()],
            followed: vec![0; nodes],
            path: vec![PathPoint::new(nodes, rows.mode_blocks); STORED_TIMES],
            mode_bounds: of_modes(),
            amplitudes: of_modes(),
            unresolved: None,
            forces_known: false,
            path_moved: [0, 1].map(|_| vec![Eight::ZERO; 2 * nodes]),
            error_rows: Vec::with_capacity(2 * rows.nodes),
            impulses: vec![Eight::ZERO; 2 * nodes],
            pushes: false,
            reach: [of_nodes(), of_nodes()],
            free_amplitudes: of_modes(),
            cubic_errors: vec![of_nodes(); HALVINGS + 1],
            cubic_errors_known: 0,
            gap_bounds: of_nodes(),
            slow_mode_gaps: [SlowModeGaps::new(nodes), SlowModeGaps::new(nodes)],
            instructions: InstructionSet::detect(),
            evaluated: EvaluatedBlocks::default(),
        }
    }

    /// Selects the sector whose nodes have these angles.
    pub(crate) fn turn_to(&mut self, angles: &NodeAngles) {
        self.angles.copy_from_slice(&angles.angles);
        self.directions_of_nodes[0].copy_from_slice(&angles.sines);
        self.directions_of_nodes[1].copy_from_slice(&angles.cosines);
    }

    /// Reads the state of a sector at the start of a span.
    pub fn read(&mut self, rows: &BladeRows, state: &SectorState) {
        self.unresolved = None;
        let start = &mut self.start;
        Eight::spread(state.position.iter().copied(), 0.0, &mut start.modes[0]);
        Eight::spread(state.velocity.iter().copied(), 0.0, &mut start.modes[1]);
        let StartContacts { forces: [closing, around], multipliers, slopes, sigma, .. } = start;
        // Entries without a node are part of saved states, so they must not depend on earlier trials.
        [closing, around, multipliers, slopes, sigma].into_iter().for_each(|blocks| blocks.fill(Eight::ZERO));
        start.pushed = false;
        for node in 0..rows.nodes {
            let force = rows.in_plane(vector3_at(&state.forces, node));
            let (block, at) = (node / 8, node % 8);
            (0..2).for_each(|along| start.forces[along][block].0[at] = force[along]);
            // The closing component of λ' ∇F is λ'; friction adds to this component.
            let normal = vector3_at(&state.normals, node);
            start.multipliers[block].0[at] = state.multipliers[node] * -normal[0];
            start.sigma[block].0[at] = if normal[0] < 0.0 { normal[1] / -normal[0] } else { 0.0 };
            start.pushed |= state.multipliers[node] > 0.0;
        }
    }

    /// Writes modes and contacts to a state. The gaps must be known.
    pub(super) fn write(rows: &BladeRows, contacts: &StartContacts, state: &mut SectorState) {
        let flat = |blocks: &[Eight], to: &mut [f64]| {
            to.iter_mut().zip(blocks.iter().flat_map(|block| block.0)).for_each(|(to, value)| *to = value);
        };
        flat(&contacts.modes[0], &mut state.position);
        flat(&contacts.modes[1], &mut state.velocity);
        state.gaps_known = true;
        let StartContacts { multipliers, sigma, gaps, forces: [closing, around], .. } = contacts;
        [&mut state.forces, &mut state.normals, &mut state.multipliers].into_iter().for_each(|values| values.fill(0.0));
        for node in 0..rows.nodes {
            let (block, i) = (node / 8, node % 8);
            let of = |values: &[Eight]| values[block].0[i];
            let (multiplier, sigma, steepness) = (of(multipliers), of(sigma), of(&rows.steepness));
            let length = (steepness * steepness + sigma * sigma).sqrt();
            state.gaps[node] = of(gaps) / length;
            if multiplier > 0.0 {
                let force = Vector2::new(of(closing), of(around));
                set_vector3_at(&mut state.forces, node, rows.in_space(node, force));
                set_vector3_at(&mut state.normals, node, rows.in_space(node, Vector2::new(1.0, sigma)) / length);
                state.multipliers[node] = multiplier * length;
            }
        }
    }

    /// Writes the gaps to a state.
    pub(super) fn write_gaps(rows: &BladeRows, contacts: &StartContacts, state: &mut SectorState) {
        for (node, gap) in state.gaps.iter_mut().enumerate() {
            let of = |values: &[Eight]| values[node / 8].0[node % 8];
            let (sigma, steepness) = (of(&contacts.sigma), of(&rows.steepness));
            *gap = of(&contacts.gaps) / (steepness * steepness + sigma * sigma).sqrt();
        }
    }

    /// Computes the quantities at the start of a step, including displacements and gaps unless they are known.
    pub fn begin(&mut self, rows: &BladeRows, known: bool, faced: &FacedSurface) {
        self.instructions.run_octets(FindStart { known, trial: self, rows, faced });
    }

    /// Tries a step.
    pub fn attempt(
        &mut self,
        rows: &BladeRows,
        level: &BladeLevel,
        faced: &FacedSurface,
        precision: f64,
    ) -> TrialResult {
        (self.forces_known, self.unresolved) = (false, None);
        self.instructions.run_octets(Attempt { trial: self, rows, level, faced, precision })
    }

    /// Computes the modal forces of the tried step.
    pub(crate) fn find_modal_forces(&mut self, rows: &BladeRows, level: &BladeLevel) {
        if !replace(&mut self.forces_known, true) {
            self.instructions.run_octets(FindModalForces { trial: self, rows, level });
        }
    }

    /// Finds the meridional displacements if the shaft can move.
    pub(super) fn find_meridional(&mut self, rows: &BladeRows, level: &BladeLevel) {
        if !rows.meridional.is_empty() {
            self.instructions.run_octets(FindMeridional { trial: self, rows, level });
        }
    }

    /// Returns the nodes of a block that are in contact at the start of the tried step or at a point.
    fn closed(&self, rows: &BladeRows, level: &BladeLevel, block: usize) -> u8 {
        let points = (0..level.points()).map(|point| &self.multipliers[point * rows.blocks + block]);
        let positive = |block: &Eight| (0..8).fold(0, |mask, i| mask | u8::from(block.0[i] > 0.0) << i);
        std::iter::once(&self.start.multipliers[block]).chain(points).fold(0, |mask, block| mask | positive(block))
    }

    /// Sets the thresholds (m) of nodes in contact to `limit`. Nodes that are deeper than `tolerance` at the start, because
    /// an input has moved the surface, are not searched.
    pub(super) fn limit_closed(
        &self,
        (rows, level): (&BladeRows, &BladeLevel),
        thresholds: &mut [Eight],
        limit: f64,
        tolerance: f64,
    ) {
        for (block, thresholds) in thresholds.iter_mut().enumerate() {
            let closed = self.closed(rows, level, block);
            for (i, threshold) in thresholds.0.iter_mut().enumerate().filter(|(i, _)| closed >> i & 1 == 1) {
                let is_deep = self.start.gaps[block].0[i] < -tolerance;
                *threshold = if is_deep { f64::NEG_INFINITY } else { limit };
            }
        }
    }

    /// Removes the nodes in contact from the followed nodes, and sets their smallest gaps (m) to infinity.
    pub(super) fn forget_closed(&mut self, (rows, level): (&BladeRows, &BladeLevel), lowest: &mut [Eight]) {
        for (block, lowest) in lowest.iter_mut().enumerate() {
            let closed = self.closed(rows, level, block);
            self.followed[block] &= !closed;
            lowest
                .0
                .iter_mut()
                .enumerate()
                .filter(|(i, _)| closed >> i & 1 == 1)
                .for_each(|(_, gap)| *gap = f64::INFINITY);
        }
    }

    /// Selects the nodes that may come closer between the points of the tried step than at the points. They count if they
    /// come closer by more than a fraction of `tolerance` (m), and if their smallest gap may be below `thresholds` (m). Returns
    /// whether there are such nodes.
    pub(super) fn select_followed(
        &mut self,
        (rows, level): (&BladeRows, &BladeLevel),
        thresholds: &[Eight],
        tolerance: f64,
        (search, ends): (Search, [f64; 2]),
    ) -> bool {
        let unresolved = self.unresolved.unwrap_or_else(|| self.find_interpolation_error(rows, level.step));
        self.unresolved = Some(unresolved);
        let instructions = self.instructions;
        instructions.run_octets(SelectFollowed {
            trial: self,
            rows,
            level,
            thresholds,
            tolerance,
            unresolved,
            ends,
            search,
        })
    }

    /// Advances the modes over the tried step, or over a step without forces, and returns the damping loss (J).
    pub fn advance(&mut self, level: &BladeLevel, pushes: bool) -> f64 {
        self.unresolved = None;
        self.instructions.run_octets(Advance { trial: self, level, pushes })
    }

    /// Makes the contacts at the end of the tried step the contacts at the start of the next step.
    pub(crate) fn begin_next_step(&mut self, rows: &BladeRows, level: &BladeLevel) {
        self.instructions.run_octets(BeginNextStep { trial: self, rows, level });
    }

    /// Finds the largest closing and circumferential displacement of each node (m) at any time without contact.
    pub(crate) fn find_reach(&mut self, rows: &BladeRows) {
        self.cubic_errors_known = 0;
        self.instructions.run_octets(FindReach { trial: self, rows });
    }

    /// Bounds the gaps while the rotor turns past the resting surface, from the angle of the first drive to that of the
    /// second, and the shaft moves within the bounds `shaft`. Returns whether all gaps stay above zero.
    pub(crate) fn find_clearance(&mut self, rows: &BladeRows, faced: &FacedSurface, shaft: &ShaftBounds) -> bool {
        self.instructions.run_octets(FindClearance { trial: self, rows, faced, shaft })
    }

    /// Kinetic and strain energy at the start of the step (J).
    pub fn energy(&self, rows: &BladeRows) -> f64 {
        self.instructions.run_octets(Energy { trial: self, rows })
    }

    /// Returns ½ΔfᵀGΔf, the energy lost when the forces change from those at the start to constant forces (J).
    pub fn dropped(&self, rows: &BladeRows) -> f64 {
        let change = |along: usize, node: usize| {
            let at = |forces: &[Eight]| forces[node / 8].0[node % 8];
            at(&self.forces[along]) - at(&self.start.forces[along])
        };
        let mut sum = 0.0;
        for (along, node) in (0..2).flat_map(|along| (0..rows.nodes).map(move |node| (along, node))) {
            let own = change(along, node);
            for (seen, other) in (0..2).flat_map(|seen| (0..rows.nodes).map(move |other| (seen, other))) {
                let flexibility = rows.flexibility[along][seen][node * rows.blocks + other / 8].0[other % 8];
                sum += own * flexibility * change(seen, other);
            }
        }
        0.5 * sum
    }

    /// Returns whether a gap of the tried step, which has this number of blocks of lanes, is not a number.
    pub(crate) fn is_lost(&self, blocks: usize) -> bool {
        self.gaps[..blocks].iter().any(|block| block.0.iter().any(|gap| gap.is_nan()))
    }

    /// True if a force acts in the tried step.
    pub fn pushes(&self) -> bool {
        self.pushes
    }

    /// True if a force acts at the start of the step.
    pub(crate) fn is_pushed(&self) -> bool {
        self.start.pushed
    }
}

//! Trial of one step of one sector: contact forces and gaps at the points, and the quality of the step.

mod coupled;
mod fast_sliding;
mod follow;
mod judgement;
mod minima;
mod obstacle;
mod outcome;
mod prediction;
mod steady;
mod sticking;

pub use super::basis::ForceInterpolation;
use super::basis::{MOST, POINTS};
use super::compliance::{LaneCompliance, Lanes};
use super::kernels::{AddProduct, ClosingColumn, Combine, Withdraw};
use super::level::StepTables;
use super::rows::{ContactRows, Sums};
use super::state::SectorState;
use crate::contact::Law;
use crate::geometry::Sliding;
use crate::math::simd::InstructionSet;
use crate::math::vector::{Vector3, set_vector3_at, vector3_at};
use crate::scene::method::Solver;
use follow::Followed;
pub(crate) use follow::StepToFollow;
use judgement::FreeMotion;
pub use judgement::TrialResult;
pub(crate) use judgement::{FALLING, KINK, NEAR};
use nalgebra::DMatrix;
pub(crate) use obstacle::node_by_node;
pub use obstacle::{Obstacle, SlidingState};
pub(crate) use outcome::TravelBounds;
use prediction::{LanePrediction, LaneValues};
use steady::Steady;
use sticking::Sticking;

/// Fraction by which the compliance of an elastic obstacle is larger at the place of the force. It exceeds the rounding of this compliance,
/// which has single precision. Without it, the contact problem of nodes that nearly coincide might have no solution. Gaps are evaluated again
/// after each solution, so only their convergence changes.
const CARRIER_SOFTENING: f64 = 4e-6;

/// Negative gaps within this fraction of the largest gap count as rounding.
const ROUNDING: f64 = 1e-13;

/// Scratch memory and results of a trial, for a fixed number of contact nodes.
#[derive(Debug, Clone)]
pub struct Trial {
    lanes: Lanes,
    /// Displacements and velocities of the rows at the start, and whether they belong to the state.
    start: Vec<f64>,
    velocities: Vec<f64>,
    known: bool,
    now: Sums<2>,
    /// Contacts at the start.
    start_contacts: SectorState,
    /// Displacements of the lanes without forces after the start (m), those caused by the forces, and their sum.
    free: Vec<f64>,
    pushed: Vec<f64>,
    moved: Vec<f64>,
    gaps: Vec<f64>,
    normals: Vec<f64>,
    /// Normals for which the forces were found, at the displacements of the previous pass.
    solved_normals: Vec<f64>,
    /// Gaps without the forces, linearised at the current displacements, and gaps with the forces.
    without: Vec<f64>,
    with: Vec<f64>,
    multipliers: Vec<f64>,
    /// Rows of the contact problem of the members: unit normals.
    rows: Vec<Vector3>,
    /// Directions of the forces (force per λ), and forces.
    directions: Vec<f64>,
    forces: Vec<f64>,
    /// Displacements and gaps of all lanes per λ of each lane.
    columns: Vec<f64>,
    closing: Vec<f64>,
    /// True if the obstacle is elastic.
    carrier_yields: bool,
    /// Change of the gaps of all lanes per λ of each lane by the compliance of the obstacle, true for the lanes whose compliance is known
    /// in this trial, and true if it was prepared for the current solution.
    carrier_columns: Vec<f64>,
    carrier_known: Vec<bool>,
    carrier_is_fresh: bool,
    /// Multipliers at the last evaluation of the gaps and after the last solution (N), and changes of the gaps since this evaluation that
    /// forces of other sectors cause (m).
    evaluated: Vec<f64>,
    applied: Vec<f64>,
    shifts: Vec<f64>,
    law: Law,
    instructions: InstructionSet,
    /// Unknowns of the problem: lanes.
    members: Vec<usize>,
    /// Number of members whose matrix is filled in the law; `None` if it must be filled in.
    matrix_order: Option<usize>,
    chosen: Vec<bool>,
    /// Selected columns of a table, and their coefficients.
    taken: Vec<usize>,
    amounts: Vec<f64>,
    sums: Sums<MOST>,
    reach: (Sums<1>, Vec<f64>),
    free_motion: FreeMotion,
    /// Weights of the work of forces at each point.
    work_weights: [[f64; POINTS]; POINTS],
    /// Time for which the force at each point acts (s).
    durations: [f64; POINTS],
    /// Displacements at each point without the residual flexibility (m), if they are needed.
    inert: [Vec<f64>; POINTS],
    /// Negative forces at one point (N).
    withdrawn: Vec<f64>,
    /// Impulse errors (N·s), and their product with the error form (m²/(N·s)).
    impulses: Vec<f64>,
    left: Vec<f64>,
    /// Depth of each node between the points (m), 0 if it touches at a point.
    depths: Vec<f64>,
    /// Fraction of the step at which the polynomial through the gaps of a node is smallest; NaN if that gap does not matter.
    minima: Vec<f64>,
    /// Nodes of a single sector that are followed between the points.
    followed: Followed,
    /// Data for contacts that may stick; and 1/h of the step (1/s), 0 if its force does not continue that of the previous step.
    sticking: Option<Box<Sticking>>,
    per_step: f64,
    /// Data for steps of a higher degree; and slopes of the polynomials through the points at the end of the step (1/s).
    steady: Option<Box<Steady>>,
    end_slopes: [f64; POINTS],
    /// True if contacts that could stick slide fast in the tried step; and the directions of their slip at every lane, while the
    /// contact problem of such a step is solved. Zero where the direction is unknown.
    slides_fast: bool,
    slip_directions: Vec<Vector3>,
}

impl Trial {
    /// Creates a trial for a sector with `modes` modes and `nodes` contact nodes. If contacts may stick, polynomials are of degree 1.
    pub fn new(modes: usize, nodes: usize, solver: Solver) -> Self {
        let lanes = Lanes { points: MOST, nodes };
        let contacts = if solver.sticks() { nodes } else { lanes.len() };
        let (width, three) = (|| vec![0.0; lanes.width()], || vec![0.0; 3 * lanes.width()]);
        let rows = || vec![0.0; 3 * nodes];
        Self {
            lanes,
            start: rows(),
            velocities: rows(),
            known: false,
            now: Sums::new(modes, nodes),
            start_contacts: SectorState::new(0, nodes),
            free: three(),
            pushed: three(),
            moved: three(),
            gaps: width(),
            normals: three(),
            solved_normals: three(),
            without: width(),
            with: width(),
            multipliers: width(),
            rows: vec![Vector3::zeros(); lanes.len()],
            directions: three(),
            forces: three(),
            columns: vec![0.0; lanes.len() * 3 * lanes.width()],
            closing: vec![0.0; lanes.len() * lanes.width()],
            carrier_yields: false,
            carrier_columns: vec![0.0; lanes.len() * lanes.width()],
            carrier_known: vec![false; lanes.len()],
            carrier_is_fresh: false,
            evaluated: width(),
            applied: width(),
            shifts: width(),
            law: Law::new(solver, None, contacts),
            instructions: InstructionSet::detect(),
            members: Vec::with_capacity(lanes.len()),
            matrix_order: None,
            chosen: vec![false; lanes.len()],
            taken: Vec::with_capacity(3 * lanes.len()),
            amounts: Vec::with_capacity(3 * lanes.len()),
            sums: Sums::new(modes, nodes),
            reach: (Sums::new(modes, nodes), rows()),
            free_motion: FreeMotion::new(modes, nodes),
            work_weights: [[0.0; POINTS]; POINTS],
            durations: [0.0; POINTS],
            inert: std::array::from_fn(|_| rows()),
            withdrawn: rows(),
            impulses: rows(),
            left: rows(),
            depths: vec![0.0; nodes],
            minima: vec![f64::NAN; nodes],
            followed: Followed::new(modes, nodes),
            sticking: solver.sticks().then(|| Box::new(Sticking::new(nodes))),
            per_step: 0.0,
            steady: None,
            end_slopes: [0.0; POINTS],
            slides_fast: false,
            slip_directions: Vec::new(),
        }
    }

    /// Enables steps of a higher degree while no contact changes its status.
    #[must_use]
    pub fn steady(mut self) -> Self {
        self.steady = Some(Box::new(Steady::new(self.lanes.len(), self.lanes.nodes)));
        self
    }

    /// Marks the stored start values as outdated, because the state has changed.
    pub(crate) fn forget(&mut self) {
        self.known = false;
    }

    /// Finds the displacements (m) and velocities (m/s) of the rows at the start, unless they are known.
    pub(crate) fn find_start(&mut self, rows: &ContactRows, state: &SectorState) {
        if self.known {
            return;
        }
        self.known = true;
        rows.now(state, &mut self.now);
        let nodes = self.lanes.nodes;
        (0..nodes).for_each(|node| set_vector3_at(&mut self.velocities, node, self.now.vector3(1, node, nodes)));
        self.set_displacements(rows, state);
    }

    /// Returns the displacements of the rows in a state (m). The stored start values become outdated.
    pub(crate) fn displacements(&mut self, rows: &ContactRows, state: &SectorState) -> &[f64] {
        self.known = false;
        rows.displacements(state, &mut self.now);
        self.set_displacements(rows, state)
    }

    /// Adds the displacements by forces to those by the modes with inertia.
    fn set_displacements(&mut self, rows: &ContactRows, state: &SectorState) -> &[f64] {
        let nodes = self.lanes.nodes;
        (0..nodes).for_each(|node| set_vector3_at(&mut self.start, node, self.now.vector3(0, node, nodes)));
        let (matrix, y) = (rows.residual(), &mut self.start);
        self.instructions.run(AddProduct { matrix, x: &state.forces, y });
        &self.start
    }

    /// Starts a trial: finds the displacements without forces at points 1 … s (unless the caller sets them, then `rows` is
    /// `None`), and takes the contact state at the start as initial guess.
    pub fn begin(
        &mut self,
        level: &StepTables,
        kind: ForceInterpolation,
        rows: Option<&ContactRows>,
        state: &SectorState,
    ) {
        let compliance = level.compliance_of(kind);
        (self.free_motion.is_known, self.slides_fast) = (false, false);
        self.carrier_known.fill(false);
        self.work_weights = std::array::from_fn(|i| kind.work_weights(&level.basis, i));
        self.durations = std::array::from_fn(|i| level.step * kind.weight(&level.basis, i));
        self.lanes = compliance.lanes();
        let lanes = self.lanes;
        self.start_contacts.copy_contacts(state);
        self.per_step = if kind == ForceInterpolation::Polynomial { 1.0 / level.step } else { 0.0 };
        let (nodes, stride) = (lanes.nodes, 3 * lanes.width());
        if let Some(rows) = rows {
            self.move_freely(level, kind, rows, state);
        }
        self.pushed[..stride].fill(0.0);
        for lane in 0..lanes.len() {
            lanes.set(&mut self.forces, lane, vector3_at(&state.forces, lanes.place(lane).1));
        }
        self.taken.clear();
        self.amounts.clear();
        for (column, force) in state.forces.iter().enumerate().filter(|(_, force)| **force != 0.0) {
            self.taken.push(column);
            self.amounts.push(*force);
        }
        if !self.taken.is_empty() {
            if kind == ForceInterpolation::Polynomial && rows.is_some() {
                self.combine(compliance.columns(), stride);
                self.free[..stride].iter_mut().zip(&self.pushed).for_each(|(free, pushed)| *free += pushed);
            }
            self.combine(compliance.held(), stride);
        }
        for point in 0..lanes.points {
            self.multipliers[point * nodes..][..nodes].copy_from_slice(&state.multipliers);
        }
    }

    /// Finds the displacements of the rows without any force.
    fn move_freely(&mut self, level: &StepTables, kind: ForceInterpolation, rows: &ContactRows, state: &SectorState) {
        rows.free(level, state, kind.last_points(&level.basis), &mut self.sums);
        let (nodes, width) = (self.lanes.nodes, self.lanes.width());
        for (point, sums) in self.sums.rows[..self.lanes.points].iter().enumerate() {
            for component in 0..3 {
                let target = &mut self.free[component * width + point * nodes..][..nodes];
                target.copy_from_slice(&sums[component * nodes..][..nodes]);
            }
        }
    }

    /// Sums the selected columns (`taken`) of a table, multiplied by `amounts`.
    fn combine(&mut self, table: &[f64], stride: usize) {
        let Self { taken, amounts, pushed, instructions, .. } = self;
        let sums = [&mut pushed[..stride]];
        instructions.run(Combine { table, stride, columns: taken, coefficients: [amounts], sums });
    }

    /// Finds displacements and gaps under the current forces. Returns the smallest gap and the largest gap of an active contact.
    pub(crate) fn find_gaps(&mut self, obstacle: &mut impl Obstacle) -> (f64, f64) {
        self.move_rows();
        let (lanes, stride) = (self.lanes, 3 * self.lanes.width());
        let Self { moved, gaps, normals, .. } = self;
        obstacle.gaps(lanes, &moved[..stride], &mut gaps[..lanes.width()], &mut normals[..stride]);
        self.extremes()
    }

    /// Finds the displacements under the current forces.
    pub(crate) fn move_rows(&mut self) {
        let stride = 3 * self.lanes.width();
        let Self { free, pushed, moved, .. } = self;
        for ((moved, free), pushed) in moved[..stride].iter_mut().zip(free).zip(pushed) {
            *moved = *free + *pushed;
        }
    }

    /// Solves 0 ≤ λ ⟂ g ≥ 0 at all points and nodes: first for contacts that penetrate or push, then also for those that these
    /// forces make penetrate.
    pub fn solve(
        &mut self,
        compliance: &LaneCompliance,
        residual: &DMatrix<f64>,
        obstacle: &mut impl Obstacle,
        verdict: &mut TrialResult,
    ) -> bool {
        self.keep_normals();
        if self.may_stick() {
            return self.solve_sticking(compliance, obstacle, verdict);
        }
        if obstacle.turns() && !self.slides_fast {
            self.find_inert(residual);
        }
        let (lanes, width) = (self.lanes, self.lanes.width());
        let Self { gaps, normals, pushed, without, .. } = self;
        self.instructions.run(Withdraw {
            base: gaps,
            normals: &normals[..3 * width],
            moved: &pushed[..3 * width],
            to: &mut without[..width],
        });
        self.members.clear();
        self.matrix_order = None;
        for lane in 0..lanes.len() {
            self.chosen[lane] = self.gaps[lane] <= 0.0 || self.multipliers[lane] > 0.0 || self.without[lane] < 0.0;
        }
        obstacle.begin_solution();
        self.prepare_carriers(obstacle);
        for lane in 0..lanes.len() {
            if self.chosen[lane] {
                self.choose(lane, compliance, obstacle);
            }
        }
        self.begin_exchange();
        self.find_shifts(obstacle);
        self.find_forces(compliance, obstacle, verdict)
    }

    /// Finds the forces of the current contact problem. Adds contacts that penetrate under these forces, and repeats this until none does.
    pub(super) fn find_forces(
        &mut self,
        compliance: &LaneCompliance,
        obstacle: &mut impl Obstacle,
        verdict: &mut TrialResult,
    ) -> bool {
        let width = self.lanes.width();
        loop {
            self.pose(obstacle);
            let outcome = self.law.solve();
            verdict.factorisations += outcome.factorisations;
            if !outcome.solved || self.law.multipliers().iter().any(|value| !value.is_finite()) {
                return false;
            }
            self.multipliers[..width].fill(0.0);
            self.taken.clear();
            self.amounts.clear();
            for (lane, value) in self.members.iter().zip(self.law.multipliers()) {
                self.multipliers[*lane] = *value;
                if *value != 0.0 {
                    self.taken.push(*lane);
                    self.amounts.push(*value);
                }
            }
            if !self.choose_violated(compliance, obstacle) {
                break;
            }
        }
        let columns = std::mem::take(&mut self.columns);
        self.combine(&columns, 3 * width);
        self.columns = columns;
        for component in 0..3 {
            let row = component * width;
            let directions = self.directions[row..][..width].iter().zip(&self.multipliers);
            let forces = self.forces[row..][..width].iter_mut();
            forces.zip(directions).for_each(|(force, (direction, value))| *force = direction * value);
        }
        self.apply_force_changes(obstacle);
        true
    }

    /// Stores the normals for which the next forces are found.
    fn keep_normals(&mut self) {
        let stride = 3 * self.lanes.width();
        self.solved_normals[..stride].copy_from_slice(&self.normals[..stride]);
    }

    /// Makes a lane an unknown, with the direction and the effect of its force.
    fn choose(&mut self, lane: usize, compliance: &LaneCompliance, obstacle: &mut impl Obstacle) {
        let (lanes, width) = (self.lanes, self.lanes.width());
        let (point, node) = lanes.place(lane);
        let sliding = if obstacle.parameters(node).friction == 0.0 {
            Sliding::default()
        } else if let Some(&known) = self.slip_directions.get(lane) {
            let is_unknown = known == Vector3::zeros();
            let direction = if is_unknown { self.find_slip_direction(node, point, obstacle) } else { known };
            self.slip_directions[lane] = direction;
            Sliding { direction, ..Sliding::default() }
        } else {
            let sliding = SlidingState {
                moved: lanes.vector3(&self.moved, lane),
                velocity: vector3_at(&self.velocities, node),
                sliding_distance: self.sliding_distance(point, node),
                duration: self.durations[point],
                normal: lanes.vector3(&self.normals, lane),
            };
            obstacle.sliding(node, point, &sliding)
        };
        let Self { without, multipliers, normals, moved, .. } = &*self;
        let values = LaneValues { lanes, without, multipliers, normals, moved };
        let prediction = LanePrediction { sliding, ..values.prediction(lane, obstacle) };
        let (mut row, mut column) = ([Vector3::zeros()], [Vector3::zeros()]);
        self.law.fill_all(&mut row, &mut column, std::iter::once(prediction));
        let ([row], [direction]) = (row, column);
        self.rows[self.members.len()] = row;
        lanes.set(&mut self.directions, lane, direction);
        self.members.push(lane);
        self.instructions.run(ClosingColumn {
            parts: compliance.of_lane(lane),
            direction,
            normals: &self.normals[..3 * width],
            column: &mut self.columns[lane * 3 * width..][..3 * width],
            closing: &mut self.closing[lane * width..][..width],
        });
        if self.carrier_yields {
            let column = &mut self.carrier_columns[lane * width..][..width];
            if !self.carrier_known[lane] {
                column.fill(0.0);
            } else if self.carrier_is_fresh {
                obstacle.add_normal_compliance(lane, direction, column);
            }
            let closing = &mut self.closing[lane * width..][..width];
            let now = self.multipliers[lane];
            for ((column, closing), without) in column.iter().zip(&mut *closing).zip(&mut self.without) {
                (*closing, *without) = (*closing + column, *without - now * column);
            }
            let softness = CARRIER_SOFTENING * column[lane];
            closing[lane] += softness;
            self.without[lane] -= now * softness;
        }
    }

    /// Assembles the problem of the members. Fills in the matrix only if it has changed.
    fn pose(&mut self, obstacle: &impl Obstacle) {
        let width = self.lanes.width();
        let count = self.members.len();
        if self.matrix_order != Some(count) || !self.law.begin_with_same_matrix() {
            self.matrix_order = Some(count);
            self.law.begin(count);
            let matrix = self.law.matrix();
            for (column, lane) in self.members.iter().enumerate() {
                let closing = &self.closing[lane * width..][..width];
                let mut entries = matrix.column_mut(column);
                entries.iter_mut().zip(&self.members).for_each(|(entry, row)| *entry = closing[*row]);
            }
        }
        let Self { law, members, rows, lanes, without, multipliers, normals, moved, .. } = self;
        let values = LaneValues { lanes: *lanes, without, multipliers, normals, moved };
        let predictions = members.iter().map(|lane| values.prediction(*lane, obstacle));
        law.pose_all(&rows[..members.len()], predictions);
    }

    /// Chooses lanes that the current forces push into a surface.
    fn choose_violated(&mut self, compliance: &LaneCompliance, obstacle: &mut impl Obstacle) -> bool {
        let (lanes, width) = (self.lanes, self.lanes.width());
        let scale = self.members.iter().fold(0.0_f64, |most, lane| most.max(self.gaps[*lane].abs()));
        let (columns, coefficients) = (&self.taken[..], [&self.amounts[..]]);
        let sums = [&mut self.with[..width]];
        self.instructions.run(Combine { table: &self.closing, stride: width, columns, coefficients, sums });
        let mut found = false;
        for lane in 0..lanes.len() {
            let after = self.without[lane] + self.with[lane];
            if !self.chosen[lane] && self.gaps[lane].is_finite() && after < -ROUNDING * scale {
                self.chosen[lane] = true;
                self.choose(lane, compliance, obstacle);
                found = true;
            }
        }
        found
    }
}

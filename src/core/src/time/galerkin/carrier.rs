//! A structure that carries surfaces, during the steps of the sectors that touch them.

use super::basis::{MOST, POINTS, real};
use super::compliance::Lanes;
use super::kernels::{Combine, PADDED};
use super::shared_body::SharedBody;
use super::surroundings::LaneStep;
use super::trial::ForceInterpolation;
use crate::geometry::frame::PolarFrame;
use crate::geometry::surface_spline::Weights;
use crate::math::simd::{InstructionSet, Kernel};
use crate::math::vector::{Vector3, vector3_at};
use crate::modes::bank::ModalBank;
use crate::modes::coordinates::Coordinates;
use crate::system::carrier::Spot;
use std::ops::RangeInclusive;

/// Largest number of sectors that exchange forces through the structure within a contact solution. Each of them has a block of lanes.
/// All other sectors share block `BLOCKS`.
pub(crate) const BLOCKS: usize = 32;

/// Number of rows in a panel of mode shapes. All modes of a panel are contiguous, so sums over modes read memory in order.
const PANEL: usize = 4 * PADDED;

/// Numbers in single precision that are processed together. Columns of them are multiples of it, padded with zeros.
const SINGLES: usize = 4 * PADDED;

/// Tables, state and scratch memory of a structure that carries surfaces.
#[derive(Debug, Clone)]
pub struct CarrierIntegrator {
    /// Index of the structure.
    pub structure: usize,
    /// Modes of the structure.
    pub body: SharedBody,
    /// `[row][mode]` of the rows that move control points, modes padded to whole registers. The compliance, which only has to make the passes
    /// of a trial converge, is computed in single precision.
    shapes: Vec<f64>,
    compliance_shapes: Vec<f32>,
    /// Mode shapes in panels of [`PANEL`] rows, `[panel][mode][row of the panel]`, rows padded to whole panels.
    by_mode: Vec<f64>,
    /// The indices 0, 1, 2, … of all modes.
    all: Vec<usize>,
    instructions: InstructionSet,
    /// Displacements of these rows at the points of the step (m), and velocities at its start (m/s).
    moved: [Vec<f64>; POINTS],
    velocity: Vec<f64>,
    /// True if `velocity` belongs to the start of the current step.
    is_velocity_known: bool,
    /// Displacements of these rows (m) at the last call of [`CarrierIntegrator::set_motion_origin`].
    motion_origin: Vec<f64>,
    /// Displacements over which forces at each point of the accepted step do work, Σ_k S_ik u_k (m).
    worked: [Vec<f64>; POINTS],
    /// Weights of the work of forces at each point of the tried step.
    pub work_weights: [[f64; POINTS]; POINTS],
    /// δ² per squared impulse on each mode: ½ mean φ²/ω².
    error_form: Vec<f64>,
    /// Errors of impulses on the modes in the tried step.
    pub impulses: Vec<f64>,
    /// Modal components of each lane of the current sector in fixed directions, and directions of the lanes.
    seen: [Vec<f32>; 3],
    frames: Vec<PolarFrame>,
    /// Places of the lanes of the current sector.
    places: Vec<LanePlace>,
    /// Modal components along the normals and along the forces of the lanes of all blocks, and true for lanes on this structure.
    along: Vec<f32>,
    acting: Vec<f32>,
    touches: Vec<bool>,
    /// Number of lanes of a block.
    lanes: usize,
    /// Changes of the modal forces at the points 1 … s since the gaps were evaluated, and the modal displacements that they cause.
    changes: [Vec<f64>; MOST],
    shifts: [Vec<f32>; MOST],
    /// Modal displacements per unit of λ of one lane.
    force: Vec<f32>,
    /// Loads on the rows at the points (N), indices of the rows with loads, and true for each of these rows.
    loads: [Vec<f64>; POINTS],
    loaded: Vec<usize>,
    is_loaded: Vec<bool>,
    /// Scratch: loads on the loaded rows, and modal forces, padded to whole registers.
    amounts: [Vec<f64>; MOST],
    modal: [Vec<f64>; MOST],
}

impl CarrierIntegrator {
    /// Creates an integrator with polynomials of degree `degree`, for sectors of at most these lanes.
    pub fn new(structure: usize, bank: &ModalBank, degree: usize, lanes: Lanes) -> Self {
        let coordinates = coordinates(bank);
        let (modes, rows) = (bank.modes(), bank.rows());
        let (stride, padded) = (modes.next_multiple_of(PADDED), rows.next_multiple_of(PANEL));
        let (mut shapes, mut by_mode) = (vec![0.0; rows * stride], vec![0.0; padded * modes]);
        for (row, mode) in (0..rows).flat_map(|row| (0..modes).map(move |mode| (row, mode))) {
            let shape = bank.contact_row(row)[mode];
            shapes[row * stride + mode] = shape;
            by_mode[(row / PANEL * modes + mode) * PANEL + row % PANEL] = shape;
        }
        let lowest = coordinates.frequencies.iter().copied().filter(|w| *w > 0.0).fold(f64::INFINITY, f64::min);
        let of_mode = |mode: usize| {
            let square: f64 = (0..rows).map(|row| shapes[row * stride + mode].powi(2)).sum();
            0.5 * coordinates.inertia[mode] * square / real(rows) / coordinates.frequencies[mode].max(lowest).powi(2)
        };
        let error_form = (0..modes).map(of_mode).collect();
        let body = SharedBody::new(coordinates, degree);
        let single_stride = modes.next_multiple_of(SINGLES);
        let compliance_shapes = single_precision(&shapes, stride, single_stride);
        Self {
            error_form,
            structure,
            compliance_shapes,
            shapes,
            by_mode,
            all: (0..modes).collect(),
            instructions: InstructionSet::detect(),
            moved: std::array::from_fn(|_| vec![0.0; padded]),
            velocity: vec![0.0; padded],
            is_velocity_known: false,
            motion_origin: vec![0.0; padded],
            worked: std::array::from_fn(|_| vec![0.0; padded]),
            work_weights: [[0.0; POINTS]; POINTS],
            impulses: vec![0.0; modes],
            seen: std::array::from_fn(|_| vec![0.0; lanes.len() * single_stride]),
            frames: vec![PolarFrame::FIXED; lanes.len()],
            places: vec![LanePlace::UNASSIGNED; lanes.len()],
            along: vec![0.0; (BLOCKS + 1) * lanes.len() * single_stride],
            acting: vec![0.0; (BLOCKS + 1) * lanes.len() * single_stride],
            touches: vec![false; (BLOCKS + 1) * lanes.len()],
            lanes: lanes.len(),
            changes: std::array::from_fn(|_| vec![0.0; stride]),
            shifts: std::array::from_fn(|_| vec![0.0; single_stride]),
            force: vec![0.0; single_stride],
            loads: std::array::from_fn(|_| vec![0.0; rows]),
            loaded: Vec::with_capacity(rows),
            is_loaded: vec![false; rows],
            amounts: std::array::from_fn(|_| Vec::with_capacity(rows)),
            modal: std::array::from_fn(|_| vec![0.0; stride]),
            body: if bank.options.loads { body.loaded() } else { body },
        }
    }

    /// Displacements of the rows at a point of the step (m).
    pub fn moved(&self, point: usize) -> &[f64] {
        &self.moved[point]
    }

    /// Computes the rows at the points 1 … `points` of the step, under the forces there; and their velocities at the start of the step, if
    /// they are not known.
    pub fn recover(&mut self, points: usize) {
        let Self { by_mode, all, moved: [_, one, two, three], velocity, is_velocity_known, body, instructions, .. } =
            self;
        let [_, a, b, c] = body.at.each_ref().map(|at| &at[..]);
        let v = &body.state.velocity[..];
        let rows = RowSums { by_mode, all, instructions };
        match (points, *is_velocity_known) {
            (1, true) => rows.find([a], [one]),
            (1, false) => rows.find([a, v], [one, velocity]),
            (2, true) => rows.find([a, b], [one, two]),
            (2, false) => rows.find([a, b, v], [one, two, velocity]),
            (_, true) => rows.find([a, b, c], [one, two, three]),
            (_, false) => rows.find([a, b, c, v], [one, two, three, velocity]),
        }
        *is_velocity_known = true;
    }

    /// Finds displacements and velocities of the rows at the start of a span.
    pub(crate) fn find_start(&mut self) {
        self.body.settle();
        let Self { by_mode, all, moved: [start, ..], velocity, body, instructions, .. } = self;
        RowSums { by_mode, all, instructions }.find([&body.at[0], &body.state.velocity], [start, velocity]);
        self.is_velocity_known = true;
        self.set_motion_origin();
    }

    /// Makes the displacements at the start of the step the origin from which motion is measured.
    pub(crate) fn set_motion_origin(&mut self) {
        self.motion_origin.copy_from_slice(&self.moved[0]);
    }

    /// Largest square of the motion of a control point since [`CarrierIntegrator::set_motion_origin`] at the given points of the step (m²);
    /// `row` is its first row.
    pub(crate) fn largest_square_motion(&self, row: usize, points: RangeInclusive<usize>) -> f64 {
        let square = |moved: &Vec<f64>| {
            (vector3_at(&moved[row..], 0) - vector3_at(&self.motion_origin[row..], 0)).norm_squared()
        };
        self.moved[points].iter().map(square).fold(0.0, f64::max)
    }

    /// Advances to the end of an accepted step. Displacements at its end become those at the start of the next step.
    pub(crate) fn take(&mut self, level: usize, kind: ForceInterpolation, points: usize) {
        self.body.take(level, kind);
        self.body.settle();
        self.moved.swap(0, points);
        self.is_velocity_known = false;
    }

    /// Velocity of a place at the start of the step (m/s), in the directions of the node.
    pub(crate) fn velocity_at(&self, spot: Spot) -> Vector3 {
        spot.interpolate(|row| self.velocity[row])
    }

    /// Returns the displacement of a place over which a force at point i of the tried step does work (m), in the directions of the node.
    pub(crate) fn sliding_distance_at(&self, spot: Spot, i: usize) -> Vector3 {
        let (weights, moved) = (&self.work_weights[i], &self.moved);
        let sliding_distance =
            |row: usize| weights.iter().zip(moved).map(|(weight, moved)| weight * moved[row]).sum::<f64>();
        spot.interpolate(sliding_distance)
    }

    /// Displacement of a place at a point of the step (m), in the directions of the node.
    pub(crate) fn moved_at(&self, spot: Spot, point: usize) -> Vector3 {
        spot.interpolate(|row| self.moved[point][row])
    }

    /// Returns the displacement of a place over which a force at point i of the accepted step does work (m), in the directions of the node.
    pub(crate) fn worked_at(&self, spot: Spot, i: usize) -> Vector3 {
        spot.interpolate(|row| self.worked[i][row])
    }

    /// Computes the weighted displacements for the work of forces at the points.
    pub(crate) fn weigh(&mut self, points: usize) {
        let Self { worked, moved, work_weights, .. } = self;
        for (worked, weights) in worked.iter_mut().zip(work_weights).take(points + 1) {
            for (row, worked) in worked.iter_mut().enumerate() {
                *worked = (0..=points).map(|k| weights[k] * moved[k][row]).sum();
            }
        }
    }

    /// Removes all loads.
    pub(crate) fn clear_loads(&mut self) {
        for row in self.loaded.drain(..) {
            self.is_loaded[row] = false;
            self.loads.iter_mut().for_each(|loads| loads[row] = 0.0);
        }
    }

    /// Adds the reaction to a force on a node at a place to the loads at point i.
    pub(crate) fn react(&mut self, spot: Spot, i: usize, force: Vector3) {
        let ((weights, first), fixed) = (spot.rows(), spot.frame.fixed(force));
        for (first, weight) in first.iter().zip(&weights.values[..weights.len]) {
            for (component, force) in fixed.iter().enumerate() {
                let row = first + component;
                self.loads[i][row] -= weight * force;
                if !self.is_loaded[row] {
                    self.is_loaded[row] = true;
                    self.loaded.push(row);
                }
            }
        }
    }

    /// Computes the modal forces at some points from the loads.
    pub(crate) fn gather(&mut self, points: RangeInclusive<usize>) {
        let (first, count) = (*points.start(), points.end() + 1 - points.start());
        self.gather_loads(first, count);
        for (forces, modal) in self.body.forces[points].iter_mut().zip(&self.modal) {
            let modes = forces.len();
            forces.copy_from_slice(&modal[..modes]);
        }
    }

    /// Computes the modal impulses (N·s) from the loads at point 0, which contain the reactions to impulses on the nodes.
    pub(crate) fn gather_impulses(&mut self) {
        self.gather_loads(0, 1);
        let modes = self.impulses.len();
        self.impulses.copy_from_slice(&self.modal[0][..modes]);
    }

    /// Computes the modal forces of the loads at `count` points from `first` on.
    fn gather_loads(&mut self, first: usize, count: usize) {
        let Self { shapes, loads, loaded, amounts, modal, instructions, .. } = self;
        for (amounts, loads) in amounts.iter_mut().zip(&loads[first..first + count]) {
            amounts.clear();
            amounts.extend(loaded.iter().map(|row| loads[*row]));
        }
        let ([a, b, c], [one, two, three]) = (&*amounts, modal);
        let (table, stride, columns) = (&shapes[..], one.len(), &loaded[..]);
        match count {
            1 => instructions.run(Combine { table, stride, columns, coefficients: [a], sums: [one] }),
            2 => instructions.run(Combine { table, stride, columns, coefficients: [a, b], sums: [one, two] }),
            _ => instructions.run(Combine { table, stride, columns, coefficients: [a, b, c], sums: [one, two, three] }),
        }
    }

    /// Displacement error caused by the impulses (m).
    pub fn error(&self) -> f64 {
        self.impulses.iter().zip(&self.error_form).map(|(impulse, form)| impulse * impulse * form).sum::<f64>().sqrt()
    }

    /// Removes all lanes of a block.
    pub(crate) fn clear_lanes(&mut self, block: usize) {
        self.touches[block * self.lanes..][..self.lanes].fill(false);
    }

    /// Assigns a lane of the current sector to a place with this `normal` (in the directions of the node). Call
    /// [`CarrierIntegrator::find_modal_components`] after the last lane.
    pub(crate) fn set_lane(&mut self, block: usize, lane: usize, spot: Spot, normal: Vector3) {
        self.touches[block * self.lanes + lane] = true;
        self.frames[lane] = spot.frame;
        let (weights, first) = spot.rows();
        self.places[lane] = LanePlace { weights, first, normal: spot.frame.fixed(normal).into() };
    }

    /// Computes the modal components of all assigned lanes of a block in fixed directions and along their normals. Most points of a node share
    /// their control points, because nodes move little in a step; the mode shapes are then read once.
    pub(crate) fn find_modal_components(&mut self, block: usize, lanes: Lanes) {
        let (padded, first) = (self.force.len(), block * self.lanes);
        let Self { seen, along, compliance_shapes: shapes, places, touches, instructions, .. } = self;
        let touches = &touches[first..][..lanes.len()];
        for node in 0..lanes.nodes {
            let (mut node_lanes, mut count) = ([0; MOST], 0);
            for lane in (1..=lanes.points).map(|point| lanes.at(point, node)).filter(|lane| touches[*lane]) {
                node_lanes[count] = lane;
                count += 1;
            }
            let group = &node_lanes[..count];
            let control_points = |lane: usize| (places[lane].first, places[lane].weights.len);
            let is_common = group.iter().all(|lane| control_points(*lane) == control_points(group[0]));
            let mut components = ModeShapeInterpolation { seen, shapes, places, instructions };
            match *group {
                [a, b] if is_common => components.find([a, b]),
                [a, b, c] if is_common => components.find([a, b, c]),
                _ => group.iter().for_each(|lane| components.find([*lane])),
            }
        }
        for lane in (0..lanes.len()).filter(|lane| touches[*lane]) {
            let to = component_window_mut(along, first + lane, padded);
            instructions.run(Project {
                seen: fixed_components(seen, lane, padded),
                direction: places[lane].normal,
                to,
            });
        }
    }

    /// Adds the displacement at all lanes (m, along their normals) per λ of one lane, whose force per λ is `direction`, to
    /// `carrier_compliance`.
    pub(crate) fn add_normal_compliance(
        &mut self,
        step: LaneStep,
        lane: usize,
        direction: Vector3,
        carrier_compliance: &mut [f64],
    ) {
        let (padded, lanes, first) = (self.force.len(), step.lanes, step.block * self.lanes);
        if !self.touches[first + lane] {
            return;
        }
        self.instructions.run(Project {
            seen: fixed_components(&self.seen, lane, padded),
            direction: self.frames[lane].fixed(direction).into(),
            to: component_window_mut(&mut self.acting, first + lane, padded),
        });
        let (k, _) = lanes.place(lane);
        for i in 1..=lanes.points {
            let Self { force, along, acting, touches, instructions, body, .. } = self;
            let (response, acting) = (body.response(step.level, step.kind, i, k), &acting[(first + lane) * padded..]);
            instructions.run(ModalResponse { response, acting, to: force });
            let others = i * lanes.nodes - lanes.nodes..i * lanes.nodes;
            let places = first + others.start..first + others.end;
            instructions.run(AddAlong {
                moved: force,
                along: &along[places.start * padded..places.end * padded],
                touches: &touches[places],
                sums: &mut carrier_compliance[others],
            });
        }
    }

    /// Sets all changes of forces to zero.
    pub(crate) fn clear_force_changes(&mut self) {
        self.changes.iter_mut().for_each(|values| values.fill(0.0));
        self.shifts.iter_mut().for_each(|values| values.fill(0.0));
    }

    /// Adds a change of λ of a lane since the last evaluation of the gaps (N).
    pub(crate) fn add_force_change(&mut self, step: LaneStep, lane: usize, change: f64) {
        let (padded, place) = (self.force.len(), step.block * self.lanes + lane);
        if self.touches[place] {
            let sums = &mut self.changes[step.lanes.place(lane).0 - 1];
            let acting = &self.acting[place * padded..][..sums.len()];
            self.instructions.run(AddMultiple { acting, change, sums });
        }
    }

    /// Finds the modal displacements caused by all changes of forces.
    pub(crate) fn apply_force_changes(&mut self, step: LaneStep) {
        let Self { changes, shifts, body, .. } = self;
        for (point, shift) in shifts[..step.lanes.points].iter_mut().enumerate() {
            body.displace(step.level, step.kind, point + 1, &changes[..step.lanes.points], shift);
        }
    }

    /// Returns the change of the gap of a lane caused by all changes of forces (m).
    pub(crate) fn gap_change(&self, step: LaneStep, lane: usize) -> f64 {
        let (padded, place) = (self.force.len(), step.block * self.lanes + lane);
        let shifts = &self.shifts[step.lanes.place(lane).0 - 1];
        let mut sums = [0.0];
        let (along, touches) = (&self.along[place * padded..][..padded], &self.touches[place..=place]);
        self.instructions.run(AddAlong { moved: shifts, along, touches, sums: &mut sums });
        sums[0]
    }

    /// Adds the displacement in the directions of each lane under a `force` on one lane at the end of the step (N), if the end is
    /// the only point.
    pub(crate) fn add_compliance(
        &mut self,
        step: LaneStep,
        lane: usize,
        force: Vector3,
        carrier_compliance: &mut [f64],
    ) {
        let (padded, lanes, first) = (self.force.len(), step.lanes, step.block * self.lanes);
        self.move_modes(step, 1, lane, force);
        for other in (0..lanes.nodes).filter(|node| self.touches[first + node]) {
            let fixed =
                self.seen.each_ref().map(|seen| f64::from(dot_of(&seen[other * padded..][..padded], &self.force)));
            lanes.set(carrier_compliance, other, self.frames[other].local(fixed.into()));
        }
    }

    /// Returns the motion of the modes at point i under a force on a lane, in the directions of the lane.
    fn move_modes(&mut self, step: LaneStep, i: usize, lane: usize, force: Vector3) {
        let LaneStep { level, kind, lanes, block } = step;
        if !self.touches[block * self.lanes + lane] {
            return self.force.fill(0.0);
        }
        let padded = self.force.len();
        let [x, y, z] = fixed_components(&self.seen, lane, padded);
        let (k, _) = lanes.place(lane);
        let [a, b, c] = singles(self.frames[lane].fixed(force).into());
        let response = self.body.response(level, kind, i, k);
        let seen = x.iter().zip(y).zip(z);
        for ((to, response), ((x, y), z)) in self.force.iter_mut().zip(response).zip(seen) {
            *to = single(*response) * (a * x + b * y + c * z);
        }
    }
}

/// The place of a lane on the surface.
#[derive(Debug, Clone, Copy)]
struct LanePlace {
    /// Weights of the control points around it, and the first row of each.
    weights: Weights,
    first: [usize; 16],
    /// Normal in fixed directions.
    normal: [f64; 3],
}

impl LanePlace {
    const UNASSIGNED: Self =
        Self { weights: Weights { indices: [0; 16], values: [0.0; 16], len: 0 }, first: [0; 16], normal: [0.0; 3] };
}

/// Modal components of a lane in fixed directions.
fn fixed_components(seen: &[Vec<f32>; 3], lane: usize, padded: usize) -> [&[f32]; 3] {
    seen.each_ref().map(|seen| &seen[lane * padded..][..padded])
}

/// Modal components of a lane in one direction.
fn component_window_mut(components: &mut [f32], lane: usize, padded: usize) -> &mut [f32] {
    &mut components[lane * padded..][..padded]
}

/// Interpolates the mode shapes at lanes.
struct ModeShapeInterpolation<'a> {
    /// Components of all lanes in fixed directions.
    seen: &'a mut [Vec<f32>; 3],
    /// `[row][mode]`.
    shapes: &'a [f32],
    places: &'a [LanePlace],
    instructions: &'a InstructionSet,
}

impl ModeShapeInterpolation<'_> {
    /// Finds the components of lanes that have the same control points.
    fn find<const N: usize>(&mut self, lanes: [usize; N]) {
        let padded = self.seen[0].len() / self.places.len();
        let LanePlace { first, weights: Weights { len, .. }, .. } = self.places[lanes[0]];
        let weights = lanes.map(|lane| self.places[lane].weights.values.map(single));
        let coefficients = weights.each_ref().map(|weights| &weights[..len]);
        for (component, seen) in self.seen.iter_mut().enumerate() {
            let rows = first.map(|row| row + component);
            let Ok(sums) = seen.get_disjoint_mut(lanes.map(|lane| lane * padded..(lane + 1) * padded)) else {
                unreachable!("lanes differ")
            };
            let (table, columns) = (self.shapes, &rows[..len]);
            self.instructions.run(Combine { table, stride: padded, columns, coefficients, sums });
        }
    }
}

/// Modal components along a direction from those along x, y and z.
struct Project<'a> {
    seen: [&'a [f32]; 3],
    direction: [f64; 3],
    to: &'a mut [f32],
}

impl Kernel for Project<'_> {
    #[inline(always)]
    fn run(self) {
        let ([x, y, z], [a, b, c]) = (self.seen, singles(self.direction));
        for (((to, x), y), z) in self.to.iter_mut().zip(x).zip(y).zip(z) {
            *to = a * x + b * y + c * z;
        }
    }
}

/// Modal displacements `to` = `response` (per unit of modal force) · `acting` (modal force per λ).
struct ModalResponse<'a> {
    response: &'a [f64],
    acting: &'a [f32],
    to: &'a mut [f32],
}

impl Kernel for ModalResponse<'_> {
    #[inline(always)]
    fn run(self) {
        for ((to, response), acting) in self.to.iter_mut().zip(self.response).zip(self.acting) {
            *to = single(*response) * acting;
        }
    }
}

/// Sums over all modes at the rows.
struct RowSums<'a> {
    /// `[panel][mode][row of the panel]`.
    by_mode: &'a [f64],
    all: &'a [usize],
    instructions: &'a InstructionSet,
}

impl RowSums<'_> {
    fn find<const N: usize>(&self, coefficients: [&[f64]; N], mut sums: [&mut Vec<f64>; N]) {
        for (panel, table) in self.by_mode.chunks_exact(PANEL * self.all.len().max(1)).enumerate() {
            let sums = sums.each_mut().map(|sums| &mut sums[panel * PANEL..][..PANEL]);
            self.instructions.run(Combine { table, stride: PANEL, columns: self.all, coefficients, sums });
        }
    }
}

/// Adds the displacements along the normals of some lanes, whose modal components are `along`, to `sums`.
struct AddAlong<'a> {
    /// Displacements of the modes.
    moved: &'a [f32],
    along: &'a [f32],
    /// True for lanes on the structure.
    touches: &'a [bool],
    sums: &'a mut [f64],
}

impl Kernel for AddAlong<'_> {
    #[inline(always)]
    fn run(self) {
        let lanes = self.along.chunks_exact(self.moved.len()).zip(self.touches).zip(self.sums);
        for ((along, _), sum) in lanes.filter(|((_, touches), _)| **touches) {
            *sum += f64::from(dot_of(along, self.moved));
        }
    }
}

/// Adds a multiple of the modal components of a force to `sums`.
struct AddMultiple<'a> {
    acting: &'a [f32],
    change: f64,
    sums: &'a mut [f64],
}

impl Kernel for AddMultiple<'_> {
    #[inline(always)]
    fn run(self) {
        for (sum, acting) in self.sums.iter_mut().zip(self.acting) {
            *sum += self.change * f64::from(*acting);
        }
    }
}

/// Scalar product, summed in [`SINGLES`] parts.
#[inline(always)]
fn dot_of(a: &[f32], b: &[f32]) -> f32 {
    let mut parts = [0.0; SINGLES];
    for (a, b) in a.as_chunks::<SINGLES>().0.iter().zip(b.as_chunks::<SINGLES>().0) {
        for i in 0..SINGLES {
            parts[i] += a[i] * b[i];
        }
    }
    parts.iter().sum()
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "the compliance of a trial needs no more than single precision")]
fn single(value: f64) -> f32 {
    value as f32
}

#[inline(always)]
fn singles(values: [f64; 3]) -> [f32; 3] {
    values.map(single)
}

/// Copies a table to single precision, with columns of `to` entries in place of `from`. Entries below 1e-9 of the largest become zero, so that
/// no product of them is subnormal.
fn single_precision(table: &[f64], from: usize, to: usize) -> Vec<f32> {
    let largest = table.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let column = |column: &[f64]| {
        let values = column.iter().map(|value| if value.abs() < 1e-9 * largest { 0.0 } else { single(*value) });
        values.chain(std::iter::repeat(0.0)).take(to).collect::<Vec<f32>>()
    };
    table.chunks_exact(from.max(1)).flat_map(column).collect()
}

/// Modes of a structure that carries surfaces.
pub fn coordinates(bank: &ModalBank) -> Coordinates {
    let model = bank.model();
    let dynamic = model.inertial_modes();
    Coordinates::new(&model.frequencies, &model.damping_ratios, dynamic)
}

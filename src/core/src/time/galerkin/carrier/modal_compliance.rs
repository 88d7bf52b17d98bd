//! Displacements of a structure that carries surfaces at the lanes of several sectors, per contact force, from all of its modes.
//!
//! Their errors affect only the convergence of a trial, because every pass evaluates the gaps with the motion of the structure in double
//! precision. Single precision is therefore sufficient, if the contact problem is softened by more than its rounding
//! (`CARRIER_SOFTENING` of the trial).

use super::BLOCKS;
use crate::geometry::frame::PolarFrame;
use crate::geometry::surface_spline::Weights;
use crate::math::simd::{InstructionSet, Kernel};
use crate::math::vector::Vector3;
use crate::modes::bank::ModalBank;
use crate::system::carrier::Spot;
use crate::time::galerkin::basis::MOST;
use crate::time::galerkin::compliance::Lanes;
use crate::time::galerkin::kernels::{Combine, PADDED, to_f32};
use crate::time::galerkin::shared_body::SharedBody;
use crate::time::galerkin::surroundings::LaneStep;

/// Number of single-precision numbers that are processed together. The number of modes is padded to a multiple of it.
const PADDED_SINGLES: usize = 4 * PADDED;

/// Entries of mode shapes below this fraction of the largest entry count as zero, because products of small entries could be subnormal
/// numbers, which are slow.
const NEGLIGIBLE_SHAPE: f64 = 1e-9;

/// Modal components of all lanes, and changes of the forces there; allocates only on creation.
#[derive(Debug, Clone)]
pub(crate) struct ModalCompliance {
    /// Mode shapes `[row][mode]` at the rows that move control points, with modes padded.
    shapes: Vec<f32>,
    /// Number of modes with padding.
    padded: usize,
    instructions: InstructionSet,
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
    /// Scratch: displacements of the modes under the force on one lane.
    moved: Vec<f32>,
}

impl ModalCompliance {
    /// Copies the mode shapes in single precision, and allocates memory for sectors of at most these lanes.
    pub(super) fn new(bank: &ModalBank, lanes: Lanes) -> Self {
        let (rows, padded) = (bank.rows(), bank.modes().next_multiple_of(PADDED_SINGLES));
        let all = (0..rows).flat_map(|row| bank.contact_row(row));
        let largest = all.fold(0.0, |most: f64, shape| most.max(shape.abs()));
        let mut shapes = vec![0.0; rows * padded];
        for (row, to) in shapes.chunks_exact_mut(padded).enumerate() {
            let shapes = bank.contact_row(row).iter();
            let large = shapes.map(|shape| if shape.abs() > NEGLIGIBLE_SHAPE * largest { to_f32(*shape) } else { 0.0 });
            to.iter_mut().zip(large).for_each(|(to, shape)| *to = shape);
        }
        Self {
            shapes,
            padded,
            instructions: InstructionSet::detect(),
            seen: std::array::from_fn(|_| vec![0.0; lanes.len() * padded]),
            frames: vec![PolarFrame::FIXED; lanes.len()],
            places: vec![LanePlace::UNASSIGNED; lanes.len()],
            along: vec![0.0; (BLOCKS + 1) * lanes.len() * padded],
            acting: vec![0.0; (BLOCKS + 1) * lanes.len() * padded],
            touches: vec![false; (BLOCKS + 1) * lanes.len()],
            lanes: lanes.len(),
            changes: std::array::from_fn(|_| vec![0.0; padded]),
            shifts: std::array::from_fn(|_| vec![0.0; padded]),
            moved: vec![0.0; padded],
        }
    }

    /// Removes all lanes of a block.
    pub(crate) fn clear_lanes(&mut self, block: usize) {
        self.touches[block * self.lanes..][..self.lanes].fill(false);
    }

    /// Assigns a lane of the current sector to a place with this `normal` (in the directions of the node). Call
    /// [`ModalCompliance::find_modal_components`] after the last lane.
    pub(crate) fn set_lane(&mut self, block: usize, lane: usize, spot: Spot, normal: Vector3) {
        self.touches[block * self.lanes + lane] = true;
        self.frames[lane] = spot.frame;
        let (weights, first) = spot.rows();
        self.places[lane] = LanePlace { weights, first, normal: spot.frame.fixed(normal).into() };
    }

    /// Computes the modal components of all assigned lanes of a block in fixed directions and along their normals. Most points of a node
    /// share their control points, because nodes move little in a step; the mode shapes are then read once.
    pub(crate) fn find_modal_components(&mut self, block: usize, lanes: Lanes) {
        let (padded, first) = (self.padded, block * self.lanes);
        let Self { seen, along, shapes, places, touches, instructions, .. } = self;
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
        body: &SharedBody,
        step: LaneStep,
        lane: usize,
        direction: Vector3,
        carrier_compliance: &mut [f64],
    ) {
        let (padded, lanes, first) = (self.padded, step.lanes, step.block * self.lanes);
        if !self.touches[first + lane] {
            return;
        }
        self.find_modal_force(first, lane, direction);
        for i in 1..=lanes.points {
            self.move_modes(body, step, i, lane);
            let others = i * lanes.nodes - lanes.nodes..i * lanes.nodes;
            let places = first + others.start..first + others.end;
            self.instructions.run(AddAlong {
                moved: &self.moved,
                along: &self.along[places.start * padded..places.end * padded],
                touches: &self.touches[places],
                sums: &mut carrier_compliance[others],
            });
        }
    }

    /// Finds the displacements of the modes at point i under the force on a lane that [`ModalCompliance::find_modal_force`] has set.
    fn move_modes(&mut self, body: &SharedBody, step: LaneStep, i: usize, lane: usize) {
        let ((k, _), place) = (step.lanes.place(lane), step.block * self.lanes + lane);
        self.instructions.run(ApplyResponse {
            response: body.response(step.level, step.kind, i, k),
            acting: &self.acting[place * self.padded..][..self.padded],
            to: &mut self.moved,
        });
    }

    /// Sets all changes of forces to zero.
    pub(crate) fn clear_force_changes(&mut self) {
        self.changes.iter_mut().for_each(|values| values.fill(0.0));
        self.shifts.iter_mut().for_each(|values| values.fill(0.0));
    }

    /// Adds a change of λ of a lane since the last evaluation of the gaps (N).
    pub(crate) fn add_force_change(&mut self, step: LaneStep, lane: usize, change: f64) {
        let (padded, place) = (self.padded, step.block * self.lanes + lane);
        if self.touches[place] {
            let sums = &mut self.changes[step.lanes.place(lane).0 - 1];
            let acting = &self.acting[place * padded..][..sums.len()];
            self.instructions.run(AddMultiple { acting, change, sums });
        }
    }

    /// Finds the modal displacements caused by all changes of forces.
    pub(crate) fn apply_force_changes(&mut self, body: &SharedBody, step: LaneStep) {
        let Self { changes, shifts, .. } = self;
        for (point, shift) in shifts[..step.lanes.points].iter_mut().enumerate() {
            body.displace(step.level, step.kind, point + 1, &changes[..step.lanes.points], shift);
        }
    }

    /// Returns the change of the gap of a lane caused by all changes of forces (m).
    pub(crate) fn gap_change(&self, step: LaneStep, lane: usize) -> f64 {
        let (padded, place) = (self.padded, step.block * self.lanes + lane);
        let shifts = &self.shifts[step.lanes.place(lane).0 - 1];
        let mut sums = [0.0];
        let (along, touches) = (&self.along[place * padded..][..padded], &self.touches[place..=place]);
        self.instructions.run(AddAlong { moved: shifts, along, touches, sums: &mut sums });
        sums[0]
    }

    /// Sets `carrier_compliance` to the displacement (m) in the directions of each lane under a `force` on one lane at the end of the step
    /// (N), if the end is the only point.
    pub(crate) fn add_compliance(
        &mut self,
        body: &SharedBody,
        step: LaneStep,
        lane: usize,
        force: Vector3,
        carrier_compliance: &mut [f64],
    ) {
        let (padded, lanes, first) = (self.padded, step.lanes, step.block * self.lanes);
        if !self.touches[first + lane] {
            return;
        }
        self.find_modal_force(first, lane, force);
        self.move_modes(body, step, 1, lane);
        for other in (0..lanes.nodes).filter(|node| self.touches[first + node]) {
            let fixed =
                self.seen.each_ref().map(|seen| f64::from(dot_of(&seen[other * padded..][..padded], &self.moved)));
            lanes.set(carrier_compliance, other, self.frames[other].local(fixed.into()));
        }
    }

    /// Finds the modal components of a `force` on a lane, in the directions of the node; `first` is the first lane of the block.
    fn find_modal_force(&mut self, first: usize, lane: usize, force: Vector3) {
        self.instructions.run(Project {
            seen: fixed_components(&self.seen, lane, self.padded),
            direction: self.frames[lane].fixed(force).into(),
            to: component_window_mut(&mut self.acting, first + lane, self.padded),
        });
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
        let weights = lanes.map(|lane| self.places[lane].weights.values.map(to_f32));
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
        let ([x, y, z], [a, b, c]) = (self.seen, self.direction.map(to_f32));
        for (((to, x), y), z) in self.to.iter_mut().zip(x).zip(y).zip(z) {
            *to = a * x + b * y + c * z;
        }
    }
}

/// Modal displacements `to` = `response` (per unit of modal force) · `acting` (modal force per λ).
struct ApplyResponse<'a> {
    response: &'a [f64],
    acting: &'a [f32],
    to: &'a mut [f32],
}

impl Kernel for ApplyResponse<'_> {
    #[inline(always)]
    fn run(self) {
        for ((to, response), acting) in self.to.iter_mut().zip(self.response).zip(self.acting) {
            *to = to_f32(*response) * acting;
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

/// Scalar product, summed in [`PADDED_SINGLES`] parts.
#[inline(always)]
fn dot_of(a: &[f32], b: &[f32]) -> f32 {
    let mut parts = [0.0; PADDED_SINGLES];
    for (a, b) in a.as_chunks::<PADDED_SINGLES>().0.iter().zip(b.as_chunks::<PADDED_SINGLES>().0) {
        for i in 0..PADDED_SINGLES {
            parts[i] += a[i] * b[i];
        }
    }
    parts.iter().sum()
}

//! Gaps to a surface through data points: closest point, normal, and the place at which the force is transferred.

pub(crate) mod near;

use super::BEND_SAFETY;
use super::frame::PolarFrame;
use super::layout::Layout;
use super::surface_spline::motion::PatchMotions;
use super::surface_spline::{ClosestPoint, Projection, SurfaceSpline, split};
use super::wrench::{At, MotionIncrement};
use super::{Gap, Geometry, PrescribedMotion, Vector3};
use crate::math::real;
use crate::math::simd::InstructionSet;
use crate::math::vector::{length, strided_vector3, vector3_at};
use near::{NearNode, NearSearch};

/// Gap of a node without a surface to touch: infinite, so that it is never used as a distance.
pub(crate) const NOTHING_TO_TOUCH: f64 = f64::INFINITY;

/// Least assumed value of [`SplineGap::largest_shift`] (rad).
const LEAST_SHIFT: f64 = 0.06;

/// Contact nodes of equally spaced sectors facing a surface spline.
#[derive(Debug, Clone, PartialEq)]
pub struct SplineGap {
    /// Positions of the contact nodes of the structure.
    pub layout: Layout,
    /// Directions of the contact nodes at rotor angle 0.
    frames: Vec<PolarFrame>,
    /// Contact nodes that can touch the surface.
    pub nodes: Vec<usize>,
    /// Index of the first data point among the nodes of the contact grid that carries the surface.
    pub first_node: usize,
    /// Clearance at which the data points were placed (m).
    pub nominal_clearance: f64,
    /// The current surface.
    pub surface: SurfaceSpline,
    /// Control points of the round surface (m).
    pub round: Vec<Vector3>,
    /// Displacement of the data points by the shape at factor 1 (m); empty for a round surface.
    pub shape: Vec<Vector3>,
    /// Angle over which the shape changes noticeably (rad).
    pub angular_scale: f64,
    /// Largest change of a control point by the shape at factor 1 (m).
    pub shape_size: f64,
    /// Largest curvatures of the radius of a ring (m/rad²): by the shape at factor 1, and by different radii of the round surface.
    shape_curvature: f64,
    round_curvature: f64,
    /// Bounds of [`SurfaceSpline::turning_rates`] for the round surface and for the shape at factor 1 (m/rad).
    round_rates: Vec<f64>,
    shape_rates: Vec<f64>,
    /// Smallest and largest angle of a node from the first node of its sector (rad).
    spread: [f64; 2],
    /// Largest angle (rad) by which the closest point of a node lies beside its undisplaced position, without the eccentricity of the shaft: a
    /// run ends when u²/2r exceeds the clearance.
    largest_shift: f64,
    /// Smallest radius of a node (m).
    smallest_radius: f64,
    /// Deviation of a ring through this number of points from a circle (m).
    pub ripple: f64,
    factor: f64,
    /// Revolutions of the rotor over the current step.
    pub turned: f64,
    instruction_set: InstructionSet,
    /// The first node, `node · lanes + lane`, that is beyond the extension of the surface ([`super::surface_spline::REACH`]).
    pub out_of_reach: Option<usize>,
}

impl SplineGap {
    /// Creates the gap function; `surface` is the round one, and `shape` is its change of control points at factor 1, empty if there is
    /// none.
    pub fn new(
        layout: Layout,
        nominal_clearance: f64,
        surface: SurfaceSpline,
        shape: Vec<Vector3>,
        angular_scale: f64,
    ) -> Self {
        let largest = shape.iter().fold(0.0, |most: f64, change| most.max(change.dot(change)));
        let radius = layout.radii.iter().fold(0.0, |most: f64, radius| most.max(*radius));
        let round = surface.control_points().to_vec();
        let smallest_radius = layout.radii.iter().copied().fold(f64::INFINITY, f64::min);
        let clearance = layout.clearances.iter().copied().filter(|one| one.is_finite()).fold(0.0, f64::max);
        Self {
            shape_size: largest.sqrt(),
            // The radial direction turns, so second differences of displacements differ from those of radii.
            shape_curvature: largest_curvature(&surface, |index| shape.get(index).copied().unwrap_or_default())
                + largest.sqrt(),
            round_curvature: largest_curvature(&surface, |index| Vector3::x() * round[index].xy().norm()),
            round_rates: surface.turning_rates(&round),
            shape_rates: surface.turning_rates(&shape),
            spread: spread(&layout),
            largest_shift: (2.0 * clearance / smallest_radius).sqrt().max(LEAST_SHIFT),
            smallest_radius,
            // The sagitta of a facet.
            ripple: 0.125 * radius * surface.spacing() * surface.spacing(),
            nodes: (0..layout.nodes()).collect(),
            frames: frames(&layout),
            first_node: 0,
            layout,
            nominal_clearance,
            round,
            surface,
            shape,
            angular_scale,
            factor: 0.0,
            turned: 0.0,
            instruction_set: InstructionSet::detect(),
            out_of_reach: None,
        }
    }

    /// Moves the control points: shape factor, and displacements `moved` (m, three per control point; empty = rigid).
    pub fn follow(&mut self, factor: f64, moved: &[f64]) {
        if moved.is_empty() && (self.shape.is_empty() || factor.to_bits() == self.factor.to_bits()) {
            return;
        }
        self.factor = factor;
        self.surface.set_control_points(|index| {
            let shaped = self.shape.get(index).map_or(self.round[index], |shape| self.round[index] + factor * shape);
            if moved.is_empty() { shaped } else { shaped + vector3_at(moved, index) }
        });
    }

    /// See [`super::GapLaw::evaluate`]; without a `guess` the search starts from the angle. Nodes out of reach have no
    /// surface to touch and are reported by [`SplineGap::out_of_reach`].
    pub fn evaluate(
        &mut self,
        drive: &PrescribedMotion,
        displacement: &[f64],
        moved: &[f64],
        guess: Option<&[ClosestPoint]>,
        geometry: &mut Geometry,
        gap: &mut [f64],
    ) {
        self.follow(drive.shape_factor, moved);
        self.out_of_reach = None;
        let lanes = self.layout.lanes;
        let nodes = self.nodes.iter().flat_map(|node| (0..lanes).map(move |lane| (*node, lane)));
        // Padding lanes are infinitely far away.
        for (node, lane) in nodes.filter(|(_, lane)| self.layout.clearances[*lane].is_finite()) {
            let index = node * lanes + lane;
            let local = strided_vector3(displacement, 3 * node * lanes + lane, lanes);
            let at = At { node, index, drive };
            let (projection, frame) = self.project(at, local, guess.map(|places| places[index]));
            match projection {
                Projection::Found { gap: found, .. } => {
                    (gap[index], geometry.places[index]) = (found.distance, found.foot);
                    geometry.set_normal(index, frame.local(found.normal));
                }
                Projection::BeyondEdge { place } => {
                    gap[index] = NOTHING_TO_TOUCH;
                    geometry.places[index] = place;
                    self.out_of_reach = self.out_of_reach.or(Some(index));
                }
                // The caller detects this: the model no longer describes such a state.
                Projection::Lost => gap[index] = f64::NAN,
            }
        }
    }

    /// Evaluates all gaps to a smooth ring, like [`SplineGap::evaluate`]. `guess` are the closest points before the rotor turned by
    /// [`SplineGap::turned`]; without them, searches start from the angles of the nodes.
    pub(crate) fn evaluate_ring(
        &mut self,
        drive: &PrescribedMotion,
        displacement: &[f64],
        moved: &[f64],
        guess: Option<&[ClosestPoint]>,
        geometry: &mut Geometry,
        gaps: &mut [f64],
    ) {
        self.follow(drive.shape_factor, moved);
        let (search, lanes, mut out_of_reach) = (NearSearch::new(self, drive), self.layout.lanes, None);
        let nodes = self.nodes.iter().flat_map(|node| (0..lanes).map(move |lane| (*node, lane)));
        let faced = nodes.filter(|(_, lane)| self.layout.clearances[*lane].is_finite()).map(|(node, lane)| {
            let index = node * lanes + lane;
            let local = strided_vector3(displacement, 3 * node * lanes + lane, lanes);
            let guess = guess.map(|places| search.advanced(places[index]));
            NearNode { node, index, local, guess }
        });
        search.find_gaps(faced, |NearNode { index, .. }, found| {
            (gaps[index], geometry.places[index]) = (found.distance, found.foot);
            geometry.set_normal(index, found.normal);
            if found.distance == NOTHING_TO_TOUCH {
                out_of_reach = out_of_reach.or(Some(index));
            }
        });
        self.out_of_reach = out_of_reach;
    }

    /// See [`super::GapLaw::largest_bends`].
    pub(super) fn largest_bend(&self, factor: f64, turn: f64) -> f64 {
        // The radius of a ring through points on a circle has a curvature of up to `ripple` per squared radian.
        let curvature = factor.abs() * self.shape_curvature + self.round_curvature + self.ripple;
        0.125 * BEND_SAFETY * curvature * turn * turn
    }

    /// Computes upper bounds of the change of any gap of each sector over a step (m) by everything except the displacement of its node.
    /// `rows` are the displacements of the control points at the end and at the beginning of the step (m); `motions` is scratch memory.
    ///
    /// Let the rotor turn by an angle α relative to the shape. Apart from this rotation, a node moves by at most the changes of its
    /// clearance and of the shaft centre, plus (|α| + rotation of the shape) · |eccentricity|. The rotated surface differs from itself by
    /// at most |α| times [`SurfaceSpline::turning_rates`], and it also deforms ([`SurfaceSpline::patch_motions`]), where the sector faces
    /// it. A distance changes by no more than the sum of these terms.
    pub(crate) fn gap_changes(
        &self,
        drive: &PrescribedMotion,
        motion: &MotionIncrement,
        rows: [&[f64]; 2],
        motions: &mut PatchMotions,
        changes: &mut [f64],
    ) {
        let turn = motion.relative_turn();
        let off_centre = length(drive.shaft) + length(motion.shaft);
        let factor = drive.shape_factor.abs() + motion.shape_factor.abs();
        let shifted = length(motion.shaft) + motion.opening.abs() + (turn + motion.shape_rotation.abs()) * off_centre;
        let common = shifted + self.surface.amplification() * motion.shape_factor.abs() * self.shape_size;
        // The surface is that of the beginning while it turns.
        self.surface.patch_motions(rows, turn, motions);
        let bound =
            |patch: usize| turn * (self.round_rates[patch] + factor * self.shape_rates[patch]) + motions.bound(patch);
        for (lane, change) in changes.iter_mut().enumerate() {
            *change = common + self.largest_faced(self.faced_patches(lane, drive, turn), bound);
        }
    }

    /// Patches around that the nodes of a sector may face while the rotor turns over the shape by up to `turn` (rad) to or from `drive`:
    /// first and last, not reduced to one turn.
    pub(crate) fn faced_patches(&self, lane: usize, drive: &PrescribedMotion, turn: f64) -> [f64; 2] {
        let turned = drive.rotor_angle - drive.shape_rotation;
        let ends = self.spread.map(|offset| self.layout.angles[lane] + turned + offset);
        let beside = length(drive.shaft) / self.smallest_radius;
        self.surface.patches_at(ends, self.largest_shift + beside + turn)
    }

    /// Largest `value` of the patches in a range of [`SplineGap::faced_patches`].
    pub(crate) fn largest_faced(&self, [first, last]: [f64; 2], value: impl Fn(usize) -> f64) -> f64 {
        let around = self.surface.around();
        let whole = real(around);
        let (mut index, _) = split(first - whole * (first / whole).floor(), around);
        let (mut patch, mut largest) = (first, 0.0_f64);
        while patch <= last.min(first + whole) {
            largest = largest.max(value(index));
            index = if index + 1 == around { 0 } else { index + 1 };
            patch += 1.0;
        }
        largest
    }

    /// Returns the closest point of a node displaced by `moved` (m), searched from its previous place or from its angle, and the directions
    /// of the node.
    #[inline(always)]
    fn project(&self, at: At<'_>, moved: Vector3, guess: Option<ClosestPoint>) -> (Projection, PolarFrame) {
        let angle = self.layout.angles[at.index] + at.drive.rotor_angle - at.drive.shape_rotation;
        let frame = PolarFrame::new(angle);
        let arm = self.arm(at.node, at.index % self.layout.lanes, at.drive, moved);
        let point = frame.fixed(arm + self.shaft_offset(angle, at.drive));
        let start = guess.map_or_else(|| self.surface.locate(point), |place| self.surface.advance(place, self.turned));
        (self.surface.project(point, start), frame)
    }

    /// Replaces the contact nodes by points at other places.
    pub(crate) fn of_points(self, layout: Layout) -> Self {
        Self { nodes: (0..layout.nodes()).collect(), frames: frames(&layout), spread: spread(&layout), layout, ..self }
    }

    /// Returns the gap of one node displaced by `moved` (m); the surface is rigid.
    pub(super) fn gap(&mut self, at: At<'_>, moved: Vector3) -> Gap {
        self.follow(at.drive.shape_factor, &[]);
        self.gap_to_current(at, moved)
    }

    /// Returns the gap of one node displaced by `moved` (m) to the current surface; infinite beyond its edges.
    pub(crate) fn gap_to_current(&self, at: At<'_>, moved: Vector3) -> Gap {
        let inwards = Gap { normal: -Vector3::x(), ..Gap::NOTHING };
        match self.project(at, moved, None) {
            (Projection::Found { gap, .. }, frame) => Gap { normal: frame.local(gap.normal), ..gap },
            (Projection::BeyondEdge { place }, _) => Gap { foot: place, ..inwards },
            (Projection::Lost, _) => Gap { distance: f64::NAN, ..inwards },
        }
    }

    /// Displacement of the shaft centre along the directions of a node at `angle` from the shape (m).
    fn shaft_offset(&self, angle: f64, drive: &PrescribedMotion) -> Vector3 {
        // Spares the sine and the cosine of a shaft that does not whirl.
        let whirls = drive.shaft[0] != 0.0 || drive.shaft[1] != 0.0;
        if whirls { PolarFrame::new(angle + drive.shape_rotation).local(drive.shaft) } else { drive.shaft }
    }

    /// Position of a node displaced by `moved` from the shaft centre (m, own directions); additional clearance, which the surface does not
    /// contain, moves it inwards.
    #[inline(always)]
    pub fn arm(&self, node: usize, lane: usize, drive: &PrescribedMotion, moved: Vector3) -> Vector3 {
        let clearance = self.layout.clearances[lane] - self.nominal_clearance + drive.gap_offset + drive.radius_change;
        Vector3::new(self.layout.radii[node] - clearance + moved[0], moved[1], self.layout.axial[node] + moved[2])
    }

    /// Velocity by the motion of the rotor (m/s) of a node displaced by `moved` (m), in its own directions: Ω × (x − e) + ė.
    pub(crate) fn rigid_velocity(
        &self,
        node: usize,
        index: usize,
        drive: &PrescribedMotion,
        moved: Vector3,
    ) -> Vector3 {
        let (arm, shaft) = (self.arm(node, index % self.layout.lanes, drive, moved), drive.shaft_velocity);
        let whirls = shaft[0] != 0.0 || shaft[1] != 0.0;
        let shaft = if whirls { self.frame(index, drive.rotor_angle).local(shaft) } else { shaft };
        Vector3::new(shaft[0] - drive.speed * arm[1], shaft[1] + drive.speed * arm[0], shaft[2])
    }

    /// Position of the contact point at `place` from the shaft centre (m), in the directions of the node.
    pub(crate) fn contact_arm(&self, index: usize, drive: &PrescribedMotion, place: ClosestPoint) -> Vector3 {
        let angle = self.layout.angles[index] + drive.rotor_angle - drive.shape_rotation;
        PolarFrame::new(angle).local(self.surface.evaluate(place).point) - self.shaft_offset(angle, drive)
    }

    /// Returns the displacement of the surface along `normal` by its prescribed motion (m), at a contact point `arm` from the shaft centre
    /// (m, directions of the node).
    pub fn surface_motion(
        &self,
        at: At<'_>,
        arm: Vector3,
        normal: Vector3,
        place: ClosestPoint,
        motion: &MotionIncrement,
    ) -> f64 {
        if motion.is_casing_at_rest() {
            return 0.0;
        }
        let angle = self.layout.angles[at.index] + at.drive.rotor_angle - at.drive.shape_rotation;
        let mut grown = Vector3::zeros();
        if motion.shape_factor != 0.0 && !self.shape.is_empty() {
            for (index, weight) in self.surface.weights(place).iter() {
                grown += motion.shape_factor * weight * self.shape[index];
            }
        }
        let grown = PolarFrame::new(angle).local(grown);
        let arm = arm + self.shaft_offset(angle, at.drive);
        let turned = motion.shape_rotation * Vector3::new(-arm[1], arm[0], 0.0);
        normal[0] * motion.opening + normal.dot(&grown) + normal.dot(&turned)
    }

    /// Angle of the position of a displaced node on the casing (rad), in the fixed frame.
    pub(crate) fn angle_on_casing(&self, at: At<'_>, moved: Vector3) -> f64 {
        let angle = self.layout.angles[at.index] + at.drive.rotor_angle;
        let arm = self.arm(at.node, at.index % self.layout.lanes, at.drive, moved);
        let arm = arm + PolarFrame::new(angle).local(at.drive.shaft);
        angle + libm::atan2(arm[1], arm[0])
    }

    /// Radial, tangential and axial directions of a node at a rotor angle (rad), in the fixed frame.
    pub fn frame(&self, index: usize, rotor_angle: f64) -> PolarFrame {
        PolarFrame::new(self.layout.angles[index] + rotor_angle)
    }
}

/// Smallest and largest angle of a node from the first node of its sector (rad).
fn spread(layout: &Layout) -> [f64; 2] {
    let offsets = layout.angles.chunks_exact(layout.lanes).map(|row| row[0] - layout.angles[0]);
    offsets.fold([0.0; 2], |[low, high]: [f64; 2], offset| [low.min(offset), high.max(offset)])
}

/// Largest second difference of vectors at the control points of each ring, divided by the squared angle between points (m/rad²).
fn largest_curvature(surface: &SurfaceSpline, of: impl Fn(usize) -> Vector3) -> f64 {
    let around = surface.around();
    let differences = (0..surface.control_points().len()).map(|index| {
        let (ring, i) = (index - index % around, index % around);
        let [before, after] = [(i + around - 1) % around, (i + 1) % around].map(|i| of(ring + i));
        (before - 2.0 * of(index) + after).norm()
    });
    differences.fold(0.0, f64::max) / (surface.spacing() * surface.spacing())
}

fn frames(layout: &Layout) -> Vec<PolarFrame> {
    layout.angles.iter().map(|angle| PolarFrame::new(*angle)).collect()
}

/// Returns whether a normal in the directions of a node is that of a casing seen from inside, on a flank below 45°.
pub(crate) fn faces_inwards(normal: Vector3) -> bool {
    length(Vector3::new(0.0, normal[1], normal[2])) <= -normal[0]
}

//! Gap functions: distances of the master nodes from the slave, as affine functions of the displacements.
//!
//! The gap of a node (eq. 3 of the paper) is evaluated at its predicted position and is linear in the correction of the step from there, g
//! = g_p + n·(u − u_p). Each kind of gap function has a file here and a variant of [`GapLaw`].
//!
//! Displacements are those of the structure: along fixed axes, or along (r, θ, z) of a rotating sector. Contact forces have the same
//! coordinates; [`wrench`] converts them to fixed directions.

pub mod frame;
pub mod layout;
pub mod open;
pub mod plane;
pub mod revolution;
pub mod spline;
pub mod surface_spline;
pub mod wrench;

use tiprub_cosim::persist_fields;

pub use crate::math::vector::Vector3;
use crate::math::vector::{ZERO, length, tangential};
use crate::scene::ranges::SMALL;
use layout::Layout;
pub(crate) use layout::sector_angle;
use open::OpenGap;
pub use plane::FixedGap;
pub use revolution::RevolutionGap;
use spline::{NOTHING_TO_TOUCH, SplineGap, faces_inwards};
use surface_spline::{ClosestPoint, SurfaceSpline};
use wrench::At;

/// Prescribed motion of rotor and casing at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PrescribedMotion {
    /// Angle of the rotor θ_r (rad).
    pub rotor_angle: f64,
    /// Speed of the rotor Ω (rad/s).
    pub speed: f64,
    /// Offset added to every radial clearance (m).
    pub gap_offset: f64,
    /// Factor on the shape of the casing (-), with its ramp.
    pub shape_factor: f64,
    /// Rotation of the shape about +z (rad).
    pub shape_rotation: f64,
    /// Uniform change of the casing radius (m).
    pub radius_change: f64,
    /// Displacement of the shaft centre along fixed x, y and z (m): whirl and axial shift.
    pub shaft: Vector3,
    /// Velocity of the shaft centre (m/s).
    pub shaft_velocity: Vector3,
}

persist_fields!(PrescribedMotion {
    rotor_angle,
    speed,
    gap_offset,
    shape_factor,
    shape_rotation,
    radius_change,
    shaft.data.0,
    shaft_velocity.data.0
});

/// Unit normals at one instant, arrays `[node · lanes + lane]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry {
    /// Components of the unit normal, pointing from the slave to the master.
    pub normal: [Vec<f64>; 3],
    /// Closest points on a surface spline; empty for other surfaces.
    pub places: Vec<ClosestPoint>,
}

persist_fields!(Geometry { normal, places });

impl Geometry {
    /// Makes room for all contact nodes and lanes of a structure, `len` in all, with closest points if one of its pairs has them.
    pub fn new(len: usize, has_places: bool) -> Self {
        let places = if has_places { len } else { 0 };
        Self { normal: [vec![0.0; len], vec![0.0; len], vec![0.0; len]], places: vec![ClosestPoint::default(); places] }
    }

    /// Closest point of one node of one lane, on surfaces that have closest points.
    #[inline(always)]
    pub(crate) fn place_at(&self, index: usize) -> ClosestPoint {
        self.places.get(index).copied().unwrap_or_default()
    }

    /// Unit normal of one node of one lane.
    pub fn normal_at(&self, index: usize) -> Vector3 {
        Vector3::new(self.normal[0][index], self.normal[1][index], self.normal[2][index])
    }

    /// Copies all normals and closest points of `other`, which belongs to the same structure.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.normal.iter_mut().zip(&other.normal).for_each(|(own, other)| own.copy_from_slice(other));
        self.places.copy_from_slice(&other.places);
    }

    /// Sets the unit normal of one node of one lane.
    #[inline(always)]
    pub(crate) fn set_normal(&mut self, index: usize, normal: Vector3) {
        self.normal.iter_mut().zip(&normal).for_each(|(values, value)| values[index] = *value);
    }
}

/// Gap of a node to the closest point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Distance along the normal (m): negative inside the surface, infinite if there is nothing to touch, NaN if there is no closest point.
    pub distance: f64,
    /// Unit normal, pointing from the slave to the master.
    pub normal: Vector3,
    /// Closest point on a surface through data points; the default for other surfaces.
    pub foot: ClosestPoint,
}

impl Gap {
    /// Gap of a node without a surface.
    pub const NOTHING: Self =
        Self { distance: NOTHING_TO_TOUCH, normal: ZERO, foot: ClosestPoint { patch: [0; 2], s: 0.0, t: 0.0 } };
}

/// Sliding of a node along a surface: its velocity in the tangent plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sliding {
    /// Unit direction (own directions of the node); 0 without slip.
    pub direction: Vector3,
    /// Speed (m/s).
    pub speed: f64,
}

impl Sliding {
    /// Returns the part of a relative velocity (m/s) in the tangent plane.
    #[inline(always)]
    pub fn new(velocity: Vector3, normal: Vector3) -> Self {
        let along = tangential(velocity, normal);
        let speed = length(along);
        Self { direction: if speed > 0.0 { along / speed } else { Vector3::zeros() }, speed }
    }
}

/// Velocities of a node and of the surface below it (m/s), without prescribed motion.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Vibration {
    pub node: Vector3,
    pub surface: Vector3,
}

/// Gap function of a contact pair, compiled for stepping, for some contact nodes of a structure in all sectors. Arrays have the size of the
/// structure, `[node · lanes + lane]`; a pair reads and writes the elements of its nodes.
#[derive(Debug, Clone, PartialEq)]
pub enum GapLaw {
    /// Constant normals and gaps: plane obstacles and node-to-node pairs.
    Fixed(FixedGap),
    /// Sectors around an axis inside a rigid surface of revolution.
    Revolution(RevolutionGap),
    /// Sectors around an axis inside a surface through data points, rigid or carried by a structure.
    Spline(Box<SplineGap>),
    /// Nodes described in fixed directions against a surface through data points, rigid or carried by a structure.
    Open(Box<OpenGap>),
}

/// Safety factor of the curvature of surfaces in [`GapLaw::largest_bends`]: nodes and normals move as well.
const BEND_SAFETY: f64 = 2.0;

impl GapLaw {
    /// Number of contact nodes per sector of the structure, including those of other pairs.
    pub fn nodes(&self) -> usize {
        match self {
            Self::Fixed(law) => law.gaps.len(),
            Self::Revolution(law) => law.layout.nodes(),
            Self::Spline(law) => law.layout.nodes(),
            Self::Open(law) => law.positions.len(),
        }
    }

    /// Returns the contact nodes of this pair.
    pub fn members(&self) -> Vec<usize> {
        match self {
            Self::Fixed(law) => (0..law.gaps.len()).collect(),
            Self::Revolution(law) => law.nodes.clone(),
            Self::Spline(law) => law.nodes.clone(),
            Self::Open(law) => law.nodes.clone(),
        }
    }

    /// Returns the gap function of nodes inside a surface through data points around an axis.
    pub(crate) fn spline_law(&self) -> Option<&SplineGap> {
        if let Self::Spline(law) = self { Some(law) } else { None }
    }

    /// Returns the gap function of a smooth ring through data points.
    pub(crate) fn smooth_ring(&self) -> Option<&SplineGap> {
        self.spline_law().filter(|law| law.surface.is_smooth_ring())
    }

    /// Returns the surface through data points that the nodes can touch.
    #[inline(always)]
    pub fn spline(&self) -> Option<&SurfaceSpline> {
        match self {
            Self::Fixed(_) | Self::Revolution(_) => None,
            Self::Spline(law) => Some(&law.surface),
            Self::Open(law) => Some(&law.surface),
        }
    }

    /// Returns the positions of the nodes around the axis, if there is one.
    pub fn layout(&self) -> Option<&Layout> {
        match self {
            Self::Fixed(_) | Self::Open(_) => None,
            Self::Revolution(law) => Some(&law.layout),
            Self::Spline(law) => Some(&law.layout),
        }
    }

    /// Returns whether a node that stays within `reach` (m, own directions) of its position cannot touch the surface while the rotor turns
    /// from its current angle to `turned` (rad) and nothing else moves. False if this is unknown.
    pub fn is_clear(&self, at: At<'_>, turned: f64, reach: Vector3) -> bool {
        match self {
            Self::Fixed(law) => law.gaps[at.node] > law.normals[at.node].abs().dot(&reach),
            Self::Revolution(law) => law.is_clear(at, turned, reach),
            Self::Spline(_) | Self::Open(_) => false,
        }
    }

    /// Largest difference by which the gap of a node that stays within `reach` (m, own directions) of its position may be smaller in
    /// between than at both ends (m), while the rotor turns from its current angle to `turned` (rad) and nothing else moves.
    pub fn approach(&self, at: At<'_>, turned: f64, reach: Vector3) -> f64 {
        match self {
            Self::Fixed(law) => 2.0 * law.normals[at.node].abs().dot(&reach),
            Self::Revolution(law) => law.approach(at, turned, reach),
            Self::Spline(_) | Self::Open(_) => f64::INFINITY,
        }
    }

    /// Largest distance of the gap of a fixed node from a straight line in time (m), while the rotor turns by `turn` (rad) at a constant rate
    /// and nothing else moves: the parts that are proportional to the angle and to its square. `None` if it is unknown.
    pub fn largest_bends(&self, factor: f64, turn: f64) -> Option<[f64; 2]> {
        match self {
            Self::Fixed(_) => Some([0.0; 2]),
            Self::Revolution(law) => Some(law.largest_bends(factor, turn)),
            Self::Spline(_) | Self::Open(_) => self.smooth_ring().map(|law| [0.0, law.largest_bend(factor, turn)]),
        }
    }

    /// Lower bound on the gap (m) of a node that stays within `reach` (m, own directions) of its position, for a motion to `end` that is
    /// linear in time while the rotor turns by `turn` relative to the shape (rad): the gap at the narrowest place and time minus the reach.
    /// `None` if it is unknown or the node may leave the surface.
    pub fn least(&self, at: At<'_>, end: &PrescribedMotion, turn: f64, reach: Vector3) -> Option<f64> {
        match self {
            Self::Revolution(law) => law.least(at, end, turn, reach),
            Self::Fixed(_) | Self::Spline(_) | Self::Open(_) => None,
        }
    }

    /// Smallest positive radial clearance, or fixed gap (m); infinite if there is none. For open surfaces a thousandth of the smallest
    /// extent.
    pub fn clearance(&self) -> f64 {
        let all = match self {
            Self::Fixed(law) => &law.gaps,
            Self::Revolution(law) => &law.layout.clearances,
            Self::Spline(law) => &law.layout.clearances,
            Self::Open(law) => return law.clearance(),
        };
        all.iter().copied().filter(|clearance| *clearance > 0.0).fold(f64::INFINITY, f64::min)
    }

    /// Returns the rounding error of a gap (m) that is a distance between points far from the origin.
    pub fn rounding(&self) -> f64 {
        let largest = |all: &mut dyn Iterator<Item = f64>| all.fold(0.0, f64::max);
        let far = match self {
            Self::Fixed(_) | Self::Revolution(_) => 0.0,
            Self::Spline(law) => largest(&mut law.layout.radii.iter().copied()),
            // Its displacements contain the whole flight.
            Self::Open(law) => 8.0 * largest(&mut law.positions.iter().map(|place| length(*place))),
        };
        64.0 * f64::EPSILON * far
    }

    /// Angle over which the casing shape changes noticeably (rad).
    pub(crate) fn angular_scale(&self) -> f64 {
        match self {
            Self::Fixed(_) | Self::Open(_) => f64::INFINITY,
            Self::Revolution(law) => law.surface.angular_scale(),
            Self::Spline(law) => law.angular_scale,
        }
    }

    /// Returns the gap of one node displaced by `moved` (m, own directions) to the current surface. For open surfaces the search starts at
    /// `guess`, if there is one.
    pub fn gap(&mut self, at: At<'_>, moved: Vector3, guess: Option<ClosestPoint>) -> Gap {
        match self {
            Self::Fixed(law) => law.gap(at.node, moved),
            Self::Revolution(law) => law.gap(at, moved),
            Self::Spline(law) => law.gap(at, moved),
            Self::Open(law) => law.gap(at.node, moved, guess),
        }
    }

    /// Computes gaps (m) and normals at an instant, for the displacements `[row · lanes + lane]` of the contact rows (m) and `moved` of the
    /// control points of a surface that a structure carries. `before` is the geometry of the previous step, from which the search for
    /// closest points starts. Gaps are infinite if there is no surface to touch; padding lanes and nodes of other pairs are not written.
    pub fn evaluate(
        &mut self,
        drive: &PrescribedMotion,
        displacement: &[f64],
        moved: &[f64],
        before: Option<&Geometry>,
        geometry: &mut Geometry,
        gap: &mut [f64],
    ) {
        let guess = before.map(|before| &before.places[..]);
        match self {
            Self::Fixed(law) => law.evaluate(displacement, geometry, gap),
            Self::Revolution(law) => law.evaluate(drive, displacement, geometry, gap),
            Self::Spline(law) => law.evaluate(drive, displacement, moved, guess, geometry, gap),
            Self::Open(law) => law.evaluate(displacement, moved, guess, geometry, gap),
        }
    }

    /// Deforms the surface to this factor of its shape, with control points displaced by `moved` (m, three per control point).
    pub fn bend(&mut self, factor: f64, moved: &[f64]) {
        match self {
            Self::Fixed(_) | Self::Revolution(_) => {}
            Self::Spline(law) => law.follow(factor, moved),
            Self::Open(law) => law.follow(moved),
        }
    }

    /// Records that the rotor has turned by `angle` (rad), up to whole turns, since the last evaluation: the search for closest points
    /// starts from there.
    pub fn turn(&mut self, angle: f64) {
        if let Self::Spline(law) = self {
            law.turned = angle / std::f64::consts::TAU;
        }
    }

    /// Largest change of the surface by its shape at factor 1 (m).
    pub(crate) fn shape_size(&self) -> f64 {
        match self {
            Self::Fixed(_) | Self::Open(_) => 0.0,
            Self::Revolution(law) => law.surface.largest_change(),
            Self::Spline(law) => law.shape_size,
        }
    }

    /// Returns the largest change of a gap (m) when the rotor turns by `angle` (rad): under the shape at `factor`, and under a surface through points
    /// that are displaced by up to `moved` (m).
    pub(crate) fn turned_under(&self, angle: f64, factor: f64, moved: f64) -> f64 {
        // At most from one end of the range of a change to the other.
        let part = |scale: f64| 2.0 * (angle / scale).min(1.0);
        let shape = if factor == 0.0 { 0.0 } else { factor * self.shape_size() * part(self.angular_scale()) };
        let Self::Spline(law) = self else { return shape };
        shape + (law.ripple + moved) * part(law.surface.spacing())
    }

    /// Changes of a gap below this (m) are insignificant: a fraction of the radius, or of the extent of open surfaces, since a linear gap
    /// neglects curvature; rounding for fixed gaps.
    pub(crate) fn indifferent(&self, node: usize) -> f64 {
        const CURVED: f64 = 1e-5;
        match self {
            Self::Fixed(law) => 1e-9 * law.gaps[node].abs(),
            Self::Revolution(RevolutionGap { layout, .. }) => CURVED * layout.radii[node],
            Self::Spline(law) => CURVED * law.layout.radii[node],
            Self::Open(law) => CURVED * law.largest,
        }
    }

    /// Returns the first node, `node · lanes + lane`, that has left a surface around an axis.
    pub(crate) fn out_of_reach(&self) -> Option<usize> {
        if let Self::Spline(law) = self { law.out_of_reach } else { None }
    }

    /// Largest displacement (m) that counts as small: a tenth of the smallest radius, or of the extent of the nodes and of their open
    /// surfaces; no limit for fixed obstacles.
    pub(crate) fn largest_displacement(&self) -> f64 {
        if let Self::Open(law) = self {
            return law.largest;
        }
        self.layout().map_or(f64::INFINITY, Layout::largest_displacement)
    }

    /// Returns whether small displacements and a casing seen from inside can describe a contact: not deeper than a tenth of the radius, on
    /// a flank below 45°. For open surfaces only the depth counts.
    pub fn is_plausible(&self, node: usize, gap: f64, normal: Vector3) -> bool {
        match self {
            Self::Fixed(_) => true,
            Self::Revolution(law) => gap > -SMALL * law.layout.radii[node] && normal[1].abs() <= -normal[0],
            Self::Spline(law) => gap > -SMALL * law.layout.radii[node] && faces_inwards(normal),
            Self::Open(law) => gap > -law.largest,
        }
    }

    /// Prescribed velocity of the master relative to the slave (m/s), of a node displaced by `moved` (m, own directions), in the
    /// coordinates of the displacements, whose arcs are r times angles; `index` is `node · lanes + lane`.
    #[inline(always)]
    pub(crate) fn rigid_velocity(&self, At { node, index, drive }: At<'_>, moved: Vector3) -> Vector3 {
        match self {
            Self::Fixed(law) => law.sliding[index],
            Self::Revolution(law) => law.layout.rigid_velocity(node, index, drive, moved),
            Self::Spline(law) => law.rigid_velocity(node, index, drive, moved),
            // Free flight is part of the displacements.
            Self::Open(_) => Vector3::zeros(),
        }
    }

    /// Returns whether sliding may have any direction in the tangent plane, so that it turns within a step.
    pub(crate) fn slides_anywhere(&self) -> bool {
        matches!(self, Self::Open(_))
    }

    /// Returns the sliding of the master along the surface, of a node displaced by `moved` (m, own directions). On surfaces around an axis
    /// axial slip is neglected, as in section 4.3 of the paper.
    #[inline(always)]
    pub(crate) fn sliding(&self, at: At<'_>, moved: Vector3, vibration: Vibration, normal: Vector3) -> Sliding {
        let velocity = self.rigid_velocity(at, moved) + vibration.node - vibration.surface;
        match self {
            Self::Fixed(_) | Self::Open(_) => Sliding::new(velocity, normal),
            Self::Revolution(_) | Self::Spline(_) => Sliding::new(Vector3::new(0.0, velocity[1], 0.0), normal),
        }
    }
}

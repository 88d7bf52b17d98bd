//! Gap functions: where the master nodes are with respect to the slave, as affine functions of their displacement.
//!
//! The gap of a node (eq. 3 of the paper) is evaluated at its predicted place and linear in the correction of the
//! step from there, g = g_p + n·(u − u_p). One kind of gap function is a file
//! here and a variant of [`GapLaw`].
//!
//! Displacements are those of the structure: along fixed axes, or along (r, θ, z) of a sector that turns. Forces of contacts are in
//! the same coordinates; [`wrench`] gives them in fixed directions.

pub mod frame;
pub mod layout;
pub mod open;
pub mod plane;
pub mod revolution;
pub mod shape;
pub mod spline;
pub mod surface_spline;
pub mod wrench;

use crate::persist::persist_fields;
use crate::ranges::SMALL;
use layout::Layout;
pub use layout::sector_angle;
use open::{OpenGap, tangent};
pub use plane::FixedGap;
pub use revolution::RevolutionGap;
use spline::{SplineGap, faces_inwards};
use surface_spline::{ClosestPoint, SurfaceSpline};
use wrench::At;

/// Prescribed motion of rotor and casing at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PrescribedMotion {
    /// Angle of the rotor θ_r (rad).
    pub rotor_angle: f64,
    /// Speed of the rotor Ω (rad/s).
    pub speed: f64,
    /// Added to every radial clearance (m).
    pub gap_offset: f64,
    /// Factor on the shape of the casing (-), ramp included.
    pub shape_factor: f64,
    /// Rotation of the shape about +z (rad).
    pub shape_rotation: f64,
    /// Uniform change of the casing radius (m).
    pub radius_change: f64,
    /// Displacement of the shaft's centre along fixed x, y and z (m): whirl and axial shift.
    pub shaft: [f64; 3],
    /// Velocity of the shaft's centre (m/s).
    pub shaft_velocity: [f64; 3],
}

persist_fields!(PrescribedMotion {
    rotor_angle,
    speed,
    gap_offset,
    shape_factor,
    shape_rotation,
    radius_change,
    shaft,
    shaft_velocity
});

/// Unit normals of one instant, arrays `[node · lanes + lane]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Geometry {
    /// Components of the unit normal, pointing from the slave to the master.
    pub normal: [Vec<f64>; 3],
    /// Closest places on a surface spline; empty for other surfaces.
    pub places: Vec<ClosestPoint>,
}

persist_fields!(Geometry { normal, places });

impl Geometry {
    /// Makes room for all contact nodes and lanes of a structure, `len` in all, with closest points if one of its pairs has them.
    pub fn new(len: usize, has_places: bool) -> Self {
        let places = if has_places { len } else { 0 };
        Self { normal: [vec![0.0; len], vec![0.0; len], vec![0.0; len]], places: vec![ClosestPoint::default(); places] }
    }

    /// Closest place of one node of one lane, on surfaces that have places.
    #[inline(always)]
    pub fn place_at(&self, index: usize) -> ClosestPoint {
        self.places.get(index).copied().unwrap_or_default()
    }

    /// Unit normal of one node of one lane.
    pub fn normal_at(&self, index: usize) -> [f64; 3] {
        [self.normal[0][index], self.normal[1][index], self.normal[2][index]]
    }
}

/// The gap function of a contact pair, compiled for stepping: of some contact nodes of a structure in all sectors. Arrays are
/// those of the structure, `[node · lanes + lane]`; a pair reads and writes the places of its nodes.
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

impl GapLaw {
    /// Number of contact nodes per sector of the structure, those of other pairs included.
    pub fn nodes(&self) -> usize {
        match self {
            Self::Fixed(law) => law.gaps.len(),
            Self::Revolution(law) => law.layout.nodes(),
            Self::Spline(law) => law.layout.nodes(),
            Self::Open(law) => law.positions().len(),
        }
    }

    /// The contact nodes of this pair.
    pub fn members(&self) -> Vec<usize> {
        match self {
            Self::Fixed(law) => (0..law.gaps.len()).collect(),
            Self::Revolution(law) => law.nodes.clone(),
            Self::Spline(law) => law.nodes.clone(),
            Self::Open(law) => law.nodes().to_vec(),
        }
    }

    /// The surface through data points that the nodes meet.
    #[inline(always)]
    pub fn spline(&self) -> Option<&SurfaceSpline> {
        match self {
            Self::Fixed(_) | Self::Revolution(_) => None,
            Self::Spline(law) => Some(&law.surface),
            Self::Open(law) => Some(&law.surface.surface),
        }
    }

    /// Where the nodes stand around the axis, if there is one.
    pub fn layout(&self) -> Option<&Layout> {
        match self {
            Self::Fixed(_) | Self::Open(_) => None,
            Self::Revolution(law) => Some(&law.layout),
            Self::Spline(law) => Some(&law.layout),
        }
    }

    /// Whether a node that stays within `reach` (m, own directions) of where it rests cannot touch while the rotor turns from where it is
    /// to `turned` (rad) and nothing else moves. False where it is not known.
    pub fn is_clear(&self, at: At<'_>, turned: f64, reach: [f64; 3]) -> bool {
        match self {
            Self::Fixed(law) => law.gaps[at.node] > dot(law.normals[at.node].map(f64::abs), reach),
            Self::Revolution(law) => law.is_clear(at, turned, reach),
            Self::Spline(_) | Self::Open(_) => false,
        }
    }

    /// By how much the gap of a node that stays within `reach` (m, own directions) of where it rests may be smaller on the way than at its
    /// ends (m), while the rotor turns from where it is to `turned` (rad) and nothing else moves.
    pub fn approach(&self, at: At<'_>, turned: f64, reach: [f64; 3]) -> f64 {
        match self {
            Self::Fixed(law) => 2.0 * dot(law.normals[at.node].map(f64::abs), reach),
            Self::Revolution(law) => law.approach(at, turned, reach),
            Self::Spline(_) | Self::Open(_) => f64::INFINITY,
        }
    }

    /// The gap that a node which stays within `reach` (m, own directions) of where it rests keeps at least on a way to `end` that
    /// is linear in time, while the rotor turns by `turn` against the shape (rad): that of the narrowest place at the narrowest time,
    /// less the reach. `None` where that is not known, or not met on the way (m).
    pub fn least(&self, at: At<'_>, end: &PrescribedMotion, turn: f64, reach: [f64; 3]) -> Option<f64> {
        match self {
            Self::Revolution(law) => law.least(at, end, turn, reach),
            Self::Fixed(_) | Self::Spline(_) | Self::Open(_) => None,
        }
    }

    /// Smallest radial clearance, or fixed gap, above 0 (m); infinite where there is none. Of open surfaces a thousandth of the smallest
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
            // Its displacements are those of all its flight.
            Self::Open(law) => 8.0 * largest(&mut law.positions().iter().map(|place| dot(*place, *place).sqrt())),
        };
        64.0 * f64::EPSILON * far
    }

    /// Angle over which the casing shape changes noticeably (rad).
    pub fn angular_scale(&self) -> f64 {
        match self {
            Self::Fixed(_) | Self::Open(_) => f64::INFINITY,
            Self::Revolution(law) => law.surface.angular_scale(),
            Self::Spline(law) => law.angular_scale,
        }
    }

    /// Normals and places of the nodes of a structure that meets nothing else, with rows of `lanes` lanes.
    pub fn geometry(&self, lanes: usize) -> Geometry {
        let mut geometry = Geometry::new(self.nodes() * lanes, self.spline().is_some());
        self.prepare(lanes, &mut geometry);
        geometry
    }

    /// Write what never changes, with rows of `lanes` lanes.
    pub fn prepare(&self, lanes: usize, geometry: &mut Geometry) {
        if let Self::Fixed(law) = self {
            law.prepare(lanes, geometry);
        }
    }

    /// Gap (m), unit normal and place of one node displaced by `moved` (m, own directions) against a surface as it is now; a place
    /// only on surfaces through data points. On open ones it is sought from `guess`, if there is one.
    pub fn gap_of_node(
        &mut self,
        at: At<'_>,
        moved: [f64; 3],
        guess: Option<ClosestPoint>,
    ) -> (f64, [f64; 3], ClosestPoint) {
        let (gap, normal) = match self {
            Self::Fixed(law) => (law.gaps[at.node] + dot(law.normals[at.node], moved), law.normals[at.node]),
            Self::Revolution(law) => law.gap_of_node(at, moved),
            Self::Spline(law) => return law.gap_of_node(at, moved),
            Self::Open(law) => return law.gap_of_node(at.node, moved, guess),
        };
        (gap, normal, ClosestPoint::default())
    }

    /// Gaps (m) and normals at an instant, for the displacements `[row · lanes + lane]` of the contact rows (m) and `moved` of the
    /// control points of a surface that is carried by a structure. `before` is the geometry of the step before, from which
    /// closest points are sought. Gaps are infinite where there is nothing to touch; padding lanes and nodes of other pairs are
    /// not written.
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
            Self::Fixed(law) => law.evaluate(displacement, gap),
            Self::Revolution(law) => law.evaluate(drive, displacement, geometry, gap),
            Self::Spline(law) => law.evaluate(drive, displacement, moved, guess, geometry, gap),
            Self::Open(law) => law.evaluate(displacement, moved, guess, geometry, gap),
        }
    }

    /// The surface is as with this factor of its shape and control points displaced by `moved` (m, three per control point).
    pub fn bend(&mut self, factor: f64, moved: &[f64]) {
        match self {
            Self::Fixed(_) | Self::Revolution(_) => {}
            Self::Spline(law) => law.follow(factor, moved),
            Self::Open(law) => law.surface.follow(moved),
        }
    }

    /// The rotor has turned by `angle` (rad), to whole turns, since the last evaluation: closest points are sought from there.
    pub fn turn(&mut self, angle: f64) {
        if let Self::Spline(law) = self {
            law.turned = angle / std::f64::consts::TAU;
        }
    }

    /// Largest change of the surface by its shape at factor 1 (m).
    pub fn shape_size(&self) -> f64 {
        match self {
            Self::Fixed(_) | Self::Open(_) => 0.0,
            Self::Revolution(law) => law.surface.largest_change(),
            Self::Spline(law) => law.shape_size,
        }
    }

    /// Returns the largest change of a gap (m) when the rotor turns by `angle` (rad): under the shape at `factor`, and under a surface through points
    /// that are displaced by up to `moved` (m).
    pub fn turned_under(&self, angle: f64, factor: f64, moved: f64) -> f64 {
        // From one end of the range of a change to the other at most.
        let part = |scale: f64| 2.0 * (angle / scale).min(1.0);
        let shape = if factor == 0.0 { 0.0 } else { factor * self.shape_size() * part(self.angular_scale()) };
        let Self::Spline(law) = self else { return shape };
        shape + (law.ripple + moved) * part(law.surface.spacing())
    }

    /// Changes of a gap below this (m) say nothing: a share of the radius, or of the extent of open surfaces, for the
    /// curvature that a linear gap leaves out; rounding of fixed gaps.
    pub fn indifferent(&self, node: usize) -> f64 {
        const CURVED: f64 = 1e-5;
        match self {
            Self::Fixed(law) => 1e-9 * law.gaps[node].abs(),
            Self::Revolution(RevolutionGap { layout, .. }) => CURVED * layout.radii[node],
            Self::Spline(law) => CURVED * law.layout.radii[node],
            Self::Open(law) => CURVED * law.largest(),
        }
    }

    /// The first node, `node · lanes + lane`, that has left a surface around an axis for good.
    pub fn out_of_reach(&self) -> Option<usize> {
        if let Self::Spline(law) = self { law.out_of_reach } else { None }
    }

    /// Largest displacement (m) that counts as small: a tenth of the smallest radius, or of the extent of open surfaces and
    /// what they meet; no limit for fixed obstacles.
    pub fn largest_displacement(&self) -> f64 {
        if let Self::Open(law) = self {
            return law.largest();
        }
        let radii = self.layout().map(|layout| layout.radii.iter());
        radii.map_or(f64::INFINITY, |radii| SMALL * radii.fold(f64::INFINITY, |low: f64, radius| low.min(*radius)))
    }

    /// Whether a contact is within what small displacements and a casing seen from inside can describe: less deep than
    /// a tenth of the radius, on a flank below 45°. On open surfaces the depth alone counts.
    pub fn is_plausible(&self, node: usize, gap: f64, normal: [f64; 3]) -> bool {
        match self {
            Self::Fixed(_) => true,
            Self::Revolution(law) => gap > -SMALL * law.layout.radii[node] && normal[1].abs() <= -normal[0],
            Self::Spline(law) => gap > -SMALL * law.layout.radii[node] && faces_inwards(normal),
            Self::Open(law) => gap > -law.largest(),
        }
    }

    /// Prescribed velocity of the master relative to the slave (m/s), of a node displaced by `moved` (m, own directions);
    /// `index` is `node · lanes + lane`. In the coordinates of the displacements, whose arcs are r times angles.
    #[inline(always)]
    pub fn sliding_velocity(&self, node: usize, index: usize, drive: &PrescribedMotion, moved: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Fixed(law) => law.sliding[index],
            Self::Revolution(law) => law.layout.rigid_velocity(node, index, drive, moved),
            Self::Spline(law) => law.rigid_velocity(node, index, drive, moved),
            // Free flight is part of the displacements.
            Self::Open(_) => [0.0; 3],
        }
    }

    /// Whether sliding takes any direction of the tangent plane, so that it turns within a step.
    pub fn slides_anywhere(&self) -> bool {
        matches!(self, Self::Open(_))
    }

    /// Unit slip direction of the master in the tangent plane, from the predicted relative velocity (m/s); zero
    /// when nothing slides. On surfaces of revolution axial slip is neglected, as in section 4.3 of the paper.
    pub fn slip_direction(&self, velocity: [f64; 3], normal: [f64; 3]) -> [f64; 3] {
        let candidate = match self {
            Self::Fixed(_) | Self::Open(_) => velocity,
            Self::Revolution(_) | Self::Spline(_) => [0.0, velocity[1], 0.0],
        };
        tangent(candidate, normal)
    }
}

/// Scalar product.
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

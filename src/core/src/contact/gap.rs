//! Gap functions: where the master nodes are with respect to the slave, as affine functions of their displacement.
//!
//! The gap of a node (eq. 3 of the paper) is evaluated at its predicted place and linear in the correction of the
//! step from there, g = g_p + n·(u − u_p). For a surface of revolution with shape s(θ) and meridional slope m,
//! F = r_c(θ + u_θ/r, z) − r − u_r + m u_z has the gradient (−1, s'/r, m) with respect to (radial, tangential, axial)
//! displacement; dividing by its length N gives the unit normal from the casing to the blade and the gap F/N. The
//! slope is what lets a frictionless lobe draw power from the shaft: r n_θ λ is the torque conjugate to θ_r.
//!
//! u_θ is an arc: the node stands at φ = θ_node + θ_r + u_θ/r and the radius r + u_r, so that what is conjugate to u_θ is
//! (1 + u_r/r) times the tangential force there. Forces of contacts are in these coordinates; [`super::wrench`] gives them
//! in fixed directions. With the shaft's centre at (e_r, e_t, e_z), seen along the directions at φ, the node is at the
//! radius ρ = √(a² + e_t²), a = r + u_r + e_r, and at φ + δ, tan δ = e_t/a, from the axis of the casing:
//!
//! F = r_c(φ + δ) − ρ + m (u_z + e_z),  ∇F = (−cos δ − s' sin δ/ρ, (1 + u_r/r)(−sin δ + s' cos δ/ρ), m).

use super::layout::Layout;
pub use super::layout::sector_angle;
use super::open_gap::{OpenGap, tangent};
use super::spline::{ClosestPoint, SurfaceSpline};
use super::spline_gap::{Frame, SplineGap, faces_inwards};
use super::surface::Surface;
use super::wrench::{At, Motion};
use crate::dynamics::dispatch::{InstructionSet, Kernel};
use crate::persist::persist_fields;
use crate::settings::Meridian;
use crate::{Result, Rom};

/// Prescribed motion of rotor and casing at one instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drive {
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
    /// Its velocity (m/s).
    pub shaft_velocity: [f64; 3],
}

persist_fields!(Drive {
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
    /// Of all contact nodes and lanes of a structure, `len` in all, with places where one of its pairs has them.
    pub fn new(len: usize, has_places: bool) -> Self {
        let places = if has_places { len } else { 0 };
        Self { normal: [vec![0.0; len], vec![0.0; len], vec![0.0; len]], places: vec![ClosestPoint::default(); places] }
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

/// Constant normals, gaps and sliding velocities of one group of contacts.
#[derive(Debug, Clone, PartialEq)]
pub struct FixedGap {
    /// Unit normal of each contact, from the slave to the master.
    pub normals: Vec<[f64; 3]>,
    /// Initial gap of each contact (m).
    pub gaps: Vec<f64>,
    /// Prescribed velocity of the master relative to the slave (m/s), on top of the deformation.
    pub sliding: Vec<[f64; 3]>,
}

/// Contact nodes of equally spaced sectors facing a surface of revolution.
#[derive(Debug, Clone, PartialEq)]
pub struct RevolutionGap {
    surface: Surface,
    instruction_set: InstructionSet,
    /// Where the contact nodes of the structure are.
    pub layout: Layout,
    /// Those that meet the surface.
    nodes: Vec<usize>,
    /// Meridional slope per contact node of the structure.
    slopes: Vec<f64>,
    /// The shaft's centre moves.
    shaft_moves: bool,
    /// Scratch of one row where it does: the node's place from the axis of the casing along its own directions (m).
    arms: [Vec<f64>; 2],
}

impl RevolutionGap {
    /// Place `rom.sectors` sectors around the axis, all contact nodes facing the surface; `clearances` holds one radial clearance
    /// (m) per sector.
    ///
    /// # Errors
    /// Wrong number of clearances.
    pub fn new(rom: &Rom, surface: Surface, clearances: &[f64], meridian: Meridian, lanes: usize) -> Result<Self> {
        let slope = |slope: f64| if meridian == Meridian::Contour { slope } else { 0.0 };
        Ok(Self {
            surface,
            instruction_set: InstructionSet::detect(),
            layout: Layout::new(rom, clearances, lanes)?,
            nodes: (0..rom.contact_nodes.len()).collect(),
            slopes: rom.contact_nodes.iter().map(|node| slope(node.meridional_slope)).collect(),
            shaft_moves: false,
            arms: [Vec::new(), Vec::new()],
        })
    }

    /// Only these contact nodes of the structure.
    pub fn of_nodes(self, nodes: Vec<usize>) -> Self {
        Self { nodes, ..self }
    }

    /// Let whirl and axial shift of the shaft act.
    pub fn with_moving_shaft(self, shaft_moves: bool) -> Self {
        let room = || vec![0.0; if shaft_moves { self.layout.lanes } else { 0 }];
        Self { shaft_moves, arms: [room(), room()], ..self }
    }

    fn evaluate(&mut self, drive: &Drive, displacement: &[f64], geometry: &mut Geometry, gap: &mut [f64]) {
        if !self.shaft_moves {
            let law = Evaluate::<false> { law: self, drive, displacement, geometry, gap, arms: [&mut [], &mut []] };
            return self.instruction_set.run(law);
        }
        let [mut outwards, mut sideways] = std::mem::take(&mut self.arms);
        let arms = [&mut outwards[..], &mut sideways[..]];
        self.instruction_set.run(Evaluate::<true> { law: self, drive, displacement, geometry, gap, arms });
        self.arms = [outwards, sideways];
    }
}

impl RevolutionGap {
    /// How far prescribed motion of the surface has taken it along the normal at a node displaced by `moved` (m), whose
    /// normal has the radial part `facing`: the share n_r/(n_r N) of what it has moved outwards.
    pub fn surface_motion(&self, at: At<'_>, moved: [f64; 3], facing: f64, motion: &Motion) -> f64 {
        if motion.casing_rests() {
            return 0.0;
        }
        let (angle, drive) = (self.angle(at, moved), at.drive);
        let [outwards, sideways] = self.shaft_offset(angle, drive);
        let arm = self.layout.radii[at.node] + moved[0] + outwards;
        let distance = libm::hypot(arm, sideways);
        let seen = angle + libm::atan2(sideways, arm) - drive.shape_rotation;
        let (shape, slope) = self.surface.evaluate(seen);
        let tilt = arm / distance + drive.shape_factor * slope * sideways / (distance * distance);
        let turned = drive.shape_factor * slope * motion.shape_rotation;
        facing / tilt * (motion.opening + motion.shape_factor * shape - turned)
    }

    /// Angle of a displaced node about the shaft's centre (rad).
    fn angle(&self, at: At<'_>, moved: [f64; 3]) -> f64 {
        self.layout.angles[at.index] + at.drive.rotor_angle + moved[1] * self.layout.per_radius[at.node]
    }

    /// Displacement of the shaft's centre across and along the circumference at an angle (m).
    fn shaft_offset(&self, angle: f64, drive: &Drive) -> [f64; 2] {
        if !self.shaft_moves {
            return [0.0; 2];
        }
        let [outwards, sideways, _] = Frame::new(angle).local(drive.shaft);
        [outwards, sideways]
    }

    /// Angle at which a displaced node faces the casing (rad), in the fixed frame.
    pub fn angle_on_casing(&self, at: At<'_>, moved: [f64; 3]) -> f64 {
        let angle = self.angle(at, moved);
        let [outwards, sideways] = self.shaft_offset(angle, at.drive);
        angle + libm::atan2(sideways, self.layout.radii[at.node] + moved[0] + outwards)
    }
}

/// arctan t for |t| ≤ 0.2 (truncation below 1e-16 of t), without branches or calls.
#[inline(always)]
fn small_arc_tangent(t: f64) -> f64 {
    let square = t * t;
    let series = [19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0].into_iter();
    t * (1.0 - square * series.fold(1.0 / 21.0, |sum, odd: f64| 1.0 / odd - square * sum))
}

/// Gaps and normals of all nodes and lanes on a surface of revolution. `SHAFT`: the shaft's centre moves.
struct Evaluate<'a, const SHAFT: bool> {
    law: &'a RevolutionGap,
    drive: &'a Drive,
    displacement: &'a [f64],
    geometry: &'a mut Geometry,
    gap: &'a mut [f64],
    arms: [&'a mut [f64]; 2],
}

impl<const SHAFT: bool> Kernel for Evaluate<'_, SHAFT> {
    #[inline(always)]
    fn run(self) {
        let Self { law, drive, displacement, geometry, gap, arms: [arms, offsets] } = self;
        let opening = drive.gap_offset + drive.radius_change;
        let turned = drive.rotor_angle - drive.shape_rotation;
        let factor = drive.shape_factor;
        let lanes = law.layout.lanes;
        for &node in &law.nodes {
            let (slope, radius, per_radius) = (law.slopes[node], law.layout.radii[node], law.layout.per_radius[node]);
            let span = node * lanes..(node + 1) * lanes;
            let [radial, tangential, axial] =
                std::array::from_fn(|component| &displacement[(3 * node + component) * lanes..][..lanes]);
            let (angles, clearances) = (&law.layout.angles[span.clone()], &law.layout.clearances[..lanes]);
            let [normal_0, normal_1, normal_2] = &mut geometry.normal;
            let normal_0 = &mut normal_0[span.clone()];
            let (normal_1, normal_2) = (&mut normal_1[span.clone()], &mut normal_2[span.clone()]);
            let gap = &mut gap[span];
            // The normal arrays hold angle, shape and slope of the shape until they are overwritten.
            for lane in 0..lanes {
                normal_0[lane] = angles[lane] + turned + tangential[lane] * per_radius;
                if SHAFT {
                    let (sine, cosine) = libm::sincos(normal_0[lane] + drive.shape_rotation);
                    let outwards = drive.shaft[0] * cosine + drive.shaft[1] * sine;
                    let offset = drive.shaft[1] * cosine - drive.shaft[0] * sine;
                    let arm = radius + radial[lane] + outwards;
                    let distance = (arm * arm + offset * offset).sqrt();
                    normal_0[lane] += small_arc_tangent(offset / arm);
                    (arms[lane], offsets[lane]) = (arm, offset);
                    // ρ − r − u_r without cancellation: what the shaft closes of the gap; set before the gap is written.
                    gap[lane] = outwards + offset * offset / (distance + arm) - slope * drive.shaft[2];
                }
            }
            law.surface.evaluate_row(normal_0, normal_1, normal_2);
            for lane in 0..lanes {
                let (mut facing, mut sideways) = (1.0, factor * normal_2[lane] * per_radius);
                let mut clearance = clearances[lane] + opening + factor * normal_1[lane];
                if SHAFT {
                    let (arm, offset) = (arms[lane], offsets[lane]);
                    let per_distance = 1.0 / (arm * arm + offset * offset).sqrt();
                    let (sine, cosine) = (offset * per_distance, arm * per_distance);
                    let steepness = factor * normal_2[lane] * per_distance;
                    facing = cosine + steepness * sine;
                    sideways = (1.0 + radial[lane] * per_radius) * (steepness * cosine - sine);
                    clearance -= gap[lane];
                }
                let per_length = 1.0 / (facing * facing + sideways * sideways + slope * slope).sqrt();
                gap[lane] = (clearance - radial[lane] + slope * axial[lane]) * per_length;
                normal_0[lane] = -facing * per_length;
                normal_1[lane] = sideways * per_length;
                normal_2[lane] = slope * per_length;
            }
        }
    }
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
            for (node, normal) in law.normals.iter().enumerate() {
                for component in 0..3 {
                    geometry.normal[component][node * lanes] = normal[component];
                }
            }
        }
    }

    /// Gaps (m) and normals at an instant, for the displacements `[row · lanes + lane]` of the contact rows (m) and `moved` of the
    /// control points of a surface that is carried by a structure. `before` is the geometry of the step before, from which
    /// closest points are sought. Gaps are infinite where there is nothing to touch; padding lanes and nodes of other pairs are
    /// not written.
    pub fn evaluate(
        &mut self,
        drive: &Drive,
        displacement: &[f64],
        moved: &[f64],
        before: Option<&Geometry>,
        geometry: &mut Geometry,
        gap: &mut [f64],
    ) {
        let guess = before.map(|before| &before.places[..]);
        match self {
            Self::Fixed(law) => {
                for (node, (normal, initial)) in law.normals.iter().zip(&law.gaps).enumerate() {
                    gap[node] = initial + dot(*normal, std::array::from_fn(|i| displacement[3 * node + i]));
                }
            }
            Self::Revolution(law) => law.evaluate(drive, displacement, geometry, gap),
            Self::Spline(law) => law.evaluate(drive, displacement, moved, guess, geometry, gap),
            Self::Open(law) => law.evaluate(displacement, moved, guess, geometry, gap),
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

    /// What turning by `angle` (rad) can do to a gap (m): under the shape at `factor`, and under a surface laid through
    /// points that are displaced by up to `moved` (m).
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
        radii.map_or(f64::INFINITY, |radii| 0.1 * radii.fold(f64::INFINITY, |low: f64, radius| low.min(*radius)))
    }

    /// Whether a contact is within what small displacements and a casing seen from inside can describe: less deep than
    /// a tenth of the radius, on a flank below 45°. On open surfaces the depth alone counts.
    pub fn is_plausible(&self, node: usize, gap: f64, normal: [f64; 3]) -> bool {
        match self {
            Self::Fixed(_) => true,
            Self::Revolution(law) => gap > -0.1 * law.layout.radii[node] && normal[1].abs() <= -normal[0],
            Self::Spline(law) => gap > -0.1 * law.layout.radii[node] && faces_inwards(normal),
            Self::Open(law) => gap > -law.largest(),
        }
    }

    /// Prescribed velocity of the master relative to the slave (m/s), of a node displaced by `moved` (m, own directions);
    /// `index` is `node · lanes + lane`. In the coordinates of the displacements, whose arcs are r times angles.
    #[inline(always)]
    pub fn sliding_velocity(&self, node: usize, index: usize, drive: &Drive, moved: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Fixed(law) => law.sliding[index],
            Self::Revolution(law) => law.layout.rigid_velocity(node, index, drive, moved),
            Self::Spline(law) => law.rigid_velocity(node, index, drive, moved),
            // Free flight is part of the displacements.
            Self::Open(_) => [0.0; 3],
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Shape;

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let lanes = 16;
        let shape = Shape::TwoLobe { depth: 0.6, width: 0.15, phase: 0.3 };
        let law = |instruction_set| RevolutionGap {
            surface: Surface::new(&shape, 3.56e-4).unwrap(),
            instruction_set,
            layout: Layout {
                lanes,
                angles: (0..16).map(|lane| 0.41 * f64::from(lane)).collect(),
                radii: vec![0.25],
                per_radius: vec![4.0],
                axial: vec![0.0],
                clearances: vec![3.56e-4; 16],
            },
            nodes: vec![0],
            slopes: vec![-0.26],
            shaft_moves: false,
            arms: [Vec::new(), Vec::new()],
        };
        let displacement: Vec<f64> = (0..48).map(|i| 1e-4 * f64::from(i).sin()).collect();
        let drive = Drive { rotor_angle: 1.1, shape_factor: 1.0, ..Drive::default() };
        let run = |instruction_set| {
            let mut law = GapLaw::Revolution(law(instruction_set));
            let (mut geometry, mut gap) = (Geometry::new(lanes, false), vec![0.0; 16]);
            law.evaluate(&drive, &displacement, &[], None, &mut geometry, &mut gap);
            let all = geometry.normal.iter().flatten().chain(&gap);
            all.map(|value| value.to_bits()).collect::<Vec<_>>()
        };
        assert_eq!(run(InstructionSet::Baseline), run(InstructionSet::detect()));
    }
}

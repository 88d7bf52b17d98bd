//! Sectors around an axis inside a rigid surface of revolution with a shape around the circumference.
//!
//! For a surface of revolution with shape s(θ) and meridional slope m, F = r_c(θ + u_θ/r, z) − r − u_r + m u_z has the gradient (−1, s'/r,
//! m) with respect to (radial, tangential, axial) displacement; dividing by its length N gives the unit normal from the casing to the blade
//! and the gap F/N. Because of the slope s' a frictionless lobe can draw power from the shaft: r n_θ λ is the torque conjugate to θ_r.
//!
//! u_θ is an arc: the node is at φ = θ_node + θ_r + u_θ/r and the radius r + u_r, so that the force conjugate to u_θ is (1 + u_r/r) times
//! the tangential force there. With the shaft centre at (e_r, e_t, e_z) in the directions at φ, the node is at the radius ρ = √(a² + e_t²),
//! a = r + u_r + e_r, and at φ + δ, tan δ = e_t/a, from the axis of the casing:
//!
//! F = r_c(φ + δ) − ρ + m (u_z + e_z),  ∇F = (−cos δ − s' sin δ/ρ, (1 + u_r/r)(−sin δ + s' cos δ/ρ), m).

use super::BEND_SAFETY;
use super::frame::PolarFrame;
use super::layout::Layout;
use super::surface_spline::ClosestPoint;
use super::wrench::{At, MotionIncrement};
use super::{Gap, Geometry, PrescribedMotion, Vector3};
use crate::math::simd::{InstructionSet, Kernel};
use crate::math::vector::length;
use crate::scene::settings::Meridian;
use crate::scene::shape::CompiledShape;
use crate::{Result, Rom};

/// Contact nodes of equally spaced sectors facing a surface of revolution.
#[derive(Debug, Clone, PartialEq)]
pub struct RevolutionGap {
    /// Shape of the surface.
    pub(crate) surface: CompiledShape,
    instruction_set: InstructionSet,
    /// Positions of the contact nodes of the structure.
    pub layout: Layout,
    /// Contact nodes that can touch the surface.
    pub(crate) nodes: Vec<usize>,
    /// Meridional slope per contact node of the structure.
    pub(crate) slopes: Vec<f64>,
    /// True if the shaft centre moves.
    pub(crate) shaft_moves: bool,
    /// Scratch of one row if the shaft centre moves: the position of the node from the axis of the casing along its own directions (m).
    arms: [Vec<f64>; 2],
}

impl RevolutionGap {
    /// Places `rom.sectors` sectors around the axis, with all contact nodes facing the surface; `clearances` contains one radial clearance
    /// (m) per sector.
    ///
    /// # Errors
    /// Wrong number of clearances.
    pub fn new(
        rom: &Rom,
        surface: CompiledShape,
        clearances: &[f64],
        meridian: Meridian,
        lanes: usize,
    ) -> Result<Self> {
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

    /// Restricts the gap function to these contact nodes of the structure.
    pub fn of_nodes(self, nodes: Vec<usize>) -> Self {
        Self { nodes, ..self }
    }

    /// Replaces the contact nodes by points at other places, with the slopes of the surface there.
    pub(crate) fn of_points(self, layout: Layout, slopes: Vec<f64>) -> Self {
        Self { nodes: (0..layout.nodes()).collect(), layout, slopes, ..self }
    }

    /// Enables whirl and axial shift of the shaft.
    pub(crate) fn with_moving_shaft(self, shaft_moves: bool) -> Self {
        let room = || vec![0.0; if shaft_moves { self.layout.lanes } else { 0 }];
        Self { shaft_moves, arms: [room(), room()], ..self }
    }

    pub(super) fn evaluate(
        &mut self,
        drive: &PrescribedMotion,
        displacement: &[f64],
        geometry: &mut Geometry,
        gap: &mut [f64],
    ) {
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
    /// Returns the displacement of the surface along the normal by its prescribed motion (m), at a node displaced by `moved` (m) whose normal has the
    /// radial part `facing`: n_r/(n_r N) times the outward displacement.
    pub fn surface_motion(&self, at: At<'_>, moved: Vector3, facing: f64, motion: &MotionIncrement) -> f64 {
        if motion.is_casing_at_rest() {
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

    /// Returns the gap of one node displaced by `moved` (m).
    pub fn gap(&self, at: At<'_>, moved: Vector3) -> Gap {
        let (node, drive, radius) = (at.node, at.drive, self.layout.radii[at.node]);
        let (slope, per_radius) = (self.slopes[node], self.layout.per_radius[node]);
        let angle = self.angle(at, moved);
        let [outwards, sideways] = self.shaft_offset(angle, drive);
        let arm = radius + moved[0] + outwards;
        let distance = libm::hypot(arm, sideways);
        let (shape, steepness) = self.surface.evaluate(angle - drive.shape_rotation + libm::atan2(sideways, arm));
        // ρ − r − u_r without cancellation.
        let shifted = outwards + sideways * sideways / (distance + arm);
        let along = if self.shaft_moves { drive.shaft[2] } else { 0.0 };
        let clearance = self.layout.clearances[at.index % self.layout.lanes] + drive.gap_offset + drive.radius_change;
        let (sine, cosine) = (sideways / distance, arm / distance);
        let per_arc = drive.shape_factor * steepness / distance;
        let gradient = match self.shaft_moves {
            true => [-cosine - per_arc * sine, (1.0 + moved[0] * per_radius) * (per_arc * cosine - sine), slope],
            false => [-1.0, drive.shape_factor * steepness * per_radius, slope],
        };
        let gradient = Vector3::from(gradient);
        let per_length = 1.0 / length(gradient);
        let open = clearance + drive.shape_factor * shape - moved[0] - shifted + slope * (moved[2] + along);
        Gap { distance: open * per_length, normal: gradient * per_length, foot: ClosestPoint::default() }
    }

    /// See [`super::GapLaw::is_clear`].
    pub(super) fn is_clear(&self, at: At<'_>, turned: f64, reach: Vector3) -> bool {
        let (node, drive, [from, to]) = (at.node, at.drive, self.swept(at, turned));
        let around = reach[1] * self.layout.per_radius[node];
        let shape = self.surface.least_between(from - around, to + around);
        let clearance = self.layout.clearances[at.index % self.layout.lanes] + drive.gap_offset + drive.radius_change;
        let left = clearance + drive.shape_factor * shape - reach[0] - self.slopes[node].abs() * reach[2];
        // Unknown if the shaft moves or the shape is turned inside out.
        !self.shaft_moves && drive.shape_factor >= 0.0 && left > 0.0
    }

    /// Returns the angles of an undisplaced node from the origin of the shape (rad) before and after the rotor turns to
    /// `turned` (rad), in ascending order.
    fn swept(&self, at: At<'_>, turned: f64) -> [f64; 2] {
        let (seen, angle) = (self.layout.angles[at.index] - at.drive.shape_rotation, at.drive.rotor_angle);
        [seen + angle.min(turned), seen + angle.max(turned)]
    }

    /// See [`super::GapLaw::approach`].
    pub(super) fn approach(&self, at: At<'_>, turned: f64, reach: Vector3) -> f64 {
        let (node, drive, [from, to]) = (at.node, at.drive, self.swept(at, turned));
        let around = reach[1] * self.layout.per_radius[node];
        let ends = self.surface.evaluate(from).0.min(self.surface.evaluate(to).0);
        let dip = drive.shape_factor * (ends - self.surface.lowest_between(from - around, to + around));
        dip + 2.0 * (reach[0] + self.slopes[node].abs() * reach[2])
    }

    /// See [`super::GapLaw::largest_bends`].
    pub(super) fn largest_bends(&self, factor: f64, turn: f64) -> [f64; 2] {
        let curvature = BEND_SAFETY * self.surface.largest_curvature();
        [0.25 * self.surface.largest_kink() * turn.abs(), 0.125 * curvature * turn * turn]
            .map(|bend| factor.abs() * bend)
    }

    /// See [`super::GapLaw::least`].
    pub(super) fn least(&self, at: At<'_>, end: &PrescribedMotion, turn: f64, reach: Vector3) -> Option<f64> {
        let (node, start) = (at.node, at.drive);
        let factors = [start.shape_factor, end.shape_factor];
        let round = self.surface == CompiledShape::Circular || factors.iter().all(|one| *one == 0.0);
        if self.shaft_moves || !(round || turn.abs() >= std::f64::consts::TAU && factors.iter().all(|one| *one >= 0.0))
        {
            return None;
        }
        let opening = |drive: &PrescribedMotion| drive.gap_offset + drive.radius_change;
        let shape = |factor: f64| if round { 0.0 } else { factor * self.surface.least() };
        let clearance = self.layout.clearances[at.index % self.layout.lanes] + opening(start).min(opening(end));
        let slope = self.slopes[node];
        let left = clearance + shape(factors[0]).min(shape(factors[1])) - reach[0] - slope.abs() * reach[2];
        Some(left / (1.0 + slope * slope).sqrt())
    }

    /// Angle of a displaced node about the shaft centre (rad).
    fn angle(&self, at: At<'_>, moved: Vector3) -> f64 {
        self.layout.angles[at.index] + at.drive.rotor_angle + moved[1] * self.layout.per_radius[at.node]
    }

    /// Radial and tangential displacement of the shaft centre at an angle (m).
    fn shaft_offset(&self, angle: f64, drive: &PrescribedMotion) -> [f64; 2] {
        if !self.shaft_moves {
            return [0.0; 2];
        }
        let shaft = PolarFrame::new(angle).local(drive.shaft);
        [shaft[0], shaft[1]]
    }

    /// Angle of the position of a displaced node on the casing (rad), in the fixed frame.
    pub(crate) fn angle_on_casing(&self, at: At<'_>, moved: Vector3) -> f64 {
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

/// Nodes of one sector at several instants, each a lane, against a surface past which only the rotor turns, about a fixed shaft: all data
/// of their gaps other than displacements. Allocates only when created.
#[derive(Debug, Clone, Default)]
pub struct Instants {
    /// Angle of the undisplaced node, from the origin of the shape (rad).
    angles: Vec<f64>,
    /// Clearance without the shape (m), and factor on the shape.
    clearances: Vec<f64>,
    factors: Vec<f64>,
    per_radius: Vec<f64>,
    slopes: Vec<f64>,
    /// Shape and its slope.
    shape: [Vec<f64>; 2],
}

impl Instants {
    /// Allocates `lanes` lanes, all infinitely far away.
    pub fn new(lanes: usize) -> Self {
        let zeros = || vec![0.0; lanes];
        Self {
            angles: zeros(),
            clearances: vec![f64::INFINITY; lanes],
            factors: zeros(),
            per_radius: zeros(),
            slopes: zeros(),
            shape: [zeros(), zeros()],
        }
    }
}

impl RevolutionGap {
    /// Fills a lane with this node at this instant. Returns false and does nothing if gaps depend on more than [`Instants`].
    pub fn enter(&self, at: At<'_>, lane: usize, instants: &mut Instants) -> bool {
        if self.shaft_moves {
            return false;
        }
        let (layout, drive) = (&self.layout, at.drive);
        instants.angles[lane] = layout.angles[at.index] + (drive.rotor_angle - drive.shape_rotation);
        instants.clearances[lane] = layout.clearances[at.index % layout.lanes] + drive.gap_offset + drive.radius_change;
        instants.factors[lane] = drive.shape_factor;
        instants.per_radius[lane] = layout.per_radius[at.node];
        instants.slopes[lane] = self.slopes[at.node];
        true
    }

    /// Computes gaps (m) and unit normals of all lanes for the displacements `moved` (m): `moved` and `normals` have three rows of lanes.
    pub(crate) fn of_lanes(&self, instants: &mut Instants, moved: &[f64], gaps: &mut [f64], normals: &mut [f64]) {
        self.instruction_set.run(EvaluateLanes { surface: &self.surface, instants, moved, gaps, normals });
    }
}

/// Evaluation of gaps and normals of lanes.
struct EvaluateLanes<'a> {
    surface: &'a CompiledShape,
    instants: &'a mut Instants,
    moved: &'a [f64],
    gaps: &'a mut [f64],
    normals: &'a mut [f64],
}

impl Kernel for EvaluateLanes<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { surface, instants, moved, gaps, normals } = self;
        let width = gaps.len();
        let Instants { angles, clearances, factors, per_radius, slopes, shape: [shape, steepness] } = instants;
        let (shape, steepness) = (&mut shape[..width], &mut steepness[..width]);
        let (radial, rest) = moved.split_at(width);
        let (tangential, axial) = rest.split_at(width);
        let (outwards, rest) = normals.split_at_mut(width);
        let (around, along) = rest.split_at_mut(width);
        let (angles, per_radius) = (&angles[..width], &per_radius[..width]);
        for lane in 0..width {
            outwards[lane] = angles[lane] + tangential[lane] * per_radius[lane];
        }
        surface.evaluate_row(outwards, shape, steepness);
        let (clearances, factors, slopes) = (&clearances[..width], &factors[..width], &slopes[..width]);
        let (along, axial) = (&mut along[..width], &axial[..width]);
        for lane in 0..width {
            let (slope, sideways) = (slopes[lane], factors[lane] * steepness[lane] * per_radius[lane]);
            let per_length = 1.0 / (1.0 + sideways * sideways + slope * slope).sqrt();
            let open = clearances[lane] + factors[lane] * shape[lane] - radial[lane] + slope * axial[lane];
            gaps[lane] = open * per_length;
            (outwards[lane], around[lane], along[lane]) = (-per_length, sideways * per_length, slope * per_length);
        }
    }
}

/// Evaluation of gaps and normals of all nodes and lanes on a surface of revolution; with `SHAFT` the shaft centre moves.
struct Evaluate<'a, const SHAFT: bool> {
    law: &'a RevolutionGap,
    drive: &'a PrescribedMotion,
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
                    // ρ − r − u_r without cancellation: the part of the gap that the shaft closes; set before the gap is written.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::settings::Shape;

    /// Each lane has the gap of a single node at one instant.
    #[test]
    fn vector_lanes_match_scalar_gaps_of_nodes() {
        let shape = Shape::TwoLobe { depth: 0.6, width: 0.15, phase: 0.3 };
        let law = |instruction_set| RevolutionGap {
            surface: CompiledShape::new(&shape, 3.56e-4).unwrap(),
            instruction_set,
            layout: Layout {
                lanes: 2,
                angles: vec![0.1, 0.6, 0.2, 0.7],
                radii: vec![0.25, 0.24],
                per_radius: vec![1.0 / 0.25, 1.0 / 0.24],
                axial: vec![0.0; 2],
                clearances: vec![3.56e-4, 3.4e-4],
            },
            nodes: vec![0, 1],
            slopes: vec![-0.26, 0.1],
            shaft_moves: false,
            arms: [Vec::new(), Vec::new()],
        };
        let drive = |rotor_angle| PrescribedMotion {
            rotor_angle,
            shape_factor: 0.9,
            shape_rotation: 0.05,
            gap_offset: 1e-5,
            ..PrescribedMotion::default()
        };
        let (drives, width) = ([0.0, 0.4, 1.3].map(drive), 8);
        let moved: Vec<f64> = (0..24).map(|i| 1e-4 * f64::from(i).sin()).collect();
        // Lane: both nodes of the second sector at three instants.
        let at = |lane: usize| At { node: lane % 2, index: 2 * (lane % 2) + 1, drive: &drives[lane / 2] };
        let run = |set: InstructionSet| {
            let (law, mut instants) = (law(set), Instants::new(width));
            assert!((0..6).all(|lane| law.enter(at(lane), lane, &mut instants)));
            let (mut gaps, mut normals) = (vec![0.0; width], vec![0.0; 3 * width]);
            law.of_lanes(&mut instants, &moved, &mut gaps, &mut normals);
            (gaps, normals)
        };
        let (gaps, normals) = run(InstructionSet::detect());
        assert_eq!((gaps.clone(), normals.clone()), run(InstructionSet::Baseline));
        for lane in 0..6 {
            let three = |values: &[f64]| [0, 1, 2].map(|component| values[component * width + lane]);
            let Gap { distance: gap, normal, .. } = law(InstructionSet::Baseline).gap(at(lane), three(&moved).into());
            assert!((gaps[lane] - gap).abs() < 1e-18, "{lane}: {} {gap}", gaps[lane]);
            assert!(three(&normals).iter().zip(&normal).all(|(a, b)| (a - b).abs() < 1e-15), "{lane}");
        }
        assert!(!law(InstructionSet::Baseline).with_moving_shaft(true).enter(at(0), 0, &mut Instants::new(width)));
    }

    #[test]
    fn every_instruction_set_gives_the_same_bits() {
        let lanes = 16;
        let shape = Shape::TwoLobe { depth: 0.6, width: 0.15, phase: 0.3 };
        let law = |instruction_set| RevolutionGap {
            surface: CompiledShape::new(&shape, 3.56e-4).unwrap(),
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
        let drive = PrescribedMotion { rotor_angle: 1.1, shape_factor: 1.0, ..PrescribedMotion::default() };
        let run = |instruction_set| {
            let mut law = crate::geometry::GapLaw::Revolution(law(instruction_set));
            let (mut geometry, mut gap) = (Geometry::new(lanes, false), vec![0.0; 16]);
            law.evaluate(&drive, &displacement, &[], None, &mut geometry, &mut gap);
            let all = geometry.normal.iter().flatten().chain(&gap);
            all.map(|value| value.to_bits()).collect::<Vec<_>>()
        };
        assert_eq!(run(InstructionSet::Baseline), run(InstructionSet::detect()));
    }
}

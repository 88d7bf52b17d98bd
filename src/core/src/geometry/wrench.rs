//! Contact forces in fixed directions: points of action and moments.
//!
//! Contact forces are computed in the coordinates of the displacements, so that their work on the structures, on a turning rotor or on a
//! moving shaft is the work in the energy ledger. Here they become vectors at a point x, with one moment for master and slave. The moment
//! on a rotor is (x − e) × F with the shaft centre e, and its z part is the torque conjugate to the rotor angle; on a free master it is x ×
//! F about the origin.
//!
//! On a surface of revolution x is at the radius r + u_r and the angle φ = θ_node + θ_r + u_θ/r from the shaft centre, the tangential force
//! there is r/(r + u_r) times the one conjugate to u_θ, and the torque is r times the latter. On a surface through data points x is the
//! contact point on the surface, where the force is transferred to its control points.

use super::frame::PolarFrame;
use super::surface_spline::ClosestPoint;
use super::{GapLaw, PrescribedMotion, Vector3};

/// A contact force on the master in fixed directions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wrench {
    /// Point of action (m), from the middle of the casing or the origin.
    pub point: Vector3,
    /// Force along fixed x, y, z (N).
    pub force: Vector3,
    /// Moment (N·m) about the shaft centre, which moves with whirl and axial shift, or about the origin.
    pub moment: Vector3,
}

/// Change of the prescribed inputs over a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotionIncrement {
    /// Length of the step (s).
    pub step: f64,
    /// Rotation of the rotor over the step (rad).
    pub turn: f64,
    /// Displacement of the shaft centre along fixed x, y, z (m).
    pub shaft: Vector3,
    /// Change of the clearance of round surfaces (m).
    pub opening: f64,
    /// Change of the factor on the shape (-).
    pub shape_factor: f64,
    /// Rotation of the shape (rad).
    pub shape_rotation: f64,
}

tiprub_cosim::persist_fields!(MotionIncrement { step, turn, shaft.data.0, opening, shape_factor, shape_rotation });

impl MotionIncrement {
    /// Computes the change from `before` to `now`, a step of length `step` (s). Angles are known only up to whole turns: the turn of the
    /// rotor is the one nearest to the value by its speed, that of the shape the smallest.
    pub fn between(before: &PrescribedMotion, now: &PrescribedMotion, step: f64) -> Self {
        let full = std::f64::consts::TAU;
        let turned = now.rotor_angle - before.rotor_angle;
        let rotated = now.shape_rotation - before.shape_rotation;
        Self {
            step,
            turn: turned - full * libm::round((turned - now.speed * step) / full),
            shaft: now.shaft - before.shaft,
            opening: now.gap_offset - before.gap_offset + (now.radius_change - before.radius_change),
            shape_factor: now.shape_factor - before.shape_factor,
            shape_rotation: rotated - full * libm::round(rotated / full),
        }
    }

    /// Magnitude of the rotation of the rotor relative to the shape (rad).
    pub(crate) fn relative_turn(&self) -> f64 {
        (self.turn - self.shape_rotation).abs()
    }

    /// Returns the mean of this step and the one before, like the displacements on which a force at the time in between does work; the turn
    /// of the rotor is that of this step alone, so that the mean torque times the speed is the power of the shaft.
    pub fn centred(&self, before: &Self) -> Self {
        Self { step: self.step, turn: self.turn, ..self.since(before).over(0.5) }
    }

    /// Returns the sum of this step and the one before.
    pub fn since(&self, before: &Self) -> Self {
        self.combined(before, |own, before| own + before)
    }

    /// Returns the difference of this motion and another.
    pub fn less(&self, other: &Self) -> Self {
        self.combined(other, |own, other| own - other)
    }

    /// Returns the change at the same rates over a step `ratio` times as long.
    pub fn over(&self, ratio: f64) -> Self {
        self.combined(self, |own, _| ratio * own)
    }

    #[inline(always)]
    fn combined(&self, other: &Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            step: of(self.step, other.step),
            turn: of(self.turn, other.turn),
            shaft: self.shaft.zip_map(&other.shaft, &of),
            opening: of(self.opening, other.opening),
            shape_factor: of(self.shape_factor, other.shape_factor),
            shape_rotation: of(self.shape_rotation, other.shape_rotation),
        }
    }

    /// Returns whether no input moves the casing.
    pub(crate) fn is_casing_at_rest(&self) -> bool {
        self.opening == 0.0 && self.shape_factor == 0.0 && self.shape_rotation == 0.0
    }
}

/// A contact of one node at the instant at which its force is computed.
#[derive(Debug, Clone, Copy)]
pub struct At<'a> {
    /// Contact node.
    pub node: usize,
    /// `node · lanes + lane`.
    pub index: usize,
    /// Prescribed motion.
    pub drive: &'a PrescribedMotion,
}

impl GapLaw {
    /// Returns the data that determine the contact point of a node displaced by `moved` (m, own directions) with the closest point `place`:
    /// the displacement itself on surfaces of revolution, otherwise the point relative to the shaft centre or the origin (m).
    #[inline(always)]
    pub fn contact_point(&self, at: At<'_>, moved: Vector3, place: ClosestPoint) -> Vector3 {
        match self {
            Self::Fixed(_) | Self::Revolution(_) => moved,
            Self::Spline(law) => law.contact_arm(at.index, at.drive, place),
            Self::Open(law) => law.contact_point(place),
        }
    }

    /// Returns the wrench of a `force` on the master (N, in the coordinates of its displacements) at a contact point found by
    /// [`GapLaw::contact_point`].
    #[inline(always)]
    pub fn wrench(&self, at: At<'_>, point: Vector3, force: Vector3) -> Wrench {
        let At { node, index, drive } = at;
        match self {
            Self::Fixed(_) => Wrench { force, ..Wrench::default() },
            Self::Open(_) => Wrench { point, force, moment: point.cross(&force) },
            Self::Spline(law) => around(law.frame(index, drive.rotor_angle), drive, point, force),
            Self::Revolution(law) => {
                let layout = &law.layout;
                let frame = layout.displaced_frame(node, index, drive.rotor_angle, point[1]);
                let stretch = 1.0 + point[0] * layout.per_radius[node];
                let arm = Vector3::new(layout.radii[node] + point[0], 0.0, layout.axial[node] + point[2]);
                let mut wrench = around(frame, drive, arm, Vector3::new(force[0], force[1] / stretch, force[2]));
                wrench.moment[2] = layout.radii[node] * force[1];
                wrench
            }
        }
    }

    /// Displacement over a step (m) with the rotor, or along fixed obstacles with prescribed sliding, in the coordinates of the
    /// displacements of a node with this contact point.
    #[inline(always)]
    pub(crate) fn spin_motion(&self, at: At<'_>, point: Vector3, motion: &MotionIncrement) -> Vector3 {
        match self {
            Self::Fixed(law) => law.sliding[at.index] * motion.step,
            Self::Open(_) => Vector3::zeros(),
            Self::Revolution(law) => Vector3::new(0.0, law.layout.radii[at.node] * motion.turn, 0.0),
            Self::Spline(_) => Vector3::new(-motion.turn * point[1], motion.turn * point[0], 0.0),
        }
    }

    /// Displacement over a step (m) with the shaft centre, in the same coordinates.
    #[inline(always)]
    pub fn shaft_motion(&self, at: At<'_>, point: Vector3, motion: &MotionIncrement) -> Vector3 {
        let At { node, index, drive } = at;
        match self {
            Self::Fixed(_) | Self::Open(_) => Vector3::zeros(),
            Self::Revolution(law) => law.layout.shaft_motion(node, index, drive.rotor_angle, point, motion.shaft),
            Self::Spline(law) => law.frame(index, drive.rotor_angle).local(motion.shaft),
        }
    }

    /// Returns the displacement of the surface along `normal` (own directions) by its prescribed motion at a contact point (m).
    #[inline(always)]
    pub fn surface_motion(
        &self,
        at: At<'_>,
        point: Vector3,
        normal: Vector3,
        place: ClosestPoint,
        motion: &MotionIncrement,
    ) -> f64 {
        match self {
            Self::Fixed(_) | Self::Open(_) => 0.0,
            Self::Revolution(law) => law.surface_motion(at, point, normal[0], motion),
            Self::Spline(law) => law.surface_motion(at, point, normal, place, motion),
        }
    }

    /// Angle of the position of a node displaced by `moved` (m, own directions) on the casing (rad), in the fixed frame.
    pub(crate) fn angle_on_casing(&self, at: At<'_>, moved: Vector3) -> f64 {
        match self {
            Self::Fixed(_) | Self::Open(_) => 0.0,
            Self::Revolution(law) => law.angle_on_casing(at, moved),
            Self::Spline(law) => law.angle_on_casing(at, moved),
        }
    }
}

/// Returns the wrench of a force at `arm` from the shaft centre, both in the directions of `frame`.
#[inline(always)]
fn around(frame: PolarFrame, drive: &PrescribedMotion, arm: Vector3, force: Vector3) -> Wrench {
    Wrench { point: frame.fixed(arm) + drive.shaft, force: frame.fixed(force), moment: frame.fixed(arm.cross(&force)) }
}

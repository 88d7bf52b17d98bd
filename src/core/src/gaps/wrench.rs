//! Contact forces in fixed directions: at which point they act, and what moment they have.
//!
//! Forces of contacts are found in the coordinates of the displacements, so that their work on the structures, and on a
//! rotor that turns or a shaft that moves, is what the ledger books. Here they become vectors at a point x, with one
//! moment for master and slave. The moment on a rotor is (x − e) × F with e the shaft's centre, its z part the torque
//! conjugate to the rotor angle; on a free master it is x × F about the origin.
//!
//! On a surface of revolution x is at the radius r + u_r and the angle φ = θ_node + θ_r + u_θ/r from the shaft's centre, the
//! tangential force there is r/(r + u_r) times the one conjugate to u_θ, and the torque r times the latter. On a surface
//! through data points x is the contact point on the surface, where the force is handed to its control points.

use super::frame::PolarFrame;
use super::surface_spline::ClosestPoint;
use super::{GapLaw, PrescribedMotion};

/// A contact force on the master in fixed directions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wrench {
    /// Where it acts (m), from the middle of the casing or the origin.
    pub point: [f64; 3],
    /// Along fixed x, y, z (N).
    pub force: [f64; 3],
    /// Moment (N·m) about the shaft's centre, which moves with whirl and axial shift, or about the origin.
    pub moment: [f64; 3],
}

/// Change of the prescribed inputs over a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MotionIncrement {
    /// Length of the step (s).
    pub step: f64,
    /// The rotor (rad), over the step.
    pub turn: f64,
    /// The shaft's centre along fixed x, y, z (m).
    pub shaft: [f64; 3],
    /// Clearance of round surfaces (m).
    pub opening: f64,
    /// Factor on the shape (-).
    pub shape_factor: f64,
    /// Rotation of the shape (rad).
    pub shape_rotation: f64,
}

crate::persist::persist_fields!(MotionIncrement { step, turn, shaft, opening, shape_factor, shape_rotation });

impl MotionIncrement {
    /// From `before` to `now`, a step of length `step` (s). Angles are known to whole turns only: the rotor's turn is the one
    /// nearest to what its speed tells, that of the shape the smallest.
    pub fn between(before: &PrescribedMotion, now: &PrescribedMotion, step: f64) -> Self {
        let full = std::f64::consts::TAU;
        let turned = now.rotor_angle - before.rotor_angle;
        let rotated = now.shape_rotation - before.shape_rotation;
        Self {
            step,
            turn: turned - full * libm::round((turned - now.speed * step) / full),
            shaft: std::array::from_fn(|i| now.shaft[i] - before.shaft[i]),
            opening: now.gap_offset - before.gap_offset + (now.radius_change - before.radius_change),
            shape_factor: now.shape_factor - before.shape_factor,
            shape_rotation: rotated - full * libm::round(rotated / full),
        }
    }

    /// Mean of this step and the one before, as the displacements are that a force at the time between works on; the rotor's
    /// turn is that of this step alone, so that the mean torque times the speed is the power of the shaft.
    pub fn centred(&self, before: &Self) -> Self {
        Self {
            step: self.step,
            turn: self.turn,
            shaft: std::array::from_fn(|i| 0.5 * (self.shaft[i] + before.shaft[i])),
            opening: 0.5 * (self.opening + before.opening),
            shape_factor: 0.5 * (self.shape_factor + before.shape_factor),
            shape_rotation: 0.5 * (self.shape_rotation + before.shape_rotation),
        }
    }

    /// This step and the one before together.
    pub fn since(&self, before: &Self) -> Self {
        Self {
            step: self.step + before.step,
            turn: self.turn + before.turn,
            shaft: std::array::from_fn(|i| self.shaft[i] + before.shaft[i]),
            opening: self.opening + before.opening,
            shape_factor: self.shape_factor + before.shape_factor,
            shape_rotation: self.shape_rotation + before.shape_rotation,
        }
    }

    /// Returns the difference of this motion and another.
    pub fn less(&self, other: &Self) -> Self {
        self.since(&other.over(-1.0))
    }

    /// Whether no input moves the casing.
    pub fn casing_rests(&self) -> bool {
        self.opening == 0.0 && self.shape_factor == 0.0 && self.shape_rotation == 0.0
    }

    /// The same rates over a step `ratio` times as long.
    pub fn over(&self, ratio: f64) -> Self {
        Self {
            step: ratio * self.step,
            turn: ratio * self.turn,
            shaft: self.shaft.map(|value| ratio * value),
            opening: ratio * self.opening,
            shape_factor: ratio * self.shape_factor,
            shape_rotation: ratio * self.shape_rotation,
        }
    }
}

/// A contact of one node at the instant its force is found.
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
    /// Returns the data from which the contact point of a node displaced by `moved` (m, own directions) with the closest point `place` follows: the
    /// displacement itself on surfaces of revolution, else the point relative to the shaft's centre or the origin (m).
    #[inline(always)]
    pub fn contact_point(&self, at: At<'_>, moved: [f64; 3], place: ClosestPoint) -> [f64; 3] {
        match self {
            Self::Fixed(_) | Self::Revolution(_) => moved,
            Self::Spline(law) => law.contact_arm(at.index, at.drive, place),
            Self::Open(law) => law.contact_point(place),
        }
    }

    /// The `force` on the master (N, in the coordinates of its displacements) at a contact point found by
    /// [`GapLaw::contact_point`].
    #[inline(always)]
    pub fn wrench(&self, at: At<'_>, point: [f64; 3], force: [f64; 3]) -> Wrench {
        let At { node, index, drive } = at;
        match self {
            Self::Fixed(_) => Wrench { force, ..Wrench::default() },
            Self::Open(_) => Wrench { point, force, moment: cross(point, force) },
            Self::Spline(law) => around(law.frame(index, drive.rotor_angle), drive, point, force),
            Self::Revolution(law) => {
                let (layout, [radial, tangential, axial]) = (&law.layout, point);
                let frame = layout.displaced_frame(node, index, drive.rotor_angle, tangential);
                let stretch = 1.0 + radial * layout.per_radius[node];
                let arm = [layout.radii[node] + radial, 0.0, layout.axial[node] + axial];
                let mut wrench = around(frame, drive, arm, [force[0], force[1] / stretch, force[2]]);
                wrench.moment[2] = layout.radii[node] * force[1];
                wrench
            }
        }
    }

    /// Displacement over a step (m) with the rotor, or with what slides along fixed obstacles, in the coordinates of the
    /// displacements of a node with this contact point.
    #[inline(always)]
    pub fn spin_motion(&self, at: At<'_>, point: [f64; 3], motion: &MotionIncrement) -> [f64; 3] {
        match self {
            Self::Fixed(law) => law.sliding[at.index].map(|velocity| velocity * motion.step),
            Self::Open(_) => [0.0; 3],
            Self::Revolution(law) => [0.0, law.layout.radii[at.node] * motion.turn, 0.0],
            Self::Spline(_) => [-motion.turn * point[1], motion.turn * point[0], 0.0],
        }
    }

    /// The same with the shaft's centre.
    #[inline(always)]
    pub fn shaft_motion(
        &self,
        At { node, index, drive }: At<'_>,
        point: [f64; 3],
        motion: &MotionIncrement,
    ) -> [f64; 3] {
        match self {
            Self::Fixed(_) | Self::Open(_) => [0.0; 3],
            Self::Revolution(law) => law.layout.shaft_motion(node, index, drive.rotor_angle, point, motion.shaft),
            Self::Spline(law) => law.frame(index, drive.rotor_angle).local(motion.shaft),
        }
    }

    /// Returns the displacement of the surface along `normal` (own directions) by its prescribed motion at a contact point (m).
    #[inline(always)]
    pub fn surface_motion(
        &self,
        at: At<'_>,
        point: [f64; 3],
        normal: [f64; 3],
        place: ClosestPoint,
        motion: &MotionIncrement,
    ) -> f64 {
        match self {
            Self::Fixed(_) | Self::Open(_) => 0.0,
            Self::Revolution(law) => law.surface_motion(at, point, normal[0], motion),
            Self::Spline(law) => law.surface_motion(at, point, normal, place, motion),
        }
    }

    /// Angle at which a node displaced by `moved` (m, own directions) faces the casing (rad), in the fixed frame.
    pub fn angle_on_casing(&self, at: At<'_>, moved: [f64; 3]) -> f64 {
        match self {
            Self::Fixed(_) | Self::Open(_) => 0.0,
            Self::Revolution(law) => law.angle_on_casing(at, moved),
            Self::Spline(law) => law.angle_on_casing(at, moved),
        }
    }
}

/// A force at `arm` from the shaft's centre, both in the directions of `frame`.
#[inline(always)]
fn around(frame: PolarFrame, drive: &PrescribedMotion, arm: [f64; 3], force: [f64; 3]) -> Wrench {
    let point = frame.fixed(arm);
    Wrench {
        point: std::array::from_fn(|i| point[i] + drive.shaft[i]),
        force: frame.fixed(force),
        moment: frame.fixed(cross(arm, force)),
    }
}

/// Vector product.
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

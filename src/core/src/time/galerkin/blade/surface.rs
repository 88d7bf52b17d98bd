//! Shape of the surface at the angles of eight nodes.

use super::off_centre::in_rotor;
use crate::geometry::Vector3;
use crate::math::octet::{Eight, Octet};
use crate::scene::shape::CompiledShape;
use crate::time::galerkin::basis::POINTS;

/// Prescribed motion at a point of a step, and the resulting clearance.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct PointDrive {
    /// Angle of the rotor relative to the shape (rad).
    pub turned: f64,
    /// Factor on the shape.
    pub factor: f64,
    /// Clearance without the shape (m).
    pub clearance: f64,
    /// Speed of the rotor (rad/s), its angle (rad), and sine and cosine of the angle if contact forces act.
    pub speed: f64,
    pub rotor_angle: f64,
    pub rotor: (f64, f64),
    /// Displacement (m) and velocity (m/s) of the shaft centre along the axes x, y and z of the turning rotor.
    pub shaft: Vector3,
    pub shaft_velocity: Vector3,
}

/// Rates of the prescribed motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct DriveRate {
    /// Rate of the angle of the rotor relative to the shape (rad/s).
    pub turned: f64,
    /// Rate of the factor on the shape (1/s).
    pub factor: f64,
    /// Rate of the clearance without the shape (m/s).
    pub clearance: f64,
}

impl PointDrive {
    /// Returns the displacement of the shaft centre along fixed x, y and z (m).
    #[inline(always)]
    pub fn shaft_in_space(&self) -> Vector3 {
        in_rotor((-self.rotor.0, self.rotor.1), self.shaft)
    }

    /// Adds the displacement (m) and the velocity (m/s) of the shaft centre, given along fixed axes.
    pub fn with_shaft(self, shaft: Vector3, velocity: Vector3) -> Self {
        let rotor = libm::sincos(self.rotor_angle);
        Self { rotor, shaft: in_rotor(rotor, shaft), shaft_velocity: in_rotor(rotor, velocity), ..self }
    }

    /// Returns the mean rates of the motion from `before` to `self` within a time (s).
    pub fn rate_since(&self, before: &Self, time: f64) -> DriveRate {
        let per_second = 1.0 / time;
        DriveRate {
            turned: (self.turned - before.turned) * per_second,
            factor: (self.factor - before.factor) * per_second,
            clearance: (self.clearance - before.clearance) * per_second,
        }
    }
}

/// Surface of revolution that all nodes of a blade face.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FacedSurface<'a> {
    /// Shape of the surface.
    pub surface: &'a CompiledShape,
    /// Prescribed motion at the points of the step.
    pub drives: [PointDrive; POINTS],
    /// Friction coefficient.
    pub friction: f64,
    /// True if the shaft may be off-centre.
    pub is_off_centre: bool,
}

impl CompiledShape {
    /// Shape (m), slope (m/rad) and curvature (m/rad²) at eight angles (rad), without the factor.
    #[inline(always)]
    pub(crate) fn evaluate_octet<L: Octet>(&self, angles: L) -> [L; 3] {
        match self {
            Self::Circular => [L::zero(); 3],
            Self::TwoLobe { height, width, phase } => {
                let turned = (angles - L::splat(*phase)) * L::splat(std::f64::consts::FRAC_1_PI) - L::splat(0.5);
                let distance = (turned - turned.rounded()) * L::splat(std::f64::consts::PI / width);
                let square = distance * distance;
                let bump = (L::zero() - square).exp_of_negative() * L::splat(-height);
                let per_width = L::splat(1.0 / width);
                let slope = distance * per_width * bump * L::splat(-2.0);
                [bump, slope, (square * L::splat(4.0) - L::splat(2.0)) * per_width * per_width * bump]
            }
            Self::Lobes { .. } | Self::Table { .. } => {
                let mut out = [Eight::ZERO; 3];
                for (i, angle) in angles.array().into_iter().enumerate() {
                    [out[0].0[i], out[1].0[i], out[2].0[i]] = self.evaluate_twice(angle);
                }
                [0, 1, 2].map(|of| L::load(&out[of]))
            }
        }
    }
}

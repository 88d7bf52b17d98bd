//! Radial, tangential and axial directions, and conversion of vectors to them.

use crate::math::vector::Vector3;

/// Radial and tangential direction at an angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PolarFrame {
    sine: f64,
    cosine: f64,
}

impl PolarFrame {
    /// Frame of a structure described in fixed directions.
    pub const FIXED: Self = Self { sine: 0.0, cosine: 1.0 };

    /// Frame at `angle` (rad).
    pub fn new(angle: f64) -> Self {
        let (sine, cosine) = libm::sincos(angle);
        Self { sine, cosine }
    }

    /// Returns the frame at the sum of the angles of two frames.
    #[inline(always)]
    pub fn turned(self, by: Self) -> Self {
        Self {
            sine: self.sine * by.cosine + self.cosine * by.sine,
            cosine: self.cosine * by.cosine - self.sine * by.sine,
        }
    }

    /// Returns the (radial, tangential, axial) components of a vector given in fixed directions.
    #[inline(always)]
    pub fn local(self, v: Vector3) -> Vector3 {
        Vector3::new(v[0] * self.cosine + v[1] * self.sine, v[1] * self.cosine - v[0] * self.sine, v[2])
    }

    /// Returns the fixed components of a vector given as (radial, tangential, axial).
    #[inline(always)]
    pub fn fixed(self, v: Vector3) -> Vector3 {
        Vector3::new(v[0] * self.cosine - v[1] * self.sine, v[0] * self.sine + v[1] * self.cosine, v[2])
    }
}

//! Random numbers that are equal on every platform.

use nalgebra::DMatrix;

/// A sequence of random numbers, defined by its seed.
#[derive(Debug, Clone)]
pub struct SeededRandom(pub u64);

impl SeededRandom {
    fn bits(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64
    }

    /// Returns a number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.bits() / (1_u64 << 53) as f64
    }

    /// Returns a number in [−1, 1).
    pub fn signed(&mut self) -> f64 {
        self.bits() / (1_u64 << 52) as f64 - 1.0
    }

    /// Returns a number in [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Returns a number in [low, high), uniform in the logarithm.
    pub fn scale(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    /// Returns a vector with components in [−size, size).
    pub fn vector(&mut self, size: f64) -> [f64; 3] {
        [(); 3].map(|()| self.within(-size, size))
    }

    /// Returns an integer in 0 .. count.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in [0, count)")]
    pub fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count - 1)
    }

    /// Returns one of the choices.
    pub fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        let count = choices.len();
        let index = (0..count).filter(|index| self.unit() < 1.0 / (index + 1) as f64).max().unwrap_or(0);
        choices[index.min(count - 1)]
    }

    /// Returns a matrix with entries in [−1, 1).
    pub fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.signed())
    }
}

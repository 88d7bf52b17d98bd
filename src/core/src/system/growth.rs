//! Growth of a shape over time.

/// Growth of the shape of a surface over a span: a factor that is linear in time, times ½(1 − cos(πt/T)) until T.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ShapeGrowth {
    /// Factor at the start and the end.
    pub factors: [f64; 2],
    /// Time since the growth began (s), at the start and the end.
    pub elapsed: [f64; 2],
    /// T (s), 0 for a shape that is complete from the start.
    pub length: f64,
}

impl ShapeGrowth {
    /// Fraction of the shape that has grown after a time `elapsed` (s) of `length` (s). Negative times, which rounding may cause
    /// in a first step, count as zero.
    pub fn share(elapsed: f64, length: f64) -> f64 {
        let elapsed = elapsed.max(0.0);
        if elapsed >= length { 1.0 } else { 0.5 * (1.0 - libm::cos(std::f64::consts::PI * elapsed / length)) }
    }

    /// Factor at the fraction `theta` of the span.
    pub fn at(&self, theta: f64) -> f64 {
        let between = |ends: [f64; 2]| ends[0] + theta * (ends[1] - ends[0]);
        between(self.factors) * Self::share(between(self.elapsed), self.length)
    }
}

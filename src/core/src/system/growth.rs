//! The growth of a shape over time.

/// Growth of the shape of a surface over a span: a factor that is linear in time, times ½(1 − cos(πt/T)) until T.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ShapeGrowth {
    /// Factor at the start and the end.
    pub factors: [f64; 2],
    /// Time since the growth began (s), at the start and the end.
    pub elapsed: [f64; 2],
    /// T (s), 0 for a shape that is there at once.
    pub length: f64,
}

impl ShapeGrowth {
    /// Share of a shape that has grown in after a time (s) of `length` (s). Before the start, where rounding may put the
    /// beginning of a first step, it is that of the start.
    pub fn share(elapsed: f64, length: f64) -> f64 {
        let elapsed = elapsed.max(0.0);
        if elapsed >= length { 1.0 } else { 0.5 * (1.0 - libm::cos(std::f64::consts::PI * elapsed / length)) }
    }

    /// Factor at a share of the span.
    pub fn at(&self, theta: f64) -> f64 {
        let between = |ends: [f64; 2]| ends[0] + theta * (ends[1] - ends[0]);
        between(self.factors) * Self::share(between(self.elapsed), self.length)
    }
}

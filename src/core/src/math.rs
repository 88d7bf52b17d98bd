//! Mathematics without mechanics: vectors, polynomials and processor-specific kernels.

pub(crate) mod cubic;
pub(crate) mod octet;
pub(crate) mod scan;
pub(crate) mod simd;
pub(crate) mod vector;

/// Converts a count to a factor.
#[expect(clippy::cast_precision_loss, reason = "counts are far below 2^52")]
pub(crate) fn real(count: usize) -> f64 {
    count as f64
}

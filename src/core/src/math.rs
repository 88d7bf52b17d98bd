//! Mathematics without mechanics: vectors, polynomials and processor-specific kernels.

pub(crate) mod cubic;
pub(crate) mod octet;
pub(crate) mod scan;
pub(crate) mod simd;
pub(crate) mod vector;

/// Returns the indices that sort the values in ascending order. Equal values keep their order.
pub(crate) fn argsort(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    order
}

/// Converts a count to a factor.
#[expect(clippy::cast_precision_loss, reason = "counts are far below 2^52")]
pub(crate) fn real(count: usize) -> f64 {
    count as f64
}

//! Mathematics without mechanics: polynomials and processor-specific kernels.

pub(crate) mod cubic;
pub(crate) mod simd;

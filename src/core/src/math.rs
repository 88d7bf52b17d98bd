//! Mathematics without mechanics: vectors, polynomials and processor-specific kernels.

pub(crate) mod cubic;
pub(crate) mod octet;
pub(crate) mod simd;
pub(crate) mod vector;

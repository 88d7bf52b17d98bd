//! Stage: blades and casing.

mod blades;
mod casing;

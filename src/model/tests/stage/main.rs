//! The stage: blades and casing.

mod blades;
mod casing;

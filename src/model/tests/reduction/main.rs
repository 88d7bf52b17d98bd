//! Reductions against the full model and closed forms.

#[path = "../common/mod.rs"]
mod common;
#[path = "../../../../tests/guide.rs"]
mod guide;

mod cube;
mod fixed;
mod hertz;
mod patches;
mod spin;
mod stress;

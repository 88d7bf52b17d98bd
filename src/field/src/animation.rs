//! A compact copy of a run, for a picture that moves: thinned surfaces, displacements of low rank, contact forces.
//!
//! [`Capture`] observes the run. Its memory does not grow with the length of the run: if it has many frames, it drops every
//! other one, and keeps the largest force and the smallest clearance of the dropped ones. [`Capture::animation`] then
//! chooses the interval of contact and returns it as bytes.

mod basis;
mod capture;
mod pack;
mod tips;

pub use capture::Capture;
pub use pack::Animation;
pub use tips::{HitBlade, TipHistory, WearMap};

/// Largest number of times of an animation.
pub const MAX_TIMES: usize = 121;
/// Number of equal angles at which the radius of a casing is stored.
pub const ANGLES: usize = 180;
/// Largest number of points of a surface with several sectors, and of a surface with one.
const MAX_POINTS: [usize; 2] = [2400, 5000];
/// Largest memory for the frames of a run (bytes).
const MAX_BYTES: usize = 96 << 20;

//! Compact data for an animation of a run: thinned surfaces, low-rank displacements, contact forces.
//!
//! [`Capture`] observes the run. Its memory does not grow with the length of the run: if there are too many frames, it drops every
//! second one, and keeps the largest forces and the smallest clearances of the dropped frames. [`Capture::animation`] then
//! chooses the interval of contact and returns its data.

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
/// Largest number of points of the surface of a sector: of a structure with several sectors, and of a structure with one.
const MAX_POINTS: [usize; 2] = [2400, 5000];
/// Largest memory for the frames of a run (bytes).
const MAX_BYTES: usize = 96 << 20;

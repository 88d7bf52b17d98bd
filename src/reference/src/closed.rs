//! Closed-form solutions for comparison with numerical results.

pub mod belt;
pub mod bouncing_bar;
pub mod chain;
pub mod frequencies;
pub mod impact;
pub mod oscillator;

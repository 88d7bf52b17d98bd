//! Closed forms that numerical results are held against.

pub mod belt;
pub mod bouncing_bar;
pub mod chain;
pub mod frequencies;
pub mod impact;
pub mod oscillator;

//! Closed forms that numerical results are held against.

pub mod belt;
pub mod bouncing_bar;
pub mod frequencies;
pub mod impact;

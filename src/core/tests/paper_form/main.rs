//! The step implemented a second time from the equations alone.

mod dense;
mod independent;

//! The step written a second time, from the equations alone.

mod dense;
mod independent;

//! Independent methods and closed forms for comparison with the product, by tests and by `lab error`. The FMU
//! contains nothing from here, and nothing here uses the stepping or contact code of the product; meshes, element
//! matrices and sparse factors are those of `tiprub-model`.

#![warn(unreachable_pub)]
#[cfg(feature = "cube")]
pub mod blade;
pub mod carpenter;
pub mod closed;
#[cfg(feature = "cube")]
pub mod compare;
#[cfg(feature = "cube")]
pub mod cube;
#[cfg(feature = "cube")]
pub mod methods;
pub mod paper;
pub mod reduced;
pub mod surface;

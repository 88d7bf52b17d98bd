//! Independent methods and closed forms that the product is compared with, by tests and by `lab error`. Nothing here
//! goes into the FMU, and nothing here uses the product's stepping or contact code; meshes, element matrices and sparse factors are those of `tiprub-model`.

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

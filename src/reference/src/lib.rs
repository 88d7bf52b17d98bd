//! Independent methods and closed forms that the product is compared with. Nothing here ships, and nothing here
//! uses the product's stepping or contact code; meshes, element matrices and sparse factors are those of `tiprub-model`.

pub mod carpenter;
pub mod closed;
#[cfg(feature = "cube")]
pub mod compare;
#[cfg(feature = "cube")]
pub mod cube;
#[cfg(feature = "cube")]
pub mod methods;
pub mod paper;
pub mod surface;

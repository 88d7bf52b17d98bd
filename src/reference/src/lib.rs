//! Independent methods and closed forms that the product is compared with. Nothing here ships, and nothing here
//! uses the product's stepping or contact code.

pub mod carpenter;
pub mod paper;

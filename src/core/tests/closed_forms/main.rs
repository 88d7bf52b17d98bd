//! The core against closed forms: motion, contact, prescribed inputs, travelling waves.

#[path = "../../../../tests/guide.rs"]
mod guide;
#[path = "../common/rods.rs"]
mod rods;

mod bouncing_bar;
mod drift;
mod orders;
mod prescribed;
mod stops;
mod waves;

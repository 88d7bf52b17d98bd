//! Through the core, against closed forms: what moves, what touches, what is prescribed, what travels.

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

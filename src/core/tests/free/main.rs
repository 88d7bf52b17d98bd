//! Free structures: how they move, and what is refused.

#[path = "../common/counting.rs"]
mod counting;

mod flight;
mod marched;
mod refusals;

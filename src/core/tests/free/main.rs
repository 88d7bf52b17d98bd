//! Free structures: how they move, and what is refused.

#[path = "../common/counting.rs"]
mod counting;
#[path = "../../../../tests/guide.rs"]
mod guide;

mod flight;
mod marched;
mod refusals;

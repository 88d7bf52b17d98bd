//! Free structures: motion, and errors.

#[path = "../common/counting.rs"]
mod counting;
#[path = "../../../../tests/guide.rs"]
mod guide;

mod flight;
mod marched;
mod refusals;

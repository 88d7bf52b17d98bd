//! The cases, family by family.

pub mod friction;
pub mod gaps;
pub mod limits;
pub mod proof;
pub mod stepping;
pub mod values;

use super::Case;

/// Every case of the full table.
pub fn all() -> Vec<Case> {
    [limits::cases(), friction::cases(), gaps::cases(), stepping::cases(), values::cases()].into_iter().flatten().collect()
}

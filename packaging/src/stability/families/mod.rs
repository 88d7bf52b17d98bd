//! The cases, family by family.

pub mod builtin;
pub mod friction;
pub mod gaps;
pub mod limits;
pub mod loads;
pub mod proof;
pub mod random;
pub mod stepping;
pub mod values;

use super::Case;

/// Every case of the full table.
pub fn all() -> Vec<Case> {
    let families = [
        limits::cases(),
        friction::cases(),
        gaps::cases(),
        stepping::cases(),
        loads::cases(),
        builtin::cases(),
        random::cases(),
        values::cases(),
    ];
    families.into_iter().flatten().collect()
}

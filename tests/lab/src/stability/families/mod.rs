//! The cases, family by family.

pub mod builtin;
pub mod decay;
pub mod disk;
pub mod free;
pub mod friction;
pub mod gaps;
pub mod heat;
pub mod limits;
pub mod loads;
pub mod plates;
pub(crate) mod proof;
pub mod random;
pub mod stepping;
pub mod surfaces;
pub mod turning;
pub mod values;

use super::Case;

/// Every case of the full table.
pub fn all() -> Vec<Case> {
    let families = [
        limits::cases(),
        friction::cases(),
        heat::cases(),
        gaps::cases(),
        stepping::cases(),
        loads::cases(),
        decay::cases(),
        turning::cases(),
        disk::cases(),
        free::cases(),
        plates::cases(),
        builtin::cases(),
        random::cases(),
        values::cases(),
        surfaces::cases(),
    ];
    families.into_iter().flatten().collect()
}

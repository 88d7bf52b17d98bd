//! The cases, family by family.

pub(crate) mod blades;
pub(crate) mod builtin;
pub(crate) mod decay;
pub(crate) mod disk;
pub(crate) mod free;
pub(crate) mod friction;
pub(crate) mod gaps;
pub(crate) mod heat;
pub(crate) mod limits;
pub(crate) mod loads;
pub(crate) mod plates;
pub(crate) mod proof;
pub(crate) mod random;
pub(crate) mod stepping;
pub(crate) mod surfaces;
pub(crate) mod turning;
pub(crate) mod values;

use super::{Case, Expected};

/// Every case of the full table.
pub(crate) fn all() -> Vec<Case> {
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
        blades::cases(),
        free::cases(),
        plates::cases(),
        builtin::cases(),
        random::cases(),
        values::cases(),
        surfaces::cases(),
    ];
    families.into_iter().flatten().map(without_film).collect()
}

/// A case of film without the inertia of contact nodes, which every scene rejects.
fn without_film(mut case: Case) -> Case {
    let has = |name: &str| case.name.split('/').any(|part| part == name);
    if has("film") && has("massless") {
        case.expected = Expected::refused(["massless-boundary", "film"]);
    }
    case
}

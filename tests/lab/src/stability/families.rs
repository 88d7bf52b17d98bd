//! All cases, family by family.

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

use super::{Expected, StabilityCase, models::StabilityMethod};

/// Returns every case of the full table.
pub(crate) fn all() -> Vec<StabilityCase> {
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
    families.into_iter().flatten().map(without_film).map(short).collect()
}

/// Families whose quick form includes galerkin at longest steps.
const SHORT: [&str; 6] = ["step-limit", "redundant", "jump", "resolution", "curved", "free"];

/// Removes galerkin cases with fixed steps from the quick table unless their family is in [`SHORT`], because they take
/// long; adaptive ones represent them.
fn short(case: StabilityCase) -> StabilityCase {
    let fixed = StabilityMethod::in_name(&case.name).0 == Some("galerkin-fixed");
    let keep = case.quick && (!fixed || SHORT.contains(&case.family()));
    case.quick(keep)
}

/// Converts a case of film without the inertia of contact nodes, which every scene rejects.
fn without_film(mut case: StabilityCase) -> StabilityCase {
    let without = [("massless", "massless-boundary"), ("galerkin", "galerkin"), ("galerkin-fixed", "galerkin")];
    if let (Some(integration), Some("film")) = StabilityMethod::in_name(&case.name)
        && let Some((_, scheme)) = without.iter().find(|(name, _)| *name == integration)
    {
        // Some scenes are rejected by another rule first.
        let other = match &case.expected {
            Expected::Refused(lists) | Expected::Either(_, lists) => lists.clone(),
            Expected::Right(_) => Vec::new(),
        };
        let film = vec![(*scheme).to_owned(), "film".to_owned()];
        case.expected = Expected::Refused(std::iter::once(film).chain(other).collect());
    }
    case
}

//! Numerical stability on stiff and extreme cases: each ends in a correct result or in an error that states the reason.
//!
//! A [`StabilityCase`] defines the expected end and the independent property that makes a result correct; [`judge`]
//! converts the actual end to a [`CaseVerdict`]. Every case runs in a child process of this program with a time limit
//! ([`child`]), so that a crash, an abort or a hang is reported as such. [`families`] contains the cases, [`table`]
//! writes them.

pub(crate) mod bodies;
pub(crate) mod case;
pub(crate) mod child;
pub(crate) mod command;
pub(crate) mod families;
pub(crate) mod models;
pub(crate) mod observe;
pub(crate) mod press;
pub(crate) mod table;

pub(crate) use case::{CaseContext, Cases, Check, Expected, StabilityCase, judge};
pub(crate) use case::{CaseEnd, CaseVerdict};

/// Returns all cases of the full table, or of the quick one; those that test the judge itself are included only by
/// their family's name.
pub(crate) fn cases(quick: bool) -> Vec<StabilityCase> {
    families::all().into_iter().filter(|case| case.quick || !quick).collect()
}

/// Returns the cases whose name begins with `prefix`; those that test the judge itself are included only here.
pub(crate) fn named(prefix: &str, quick: bool) -> Vec<StabilityCase> {
    let proof = families::proof::cases();
    cases(quick).into_iter().chain(proof).filter(|case| case.name.starts_with(prefix)).collect()
}

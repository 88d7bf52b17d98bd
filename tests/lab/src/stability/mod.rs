//! Numerical stability on stiff and extreme cases: each ends in a right answer or in a refusal that says why.
//!
//! A [`StabilityCase`] says what is expected, and by what independent property an answer counts as right; [`judge`] turns what
//! happened into a [`CaseVerdict`]. Every case runs in a child process of this program with a time limit ([`child`]), so that a
//! crash, an abort or a hang is seen as what it is. [`families`] holds the cases, [`table`] writes them down.

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

/// All cases of the full table, or of the quick one; those that prove the judge itself come with their family's name only.
pub(crate) fn cases(quick: bool) -> Vec<StabilityCase> {
    families::all().into_iter().filter(|case| case.quick || !quick).collect()
}

/// Cases whose name begins with `prefix`; those of the judge's own proof are among them only here.
pub(crate) fn named(prefix: &str, quick: bool) -> Vec<StabilityCase> {
    let proof = families::proof::cases();
    cases(quick).into_iter().chain(proof).filter(|case| case.name.starts_with(prefix)).collect()
}

//! Signorini's law on all contacts of a group: 0 ≤ λ ⟂ g + Wλ ≥ 0.

use super::sliding::SlidingRule;

/// Linear complementarity.
#[derive(Debug, Clone)]
pub(crate) struct Lcp;

impl SlidingRule for Lcp {}

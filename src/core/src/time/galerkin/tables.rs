//! Tables of a sector for steps of all lengths.

use super::basis::MOST;
use super::level::StepTables;
use super::rows::ContactRows;
use super::state::SectorState;
use super::trial::ForceInterpolation;
use crate::modes::coordinates::ContactModes;

/// Largest number of halvings of the span.
pub const HALVINGS: usize = 12;

/// Tables of one kind of sector for a span that is halved repeatedly. All levels have the same degree.
#[derive(Debug, Clone)]
pub struct Tables {
    /// Data that all levels share.
    pub rows: ContactRows,
    /// Tables for the span, half of it, a quarter, …
    pub levels: Vec<StepTables>,
    /// Tables of a higher degree, for steps in which no sticking contact changes its status; empty without sticking.
    pub steady: Vec<StepTables>,
    modes: ContactModes,
    /// Length of the span (s).
    span: f64,
}

impl Tables {
    /// Creates tables for spans up to `longest` (s); call `set_span_length` before the first span, and `fill` before the
    /// first step of a level.
    pub fn new(modes: ContactModes, longest: f64) -> Self {
        let degree = modes.degree_up_to(longest);
        Self::of_degree(modes, degree)
    }

    /// Creates tables of degree 1, and of a higher degree for steps in which no sticking contact changes its status.
    pub(crate) fn with_steady(modes: ContactModes, longest: f64) -> Self {
        let degree = modes.degree_up_to(longest);
        let steady = (0..=HALVINGS).map(|_| StepTables::new(&modes, degree)).collect();
        Self { steady, ..Self::of_degree(modes, 1) }
    }

    /// Creates tables of a degree that is known to be suitable.
    pub(crate) fn of_degree(modes: ContactModes, degree: usize) -> Self {
        let levels = (0..=HALVINGS).map(|_| StepTables::new(&modes, degree)).collect();
        Self { rows: ContactRows::new(&modes), levels, steady: Vec::new(), modes, span: 0.0 }
    }

    /// Modes with inertia, and the flexibility of the others.
    pub(crate) fn shapes(&self) -> &ContactModes {
        &self.modes
    }

    /// Number of modes with inertia.
    pub fn modes(&self) -> usize {
        self.modes.len()
    }

    /// Number of contact nodes.
    pub fn nodes(&self) -> usize {
        self.modes.rows() / 3
    }

    /// Kinetic and strain energy of a sector (J).
    pub fn energy(&self, state: &SectorState) -> f64 {
        let (kinetic, strain) = state.energies(&self.modes.frequencies, self.rows.residual());
        kinetic + strain
    }

    /// Tables of a level with the given number of points.
    pub(crate) fn of_points(&self, level: usize, kind: ForceInterpolation, points: usize) -> &StepTables {
        let steady = self
            .steady
            .get(level)
            .filter(|level| kind == ForceInterpolation::Polynomial && level.basis.degree == points);
        steady.unwrap_or(&self.levels[level])
    }

    /// Sets the length of the spans (s). [`Tables::fill`] then fills the tables of the levels that steps use.
    pub(crate) fn set_span_length(&mut self, span: f64) {
        self.span = span;
    }

    /// Fills the tables of a level, unless they are filled. Returns whether they have changed. Does not allocate.
    pub(crate) fn fill(&mut self, level: usize) -> bool {
        let step = halved(self.span, level);
        if self.levels[level].step.to_bits() == step.to_bits() {
            return false;
        }
        for levels in [&mut self.levels, &mut self.steady] {
            if let Some(tables) = levels.get_mut(level) {
                tables.set_step(&self.modes, step);
                tables.share = halved(1.0, level);
            }
        }
        if level == HALVINGS {
            self.levels[level].set_constant(&self.modes);
        }
        true
    }
}

impl ContactModes {
    /// Largest suitable degree for spans up to `longest` (s). Shorter spans are possible, so all lengths down to a thousandth of
    /// the shortest step are checked.
    pub(crate) fn degree_up_to(&self, longest: f64) -> usize {
        let lengths = (0..2 * HALVINGS).map(|halvings| halved(longest, halvings));
        if lengths.into_iter().all(|length| self.allows_cubics(length)) { MOST } else { MOST - 1 }
    }
}

/// Shortest step of spans of length `span` (s).
pub fn shortest(span: f64) -> f64 {
    halved(span, HALVINGS)
}

/// `span` divided by 2 `halvings` times (s).
pub(super) fn halved(span: f64, halvings: usize) -> f64 {
    libm::ldexp(span, -i32::try_from(halvings).unwrap_or(i32::MAX))
}

//! Tables of one kind of sector for steps of all lengths, filled when a length is first used.

use super::level::BladeLevel;
use super::rows::BladeRows;
use crate::geometry::revolution::RevolutionGap;
use crate::modes::coordinates::ContactModes;
use crate::time::galerkin::level::StepTables;
use crate::time::galerkin::tables::{HALVINGS, Tables, halved};
use crate::time::galerkin::trial::ForceInterpolation;

/// Tables of one kind of sector.
#[derive(Debug, Clone)]
pub(super) struct BladeTables {
    pub rows: BladeRows,
    modes: ContactModes,
    /// Tables of all contact rows for one length, from which the others are filled.
    general: StepTables,
    grids: [Grid; 2],
    /// Index of the grid in use.
    in_use: usize,
}

/// Span whose steps the tables describe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SpanKind {
    /// A span that ends at an internal point of the communication step.
    Bounded,
    /// A span of a steady phase, which does not depend on the communication step.
    Steady,
}

/// Tables for a span that is halved repeatedly.
#[derive(Debug, Clone)]
struct Grid {
    /// Length of the span (s).
    span: f64,
    levels: Vec<BladeLevel>,
    /// Steps of the shortest length with a constant force.
    constant: BladeLevel,
    /// True for filled levels; the last entry belongs to the constant force.
    filled: [bool; HALVINGS + 2],
}

impl BladeTables {
    /// Allocates tables for the modes of the tables of all contact rows.
    pub fn new(tables: &Tables, gap: &RevolutionGap) -> Self {
        let degree = tables.levels[0].basis.degree;
        let rows = BladeRows::new(tables.shapes(), tables.rows.error_form(), &gap.slopes, &gap.layout);
        let level = |kind| BladeLevel::new(&rows, degree, kind);
        let grid = Grid {
            span: 0.0,
            levels: (0..=HALVINGS).map(|_| level(ForceInterpolation::Polynomial)).collect(),
            constant: level(ForceInterpolation::Constant),
            filled: [false; HALVINGS + 2],
        };
        let modes = tables.shapes().clone();
        Self { general: StepTables::new(&modes, degree), modes, grids: [grid.clone(), grid], rows, in_use: 0 }
    }

    /// Uses tables for spans of this length (s).
    pub fn set_span(&mut self, kind: SpanKind, span: f64) {
        self.in_use = kind as usize;
        let grid = &mut self.grids[self.in_use];
        if grid.span.to_bits() != span.to_bits() {
            (grid.span, grid.filled) = (span, [false; HALVINGS + 2]);
        }
    }

    /// Fills the table of a level unless it is filled. Does not allocate.
    pub fn prepare(&mut self, level: usize, kind: ForceInterpolation) {
        let Self { rows, modes, general, grids, in_use } = self;
        let Grid { span, levels, constant, filled } = &mut grids[*in_use];
        let (entry, halvings, table) = match kind {
            ForceInterpolation::Polynomial => (level, level, &mut levels[level]),
            ForceInterpolation::Constant => (HALVINGS + 1, HALVINGS, constant),
        };
        if !filled[entry] {
            general.set_step(modes, halved(*span, halvings));
            table.fill(rows, general);
            filled[entry] = true;
        }
    }

    /// Table of a level, which must be filled.
    pub fn level(&self, level: usize, kind: ForceInterpolation) -> &BladeLevel {
        let grid = &self.grids[self.in_use];
        if kind == ForceInterpolation::Constant { &grid.constant } else { &grid.levels[level] }
    }

    /// Length of the steps of a level (s).
    pub fn length(&self, level: usize) -> f64 {
        halved(self.grids[self.in_use].span, level)
    }
}

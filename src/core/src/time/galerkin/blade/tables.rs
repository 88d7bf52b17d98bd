//! Tables of one kind of sector for steps of all lengths, filled when a length is first used.

use super::level::BladeLevel;
use super::rows::BladeRows;
use super::skipped::plausible_energy;
use crate::geometry::revolution::RevolutionGap;
use crate::modes::coordinates::ContactModes;
use crate::time::galerkin::level::StepTables;
use crate::time::galerkin::tables::{HALVINGS, Tables, halved};
use crate::time::galerkin::trial::ForceInterpolation;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// Tables of one kind of sector. Several threads can read and fill them concurrently.
#[derive(Debug)]
pub(super) struct BladeTables {
    pub rows: BladeRows,
    /// Largest energy (J) of certainly small displacements; see [`plausible_energy`].
    pub plausible_energy: f64,
    modes: ContactModes,
    grids: [Grid; 2],
    /// Index of the grid in use.
    in_use: usize,
    unfilled: Mutex<UnfilledTables>,
}

/// Memory for tables that are not filled.
#[derive(Debug, Clone)]
struct UnfilledTables {
    /// Tables of all contact rows for one length, from which the others are filled.
    general: StepTables,
    polynomial: Vec<BladeLevel>,
    constant: Vec<BladeLevel>,
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
#[derive(Debug, Clone, Default)]
struct Grid {
    /// Length of the span (s).
    span: f64,
    levels: [OnceLock<BladeLevel>; HALVINGS + 1],
    /// Steps of the shortest length with a constant force.
    constant: OnceLock<BladeLevel>,
}

impl BladeTables {
    /// Allocates tables for the modes of the tables of all contact rows.
    pub fn new(tables: &Tables, gap: &RevolutionGap) -> Self {
        let degree = tables.levels[0].basis.degree;
        let rows = BladeRows::new(tables.shapes(), tables.rows.error_form(), gap);
        let level = |kind| BladeLevel::new(&rows, degree, kind);
        let modes = tables.shapes().clone();
        let unfilled = UnfilledTables {
            general: StepTables::new(&modes, degree),
            polynomial: (0..2 * (HALVINGS + 1)).map(|_| level(ForceInterpolation::Polynomial)).collect(),
            constant: (0..2).map(|_| level(ForceInterpolation::Constant)).collect(),
        };
        let plausible_energy = plausible_energy(&modes, &gap.layout);
        Self { rows, plausible_energy, modes, grids: Default::default(), in_use: 0, unfilled: Mutex::new(unfilled) }
    }

    fn unfilled(&self) -> MutexGuard<'_, UnfilledTables> {
        self.unfilled.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Uses tables for spans of this length (s).
    pub fn set_span(&mut self, kind: SpanKind, span: f64) {
        self.in_use = kind as usize;
        let Grid { span: previous, levels, constant } = &mut self.grids[self.in_use];
        if previous.to_bits() == span.to_bits() {
            return;
        }
        *previous = span;
        let unfilled = self.unfilled.get_mut().unwrap_or_else(PoisonError::into_inner);
        unfilled.polynomial.extend(levels.iter_mut().filter_map(OnceLock::take));
        unfilled.constant.extend(constant.take());
    }

    /// Returns the table of a level, and fills it at its first use. Does not allocate.
    pub fn level(&self, level: usize, kind: ForceInterpolation) -> &BladeLevel {
        let Grid { levels, constant, .. } = &self.grids[self.in_use];
        match kind {
            ForceInterpolation::Polynomial => levels[level].get_or_init(|| self.filled(kind, level)),
            ForceInterpolation::Constant => constant.get_or_init(|| self.filled(kind, HALVINGS)),
        }
    }

    /// Fills a table for the span halved `halvings` times.
    #[cold]
    fn filled(&self, kind: ForceInterpolation, halvings: usize) -> BladeLevel {
        let UnfilledTables { general, polynomial, constant } = &mut *self.unfilled();
        general.set_step(&self.modes, self.length(halvings));
        let memory = match kind {
            ForceInterpolation::Polynomial => polynomial,
            ForceInterpolation::Constant => {
                general.set_constant(&self.modes);
                constant
            }
        };
        let mut level = memory.pop().unwrap_or_else(|| unreachable!("memory for every level"));
        level.fill(&self.rows, general);
        level
    }

    /// Length of the steps of a level (s).
    pub fn length(&self, level: usize) -> f64 {
        halved(self.grids[self.in_use].span, level)
    }
}

impl Clone for BladeTables {
    fn clone(&self) -> Self {
        let Self { rows, modes, grids, in_use, .. } = self;
        let mut unfilled = self.unfilled().clone();
        // `set_span` returns the memory of all filled tables to these lists.
        unfilled.polynomial.reserve_exact(2 * (HALVINGS + 1));
        unfilled.constant.reserve_exact(2);
        Self {
            plausible_energy: self.plausible_energy,
            rows: rows.clone(),
            modes: modes.clone(),
            grids: grids.clone(),
            in_use: *in_use,
            unfilled: Mutex::new(unfilled),
        }
    }
}

//! What one structure's contact nodes remember: values now, one step before, and the oldest that a step still needs.

use crate::gaps::Geometry;
use crate::persist::{Persist, StateReader, StateWriter, persist_fields};

/// A value of the step just done, and of the step before. Only the former is part of a saved state.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Two<T> {
    /// Value of the last step.
    pub now: T,
    /// Value of the step before.
    pub before: T,
}

impl<T: Clone> Two<T> {
    /// The same value twice.
    pub fn new(value: T) -> Self {
        Self { before: value.clone(), now: value }
    }

    /// Makes the current value the one of the step before; the current value must be written next.
    pub fn shift(&mut self) {
        std::mem::swap(&mut self.now, &mut self.before);
    }
}

/// Three instants of an array. Those now and before are part of a saved state.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Three {
    /// At the current step.
    pub now: Vec<f64>,
    /// One step earlier.
    pub before: Vec<f64>,
    /// Two steps earlier.
    pub oldest: Vec<f64>,
}

impl Three {
    /// The same value everywhere and always.
    pub fn new(len: usize, value: f64) -> Self {
        Self { now: vec![value; len], before: vec![value; len], oldest: vec![value; len] }
    }

    /// Each becomes one step older; what is now is then to be written.
    pub fn shift(&mut self) {
        std::mem::swap(&mut self.oldest, &mut self.before);
        std::mem::swap(&mut self.before, &mut self.now);
    }
}

impl<T: Persist> Persist for Two<T> {
    fn save(&self, writer: &mut StateWriter) {
        self.now.save(writer);
    }
    fn restore(&mut self, reader: &mut StateReader) {
        self.now.restore(reader);
    }
    fn check(&self, reader: &mut StateReader) {
        self.now.check(reader);
    }
}

impl Persist for Three {
    fn save(&self, writer: &mut StateWriter) {
        self.now.save(writer);
        self.before.save(writer);
    }
    fn restore(&mut self, reader: &mut StateReader) {
        self.now.restore(reader);
        self.before.restore(reader);
    }
    fn check(&self, reader: &mut StateReader) {
        self.now.check(reader);
        self.before.check(reader);
    }
}

/// The past of the contact nodes of one structure, arrays `[node · lanes + lane]` and `[row · lanes + lane]` with three rows per
/// node. Displacements now and before are those of the modes.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactHistory {
    /// Gaps (m); infinite in padding lanes and where there is nothing to touch.
    pub gap: Three,
    /// Normals and closest points.
    pub geometry: Two<Geometry>,
    /// λ of the last step (N).
    pub multiplier: Vec<f64>,
    /// Part of λ that a coating carries (N).
    pub coating_force: Vec<f64>,
    /// Contact force on each row (N). That of the step before is kept for laws that start from it.
    pub force: Two<Vec<f64>>,
    /// Contact points as [`crate::gaps::GapLaw::contact_point`] tells them.
    pub points: Vec<f64>,
    /// Displacement of the contact rows as predicted (m), of schemes whose contact forces act one step later.
    pub predicted: Two<Vec<f64>>,
    /// Data that is not part of a state.
    pub passing: Passing,
}

/// Data of the past that a step needs and the next one does not.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Passing {
    /// Displacements of all rows of the structure, two steps before the step under way ends (m).
    pub oldest: Vec<f64>,
    /// Contact forces that last (N), on all rows: without those of impacts.
    pub lasting: Vec<f64>,
}

/// Written at every step before it is read.
impl Persist for Passing {
    fn save(&self, _: &mut StateWriter) {}
    fn restore(&mut self, _: &mut StateReader) {}
    fn check(&self, _: &mut StateReader) {}
}

persist_fields!(ContactHistory { gap, geometry, multiplier, coating_force, force, points, predicted, passing });

impl ContactHistory {
    /// Nothing has touched yet: `contacts` nodes in all lanes, `rows` values of displacements.
    pub fn new(geometry: Geometry, contacts: usize, rows: usize) -> Self {
        Self {
            // Padding lanes keep an infinite gap.
            gap: Three::new(contacts, f64::INFINITY),
            geometry: Two::new(geometry),
            multiplier: vec![0.0; contacts],
            coating_force: vec![0.0; contacts],
            force: Two::new(vec![0.0; 3 * contacts]),
            points: vec![0.0; 3 * contacts],
            predicted: Two::new(vec![0.0; 3 * contacts]),
            passing: Passing { oldest: vec![0.0; rows], lasting: vec![0.0; rows] },
        }
    }

    /// A step begins, from displacements `before` (m) one step earlier.
    pub fn shift(&mut self, before: &[f64]) {
        self.gap.shift();
        self.geometry.shift();
        self.passing.oldest.copy_from_slice(before);
    }

    /// Forces of the last step become those of the step before, for laws that start from them.
    pub fn keep_forces(&mut self) {
        self.force.before.copy_from_slice(&self.force.now);
    }

    /// Nothing has touched yet.
    pub fn clear(&mut self) {
        self.multiplier.fill(0.0);
        self.coating_force.fill(0.0);
        self.force.now.fill(0.0);
        self.points.fill(0.0);
    }
}

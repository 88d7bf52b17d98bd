//! Sums of many terms.

use crate::persist_fields;

/// Sum with Neumaier's compensation, because long runs add millions of tiny losses.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sum {
    total: f64,
    compensation: f64,
}

persist_fields!(Sum { total, compensation });

impl Sum {
    /// Adds a term.
    pub fn add(&mut self, term: f64) {
        let sum = self.total + term;
        self.compensation +=
            if self.total.abs() >= term.abs() { (self.total - sum) + term } else { (term - sum) + self.total };
        self.total = sum;
    }

    /// Returns the compensated value.
    pub fn value(&self) -> f64 {
        self.total + self.compensation
    }
}

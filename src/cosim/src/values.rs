//! Variables together with their current values.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use crate::persist::damaged;
use crate::variables::{DataType, Quantity, StartValue, Variable, VariableTable};
use crate::{Result, shown};

/// Variables of a unit with their current values, which it dereferences to: one number per value reference.
///
/// Integers, items and truth values are stored as numbers; texts are constants of the table.
#[derive(Debug, Clone, Default)]
pub struct VariableValues {
    table: Arc<VariableTable>,
    values: Vec<f64>,
}

crate::persist_fields!(VariableValues { values, .. });

impl VariableValues {
    /// Creates the store with all start values.
    pub fn new(table: VariableTable) -> Self {
        let mut store = Self { values: vec![0.0; table.references()], table: Arc::new(table) };
        store.reset();
        store
    }

    /// Returns the variables.
    pub fn table(&self) -> &VariableTable {
        &self.table
    }

    /// Returns the elements of a variable with this quantity of one structure or pair.
    pub fn elements(&self, quantity: Quantity, of: usize) -> Option<&[f64]> {
        let variable = self.table.with_quantity_of(quantity, of)?;
        self.values.get(variable.reference as usize..)?.get(..variable.len())
    }

    /// Returns the first element of a variable, or 0 without this variable.
    pub fn value_of(&self, quantity: Quantity, of: usize) -> f64 {
        self.elements(quantity, of).map_or(0.0, |elements| elements[0])
    }

    /// Checks the values of a saved state.
    ///
    /// # Errors
    /// A value that the type or the range of its variable excludes.
    pub fn check_values(&self) -> Result<()> {
        for variable in self.table.variables() {
            let values = &self.values[variable.reference as usize..][..variable.len()];
            if let Some(value) = values.iter().find(|value| !variable.can_have(**value)) {
                return damaged(format!("`{}` has the invalid value {}", variable.name, shown(*value)));
            }
        }
        Ok(())
    }

    /// Replaces all values and returns the previous ones.
    pub fn replace(&mut self, values: Vec<f64>) -> Vec<f64> {
        std::mem::replace(&mut self.values, values)
    }

    /// Sets all start values; values without one are 0.
    pub fn reset(&mut self) {
        self.values.fill(0.0);
        for variable in self.table.variables() {
            let values = &mut self.values[variable.reference as usize..];
            match &variable.start {
                Some(StartValue::Real(start)) => values[..start.len()].copy_from_slice(start),
                Some(StartValue::Integer(start)) => values[0] = f64::from(*start),
                Some(StartValue::Boolean(start)) => values[0] = f64::from(u8::from(*start)),
                Some(StartValue::String(_)) | None => {}
            }
        }
    }

    /// Returns the variable that has a reference, and its stored number.
    ///
    /// # Errors
    /// Unknown reference, or a variable of another type than `wanted`.
    pub(crate) fn stored(&self, reference: u32, wanted: DataType) -> Result<(&Variable, f64)> {
        let (variable, element) = self.table.locate(reference)?;
        variable.check_type(element, wanted)?;
        Ok((variable, self.values[reference as usize]))
    }
}

impl Deref for VariableValues {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.values
    }
}

impl DerefMut for VariableValues {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }
}

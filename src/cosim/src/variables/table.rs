//! All variables of a unit, by reference and by quantity.

use std::collections::{BTreeMap, HashSet};

use super::{Quantity, Variable};
use crate::{Error, Result, bounds};

/// The table: variables in order of their references, which start at 0 (time) without gaps.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct VariableTable {
    variables: Vec<Variable>,
    /// Row of each value reference.
    rows: Vec<u32>,
    /// First row of each quantity of a structure or pair.
    places: BTreeMap<(Quantity, usize), usize>,
}

/// Rejects tables with more than [`bounds::VALUES`] values.
fn check_count(variables: &[Variable]) -> Result<()> {
    let count = variables.iter().fold(0, |sum: usize, variable| sum.saturating_add(variable.len()));
    let Some(largest) = variables.iter().max_by_key(|variable| variable.len()).filter(|_| count > bounds::VALUES)
    else {
        return Ok(());
    };
    Err(Error::invalid(
        "scene",
        format!(
            "the variables have {count} values, which exceeds the limit of {}; `{}` alone has {}",
            bounds::VALUES,
            largest.name,
            largest.len()
        ),
        "Request fewer outputs, or use fewer coating cells, structures or sectors",
    ))
}

impl VariableTable {
    /// Creates a table of variables and assigns them consecutive references, starting at 0.
    ///
    /// # Errors
    /// [`Error::Invalid`] if a name occurs twice, or there are more than [`bounds::VALUES`] values.
    pub fn new(mut variables: Vec<Variable>) -> Result<Self> {
        check_count(&variables)?;
        let (mut rows, mut places, mut names) = (Vec::new(), BTreeMap::new(), HashSet::new());
        for (row, variable) in variables.iter_mut().enumerate() {
            variable.reference = u32::try_from(rows.len()).unwrap_or(u32::MAX);
            if !names.insert(variable.name.clone()) {
                let what = format!("variable `{}`", variable.name);
                return Err(Error::invalid(what, "the name occurs twice", "Give unique names"));
            }
            rows.extend(std::iter::repeat_n(u32::try_from(row).unwrap_or(u32::MAX), variable.len()));
            places.entry((variable.quantity, variable.of)).or_insert(row);
        }
        Ok(Self { variables, rows, places })
    }

    /// Number of value references (elements of all variables).
    pub fn references(&self) -> usize {
        self.rows.len()
    }

    /// First variable with this quantity.
    pub fn with_quantity(&self, quantity: Quantity) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.quantity == quantity)
    }

    /// Variable with this quantity of one structure or pair.
    pub fn with_quantity_of(&self, quantity: Quantity, of: usize) -> Option<&Variable> {
        self.places.get(&(quantity, of)).map(|row| &self.variables[*row])
    }

    /// All rows.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Row and element index of a value reference.
    ///
    /// # Errors
    /// [`Error::Invalid`] for an unknown reference.
    pub fn locate(&self, reference: u32) -> Result<(&Variable, usize)> {
        let row = usize::try_from(reference).ok().and_then(|index| self.rows.get(index));
        let row = *row.ok_or_else(|| {
            let remedy = "Use a value reference of its modelDescription.xml";
            Error::invalid("", format!("value reference {reference} does not exist in this FMU"), remedy)
        })? as usize;
        let variable = &self.variables[row];
        Ok((variable, (reference - variable.reference) as usize))
    }

    /// Finds a variable by its name (scalar or array name, not an element name).
    pub fn find(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.name == name)
    }
}

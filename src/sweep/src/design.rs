//! Values of the variables in every run.

use tiprub_shell::{Failure, Result};
use tiprub_table::{Cell, Column, ColumnType};

/// Largest number of runs of a plan.
pub const MOST_RUNS: usize = 10_000_000;

/// Rule that combines the values of the variables into runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Combination {
    /// Every value of a variable with every value of the others; the last variable changes fastest.
    Grid,
    /// The first values of all variables, then the second values, and so on.
    List,
}

/// Values of all variables.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    columns: Vec<Column>,
    combination: Combination,
    runs: usize,
}

impl Design {
    /// Combines the values of variables, one column each.
    ///
    /// # Errors
    /// A variable has no value, lists differ in length, or there are too many runs.
    pub fn new(columns: Vec<Column>, combination: Combination) -> Result<Self> {
        if let Some(column) = columns.iter().find(|column| column.cells.is_empty()) {
            return Err(Failure::new(
                format!("variable `{}`", column.name),
                "has no values",
                "Give at least one value",
            ));
        }
        let missing = |column: &Column| Some((column.name.clone(), column.cells.iter().position(Option::is_none)?));
        if let Some((name, row)) = columns.iter().find_map(missing) {
            let what = format!("variable `{name}`");
            return Err(Failure::new(what, format!("its value in row {} is missing", row + 1), "Give every value"));
        }
        let lengths = columns.iter().map(|column| column.cells.len());
        let runs = match combination {
            Combination::Grid => lengths.fold(1_usize, usize::saturating_mul),
            Combination::List => {
                let first = lengths.clone().next().unwrap_or(1);
                if let Some(column) = columns.iter().find(|column| column.cells.len() != first) {
                    let count = column.cells.len();
                    return Err(Failure::new(
                        format!("variable `{}`", column.name),
                        format!("has {count} values, but variable `{}` has {first}", columns[0].name),
                        "Give equally many values to all variables of a list, or use design = \"grid\"",
                    ));
                }
                first
            }
        };
        if runs > MOST_RUNS {
            let problem = format!("the plan has {runs} runs, more than the limit of {MOST_RUNS}");
            return Err(Failure::new("design", problem, "Give fewer values, or divide the plan into several plans"));
        }
        Ok(Self { columns, combination, runs })
    }

    /// Returns the number of runs.
    pub fn runs(&self) -> usize {
        self.runs
    }

    /// Returns the type of the values of a variable in the whole plan.
    pub fn kind(&self, variable: usize) -> ColumnType {
        self.columns[variable].kind
    }

    /// Returns the value of a variable in a run (both from 0).
    ///
    /// # Panics
    /// If there is no such variable or run.
    pub fn value(&self, run: usize, variable: usize) -> &Cell {
        let index = match self.combination {
            Combination::List => run,
            Combination::Grid => {
                let faster: usize = self.columns[variable + 1..].iter().map(|column| column.cells.len()).product();
                run / faster % self.columns[variable].cells.len()
            }
        };
        self.columns[variable].cells[index].as_ref().expect("the constructor rejects missing values")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(name: &str, values: &[i64]) -> Column {
        Column::new(name, values.iter().map(|value| Some(Cell::Integer(*value))).collect())
    }

    fn rows(design: &Design, variables: usize) -> Vec<Vec<String>> {
        let row = |run| (0..variables).map(|variable| design.value(run, variable).to_string()).collect();
        (0..design.runs()).map(row).collect()
    }

    #[test]
    fn grid_combines_all_values_and_varies_the_last_fastest() {
        let design = Design::new(vec![column("a", &[1, 2]), column("b", &[5, 6, 7])], Combination::Grid).unwrap();
        assert_eq!(rows(&design, 2), [["1", "5"], ["1", "6"], ["1", "7"], ["2", "5"], ["2", "6"], ["2", "7"]]);
    }

    #[test]
    fn list_takes_values_side_by_side() {
        let design = Design::new(vec![column("a", &[1, 2]), column("b", &[5, 6])], Combination::List).unwrap();
        assert_eq!(rows(&design, 2), [["1", "5"], ["2", "6"]]);
        assert_eq!(Design::new(Vec::new(), Combination::Grid).unwrap().runs(), 1);
    }

    #[test]
    fn unusable_designs_name_the_variable() {
        let failure = Design::new(vec![column("a", &[1, 2]), column("b", &[5])], Combination::List).unwrap_err();
        assert!(failure.what.contains("`b`") && failure.problem.contains("has 1 values"), "{failure}");
        assert!(Design::new(vec![column("a", &[])], Combination::Grid).unwrap_err().what.contains("`a`"));
        let gap = Column::new("c", vec![Some(Cell::Integer(1)), None]);
        assert!(Design::new(vec![gap], Combination::List).unwrap_err().problem.contains("row 2"));
        let many: Vec<i64> = (0..10_000).collect();
        let large = Design::new(vec![column("a", &many), column("b", &many)], Combination::Grid).unwrap_err();
        assert!(large.problem.contains("100000000 runs"), "{large}");
    }
}

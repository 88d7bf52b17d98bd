//! Computation of outputs from coordinates.

use nalgebra::DMatrix;

use crate::model::ConductionModel;
use crate::operator::DiagonalOperator;
use crate::simulation::ThermalSimulation;
use crate::table::Item;

/// Returns the rows of temperatures by coordinates x: of patches, of their heated surfaces, of the whole model, of
/// the surfaces in gas and air, of places.
pub(crate) fn rows(model: &ConductionModel) -> DMatrix<f64> {
    let parts = [&model.patch_means, &model.heat_loads.transpose(), &mean(model), &model.wetted_means, &model.places];
    let count = parts.iter().map(|part| part.nrows()).sum();
    let mut rows = DMatrix::zeros(count, model.order());
    let mut first = 0;
    for part in parts {
        rows.rows_mut(first, part.nrows()).copy_from(part);
        first += part.nrows();
    }
    rows
}

/// Returns the row of the mean temperature: the first coordinate alone.
fn mean(model: &ConductionModel) -> DMatrix<f64> {
    let mut row = DMatrix::zeros(1, model.order());
    row[(0, 0)] = 1.0 / model.heat_capacity.sqrt();
    row
}

/// Multiplies a row of the operator by coordinates.
pub(crate) fn row_times(operator: &DiagonalOperator, row: usize, coordinates: &[f64]) -> f64 {
    operator.rows.row(row).iter().zip(coordinates).map(|(a, b)| a * b).sum()
}

/// Returns the stored heat (J).
pub(crate) fn stored(operator: &DiagonalOperator, coordinates: &[f64]) -> f64 {
    operator.stored.iter().zip(coordinates).map(|(a, b)| a * b).sum()
}

impl ThermalSimulation {
    /// Returns the first row of the places.
    pub(crate) fn first_place(&self) -> usize {
        2 * self.model.patches.len() + 3
    }

    /// Returns the row of the hottest place.
    pub(crate) fn hottest(&self) -> usize {
        let value = |row: usize| row_times(&self.operator, row, &self.state.coordinates);
        let rows = self.first_place()..self.operator.rows.nrows();
        let best = rows.map(|row| (row, value(row))).max_by(|a, b| a.1.total_cmp(&b.1));
        best.map_or(0, |(row, _)| row)
    }

    /// Computes the values of all outputs.
    pub(crate) fn compute_outputs(&mut self) {
        for row in 0..self.items.len() {
            let variable = &self.state.values.table().variables()[row];
            let (first, count) = (variable.reference as usize, variable.len());
            for element in 0..count {
                if let Some(value) = self.output(self.items[row], element) {
                    self.state.values[first + element] = value;
                }
            }
        }
    }

    /// Returns one output; `None` if the item is not an output.
    fn output(&self, item: Item, element: usize) -> Option<f64> {
        let state = &self.state;
        Some(match item {
            Item::Time => state.time,
            Item::Power(film) => state.powers[film],
            Item::Residual => self.residual(),
            Item::RelativeResidual => {
                let size = state.exchanged + state.initial_heat.abs();
                if size > 0.0 { self.residual() / size } else { 0.0 }
            }
            _ => return self.linear(item, element, &state.coordinates, state.totals.map(|total| total.value())),
        })
    }

    /// Returns a temperature or a heat that is linear in the coordinates and the supplied heats: of the state, of its rates or of its
    /// changes; `None` for other items.
    pub(crate) fn linear(&self, item: Item, element: usize, coordinates: &[f64], heats: [f64; 3]) -> Option<f64> {
        Some(match item {
            Item::Rows(first) => row_times(&self.operator, first + element, coordinates),
            Item::Hottest => row_times(&self.operator, self.hottest(), coordinates),
            Item::Stored => stored(&self.operator, coordinates),
            Item::Total(index) => heats[index],
            _ => return None,
        })
    }

    /// Returns the residual of the heat balance (J).
    fn residual(&self) -> f64 {
        let came: f64 = self.state.totals.iter().map(tiprub_cosim::Sum::value).sum();
        stored(&self.operator, &self.state.coordinates) - self.state.initial_heat - came
    }
}

//! Model in the eigenvectors of its conduction and convection, for given convection factors.

use nalgebra::{DMatrix, DVector};

use crate::exponential::Phi;
use crate::model::ConductionModel;

/// ż = −λ z + loads, z = Eᵀ x.
#[derive(Debug, Clone)]
pub(crate) struct DiagonalOperator {
    /// Factors of the gas and of the air for which the operator was computed.
    pub(crate) factors: [f64; 2],
    /// λ (1/s), ascending.
    pub(crate) rates: Vec<f64>,
    /// E, coordinates × coordinates.
    pub(crate) vectors: DMatrix<f64>,
    /// Loads of a watt in each patch, coordinates × patches.
    pub(crate) heat: DMatrix<f64>,
    /// Loads per kelvin of the gas and of the air, including their factors; the transpose gives the heat flow at a
    /// temperature.
    pub(crate) films: [DVector<f64>; 2],
    /// Conductances of the surfaces at a uniform temperature, s h A (W/K).
    pub(crate) conductances: [f64; 2],
    /// Rows of outputs, see [`crate::outputs::rows`].
    pub(crate) rows: DMatrix<f64>,
    /// Stored heat (J) per coordinate.
    pub(crate) stored: DVector<f64>,
}

impl DiagonalOperator {
    /// Computes the operator of a model with `rows` of outputs.
    pub(crate) fn new(model: &ConductionModel, rows: &DMatrix<f64>, factors: [f64; 2]) -> Self {
        let films = [&model.gas_convection, &model.ambient_convection];
        let matrix = &model.conduction + films[0] * factors[0] + films[1] * factors[1];
        let eigen = matrix.symmetric_eigen();
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
        let vectors = DMatrix::from_fn(order.len(), order.len(), |i, k| eigen.eigenvectors[(i, order[k])]);
        let root = model.heat_capacity.sqrt();
        // H of the uniform temperature of 1 K, whose coordinates are √C and zeros.
        let film = |index: usize| vectors.tr_mul(&(films[index].column(0) * (root * factors[index])));
        Self {
            factors,
            // Without convection the rate of the uniform temperature is a rounding error of either sign.
            rates: order.iter().map(|&k| eigen.eigenvalues[k].max(0.0)).collect(),
            heat: vectors.tr_mul(&model.heat_loads),
            films: [film(0), film(1)],
            conductances: [model.gas_conductance() * factors[0], model.ambient_conductance() * factors[1]],
            rows: rows * &vectors,
            stored: vectors.row(0).transpose() * root,
            vectors,
        }
    }

    /// Advances coordinates over a step of `length` (s). `heat` (W) and the temperatures `films` of gas and air (K) are given
    /// at its start and its end, and linear in between. Returns the supplied heat, and the heat from the gas and from the
    /// air (J).
    pub(crate) fn advance(
        &self,
        length: f64,
        coordinates: &mut [f64],
        heat: [&[f64]; 2],
        films: [[f64; 2]; 2],
    ) -> [f64; 3] {
        let mean = |start: f64, end: f64| 0.5 * (start + end) * length;
        let supplied = heat[0].iter().zip(heat[1]).map(|(start, end)| mean(*start, *end)).sum();
        let [gas, air] = [0, 1].map(|film| self.conductances[film] * mean(films[0][film], films[1][film]));
        let mut heats = [supplied, gas, air];
        for (coordinate, z) in coordinates.iter_mut().enumerate() {
            let [start, end] = [0, 1].map(|side| self.load(coordinate, heat[side], films[side]));
            let phi = Phi::new(-self.rates[coordinate] * length);
            let [next, integral] = phi.step(length, *z, start, end - start);
            *z = next;
            for (flow, film) in heats[1..].iter_mut().zip(&self.films) {
                *flow -= film[coordinate] * integral;
            }
        }
        heats
    }

    /// Returns the load of `heat` (W) and of the temperatures of gas and air (K) on one coordinate.
    pub(crate) fn load(&self, coordinate: usize, heat: &[f64], films: [f64; 2]) -> f64 {
        let patches = self.heat.row(coordinate);
        let heated: f64 = patches.iter().zip(heat).map(|(load, heat)| load * heat).sum();
        heated + self.films[0][coordinate] * films[0] + self.films[1][coordinate] * films[1]
    }
}

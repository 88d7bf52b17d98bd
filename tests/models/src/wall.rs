//! Heat conduction through a wall.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use tiprub_cosim::ThermalPatch;
use tiprub_thermal::ConductionModel;

/// Returns a wall of 50 J/K with gas on one side (1 W/K) and air on the other (0.2 W/K), with one conduction mode
/// across its thickness.
pub fn wall() -> ConductionModel {
    let capacity = 50.0_f64;
    let uniform = 1.0 / capacity.sqrt();
    let row = |mode: f64| [uniform, mode * uniform];
    let film = |rate: f64, mode: f64| {
        let shape = DVector::from_column_slice(&[1.0, mode]);
        &shape * shape.transpose() * rate
    };
    ConductionModel {
        name: "wall".into(),
        origin: "one mode across the thickness".into(),
        heat_capacity: capacity,
        conduction: DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.0, 0.5]),
        gas_convection: film(0.02, 1.4),
        ambient_convection: film(0.004, -1.4),
        heat_loads: DMatrix::from_column_slice(2, 1, &row(1.4)),
        patch_means: DMatrix::from_row_slice(1, 2, &row(0.1)),
        wetted_means: DMatrix::from_row_slice(2, 2, &[row(1.4), row(-1.4)].concat()),
        places: DMatrix::from_row_slice(1, 2, &row(1.4)),
        patches: vec![ThermalPatch { angle: [0.0, TAU], axial: [0.0, 0.1] }],
        element_time: 1e-6,
    }
}

//! Heat conduction of casings: closed forms through the whole chain of mesh, reduction and exact step, and the
//! reduction against the full model.

#[path = "../common/mod.rs"]
mod common;

mod closed_forms;
mod reduction;
mod unstructured;

use std::f64::consts::PI;

use tiprub_core::CoSimulation;
use tiprub_cosim::ThermalPatch;
use tiprub_model::Mesh;
use tiprub_model::conduction::{ConductionOptions, Conductor};
use tiprub_model::element::ElementKind;
use tiprub_thermal::ThermalSimulation;

/// Returns steel with the given films (W/(m² K)).
fn options(films: [f64; 2], heated: [f64; 2], modes: usize) -> ConductionOptions {
    let conductor = Conductor::steel();
    ConductionOptions { name: "wall".into(), density: 7850.0, conductor, films, heated, surface: None, modes }
}

/// Returns one patch that contains everything.
fn whole() -> Vec<ThermalPatch> {
    vec![ThermalPatch { angle: [0.0, 2.0 * PI], axial: [-1.0, 1.0] }]
}

/// Returns a plane wall from x = 1 m, the side of the gas, outwards; its other sides are in the air.
fn wall(thickness: f64, elements: usize) -> Mesh {
    let mut mesh = common::distorted_box(ElementKind::Hex20, [elements, 1, 1], [thickness, 0.01, 0.01], |_| [0.0; 3]);
    mesh.nodes.iter_mut().for_each(|node| node[0] += 1.0);
    mesh
}

#[track_caller]
fn set(simulation: &mut ThermalSimulation, name: &str, value: f64) {
    let reference = simulation.table().find(name).unwrap_or_else(|| panic!("no {name}")).reference;
    simulation.set_real(reference, value).unwrap();
}

#[track_caller]
fn get(simulation: &ThermalSimulation, name: &str) -> f64 {
    let reference = simulation.table().find(name).unwrap_or_else(|| panic!("no {name}")).reference;
    simulation.real(reference).unwrap()
}

//! Loads other than contact, in modal coordinates: centrifugal growth, heat, nodal-diameter loads.

use super::inputs::CarrierInputs;
use crate::Rom;
use crate::math::real;
use crate::modes::modal::ModalModel;
use crate::scene::settings::StructureSettings;

/// Modal load of a structure by growth, per Ω² and, with stiffening, per Ω⁴; for coupled sectors on nodal diameter 0. Empty if the scene
/// has no growth.
pub fn centrifugal(structure: &StructureSettings, rom: &Rom, model: &ModalModel) -> Vec<[f64; 2]> {
    let Some(spin) = rom.extras.spin.as_ref().filter(|_| structure.spin.growth) else { return Vec::new() };
    let second = model.modal_load(&spin.centrifugal_load);
    // The fourth power belongs to the stiffness of small motions about the stretched shape; Ω²c alone with the stiffness at rest is linear
    // theory.
    let fourth = model.modal_load(&spin.centrifugal_load_speed4);
    let share = if structure.spin.stiffening { 1.0 } else { 0.0 };
    // This is the load of one sector, equal on all N sectors; an amplitude of nodal diameter 0 moves each by 1/√N.
    let all = if rom.is_cyclic() { libm::sqrt(real(rom.sectors)) } else { 1.0 };
    second.into_iter().zip(fourth).map(|(second, fourth)| [all * second, all * share * fourth]).collect()
}

/// Fills in the modal loads by growth at speed Ω (rad/s).
pub(crate) fn fill_centrifugal(centrifugal: &[[f64; 2]], speed: f64, loads: &mut [f64]) {
    let square = speed * speed;
    for (load, [second, fourth]) in loads.iter_mut().zip(centrifugal) {
        *load = square * (second + square * fourth);
    }
}

/// Modal load vectors of a surface carrier, per unit of the driving input; empty if the scene has no such load.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct CarrierLoads {
    /// Per kelvin of each patch.
    pub thermal: Vec<Vec<f64>>,
    /// Nodal-diameter load at phase 0 and a quarter period later, per unit amplitude.
    pub nodal: Option<[Vec<f64>; 2]>,
}

impl CarrierLoads {
    /// Creates the load vectors for a nodal-diameter load of `order`; `model` is observed at the contact grid of `rom`.
    pub fn new(structure: &StructureSettings, order: u32, rom: &Rom, model: &ModalModel) -> Self {
        let thermal = rom.extras.thermal.as_ref().filter(|_| structure.thermal);
        let load = |column: &[f64]| model.modal_load(column);
        let thermal = thermal.map(|thermal| thermal.loads.column_iter().map(|one| load(one.as_slice())).collect());
        let quarter = std::f64::consts::FRAC_PI_2;
        let nodal = structure.load.map(|_| [0.0, quarter].map(|phase| nodal_load(rom, model, order, phase)));
        Self { thermal: thermal.unwrap_or_default(), nodal }
    }

    /// Returns whether there are any loads.
    pub(crate) fn are_there(&self) -> bool {
        !self.thermal.is_empty() || self.nodal.is_some()
    }

    /// Fills in the modal loads for the inputs at `offset`.
    pub(super) fn fill(&self, inputs: &CarrierInputs, offset: f64, loads: &mut [f64]) {
        loads.fill(0.0);
        for (vector, input) in self.thermal.iter().zip(&inputs.temperatures) {
            let temperature = input.at(offset);
            loads.iter_mut().zip(vector).for_each(|(load, value)| *load += temperature * value);
        }
        if let Some([first, second]) = &self.nodal {
            let amplitude = inputs.load_amplitude.at(offset);
            let (sine, cosine) = libm::sincos(inputs.load_phase.at(offset));
            for ((load, first), second) in loads.iter_mut().zip(first).zip(second) {
                *load += amplitude * (cosine * first + sine * second);
            }
        }
    }
}

/// Modal load of the line load cos(nθ − φ) (N/m of circumference, outwards), distributed over the rings of the contact grid.
fn nodal_load(rom: &Rom, model: &ModalModel, order: u32, phase: f64) -> Vec<f64> {
    let Some(grid) = rom.extras.grid else { return vec![0.0; model.len()] };
    let share = std::f64::consts::TAU / (real(grid.around) * real(grid.along));
    let force = |node: usize| {
        let position = rom.contact_nodes[node].position;
        position[0] * share * libm::cos(f64::from(order) * position[1] - phase)
    };
    let nodes = rom.contact_nodes.len();
    (0..model.len())
        .map(|mode| (0..nodes).map(|node| model.contact_modes[(3 * node, mode)] * force(node)).sum())
        .collect()
}

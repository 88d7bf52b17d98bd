//! Elastic rods of linear elements with lumped mass, and other small systems defined by their modes.

#![allow(dead_code, reason = "each test binary uses its part")]

use nalgebra::DMatrix;
use tiprub_core::geometry::{FixedGap, GapLaw, Vector3};
use tiprub_core::limits::massless::{MasslessCheck, QUIET};
use tiprub_core::modes::bank::BankOptions;
use tiprub_core::modes::modal::ModalModel;
use tiprub_core::modes::schemes::free_increment;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::Rom;
use tiprub_core::system::{System, SystemSettings};
use tiprub_test_models::{node, single_sector_with, structure};

pub const SCHEMES: [Scheme; Scheme::RECURRENCES.len()] = Scheme::RECURRENCES;

/// Fraction of its mass that a nominally massless contact node of a rod keeps; the matrix must stay invertible.
pub const NEARLY_NONE: f64 = 1e-4;

/// A straight rod along x.
#[derive(Debug, Clone, Copy)]
pub struct StraightRod {
    pub young: f64,
    pub density: f64,
    pub area: f64,
    pub length: f64,
    pub elements: usize,
    /// Contact node, 0 or `elements`.
    pub end: usize,
    /// Fraction of its lumped mass that the contact node keeps; the rest goes to its neighbour.
    pub kept: f64,
}

impl StraightRod {
    pub fn wave_time(&self) -> f64 {
        self.length / self.elements as f64 / (self.young / self.density).sqrt()
    }

    pub fn rom(&self) -> Rom {
        let size = self.length / self.elements as f64;
        let (stiffness, mass) = (self.young * self.area / size, self.density * self.area * size);
        let nodes = self.elements + 1;
        let (mut k, mut m) = (DMatrix::zeros(nodes, nodes), DMatrix::zeros(nodes, nodes));
        for element in 0..self.elements {
            for (i, j, sign) in [(0, 0, 1.0), (1, 1, 1.0), (0, 1, -1.0), (1, 0, -1.0)] {
                k[(element + i, element + j)] += sign * stiffness;
            }
            m[(element, element)] += mass / 2.0;
            m[(element + 1, element + 1)] += mass / 2.0;
        }
        let moved = (1.0 - self.kept) * m[(self.end, self.end)];
        let neighbour = if self.end == 0 { 1 } else { self.end - 1 };
        m[(self.end, self.end)] -= moved;
        m[(neighbour, neighbour)] += moved;
        let mut map = DMatrix::zeros(3, nodes);
        map[(0, self.end)] = 1.0;
        structure("rod", m, k, map, vec![node("end", [0.0; 3], 0.0)])
    }

    /// Returns the modes; the highest one is the flexibility of the contact node.
    pub fn model(&self) -> ModalModel {
        ModalModel { quasi_static: 1, ..ModalModel::from_rom(&self.rom(), 0.0).unwrap() }
    }

    /// Returns the modes of the rod clamped at the other end.
    pub fn clamped_model(&self) -> ModalModel {
        let mut rom = self.rom();
        let held = self.elements - self.end;
        rom.mass = rom.mass.remove_row(held).remove_column(held);
        rom.stiffness = rom.stiffness.remove_row(held).remove_column(held);
        rom.contact_map = rom.contact_map.remove_column(held);
        ModalModel { quasi_static: 1, ..ModalModel::from_rom(&rom, 0.0).unwrap() }
    }
}

/// Returns the modes in ascending order of frequency, after structures were combined.
pub fn ascending(model: &ModalModel, quasi_static: usize) -> ModalModel {
    let mut order: Vec<usize> = (0..model.len()).collect();
    order.sort_by(|a, b| model.frequencies[*a].total_cmp(&model.frequencies[*b]));
    ModalModel {
        frequencies: order.iter().map(|mode| model.frequencies[*mode]).collect(),
        damping_ratios: order.iter().map(|mode| model.damping_ratios[*mode]).collect(),
        contact_modes: model.contact_modes.select_columns(&order),
        shapes: model.shapes.select_columns(&order),
        quasi_static,
    }
}

/// Returns one contact node that moves along x only, defined by its modes (ω, displacement of the node per unit
/// amplitude).
pub fn single(modes: &[(f64, f64)], quasi_static: usize) -> ModalModel {
    ModalModel {
        frequencies: modes.iter().map(|mode| mode.0).collect(),
        damping_ratios: vec![0.0; modes.len()],
        contact_modes: DMatrix::from_fn(3, modes.len(), |row, mode| if row == 0 { modes[mode].1 } else { 0.0 }),
        shapes: DMatrix::identity(modes.len(), modes.len()),
        quasi_static,
    }
}

/// Returns one node against a plane normal to x; `normal` is +1 if the plane is below it, −1 if it is above.
pub fn against_plane(model: &ModalModel, methods: (Scheme, Solver), normal: f64, gap: f64, loads: bool) -> System {
    let law = FixedGap { normals: vec![normal * Vector3::x()], gaps: vec![gap], sliding: vec![Vector3::zeros()] };
    let settings = SystemSettings { scheme: methods.0, solver: methods.1, ledger: true };
    let bank = BankOptions { loads, ..BankOptions::default() };
    single_sector_with(model, bank, GapLaw::Fixed(law), 0.0, settings)
}

/// Sets amplitude and increment q(0) − q(−h) of a mode.
pub fn set_samples(system: &mut System, model: &ModalModel, mode: usize, now: f64, before: f64) {
    let (frequency, step) = (model.frequencies[mode], system.bank().step());
    let at_rest = free_increment(frequency, 0.0, now, 0.0, step);
    let per_velocity = free_increment(frequency, 0.0, 0.0, 1.0, step);
    system.bank_mut().set_modal_state(mode, 0, now, (now - before - at_rest) / per_velocity);
}

/// Returns the step of massless-boundary, at most `largest` (s), at which opening and closing contact gains no energy.
pub fn quiet_step(model: &ModalModel, largest: f64) -> f64 {
    let check = MasslessCheck { model, normals: vec![Vector3::x()], carriers: Vec::new() };
    let limit = check.limit(1e3 * largest).unwrap();
    (0.95 * (QUIET * limit.closed).min(limit.usable)).min(largest)
}

/// Returns the orders of convergence from errors at repeatedly halved steps.
pub fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect()
}

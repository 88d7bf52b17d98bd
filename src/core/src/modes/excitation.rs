//! Loads that travel around the disk: a stationary pattern, seen from sectors that rotate through it.
//!
//! Blade s = 0 … N − 1 is loaded by F cos(ψ + 2πks/N) at one of its contact rows, with engine order k and ψ = kθ_r − phase. The
//! modal load of one mode is F φ cos(…). For coupled sectors, k is a wave of nodal diameter n = k mod N or, above N/2, of n = N −
//! k that travels in the other direction: Re(z e^(2πins/N)) with z = F e^(iψ) or F e^(−iψ). Its modal load is Ψ* z N/2, and Ψ*
//! Re(z) N if the modes are real.

use std::ops::Range;

use nalgebra::DMatrix;

use super::cyclic::CyclicModel;
use super::modal::ModalModel;
use crate::math::real;

/// Definition of an excitation: engine order, loaded modes and contact row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Excitation {
    /// Initial engine order.
    pub order: u32,
    /// The only loaded mode (0-based); `None` if all modes are loaded.
    pub mode: Option<usize>,
    /// Contact row on which the force acts; `None` for the row with the largest displacement in `mode`.
    pub row: Option<usize>,
}

/// Returns the index of the largest value, the first one if several are equal up to rounding.
pub fn most_moved(sizes: impl Iterator<Item = f64>) -> usize {
    let most = sizes
        .enumerate()
        .fold((0, 0.0), |most, (row, size)| if size > most.1 * (1.0 + 1e-6) { (row, size) } else { most });
    most.0
}

/// (cos, sin)(2πks/N).
fn wave(order: u32, sector: usize, sectors: usize) -> [f64; 2] {
    let turn = order as usize * sector % sectors;
    let angle = std::f64::consts::TAU * (real(turn) / real(sectors));
    let (sine, cosine) = libm::sincos(angle);
    [cosine, sine]
}

/// Loads of an excitation on the modes of uncoupled sectors, or of one nodal diameter of a disk.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ModalExcitation {
    excitation: Excitation,
    /// Groups on which the loads act: sectors, or one nodal diameter.
    pub groups: Range<usize>,
    /// Number of parts of loads and forces: 1 for sectors, 2 for a nodal diameter (real and imaginary).
    parts: usize,
    /// Modal load per unit force, `[mode][part]` (1/√kg); 0 for entries without a mode.
    pub load: Vec<f64>,
    /// Force on a sector per amplitude, or z times N or N/2 per z.
    share: f64,
    /// Factors of (cos ψ, −sin ψ) in the forces, `[group][part]`.
    pattern: Vec<[f64; 2]>,
    /// Forces in the current step (N), `[group][part]`: on sectors, or z times N or N/2.
    pub now: Vec<f64>,
}

impl ModalExcitation {
    pub fn new(excitation: Excitation, model: &ModalModel, disk: Option<&CyclicModel>, sectors: usize) -> Self {
        let (groups, parts) = (if disk.is_some() { 0..1 } else { 0..sectors }, if disk.is_some() { 2 } else { 1 });
        let (count, modes) = (groups.len() * parts, disk.map_or(model.len(), CyclicModel::most_modes));
        let (load, pattern, now) = (vec![0.0; parts * modes], vec![[0.0; 2]; count], vec![0.0; count]);
        let mut loads = Self { excitation, groups, parts, load, share: 1.0, pattern, now };
        if disk.is_none() {
            loads.fill(&model.contact_modes, |shape| [*shape, 0.0]);
        }
        loads.set_order(excitation.order, disk);
        loads
    }

    /// Sets the modal loads from the shapes of the modes, whose real and imaginary parts are `parts_of`.
    fn fill<T>(&mut self, shapes: &DMatrix<T>, parts_of: impl Fn(&T) -> [f64; 2]) {
        let size = |value: &T| {
            let [real, imaginary] = parts_of(value);
            libm::hypot(real, imaginary)
        };
        let own = self.excitation.mode.unwrap_or(0);
        let most = || most_moved(shapes.column(own).iter().map(size));
        let row = self.excitation.row.unwrap_or_else(most);
        self.load.fill(0.0);
        for (mode, load) in self.load.chunks_exact_mut(self.parts).take(shapes.ncols()).enumerate() {
            if self.excitation.mode.is_none_or(|own| own == mode) {
                load.copy_from_slice(&parts_of(&shapes[(row, mode)])[..self.parts]);
            }
        }
    }

    /// Sets the engine order, on uncoupled sectors or on a `disk`.
    pub fn set_order(&mut self, order: u32, disk: Option<&CyclicModel>) {
        let Some(disk) = disk else {
            let sectors = self.groups.len();
            for (sector, pattern) in self.pattern.iter_mut().enumerate() {
                *pattern = wave(order, sector, sectors);
            }
            return;
        };
        let alias = order as usize % disk.sectors;
        let n = alias.min(disk.sectors - alias);
        self.groups = n..n + 1;
        // A real mode has no imaginary part.
        let [share, turning] = match (disk.is_real(n), 2 * alias > disk.sectors) {
            (true, _) => [1.0, 0.0],
            (false, true) => [0.5, 1.0],
            (false, false) => [0.5, -1.0],
        };
        self.share = share * real(disk.sectors);
        self.pattern.copy_from_slice(&[[1.0, 0.0], [0.0, turning]]);
        self.fill(&disk.diameters[n].contact_modes, |shape| [shape.re, -turning.abs() * shape.im]);
    }

    /// Sets the forces of the next step from amplitude (N) and phase ψ (rad).
    pub fn set(&mut self, amplitude: f64, phase: f64) {
        let (sine, cosine) = libm::sincos(phase);
        for (force, [across, along]) in self.now.iter_mut().zip(&self.pattern) {
            *force = self.share * amplitude * (cosine * across - sine * along);
        }
    }

    /// Returns the modal force (re, im) on a mode of a group that `forces` cause, `[group][part]`.
    pub fn on_mode(&self, mode: usize, group: usize, forces: &[f64]) -> [f64; 2] {
        if !self.groups.contains(&group) {
            return [0.0; 2];
        }
        let parts = |values: &[f64], index: usize| {
            let of = &values[index * self.parts..][..self.parts];
            [of[0], of.get(1).copied().unwrap_or(0.0)]
        };
        times(parts(&self.load, mode), parts(forces, group - self.groups.start))
    }
}

fn times(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

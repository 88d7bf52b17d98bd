//! Loads that travel around the disk: a stationary pattern, seen from sectors that rotate through it.
//!
//! Blade s = 0 … N − 1 is loaded by F cos(ψ + 2πks/N) at one of its contact rows, with engine order k and ψ = kθ_r − phase. The
//! modal load of one mode is F φ cos(…). For coupled sectors, k is a wave of nodal diameter n = k mod N or, above N/2, of n = N −
//! k that travels in the other direction: Re(z e^(2πins/N)) with z = F e^(iψ) or F e^(−iψ). Its modal load is Ψ* z N/2, and Ψ*
//! Re(z) N if the modes are real.

use super::cyclic::CyclicModel;
use super::modal::ModalModel;

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

impl Excitation {
    fn acts_on(&self, mode: usize) -> bool {
        self.mode.is_none_or(|own| own == mode)
    }
}

/// (cos, sin)(2πks/N).
fn wave(order: u64, sector: usize, sectors: usize) -> [f64; 2] {
    let turn = order * sector as u64 % sectors as u64;
    #[expect(clippy::cast_precision_loss, reason = "sector counts are far below 2^52")]
    let angle = std::f64::consts::TAU * (turn as f64 / sectors as f64);
    let (sine, cosine) = libm::sincos(angle);
    [cosine, sine]
}

/// Excitation of uncoupled sectors.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SectorLoads {
    /// Modal load per unit force, of each mode (1/√kg).
    pub load: Vec<f64>,
    pattern: Vec<[f64; 2]>,
    /// Forces on the sectors in the current step (N).
    pub now: Vec<f64>,
    /// Forces on the sectors in the previous step (N).
    pub before: Vec<f64>,
}

impl SectorLoads {
    pub fn new(excitation: Excitation, model: &ModalModel, sectors: usize) -> Self {
        let own = excitation.mode.unwrap_or(0);
        let sizes = || model.contact_modes.column(own).iter().map(|value| value.abs()).collect::<Vec<_>>().into_iter();
        let row = excitation.row.unwrap_or_else(|| most_moved(sizes()));
        let of_mode = |mode| if excitation.acts_on(mode) { model.contact_modes[(row, mode)] } else { 0.0 };
        let mut loads = Self {
            load: (0..model.len()).map(of_mode).collect(),
            pattern: vec![[0.0; 2]; sectors],
            now: vec![0.0; sectors],
            before: vec![0.0; sectors],
        };
        loads.set_order(excitation.order);
        loads
    }

    pub(crate) fn set_order(&mut self, order: u32) {
        let sectors = self.pattern.len();
        for (sector, pattern) in self.pattern.iter_mut().enumerate() {
            *pattern = wave(u64::from(order), sector, sectors);
        }
    }

    /// Sets the forces of the next step from amplitude (N) and phase ψ (rad).
    pub fn set(&mut self, amplitude: f64, phase: f64) {
        let (sine, cosine) = libm::sincos(phase);
        for (force, [across, along]) in self.now.iter_mut().zip(&self.pattern) {
            *force = amplitude * (cosine * across - sine * along);
        }
    }

    pub fn rest(&mut self) {
        self.now.fill(0.0);
        self.before.fill(0.0);
    }
}

/// Excitation of a disk of coupled sectors.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DiskLoads {
    excitation: Excitation,
    /// Loaded nodal diameter.
    pub diameter: usize,
    backward: bool,
    /// N, or N/2 if the modes are complex.
    share: f64,
    /// Modal load per unit z (re, im), of each mode (1/√kg); 0 for entries without a mode.
    load: Vec<[f64; 2]>,
    now: [f64; 2],
    pub before: [f64; 2],
}

impl DiskLoads {
    pub fn new(excitation: Excitation, model: &CyclicModel) -> Self {
        let load = vec![[0.0; 2]; model.most_modes()];
        let mut loads =
            Self { excitation, diameter: 0, backward: false, share: 0.0, load, now: [0.0; 2], before: [0.0; 2] };
        loads.set_order(excitation.order, model);
        loads
    }

    pub(crate) fn set_order(&mut self, order: u32, model: &CyclicModel) {
        let alias = order as usize % model.sectors;
        self.backward = 2 * alias > model.sectors;
        self.diameter = if self.backward { model.sectors - alias } else { alias };
        let (shapes, own) = (&model.diameters[self.diameter].contact_modes, self.excitation.mode.unwrap_or(0));
        #[expect(clippy::cast_precision_loss, reason = "sector counts are far below 2^52")]
        let count = model.sectors as f64;
        self.share = if model.is_real(self.diameter) { count } else { 0.5 * count };
        let row = self.excitation.row.unwrap_or_else(|| {
            let sizes = (0..shapes.nrows()).map(|row| libm::hypot(shapes[(row, own)].re, shapes[(row, own)].im));
            most_moved(sizes)
        });
        self.load.fill([0.0; 2]);
        for mode in (0..shapes.ncols()).filter(|mode| self.excitation.acts_on(*mode)) {
            self.load[mode] = [shapes[(row, mode)].re, -shapes[(row, mode)].im];
        }
        if model.is_real(self.diameter) {
            self.load.iter_mut().for_each(|load| load[1] = 0.0);
        }
    }

    /// Sets the forces of the next step from amplitude (N) and phase ψ (rad).
    pub fn set(&mut self, amplitude: f64, phase: f64, is_real: bool) {
        let (sine, cosine) = libm::sincos(phase);
        let along = if is_real {
            0.0
        } else if self.backward {
            -sine
        } else {
            sine
        };
        self.now = [cosine, along].map(|part| self.share * amplitude * part);
    }

    /// Modal force (re, im) on a mode in the current step.
    pub(crate) fn of_mode(&self, mode: usize) -> [f64; 2] {
        times(self.load[mode], self.now)
    }

    /// Modal force (re, im) on a mode in the previous step.
    pub(crate) fn of_mode_before(&self, mode: usize) -> [f64; 2] {
        times(self.load[mode], self.before)
    }

    pub fn keep(&mut self) {
        self.before = self.now;
    }

    pub fn rest(&mut self) {
        (self.now, self.before) = ([0.0; 2], [0.0; 2]);
    }
}

fn times(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

//! Coupling of modes by spin and heat: Coriolis force, and the change of stiffness with speed and temperature.
//!
//! With G the Coriolis matrix and ΔK = (Ω² − Ω₀²)K₁ + (Ω⁴ − Ω₀⁴)K₂ − s(T − T₀)K in modal coordinates, the step
//!
//! ```text
//! m̃(q⁺ − 2q + q⁻)/h² + (d̃ + 2ΩG)(q⁺ − q⁻)/2h + (ω² + ΔK) q = f
//! ```
//!
//! is d⁺ = T (p − c((Ω/h) G d + ΔK q) + c f) with the uncoupled prediction p = βd − κq and T = (I + c(Ω/h)G)⁻¹. When the step is
//! multiplied by (q⁺ − q⁻)/2, the Coriolis term vanishes and ΔK adds ½ qᵀΔK q⁻ to the strain energy: the energy balance still
//! closes.

use crate::modes::modal::ModalSpin;
use crate::modes::schemes::ModeCoefficients;

/// Terms of spin that couple the modes.
#[derive(Debug, Clone)]
pub struct Coupling {
    spin: ModalSpin,
    stiffening: bool,
    coriolis: bool,
    /// Current speed (rad/s).
    pub(super) speed: f64,
    /// Current temperature (K).
    pub(super) temperature: f64,
    /// ΔK, row by row.
    stiffness: Vec<f64>,
    /// (Ω/h) G, row by row.
    gyroscopic: Vec<f64>,
    /// T of every set of coefficients, row by row.
    transforms: Vec<Vec<f64>>,
    /// Square of the frequency factor of every set; it multiplies ΔK of a mistuned sector.
    squares: Vec<f64>,
    /// Number of modes, from the lowest, that ΔK couples.
    pub(super) coupled: usize,
    /// Stiffness of each mode as a fraction of the reference stiffness if it softens without being coupled, otherwise 1.
    shares: Vec<f64>,
    work: Vec<f64>,
    result: Vec<f64>,
}

impl Coupling {
    /// Coupling for sectors with these frequency factors; one set of coefficients if `factors` is empty.
    pub fn new(spin: ModalSpin, stiffening: bool, coriolis: bool, factors: &[f64]) -> Self {
        let squares = if factors.is_empty() { vec![1.0] } else { factors.iter().map(|one| one * one).collect() };
        let modes = spin.coriolis.nrows();
        let square = |on: bool| vec![0.0; if on { modes * modes } else { 0 }];
        Self {
            speed: spin.reference_speed,
            temperature: spin.reference_temperature,
            stiffening: stiffening || spin.softening.is_some(),
            coriolis,
            stiffness: square(stiffening || spin.softening.is_some()),
            gyroscopic: square(coriolis),
            transforms: vec![square(coriolis); squares.len()],
            squares,
            coupled: 0,
            shares: vec![1.0; modes],
            work: vec![0.0; 2 * modes * modes],
            result: vec![0.0; modes],
            spin,
        }
    }

    /// Returns whether anything couples the modes at the current speed.
    pub(crate) fn is_active(&self) -> bool {
        (self.coriolis && self.speed != 0.0) || self.is_stiffened()
    }

    fn is_stiffened(&self) -> bool {
        self.stiffening
            && (self.speed.abs().to_bits() != self.spin.reference_speed.abs().to_bits() || self.heated() != 0.0)
    }

    /// Returns whether heat softens the modes.
    pub fn softens(&self) -> bool {
        self.spin.softening.is_some()
    }

    /// Stiffness of a mode that ΔK does not couple, as a fraction of the reference stiffness; 1 for coupled modes.
    pub fn share(&self, mode: usize) -> f64 {
        self.shares[mode]
    }

    /// Temperature above the reference temperature of the modes (K), 0 without softening.
    fn heated(&self) -> f64 {
        if self.spin.softening.is_some() { self.temperature - self.spin.reference_temperature } else { 0.0 }
    }

    /// Returns whether the coupling was computed for exactly this speed (rad/s) and temperature (K).
    pub(super) fn matches(&self, speed: f64, temperature: f64) -> bool {
        self.speed.to_bits() == speed.to_bits() && self.temperature.to_bits() == temperature.to_bits()
    }

    /// Updates speed Ω (rad/s) and temperature (K) for step size h (s) and modes with these reference `frequencies` (rad/s), the
    /// first `dynamic` of which have inertia.
    pub fn refresh(&mut self, [speed, temperature]: [f64; 2], step: f64, dynamic: usize, frequencies: &[f64]) {
        let modes = self.result.len();
        (self.speed, self.temperature) = (speed, temperature);
        let heated = self.heated();
        // Modes without inertia, and those that the step does not resolve, keep the stiffness of the reference speed: ΔK is
        // explicit, and at ωh ≈ π even a small ΔK would make them grow. With heat they soften by `shares`.
        let largest = self.squares.iter().fold(0.0_f64, |most, square| most.max(*square));
        let is_resolved = |frequency: &&f64| largest * **frequency * **frequency * step * step <= 4.0;
        self.coupled = dynamic.min(frequencies.iter().take_while(is_resolved).count());
        let dynamic = self.coupled;
        if self.stiffening {
            let (square, reference) = (speed * speed, self.spin.reference_speed * self.spin.reference_speed);
            let (second, fourth) = (square - reference, square * square - reference * reference);
            let entry = |spin: &ModalSpin, row: usize, column: usize| {
                let at = (row, column);
                let stiffened = second * spin.stiffness_speed2[at] + fourth * spin.stiffness_speed4[at];
                spin.softening.as_ref().map_or(stiffened, |softening| stiffened + heated * softening[at])
            };
            for row in 0..modes {
                for column in 0..modes {
                    let both = row < dynamic && column < dynamic;
                    self.stiffness[row * modes + column] = if both { entry(&self.spin, row, column) } else { 0.0 };
                }
            }
            if self.softens() {
                for (mode, (share, frequency)) in self.shares.iter_mut().zip(frequencies).enumerate() {
                    let alone = mode >= dynamic && *frequency > 0.0;
                    let change = if alone { entry(&self.spin, mode, mode) } else { 0.0 };
                    *share = if alone { 1.0 + change / (frequency * frequency) } else { 1.0 };
                }
            }
        }
        if self.coriolis {
            for row in 0..modes {
                for column in 0..modes {
                    self.gyroscopic[row * modes + column] = speed / step * self.spin.coriolis[(row, column)];
                }
            }
        }
    }

    /// Computes T of every set from its coefficients for the current step.
    pub(crate) fn invert_all(&mut self, coefficients: &[ModeCoefficients]) {
        if self.coriolis {
            for (set, coefficients) in coefficients.chunks_exact(self.shares.len()).enumerate() {
                self.invert(set, coefficients);
            }
        }
    }

    /// Adds ΔK of a sector without a factor, times modal coordinates, to forces. Forces of modes that soften without coupling are
    /// multiplied by their stiffness fraction.
    pub fn add_stiffness(&self, position: &[f64], forces: &mut [f64]) {
        if !self.is_stiffened() {
            return;
        }
        let modes = position.len();
        for (row, force) in forces.iter_mut().enumerate() {
            let entries = self.stiffness[row * modes..][..modes].iter().zip(position);
            *force = self.shares[row] * *force + entries.map(|(entry, value)| entry * value).sum::<f64>();
        }
    }

    /// T = (I + c(Ω/h)G)⁻¹ by elimination without pivoting: diag(1/c) + (Ω/h)G has a positive definite symmetric part.
    fn invert(&mut self, set: usize, coefficients: &[ModeCoefficients]) {
        let modes = self.result.len();
        let width = 2 * modes;
        for row in 0..modes {
            for column in 0..modes {
                let unit = f64::from(u8::from(row == column));
                let coupled = coefficients[row].compliance * self.gyroscopic[row * modes + column];
                self.work[row * width + column] = unit + coupled;
                self.work[row * width + modes + column] = unit;
            }
        }
        for pivot in 0..modes {
            let scale = 1.0 / self.work[pivot * width + pivot];
            self.work[pivot * width..][..width].iter_mut().for_each(|value| *value *= scale);
            for row in (0..modes).filter(|row| *row != pivot) {
                let factor = self.work[row * width + pivot];
                for column in 0..width {
                    let value = self.work[pivot * width + column];
                    self.work[row * width + column] -= factor * value;
                }
            }
        }
        for row in 0..modes {
            let inverse = &self.work[row * width + modes..][..modes];
            self.transforms[set][row * modes..][..modes].copy_from_slice(inverse);
        }
    }

    /// `values` ← T `values` for one set of coefficients.
    pub fn transform(&mut self, set: usize, values: &mut [f64]) {
        if !self.coriolis || self.speed == 0.0 {
            return;
        }
        multiply(&self.transforms[set], values, &mut self.result);
        values.copy_from_slice(&self.result);
    }

    /// Replaces the uncoupled prediction p by the difference d⁺ − p of the coupled prediction. `position` is q and `increment` is
    /// d of the previous step.
    pub fn couple(
        &mut self,
        set: usize,
        coefficients: &[ModeCoefficients],
        position: &[f64],
        increment: &[f64],
        predicted: &mut [f64],
    ) {
        let modes = self.result.len();
        self.result.fill(0.0);
        if self.is_stiffened() {
            multiply(&self.stiffness, position, &mut self.result);
            let square = self.squares[set];
            self.result.iter_mut().for_each(|value| *value *= square);
        }
        if self.coriolis {
            for (row, sum) in self.result.iter_mut().enumerate() {
                let entries = self.gyroscopic[row * modes..][..modes].iter().zip(increment);
                *sum += entries.map(|(entry, value)| entry * value).sum::<f64>();
            }
        }
        let (work, _) = self.work.split_at_mut(modes);
        for (mode, value) in work.iter_mut().enumerate() {
            *value = predicted[mode] - coefficients[mode].load_compliance() * self.result[mode];
        }
        if self.coriolis && self.speed != 0.0 {
            multiply(&self.transforms[set], work, &mut self.result);
        } else {
            self.result.copy_from_slice(work);
        }
        for (value, coupled) in predicted.iter_mut().zip(&self.result) {
            *value = coupled - *value;
        }
    }

    /// Adds the modal forces of constant spin, −ΔKq − 2ΩGq̇ with q̇ = d/h.
    pub fn force(&self, set: usize, position: &[f64], increment: &[f64], forces: &mut [f64]) {
        let modes = self.result.len();
        forces.fill(0.0);
        for (row, force) in forces.iter_mut().enumerate() {
            let product = |matrix: &[f64], vector: &[f64]| -> f64 {
                matrix[row * modes..][..modes].iter().zip(vector).map(|(entry, value)| entry * value).sum()
            };
            if self.is_stiffened() {
                *force -= self.squares[set] * product(&self.stiffness, position);
            }
            if self.coriolis {
                *force -= 2.0 * product(&self.gyroscopic, increment);
            }
        }
    }

    /// Returns ½ qᵀΔK(q − d), a part of the strain energy (J).
    pub fn strain(&self, set: usize, position: impl Fn(usize) -> f64, before: impl Fn(usize) -> f64) -> f64 {
        if !self.is_stiffened() {
            return 0.0;
        }
        let modes = self.result.len();
        let row = |row: usize| {
            let entries = &self.stiffness[row * modes..][..modes];
            let sum: f64 = entries.iter().enumerate().map(|(column, entry)| entry * before(column)).sum();
            0.5 * position(row) * sum
        };
        self.squares[set] * (0..modes).map(row).sum::<f64>()
    }
}

fn multiply(matrix: &[f64], vector: &[f64], result: &mut [f64]) {
    for (row, sum) in matrix.chunks_exact(vector.len()).zip(result) {
        *sum = row.iter().zip(vector).map(|(entry, value)| entry * value).sum();
    }
}

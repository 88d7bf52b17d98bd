//! Modes coupled by spin and heat: Coriolis force, and the stiffness of a speed and a temperature other than those of the modes.
//!
//! With G the Coriolis matrix and ΔK = (Ω² − Ω₀²)K₁ + (Ω⁴ − Ω₀⁴)K₂ − s(T − T₀)K in modal coordinates, the step
//!
//! ```text
//! m̃(q⁺ − 2q + q⁻)/h² + (d̃ + 2ΩG)(q⁺ − q⁻)/2h + (ω² + ΔK) q = f
//! ```
//!
//! is d⁺ = T (p − c((Ω/h) G d + ΔK q) + c f) with the uncoupled prediction p = βd − κq and T = (I + c(Ω/h)G)⁻¹. Multiplied
//! with (q⁺ − q⁻)/2 the Coriolis term vanishes and ΔK adds ½ qᵀΔK q⁻ to the strain energy: the ledger closes as before.

use crate::dynamics::modal::ModalSpin;
use crate::schemes::ModeCoefficients;

/// What of the spin couples the modes.
#[derive(Debug, Clone)]
pub struct Coupling {
    spin: ModalSpin,
    stiffening: bool,
    coriolis: bool,
    speed: f64,
    temperature: f64,
    /// ΔK, row by row.
    stiffness: Vec<f64>,
    /// (Ω/h) G, row by row.
    gyroscopic: Vec<f64>,
    /// T of every set of coefficients, row by row.
    transforms: Vec<Vec<f64>>,
    work: Vec<f64>,
    result: Vec<f64>,
}

impl Coupling {
    /// Room for `sets` sets of coefficients.
    pub fn new(spin: ModalSpin, stiffening: bool, coriolis: bool, sets: usize) -> Self {
        let modes = spin.coriolis.nrows();
        let square = |on: bool| vec![0.0; if on { modes * modes } else { 0 }];
        Self {
            speed: spin.reference_speed,
            temperature: spin.reference_temperature,
            stiffening: stiffening || spin.softening.is_some(),
            coriolis,
            stiffness: square(stiffening || spin.softening.is_some()),
            gyroscopic: square(coriolis),
            transforms: vec![square(coriolis); sets],
            work: vec![0.0; 2 * modes * modes],
            result: vec![0.0; modes],
            spin,
        }
    }

    /// Speed in use (rad/s).
    pub fn speed(&self) -> f64 {
        self.speed
    }

    /// Temperature in use (K).
    pub fn temperature(&self) -> f64 {
        self.temperature
    }

    /// Whether anything couples the modes at the speed in use.
    pub fn is_active(&self) -> bool {
        (self.coriolis && self.speed != 0.0) || self.is_stiffened()
    }

    fn is_stiffened(&self) -> bool {
        self.stiffening
            && (self.speed.abs().to_bits() != self.spin.reference_speed.abs().to_bits() || self.heated() != 0.0)
    }

    /// Kelvin above the temperature of the modes, where these soften.
    fn heated(&self) -> f64 {
        if self.spin.softening.is_some() { self.temperature - self.spin.reference_temperature } else { 0.0 }
    }

    /// Use the speed Ω (rad/s) and the temperature (K) with the coefficients of a step size h (s), one slice per set.
    pub fn refresh(
        &mut self,
        [speed, temperature]: [f64; 2],
        step: f64,
        dynamic: usize,
        coefficients: &[ModeCoefficients],
    ) {
        let modes = self.result.len();
        (self.speed, self.temperature) = (speed, temperature);
        let heated = self.heated();
        // Modes without inertia, and those that the step does not resolve, keep the stiffness of the reference speed: ΔK
        // is explicit, and at ωh ≈ π the least of it would make them grow.
        let dynamic = dynamic.min(resolved(step, modes, coefficients));
        if self.stiffening {
            let (square, reference) = (speed * speed, self.spin.reference_speed * self.spin.reference_speed);
            let (second, fourth) = (square - reference, square * square - reference * reference);
            for row in 0..modes {
                for column in 0..modes {
                    let entries =
                        (self.spin.stiffness_speed2[(row, column)], self.spin.stiffness_speed4[(row, column)]);
                    let both = row < dynamic && column < dynamic;
                    self.stiffness[row * modes + column] =
                        if both { second * entries.0 + fourth * entries.1 } else { 0.0 };
                    if let Some(softening) = self.spin.softening.as_ref().filter(|_| both) {
                        self.stiffness[row * modes + column] += heated * softening[(row, column)];
                    }
                }
            }
        }
        if self.coriolis {
            for row in 0..modes {
                for column in 0..modes {
                    self.gyroscopic[row * modes + column] = speed / step * self.spin.coriolis[(row, column)];
                }
            }
            for (set, coefficients) in coefficients.chunks_exact(modes).enumerate() {
                self.invert(set, coefficients);
            }
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

    /// Turns the uncoupled prediction p into the difference d⁺ − p of the coupled one, in place. `position` is q and
    /// `increment` is d of the step before.
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

    /// −ΔKq − 2ΩGq̇ with q̇ = d/h: what constant spin adds to the modal forces of a motion.
    pub fn force(&self, position: &[f64], increment: &[f64], forces: &mut [f64]) {
        let modes = self.result.len();
        forces.fill(0.0);
        for (row, force) in forces.iter_mut().enumerate() {
            let product = |matrix: &[f64], vector: &[f64]| -> f64 {
                matrix[row * modes..][..modes].iter().zip(vector).map(|(entry, value)| entry * value).sum()
            };
            if self.is_stiffened() {
                *force -= product(&self.stiffness, position);
            }
            if self.coriolis {
                *force -= 2.0 * product(&self.gyroscopic, increment);
            }
        }
    }

    /// ½ qᵀΔK(q − d): part of the strain energy (J).
    pub fn strain(&self, position: impl Fn(usize) -> f64, before: impl Fn(usize) -> f64) -> f64 {
        if !self.is_stiffened() {
            return 0.0;
        }
        let modes = self.result.len();
        let row = |row: usize| {
            let entries = &self.stiffness[row * modes..][..modes];
            let sum: f64 = entries.iter().enumerate().map(|(column, entry)| entry * before(column)).sum();
            0.5 * position(row) * sum
        };
        (0..modes).map(row).sum()
    }
}

/// Number of modes, from the lowest, with ωh ≤ 2 in every set of coefficients.
fn resolved(step: f64, modes: usize, coefficients: &[ModeCoefficients]) -> usize {
    let within = |k: &ModeCoefficients| 2.0 * k.spring * step * step <= 4.0;
    let count = |set: &[ModeCoefficients]| set.iter().take_while(|k| within(k)).count();
    coefficients.chunks_exact(modes).map(count).min().unwrap_or(0)
}

fn multiply(matrix: &[f64], vector: &[f64], result: &mut [f64]) {
    for (row, sum) in matrix.chunks_exact(vector.len()).zip(result) {
        *sum = row.iter().zip(vector).map(|(entry, value)| entry * value).sum();
    }
}

//! Fourier transforms between the spectra of nodal diameters and the N sectors.
//!
//! A spectrum holds complex values per row and nodal diameter, `[block][row][re, im][lane]` with the nodal diameters as lanes of
//! blocks of [`LANES`]; values of the sectors are `[row][sector]`. With E = Σ Re U_n cos(2πns/N) and O = Σ Im U_n sin(2πns/N),
//! sector s moves by E − O and sector N − s by E + O, so that only half of the sectors need sums. For even N, the sums over even
//! and over odd n also give sectors N/2 ± s, and a quarter is enough.

use crate::math::real;
use crate::math::simd::Kernel;
use crate::math::vector::Vector3;
use crate::modes::bank::LANES;

/// Rows that are transformed together.
const ROWS: usize = 3;

/// Tables for one number of sectors.
#[derive(Debug, Clone, PartialEq)]
pub struct Fourier {
    sectors: usize,
    /// Nodal diameters 0 ..= N/2.
    diameters: usize,
    /// Number of sectors for which sums are computed: 0 .. summed.
    summed: usize,
    /// (cos, sin)(2πns/N) of the summed sectors, `[n][chunk][cos, sin][lane]`.
    synthesis: Vec<[[f64; LANES]; 2]>,
    /// (cos, −sin)(2πns/N) of all sectors, `[sector][block][cos, −sin][lane of n]`.
    analysis: Vec<[[f64; LANES]; 2]>,
}

impl Fourier {
    /// Creates tables for `sectors` sectors.
    pub fn new(sectors: usize) -> Self {
        let diameters = sectors / 2 + 1;
        let summed = if sectors.is_multiple_of(2) { sectors / 4 + 1 } else { diameters };
        let (chunks, blocks) = (summed.div_ceil(LANES), diameters.div_ceil(LANES));
        let mut synthesis = vec![[[0.0; LANES]; 2]; diameters * chunks];
        for n in 0..diameters {
            for sector in 0..summed {
                let (sine, cosine) = sine_cosine(n * sector, sectors);
                let [cosines, sines] = &mut synthesis[n * chunks + sector / LANES];
                (cosines[sector % LANES], sines[sector % LANES]) = (cosine, sine);
            }
        }
        let mut analysis = vec![[[0.0; LANES]; 2]; sectors * blocks];
        for sector in 0..sectors {
            for n in 0..diameters {
                let (sine, cosine) = sine_cosine(n * sector, sectors);
                let [cosines, sines] = &mut analysis[sector * blocks + n / LANES];
                (cosines[n % LANES], sines[n % LANES]) = (cosine, -sine);
            }
        }
        Self { sectors, diameters, summed, synthesis, analysis }
    }

    /// Number of blocks of a spectrum.
    pub fn blocks(&self) -> usize {
        self.diameters.div_ceil(LANES)
    }

    /// Adds the three components of a force on one sector to the spectrum Σ_s f_s e^(−2πins/N), rows `first` to `first + 2` of `rows`.
    #[inline(always)]
    pub fn add(&self, sector: usize, first: usize, rows: usize, force: Vector3, spectrum: &mut [[[f64; LANES]; 2]]) {
        let blocks = self.blocks();
        for (block, [cosines, sines]) in self.analysis[sector * blocks..][..blocks].iter().enumerate() {
            let targets = &mut spectrum[block * rows + first..][..3];
            for ([real, imaginary], force) in targets.iter_mut().zip(&force) {
                for lane in 0..LANES {
                    real[lane] += force * cosines[lane];
                    imaginary[lane] += force * sines[lane];
                }
            }
        }
    }
}

/// Computes the values of all sectors from a spectrum of `rows` rows: u_s = Σ_n Re(U_n e^(2πins/N)), `[row · lanes + s]`.
pub(crate) struct Synthesis<'a> {
    pub fourier: &'a Fourier,
    pub spectrum: &'a [[[f64; LANES]; 2]],
    pub rows: usize,
    pub lanes: usize,
    pub values: &'a mut [f64],
}

impl Kernel for Synthesis<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { fourier, spectrum, rows, lanes, values } = self;
        let even = fourier.sectors.is_multiple_of(2);
        let chunks = fourier.summed.div_ceil(LANES);
        for (group, values) in values.chunks_exact_mut(ROWS * lanes).enumerate() {
            for chunk in 0..chunks {
                let source = &spectrum[ROWS * group..];
                let (first, second) = if even {
                    (fourier.sum(chunk, 0, 2, source, rows), fourier.sum(chunk, 1, 2, source, rows))
                } else {
                    (fourier.sum(chunk, 0, 1, source, rows), [[[0.0; LANES]; 2]; ROWS])
                };
                let sums = first.iter().zip(&second);
                for (sums, values) in sums.zip(values.chunks_exact_mut(lanes)) {
                    fourier.unfold(chunk, sums, values);
                }
            }
        }
    }
}

impl Fourier {
    /// Σ Re U_n cos(2πns/N) and Σ Im U_n sin(2πns/N) over every `stride`-th n from `first` on, for one chunk of sectors.
    #[inline(always)]
    fn sum(
        &self,
        chunk: usize,
        first: usize,
        stride: usize,
        spectrum: &[[[f64; LANES]; 2]],
        rows: usize,
    ) -> [[[f64; LANES]; 2]; ROWS] {
        let chunks = self.summed.div_ceil(LANES);
        let mut sums = [[[0.0; LANES]; 2]; ROWS];
        for n in (first..self.diameters).step_by(stride) {
            let [cosines, sines] = &self.synthesis[n * chunks + chunk];
            let source = &spectrum[n / LANES * rows..][..ROWS];
            for row in 0..ROWS {
                let (real, imaginary) = (source[row][0][n % LANES], source[row][1][n % LANES]);
                for lane in 0..LANES {
                    sums[row][0][lane] += real * cosines[lane];
                    sums[row][1][lane] += imaginary * sines[lane];
                }
            }
        }
        sums
    }

    /// Computes sectors s, N − s, and for even N also N/2 + s and N/2 − s, from the sums over even and odd n.
    #[inline(always)]
    fn unfold(&self, chunk: usize, sums: (&[[f64; LANES]; 2], &[[f64; LANES]; 2]), values: &mut [f64]) {
        let first = chunk * LANES;
        let count = (self.summed - first).min(LANES);
        let ([even, even_turning], [odd, odd_turning]) = sums;
        let (mut out, n) = ([[0.0; LANES]; 4], self.sectors);
        for lane in 0..LANES {
            let (across, along) = (even[lane] + odd[lane], even_turning[lane] + odd_turning[lane]);
            let (opposite, back) = (even[lane] - odd[lane], even_turning[lane] - odd_turning[lane]);
            out[0][lane] = across - along;
            out[1][lane] = across + along;
            out[2][lane] = opposite - back;
            out[3][lane] = opposite + back;
        }
        for lane in 0..count {
            let sector = first + lane;
            values[sector] = out[0][lane];
            if sector > 0 {
                values[n - sector] = out[1][lane];
            }
            if n.is_multiple_of(2) {
                values[n / 2 + sector] = out[2][lane];
                values[n / 2 - sector] = out[3][lane];
            }
        }
    }
}

/// Sine and cosine of 2π·index/count; the symmetries of the circle hold exactly.
pub(crate) fn sine_cosine(index: usize, count: usize) -> (f64, f64) {
    let (quarter, rest) = (4 * (index % count) / count, 4 * (index % count) % count);
    let angle = |part: usize| std::f64::consts::FRAC_PI_2 * (real(part) / real(count));
    let (sine, cosine) = if 2 * rest == count {
        (std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2)
    } else if 2 * rest < count {
        libm::sincos(angle(rest))
    } else {
        let (sine, cosine) = libm::sincos(angle(count - rest));
        (cosine, sine)
    };
    match quarter {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine_are_exact_at_symmetry_angles() {
        for count in 1..60 {
            for index in 0..3 * count {
                let (sine, cosine) = sine_cosine(index, count);
                let angle = std::f64::consts::TAU * index as f64 / count as f64;
                assert!((sine - angle.sin()).abs() < 4e-15 && (cosine - angle.cos()).abs() < 4e-15, "{index}/{count}");
                let mirrored = sine_cosine(3 * count - index, count);
                assert_eq!((mirrored.0, mirrored.1), (-sine, cosine), "{index}/{count}");
            }
        }
        assert_eq!(sine_cosine(14, 56), (1.0, 0.0));
        assert_eq!(sine_cosine(28, 56), (0.0, -1.0));
    }

    /// Compares every number of sectors with the explicit sum, in both directions.
    #[test]
    fn synthesis_is_the_sum_over_the_nodal_diameters() {
        for sectors in 2..=61_usize {
            let (rows, lanes) = (6, sectors.div_ceil(LANES) * LANES);
            let fourier = Fourier::new(sectors);
            let mut spectrum = vec![[[0.0; LANES]; 2]; fourier.blocks() * rows];
            for n in 0..=sectors / 2 {
                for row in 0..rows {
                    let entry = &mut spectrum[n / LANES * rows + row];
                    entry[0][n % LANES] = (1.3 * n as f64 + row as f64).sin();
                    entry[1][n % LANES] = (0.7 * n as f64 - 2.0 * row as f64).cos();
                }
            }
            let mut values = vec![0.0; rows * lanes];
            Synthesis { fourier: &fourier, spectrum: &spectrum, rows, lanes, values: &mut values }.run();
            for row in 0..rows {
                for sector in 0..sectors {
                    let sum: f64 = (0..=sectors / 2)
                        .map(|n| {
                            let angle = std::f64::consts::TAU * (n * sector) as f64 / sectors as f64;
                            let entry = &spectrum[n / LANES * rows + row];
                            entry[0][n % LANES] * angle.cos() - entry[1][n % LANES] * angle.sin()
                        })
                        .sum();
                    let found = values[row * lanes + sector];
                    assert!(
                        (found - sum).abs() < 1e-12,
                        "N = {sectors}, row {row}, sector {sector}: {found} for {sum}"
                    );
                }
            }
            let mut again = vec![[[0.0; LANES]; 2]; fourier.blocks() * rows];
            for sector in 0..sectors {
                for node in 0..2 {
                    let force = [0, 1, 2].map(|i| values[(3 * node + i) * lanes + sector]).into();
                    fourier.add(sector, 3 * node, rows, force, &mut again);
                }
            }
            for n in 0..=sectors / 2 {
                let real = n == 0 || 2 * n == sectors;
                let factor = if real { 1.0 } else { 2.0 } / sectors as f64;
                for row in 0..rows {
                    let (given, back) = (spectrum[n / LANES * rows + row], again[n / LANES * rows + row]);
                    let off = (given[0][n % LANES] - factor * back[0][n % LANES]).abs();
                    let imaginary = if real { 0.0 } else { given[1][n % LANES] };
                    let off = off.max((imaginary - factor * back[1][n % LANES]).abs());
                    assert!(off < 1e-13, "N = {sectors}, n = {n}: {off:e}");
                }
            }
        }
    }
}

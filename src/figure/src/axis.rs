//! Axes of plots: linear, or logarithmic with round numbers at the ticks.

use std::ops::Range;

use plotters::coord::{
    ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter},
    types::RangedCoordf64,
};

/// Largest number of ticks of a logarithmic axis.
const MOST_TICKS: u8 = 9;

/// Linear axis, or axis of decimal logarithms.
#[derive(Debug, Clone)]
pub struct Axis {
    range: Range<f64>,
    logarithmic: bool,
}

impl Axis {
    /// Creates an axis over a range of values, or of their decimal logarithms.
    pub fn new(range: Range<f64>, logarithmic: bool) -> Self {
        Self { range, logarithmic }
    }

    fn linear(&self) -> RangedCoordf64 {
        self.range.clone().into()
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.linear().map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if self.logarithmic { logarithmic_ticks(&self.range) } else { self.linear().key_points(hint) }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        tick(if self.logarithmic { 10_f64.powf(*value) } else { *value })
    }
}

/// Returns decimal logarithms of round numbers within their range: decades, or 1, 2 and 5 in each decade, or evenly spaced numbers.
fn logarithmic_ticks(range: &Range<f64>) -> Vec<f64> {
    let decades: Vec<f64> = multiples(range, &[1.0]);
    if decades.len() > 2 {
        let every = decades.len().div_ceil(MOST_TICKS.into());
        return decades.into_iter().rev().step_by(every).collect();
    }
    let finer = multiples(range, &[1.0, 2.0, 5.0]);
    if finer.len() > 2 {
        return finer;
    }
    let [low, high] = [range.start, range.end].map(|end| 10_f64.powf(end));
    let step = round_step((high - low) / 5.0);
    let first = (low / step).ceil();
    (0..=MOST_TICKS)
        .map(|index| (first + f64::from(index)) * step)
        .take_while(|value| *value <= high)
        .map(f64::log10)
        .collect()
}

/// Returns decimal logarithms of the multiples of powers of ten within a range.
fn multiples(range: &Range<f64>, factors: &[f64]) -> Vec<f64> {
    #[expect(clippy::cast_possible_truncation, reason = "exponents of doubles")]
    let powers = range.start.floor() as i32..=range.end.ceil() as i32;
    let all = powers.flat_map(|power| factors.iter().map(move |factor| f64::from(power) + factor.log10()));
    all.filter(|value| (range.start - 1e-9..=range.end + 1e-9).contains(value)).collect()
}

/// Returns the smallest round step (1, 2 or 5 times a power of ten) that is not below `raw`.
pub fn round_step(raw: f64) -> f64 {
    let power = 10_f64.powf(raw.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= raw * 0.999);
    factor.unwrap_or(10.0) * power
}

/// Formats an axis number without trailing zeros or rounding digits; never a negative zero.
pub fn tick(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if !(1e-3 * (1.0 - 1e-9)..1e5 * (1.0 - 1e-9)).contains(&value.abs()) {
        let text = format!("{value:.2e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
        return format!("{mantissa}e{exponent}");
    }
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tick_labels_are_short() {
        let ticks = [0.0, 0.30000000000000004, -1500.0, 2e-7, 1e6, -0.25].map(tick);
        assert_eq!(ticks, ["0", "0.3", "-1500", "2e-7", "1e6", "-0.25"]);
    }

    /// Tick labels such as 0.1259 do not occur in any range.
    #[test]
    fn logarithmic_axes_have_round_numbers_at_their_ticks() {
        for start in [-17.3, -2.95, -0.9, 0.02, 1.1] {
            for span in [0.05, 0.3, 0.9, 1.7, 2.5, 6.0, 20.0] {
                let axis = Axis::new(start..start + span, true);
                let ticks = logarithmic_ticks(&axis.range);
                assert!((2..=12).contains(&ticks.len()), "{start} {span}: {ticks:?}");
                for tick in ticks.iter().map(|value| axis.format_ext(value)) {
                    let mantissa = tick.split('e').next().unwrap().replace('.', "");
                    let digits = mantissa.trim_start_matches('0').trim_end_matches('0');
                    assert!(digits.len() <= 3 && (span < 0.9 || digits.len() == 1), "{start} {span}: {tick}");
                }
            }
        }
    }
}

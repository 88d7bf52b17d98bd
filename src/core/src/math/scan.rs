//! Scans of long arrays.

use super::simd::Kernel;

/// Number of values per chunk. Independent results for the places in a chunk hide the latency of additions.
const CHUNK: usize = 32;

/// Clears `all` unless every value is finite.
pub(crate) struct AllFinite<'a> {
    pub values: &'a [f64],
    pub all: &'a mut bool,
}

impl Kernel for AllFinite<'_> {
    #[inline(always)]
    fn run(self) {
        // Zero times a finite number is zero; zero times infinity or NaN is NaN.
        let mut sums = [0.0; CHUNK];
        let (chunks, rest) = self.values.as_chunks::<CHUNK>();
        for chunk in chunks {
            for lane in 0..CHUNK {
                sums[lane] += 0.0 * chunk[lane];
            }
        }
        *self.all &= sums.iter().sum::<f64>() == 0.0 && rest.iter().all(|value| value.is_finite());
    }
}

/// Raises `largest` to the largest magnitude of all values. NaN is ignored.
pub(crate) struct LargestMagnitude<'a> {
    pub values: &'a [f64],
    pub largest: &'a mut f64,
}

impl Kernel for LargestMagnitude<'_> {
    #[inline(always)]
    fn run(self) {
        let larger = |largest: f64, value: f64| if value.abs() > largest { value.abs() } else { largest };
        let mut maxima = [0.0; CHUNK];
        let (chunks, rest) = self.values.as_chunks::<CHUNK>();
        for chunk in chunks {
            for lane in 0..CHUNK {
                maxima[lane] = larger(maxima[lane], chunk[lane]);
            }
        }
        *self.largest = maxima.iter().chain(rest).fold(*self.largest, |largest, value| larger(largest, *value));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::simd::InstructionSet;

    #[test]
    fn scans_find_one_unusual_value_at_every_place() {
        for length in [0, 1, 31, 32, 33, 100] {
            for place in 0..length {
                for (exception, expected) in [(f64::NAN, 2.0), (f64::INFINITY, f64::INFINITY), (-3.0, 3.0)] {
                    let mut values = vec![-2.0; length];
                    values[place] = exception;
                    let (mut all, mut largest) = (true, 0.0);
                    let instructions = InstructionSet::detect();
                    instructions.run(AllFinite { values: &values, all: &mut all });
                    instructions.run(LargestMagnitude { values: &values, largest: &mut largest });
                    let expected = if length == 1 && exception.is_nan() { 0.0 } else { expected };
                    assert_eq!((all, largest), (exception.is_finite(), expected), "{exception} at {place} of {length}");
                }
            }
        }
    }
}

//! Approximation of many displacement fields by few vectors.

use nalgebra::{DMatrix, SymmetricEigen};

/// Number of search directions beyond the largest rank.
const EXTRA: usize = 8;
/// Number of subspace iterations after the random start.
const REPEATS: usize = 1;
/// On average, one of `SPARSE` fields takes part in the search.
const SPARSE: u32 = 5;
/// Largest number of fields that all take part in the search.
const FEW: usize = 500;
/// Directions shorter than this fraction of the longest one consist of rounding errors.
const ROUNDING: f64 = 1e-6;

/// Approximation u_s ≈ Σ_k c_sk v_k of fields u_s by orthonormal vectors v_k.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Basis {
    /// Vectors v, in the order of descending contribution.
    pub(crate) vectors: Vec<Vec<f32>>,
    /// Coefficients c, `[field][vector]`.
    pub(crate) coefficients: Vec<Vec<f32>>,
    /// Largest deviation of a value of any field, as a fraction of the largest value of all fields.
    pub(crate) deviation: f64,
}

impl Basis {
    /// Finds a basis of at most `rank` vectors, with as few vectors as keep the deviation below `max_deviation`. The method is a
    /// randomised subspace iteration with a fixed seed (Halko, Martinsson, Tropp 2011), followed by the eigenvectors of the small
    /// matrix C Cᵀ of the coefficients C. All fields have the same length.
    pub(crate) fn new(fields: &[Vec<f32>], rank: usize, max_deviation: f64) -> Self {
        let length = fields.first().map_or(0, Vec::len);
        let count = (rank + EXTRA).min(fields.len()).min(length);
        let mut directions = vec![vec![0.0_f32; length]; count];
        // A linear congruential generator, of which the high bits are used.
        let mut number = 1_u32;
        let mut next = || {
            number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            number >> 16
        };
        let sparse: Vec<&Vec<f32>> =
            fields.iter().filter(|_| fields.len() <= FEW || next().is_multiple_of(SPARSE)).collect();
        for field in &sparse {
            for direction in &mut directions {
                add(direction, if next() & 0x8000 == 0 { 1.0 } else { -1.0 }, field);
            }
        }
        orthonormalise(&mut directions);
        for _ in 0..REPEATS {
            let mut next = vec![vec![0.0_f32; length]; directions.len()];
            for field in &sparse {
                for (next, direction) in next.iter_mut().zip(&directions) {
                    add(next, single(dot(direction, field)), field);
                }
            }
            orthonormalise(&mut next);
            directions = next;
        }
        let found: Vec<Vec<f64>> =
            fields.iter().map(|field| directions.iter().map(|own| dot(own, field)).collect()).collect();
        let (vectors, turn) = principal_vectors(&directions, &found, rank);
        let coefficients: Vec<Vec<f32>> =
            found.iter().map(|own| turn.iter().map(|t| single(sum(t, own))).collect()).collect();
        let deviations = deviations(fields, &vectors, &coefficients);
        let needed = deviations.iter().position(|deviation| *deviation <= max_deviation).unwrap_or(vectors.len());
        let mut basis = Self { vectors, coefficients, deviation: deviations[needed] };
        basis.vectors.truncate(needed);
        basis.coefficients.iter_mut().for_each(|own| own.truncate(needed));
        basis
    }

    /// Approximates other fields by the vectors of this basis.
    pub(crate) fn project(self, fields: impl Iterator<Item = Vec<f32>>) -> Self {
        let (mut coefficients, mut largest, mut deviation) = (Vec::new(), 0.0_f32, 0.0_f32);
        for mut field in fields {
            let own: Vec<f32> = self.vectors.iter().map(|vector| single(dot(vector, &field))).collect();
            largest = largest.max(largest_magnitude(&field));
            self.vectors.iter().zip(&own).for_each(|(vector, weight)| add(&mut field, -weight, vector));
            deviation = deviation.max(largest_magnitude(&field));
            coefficients.push(own);
        }
        let deviation = if largest > 0.0 { f64::from(deviation / largest) } else { 0.0 };
        Self { vectors: self.vectors, coefficients, deviation }
    }
}

/// Returns [`Basis::deviation`] for each number of vectors, from none to all.
fn deviations(fields: &[Vec<f32>], vectors: &[Vec<f32>], coefficients: &[Vec<f32>]) -> Vec<f64> {
    let mut largest = vec![0.0_f32; vectors.len() + 1];
    for (field, own) in fields.iter().zip(coefficients) {
        let mut rest = field.clone();
        largest[0] = largest[0].max(largest_magnitude(&rest));
        for (number, (vector, weight)) in vectors.iter().zip(own).enumerate() {
            add(&mut rest, -weight, vector);
            largest[number + 1] = largest[number + 1].max(largest_magnitude(&rest));
        }
    }
    let whole = largest[0];
    largest.iter().map(|own| if whole > 0.0 { f64::from(own / whole) } else { 0.0 }).collect()
}

/// Returns the largest magnitude.
fn largest_magnitude(values: &[f32]) -> f32 {
    values.iter().fold(0.0_f32, |most, value| most.max(value.abs()))
}

/// Returns at most `rank` vectors in the order of their contribution, and their components along `directions`.
fn principal_vectors(directions: &[Vec<f32>], found: &[Vec<f64>], rank: usize) -> (Vec<Vec<f32>>, Vec<Vec<f64>>) {
    let count = directions.len();
    let products = DMatrix::from_fn(count, count, |i, k| found.iter().map(|own| own[i] * own[k]).sum::<f64>());
    if count == 0 {
        return (Vec::new(), Vec::new());
    }
    let eigen = SymmetricEigen::new(products);
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let largest = eigen.eigenvalues[order[0]];
    order.retain(|index| largest > 0.0 && eigen.eigenvalues[*index] > ROUNDING * ROUNDING * largest);
    order.truncate(rank);
    let turn: Vec<Vec<f64>> =
        order.iter().map(|index| eigen.eigenvectors.column(*index).iter().copied().collect()).collect();
    let vector = |turn: &Vec<f64>| {
        let mut vector = vec![0.0; directions[0].len()];
        directions.iter().zip(turn).for_each(|(own, weight)| add(&mut vector, single(*weight), own));
        vector
    };
    (turn.iter().map(vector).collect(), turn)
}

/// Orthonormalises vectors by two passes of Gram-Schmidt, and removes those that depend linearly on others.
fn orthonormalise(vectors: &mut Vec<Vec<f32>>) {
    let length = |vector: &[f32]| dot(vector, vector).sqrt();
    let longest = vectors.iter().map(|vector| length(vector)).fold(0.0, f64::max);
    let mut kept: Vec<Vec<f32>> = Vec::new();
    for mut vector in vectors.drain(..) {
        for own in kept.iter().chain(&kept) {
            let share = single(dot(own, &vector));
            add(&mut vector, -share, own);
        }
        let rest = length(&vector);
        if rest > ROUNDING * longest {
            vector.iter_mut().for_each(|value| *value = single(f64::from(*value) / rest));
            kept.push(vector);
        }
    }
    *vectors = kept;
}

/// Adds `factor` times `values` to `sum`.
fn add(sum: &mut [f32], factor: f32, values: &[f32]) {
    sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
}

/// Returns the dot product, from sixteen sums that the compiler turns into vector instructions.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let (heads_a, rest_a) = a.as_chunks::<16>();
    let (heads_b, rest_b) = b.as_chunks::<16>();
    let mut sums = [0.0_f32; 16];
    for (a, b) in heads_a.iter().zip(heads_b) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    let rest = rest_a.iter().zip(rest_b).map(|(a, b)| f64::from(a * b));
    sums.iter().map(|sum| f64::from(*sum)).sum::<f64>() + rest.sum::<f64>()
}

/// Returns the dot product of two short vectors.
fn sum(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns 40 combinations of three independent shapes, of which the third is small.
    fn fields() -> Vec<Vec<f32>> {
        let shape = |k: u32, x: u32| ((k + 1) as f32 * x as f32 * 0.037).sin();
        let field = |s: u32| {
            let weights = [(s as f32 * 0.7).cos(), 0.5 * (s as f32 * 1.3).sin(), 1e-3 * (s as f32 * 2.9).sin()];
            (0..101).map(|x| (0..3).map(|k| weights[k as usize] * shape(k, x)).sum()).collect()
        };
        (0..40).map(field).collect()
    }

    #[test]
    fn finds_all_shapes_of_low_rank_fields() {
        let basis = Basis::new(&fields(), 12, 0.0);
        assert_eq!(basis.vectors.len(), 3);
        assert!(basis.deviation < 2e-6, "{}", basis.deviation);
        for (i, a) in basis.vectors.iter().enumerate() {
            for (k, b) in basis.vectors.iter().enumerate() {
                assert!((dot(a, b) - f64::from(u8::from(i == k))).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn reports_the_deviation_of_a_truncated_basis() {
        let basis = Basis::new(&fields(), 2, 0.0);
        assert!(basis.vectors.len() == 2 && (1e-5..1e-2).contains(&basis.deviation), "{}", basis.deviation);
        let enough = Basis::new(&fields(), 12, 0.01);
        assert!(enough.vectors.len() == 2 && enough.coefficients[0].len() == 2);
        assert!((enough.deviation / basis.deviation - 1.0).abs() < 1e-2, "{} {}", enough.deviation, basis.deviation);
        let kept = basis.clone().project(fields().into_iter());
        assert!((kept.deviation / basis.deviation - 1.0).abs() < 1e-2 && kept.coefficients.len() == 40);
        let one = Basis::new(&fields(), 1, 0.0);
        assert!(one.deviation > 0.05, "{}", one.deviation);
    }

    #[test]
    fn accepts_zero_fields_and_no_fields() {
        let basis = Basis::new(&vec![vec![0.0; 12]; 5], 4, 0.0);
        assert!(basis.vectors.is_empty() && basis.coefficients == vec![Vec::<f32>::new(); 5] && basis.deviation == 0.0);
        assert!(Basis::new(&[], 4, 0.0).vectors.is_empty());
    }
}

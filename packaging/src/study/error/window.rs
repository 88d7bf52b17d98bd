//! How long a scene can be followed: runs from starts that differ by almost nothing part when contact is chaotic.

use std::iter::zip;

use super::{case::Case, competitor::DEFAULT, run};

/// Relative change of the initial gap of the run that is compared.
pub const PERTURBATION: f64 = 1e-9;

/// Difference of two runs at every sample, relative to the largest displacements so far, over `samples` samples.
///
/// # Errors
/// A run fails.
pub fn parting(case: &dyn Case, division: u32, samples: usize) -> Result<Vec<f64>, String> {
    let trace = |perturbation: f64| {
        let mut run = case.start(case.standard(), DEFAULT, division, perturbation)?;
        run::trace(run.as_mut(), samples)
    };
    let (plain, perturbed) = (trace(0.0)?, trace(PERTURBATION)?);
    let mut largest = f64::MIN_POSITIVE;
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    Ok(zip(&plain.displacements, &perturbed.displacements)
        .map(|(a, b)| {
            largest = largest.max(norm(&mut a.iter().copied()));
            norm(&mut zip(a, b).map(|(a, b)| a - b)) / largest
        })
        .collect())
}

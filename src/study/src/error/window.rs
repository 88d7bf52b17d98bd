//! Finds the window over which a scene can be compared: in chaotic contact, runs from nearly identical starts diverge.

use std::{iter::zip, ops::Range};

use tiprub_figure::table::Table;

use super::{
    case::ErrorCase,
    competitor::{Competitor, DEFAULT},
    measure::{STILL, parts_apart, worst},
    run::{self, Trace},
};
use crate::Statement;

/// Relative change of the initial gap in the perturbed run.
pub const PERTURBATION: f64 = 1e-9;

/// Runs that differ by more than this have diverged: the errors of a scheme are then amplified as much.
pub const PARTED: f64 = 1e-6;
/// Internal steps per sample of the runs for statistics, and of the run with which they are compared.
const DIVISION: u32 = 20;
const FINE: u32 = 160;

/// Returns the difference of two runs at each of `samples` samples, relative to the largest displacements, of the structure with the largest
/// difference.
///
/// # Errors
/// A run fails.
pub fn parting(case: &dyn ErrorCase, division: u32, samples: usize) -> Result<Vec<f64>, String> {
    let trace = |perturbation: f64| {
        let mut run = case.start(case.standard(), DEFAULT, division, perturbation)?;
        run::trace(run.as_mut(), samples)
    };
    let (plain, perturbed) = (trace(0.0)?, trace(PERTURBATION)?);
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    let mut from = 0;
    let parts = plain.parts.iter().map(|length| {
        from += length;
        let own = from - length..from;
        let sizes = plain.displacements.iter().map(|all| norm(&mut all[own.clone()].iter().copied()));
        (own.clone(), sizes.fold(f64::MIN_POSITIVE, f64::max))
    });
    let parts: Vec<_> = parts.collect();
    let least = STILL * parts.iter().fold(0.0, |most: f64, (_, size)| most.max(*size));
    let at = |(a, b): (&Vec<f64>, &Vec<f64>)| {
        let of = |(own, size): &(Range<usize>, f64)| {
            norm(&mut zip(&a[own.clone()], &b[own.clone()]).map(|(a, b)| a - b)) / size.max(least)
        };
        worst(parts.iter().map(of))
    };
    Ok(zip(&plain.displacements, &perturbed.displacements).map(at).collect())
}

/// Returns the number of samples before the runs of [`parting`] have diverged, at most `most`.
pub fn samples(parting: &[f64], most: usize) -> usize {
    parting.iter().position(|apart| *apart > PARTED).unwrap_or(most).min(most)
}

/// Returns the statement about whether the window of a scene ends before its runs diverge.
pub fn statement(case: &dyn ErrorCase) -> Option<Statement> {
    let parting = case.parting();
    let end = *parting.get(case.samples().checked_sub(1)?)?;
    let last = parting.last()?;
    let long = case.interval() * parting.len() as f64;
    Some(Statement::tested(
        format!(
            "{}: the window of {:.2} ms ends before trajectories diverge",
            case.title(),
            1e3 * case.interval() * case.samples() as f64
        ),
        end <= PARTED,
        format!(
            "a relative change of {PERTURBATION:.0e} in {} changes the displacements by a relative {end:.1e} at the end of the window and \
             by {last:.1e} after {:.1} ms",
            case.perturbed(),
            1e3 * long
        ),
    ))
}

/// Tabulates the effective displacement and mean force after the window for every competitor at one step, against tiprub with a fine step; `None`
/// for scenes that end with their window.
pub fn statistics(case: &dyn ErrorCase) -> Option<Table> {
    let samples = case.parting().len();
    if samples <= case.samples() {
        return None;
    }
    let traced = |competitor: Competitor, division: u32| {
        let mut run = case.start(case.standard(), competitor, division, 0.0)?;
        run::trace(run.as_mut(), samples)
    };
    let fine = traced(DEFAULT, FINE).ok()?;
    let of = |trace: &Trace| {
        let late = &trace.displacements[case.samples()..];
        let squares: f64 = late.iter().flatten().map(|u| u * u).sum();
        let count = late.iter().map(Vec::len).sum::<usize>();
        let impulse: f64 = trace.impulses[case.samples()..].iter().sum();
        [(squares / count as f64).sqrt(), impulse / (case.interval() * late.len() as f64)]
    };
    let [amplitude, force] = of(&fine);
    let step = 1e6 * case.interval() / f64::from(DIVISION);
    let caption = format!(
        "{}: from {:.2} to {:.2} ms at h = {step:.2} µs against {} at h = {:.3} µs (effective displacement {:.3e} m, \
         mean of all normal forces {force:.4e} N)",
        case.title(),
        1e3 * case.interval() * case.samples() as f64,
        1e3 * case.interval() * samples as f64,
        DEFAULT.name(),
        1e6 * case.interval() / f64::from(FINE),
        amplitude
    );
    let mut table =
        Table::new(caption, ["competitor", "effective displacement", "mean force", "trajectory (relative L2)"]);
    for competitor in case.competitors(case.standard()) {
        let mut cells = vec![competitor.name()];
        cells.extend(match traced(competitor, DIVISION) {
            Ok(found) => {
                let [own_amplitude, own_force] = of(&found);
                let late = |trace: &Trace| trace.displacements[case.samples()..].to_vec();
                [
                    format!("{:+.2} %", 100.0 * (own_amplitude / amplitude - 1.0)),
                    format!("{:+.2} %", 100.0 * (own_force / force - 1.0)),
                    format!("{:.1e}", parts_apart(&late(&found), &late(&fine), &fine.parts)),
                ]
            }
            Err(problem) => [shortened(&problem), String::new(), String::new()],
        });
        table.rows.push(cells);
    }
    Some(table)
}

/// Shortens a reason that the table of all runs states in full beside the run with this step.
fn shortened(problem: &str) -> String {
    const MOST: usize = 80;
    match problem.char_indices().nth(MOST) {
        None => problem.to_owned(),
        Some((end, _)) => format!("{} …", problem[..end].rsplit_once(' ').map_or(&problem[..end], |(start, _)| start)),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn long_reasons_are_truncated_at_word_boundaries() {
        let long = "refused: µ ".repeat(20);
        let short = super::shortened(&long);
        assert!(short.chars().count() <= 82 && short.ends_with(" µ …"), "{short}");
        assert_eq!(super::shortened("refused"), "refused");
    }

    #[test]
    fn window_ends_where_runs_diverge() {
        assert_eq!(super::samples(&[1e-9, 1e-8, 1e-7, 1e-5, 1e-8], 10), 3);
        assert_eq!(super::samples(&[1e-9; 5], 4), 4);
    }
}

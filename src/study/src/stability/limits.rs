//! Largest internal step of every scheme and solver at the scene's own friction and speed, such that all shorter steps that were tried are accepted.

use tiprub_core::modes::{cyclic::CyclicModel, modal::ModalModel};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_shell::Result;

use super::{
    StoredWork,
    scene::{Method, OperatingPoint, SceneStart, ScreeningResult, StabilityScene},
    seek::{Sought, TRIED, seek},
};

/// Approximate number of answers that are needed: for every scheme doublings over the whole range and halvings, and two for each further solver.
pub const ANSWERS: usize = 72;

/// Largest steps of a scheme with a solver.
#[derive(Debug, Clone, PartialEq)]
pub struct Usable {
    /// Scheme and solver.
    pub method: Method,
    /// Largest step (s) with the reason why a longer one is rejected, or the reason why none is accepted.
    pub sought: Sought<String>,
}

impl Usable {
    /// Returns the largest step (s) that was accepted.
    pub fn step(&self) -> Option<f64> {
        match self.sought {
            Sought::All(step) | Sought::Below(step, _) => Some(step),
            Sought::None(_) => None,
        }
    }

    /// Formats the result for the terminal.
    pub fn to_text(&self) -> String {
        match &self.sought {
            Sought::All(step) => format!("none rejected up to {step:.1e} s"),
            Sought::Below(step, _) => format!("{step:.3e} s"),
            Sought::None(why) => format!("rejected: {why}"),
        }
    }

    /// Returns the reason why a longer step is rejected.
    pub fn why(&self) -> &str {
        match &self.sought {
            Sought::All(_) => "",
            Sought::Below(_, why) | Sought::None(why) => why,
        }
    }
}

/// Returns the highest angular frequency of all structures (rad/s).
fn highest(asked: &StabilityScene) -> f64 {
    let of = |rom: &tiprub_core::Rom| {
        if rom.is_cyclic() {
            CyclicModel::from_rom(rom, 0.0).map(|model| model.largest_frequency())
        } else {
            ModalModel::from_rom(rom, 0.0).map(|model| model.largest_frequency())
        }
    };
    asked.scene.roms.iter().filter_map(|rom| of(rom).ok()).fold(0.0, f64::max)
}

/// Determines all limits, the schemes in parallel. Further solvers are tried at the limit of the scheme's first solver, and are searched anew only
/// if the answers differ.
///
/// # Errors
/// A thread fails.
pub(super) fn find_all(
    asked: &StabilityScene,
    own: &SceneStart,
    quick: bool,
    work: &mut StoredWork,
) -> Result<Vec<Usable>> {
    let place = [OperatingPoint { friction: own.friction, speed: own.speed }];
    let highest = highest(asked);
    let range = TRIED.map(|product| product / highest);
    // A quick study searches from the scene's own step or the resolved one, whichever is longer.
    let range = if quick { [range[0].max(own.step).min(range[1]), range[1]] } else { range };
    let of_scheme = |scheme: &Scheme| {
        let ask =
            |solver: Solver, step: f64| -> ScreeningResult { asked.at((*scheme, solver), step, &place).remove(0) };
        let known = Some(scheme.properties().stable_below / highest).filter(|step| step.is_finite());
        let sought = |solver: Solver, range: [f64; 2]| seek(range, known, |step| ask(solver, step).map(drop));
        let mut found: Vec<Sought<String>> = Vec::new();
        for solver in Solver::ALL {
            let like = found.iter().find(|other| has_same_limit(other, &|step| ask(solver, step)));
            let sought = match like {
                Some(other) => other.clone(),
                None => match sought(solver, range) {
                    // The scene's own step is already rejected: the limit lies below.
                    Sought::None(_) if quick => sought(solver, TRIED.map(|product| product / highest)),
                    found => found,
                },
            };
            found.push(sought);
        }
        Ok(found)
    };
    let share = ANSWERS as f64 / Scheme::RECURRENCES.len() as f64;
    let found = work.run((super::LIMITS, "limits", share), &Scheme::RECURRENCES, of_scheme)?;
    let methods = Scheme::RECURRENCES.iter().flat_map(|scheme| Solver::ALL.map(|solver| (*scheme, solver)));
    Ok(methods.zip(found.concat()).map(|(method, sought)| Usable { method, sought }).collect())
}

/// Returns whether a solver accepts a step just below the limit of another solver, and rejects a step just above it for the same reason.
fn has_same_limit(other: &Sought<String>, ask: &dyn Fn(f64) -> ScreeningResult) -> bool {
    let Sought::Below(step, why) = other else { return false };
    // Twice the width of the last interval.
    ask(step * (1.0 - 1e-6)).is_ok() && ask(step * 1.02).is_err_and(|refusal| same_reason(&refusal, why))
}

/// Returns whether two rejections differ only in their numbers.
pub fn same_reason(a: &str, b: &str) -> bool {
    let words = |text: &str| {
        text.split_whitespace()
            .filter(|word| !word.contains(|c: char| c.is_ascii_digit()))
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    words(a) == words(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_compared_by_their_words() {
        assert!(same_reason("ω_max·h = 2.1 ≥ 2 at 1e-6 s", "ω_max·h = 3.7 ≥ 2 at 2e-6 s"));
        assert!(!same_reason("ω_max·h = 2.1 ≥ 2", "`coulomb` is not prepared"));
    }
}

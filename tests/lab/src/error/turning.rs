//! Rotors in casings at several numbers of modes, with the methods of the reference crate for comparison.

use tiprub_core::Scene;
use tiprub_reference::reduced;
use tiprub_shell::{Failure, Result};

use super::{
    case::{ErrorCase, without_finest},
    competitor::{Competitor, EquationFamily, TOLERANCES, TOLERANT},
    outside::{OutsideRun, Softness},
    run::TimedRun,
    scene::SceneRun,
    window,
};

/// Description and steps of a rotor.
pub(crate) struct TurningFacts {
    pub name: &'static str,
    /// Names of its two figures.
    pub figures: [&'static str; 2],
    pub title: &'static str,
    pub description: String,
    /// Meaning of a size.
    pub size_name: &'static str,
    /// Time between samples (s).
    pub interval: f64,
    /// Maximum number of samples of the window, and per window of impulses.
    pub samples: [usize; 2],
    /// Number of windows over which the divergence of runs is checked, and internal steps per sample.
    pub long: (usize, u32),
    /// Internal steps per sample.
    pub divisions: Vec<u32>,
    /// Internal steps per sample of the independent methods, if their steps take much longer.
    pub outside_divisions: Option<Vec<u32>>,
    /// Internal steps per sample of the references: of the product and of Moreau-Jean.
    pub references: (u32, u32),
    /// Equations whose limits are computed at the standard size, and at the others.
    pub families: [Vec<EquationFamily>; 2],
    pub softness: Softness,
}

/// A rotor with several numbers of modes: for the product, and for the reference crate.
pub(crate) struct TurningCase<S> {
    facts: TurningFacts,
    sizes: Vec<(usize, Scene, S)>,
    samples: usize,
    parting: Vec<f64>,
}

impl<S: reduced::ReducedScene> TurningCase<S> {
    /// Determines the time over which trajectories can be compared.
    ///
    /// # Errors
    /// A run that fails; never with the built-in models.
    pub(crate) fn new(facts: TurningFacts, sizes: Vec<(usize, Scene, S)>) -> Result<Self> {
        let [samples, _] = facts.samples;
        let mut turning = Self { facts, sizes, samples, parting: Vec::new() };
        let (windows, division) = turning.facts.long;
        turning.parting = window::parting(&turning, division, windows * samples)
            .map_err(|problem| Failure::new(turning.facts.name, problem, "Report this to the developers"))?;
        turning.samples = window::samples(&turning.parting, samples);
        Ok(turning)
    }
}

impl<S: reduced::ReducedScene> ErrorCase for TurningCase<S> {
    fn name(&self) -> &'static str {
        self.facts.name
    }

    fn figures(&self) -> [&'static str; 2] {
        self.facts.figures
    }

    fn title(&self) -> &str {
        self.facts.title
    }

    fn description(&self) -> String {
        self.facts.description.clone()
    }

    fn size_name(&self) -> &'static str {
        self.facts.size_name
    }

    fn sizes(&self) -> Vec<usize> {
        self.sizes.iter().map(|size| size.0).collect()
    }

    fn interval(&self) -> f64 {
        self.facts.interval
    }

    fn samples(&self) -> usize {
        self.samples
    }

    fn impulse_window(&self) -> usize {
        self.facts.samples[1]
    }

    /// Steps are compared at the standard size; the others omit the finest.
    fn divisions(&self, size: usize) -> Vec<u32> {
        without_finest(&self.facts.divisions, size == self.standard())
    }

    fn competitors(&self, size: usize) -> Vec<Competitor> {
        let reduced = Competitor::reduced().into_iter().chain([TOLERANT]);
        reduced.filter(|competitor| competitor.is_core() || size == self.standard()).collect()
    }

    fn divisions_of(&self, size: usize, competitor: Competitor) -> Vec<u32> {
        if competitor.is_by_tolerance() {
            return TOLERANCES.to_vec();
        }
        let outside = self.facts.outside_divisions.as_ref().filter(|_| !competitor.is_core());
        outside.map_or_else(|| self.divisions(size), Vec::clone)
    }

    fn reference_divisions(&self, size: usize) -> (u32, u32) {
        let (own, outside) = self.facts.references;
        // The independent reference must be equally fine only at the size where steps are compared.
        (own, if size == self.standard() { outside } else { outside / 4 })
    }

    fn families(&self, size: usize) -> Vec<EquationFamily> {
        self.facts.families[usize::from(size != self.standard())].clone()
    }

    fn parting(&self) -> &[f64] {
        &self.parting
    }

    fn start<'a>(
        &'a self,
        size: usize,
        competitor: Competitor,
        division: u32,
        perturbation: f64,
    ) -> Result<Box<dyn TimedRun + 'a>, String> {
        let (_, scene, outside) = &self.sizes[size];
        let TurningFacts { interval, softness, .. } = self.facts;
        Ok(match competitor {
            Competitor::Core(scheme, solver) => {
                let scene = SceneRun::by(scene, (scheme, solver), interval, division, perturbation);
                Box::new(SceneRun::with_start_values(&scene, interval, division, &[])?)
            }
            Competitor::Moreau | Competitor::Augmented | Competitor::Penalty(_) | Competitor::Full(_) => {
                Box::new(OutsideRun::new(outside, competitor, interval, division, softness)?)
            }
        })
    }
}

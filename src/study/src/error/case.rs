//! What every scene of the study offers: its sizes, its steps, and a run of any competitor.

use super::{
    competitor::{Competitor, DEFAULT, EquationFamily, TOLERANT},
    run::{TimedRun, Trace},
};

/// A scene in several sizes: numbers of elements, or of component modes.
pub trait ErrorCase {
    /// For file names and `--scene`.
    fn name(&self) -> &'static str;

    /// Names of its two figures: error of the steps, total error.
    fn figures(&self) -> [&'static str; 2];

    /// For headings.
    fn title(&self) -> &str;

    /// Returns a description of the scene in a sentence or two, with the limits of its figures.
    fn description(&self) -> String;

    /// Returns the meaning of a size: `elements per bar`.
    fn size_name(&self) -> &'static str;

    /// The sizes, ascending.
    fn sizes(&self) -> Vec<usize>;

    /// Index of the size at which all competitors are compared for their steps.
    fn standard(&self) -> usize {
        self.sizes().len().saturating_sub(2)
    }

    /// Time between samples (s), common to all runs.
    fn interval(&self) -> f64;

    /// Samples until the window ends.
    fn samples(&self) -> usize;

    /// Samples per window of impulses.
    fn impulse_window(&self) -> usize;

    /// Internal steps per sample to be tried, ascending; the first are beyond the limit of central differences.
    fn divisions(&self, size: usize) -> Vec<u32>;

    /// The same for one competitor.
    fn divisions_of(&self, size: usize, _: Competitor) -> Vec<u32> {
        self.divisions(size)
    }

    /// Internal steps per sample of the references: the product's, and the outside one's where the scene has one.
    fn reference_divisions(&self, size: usize) -> (u32, u32);

    /// The first reference.
    fn first(&self) -> Competitor {
        DEFAULT
    }

    /// The method with adaptive steps, which solves the equations of its family.
    fn tolerant(&self) -> Competitor {
        TOLERANT
    }

    /// The second reference, and the competitors at a size.
    fn second(&self) -> Competitor {
        Competitor::Moreau
    }

    /// Returns the relation of the second reference to the first.
    fn relation(&self) -> &'static str {
        "an independent implementation"
    }

    /// The second reference where it is the same at all sizes.
    fn second_trace(&self) -> Option<Trace> {
        None
    }

    /// Returns the distance of two references that share no code with the product, and their names, if there are two.
    fn meeting(&self) -> Option<(f64, String)> {
        None
    }

    /// Who takes part at a size: outside methods at the standard size only, since they take long and truncation is the same
    /// for all.
    fn competitors(&self, size: usize) -> Vec<Competitor> {
        let all = Competitor::reduced().into_iter();
        all.filter(|competitor| competitor.is_core() || size == self.standard()).collect()
    }

    /// Start a run at a size, with a relative perturbation of the initial gap.
    ///
    /// # Errors
    /// The competitor refuses.
    fn start<'a>(
        &'a self,
        size: usize,
        competitor: Competitor,
        division: u32,
        perturbation: f64,
    ) -> Result<Box<dyn TimedRun + 'a>, String>;

    /// The exact solution, or that of the full model, where there is one.
    fn exact(&self) -> Option<Trace> {
        None
    }

    /// Known error of the displacements by modes, patches, rows and mesh of the model, added up (relative); `None` where it is unknown or where
    /// other sizes show it.
    fn model_error(&self) -> Option<f64> {
        None
    }

    /// Releases that are looked for: a time before which contact has ended (s), and a time after which it began.
    fn releases(&self) -> Vec<[f64; 2]> {
        Vec::new()
    }

    /// Returns the scale of errors of the energy (J); the largest energy there is, if the scene does not give one.
    fn energy_scale(&self) -> Option<f64> {
        None
    }

    /// Returns the divergence of two runs from almost the same start ([`super::window::parting`]), beyond the window; empty if the exact solution is
    /// known.
    fn parting(&self) -> &[f64] {
        &[]
    }

    /// Returns the name of the quantity that is perturbed for that.
    fn perturbed(&self) -> &'static str {
        "a gap"
    }

    /// Whether a coating gives way.
    fn is_coated(&self) -> bool {
        false
    }

    /// Whether contact nodes act on each other, so that solvers differ.
    fn several_nodes(&self) -> bool {
        true
    }

    /// Equations other than those of the first reference whose limits are computed at a size.
    fn families(&self, size: usize) -> Vec<EquationFamily>;
}

/// Returns the divisions of another size: those at the standard size without the finest.
pub fn without_finest(divisions: &[u32], standard: bool) -> Vec<u32> {
    divisions[..divisions.len() - usize::from(!standard)].to_vec()
}

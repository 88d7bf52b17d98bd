//! Interface of the scenes of the error study: sizes, steps, and runs of any competitor.

use super::{
    competitor::{Competitor, DEFAULT, EquationFamily, TOLERANT},
    run::{TimedRun, Trace},
};

/// A scene in several sizes: numbers of elements, or of component modes.
pub trait ErrorCase {
    /// Returns the name for files and for `--scene`.
    fn name(&self) -> &'static str;

    /// Returns the names of the two figures: error of the steps, total error.
    fn figures(&self) -> [&'static str; 2];

    /// Returns the title for headings.
    fn title(&self) -> &str;

    /// Returns a description of the scene in a sentence or two, with the limits of its figures.
    fn description(&self) -> String;

    /// Returns the meaning of a size, such as `elements per bar`.
    fn size_name(&self) -> &'static str;

    /// Returns the sizes, ascending.
    fn sizes(&self) -> Vec<usize>;

    /// Returns the index of the size at which the steps of all competitors are compared.
    fn standard(&self) -> usize {
        self.sizes().len().saturating_sub(2)
    }

    /// Returns the time between samples (s), the same for all runs.
    fn interval(&self) -> f64;

    /// Returns the number of samples until the window ends.
    fn samples(&self) -> usize;

    /// Returns the number of samples per window of impulses.
    fn impulse_window(&self) -> usize;

    /// Returns the internal steps per sample to try, ascending; the first ones are beyond the limit of central differences.
    fn divisions(&self, size: usize) -> Vec<u32>;

    /// Returns the internal steps per sample to try with one competitor.
    fn divisions_of(&self, size: usize, _: Competitor) -> Vec<u32> {
        self.divisions(size)
    }

    /// Returns the internal steps per sample of the two references: the one of tiprub, and the independent one if the scene has one.
    fn reference_divisions(&self, size: usize) -> (u32, u32);

    /// Returns the first reference.
    fn first(&self) -> Competitor {
        DEFAULT
    }

    /// Returns the method with adaptive steps that solves the same equations as the first reference.
    fn tolerant(&self) -> Competitor {
        TOLERANT
    }

    /// Returns the second reference.
    fn second(&self) -> Competitor {
        Competitor::Moreau
    }

    /// Returns the relation of the second reference to the first.
    fn relation(&self) -> &'static str {
        "an independent implementation"
    }

    /// Returns the second reference if it is the same at all sizes.
    fn second_trace(&self) -> Option<Trace> {
        None
    }

    /// Returns the distance of two references that share no code with the product, and their names, if there are two.
    fn meeting(&self) -> Option<(f64, String)> {
        None
    }

    /// Returns the competitors at a size. Independent methods take part at the standard size only, since they take long and the truncation error is
    /// the same for all.
    fn competitors(&self, size: usize) -> Vec<Competitor> {
        let all = Competitor::reduced().into_iter();
        all.filter(|competitor| competitor.is_core() || size == self.standard()).collect()
    }

    /// Starts a run at a size, with a relative perturbation of the initial gap.
    ///
    /// # Errors
    /// The competitor rejects the scene or the step.
    fn start<'a>(
        &'a self,
        size: usize,
        competitor: Competitor,
        division: u32,
        perturbation: f64,
    ) -> Result<Box<dyn TimedRun + 'a>, String>;

    /// Returns the exact solution, or that of the full model, if there is one.
    fn exact(&self) -> Option<Trace> {
        None
    }

    /// Returns the known error of the displacements by modes, patches, rows and mesh of the model, added up (relative); `None` if it is unknown or
    /// if other sizes show it.
    fn model_error(&self) -> Option<f64> {
        None
    }

    /// Returns the releases to evaluate, each as a time after which contact begins and a time before which it has ended (s).
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

    /// Returns whether a coating can yield.
    fn is_coated(&self) -> bool {
        false
    }

    /// Returns whether contact nodes act on each other, so that solvers differ.
    fn several_nodes(&self) -> bool {
        true
    }

    /// Returns the equations other than those of the first reference whose limits are computed at a size.
    fn families(&self, size: usize) -> Vec<EquationFamily>;
}

/// Returns the divisions of another size: those at the standard size without the finest.
pub fn without_finest(divisions: &[u32], standard: bool) -> Vec<u32> {
    divisions[..divisions.len() - usize::from(!standard)].to_vec()
}

//! Scenes 1 and 2: Carpenter's bars and the bouncing bar, with exact solutions; and bars with forced vibration only, to
//! determine orders.

use tiprub_reference::{
    carpenter,
    closed::bouncing_bar,
    reduced::bars::{self, RodModel, RodScene},
};

use super::{
    case::ErrorCase,
    competitor::{Competitor, EquationFamily, TOLERANCES, TOLERANT},
    marched::RodMarch,
    outside::{OutsideRun, Softness},
    rods::CoreRod,
    run::{TimedRun, Trace},
};

/// Fraction of its mass that a nominally massless contact node keeps: one mode then represents its flexibility alone.
const END_MASS: f64 = 1e-4;
/// Steps relative to the time a wave takes through an element, which is the limit of central differences.
const COURANT: [f64; 9] = [4.0, 1.6, 1.02, 0.9, 0.5, 0.25, 0.125, 0.0625, 0.03125];
/// Relative step of the references.
const REFERENCE_COURANT: f64 = 1.0 / 256.0;

/// A rod at one number of elements, for all methods.
struct BarSize {
    elements: usize,
    outside: RodScene,
    core: CoreRod,
    massless: CoreRod,
    /// Contact stiffness of soft methods (N/m), and the penetration they may cause (m).
    softness: Softness,
}

/// Problem of a bar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BarProblem {
    Carpenter,
    Bouncing,
    /// Never in contact, or always in contact.
    Shaken {
        touching: bool,
    },
}

/// A problem of rods at several numbers of elements.
pub(crate) struct Bars {
    problem: BarProblem,
    sizes: Vec<BarSize>,
    standard: usize,
    interval: f64,
    samples: usize,
    /// Length of an element if there is one element, divided by the wave speed (s).
    passage: f64,
    courant: Vec<f64>,
}

impl Bars {
    /// Creates scene 1.
    ///
    /// # Errors
    /// None.
    pub(crate) fn carpenter(quick: bool) -> Result<Self, String> {
        let elements = if quick { vec![10, 20, 40] } else { vec![20, 40, 80, 160] };
        let passage = carpenter::LENGTH / carpenter::wave_speed();
        Self::new(BarProblem::Carpenter, &elements, 10e-6, 22, passage, quick)
    }

    /// Creates scene 2, over its period with two contacts.
    ///
    /// # Errors
    /// None.
    pub(crate) fn bouncing(quick: bool) -> Result<Self, String> {
        let elements = if quick { vec![10, 20, 40] } else { vec![20, 40, 80, 160] };
        let passage = bouncing_bar::LENGTH / bouncing_bar::wave_speed();
        Self::new(BarProblem::Bouncing, &elements, bouncing_bar::PERIOD / 64.0, 64, passage, quick)
    }

    /// Creates a bar of twenty elements with forced vibration and no change of contact.
    ///
    /// # Errors
    /// None.
    pub(crate) fn shaken(touching: bool) -> Result<Self, String> {
        let passage = bouncing_bar::LENGTH / bouncing_bar::wave_speed();
        let mut bars =
            Self::new(BarProblem::Shaken { touching }, &[20], bouncing_bar::PERIOD / 64.0, 16, passage, false)?;
        bars.courant = vec![0.5, 0.25, 0.125, 0.0625, 0.03125];
        Ok(bars)
    }

    fn new(
        problem: BarProblem,
        elements: &[usize],
        interval: f64,
        samples: usize,
        passage: f64,
        quick: bool,
    ) -> Result<Self, String> {
        let sizes = elements.iter().map(|count| BarSize::new(problem, *count)).collect::<Result<Vec<_>, String>>()?;
        let courant = if quick { COURANT[..7].to_vec() } else { COURANT.to_vec() };
        Ok(Self { problem, standard: 1.min(sizes.len() - 1), sizes, interval, samples, passage, courant })
    }

    fn division(&self, size: usize, courant: f64) -> u32 {
        let step = courant * self.passage / self.sizes[size].elements as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a moderate positive number")]
        let division = (self.interval / step * (1.0 - 1e-12)).ceil() as u32;
        division.max(1)
    }

    fn exact_at(&self, time: f64) -> f64 {
        match self.problem {
            BarProblem::Carpenter => bars::carpenter_exact(time),
            _ => -bouncing_bar::displacement(0.0, time) + bouncing_bar::HEIGHT,
        }
    }

    fn exact_force(&self, time: f64) -> f64 {
        let exact = carpenter::exact();
        match self.problem {
            BarProblem::Carpenter if time > exact.touch && time < exact.release => exact.force,
            BarProblem::Carpenter => 0.0,
            _ => bouncing_bar::pressure(time),
        }
    }
}

impl BarSize {
    fn new(problem: BarProblem, elements: usize) -> Result<Self, String> {
        let rod = |end_mass: f64| -> RodModel {
            match problem {
                BarProblem::Carpenter => bars::carpenter(elements, end_mass),
                BarProblem::Bouncing => bars::bouncing(elements, end_mass),
                BarProblem::Shaken { touching } => bars::shaken(elements, end_mass, touching),
            }
        };
        let whole = matches!(problem, BarProblem::Shaken { .. });
        let ends = if problem == BarProblem::Carpenter { 2 } else { 1 };
        // As stiff as two elements; commercial codes permit a penetration of a hundredth of an element.
        let (stiffness, length) = match problem {
            BarProblem::Carpenter => (carpenter::YOUNG * carpenter::AREA / carpenter::LENGTH, carpenter::LENGTH),
            _ => (bouncing_bar::YOUNG / bouncing_bar::LENGTH, bouncing_bar::LENGTH),
        };
        let (stiffness, tolerance) = (2.0 * stiffness * elements as f64, 0.01 * length / elements as f64);
        Ok(Self {
            elements,
            outside: RodScene::new(&rod(1.0), whole).ok_or("the rod has no mass")?,
            core: CoreRod::new(&rod(1.0), ends, whole)?,
            massless: CoreRod::new(&rod(END_MASS), ends, whole)?,
            softness: Softness { stiffness, tolerance, margin: f64::INFINITY },
        })
    }
}

impl ErrorCase for Bars {
    fn name(&self) -> &'static str {
        match self.problem {
            BarProblem::Carpenter => "carpenter",
            BarProblem::Bouncing => "bouncing-bar",
            BarProblem::Shaken { touching: false } => "free-vibration",
            BarProblem::Shaken { touching: true } => "sustained-contact",
        }
    }

    fn figures(&self) -> [&'static str; 2] {
        match self.problem {
            BarProblem::Carpenter => ["carpenter-steps", "carpenter-total"],
            BarProblem::Bouncing => ["bouncing-bar-steps", "bouncing-bar-total"],
            BarProblem::Shaken { touching: false } => ["free-steps", "free-total"],
            BarProblem::Shaken { touching: true } => ["sustained-steps", "sustained-total"],
        }
    }

    fn title(&self) -> &'static str {
        match self.problem {
            BarProblem::Carpenter => "Carpenter's bars",
            BarProblem::Bouncing => "Bouncing bar",
            BarProblem::Shaken { touching: false } => "Free vibration",
            BarProblem::Shaken { touching: true } => "Sustained contact",
        }
    }

    fn description(&self) -> String {
        match self.problem {
            BarProblem::Carpenter => "Two elastic bars meet head-on (N. J. Carpenter, R. L. Taylor, M. G. Katona, \
                                      1991); linear elements, lumped mass. Compared with the exact solution: relative \
                                      displacement of the ends, force and release."
                .into(),
            BarProblem::Bouncing => {
                "A bar bounces on rigid ground under gravity (D. Doyen, A. Ern, S. Piperno, 2011), one period with two \
                                  contacts; linear elements, lumped mass. Compared with the exact series solution."
                    .into()
            }
            BarProblem::Shaken { .. } => "A bar clamped at its top and excited without a change of contact.".into(),
        }
    }

    fn size_name(&self) -> &'static str {
        "elements"
    }

    fn sizes(&self) -> Vec<usize> {
        self.sizes.iter().map(|size| size.elements).collect()
    }

    fn standard(&self) -> usize {
        self.standard
    }

    fn interval(&self) -> f64 {
        self.interval
    }

    fn samples(&self) -> usize {
        self.samples
    }

    fn impulse_window(&self) -> usize {
        1
    }

    fn divisions(&self, size: usize) -> Vec<u32> {
        let mut divisions: Vec<u32> = self.courant.iter().map(|courant| self.division(size, *courant)).collect();
        divisions.dedup();
        divisions
    }

    fn reference_divisions(&self, size: usize) -> (u32, u32) {
        let division = self.division(size, REFERENCE_COURANT);
        (division, division)
    }

    fn competitors(&self, _: usize) -> Vec<Competitor> {
        Competitor::reduced().into_iter().chain([TOLERANT]).collect()
    }

    fn divisions_of(&self, size: usize, competitor: Competitor) -> Vec<u32> {
        if competitor == TOLERANT { TOLERANCES.to_vec() } else { self.divisions(size) }
    }

    fn start<'a>(
        &'a self,
        size: usize,
        competitor: Competitor,
        division: u32,
        perturbation: f64,
    ) -> Result<Box<dyn TimedRun + 'a>, String> {
        let (size, interval) = (&self.sizes[size], self.interval);
        Ok(match competitor {
            TOLERANT => {
                let tolerance = 1.0 / f64::from(division);
                Box::new(RodMarch::new(&size.massless, interval, tolerance, perturbation))
            }
            Competitor::Core(scheme, solver) => {
                let massless = competitor.family().massless;
                let rod = if massless { &size.massless } else { &size.core };
                Box::new(rod.run((scheme, solver), interval, division, perturbation)?)
            }
            _ => Box::new(OutsideRun::new(&size.outside, competitor, interval, division, size.softness)?),
        })
    }

    fn exact(&self) -> Option<Trace> {
        /// Number of points per sample at which the force is evaluated.
        const POINTS: u32 = 2000;
        if matches!(self.problem, BarProblem::Shaken { .. }) {
            return None;
        }
        let time = |sample: usize| (sample + 1) as f64 * self.interval;
        let impulse = |sample: usize| -> f64 {
            let small = self.interval / f64::from(POINTS);
            let start = sample as f64 * self.interval;
            (0..POINTS).map(|i| self.exact_force(start + (f64::from(i) + 0.5) * small) * small).sum()
        };
        let last = |sample: usize| {
            let ends = match self.problem {
                BarProblem::Carpenter => vec![carpenter::exact().release],
                _ => bouncing_bar::CONTACTS.iter().map(|contact| contact[1]).collect(),
            };
            ends.into_iter().filter(|end| *end <= time(sample)).fold(f64::NAN, |_, end| end)
        };
        let energy = match self.problem {
            BarProblem::Carpenter => carpenter::exact().energy,
            // The potential is relative to the initial position of the bar.
            _ => 0.0,
        };
        Some(Trace {
            displacements: (0..self.samples).map(|sample| vec![self.exact_at(time(sample))]).collect(),
            parts: vec![1],
            impulses: (0..self.samples).map(impulse).collect(),
            shares: Vec::new(),
            last_forces: (0..self.samples).map(last).collect(),
            energies: vec![energy; self.samples],
            initial_energy: energy,
            residual: None,
            penetration: 0.0,
            adhesion: 0.0,
        })
    }

    /// Without friction there is no sticking.
    fn families(&self, _: usize) -> Vec<EquationFamily> {
        vec![EquationFamily::MASSLESS]
    }

    fn several_nodes(&self) -> bool {
        false
    }

    fn energy_scale(&self) -> Option<f64> {
        (self.problem == BarProblem::Bouncing).then(bouncing_bar::energy)
    }

    fn releases(&self) -> Vec<[f64; 2]> {
        match self.problem {
            BarProblem::Carpenter => vec![[carpenter::exact().touch, 2.2e-4]],
            BarProblem::Bouncing => {
                bouncing_bar::CONTACTS.iter().map(|contact| [contact[0], contact[1] + 1.0]).collect()
            }
            BarProblem::Shaken { .. } => Vec::new(),
        }
    }
}

//! Unmodified built-in scenes: adaptive steps compared with fixed steps and the paper's method, each with the same
//! model.

use tiprub_core::Scene;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::{Preset, Shape};
use tiprub_gallery::{rom_cache::RomCache, scene_source};
use tiprub_shell::{Failure, Result, console::Console};

use super::{
    case::ErrorCase,
    competitor::{Competitor, DEFAULT, EquationFamily, PAPER, TOLERANCES, TOLERANT},
    run::TimedRun,
    scene::SceneRun,
    window,
};

/// Time between samples, and communication step of all runs (s).
const INTERVAL: f64 = 8e-5;
/// The massless-boundary scheme with the default contact solver.
const MASSLESS: Competitor = Competitor::Core(Scheme::MasslessBoundary, Solver::Lcp);
/// Samples per window of impulses.
const IMPULSE_WINDOW: usize = 4;
/// Internal steps per sample of the runs that determine the time over which trajectories can be compared; the first one
/// that the scene accepts is used.
const PARTING_DIVISIONS: [u32; 4] = [80, 160, 320, 640];

/// A built-in scene and the steps that are compared on it.
pub(crate) struct BuiltInFacts {
    pub name: &'static str,
    /// File names of the two pictures.
    pub figures: [&'static str; 2],
    pub title: &'static str,
    pub description: &'static str,
    /// Source of the scene.
    pub scene: &'static str,
    /// Depth of the two bumps (fraction of the gap); `None` leaves the casing unchanged.
    pub depth: Option<f64>,
    /// Number of samples: full study, quick form.
    pub samples: [usize; 2],
    /// Internal steps per sample of the paper's method, of `modal-exact` and of `massless-boundary`, ascending.
    pub divisions: [&'static [u32]; 3],
    /// Internal steps per sample of the fine reference run.
    pub reference: u32,
}

const BLADES: [&[u32]; 3] = [&[80, 320, 1280, 2000, 4000], &[80, 160, 320, 640], &[40, 80, 160, 320, 640]];
const COUPLED: [&[u32]; 3] = [&[80, 320, 1280], &[40, 80, 160, 320], &[10, 20, 40, 80, 160]];

pub(crate) const LIGHT: BuiltInFacts = BuiltInFacts {
    name: "rotor37-light",
    figures: ["rotor37-light-steps", "rotor37-light-total"],
    title: "Rotor 37, light rub",
    description: "36 blades of rotor 37 with 18 contact patches and 80 modes each, at design speed, µ = 0.15. The \
                  interference of the two bumps of the rigid casing is a fifth of the gap.",
    scene: "builtin:rotor37",
    depth: Some(0.6),
    samples: [66, 14],
    divisions: BLADES,
    reference: 4000,
};

pub(crate) const HEAVY: BuiltInFacts = BuiltInFacts {
    name: "rotor37-heavy",
    figures: ["rotor37-heavy-steps", "rotor37-heavy-total"],
    title: "Rotor 37, heavy rub",
    description: "The same blades. The interference of the two bumps equals the gap.",
    depth: Some(1.0),
    ..LIGHT
};

pub(crate) const CASING: BuiltInFacts = BuiltInFacts {
    name: "flexible-casing",
    figures: ["flexible-casing-steps", "flexible-casing-total"],
    title: "Rotor 37 in an elastic casing",
    description: "36 blades of rotor 37 in an elastic casing with a B-spline surface, one revolution. The casing \
                  couples all blades.",
    scene: "builtin:flexible-casing",
    depth: None,
    samples: [44, 8],
    divisions: COUPLED,
    reference: 1600,
};

pub(crate) const STAGE: BuiltInFacts = BuiltInFacts {
    name: "stage",
    figures: ["stage-steps", "stage-total"],
    title: "Stage",
    description: "56 blades coupled by their disk, with 18 contact patches each, in an elastic casing under load.",
    scene: "builtin:stage",
    samples: [60, 8],
    ..CASING
};

/// One scene, one model: discretisation errors of the steps only.
pub(crate) struct BuiltIn {
    facts: BuiltInFacts,
    scene: Scene,
    samples: usize,
    quick: bool,
    parting: Vec<f64>,
}

impl BuiltIn {
    /// Loads the scene and determines the time over which its trajectories can be compared.
    ///
    /// # Errors
    /// A model that cannot be reduced or a run that fails; never with the built-in scenes.
    pub(crate) fn new(facts: BuiltInFacts, quick: bool, cache: &RomCache, console: &Console) -> Result<Self> {
        let mut scene = scene_source::load(facts.scene, cache, console)?;
        scene.settings.preset = Preset::None;
        scene.settings.experiment.communication_step = INTERVAL;
        if let (Some(bumps), Shape::TwoLobe { depth, .. }) = (facts.depth, &mut scene.settings.surfaces[0].shape) {
            *depth = bumps;
        }
        let samples = facts.samples[usize::from(quick)];
        let mut case = Self { facts, scene, samples, quick, parting: Vec::new() };
        let mut parting = Err(String::new());
        for division in PARTING_DIVISIONS {
            parting = window::parting(&case, division, samples);
            if parting.is_ok() {
                break;
            }
        }
        case.parting =
            parting.map_err(|problem| Failure::new(case.facts.name, problem, "Report this to the developers"))?;
        case.samples = window::samples(&case.parting, samples);
        Ok(case)
    }

    /// Returns the scene.
    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }
}

impl ErrorCase for BuiltIn {
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
        self.facts.description.into()
    }

    fn size_name(&self) -> &'static str {
        "coordinates of the first ROM"
    }

    fn sizes(&self) -> Vec<usize> {
        vec![self.scene.roms[0].order()]
    }

    fn interval(&self) -> f64 {
        INTERVAL
    }

    fn samples(&self) -> usize {
        self.samples
    }

    fn impulse_window(&self) -> usize {
        IMPULSE_WINDOW
    }

    fn divisions(&self, _: usize) -> Vec<u32> {
        self.facts.divisions[1].to_vec()
    }

    /// The quick form omits the finer half.
    fn divisions_of(&self, _: usize, competitor: Competitor) -> Vec<u32> {
        let all = match competitor {
            TOLERANT => &TOLERANCES[..],
            PAPER => self.facts.divisions[0],
            MASSLESS => self.facts.divisions[2],
            _ => self.facts.divisions[1],
        };
        let count = if self.quick { all.len().div_ceil(2) } else { all.len() };
        all[..count].to_vec()
    }

    fn reference_divisions(&self, _: usize) -> (u32, u32) {
        let fine = if self.quick { 640 } else { self.facts.reference };
        (fine, fine / 2)
    }

    fn second(&self) -> Competitor {
        DEFAULT
    }

    fn relation(&self) -> &'static str {
        "the same scheme with twice the step"
    }

    fn competitors(&self, _: usize) -> Vec<Competitor> {
        vec![PAPER, DEFAULT, MASSLESS, TOLERANT]
    }

    /// Known if every direction was refined, for the blade in a rigid casing.
    fn model_error(&self) -> Option<f64> {
        let [rom] = &self.scene.roms[..] else { return None };
        let known = rom.checks.rub_errors.as_ref()?;
        Some(known.modes? + known.patches? + known.rows? + known.mesh?)
    }

    fn start<'a>(
        &'a self,
        _: usize,
        competitor: Competitor,
        division: u32,
        perturbation: f64,
    ) -> std::result::Result<Box<dyn TimedRun + 'a>, String> {
        let Competitor::Core(scheme, solver) = competitor else {
            return Err("only the methods of tiprub are available for a built-in scene".into());
        };
        let scene = SceneRun::by(&self.scene, (scheme, solver), INTERVAL, division, perturbation);
        Ok(Box::new(SceneRun::with_start_values(&scene, INTERVAL, division, &[])?))
    }

    fn parting(&self) -> &[f64] {
        &self.parting
    }

    fn families(&self, _: usize) -> Vec<EquationFamily> {
        vec![EquationFamily::MASSLESS]
    }
}

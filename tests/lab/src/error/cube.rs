//! Scene 3: the cube between two rings, with four methods on the full finite-element model.

use tiprub_core::Scene;
use tiprub_gallery::{reduction, rom_cache::RomCache, scene_source};
use tiprub_model::cube::{RingOptions, RingSide};
use tiprub_reference::{
    cube::scene::{CubeScene as FullScene, CubeSetting, Mass},
    surface::SurfaceKind,
};
use tiprub_shell::{Failure, Result, console::Console};

use super::{
    case::ErrorCase,
    competitor::{Competitor, EquationFamily, Full, TOLERANCES, TOLERANT},
    full::{FullRun, without_flight},
    measure::apart,
    run::{self, StepExtremes, TimedRun, Trace},
    scene::SceneRun,
    window,
};

/// Modes of each ring; the middle one is the built-in number.
const MODES: [usize; 3] = [20, 100, 300];
const QUICK_MODES: [usize; 2] = [20, 100];
/// Time between samples (s).
const INTERVAL: f64 = 8e-6;
/// Number of samples of the window, while node 1 touches.
const SAMPLES: usize = 47;
const QUICK_SAMPLES: usize = 10;
/// Internal steps per sample; the limit of central differences is between the first two of the full list.
const DIVISIONS: [u32; 7] = [1, 2, 4, 8, 16, 32, 64];
const OTHER_DIVISIONS: [u32; 4] = [2, 4, 16, 32];
const QUICK_DIVISIONS: [u32; 4] = [1, 2, 8, 16];
/// Internal steps per sample of the methods a, b, c, d; those of a and b as references.
const FULL_DIVISIONS: [&[u32]; 4] = [&[4, 8, 16, 32, 64], &[1, 2, 4, 8, 16], &[2, 4, 8], &[8, 32, 64]];
const QUICK_FULL_DIVISIONS: [&[u32]; 4] = [&[8, 16], &[4, 8], &[], &[]];
const FULL_REFERENCES: [u32; 2] = [160, 32];
const QUICK_FULL_REFERENCES: [u32; 2] = [64, 16];
/// Internal steps per sample of the product's reference, and of the runs that check the divergence of trajectories.
const REFERENCE: u32 = 256;
const QUICK_REFERENCE: u32 = 64;
const PARTING_DIVISION: u32 = 16;

/// The cube with several numbers of modes of its rings.
pub(crate) struct Cube {
    sizes: Vec<(usize, Scene)>,
    full: FullScene,
    quick: bool,
    samples: usize,
    speed: f64,
    /// Methods a and b with fine steps.
    references: Vec<Trace>,
    parting: Vec<f64>,
}

impl Cube {
    /// Reduces the rings with several numbers of modes (or loads them from the cache) and runs the references.
    ///
    /// # Errors
    /// A failed reduction or reference; never with the built-in models.
    pub(crate) fn new(quick: bool, cache: &RomCache, console: &Console) -> Result<Self> {
        let shipped = scene_source::load("builtin:cube-between-rings", cache, console)?;
        let mut sizes = Vec::new();
        for &modes in if quick { &QUICK_MODES[..] } else { &MODES[..] } {
            let mut scene = shipped.clone();
            for (rom, side) in scene.roms[1..].iter_mut().zip(RingSide::BOTH) {
                let options = RingOptions { modes, ..RingOptions::new(side) };
                let name = format!("{}-study-{modes}", options.name);
                *rom = cache.get(&name, &options, console, &|| Ok(reduction::cube_ring(&options, console)?.rom))?;
            }
            sizes.push((modes, scene));
        }
        let speed = shipped.settings.structures[0].velocity[1].abs();
        let friction = shipped.settings.contacts[0].friction;
        let setting = CubeSetting { speed, friction, surface: SurfaceKind::Spline, mass: Mass::Lumped };
        let full = FullScene::new(setting).map_err(|error| Failure::from_below("lab error", error))?;
        let samples = if quick { QUICK_SAMPLES } else { SAMPLES };
        let mut cube = Self { sizes, full, quick, samples, speed, references: Vec::new(), parting: Vec::new() };
        let failed = |problem: String| Failure::new("cube", problem, "Report this to the developers");
        cube.parting = window::parting(&cube, PARTING_DIVISION, samples).map_err(failed)?;
        cube.samples = window::samples(&cube.parting, samples);
        let divisions = if quick { QUICK_FULL_REFERENCES } else { FULL_REFERENCES };
        for (method, division) in [Full::Film, Full::Bipotential].into_iter().zip(divisions) {
            cube.references.push(cube.full_trace(method, division).map_err(failed)?);
        }
        Ok(cube)
    }

    fn full_trace(&self, method: Full, division: u32) -> std::result::Result<Trace, String> {
        let mut run = FullRun::new(&self.full, method, (INTERVAL, self.samples), division)?;
        run::trace(&mut run, self.samples)
    }

    fn full_divisions(&self, method: Full) -> &'static [u32] {
        let all = if self.quick { QUICK_FULL_DIVISIONS } else { FULL_DIVISIONS };
        Full::ALL.iter().zip(all).find(|(each, _)| **each == method).map_or(&[], |(_, divisions)| divisions)
    }
}

impl ErrorCase for Cube {
    fn name(&self) -> &'static str {
        "cube"
    }

    fn figures(&self) -> [&'static str; 2] {
        ["cube-steps", "cube-total"]
    }

    fn title(&self) -> &'static str {
        "Cube between two rings"
    }

    fn description(&self) -> String {
        "A cube enters the gap between two elastic rings at 100 m/s; the gap is narrower than the cube, µ = 0.15. \
         Errors are in the displacements of its 72 contact nodes (uniform motion removed) while node 1 is in \
         contact, relative to method a on the full finite-element model with a fine step. Methods on the full \
         model are compared with this solution in both figures."
            .into()
    }

    fn size_name(&self) -> &'static str {
        "modes per ring"
    }

    fn sizes(&self) -> Vec<usize> {
        self.sizes.iter().map(|size| size.0).collect()
    }

    fn interval(&self) -> f64 {
        INTERVAL
    }

    fn samples(&self) -> usize {
        self.samples
    }

    fn impulse_window(&self) -> usize {
        2
    }

    fn divisions(&self, size: usize) -> Vec<u32> {
        match (self.quick, size == self.standard()) {
            (true, _) => QUICK_DIVISIONS.to_vec(),
            (false, true) => DIVISIONS.to_vec(),
            (false, false) => OTHER_DIVISIONS.to_vec(),
        }
    }

    fn divisions_of(&self, size: usize, competitor: Competitor) -> Vec<u32> {
        match competitor {
            Competitor::Full(method) => self.full_divisions(method).to_vec(),
            TOLERANT if self.quick => TOLERANCES[..2].to_vec(),
            TOLERANT => TOLERANCES.to_vec(),
            _ => self.divisions(size),
        }
    }

    fn reference_divisions(&self, _: usize) -> (u32, u32) {
        match self.quick {
            true => (QUICK_REFERENCE, QUICK_FULL_REFERENCES[0]),
            false => (REFERENCE, FULL_REFERENCES[0]),
        }
    }

    fn second(&self) -> Competitor {
        Competitor::Full(Full::Film)
    }

    fn second_trace(&self) -> Option<Trace> {
        self.references.first().cloned()
    }

    fn meeting(&self) -> Option<(f64, String)> {
        let [first, second, ..] = &self.references[..] else { return None };
        let [a, b] = if self.quick { QUICK_FULL_REFERENCES } else { FULL_REFERENCES };
        let micro = |division: u32| 1e6 * INTERVAL / f64::from(division);
        Some((
            apart(second, first),
            format!("a at h = {:.3} µs and b at {:.3} µs, both on the full model", micro(a), micro(b)),
        ))
    }

    /// Methods on the full model occur once, because they do not use modes.
    fn competitors(&self, size: usize) -> Vec<Competitor> {
        let takes_part = |competitor: &Competitor| match competitor {
            // The solution for a tolerance is computed at one size.
            &TOLERANT => size == self.standard(),
            Competitor::Core(..) => true,
            Competitor::Full(method) => size == self.standard() && !self.full_divisions(*method).is_empty(),
            _ => false,
        };
        Competitor::all().into_iter().filter(takes_part).collect()
    }

    fn start<'a>(
        &'a self,
        size: usize,
        competitor: Competitor,
        division: u32,
        perturbation: f64,
    ) -> std::result::Result<Box<dyn TimedRun + 'a>, String> {
        Ok(match competitor {
            Competitor::Core(scheme, solver) => {
                let scene = SceneRun::by(&self.sizes[size].1, (scheme, solver), INTERVAL, division, perturbation);
                let run = SceneRun::with_start_values(&scene, INTERVAL, division, &[])?;
                Box::new(FlightRemoved { run, speed: self.speed })
            }
            Competitor::Full(method) => Box::new(FullRun::new(&self.full, method, (INTERVAL, self.samples), division)?),
            _ => return Err("this method does not support a free master".into()),
        })
    }

    fn exact(&self) -> Option<Trace> {
        self.references.first().cloned()
    }

    fn parting(&self) -> &[f64] {
        &self.parting
    }

    fn perturbed(&self) -> &'static str {
        "the speed"
    }

    /// Massless-boundary is rejected, and at this speed there is no sticking.
    fn families(&self, _: usize) -> Vec<EquationFamily> {
        Vec::new()
    }
}

/// A run of the product, with the rigid motion removed from its displacements.
struct FlightRemoved {
    run: SceneRun,
    speed: f64,
}

impl TimedRun for FlightRemoved {
    fn advance(&mut self) -> std::result::Result<(), String> {
        self.run.advance()
    }

    fn watch(&mut self, seen: &mut StepExtremes) -> std::result::Result<(), String> {
        self.run.watch(seen)
    }

    fn displacements(&self) -> Vec<f64> {
        without_flight(self.run.displacements_with_flight(), self.speed * self.run.time())
    }

    fn energy(&self) -> f64 {
        self.run.energy()
    }

    fn residual(&self) -> Option<f64> {
        self.run.residual()
    }
}

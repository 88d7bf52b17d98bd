//! Structures and scenes with analytic solutions, and blades and rings of analytic modes.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, Matrix3};
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::{DisplacementFrame, Harmonic, RomExtras};
use tiprub_core::{Rom, Scene};
pub(crate) use tiprub_test_models::{GAP, RADIUS, SeededRandom, bumps, rich_blade as blade, round};
use tiprub_test_models::{node, ring, structure};

/// Longest step of adaptive integration (s), the default of scenes.
pub(crate) const LONGEST: f64 = tiprub_core::scene::settings::ADAPTIVE_STEP;

/// Choice of the step length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum StepChoice {
    /// The case defines the internal step; for galerkin the longest one, with the largest tolerance that scenes accept.
    Fixed,
    /// The method chooses the step by this tolerance (a fraction of the clearance).
    Adaptive(f64),
}

/// Scheme, contact solver, and choice of the step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StabilityMethod {
    /// Scheme.
    pub scheme: Scheme,
    /// Contact solver.
    pub solver: Solver,
    /// Choice of the step.
    pub steps: StepChoice,
}

/// Returns the first word of the name of a scheme that distinguishes it from the others.
pub(crate) fn short_name(scheme: Scheme) -> &'static str {
    let name = scheme.name();
    name.strip_prefix("modal-").unwrap_or(name).split('-').next().unwrap_or(name)
}

/// Returns all schemes with their choice of the step size and their name in the table.
fn integrations() -> impl Iterator<Item = (Scheme, StepChoice, &'static str)> {
    Scheme::ALL.into_iter().flat_map(|scheme| {
        let adaptive = scheme.properties().adaptive;
        let by_tolerance = adaptive.then_some((scheme, StepChoice::Adaptive(1e-4), short_name(scheme)));
        let fixed = (scheme, StepChoice::Fixed, if adaptive { "galerkin-fixed" } else { short_name(scheme) });
        by_tolerance.into_iter().chain([fixed])
    })
}

impl StabilityMethod {
    /// Returns modal-exact with this solver.
    pub(crate) const fn exact(solver: Solver) -> Self {
        Self { scheme: Scheme::ModalExact, solver, steps: StepChoice::Fixed }
    }

    /// Returns every method.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        let with = |(scheme, steps, _)| Solver::ALL.into_iter().map(move |solver| Self { scheme, solver, steps });
        integrations().flat_map(with)
    }

    /// Returns every scheme and choice of the step, with one solver.
    pub(crate) fn all_with(solver: Solver) -> impl Iterator<Item = Self> {
        Self::all().filter(move |method| method.solver == solver)
    }

    /// Returns modal-exact and both forms of galerkin, with every solver: for cases that do not depend on the choice of
    /// a recurrence.
    pub(crate) fn common() -> impl Iterator<Item = Self> {
        Self::all().filter(|method| [Scheme::ModalExact, Scheme::Galerkin].contains(&method.scheme))
    }

    /// Returns the name of scheme and choice of the step.
    pub(crate) fn integration(self) -> &'static str {
        let adaptive = |steps| matches!(steps, StepChoice::Adaptive(_));
        let mut all = integrations();
        let own = all.find(|(scheme, steps, _)| *scheme == self.scheme && adaptive(*steps) == adaptive(self.steps));
        own.map_or("", |(.., name)| name)
    }

    /// Returns the name of the solver.
    pub(crate) fn solver_name(self) -> &'static str {
        self.solver.name()
    }

    /// Returns both as parts of the name of a case.
    pub(crate) fn name(self) -> String {
        format!("{}/{}", self.integration(), self.solver_name())
    }

    /// Returns the method in the name of a case: scheme with choice of the step, and solver.
    pub(crate) fn in_name(name: &str) -> (Option<&'static str>, Option<&'static str>) {
        let part = |known: &'static str| name.split('/').any(|part| part == known).then_some(known);
        let scheme = integrations().find_map(|(.., known)| part(known));
        (scheme, Solver::ALL.iter().find_map(|known| part(known.name())))
    }

    /// Returns the names of schemes with their choice of the step.
    pub(crate) fn integrations() -> impl Iterator<Item = &'static str> {
        integrations().map(|(.., name)| name)
    }

    /// Returns whether the scheme is galerkin, with a tolerance or at longest steps.
    pub(crate) fn is_galerkin(self) -> bool {
        self.scheme == Scheme::Galerkin
    }

    /// Returns whether a tolerance chooses the steps.
    pub(crate) fn is_adaptive(self) -> bool {
        matches!(self.steps, StepChoice::Adaptive(_))
    }

    /// Returns whether the scheme is massless-boundary.
    pub(crate) fn is_massless(self) -> bool {
        self.scheme == Scheme::MasslessBoundary
    }

    /// Returns the method with another tolerance, if it has one.
    pub(crate) fn within(self, tolerance: f64) -> Self {
        if self.is_adaptive() { Self { steps: StepChoice::Adaptive(tolerance), ..self } } else { self }
    }

    /// Returns the method for comparison, with a smaller tolerance, and the divisor of the step.
    pub(crate) fn finer(self) -> (Self, f64) {
        match self.steps {
            StepChoice::Adaptive(tolerance) => (self.within((tolerance / 16.0).max(1e-9)), 1.0),
            StepChoice::Fixed => (self, 4.0),
        }
    }

    /// Returns the internal step, or the longest one of adaptive integration (s).
    pub(crate) fn step(self, step: f64) -> f64 {
        if self.is_adaptive() { LONGEST } else { step }
    }

    /// Returns a scene with this method.
    pub(crate) fn on(self, scene: Scene) -> Scene {
        let mut scene = with_methods(scene, self.scheme, self.solver);
        scene.settings.time.tolerance = match self.steps {
            StepChoice::Adaptive(tolerance) => Some(tolerance),
            StepChoice::Fixed if self.is_galerkin() => Some(tiprub_core::scene::ranges::TOLERANCE[1]),
            StepChoice::Fixed => None,
        };
        scene
    }

    /// Returns a scene with this method in internal steps of `step` (s), or in the longest adaptive ones, and
    /// communication steps of the same length.
    pub(crate) fn stepping(self, scene: Scene, step: f64) -> Scene {
        with_step(self.on(scene), self.step(step))
    }
}

/// Returns the distance that the tolerance of a scene permits (m); 0 for schemes without one.
pub(crate) fn allowed(scene: &Scene) -> f64 {
    let contacts = scene.settings.contacts.iter();
    let smallest = contacts.flat_map(|contact| {
        contact.sector_gaps.iter().copied().chain(contact.sector_gaps.is_empty().then_some(contact.gap))
    });
    scene.settings.time.step_tolerance().map_or(0.0, |tolerance| tolerance * smallest.fold(f64::INFINITY, f64::min))
}

/// A contact node on a spring on a mass on a spring, in each direction: six degrees of freedom per sector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tower {
    /// Number of sectors.
    pub sectors: usize,
    /// Mass of the base and of the contact node (kg).
    pub mass: [f64; 2],
    /// Stiffness of the base spring, radial, tangential and axial (N/m).
    pub base: [f64; 3],
    /// Stiffness of the spring of the contact node, each direction (N/m).
    pub tip: f64,
    /// Angle by which the principal axes of the base spring are turned from radial to tangential (rad), which couples
    /// them.
    pub turned: f64,
    /// Number of coincident contact nodes.
    pub copies: usize,
    /// Slope of the tip contour.
    pub slope: f64,
    /// Stiffness of springs between the bases of neighbouring sectors (N/m) in each direction; 0 = uncoupled.
    pub neighbour: f64,
}

impl Default for Tower {
    fn default() -> Self {
        Self {
            sectors: 12,
            mass: [0.1, 1e-3],
            base: [4e7, 4e6, 2e7],
            tip: 2e8,
            turned: 0.0,
            copies: 1,
            slope: -0.2,
            neighbour: 0.0,
        }
    }
}

impl Tower {
    /// Returns the stiffness of the base spring in radial, tangential and axial direction.
    fn base_stiffness(&self) -> Matrix3<f64> {
        let (sine, cosine) = self.turned.sin_cos();
        let turn = Matrix3::new(cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0);
        turn * Matrix3::from_diagonal(&self.base.into()) * turn.transpose()
    }

    /// Returns the stiffness matrix of one sector with `more` on the diagonal of its base: (base, tip) by directions.
    fn stiffness(&self, more: f64) -> DMatrix<f64> {
        let base = self.base_stiffness();
        DMatrix::from_fn(6, 6, |i, j| {
            let same = if i % 3 == j % 3 { self.tip } else { 0.0 };
            match (i < 3, j < 3) {
                (true, true) => base[(i, j)] + same + if i == j { more } else { 0.0 },
                (false, false) => same,
                _ => -same,
            }
        })
    }

    /// Returns the ROM.
    pub(crate) fn rom(&self) -> Rom {
        let mass = DMatrix::from_fn(6, 6, |i, j| if i == j { self.mass[i / 3] } else { 0.0 });
        let contact_map =
            DMatrix::from_fn(3 * self.copies, 6, |row, column| f64::from(u8::from(3 + row % 3 == column)));
        let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
        let harmonic = |diameter: usize| {
            let wave = 2.0 - 2.0 * (TAU * diameter as f64 / self.sectors as f64).cos();
            Harmonic {
                mass: complex(&mass),
                stiffness: complex(&self.stiffness(self.neighbour * wave)),
                contact_map: complex(&contact_map),
            }
        };
        let harmonics = if self.neighbour > 0.0 { (1..=self.sectors / 2).map(harmonic).collect() } else { Vec::new() };
        let node = |index: usize| node(format!("node_{index}"), [RADIUS, 0.0, 0.0], self.slope);
        let nodes = (0..self.copies).map(node).collect();
        let rom = structure("tower", mass, self.stiffness(0.0), contact_map, nodes);
        let extras = RomExtras { harmonics, ..RomExtras::default() };
        Rom { sectors: self.sectors, frame: DisplacementFrame::Cylindrical, damping_ratio: 0.005, extras, ..rom }
    }

    /// Returns the largest angular frequency of one sector (rad/s), from the springs as written.
    pub(crate) fn largest_frequency(&self) -> f64 {
        let scale = |i: usize| 1.0 / self.mass[i / 3].sqrt();
        let stiffness = self.stiffness(4.0 * self.neighbour);
        DMatrix::from_fn(6, 6, |i, j| scale(i) * stiffness[(i, j)] * scale(j)).symmetric_eigenvalues().max().sqrt()
    }
}

/// Makes an elastic ring carry the surface.
pub(crate) fn on_ring(scene: &mut Scene, damping_ratio: f64) {
    tiprub_test_models::on_ring(scene, ring(36, 3), damping_ratio);
}

/// Sets scheme and solver. Scenes of the families are intentionally extreme.
pub(crate) fn with_methods(mut scene: Scene, scheme: Scheme, solver: Solver) -> Scene {
    scene.settings.accept_implausible = true;
    scene.settings.time.scheme = scheme;
    scene.settings.contacts[0].solver = solver;
    scene
}

/// Sets the internal step, with communication steps of the same length.
pub(crate) fn with_step(mut scene: Scene, step: f64) -> Scene {
    scene.settings.accept_implausible = true;
    scene.settings.time.step = step;
    scene.settings.experiment.communication_step = step;
    scene
}

//! Who takes part: every scheme with every solver of the product, and methods that share nothing with it.

use tiprub_core::settings::{Scheme, Solver};

/// One way to step a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Competitor {
    /// The product.
    Core(Scheme, Solver),
    /// Moreau and Jean, θ = ½: implicit, exact complementarity.
    Moreau,
    /// Newmark with an augmented Lagrangian.
    Augmented,
    /// Central differences with contact springs of so many times the scene's own stiffness.
    Penalty(u32),
    /// A method on the full finite-element model.
    Full(Full),
}

/// Methods of the reference crate on the full finite-element model of the cube and its rings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Full {
    /// a: central differences with film, the paper's method.
    Film,
    /// b: bi-potential, implicit.
    Bipotential,
    /// c: augmented Lagrangian with Newmark's method.
    Augmented,
    /// d: central differences with a penalty.
    Penalty,
}

impl Full {
    /// All four.
    pub const ALL: [Self; 4] = [Self::Film, Self::Bipotential, Self::Augmented, Self::Penalty];
}

/// Steps by a tolerance.
pub const TOLERANT: Competitor = Competitor::Core(Scheme::Galerkin, Solver::Lcp);
/// One over its tolerances that are compared.
pub const TOLERANCES: [u32; 4] = [100, 1000, 10_000, 100_000];
/// One over that of its finest run.
pub const FINEST: u32 = 10_000_000;
/// The method of the paper.
pub const PAPER: Competitor = Competitor::Core(Scheme::CentralDifference, Solver::Film);
/// The first reference and default of the product.
pub const DEFAULT: Competitor = Competitor::Core(Scheme::ModalExact, Solver::Lcp);
/// Which equations a competitor solves: runs of one family have one limit for h → 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EquationFamily {
    /// The contact nodes have no inertia.
    pub massless: bool,
    /// Contacts may stick, and slide in any direction; otherwise they slide along the circumference.
    pub sticking: bool,
}

impl EquationFamily {
    /// Inertia everywhere and sliding, as the first reference.
    pub const PLAIN: Self = Self { massless: false, sticking: false };
    /// No inertia of the contact nodes.
    pub const MASSLESS: Self = Self { massless: true, sticking: false };
    /// Sticking.
    pub const STICKING: Self = Self { massless: false, sticking: true };
    /// Both.
    pub const BOTH: Self = Self { massless: true, sticking: true };

    /// Whose fine run stands for the limit.
    pub fn reference(self) -> Competitor {
        let scheme = if self.massless { Scheme::MasslessBoundary } else { Scheme::ModalExact };
        Competitor::Core(scheme, if self.sticking { Solver::Coulomb } else { Solver::Lcp })
    }
}

/// Name of a scheme with a solver, as in scene files.
pub fn method_name((scheme, solver): (Scheme, Solver)) -> String {
    Competitor::Core(scheme, solver).name()
}

impl Competitor {
    /// Everyone, the product's own first.
    pub fn all() -> Vec<Self> {
        Self::reduced().into_iter().chain([TOLERANT]).chain(Full::ALL.map(Self::Full)).collect()
    }

    /// Everyone who steps a reduced model, the product's own first.
    pub fn reduced() -> Vec<Self> {
        let own =
            Scheme::RECURRENCES.into_iter().flat_map(|scheme| Solver::ALL.map(|solver| Self::Core(scheme, solver)));
        own.chain([Self::Moreau, Self::Augmented, Self::Penalty(1), Self::Penalty(10)]).collect()
    }

    /// The product's own.
    pub fn is_core(self) -> bool {
        matches!(self, Self::Core(..))
    }

    /// Whether it steps the full finite-element model.
    pub fn is_full(self) -> bool {
        matches!(self, Self::Full(_))
    }

    /// The equations it solves.
    pub fn family(self) -> EquationFamily {
        let Self::Core(scheme, solver) = self else { return EquationFamily::PLAIN };
        EquationFamily { massless: scheme.is_massless(), sticking: solver == Solver::Coulomb }
    }

    /// Whether a tolerance takes the place of its step. What divides the sample then divides the smallest clearance.
    pub fn is_by_tolerance(self) -> bool {
        matches!(self, Self::Core(Scheme::Galerkin, _))
    }

    /// `h = 0.500 µs` of a step (s), or `tolerance 1e-3`.
    pub fn setting(self, value: f64) -> String {
        if self.is_by_tolerance() { format!("tolerance {value:.0e}") } else { format!("h = {:.3} µs", 1e6 * value) }
    }

    /// As in scene files, or in words.
    pub fn name(self) -> String {
        match self {
            TOLERANT => "galerkin".into(),
            Self::Core(scheme, solver) => format!("{} + {}", scheme.name(), solver.name()),
            Self::Moreau => "Moreau-Jean, implicit".into(),
            Self::Augmented => "Newmark, augmented Lagrangian".into(),
            Self::Penalty(1) => "central differences, penalty".into(),
            Self::Penalty(times) => format!("central differences, penalty × {times}"),
            Self::Full(Full::Film) => "a, film, full model".into(),
            Self::Full(Full::Bipotential) => "b, bi-potential, full model".into(),
            Self::Full(Full::Augmented) => "c, augmented Lagrangian, full model".into(),
            Self::Full(Full::Penalty) => "d, penalty, full model".into(),
        }
    }

    /// Index of the colour: one per scheme or outside method.
    pub fn color(self) -> usize {
        match self {
            Self::Core(Scheme::CentralDifference, _) => 0,
            Self::Core(Scheme::ModalExact, _) => 1,
            Self::Core(Scheme::MasslessBoundary, _) => 2,
            Self::Moreau => 3,
            Self::Augmented => 4,
            Self::Penalty(_) => 5,
            Self::Full(_) => 6,
            Self::Core(Scheme::Galerkin, _) => 7,
        }
    }

    /// Index of the marker: one per solver; outside methods have a cross, the stiffer penalty another.
    pub fn marker(self) -> usize {
        match self {
            Self::Core(_, Solver::Film) | Self::Full(Full::Film) => 0,
            Self::Core(_, Solver::Lcp) | Self::Full(Full::Bipotential) => 1,
            Self::Core(_, Solver::Coulomb) => 2,
            Self::Penalty(times) if times > 1 => 4,
            Self::Full(Full::Penalty) => 4,
            _ => 3,
        }
    }
}

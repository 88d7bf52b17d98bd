//! Competitors: every scheme with every solver of tiprub, and independent methods that share no code with it.

use tiprub_core::scene::method::{Scheme, Solver};

/// Method that steps a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Competitor {
    /// A scheme and a solver of tiprub.
    Core(Scheme, Solver),
    /// Moreau-Jean scheme with θ = ½: implicit, exact complementarity.
    Moreau,
    /// Newmark with an augmented Lagrangian.
    Augmented,
    /// Central differences with contact springs of this many times the scene's own stiffness.
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
    /// All four methods.
    pub const ALL: [Self; 4] = [Self::Film, Self::Bipotential, Self::Augmented, Self::Penalty];
}

/// Adaptive steps with a tolerance.
pub const TOLERANT: Competitor = Competitor::Core(Scheme::Galerkin, Solver::Lcp);
/// Inverses of the compared tolerances.
pub const TOLERANCES: [u32; 4] = [100, 1000, 10_000, 100_000];
/// Inverse of the tolerance of the finest run.
pub const FINEST: u32 = 10_000_000;
/// The method of the paper.
pub const PAPER: Competitor = Competitor::Core(Scheme::PAPER, Solver::PAPER);
/// First reference and default of tiprub.
pub const DEFAULT: Competitor = Competitor::Core(Scheme::ModalExact, Solver::Lcp);
/// Equations that a competitor solves: all runs of one family converge to the same limit for h → 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EquationFamily {
    /// True if the contact nodes have no inertia.
    pub massless: bool,
    /// True if contacts may stick, and slide in any direction; otherwise they slide along the circumference.
    pub sticking: bool,
}

impl EquationFamily {
    /// Inertia at all nodes and sliding contact, as in the first reference.
    pub const PLAIN: Self = Self { massless: false, sticking: false };
    /// Contact nodes without inertia.
    pub const MASSLESS: Self = Self { massless: true, sticking: false };
    /// Sticking contact.
    pub const STICKING: Self = Self { massless: false, sticking: true };
    /// Contact nodes without inertia, and sticking contact.
    pub const BOTH: Self = Self { massless: true, sticking: true };

    /// Returns the competitor whose fine run represents the limit.
    pub fn reference(self) -> Competitor {
        let scheme = if self.massless { Scheme::MasslessBoundary } else { Scheme::ModalExact };
        Competitor::Core(scheme, if self.sticking { Solver::STICKING } else { Solver::default() })
    }
}

/// Returns the name of a scheme with a solver, as in scene files.
pub fn method_name((scheme, solver): (Scheme, Solver)) -> String {
    Competitor::Core(scheme, solver).name()
}

impl Competitor {
    /// Returns all competitors, those of tiprub first.
    pub fn all() -> Vec<Self> {
        Self::reduced().into_iter().chain([TOLERANT]).chain(Full::ALL.map(Self::Full)).collect()
    }

    /// Returns all competitors that step a reduced model, those of tiprub first.
    pub fn reduced() -> Vec<Self> {
        let own =
            Scheme::RECURRENCES.into_iter().flat_map(|scheme| Solver::ALL.map(|solver| Self::Core(scheme, solver)));
        own.chain([Self::Moreau, Self::Augmented, Self::Penalty(1), Self::Penalty(10)]).collect()
    }

    /// Returns whether the method is part of tiprub.
    pub fn is_core(self) -> bool {
        matches!(self, Self::Core(..))
    }

    /// Returns whether the method steps the full finite-element model.
    pub fn is_full(self) -> bool {
        matches!(self, Self::Full(_))
    }

    /// Returns the equations that the method solves.
    pub fn family(self) -> EquationFamily {
        let Self::Core(scheme, solver) = self else { return EquationFamily::PLAIN };
        EquationFamily { massless: scheme.properties().quasi_static, sticking: solver.sticks() }
    }

    /// Returns whether the method uses a tolerance instead of a step; a division then applies to the smallest clearance instead of the sample
    /// interval.
    pub fn is_by_tolerance(self) -> bool {
        matches!(self, Self::Core(scheme, _) if scheme.properties().adaptive)
    }

    /// Formats a setting: `h = 0.500 µs` for a step (s), or `tolerance 1e-3`.
    pub fn setting(self, value: f64) -> String {
        if self.is_by_tolerance() { format!("tolerance {value:.0e}") } else { format!("h = {:.3} µs", 1e6 * value) }
    }

    /// Returns the name as in scene files, or a description.
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

    /// Returns the index of the colour: one per scheme or independent method.
    pub fn color(self) -> usize {
        match self {
            // The colours of independent methods follow those of the first three schemes.
            Self::Core(scheme, _) => match Scheme::ALL.iter().position(|one| *one == scheme) {
                Some(index @ ..3) => index,
                other => other.unwrap_or(3) + 4,
            },
            Self::Moreau => 3,
            Self::Augmented => 4,
            Self::Penalty(_) => 5,
            Self::Full(_) => 6,
        }
    }

    /// Returns the index of the marker: one per solver; independent methods have a cross, the stiffer penalty another marker.
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

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
}

/// Schemes of the product.
pub const SCHEMES: [Scheme; 3] = [Scheme::CentralDifference, Scheme::ModalExact, Scheme::MasslessBoundary];
/// Solvers of the product.
pub const SOLVERS: [Solver; 3] = [Solver::Film, Solver::Lcp, Solver::Coulomb];

/// The method of the paper.
pub const PAPER: Competitor = Competitor::Core(Scheme::CentralDifference, Solver::Film);
/// The first reference and default of the product.
pub const DEFAULT: Competitor = Competitor::Core(Scheme::ModalExact, Solver::Lcp);
/// The same without inertia of the contact nodes: other equations, with a limit of their own.
pub const MASSLESS: Competitor = Competitor::Core(Scheme::MasslessBoundary, Solver::Lcp);

/// Which equations a competitor solves: runs of one family have one limit for h → 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Every mode has its inertia.
    Inertia,
    /// The contact nodes have none.
    Massless,
}

impl Competitor {
    /// Everyone, the product's own first.
    pub fn all() -> Vec<Self> {
        let own = SCHEMES.into_iter().flat_map(|scheme| SOLVERS.map(|solver| Self::Core(scheme, solver)));
        own.chain([Self::Moreau, Self::Augmented, Self::Penalty(1), Self::Penalty(10)]).collect()
    }

    /// The product's own.
    pub fn is_core(self) -> bool {
        matches!(self, Self::Core(..))
    }

    /// The equations it solves.
    pub fn family(self) -> Family {
        match self {
            Self::Core(Scheme::MasslessBoundary, _) => Family::Massless,
            _ => Family::Inertia,
        }
    }

    /// As in scene files, or in words.
    pub fn name(self) -> String {
        match self {
            Self::Core(scheme, solver) => format!("{} + {}", scheme_name(scheme), solver_name(solver)),
            Self::Moreau => "Moreau-Jean, implicit".into(),
            Self::Augmented => "Newmark, augmented Lagrangian".into(),
            Self::Penalty(1) => "central differences, penalty".into(),
            Self::Penalty(times) => format!("central differences, penalty × {times}"),
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
        }
    }

    /// Index of the marker: one per solver; outside methods have a cross, the stiffer penalty another.
    pub fn marker(self) -> usize {
        match self {
            Self::Core(_, Solver::Film) => 0,
            Self::Core(_, Solver::Lcp) => 1,
            Self::Core(_, Solver::Coulomb) => 2,
            Self::Penalty(times) if times > 1 => 4,
            _ => 3,
        }
    }
}

/// Name of a scheme in scene files.
pub fn scheme_name(scheme: Scheme) -> &'static str {
    match scheme {
        Scheme::ModalExact => "modal-exact",
        Scheme::CentralDifference => "central-difference",
        Scheme::MasslessBoundary => "massless-boundary",
    }
}

/// Name of a solver in scene files.
pub fn solver_name(solver: Solver) -> &'static str {
    match solver {
        Solver::Lcp => "lcp",
        Solver::Film => "film",
        Solver::Coulomb => "coulomb",
    }
}

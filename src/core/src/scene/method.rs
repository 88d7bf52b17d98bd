//! Methods that a scene may choose: time-stepping schemes and contact solvers.

use serde::{Deserialize, Serialize};
use tiprub_cosim::variables::Enumeration;

/// Time-stepping scheme of the modal equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// Explicit central differences, the paper's scheme (eq. 9); stable for ωh < 2.
    CentralDifference,
    /// Two-step recurrence that is exact in free flight and at rest under constant force (default of Rust; a scene file that names no scheme
    /// has [another default](crate::scene::settings::SceneSettings::default_scheme)).
    #[default]
    ModalExact,
    /// The highest modes, three per contact node, are quasi-static: contact acts through their residual flexibility
    /// (Monjaraz-Tec, Gross, Krack, Computers & Structures 260, 2022); the other modes take the contact force one step later.
    MasslessBoundary,
    /// Continuous Galerkin in time; the steps of each sector are as long as a tolerance allows ([`crate::time::galerkin`]). Contact
    /// acts through the flexibility of the same quasi-static modes.
    Galerkin,
}

impl Scheme {
    /// All schemes, in the order of the FMU's enumeration.
    pub const ALL: [Self; 4] = [Self::CentralDifference, Self::ModalExact, Self::MasslessBoundary, Self::Galerkin];

    /// Schemes whose modes follow recurrences, all with one step.
    pub const RECURRENCES: [Self; 3] = [Self::CentralDifference, Self::ModalExact, Self::MasslessBoundary];

    /// Returns whether the highest modes, three per contact node, are quasi-static.
    pub fn is_massless(self) -> bool {
        match self {
            Self::CentralDifference | Self::ModalExact => false,
            Self::MasslessBoundary | Self::Galerkin => true,
        }
    }

    /// Returns whether contact forces act one step after they are found.
    pub fn acts_later(self) -> bool {
        match self {
            Self::CentralDifference | Self::ModalExact | Self::Galerkin => false,
            Self::MasslessBoundary => true,
        }
    }

    /// Name in scene files and in the FMU's enumeration.
    pub fn name(self) -> &'static str {
        SCHEMES.items[self as usize].0
    }
}

/// The enumeration of the FMU.
pub(crate) static SCHEMES: Enumeration = Enumeration {
    name: "Scheme",
    description: "Time-stepping scheme",
    items: &[
        ("central-difference", "Explicit central differences (eq. 9), stable for omega h < 2"),
        ("modal-exact", "Exact for free motion and under constant force"),
        ("massless-boundary", "Highest modes quasi-static; contact forces act on the other modes one step later"),
        ("galerkin", "Continuous Galerkin in time with adaptive steps for each sector; highest modes quasi-static"),
    ],
};

/// Solver of the unilateral contact problem of one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// The paper's forward-increment Lagrange multipliers (eqs 10-11): penetration detected once, equality there.
    Film,
    /// Linear complementarity over all contact nodes (default).
    #[default]
    Lcp,
    /// Coulomb friction with sticking: De Saxcé's form by Gauss-Seidel with exact local solutions.
    Coulomb,
}

impl Solver {
    /// Returns whether contacts may stick, so that tangential forces have any direction within the friction cone.
    pub fn sticks(self) -> bool {
        match self {
            Self::Film | Self::Lcp => false,
            Self::Coulomb => true,
        }
    }

    /// All solvers, in the order of the FMU's enumeration.
    pub const ALL: [Self; 3] = [Self::Film, Self::Lcp, Self::Coulomb];

    /// Name in scene files and in the FMU's enumeration.
    pub fn name(self) -> &'static str {
        SOLVERS.items[self as usize].0
    }
}

/// Enumeration of the solvers for importers.
pub(crate) static SOLVERS: Enumeration = Enumeration {
    name: "Solver",
    description: "Contact solver",
    items: &[
        ("film", "Forward-increment Lagrange multipliers: zero gap at the nodes that are predicted to penetrate"),
        ("lcp", "Complementarity over all contact nodes"),
        ("coulomb", "Coulomb friction with sticking"),
    ],
};

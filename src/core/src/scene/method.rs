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

    /// The paper's scheme, which the preset `paper` fixes.
    pub const PAPER: Self = Self::CentralDifference;

    /// The scheme with adaptive steps that defaults and remedies propose.
    pub const ADAPTIVE: Self = Self::Galerkin;

    /// Returns the facts about the method on which limits, checks and remedies depend.
    pub fn properties(self) -> &'static SchemeProperties {
        match self {
            Self::CentralDifference => &SchemeProperties {
                stable_below: 2.0,
                resonance_error: Some(ResonanceError {
                    resolved_turn: 0.245,
                    amplitude: |turn| turn / libm::sin(turn) - 1.0,
                    frequency: |turn| turn * turn / 24.0,
                }),
                ..SchemeProperties::UNLIMITED
            },
            Self::ModalExact => {
                &SchemeProperties { resolved_up_to: 2.0, holds_loads: true, ..SchemeProperties::UNLIMITED }
            }
            Self::MasslessBoundary => &SchemeProperties {
                quasi_static: true,
                delays_contact: true,
                holds_loads: true,
                returns_impact_energy: true,
                ..SchemeProperties::UNLIMITED
            },
            Self::Galerkin => &SchemeProperties {
                quasi_static: true,
                adaptive: true,
                stores_velocity: true,
                returns_impact_energy: true,
                ..SchemeProperties::UNLIMITED
            },
        }
    }

    /// Name in scene files and in the FMU's enumeration.
    pub fn name(self) -> &'static str {
        SCHEMES.items[self as usize].0
    }

    /// Number in the enumeration of the FMU, which starts at 1.
    pub fn number(self) -> i32 {
        self as i32 + 1
    }
}

/// Facts about a time-stepping scheme.
#[derive(Debug)]
pub struct SchemeProperties {
    /// True if steps are as long as a tolerance allows; such steps need no limits.
    pub adaptive: bool,
    /// True if the highest modes, three per contact node, are quasi-static: contact nodes have no mass.
    pub quasi_static: bool,
    /// True if contact forces act one step after they are found.
    pub delays_contact: bool,
    /// True if the state of a mode is (q, hq̇) at one time, otherwise (q, q − q⁻) at two.
    pub stores_velocity: bool,
    /// True if the recurrence takes a harmonic load as constant over a step, so that its amplitude is corrected.
    pub holds_loads: bool,
    /// True if impacts may return some energy of earlier impacts: forces act late, or closed contacts have small gaps.
    pub returns_impact_energy: bool,
    /// ωh from which on free vibration is unstable; infinite if any step is stable.
    pub stable_below: f64,
    /// ωh up to which a mode responds correctly to contact forces; infinite if every accepted step resolves all modes with inertia.
    pub resolved_up_to: f64,
    /// Error of resonances that harmonic loads excite; `None` if the scheme corrects or controls it.
    pub resonance_error: Option<ResonanceError>,
}

impl SchemeProperties {
    /// A scheme without limits whose modes all have inertia.
    const UNLIMITED: Self = Self {
        adaptive: false,
        quasi_static: false,
        delays_contact: false,
        stores_velocity: false,
        holds_loads: false,
        returns_impact_energy: false,
        stable_below: f64::INFINITY,
        resolved_up_to: f64::INFINITY,
        resonance_error: None,
    };
}

/// Error of a resonance, as functions of the angle (rad) by which the load turns per step.
#[derive(Debug, Clone, Copy)]
pub struct ResonanceError {
    /// Turn above which the amplitude is more than 1 % too large (rad).
    pub resolved_turn: f64,
    /// Fraction by which the amplitude is too large.
    pub amplitude: fn(f64) -> f64,
    /// Fraction by which the frequency is shifted.
    pub frequency: fn(f64) -> f64,
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
    /// All solvers, in the order of the FMU's enumeration.
    pub const ALL: [Self; 3] = [Self::Film, Self::Lcp, Self::Coulomb];

    /// Solver of the paper, which the preset `paper` prescribes.
    pub const PAPER: Self = Self::Film;

    /// The solver with sticking friction that remedies propose.
    pub const STICKING: Self = Self::Coulomb;

    /// Returns the properties of the solver on which limits, checks, remedies and texts depend.
    pub fn properties(self) -> &'static SolverProperties {
        match self {
            Self::Film => &SolverProperties { complementary: false, ..SolverProperties::SLIDING },
            Self::Lcp => &SolverProperties { solves_coatings: true, ..SolverProperties::SLIDING },
            Self::Coulomb => &SolverProperties {
                feature: Some("friction sticks and slides (coulomb)"),
                sticks: true,
                ..SolverProperties::SLIDING
            },
        }
    }

    /// Name in scene files and in the FMU's enumeration.
    pub fn name(self) -> &'static str {
        SOLVERS.items[self as usize].0
    }

    /// Returns [`SolverProperties::sticks`].
    pub fn sticks(self) -> bool {
        self.properties().sticks
    }
}

/// Properties of a contact solver and its law.
#[derive(Debug)]
pub struct SolverProperties {
    /// Phrase that describes a scene with this solver; `None` for plain sliding friction.
    pub feature: Option<&'static str>,
    /// True if contacts may stick, so that tangential forces have any direction within the friction cone.
    pub sticks: bool,
    /// True if gap and force are complementary. Otherwise a contact may pull a node, or leave it inside a surface for a
    /// step.
    pub complementary: bool,
    /// True if friction is µ times the normal force at any sliding speed.
    pub constant_friction: bool,
    /// True if contacts may have a coating, which yields within the contact problem.
    pub solves_coatings: bool,
}

impl SolverProperties {
    /// Complementarity with friction that always slides.
    const SLIDING: Self =
        Self { feature: None, sticks: false, complementary: true, constant_friction: true, solves_coatings: false };
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

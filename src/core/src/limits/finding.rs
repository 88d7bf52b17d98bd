//! Findings as data: exceeded limits, and doubtful results. `wording.rs` gives them words when they are reported.

use super::massless::MasslessLimit;
use super::{Fastest, GrowthRates};
use crate::scene::method::Scheme;
use tiprub_cosim::warning::Topic;

/// Growth factor that counts as significant: it turns a motion of a thousandth of the clearance into one as large as the clearance.
pub(crate) const SIGNIFICANT_GROWTH: f64 = 1e3;

/// Part of a scene that a finding concerns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// The whole scene.
    Scene,
    /// A master.
    Body(usize),
    /// A structure that carries a surface.
    Carrier(usize),
    /// Contact of a master that slides in +θ (0) or −θ (1).
    Slip {
        /// The master.
        body: usize,
        /// Index of the sense.
        sense: usize,
    },
}

/// A finding about a part of a scene: a warning, or the reason for an error.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding<K = WarningKind> {
    /// The part of the scene.
    pub of: Subject,
    /// The finding, with its numbers.
    pub kind: K,
}

/// Result of a check of a scene.
pub type Checked<T> = Result<T, Finding<ErrorKind>>;

/// Closed contact that slides in one sense.
#[derive(Debug, Clone, PartialEq)]
pub struct ClosedContact {
    /// Closed contact nodes of the ROM.
    pub nodes: Vec<usize>,
    /// True if they are closed on all sectors.
    pub all_sectors: bool,
    /// Index of the sense: 0 for +θ, 1 for −θ.
    pub sense: usize,
    /// Friction coefficients of these nodes, ascending.
    pub frictions: Vec<f64>,
}

/// Growth that a step adds to closed sliding contact.
#[derive(Debug, Clone, PartialEq)]
pub struct StepGrowth {
    /// The contact with the most growth.
    pub contact: ClosedContact,
    /// The step (s).
    pub step: f64,
    /// Growth at this step.
    pub rates: GrowthRates,
    /// Largest error by this growth, as a fraction of the displacement that contact causes.
    pub error: f64,
    /// Longest step that is accepted (s), if there is one.
    pub accepted: Option<f64>,
    /// Longest step without a warning (s), if there is one.
    pub silent: Option<f64>,
}

/// Findings that are reported while the scene is accepted.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the comment of a variant describes its numbers")]
pub enum WarningKind {
    /// Modes up to the largest angular frequency (rad/s) are not resolved by a step (s).
    UnresolvedModes { scheme: Scheme, frequency: f64, step: f64 },
    /// A step (s) near the limit (s) leaves much of the flexibility of contact unresolved.
    UnresolvedFlexibility { scheme: Scheme, step: f64, limit: f64 },
    /// Contact that opens and closes may gain energy at this step (s).
    MasslessEnergy { step: f64, limit: MasslessLimit },
    /// Contact is stable for a number of blades in contact, but not for all sectors.
    MasslessBlades { stable: f64, sectors: usize },
    /// The tip locks up above a friction coefficient, and diverges at a rate (1/s) if that is known.
    LockUp { contact: ClosedContact, friction: f64, rate: Option<f64> },
    /// Vibration in closed contact grows by the differential equations.
    Flutter {
        contact: ClosedContact,
        motion: Fastest,
        /// Growth with the mass of the contact nodes, if `motion` neglects it.
        with_mass: Option<Fastest>,
        /// Fraction of the contact displacement that this motion contributes until contact opens.
        share: f64,
        /// Time after which contact opens (s), if the growth until then is not significant.
        opens_after: Option<f64>,
        /// Tolerance of adaptive steps, which do not resolve vibration far below it; `None` for fixed steps.
        tolerance: Option<f64>,
    },
    /// The step makes vibration in closed contact grow.
    StepGrowth(Box<StepGrowth>),
    /// The next step will be rejected, because contact now slides in the other sense.
    ReversedGrowth(Box<StepGrowth>),
    /// Vibration grows while all contact nodes of a blade cut.
    CuttingGrowth(Fastest),
    /// The model has too many modes for the check of growth.
    GrowthUnchecked { scheme: Scheme, modes: usize },
    /// Growth in the other sense of slip was not checked.
    OtherSense,
    /// The casing's part of W is not positive semidefinite: lowest eigenvalue relative to the largest, and angle (rad).
    CasingSolvability { friction: f64, step: f64, eigenvalue: f64, angle: f64 },
    /// The contact problem in free flight may have no unique solution: lowest eigenvalue of the scaled symmetric part of W.
    FlightSolvability { friction: f64, eigenvalue: f64 },
    /// Quasi-static modes give no flexibility to `rigid` of the directions of contact nodes.
    RigidContact { scheme: Scheme, modes: usize, rigid: usize, directions: usize },
    /// The load turns by this angle (rad) in one internal step, too far by a factor: errors of amplitude and frequency of a resonance.
    CoarseExcitation { scheme: Scheme, turn: f64, excess: f64, amplitude: f64, frequency: f64 },
}

impl WarningKind {
    /// Returns the finding about a part of the scene.
    pub fn of(self, of: Subject) -> Finding {
        Finding { of, kind: self }
    }

    /// Returns the topic of the warning.
    pub fn topic(&self) -> Topic {
        match self {
            Self::UnresolvedModes { .. } => Topic::UnresolvedModes,
            Self::UnresolvedFlexibility { .. } => Topic::UnresolvedFlexibility,
            Self::MasslessEnergy { .. } => Topic::MasslessEnergy,
            Self::MasslessBlades { .. } => Topic::MasslessBlades,
            Self::LockUp { .. } => Topic::LockUp,
            Self::Flutter { .. } => Topic::Flutter,
            Self::StepGrowth(_) | Self::ReversedGrowth(_) => Topic::StepGrowth,
            Self::CuttingGrowth(_) => Topic::CuttingGrowth,
            Self::GrowthUnchecked { .. } => Topic::GrowthUnchecked,
            Self::OtherSense => Topic::OtherSense,
            Self::CasingSolvability { .. } => Topic::CasingSolvability,
            Self::FlightSolvability { .. } => Topic::FlightSolvability,
            Self::RigidContact { .. } => Topic::RigidContact,
            Self::CoarseExcitation { .. } => Topic::CoarseExcitation,
        }
    }
}

/// Findings for which a scene or a step is rejected.
#[derive(Debug, Clone, PartialEq)]
#[expect(missing_docs, reason = "the comment of a variant describes its numbers")]
pub enum ErrorKind {
    /// Free vibration with the largest angular frequency (rad/s) is unstable at a step (s).
    UnstableStep { scheme: Scheme, frequency: f64, step: f64 },
    /// A step (s) at or beyond the limit (s) does not resolve the modes that contact excites; largest angular frequency (rad/s).
    UnresolvedContact { scheme: Scheme, step: f64, limit: f64, frequency: f64 },
    /// The contact problem has no unique solution, or none is proven, from a friction coefficient on.
    Unsolvable { friction: f64, step: f64, solvable_below: f64, is_proven: bool },
    /// A node in free flight is driven into the surface by friction alone.
    Jammed { friction: f64, step: f64, node: usize },
    /// Contact is unstable or gains energy at a step (s).
    MasslessStep { step: f64, limit: MasslessLimit },
    /// Closed contact raises the square of the highest frequency of modes with inertia by this factor.
    StiffContact { factor: f64 },
    /// The quasi-static modes have no flexibility along the normal of a contact node.
    RigidNormal,
    /// The step makes vibration in closed contact grow.
    StepGrowth(Box<StepGrowth>),
}

impl ErrorKind {
    /// Returns the finding about a part of the scene.
    pub fn of(self, of: Subject) -> Finding<Self> {
        Finding { of, kind: self }
    }
}

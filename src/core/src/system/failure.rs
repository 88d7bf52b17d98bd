//! Why a step fails.

use super::Curved;
use super::losses::Loss;

/// Why a step failed. Structures, sectors and nodes count from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum StepFailure {
    /// A displacement or gap became infinite or NaN.
    NonFinite,
    /// A node is displaced or penetrates by more than a tenth of its radius, or meets a flank of the casing steeper than
    /// 45°; on open surfaces, by more than a tenth of the extent of the contact nodes.
    Implausible {
        /// Structure.
        structure: usize,
        /// Sector.
        sector: usize,
    },
    /// A structure that carries a surface is displaced by more than a tenth of the radius, or of the extent.
    CarrierImplausible {
        /// Structure.
        structure: usize,
    },
    /// A contact node moves by more than a tenth of the extent of an open surface in one step: it could pass it unseen.
    TooFast {
        /// Structure.
        structure: usize,
    },
    /// A node comes over a free edge and is behind the surface already.
    BehindEdge {
        /// Structure.
        structure: usize,
        /// Contact node.
        node: usize,
    },
    /// Normals turn and surfaces curve so far within steps that this adds energy which no input brings.
    Unbalanced {
        /// Set of structures that can feel each other.
        set: usize,
        /// Energy that was added (J).
        work: f64,
        /// All energy exchanged (J).
        exchanged: f64,
    },
    /// Friction or impacts, which can only take energy, have given some.
    Gives {
        /// Set of structures that can feel each other.
        set: usize,
        /// Which of the two.
        loss: Loss,
        /// Energy that was given back since the largest loss (J).
        given: f64,
        /// Energy that it is compared with (J).
        exchanged: f64,
    },
    /// A node moves so far around the axis that what linear kinematics misses is as large as its clearance.
    Curved(Curved),
    /// A node has left a surface around an axis over its edge, further than the surface goes on.
    OutOfReach {
        /// Structure.
        structure: usize,
        /// Contact node.
        node: usize,
        /// Sector.
        sector: usize,
    },
    /// A gap has changed by more than the motion of node and surface explains: it is not a distance.
    Unexplained {
        /// Structure.
        structure: usize,
        /// Contact node.
        node: usize,
        /// Sector.
        sector: usize,
        /// Change of the gap over two steps (m).
        jump: f64,
        /// Part that motion explains (m).
        explained: f64,
    },
    /// A law that looks once for penetration holds nodes closed that the others push away.
    Pulls {
        /// Structure.
        structure: usize,
        /// Contact node most pulled at.
        node: usize,
        /// Impulse as a fraction of that of the node with the largest.
        share: f64,
    },
    /// A law that looks once for penetration leaves a node deep inside the surface.
    LeftInside {
        /// Structure.
        structure: usize,
        /// Contact node that was deepest inside.
        node: usize,
        /// Depth as a fraction of the clearance.
        share: f64,
    },
    /// More steps would have to be tried than are allowed.
    Exhausted,
    /// The contact problem of a sector has no solution within the pivoting limit.
    Unsolved {
        /// Structure.
        structure: usize,
        /// Sector.
        sector: usize,
    },
}

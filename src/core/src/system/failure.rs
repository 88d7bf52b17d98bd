//! Reasons why a step fails.

use super::Curved;
use super::losses::Loss;

/// Reason why a step failed. Structures, sectors and nodes count from 0.
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
    /// A contact node moves by more than a tenth of the extent of an open surface in one step, so it could pass the surface unnoticed.
    TooFast {
        /// Structure.
        structure: usize,
    },
    /// A node passes a free edge and is already behind the surface.
    BehindEdge {
        /// Structure.
        structure: usize,
        /// Contact node.
        node: usize,
    },
    /// Normals turn and surfaces curve so much within steps that this adds energy that no input supplies.
    Unbalanced {
        /// Set of structures that influence each other.
        set: usize,
        /// Energy that was added (J).
        work: f64,
        /// All energy exchanged (J).
        exchanged: f64,
    },
    /// Friction, impacts or cutting, which can only dissipate energy, have supplied energy.
    Gives {
        /// Set of structures that influence each other.
        set: usize,
        /// Kind of the loss.
        loss: Loss,
        /// Energy supplied since the largest loss (J).
        given: f64,
        /// Reference energy for the comparison (J).
        exchanged: f64,
    },
    /// A node moves so far around the axis that the error of linear kinematics is as large as its clearance.
    Curved(Curved),
    /// A node has left a surface around an axis beyond the extrapolated part of its edge.
    OutOfReach {
        /// Structure.
        structure: usize,
        /// Contact node.
        node: usize,
        /// Sector.
        sector: usize,
    },
    /// A gap has changed by more than the motion of node and surface explains, so it is not a distance.
    Unexplained {
        /// Structure.
        structure: usize,
        /// Contact node.
        node: usize,
        /// Sector.
        sector: usize,
        /// Change of the gap over two steps (m).
        jump: f64,
        /// Change that the motion explains (m).
        explained: f64,
    },
    /// A law that checks for penetration only once holds nodes closed that the other nodes push away.
    Pulls {
        /// Structure.
        structure: usize,
        /// Contact node with the largest pulling impulse.
        node: usize,
        /// Pulling impulse as a fraction of the largest impulse of a node.
        share: f64,
    },
    /// A law that checks for penetration only once leaves a node deep inside the surface.
    LeftInside {
        /// Structure.
        structure: usize,
        /// Contact node that was deepest inside.
        node: usize,
        /// Depth as a fraction of the clearance.
        share: f64,
    },
    /// The limit of attempted steps is exceeded.
    Exhausted,
    /// The contact problem of a sector has no solution within the pivoting limit.
    Unsolved {
        /// Structure.
        structure: usize,
        /// Sector.
        sector: usize,
    },
}

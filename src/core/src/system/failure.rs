//! Reasons why a step fails.

use super::Curved;
use super::losses::Loss;

/// Reason why a step failed. Structures, sectors, nodes, and sets of structures that influence each other, are numbered
/// from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(missing_docs, reason = "the comment of a variant describes its numbers")]
pub enum StepFailure {
    /// A displacement or gap became infinite or NaN.
    NonFinite,
    /// A node is displaced or penetrates by more than a tenth of its radius, or meets a flank of the casing steeper than
    /// 45°; on open surfaces, by more than a tenth of the extent of the contact nodes.
    Implausible { structure: usize, sector: usize },
    /// A structure that carries a surface is displaced by more than a tenth of the radius, or of the extent.
    CarrierImplausible { structure: usize },
    /// A contact node moves by more than a tenth of the extent of an open surface in one step, so it could pass the surface unnoticed.
    TooFast { structure: usize },
    /// A node passes a free edge and is already behind the surface.
    BehindEdge { structure: usize, node: usize },
    /// Turning normals and curved surfaces add energy within steps that no input supplies: the added `work` (J), and
    /// the total energy `exchanged` (J).
    Unbalanced { set: usize, work: f64, exchanged: f64 },
    /// Friction, impacts or cutting, which can only dissipate energy, have supplied energy: the energy `given` since
    /// the largest loss (J), and the total energy `exchanged` (J), the reference for it.
    Gives { set: usize, loss: Loss, given: f64, exchanged: f64 },
    /// A node moves so far around the axis that the error of linear kinematics is as large as its clearance.
    Curved(Curved),
    /// A node has left a surface around an axis beyond the extrapolated part of its edge.
    OutOfReach { structure: usize, node: usize, sector: usize },
    /// A gap has changed by more than the motion of node and surface explains, so it is not a distance: its change over
    /// two steps, `jump` (m), and the change that the motion explains, `explained` (m).
    Unexplained { structure: usize, node: usize, sector: usize, jump: f64, explained: f64 },
    /// A law that checks for penetration only once keeps nodes closed although the other nodes push them away: the node
    /// with the largest pulling impulse, and this impulse as a fraction of the largest impulse of a node.
    Pulls { structure: usize, node: usize, share: f64 },
    /// A law that checks for penetration only once does not resolve a deep penetration: the node with the deepest
    /// penetration, and its depth as a fraction of the clearance.
    LeftInside { structure: usize, node: usize, share: f64 },
    /// The limit of attempted steps is exceeded.
    Exhausted,
    /// The contact problem of a sector has no solution within the pivoting limit.
    Unsolved { structure: usize, sector: usize },
}

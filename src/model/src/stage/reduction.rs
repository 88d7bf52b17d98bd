//! Reduced-order model of the bladed disk of the stage.

use super::lattice::sector_mesh;
use super::sector::{SectorMesh, SectorOptions};
use crate::cyclic::{CyclicBoundary, CyclicOptions, CyclicReduction, ModeSelection, PairingReport, reduce_cyclic};
use crate::material::Material;
use crate::progress::{Listener, ReductionStage, report};
use crate::reduce::{ContactPoint, ReductionKind};
use crate::rotor37::TipContact;
use crate::{FeModel, Result};

/// Options of the stage.
#[derive(Debug, Clone, PartialEq)]
pub struct StageOptions {
    /// Shape and mesh of a sector.
    pub sector: SectorOptions,
    /// Material.
    pub material: Material,
    /// Contact of the tip.
    pub tip: TipContact,
    /// Kind of the modes.
    pub kind: ReductionKind,
    /// Selection of modes.
    pub modes: ModeSelection,
    /// Modes per nodal diameter that are compared with the full model.
    pub checked_modes: usize,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
}

impl Default for StageOptions {
    fn default() -> Self {
        Self {
            sector: SectorOptions::default(),
            material: Material::titanium(),
            tip: TipContact::Nodes(3),
            kind: ReductionKind::FixedInterface,
            modes: ModeSelection::Families(25),
            checked_modes: 10,
            damping_ratio: 0.005,
        }
    }
}

impl StageOptions {
    /// Returns a coarse sector and few modes, for tests and trials.
    pub fn coarse() -> Self {
        Self { sector: SectorOptions::coarse(), modes: ModeSelection::Families(8), checked_modes: 5, ..Self::default() }
    }

    /// Returns the options of the reduction of the sector.
    pub fn cyclic(&self, name: impl Into<String>) -> CyclicOptions {
        CyclicOptions {
            name: name.into(),
            kind: self.kind,
            modes: self.modes,
            checked_modes: self.checked_modes,
            damping_ratio: self.damping_ratio,
        }
    }
}

/// Model of one sector with the data of its reduction.
#[derive(Debug, Clone)]
pub struct StageModel {
    /// Assembled model, including its mesh.
    pub model: FeModel,
    /// Nodes of the bore.
    pub clamped: Vec<usize>,
    /// Contact nodes or patches, leading to trailing edge.
    pub contact: Vec<ContactPoint>,
    /// Pairing of the nodes of the faces.
    pub boundary: CyclicBoundary,
    /// Quality of the pairing.
    pub pairing: PairingReport,
}

/// Tolerance of the pairing (m). Faces of a generated sector match to round-off, so it only has to distinguish nodes.
const TOLERANCE: f64 = 1e-9;

/// Meshes and assembles a sector of the stage.
///
/// # Errors
/// The errors of [`sector_mesh`] and of the assembly; more contact nodes or patches than the tip has places for.
pub fn stage_model(options: &StageOptions, listener: Listener<'_>) -> Result<StageModel> {
    report(listener, ReductionStage::Mesh, 0, 1);
    let sector: SectorMesh = sector_mesh(&options.sector)?;
    let contact = match options.tip {
        TipContact::Nodes(count) => sector.contact_points(count)?,
        TipContact::Patches(count) => sector.contact_patches(count)?,
        TipContact::Rows(counts) => sector.contact_rows(counts)?,
    };
    report(listener, ReductionStage::Mesh, 1, 1);
    let origin = format!("Parametric stage of {} sectors, bore clamped", options.sector.geometry.sectors);
    let model = FeModel::assembled(sector.mesh, &options.material, origin, listener)?;
    let [low, high] = ["CYCLIC_LOW", "CYCLIC_HIGH"].map(|face| model.set(face));
    let (boundary, pairing) =
        CyclicBoundary::pair(&model.nodes, low?, high?, options.sector.geometry.sectors, TOLERANCE)?;
    let clamped = model.set("CLAMPED")?.to_vec();
    Ok(StageModel { model, clamped, contact, boundary, pairing })
}

/// Builds, reduces and checks the bladed disk of the stage.
///
/// # Errors
/// The errors of [`stage_model`] and [`reduce_cyclic`].
pub fn reduce_stage(options: &StageOptions, listener: Listener<'_>) -> Result<CyclicReduction> {
    let stage = stage_model(options, listener)?;
    let cyclic = options.cyclic("stage");
    let StageModel { model, clamped, contact, boundary, .. } = &stage;
    reduce_cyclic(model, clamped, contact, boundary, &cyclic, listener)
}

//! Blade of NASA rotor 37: geometry, mesh and reduced model.
//!
//! **Origin.** Moore and Reid, *Performance of single-stage axial-flow transonic compressor with rotor and stator
//! aspect ratios of 1.19 and 1.26, respectively, and with design pressure ratio of 2.05*, NASA TP-1659 (1980), table
//! IV: 12 surfaces of revolution from the hub intersection to the blade tip, 100 stations each. The program contains
//! a fit, [`AerofoilSection`], not the table. Over all 2400 points of the table, round edges included, its distance
//! from the surface is at most [`FIT_DISTANCE`] (0.0094 mm), and on the sides [`FIT_ALONG_THETA`] (0.0165 mm) along
//! rθ at equal z. The table has no data between the sections; lines of equal fractions of chord and thickness are
//! natural cubic splines.
//!
//! **Direction of rotation.** In the table θ increases from the leading to the trailing edge, so the rotor of the
//! table turns towards negative θ. The mesh is mirrored (θ → -θ) so that its design speed is *positive* about +z.
//!
//! **Edges.** The geometry has round edges. The mesh ends in flat faces instead: as wide as the distance of the sides
//! there and π/4 of the edge radius beyond the centre of the arc, which keeps the area of the section (rectangle π/4
//! R · 2R = half disk). The first and last mesh node are therefore about 0.21 edge radii (0.03 to 0.06 mm) inside the
//! nose.

mod blade_mesh;
mod section;
mod sections;

pub use blade_mesh::{BladeMesh, MeshCounts, blade_mesh};
pub(crate) use blade_mesh::{place_name, spread_contact};
pub use section::{AerofoilSection, CylindricalPoint};

use tiprub_core::scene::rom::DisplacementFrame;

use crate::material::Material;
use crate::progress::{Listener, ReductionStage, report};
use crate::reduce::{Reduction, ReductionKind, ReductionOptions, reduce_model};
use crate::stress::StressPlaces;
use crate::{FeModel, Result};

/// Number of blades.
pub(crate) const BLADES: usize = 36;
/// Design speed (rad/s), positive about +z for the mesh of this module.
pub const DESIGN_SPEED: f64 = 1800.0;
/// Running tip clearance at design speed (m).
pub const TIP_GAP: f64 = 0.356e-3;

/// Largest distance of a point of the table from the fitted surface (m), including the error in r.
pub const FIT_DISTANCE: f64 = 9.4e-6;
/// Largest distance along rθ, at equal z, of a point on the sides of the table from the fitted sides (m).
pub const FIT_ALONG_THETA: f64 = 16.5e-6;

/// Returns the twelve sections, hub to tip.
pub fn sections() -> &'static [AerofoilSection] {
    &sections::SECTIONS
}

/// Number of watched points of a tip with patches: its edges and the middle.
const WATCHED: usize = 3;
/// Number of modes of a blade with patches whose places of largest stress are recovered.
const STRESSED: usize = 6;

/// Contact nodes or patches of the tip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TipContact {
    /// Number of nodes along the mid-thickness line, ends included (at least 2).
    Nodes(usize),
    /// Number of patches along the chord, over the whole thickness.
    Patches(usize),
    /// Number of patches along the chord and number of rows across the thickness, the outermost rows at the sides.
    Rows([usize; 2]),
}

impl TipContact {
    /// Creates patches from the numbers along the chord and of rows; one row covers the whole thickness.
    pub fn patches(counts: [usize; 2]) -> Self {
        match counts {
            [count, 1] => Self::Patches(count),
            counts => Self::Rows(counts),
        }
    }

    /// Returns the numbers of nodes or patches along the chord and of rows across the thickness.
    pub fn counts(self) -> [usize; 2] {
        match self {
            Self::Nodes(count) | Self::Patches(count) => [count, 1],
            Self::Rows(counts) => counts,
        }
    }
}

/// Options of the blade.
#[derive(Debug, Clone, PartialEq)]
pub struct Rotor37Options {
    /// Number of elements along chord, thickness and span.
    pub mesh: MeshCounts,
    /// Contact of the tip.
    pub tip: TipContact,
    /// Kind of the modes.
    pub kind: ReductionKind,
    /// Number of modes.
    pub modes: usize,
    /// Number of modes compared with the full model.
    pub checked_modes: usize,
    /// Modal damping ratio proposed with the model.
    pub damping_ratio: f64,
    /// Material.
    pub material: Material,
    /// Largest speed (rad/s) for which the effects of spin are computed; no spin if absent.
    pub spin: Option<f64>,
}

impl Default for Rotor37Options {
    /// Returns the recommended model: nine patches along the chord in two rows at the sides of the tip. The chapter
    /// on trust lists the errors of patches, rows, modes and mesh.
    fn default() -> Self {
        Self {
            mesh: MeshCounts { chord: 24, thickness: 2, span: 40 },
            tip: TipContact::Rows([9, 2]),
            kind: ReductionKind::FreeInterface,
            modes: 80,
            ..Self::paper()
        }
    }
}

impl Rotor37Options {
    /// Returns the recommended model with its patches in one row: contact is averaged over the thickness of the tip.
    pub fn one_row() -> Self {
        let [patches, _] = Self::default().tip.counts();
        Self { tip: TipContact::Patches(patches), ..Self::default() }
    }

    /// Returns the type of model of the paper: Craig-Bampton modes, three contact nodes.
    pub fn paper() -> Self {
        Self {
            mesh: MeshCounts::default(),
            tip: TipContact::Nodes(3),
            kind: ReductionKind::FixedInterface,
            modes: 20,
            checked_modes: 10,
            damping_ratio: 0.005,
            material: Material::maraging_steel(),
            spin: None,
        }
    }
}

/// Builds, reduces and checks the blade: hub section clamped, contact on the tip as chosen in the options.
///
/// # Examples
/// ```
/// # use tiprub_model::{Rotor37Options, progress::silent};
/// // The method of the paper: three contact nodes at the tip.
/// let reduction = tiprub_model::reduce_rotor37(&Rotor37Options::paper(), &silent)?;
/// assert_eq!(reduction.rom.contact_nodes.len(), 3);
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) for counts that are too small or more contact nodes than the mesh has;
/// the errors of [`reduce_model`].
pub fn reduce_rotor37(options: &Rotor37Options, listener: Listener<'_>) -> Result<Reduction> {
    report(listener, ReductionStage::Mesh, 0, 1);
    let blade = blade_mesh(options.mesh)?;
    let stressed = if let TipContact::Nodes(_) = options.tip { 0 } else { STRESSED.min(options.checked_modes) };
    let (contact, watched) = match options.tip {
        TipContact::Nodes(count) => (blade.contact_points(count)?, Vec::new()),
        TipContact::Patches(count) => (blade.contact_patches(count)?, blade.contact_points(WATCHED)?),
        TipContact::Rows(counts) => (blade.contact_rows(counts)?, blade.contact_points(WATCHED)?),
    };
    report(listener, ReductionStage::Mesh, 1, 1);
    let clamped = blade.mesh.set("hub")?.to_vec();
    let reduction_options = ReductionOptions {
        name: "rotor37".into(),
        kind: options.kind,
        modes: options.modes,
        checked_modes: options.checked_modes,
        sectors: BLADES,
        frame: DisplacementFrame::Cylindrical,
        watched,
        stress: StressPlaces { nodes: Vec::new(), modes: stressed },
        damping_ratio: options.damping_ratio,
    };
    let model = FeModel::assembled(blade.mesh, &options.material, String::new(), listener)?;
    let mut reduction = reduce_model(model, &clamped, &contact, &reduction_options, options.spin, listener)?;
    reduction.rom.origin = format!(
        "Blade of NASA rotor 37 (fit of the coordinates of NASA TP-1659), hub clamped: {}",
        reduction.rom.origin
    );
    Ok(reduction)
}

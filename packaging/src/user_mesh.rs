//! Finite-element models of the user: read, checked, reduced, described.

mod choose;
mod describe;
mod judge;

pub use judge::{narrow, narrow_rows};

use std::{
    cell::RefCell,
    fmt::Write as _,
    path::{Path, PathBuf},
};

use choose::Chosen;
use tiprub_core::scene::rom::DisplacementFrame;
use tiprub_gallery::reduction::{self, with_progress};
use tiprub_model::{
    CasingOptions, FeModel, Material, Mesh, Reduction,
    casing::{self, CasingReductionOptions},
    cyclic::{CyclicOptions, ModeSelection, reduce_cyclic},
    element::Formulation,
    read::{Imported, MatrixFiles, MeshOptions, bounding_box, read_matrices, read_mesh},
    reduce::ReductionOptions,
    reduce_casing, reduce_model,
    rotor37::TipContact,
    thermal::equal_patches,
};
use tiprub_shell::{Failure, Result, console::Console};
use tiprub_study::convergence::refine::{self, Meshed};

use crate::shared_arguments::KindChoice;
use crate::{
    mesh_arguments::{
        BladeOptions, CasingMeshArguments, FromMesh, KeptOptions, MeshSource, ModelOptions, SectorArguments, TipOptions,
    },
    reduced::ReducedModel,
};

/// Defaults: number of modes, with patches up to the number that fine meshes permit, number of modes compared with the full model, damping ratio.
pub const MODES: usize = 25;
const MOST_MODES: usize = 80;
/// Degrees of freedom of the full model per mode with patches, because the highest modes of a coarse mesh are meaningless.
const PER_MODE: usize = 40;
const CHECKED_MODES: usize = 10;
const DAMPING: f64 = 0.005;

/// Names of the sets of all clamped nodes and of the two faces in exported files.
const CLAMPED: &str = casing::CLAMPED;
const FACES: [&str; 2] = ["CYCLIC_LOW", "CYCLIC_HIGH"];

/// Reduces blades on a rigid hub.
///
/// # Errors
/// Files or sets are wrong (the error names file, line and remedy), or the reduction fails.
pub fn blade(
    file: Option<&Path>,
    options: &BladeOptions,
    (tips, kept): (&TipOptions, KeptOptions),
    console: &Console,
) -> Result<ReducedModel> {
    let source = options.source(file, kept);
    let imported = import(&source, console)?;
    let choose = |imported: &Imported| {
        Ok(Chosen { stress: choose::stress(imported, options)?, ..choose::tips(imported, source.model, tips, None)? })
    };
    reduce_clamped(&source, imported, choose, |model, chosen, clamped| {
        Ok(ReducedModel::general(general(&source, options, model, chosen, console)?, clamped))
    })
}

/// Source of a ROM of blades: a mesh or matrices with the options of its reduction.
pub struct BladeSource<'a> {
    /// Mesh file.
    pub file: Option<&'a Path>,
    /// Other meshes of the same blade, with the same sets.
    pub others: &'a [PathBuf],
    /// Options.
    pub options: &'a BladeOptions,
}

impl<'a> BladeSource<'a> {
    /// Creates the source from the command line.
    pub fn of(from: &'a FromMesh) -> Self {
        Self { file: from.file.as_deref(), others: &from.others, options: &from.blade }
    }
}

impl refine::RomSource for BladeSource<'_> {
    fn reduce(&self, other: Option<usize>, modes: usize, tip: TipContact, console: &Console) -> Result<Meshed> {
        let [count, rows] = tip.counts();
        let tips = match tip {
            TipContact::Nodes(_) => TipOptions { contact_nodes: Some(count), ..TipOptions::default() },
            TipContact::Patches(_) | TipContact::Rows(_) => {
                TipOptions { contact_patches: Some(count), contact_rows: Some(rows), ..TipOptions::default() }
            }
        };
        let kept = KeptOptions { modes: Some(modes), ..KeptOptions::default() };
        let file = other.and_then(|other| self.others.get(other)).map(PathBuf::as_path).or(self.file);
        let found = blade(file, self.options, (&tips, kept), console)?;
        Ok(Meshed { rom: found.rom, nodes: found.nodes })
    }

    fn others(&self) -> usize {
        self.others.len()
    }
}

/// Reduces a disk of coupled sectors.
///
/// # Errors
/// The errors of [`blade`].
pub fn sector(options: &SectorArguments, console: &Console) -> Result<ReducedModel> {
    let source = options.source();
    let imported = import(&source, console)?;
    let choose = |imported: &Imported| choose::tips(imported, source.model, &options.tips, Some(options));
    reduce_clamped(&source, imported, choose, |model, chosen, clamped| {
        cyclic((&source, options), model, chosen, clamped, console)
    })
}

/// Reduces a casing whose contact nodes form a grid.
///
/// # Errors
/// The errors of [`blade`], or a mesh with several materials.
pub fn casing(options: &CasingMeshArguments, console: &Console) -> Result<ReducedModel> {
    let source = options.source();
    let imported = import(&source, console)?;
    let materials = imported.materials.len();
    let choose = |imported: &Imported| choose::grid(imported, options);
    reduce_clamped(&source, imported, choose, |model, chosen, clamped| {
        if materials != 1 {
            return Err(no_mesh());
        }
        Ok(ReducedModel::general(ring(&source, options, model, chosen, console)?, clamped))
    })
}

/// Reads a casing of one material for its heat conduction: mesh, material, the nodes of its contact set if one is named, warnings.
///
/// # Errors
/// The errors of [`blade`], or a mesh with several materials.
pub fn conducting(file: &Path, options: &ModelOptions, console: &Console) -> Result<ConductingMesh> {
    let imported = import(&MeshSource::mesh(file, options), console)?;
    let mut warnings = imported.warnings.clone();
    warnings.extend(judge::judge(&imported, options)?);
    let set =
        options.contact_set.as_deref().map(|name| choose::nodes_of(&imported, name, "--contact-set")).transpose()?;
    let Some((mesh, material)) = imported.model.mesh else { return Err(no_mesh()) };
    Ok(ConductingMesh { mesh, material, set: set.map(|(nodes, _)| nodes), warnings })
}

/// Input of [`conducting`].
pub struct ConductingMesh {
    /// Mesh.
    pub mesh: Mesh,
    /// Material of all its elements.
    pub material: Material,
    /// Nodes of the inner surface, if a set is named.
    pub set: Option<Vec<usize>>,
    /// Unusual properties.
    pub warnings: Vec<String>,
}

fn no_mesh() -> Failure {
    let problem = "a casing requires a mesh of one material";
    Failure::usage("mesh", problem, "Give a mesh file whose elements share one material")
}

/// Checks the model, chooses the nodes, reduces with the set of clamped nodes, and describes the result.
fn reduce_clamped(
    source: &MeshSource,
    imported: Imported,
    choose: impl FnOnce(&Imported) -> Result<Chosen>,
    reduce: impl FnOnce(FeModel, &Chosen, Option<&str>) -> Result<ReducedModel>,
) -> Result<ReducedModel> {
    let mut warnings = imported.warnings.clone();
    warnings.extend(judge::judge(&imported, source.model)?);
    let chosen = choose(&imported)?;
    let read = describe::describe(&imported, source.model, &chosen);
    let slips = judge::radius_slip(&imported, &chosen).into_iter().collect();
    warnings.extend(judge::contact_warnings(&chosen));
    warnings.extend(judge::set_warnings(source.model, &chosen));
    let mut model = imported.model;
    let clamped = (!chosen.clamped.is_empty()).then_some(CLAMPED);
    if let Some((mesh, _)) = model.mesh.as_mut().filter(|_| clamped.is_some()) {
        mesh.sets.insert(CLAMPED.to_owned(), chosen.clamped.clone());
    }
    let mut reduced = reduce(model, &chosen, clamped)?;
    let notes = core::mem::replace(&mut reduced.read, read).0;
    for note in notes.lines() {
        let _ = write!(reduced.read.0, "\n  note: {note}");
    }
    warnings.extend(judge::frequency_warning(&reduced.rom, clamped.is_none()));
    (reduced.warnings, reduced.slips) = (warnings, slips);
    Ok(reduced)
}

fn general(
    source: &MeshSource,
    options: &BladeOptions,
    model: FeModel,
    chosen: &Chosen,
    console: &Console,
) -> Result<Reduction> {
    let name = source.name();
    let title = format!("Reducing {name}");
    let reduction = ReductionOptions {
        name,
        kind: KindChoice::kind(options.kind, has_patches(chosen)),
        modes: source.kept.modes.unwrap_or_else(|| default_modes(&model, has_patches(chosen))),
        checked_modes: CHECKED_MODES,
        sectors: options.sectors.unwrap_or(1) as usize,
        frame: DisplacementFrame::Cylindrical,
        watched: choose::watched(&model, &chosen.contact)?,
        stress: chosen.stress.clone(),
        damping_ratio: source.kept.damping.unwrap_or(DAMPING),
    };
    let model = RefCell::new(Some(model));
    with_progress(&title, console, &|listener| {
        // The matrices are moved, not copied.
        let model = model.take().ok_or_else(|| tiprub_model::Error::invalid("model", "it is already reduced", ""))?;
        reduce_model(model, &chosen.clamped, &chosen.contact, &reduction, options.spin, listener)
    })
}

fn default_modes(model: &FeModel, patches: bool) -> usize {
    if patches { (3 * model.nodes.len() / PER_MODE).clamp(MODES, MOST_MODES) } else { MODES }
}

fn ring(
    source: &MeshSource,
    options: &CasingMeshArguments,
    model: FeModel,
    chosen: &Chosen,
    console: &Console,
) -> Result<Reduction> {
    let (Some((mesh, mut material)), Some(grid)) = (model.mesh, &chosen.grid) else { return Err(no_mesh()) };
    material.expansion = options.expansion.unwrap_or(material.expansion);
    let [low, high] = bounding_box(&mesh.nodes);
    let [around, along] = options.patches.unwrap_or([0, 0]);
    let patches = equal_patches(around, along, [low[2], high[2]]);
    let name = source.name();
    let title = format!("Reducing {name}");
    let defaults = CasingOptions::default();
    let options = CasingReductionOptions {
        name,
        formulation: Formulation::Displacement,
        fixed_interface_modes: options.fixed_interface_modes.unwrap_or(defaults.fixed_interface_modes),
        modes: source.kept.modes.unwrap_or(defaults.modes),
        checked_modes: CHECKED_MODES,
        damping_ratio: source.kept.damping.unwrap_or(DAMPING),
    };
    let mesh = RefCell::new(Some(mesh));
    with_progress(&title, console, &|listener| {
        let mesh = mesh.take().ok_or_else(|| tiprub_model::Error::invalid("model", "it is already reduced", ""))?;
        reduce_casing(mesh, &material, &chosen.clamped, grid, &patches, &options, listener)
    })
}

fn has_patches(chosen: &Chosen) -> bool {
    chosen.contact.iter().any(|point| !point.patch.is_empty())
}

fn cyclic(
    (source, options): (&MeshSource, &SectorArguments),
    model: FeModel,
    chosen: &Chosen,
    clamped: Option<&str>,
    console: &Console,
) -> Result<ReducedModel> {
    let Some((boundary, _)) = &chosen.faces else {
        return Err(Failure::new("sector", "its faces were not paired", "Report this to the developers"));
    };
    let name = source.name();
    let title = format!("Reducing {name}");
    let options = CyclicOptions {
        name,
        kind: KindChoice::kind(options.kind, has_patches(chosen)),
        modes: ModeSelection::Families(source.kept.modes.unwrap_or(MODES)),
        checked_modes: CHECKED_MODES,
        damping_ratio: source.kept.damping.unwrap_or(DAMPING),
    };
    let reduction = with_progress(&title, console, &|listener| {
        reduce_cyclic(&model, &chosen.clamped, &chosen.contact, boundary, &options, listener)
    })?;
    let nodes = model.nodes.len();
    let mut mesh = model.mesh;
    if let Some((mesh, _)) = &mut mesh {
        for (face, side) in FACES.iter().zip([0, 1]) {
            let mut face_nodes: Vec<usize> = boundary.pairs.iter().map(|pair| pair[side]).collect();
            face_nodes.sort_unstable();
            mesh.sets.insert((*face).to_owned(), face_nodes);
        }
    }
    Ok(ReducedModel::cyclic(reduction, mesh, nodes, clamped, FACES))
}

fn import(source: &MeshSource, console: &Console) -> Result<Imported> {
    let (options, material) = (source.model, source.material());
    let matrices = source.matrices.and_then(|own| Some((own, own.stiffness.as_ref()?, own.mass.as_ref()?)));
    let Some((matrices, stiffness, mass)) = matrices else {
        let Some(path) = source.file else {
            return Err(Failure::usage("mesh", "no file is given", "Give a mesh file, or --stiffness and --mass"));
        };
        let options =
            MeshOptions { units: options.units(), axis: options.axis(), material, temperature: options.temperature };
        let title = format!("Reading {}", path.display());
        return with_progress(&title, console, &|listener| read_mesh(path, &options, listener));
    };
    let Some(nodes) = matrices.nodes.as_deref().or(source.file) else {
        let remedy = "Give --nodes FILE (lines NODE,X,Y,Z,SETS) or the mesh file of the model";
        return Err(Failure::usage("--stiffness", "the positions of the nodes are missing", remedy));
    };
    let files = MatrixFiles {
        stiffness: stiffness.clone(),
        mass: mass.clone(),
        nodes: nodes.to_path_buf(),
        dofs: matrices.dofs.clone(),
        units: options.units(),
        axis: options.axis(),
        left_out: options.clamp_set.clone(),
    };
    console.print_progress(format_args!("Reading {} and {}", stiffness.display(), mass.display()));
    read_matrices(&files).map_err(failure)
}

fn failure(error: tiprub_model::Error) -> Failure {
    reduction::failure("model", error)
}

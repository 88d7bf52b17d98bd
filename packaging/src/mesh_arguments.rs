//! Options of `tiprub reduce blade`, `sector` and `casing-mesh`: finite-element models of the user.

mod included;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use tiprub_model::{
    Material,
    read::{EngineAxis, Units},
};
use tiprub_shell::{Failure, Result, places::NamedFile};
use tiprub_study::arguments::{ConvergenceArguments, ErrorArguments};

use crate::shared_arguments::{KindChoice, MaterialChoice, OutputArguments, axial, pair};

/// Arguments of `tiprub reduce blade`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct BladeArguments {
    /// Mesh file: CalculiX/Abaqus (.inp) or Gmsh 4.1 (.msh). With --stiffness, only its nodes and
    /// sets are used.
    #[arg(value_name = "FILE", required_unless_present = "stiffness")]
    pub file: Option<PathBuf>,
    /// Contact nodes.
    #[command(flatten)]
    pub tips: TipOptions,
    /// Input options.
    #[command(flatten)]
    pub blade: BladeOptions,
    /// Reduction options.
    #[command(flatten)]
    pub kept: KeptOptions,
    /// Output options.
    #[command(flatten)]
    pub written: OutputArguments,
}

/// Input of blades.
#[derive(Debug, Clone, PartialEq, Default, Args)]
pub struct BladeOptions {
    /// Number of uncoupled blades around the axis [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub sectors: Option<u32>,
    /// Also compute the effects of spin (stiffening, growth, Coriolis force) up to this speed (rad/s); requires a mesh.
    #[arg(long, value_name = "SPEED", value_parser = positive, allow_negative_numbers = true, conflicts_with = "stiffness")]
    pub spin: Option<f64>,
    /// Kind of modes to keep [default: craig-bampton; free-interface with patches].
    #[arg(long, value_enum)]
    pub kind: Option<KindChoice>,
    /// Recover stress where it is largest, away from clamped nodes, in each of the N lowest modes; requires
    /// a mesh of one material [default: 0].
    #[arg(long, value_name = "N", conflicts_with = "stiffness")]
    pub stress_modes: Option<usize>,
    /// Nodes where stress is recovered: a set, or node numbers in the file such as 12,57,103.
    #[arg(long, value_name = "SET", conflicts_with = "stiffness")]
    pub stress_set: Option<String>,
    /// Input options.
    #[command(flatten)]
    pub model: ModelOptions,
    /// Matrices.
    #[command(flatten)]
    pub matrices: MatrixOptions,
}

/// Arguments of `tiprub study convergence`.
#[derive(Debug, Args)]
pub struct ConvergenceCommand {
    /// Scene and window.
    #[command(flatten)]
    pub study: ConvergenceArguments,
    /// Where the ROM is from.
    #[command(flatten)]
    pub from: FromMesh,
}

/// Arguments of `tiprub study error`.
#[derive(Debug, Args)]
pub struct ErrorCommand {
    /// Scene and window.
    #[command(flatten)]
    pub study: ErrorArguments,
    /// Where the ROM is from.
    #[command(flatten)]
    pub from: FromMesh,
}

/// Where the ROM of a scene is from.
#[derive(Debug, Args)]
pub struct FromMesh {
    /// Mesh (or, with --stiffness, nodes and sets) from which the ROM of the blades was reduced, with the options of
    /// `tiprub reduce blade`. The study then also tries more modes and other contact nodes.
    #[arg(long = "mesh", value_name = "FILE", help_heading = MESH)]
    pub file: Option<PathBuf>,
    /// Coarser or finer mesh of the same blades, with the same sets and units, to show the effect of the mesh. May be
    /// repeated; the error of the mesh requires two or more.
    #[arg(long = "other-mesh", value_name = "FILE", help_heading = MESH, requires = "file", conflicts_with = "stiffness")]
    pub others: Vec<PathBuf>,
    /// Options of the blade.
    #[command(flatten, next_help_heading = MESH)]
    pub blade: BladeOptions,
}

const MESH: &str = "Source of the ROM, as for `tiprub reduce blade`";

impl FromMesh {
    /// Returns whether a mesh or matrices are given.
    ///
    /// # Errors
    /// There are options of a mesh without a mesh.
    pub fn is_given(&self) -> Result<bool> {
        let given = self.file.is_some() || self.blade.matrices.stiffness.is_some();
        if given || self.blade == BladeOptions::default() {
            return Ok(given);
        }
        let problem = "an option describes a mesh, but no mesh is given";
        Err(Failure::usage("--mesh", problem, "Give --mesh FILE, or omit the options of `tiprub reduce blade`"))
    }

    /// Returns all files that are read.
    pub fn files(&self) -> Vec<NamedFile> {
        let own = self.blade.source(self.file.as_deref(), KeptOptions::default()).files();
        own.into_iter().chain(self.others.iter().map(|path| NamedFile::new("--other-mesh", path))).collect()
    }
}

/// Arguments of `tiprub reduce sector`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct SectorArguments {
    /// Mesh file of one sector: CalculiX/Abaqus (.inp) or Gmsh 4.1 (.msh). With --stiffness, only its nodes and
    /// sets are used.
    #[arg(value_name = "FILE", required_unless_present = "stiffness")]
    pub file: Option<PathBuf>,
    /// Number of sectors of the disk.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub sectors: u32,
    /// Face of the sector towards its lower neighbour (the one at the smaller angle).
    #[arg(long, value_name = "SET")]
    pub cyclic_low: String,
    /// Face of the sector towards its upper neighbour.
    #[arg(long, value_name = "SET")]
    pub cyclic_high: String,
    /// Largest distance (m) between a node of the upper face and the rotated node of the lower face [default: 1e-5 of
    /// the largest radius].
    #[arg(long, value_name = "M", value_parser = positive)]
    pub cyclic_tolerance: Option<f64>,
    /// Kind of modes to keep per nodal diameter [default: craig-bampton; free-interface with patches].
    #[arg(long, value_enum)]
    pub kind: Option<KindChoice>,
    /// Contact nodes.
    #[command(flatten)]
    pub tips: TipOptions,
    /// Input options.
    #[command(flatten)]
    pub model: ModelOptions,
    /// Matrices.
    #[command(flatten)]
    pub matrices: MatrixOptions,
    /// Reduction options.
    #[command(flatten)]
    pub kept: KeptOptions,
    /// Output options.
    #[command(flatten)]
    pub written: OutputArguments,
}

/// Arguments of `tiprub reduce casing-mesh`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct CasingMeshArguments {
    /// Mesh file of one material: CalculiX/Abaqus (.inp) or Gmsh 4.1 (.msh).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Contact nodes around the circumference and along the axis.
    #[arg(long, value_name = "AxL", value_parser = pair)]
    pub contact_grid: [usize; 2],
    /// Axial positions of the first and the last contact ring (m) [default: those of the contact set].
    #[arg(long, value_name = "FROM:TO", value_parser = axial, allow_hyphen_values = true)]
    pub contact_axial: Option<[f64; 2]>,
    /// Thermal patches around the circumference and along the axis [default: none].
    #[arg(long, value_name = "AxL", value_parser = pair)]
    pub patches: Option<[usize; 2]>,
    /// Coefficient of linear thermal expansion (1/K), instead of the material's.
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub expansion: Option<f64>,
    /// Number of fixed-interface modes used for the reduction; `--modes` is the number of modes kept in the ROM
    /// [default: 156].
    #[arg(long, value_name = "N")]
    pub fixed_interface_modes: Option<usize>,
    /// Input options.
    #[command(flatten)]
    pub model: ModelOptions,
    /// Reduction options.
    #[command(flatten)]
    pub kept: KeptOptions,
    /// Output options.
    #[command(flatten)]
    pub written: OutputArguments,
}

/// Contact nodes of blades.
#[derive(Debug, Clone, PartialEq, Default, Args)]
pub struct TipOptions {
    /// Number of contact nodes, chosen evenly along the chord from the contact set or the tip; replaces the patches.
    #[arg(long, value_name = "N")]
    pub contact_nodes: Option<usize>,
    /// Number of patches along the chord into which the faces of the contact set or the tip are divided [default: 9,
    /// fewer if the elements are wider; none for a contact set of at most 12 nodes, which are then the contact nodes].
    #[arg(long, value_name = "N", conflicts_with = "contact_nodes")]
    pub contact_patches: Option<usize>,
    /// Rows of patches across the thickness, from side to side; with two or more, the sides of a tilted tip touch
    /// separately [default: 2; 1 if the mesh is too coarse for two].
    #[arg(long, value_name = "R", conflicts_with = "contact_nodes")]
    pub contact_rows: Option<usize>,
    /// Names of the contact nodes or patches along the chord, in order of increasing z; patches in rows are named
    /// NAME_row_1, NAME_row_2, ... [default: tip_1,tip_2,... and patch_1,patch_2,...].
    #[arg(long, value_name = "NAME,NAME,...", value_delimiter = ',', value_parser = identifier)]
    pub contact_names: Vec<String>,
}

/// Options of every user mesh.
#[derive(Debug, Clone, PartialEq, Default, Args)]
pub struct ModelOptions {
    /// Set of nodes that can touch. A set of more than 12 nodes is a tip, with contact on patches; the nodes of a
    /// smaller set are the contact nodes, as are nodes given by their numbers in the file, such as 12,57,103. Without
    /// this option, the tip of a blade mesh is detected as its outermost faces.
    #[arg(long, value_name = "SET")]
    pub contact_set: Option<String>,
    /// Set of clamped nodes, or their numbers in the file; may be repeated. `none`: the structure is a free body.
    #[arg(long, value_name = "SET")]
    pub clamp_set: Vec<String>,
    /// Units of the file; values on the command line are always in SI units [default: m].
    #[arg(long, value_enum)]
    pub units: Option<UnitChoice>,
    /// Engine axis in the file; the other axes follow in cyclic order [default: z].
    #[arg(long, value_enum)]
    pub axis: Option<AxisChoice>,
    /// Material of all elements, instead of that in the file.
    #[arg(long, value_enum, conflicts_with = "young")]
    pub material: Option<MaterialChoice>,
    /// Young's modulus (Pa) of all elements, instead of the material in the file.
    #[arg(long, value_name = "E", value_parser = positive, requires = "poisson", requires = "density")]
    pub young: Option<f64>,
    /// Poisson's ratio of all elements.
    #[arg(long, value_name = "NU", value_parser = poisson, requires = "young", allow_negative_numbers = true)]
    pub poisson: Option<f64>,
    /// Density (kg/m³) of all elements.
    #[arg(long, value_name = "RHO", value_parser = positive, requires = "young")]
    pub density: Option<f64>,
    /// Temperature at which the material tables of the file are evaluated, in the unit of the file.
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub temperature: Option<f64>,
}

/// Reduction options of a user mesh.
#[derive(Debug, Clone, PartialEq, Default, Args)]
pub struct KeptOptions {
    /// Number of modes kept [default: 25 for blades, up to 80 with patches; 25 per nodal diameter for a disk; 60 for a
    /// casing].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Default modal damping ratio of the model [default: 0.005].
    #[arg(long, value_name = "RATIO", value_parser = share)]
    pub damping: Option<f64>,
    /// Name of the structure [default: name of the file].
    #[arg(long, value_name = "NAME", value_parser = model_name)]
    pub name: Option<String>,
}

/// Matrices instead of a mesh.
#[derive(Debug, Clone, PartialEq, Default, Args)]
pub struct MatrixOptions {
    /// Stiffness matrix (Matrix Market, CalculiX .sti or Abaqus text). Nodes and sets are those of the mesh FILE, if
    /// given.
    #[arg(long, value_name = "FILE", requires = "mass", conflicts_with_all = ["material", "young"])]
    pub stiffness: Option<PathBuf>,
    /// Mass matrix, in the same format.
    #[arg(long, value_name = "FILE", requires = "stiffness")]
    pub mass: Option<PathBuf>,
    /// Table of the nodes of the matrices, with lines `NODE,X,Y,Z[,SETS]`, instead of a mesh file.
    #[arg(long, value_name = "FILE", requires = "stiffness", conflicts_with = "file")]
    pub nodes: Option<PathBuf>,
    /// CalculiX's list of degrees of freedom [default: the stiffness file with the extension .dof].
    #[arg(long, value_name = "FILE", requires = "stiffness")]
    pub dofs: Option<PathBuf>,
}

/// Input for a user mesh of any kind.
#[derive(Debug, Clone)]
pub struct MeshSource<'a> {
    /// Mesh file.
    pub file: Option<&'a Path>,
    /// Options.
    pub model: &'a ModelOptions,
    /// Matrices, if the command accepts them.
    pub matrices: Option<&'a MatrixOptions>,
    /// Reduction options.
    pub kept: KeptOptions,
}

impl BladeArguments {
    /// Returns the input.
    pub fn source(&self) -> MeshSource<'_> {
        self.blade.source(self.file.as_deref(), self.kept.clone())
    }
}

impl BladeOptions {
    /// Returns the input, with this mesh file.
    pub fn source<'a>(&'a self, file: Option<&'a Path>, kept: KeptOptions) -> MeshSource<'a> {
        MeshSource { file, model: &self.model, matrices: Some(&self.matrices), kept }
    }
}

impl SectorArguments {
    /// Returns the input.
    pub fn source(&self) -> MeshSource<'_> {
        let file = self.file.as_deref();
        MeshSource { file, model: &self.model, matrices: Some(&self.matrices), kept: self.kept.clone() }
    }
}

impl CasingMeshArguments {
    /// Returns the input.
    pub fn source(&self) -> MeshSource<'_> {
        MeshSource { file: Some(&self.file), model: &self.model, matrices: None, kept: self.kept.clone() }
    }
}

impl<'a> MeshSource<'a> {
    /// Creates the input for a mesh alone.
    pub fn mesh(file: &'a Path, model: &'a ModelOptions) -> Self {
        Self { file: Some(file), model, matrices: None, kept: KeptOptions::default() }
    }
}

impl MeshSource<'_> {
    /// Returns the name of the model.
    pub fn name(&self) -> String {
        if let Some(name) = &self.kept.name {
            return name.clone();
        }
        let stiffness = self.matrices.and_then(|matrices| matrices.stiffness.as_deref());
        let stem = self.file.or(stiffness).and_then(Path::file_stem);
        stem.map_or_else(|| "model".to_owned(), |stem| stem.to_string_lossy().into_owned())
    }

    /// Returns all files that are read.
    pub fn files(&self) -> Vec<NamedFile> {
        let mesh = self.file.map(|path| NamedFile::new("the mesh", path));
        let mut parts = Vec::new();
        self.file.iter().for_each(|path| included::collect(path, &mut parts));
        let parts = parts.into_iter().map(|path| NamedFile::new("a file that the mesh includes,", path));
        let matrices = self.matrices.into_iter().flat_map(|own| {
            // Without --dofs, the list beside CalculiX's stiffness file is read.
            let storage = own.stiffness.as_ref().filter(|path| path.extension().is_some_and(|kind| kind == "sti"));
            let dofs = own.dofs.clone().or(storage.map(|path| path.with_extension("dof")));
            let all = [
                ("--stiffness", own.stiffness.clone()),
                ("--mass", own.mass.clone()),
                ("--nodes", own.nodes.clone()),
                ("--dofs", dofs),
            ];
            all.into_iter().filter_map(|(role, path)| NamedFile::option(role, &path))
        });
        mesh.into_iter().chain(parts).chain(matrices).collect()
    }

    /// Returns the material of the command line, if any.
    pub fn material(&self) -> Option<Material> {
        let own = self.model;
        let of_numbers = |((young_modulus, poisson_ratio), density)| Material {
            name: "user".into(),
            young_modulus,
            poisson_ratio,
            density,
            expansion: 0.0,
        };
        let numbers = own.young.zip(own.poisson).zip(own.density).map(of_numbers);
        own.material.map(MaterialChoice::material).or(numbers)
    }
}

/// Units by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum UnitChoice {
    /// mm, t, s, N, MPa.
    #[value(name = "mm-t-s")]
    MillimetreTonneSecond,
    /// m, kg, s, N, Pa: values are accepted as they are, however unusual.
    #[value(name = "m")]
    Metre,
}

/// Axes by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum AxisChoice {
    /// x: the file's y, z, x become x, y, z.
    X,
    /// y: the file's z, x, y become x, y, z.
    Y,
    /// z: the axes are unchanged.
    Z,
}

impl ModelOptions {
    /// Returns the engine axis in the file.
    pub fn axis(&self) -> EngineAxis {
        match self.axis {
            Some(AxisChoice::X) => EngineAxis::X,
            Some(AxisChoice::Y) => EngineAxis::Y,
            Some(AxisChoice::Z) | None => EngineAxis::Z,
        }
    }

    /// Returns the units of the file.
    pub fn units(&self) -> Units {
        match self.units {
            Some(UnitChoice::MillimetreTonneSecond) => Units::MillimetreTonneSecond,
            Some(UnitChoice::Metre) | None => Units::Si,
        }
    }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("give a positive number in SI units".into()),
    }
}

fn poisson(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > -1.0 && value < 0.5 => Ok(value),
        _ => Err("give a number above -1 and below 0.5".into()),
    }
}

/// Checks a part of variable names.
fn identifier(text: &str) -> Result<String, String> {
    let starts_well = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    if starts_well && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
        return Ok(text.to_owned());
    }
    Err("use letters, digits and underscores, not starting with a digit; the name is part of variable names".into())
}

/// Checks a part of a file name.
pub(crate) fn model_name(text: &str) -> Result<String, String> {
    if text.is_empty() || text.contains(['/', '\\']) || text.starts_with('.') {
        return Err("give a plain name without a path; set the path of the output file with -o".into());
    }
    Ok(text.to_owned())
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..1.0).contains(&value) => Ok(value),
        _ => Err("give a number from 0 to less than 1".into()),
    }
}

//! Options of `tiprub reduce blade`, `sector` and `casing-mesh`: finite-element models of one's own.

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
    /// Mesh file: CalculiX/Abaqus (.inp) or Gmsh 4.1 (.msh). With --stiffness its nodes and sets are taken.
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
    /// Also compute the effects of spin (stiffening, growth, Coriolis force) up to this speed (rad/s); from a mesh only.
    #[arg(long, value_name = "SPEED", value_parser = positive, allow_negative_numbers = true, conflicts_with = "stiffness")]
    pub spin: Option<f64>,
    /// Which modes are kept [default: craig-bampton; free-interface with patches].
    #[arg(long, value_enum)]
    pub kind: Option<KindChoice>,
    /// Number of lowest modes at whose places of largest stress, away from clamped nodes, stress is recovered; from a mesh of one material
    /// only [default: 0].
    #[arg(long, value_name = "N", conflicts_with = "stiffness")]
    pub stress_modes: Option<usize>,
    /// Nodes where stress is recovered: a set, or numbers of nodes in the file, such as 12,57,103.
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
    /// Mesh (or, with --stiffness, nodes and sets) that the ROM of the blades was reduced from, with the options of `tiprub reduce
    /// blade`: more modes and other contact nodes are then tried.
    #[arg(long = "mesh", value_name = "FILE", help_heading = MESH)]
    pub file: Option<PathBuf>,
    /// Another mesh of the same blades, coarser or finer, with the same sets, in the same units: what meshes change is then told. May be
    /// repeated; two or more let the error of the mesh be read.
    #[arg(long = "other-mesh", value_name = "FILE", help_heading = MESH, requires = "file", conflicts_with = "stiffness")]
    pub others: Vec<PathBuf>,
    /// Options of the blade.
    #[command(flatten, next_help_heading = MESH)]
    pub blade: BladeOptions,
}

const MESH: &str = "Where the ROM is from, as for `tiprub reduce blade`";

impl FromMesh {
    /// Whether a mesh or matrices are given.
    ///
    /// # Errors
    /// Options of a mesh without one.
    pub fn is_given(&self) -> Result<bool> {
        let given = self.file.is_some() || self.blade.matrices.stiffness.is_some();
        if given || self.blade == BladeOptions::default() {
            return Ok(given);
        }
        let problem = "an option given describes a mesh, and there is none";
        Err(Failure::usage("--mesh", problem, "Give --mesh FILE, or leave the options of `tiprub reduce blade` out"))
    }

    /// All files that are read.
    pub fn files(&self) -> Vec<NamedFile> {
        let own = self.blade.source(self.file.as_deref(), KeptOptions::default()).files();
        own.into_iter().chain(self.others.iter().map(|path| NamedFile::new("--other-mesh", path))).collect()
    }
}

/// Arguments of `tiprub reduce sector`.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct SectorArguments {
    /// Mesh file of one sector: CalculiX/Abaqus (.inp) or Gmsh 4.1 (.msh). With --stiffness its nodes and sets are taken.
    #[arg(value_name = "FILE", required_unless_present = "stiffness")]
    pub file: Option<PathBuf>,
    /// Number of sectors of the disk.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub sectors: u32,
    /// Face of the sector towards its lower neighbour (smaller angle).
    #[arg(long, value_name = "SET")]
    pub cyclic_low: String,
    /// Face of the sector towards its upper neighbour.
    #[arg(long, value_name = "SET")]
    pub cyclic_high: String,
    /// Largest distance (m) of a node of the upper face from the turned one of the lower face [default: 1e-5 of the
    /// largest radius].
    #[arg(long, value_name = "M", value_parser = positive)]
    pub cyclic_tolerance: Option<f64>,
    /// Which modes are kept, per nodal diameter [default: craig-bampton; free-interface with patches].
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
    /// Axial positions of the first and the last contact ring (m) [default: those of the set].
    #[arg(long, value_name = "FROM:TO", value_parser = axial, allow_hyphen_values = true)]
    pub contact_axial: Option<[f64; 2]>,
    /// Thermal patches around and along [default: none].
    #[arg(long, value_name = "AxL", value_parser = pair)]
    pub patches: Option<[usize; 2]>,
    /// Coefficient of linear thermal expansion (1/K), instead of the material's.
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub expansion: Option<f64>,
    /// Fixed-interface modes to reduce with; `--modes` is the number of modes kept in the ROM [default: 156].
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
    /// Number of contact nodes, chosen evenly along the chord out of the contact set or the tip, instead of patches.
    #[arg(long, value_name = "N")]
    pub contact_nodes: Option<usize>,
    /// Number of patches along the chord that the faces within the contact set or the tip are divided into [default: 9, fewer where
    /// elements are wider; none for a contact set of at most 12 nodes, which are the contact nodes].
    #[arg(long, value_name = "N", conflicts_with = "contact_nodes")]
    pub contact_patches: Option<usize>,
    /// Rows of patches across the thickness, from side to side: with two or more the sides of a tilted tip touch [default: 2; 1 where
    /// the mesh does not tell two apart].
    #[arg(long, value_name = "R", conflicts_with = "contact_nodes")]
    pub contact_rows: Option<usize>,
    /// Names of the contact nodes or patches along the chord, by growing z; of patches in rows NAME_row_1, NAME_row_2, ... [default:
    /// tip_1,tip_2,... and patch_1,patch_2,...].
    #[arg(long, value_name = "NAME,NAME,...", value_delimiter = ',', value_parser = identifier)]
    pub contact_names: Vec<String>,
}

/// Options of every user mesh.
#[derive(Debug, Clone, PartialEq, Default, Args)]
pub struct ModelOptions {
    /// Set of nodes that can touch. With more than 12 nodes it is a tip, and contact is on patches; with fewer all of them are contact nodes,
    /// and so are nodes given by their numbers in the file, such as 12,57,103. Without it the tip of a mesh of blades is found: its outermost
    /// faces.
    #[arg(long, value_name = "SET")]
    pub contact_set: Option<String>,
    /// Set of nodes that are held, or their numbers in the file; may be repeated. `none`: the structure flies freely.
    #[arg(long, value_name = "SET")]
    pub clamp_set: Vec<String>,
    /// Units of the file; everything on the command line is in SI units, whatever the file's are [default: m].
    #[arg(long, value_enum)]
    pub units: Option<UnitChoice>,
    /// Engine axis in the file; the others follow in turn [default: z].
    #[arg(long, value_enum)]
    pub axis: Option<AxisChoice>,
    /// Material of all elements, instead of the file's.
    #[arg(long, value_enum, conflicts_with = "young")]
    pub material: Option<MaterialChoice>,
    /// Young's modulus (Pa) of all elements, instead of the file's material.
    #[arg(long, value_name = "E", value_parser = positive, requires = "poisson", requires = "density")]
    pub young: Option<f64>,
    /// Poisson's ratio of all elements.
    #[arg(long, value_name = "NU", value_parser = poisson, requires = "young", allow_negative_numbers = true)]
    pub poisson: Option<f64>,
    /// Density (kg/m³) of all elements.
    #[arg(long, value_name = "RHO", value_parser = positive, requires = "young")]
    pub density: Option<f64>,
    /// Temperature at which the file's tables of properties are read, in its unit.
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub temperature: Option<f64>,
}

/// Reduction options of a user mesh.
#[derive(Debug, Clone, PartialEq, Default, Args)]
pub struct KeptOptions {
    /// Modes kept [default: 25, of blades with patches up to 80, of a disk per nodal diameter; 60 of a casing].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Modal damping ratio proposed with the model [default: 0.005].
    #[arg(long, value_name = "RATIO", value_parser = share)]
    pub damping: Option<f64>,
    /// Name of the structure [default: that of the file].
    #[arg(long, value_name = "NAME", value_parser = model_name)]
    pub name: Option<String>,
}

/// Matrices instead of a mesh.
#[derive(Debug, Clone, PartialEq, Default, Args)]
pub struct MatrixOptions {
    /// Stiffness matrix: Matrix Market, CalculiX .sti, Abaqus text. With a mesh FILE, nodes and sets are its.
    #[arg(long, value_name = "FILE", requires = "mass", conflicts_with_all = ["material", "young"])]
    pub stiffness: Option<PathBuf>,
    /// Mass matrix, in the same format.
    #[arg(long, value_name = "FILE", requires = "stiffness")]
    pub mass: Option<PathBuf>,
    /// Table of nodes of the matrices: `NODE,X,Y,Z[,SETS]`, instead of a mesh file.
    #[arg(long, value_name = "FILE", requires = "stiffness", conflicts_with = "file")]
    pub nodes: Option<PathBuf>,
    /// CalculiX's list of degrees of freedom [default: the stiffness file with the extension .dof].
    #[arg(long, value_name = "FILE", requires = "stiffness")]
    pub dofs: Option<PathBuf>,
}

/// Input of a user mesh, of any kind.
#[derive(Debug, Clone)]
pub struct MeshSource<'a> {
    /// Mesh file.
    pub file: Option<&'a Path>,
    /// Options.
    pub model: &'a ModelOptions,
    /// Matrices, where they can be given.
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
    /// A mesh alone.
    pub fn mesh(file: &'a Path, model: &'a ModelOptions) -> Self {
        Self { file: Some(file), model, matrices: None, kept: KeptOptions::default() }
    }
}

impl MeshSource<'_> {
    /// Name of the model.
    pub fn name(&self) -> String {
        if let Some(name) = &self.kept.name {
            return name.clone();
        }
        let stiffness = self.matrices.and_then(|matrices| matrices.stiffness.as_deref());
        let stem = self.file.or(stiffness).and_then(Path::file_stem);
        stem.map_or_else(|| "model".to_owned(), |stem| stem.to_string_lossy().into_owned())
    }

    /// All files that are read.
    pub fn files(&self) -> Vec<NamedFile> {
        let mesh = self.file.map(|path| NamedFile::new("FILE", path));
        let mut parts = Vec::new();
        self.file.iter().for_each(|path| included::collect(path, &mut parts));
        let parts = parts.into_iter().map(|path| NamedFile::new("a file that FILE includes,", path));
        let matrices = self.matrices.into_iter().flat_map(|own| {
            // Without --dofs the list beside CalculiX's stiffness file is read.
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

    /// The material that the command line gives, if any.
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
    /// m, kg, s, N, Pa: taken as it stands, however unusual it looks.
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
    /// z: nothing is turned.
    Z,
}

impl ModelOptions {
    /// Engine axis in the file.
    pub fn axis(&self) -> EngineAxis {
        match self.axis {
            Some(AxisChoice::X) => EngineAxis::X,
            Some(AxisChoice::Y) => EngineAxis::Y,
            Some(AxisChoice::Z) | None => EngineAxis::Z,
        }
    }

    /// Units of the file.
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

/// Part of variable names.
fn identifier(text: &str) -> Result<String, String> {
    let starts_well = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    if starts_well && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
        return Ok(text.to_owned());
    }
    Err("use letters, digits and underscores, not starting with a digit: it becomes part of variable names".into())
}

/// Part of a file name.
fn model_name(text: &str) -> Result<String, String> {
    if text.is_empty() || text.contains(['/', '\\']) || text.starts_with('.') {
        return Err("give a plain name; where the ROM file goes is what -o says".into());
    }
    Ok(text.to_owned())
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..1.0).contains(&value) => Ok(value),
        _ => Err("give a number from 0, below 1".into()),
    }
}

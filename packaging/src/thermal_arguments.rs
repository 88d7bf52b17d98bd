//! Options of `tiprub thermal`.

use std::path::{Path, PathBuf};

use clap::Args;
use tiprub_model::{CasingOptions, casing::CASING37};
use tiprub_shell::places::NamedFile;

use crate::{
    casing_arguments::RingArguments,
    cli::{FmiChoice, LibraryArguments},
    mesh_arguments::{AxisChoice, MeshSource, ModelOptions, UnitChoice},
    shared_arguments::axial,
};

/// Arguments of `tiprub thermal`.
#[derive(Debug, Args)]
pub struct ThermalArguments {
    /// Mesh file of your own casing, of one material: CalculiX/Abaqus (.inp) or Gmsh 4.1 (.msh), instead of a contour.
    #[arg(value_name = "FILE", conflicts_with_all = ["contour", "thickness", "low_flange", "high_flange", "element", "mesh"])]
    pub file: Option<PathBuf>,
    /// Set of the nodes of the inner surface of FILE [default: detected in the mesh].
    #[arg(long, value_name = "SET", requires = "file")]
    pub contact_set: Option<String>,
    /// Units of FILE; values on the command line are always in SI units [default: m].
    #[arg(long, value_enum, requires = "file")]
    pub units: Option<UnitChoice>,
    /// Engine axis in FILE; the other axes follow in cyclic order [default: z].
    #[arg(long, value_enum, requires = "file")]
    pub axis: Option<AxisChoice>,
    /// The casing, as for `tiprub reduce casing`: with the same options, the patches are the same.
    #[command(flatten)]
    pub ring: RingArguments,
    /// Conductivity (W/(m K)), instead of the material's [default: 53.3 for steel, 6.7 for titanium].
    #[arg(long, value_name = "K")]
    pub conductivity: Option<f64>,
    /// Specific heat capacity (J/(kg K)), instead of the material's [default: 439.8 for steel, 526.3 for titanium].
    #[arg(long, value_name = "C")]
    pub heat_capacity: Option<f64>,
    /// Film coefficient of the gas inside (W/(m2 K)) [default: 500].
    #[arg(long, value_name = "H")]
    pub gas_film: Option<f64>,
    /// Film coefficient of the air outside (W/(m2 K)) [default: 25].
    #[arg(long, value_name = "H")]
    pub ambient_film: Option<f64>,
    /// Axial positions (m) between which the inner surface is heated [default: from the first to the last contact ring;
    /// the whole surface of FILE without --contact-axial].
    #[arg(long, value_name = "FROM:TO", value_parser = axial, allow_hyphen_values = true)]
    pub heated: Option<[f64; 2]>,
    /// Number of eigenmodes kept in addition to the steady-state responses [default: 20].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Name of the model [default: casing37_thermal; casing_thermal for another casing; for FILE, its name with
    /// _thermal].
    #[arg(long, value_name = "NAME", value_parser = super::mesh_arguments::model_name)]
    pub name: Option<String>,
    /// FMI version of the FMU.
    #[arg(long, value_enum, default_value_t = FmiChoice::Both)]
    pub fmi: FmiChoice,
    /// The .fmu file, or a directory for it (always a directory with `--fmi both`).
    #[arg(long, short, value_name = "FILE|DIR", default_value = ".")]
    pub output: PathBuf,
    /// FMI 3: write arrays instead of scalars with the names of FMI 2.
    #[arg(long)]
    pub arrays: bool,
    /// Libraries that go into the FMU.
    #[command(flatten)]
    pub libraries: LibraryArguments,
}

impl ThermalArguments {
    /// Returns the name of the model.
    pub fn name(&self) -> String {
        self.name.clone().unwrap_or_else(|| {
            let stem = self.file.as_deref().and_then(Path::file_stem).map(|stem| stem.to_string_lossy().into_owned());
            let built_in = self.ring.options() == CasingOptions::default();
            format!("{}_thermal", stem.as_deref().unwrap_or(if built_in { CASING37 } else { "casing" }))
        })
    }

    /// Returns the input options of FILE.
    pub fn model(&self) -> ModelOptions {
        ModelOptions {
            contact_set: self.contact_set.clone(),
            units: self.units,
            axis: self.axis,
            material: self.ring.material,
            ..ModelOptions::default()
        }
    }

    /// Returns all files that are read.
    pub fn files(&self) -> Vec<NamedFile> {
        let model = self.model();
        self.file.as_deref().map_or_else(Vec::new, |file| MeshSource::mesh(file, &model).files())
    }
}

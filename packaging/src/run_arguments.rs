//! Arguments of `tiprub run`.

use std::path::PathBuf;

use clap::Args;
use tiprub_field::FieldOptions;
use tiprub_study::arguments::{CacheArguments, SceneOptions, assignment, positive_count};

/// Arguments of `tiprub run`.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// Scene file (TOML), or a built-in scene such as `builtin:rotor37`.
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// Also print the final values of all outputs, the extremes, the computing times and the full warnings.
    #[arg(long)]
    pub all: bool,
    /// Write all outputs to a CSV file; `-` is stdout.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Write all outputs to a Parquet file, in columns of real numbers.
    #[arg(long, value_name = "FILE")]
    pub parquet: Option<PathBuf>,
    /// Write a report that shows the contact: one HTML file with an animation and figures, which opens offline.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Write surfaces, displacements, clearance, contact pressure, wear and stress over time for ParaView: one file per
    /// part and time (.vtu), listed in DIR/fields.pvd.
    #[arg(long, value_name = "DIR")]
    pub vtk: Option<PathBuf>,
    /// Sectors for --vtk, separated by commas [default: all].
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', requires = "vtk")]
    pub vtk_sectors: Vec<usize>,
    /// Write the files of --vtk at every K-th communication point, and at the last one.
    #[arg(long, value_name = "K", default_value = "1", value_parser = positive_count, requires = "vtk")]
    pub vtk_every: std::num::NonZero<usize>,
    /// Accept a directory for --vtk that is not empty: the files that an earlier DIR/fields.pvd lists are removed first,
    /// and files of the same names are replaced.
    #[arg(long, requires = "vtk")]
    pub force: bool,
    /// Stop time (s), instead of the scene's.
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub stop: Option<f64>,
    /// Communication step H (s), instead of the scene's.
    #[arg(long, value_name = "H", allow_negative_numbers = true)]
    pub step: Option<f64>,
    /// Start value of an input or parameter; for an array, one value for all elements or a list such as `NAME=[1,2,3]`.
    /// May be repeated.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment, allow_hyphen_values = true)]
    pub set: Vec<(String, String)>,
    /// Read inputs and tunable parameters over time from a CSV file with the columns `time,NAME,NAME,...`; inputs are
    /// interpolated linearly between the lines, without delay.
    #[arg(long, value_name = "FILE", conflicts_with = "estimate")]
    pub inputs: Option<PathBuf>,
    /// Also estimate the discretisation errors of time step, modes, patches along the chord and rows across the
    /// thickness, from about ten coarser runs. The error of the mesh is printed if the ROM contains it (`tiprub study
    /// convergence --into`).
    #[arg(long)]
    pub estimate: bool,
    /// Changes to the scene.
    #[command(flatten)]
    pub options: SceneOptions,
    /// Cache of built-in models.
    #[command(flatten)]
    pub cache: CacheArguments,
}

impl RunArguments {
    /// Returns the choices for fields over time, if they are requested.
    pub fn fields(&self) -> Option<FieldOptions> {
        Some(FieldOptions {
            directory: self.vtk.clone()?,
            sectors: self.vtk_sectors.clone(),
            every: self.vtk_every.get(),
            force: self.force,
        })
    }
}

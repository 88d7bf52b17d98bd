//! Options of `tiprub thermal`.

use std::path::PathBuf;

use clap::Args;
use tiprub_model::{CasingOptions, casing::CASING37};

use crate::{
    casing_arguments::RingArguments,
    cli::{FmiChoice, LibraryArguments},
    shared_arguments::axial,
};

/// Arguments of `tiprub thermal`.
#[derive(Debug, Args)]
pub struct ThermalArguments {
    /// The casing, as for `tiprub reduce casing`: with the same options patches are the same.
    #[command(flatten)]
    pub ring: RingArguments,
    /// Conductivity (W/(m K)), instead of the material's [default: 53.3 of steel, 6.7 of titanium].
    #[arg(long, value_name = "K")]
    pub conductivity: Option<f64>,
    /// Specific heat capacity (J/(kg K)), instead of the material's [default: 439.8 of steel, 526.3 of titanium].
    #[arg(long, value_name = "C")]
    pub heat_capacity: Option<f64>,
    /// Film coefficient of the gas inside (W/(m2 K)) [default: 500].
    #[arg(long, value_name = "H")]
    pub gas_film: Option<f64>,
    /// Film coefficient of the air outside (W/(m2 K)) [default: 25].
    #[arg(long, value_name = "H")]
    pub ambient_film: Option<f64>,
    /// Axial positions (m) between which the inner surface is heated [default: from the first to the last contact ring].
    #[arg(long, value_name = "FROM:TO", value_parser = axial, allow_hyphen_values = true)]
    pub heated: Option<[f64; 2]>,
    /// Eigenmodes kept besides responses at rest [default: 20].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Name of the model [default: casing37_thermal, of another casing casing_thermal].
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// FMI version of the FMU.
    #[arg(long, value_enum, default_value_t = FmiChoice::Both)]
    pub fmi: FmiChoice,
    /// The .fmu file, or a directory for it (always a directory with `--fmi both`).
    #[arg(long, short, value_name = "FILE|DIR", default_value = ".")]
    pub output: PathBuf,
    /// FMI 3: keep arrays whole, instead of scalars with the names of FMI 2.
    #[arg(long)]
    pub arrays: bool,
    /// Libraries that go into the FMU.
    #[command(flatten)]
    pub libraries: LibraryArguments,
}

impl ThermalArguments {
    /// Name of the model.
    pub fn name(&self) -> String {
        self.name.clone().unwrap_or_else(|| {
            let built_in = self.ring.options() == CasingOptions::default();
            format!("{}_thermal", if built_in { CASING37 } else { "casing" })
        })
    }
}

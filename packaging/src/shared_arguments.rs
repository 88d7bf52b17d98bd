//! Options that several kinds of `tiprub reduce` share.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use tiprub_field::shape_file;
use tiprub_model::{Material, reduce::ReductionKind};

/// Output options of every reduction.
#[derive(Debug, Clone, PartialEq, Eq, Default, Args)]
pub struct OutputArguments {
    /// ROM file to write [default: NAME.rom.safetensors with the name of the model].
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace existing files.
    #[arg(long)]
    pub force: bool,
    /// Accept implausible values (contact nodes far inside, lengths in millimetres, overlapping sectors), with a
    /// warning.
    #[arg(long)]
    pub accept_implausible: bool,
    /// Also write the mesh as a CalculiX/Abaqus input file that computes its frequencies.
    #[arg(long, value_name = "FILE")]
    pub inp: Option<PathBuf>,
    /// Also write the mesh, sets and mode shapes for ParaView (.vtu).
    #[arg(long, value_name = "FILE")]
    pub vtk: Option<PathBuf>,
    /// Do not write the shape file beside the ROM (NAME.shapes.safetensors), from which `tiprub run --vtk` draws the
    /// surface of the model.
    #[arg(long)]
    pub no_shapes: bool,
}

impl OutputArguments {
    /// Returns the shape file beside this ROM; `None` if it is not requested, or if the ROM is written to a device or a
    /// pipe.
    pub fn shapes(&self, rom: &Path) -> Option<PathBuf> {
        let is_stream = rom.exists() && !rom.is_file();
        (!self.no_shapes && !is_stream).then(|| shape_file::beside(rom))
    }
}

/// Which modes a reduction keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum KindChoice {
    /// Modes with fixed contact nodes (Craig and Bampton), as in the paper. Contact nodes have mass.
    CraigBampton,
    /// Modes with free contact nodes, and exact static responses to contact forces (MacNeal, Rubin). Requires fewer
    /// modes for the same error. Contact nodes have no mass with the scheme massless-boundary.
    FreeInterface,
}

impl KindChoice {
    /// Returns the requested kind; by default, contact patches use free-interface modes.
    pub fn kind(choice: Option<Self>, patches: bool) -> ReductionKind {
        match choice {
            Some(Self::CraigBampton) => ReductionKind::FixedInterface,
            Some(Self::FreeInterface) => ReductionKind::FreeInterface,
            None if patches => ReductionKind::FreeInterface,
            None => ReductionKind::FixedInterface,
        }
    }
}

/// Materials by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MaterialChoice {
    /// E = 210 GPa, ρ = 7850 kg/m³, α = 11.7e-6 1/K.
    Steel,
    /// Ti-6Al-4V: E = 113.8 GPa, ρ = 4430 kg/m³, α = 8.6e-6 1/K.
    Titanium,
    /// E = 180 GPa, ρ = 8000 kg/m³, α = 10.1e-6 1/K.
    MaragingSteel,
}

impl MaterialChoice {
    /// Returns the material of this name.
    pub fn material(self) -> Material {
        match self {
            Self::Steel => Material::steel(),
            Self::Titanium => Material::titanium(),
            Self::MaragingSteel => Material::maraging_steel(),
        }
    }
}

/// Three element counts: chord, thickness and span of a blade; circumference, thickness and length of a casing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshSize(pub [usize; 3]);

impl std::str::FromStr for MeshSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let counts: Result<Vec<usize>, _> = text.split(['x', 'X']).map(str::parse).collect();
        match counts.as_deref() {
            Ok([a, b, c]) if [a, b, c].iter().all(|count| (1..=200).contains(*count)) => Ok(Self([*a, *b, *c])),
            _ => {
                Err("give three element counts from 1 to 200: CHORDxTHICKNESSxSPAN for a blade, for example 10x1x14, \
                      or AROUNDxTHROUGHxALONG for a casing, for example 72x1x12"
                    .into())
            }
        }
    }
}

/// Parses two counts.
///
/// # Errors
/// The text does not have this form.
pub fn pair(text: &str) -> Result<[usize; 2], String> {
    let counts: Result<Vec<usize>, _> = text.split(['x', 'X']).map(str::parse).collect();
    match counts.as_deref() {
        Ok([around, along]) if *around <= 360 && *along <= 100 => Ok([*around, *along]),
        _ => Err("give two counts, at most 360 around and 100 along, as AROUNDxALONG, for example 24x3".into()),
    }
}

/// Parses two axial positions (m).
///
/// # Errors
/// The text does not have this form.
pub fn axial(text: &str) -> Result<[f64; 2], String> {
    let ends = text.split_once(':').map(|(from, to)| [from, to].map(|end| end.trim().parse::<f64>().ok()));
    match ends {
        Some([Some(from), Some(to)]) if from < to => Ok([from, to]),
        _ => Err("give two increasing axial positions in m as FROM:TO, for example 0.002:0.038".into()),
    }
}

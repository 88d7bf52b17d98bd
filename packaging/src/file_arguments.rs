//! Options of `tiprub reduce FILE`: a finite-element model of one's own.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use tiprub_model::{
    Material,
    read::{Axis, Units},
};
use tiprub_shell::{Failure, Result};

use crate::casing_arguments::MaterialChoice;

/// What describes a model of one's own.
#[derive(Debug, Clone, PartialEq, Default, Args)]
#[command(next_help_heading = "Options of a model of your own")]
pub struct FileArguments {
    /// Set of nodes that can touch the casing: contact nodes are taken from it. Or their numbers in the file, such as 12,57,103:
    /// then all of them.
    #[arg(long, value_name = "SET")]
    pub contact_set: Option<String>,
    /// Set of nodes that are held, or their numbers in the file; may be repeated. `none`: the structure flies freely.
    #[arg(long, value_name = "SET")]
    pub clamp_set: Vec<String>,
    /// Names of the contact nodes, by growing z [default: tip_1,tip_2,...].
    #[arg(long, value_name = "NAME,NAME,...", value_delimiter = ',', value_parser = identifier)]
    pub contact_names: Vec<String>,
    /// Number of equal sectors around the axis. Without cyclic faces: blades that know nothing of each other [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub sectors: Option<u32>,
    /// Face of a sector towards its lower neighbour (smaller angle).
    #[arg(long, value_name = "SET", requires = "cyclic_high", requires = "sectors")]
    pub cyclic_low: Option<String>,
    /// Face of a sector towards its upper neighbour.
    #[arg(long, value_name = "SET", requires = "cyclic_low", requires = "sectors")]
    pub cyclic_high: Option<String>,
    /// Largest distance (m) of a node of the upper face from the turned one of the lower face [default: 1e-5 of the
    /// largest radius].
    #[arg(long, value_name = "M", value_parser = positive, requires = "cyclic_low")]
    pub cyclic_tolerance: Option<f64>,
    /// Units of the file; everything on the command line is in SI units, whatever the file's are [default: m].
    #[arg(long, value_enum)]
    pub units: Option<UnitChoice>,
    /// Engine axis in the file; the others follow in turn [default: z].
    #[arg(long, value_enum)]
    pub axis: Option<AxisChoice>,
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
    /// Stiffness matrix: Matrix Market, CalculiX .sti, Abaqus text. With a mesh file as MODEL, nodes and sets are its.
    #[arg(long, value_name = "FILE", requires = "mass")]
    pub stiffness: Option<PathBuf>,
    /// Mass matrix, in the same format.
    #[arg(long, value_name = "FILE", requires = "stiffness")]
    pub mass: Option<PathBuf>,
    /// Table of nodes of the matrices: `NODE,X,Y,Z[,SETS]`, instead of a mesh file.
    #[arg(long, value_name = "FILE", requires = "stiffness")]
    pub nodes: Option<PathBuf>,
    /// CalculiX's list of degrees of freedom [default: the stiffness file with the extension .dof].
    #[arg(long, value_name = "FILE", requires = "stiffness")]
    pub dofs: Option<PathBuf>,
    /// Modal damping ratio proposed with the model [default: 0.005].
    #[arg(long, value_name = "RATIO", value_parser = share)]
    pub damping: Option<f64>,
    /// Name of the structure [default: that of the file].
    #[arg(long, value_name = "NAME", value_parser = model_name)]
    pub name: Option<String>,
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

impl FileArguments {
    /// Engine axis in the file.
    pub fn axis(&self) -> Axis {
        match self.axis {
            Some(AxisChoice::X) => Axis::X,
            Some(AxisChoice::Y) => Axis::Y,
            Some(AxisChoice::Z) | None => Axis::Z,
        }
    }

    /// Units of the file.
    pub fn units(&self) -> Units {
        match self.units {
            Some(UnitChoice::MillimetreTonneSecond) => Units::MillimetreTonneSecond,
            Some(UnitChoice::Metre) | None => Units::Si,
        }
    }

    /// The material that the command line gives, if any.
    ///
    /// # Errors
    /// A name and numbers together.
    pub fn material(&self, named: Option<MaterialChoice>, expansion: Option<f64>) -> Result<Option<Material>> {
        let numbers = self.young.zip(self.poisson).zip(self.density);
        let material = match (named, numbers) {
            (Some(_), Some(_)) => {
                let remedy = "Give a name, or --young, --poisson and --density";
                return Err(Failure::usage("--material", "the material is given twice", remedy));
            }
            (Some(named), None) => Some(named.material()),
            (None, Some(((young_modulus, poisson_ratio), density))) => {
                let name = "user".into();
                Some(Material { name, young_modulus, poisson_ratio, density, expansion: 0.0 })
            }
            (None, None) => None,
        };
        Ok(material.map(|material| Material { expansion: expansion.unwrap_or(material.expansion), ..material }))
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

//! Options of `tiprub reduce casing` and `tiprub thermal`: a ring that is described on the command line.

use crate::shared_arguments::{MaterialChoice, MeshSize, OutputArguments, axial, pair};
use clap::{Args, ValueEnum};
use tiprub_model::{
    CasingOptions,
    casing::{ContactRings, Flange, InnerContour, RingCounts, RingSupport},
    element::ElementKind,
};

/// Default distance of the first and the last contact ring from the ends of the casing, as a fraction of its length.
const MARGIN: f64 = 0.1;

/// Shape of a casing; absent options are those of casing37.
#[derive(Debug, Clone, PartialEq, Default, Args)]
pub struct RingArguments {
    /// Inner contour as points z:r in m, in order of increasing z [default: the tip of rotor 37 plus the design gap].
    #[arg(long, value_name = "Z:R,Z:R,...", value_parser = contour, allow_hyphen_values = true)]
    pub contour: Option<InnerContour>,
    /// Radial thickness of the shell (m) [default: 0.004].
    #[arg(long, value_name = "M", value_parser = length)]
    pub thickness: Option<f64>,
    /// Flange at the low end of z: axial thickness and radial height (m), or `none` [default: 0.005x0.010].
    #[arg(long, value_name = "TxH", value_parser = flange)]
    pub low_flange: Option<FlangeChoice>,
    /// Flange at the high end of z, in the same form [default: 0.004x0.006].
    #[arg(long, value_name = "TxH", value_parser = flange)]
    pub high_flange: Option<FlangeChoice>,
    /// Material [default: steel].
    #[arg(long, value_enum)]
    pub material: Option<MaterialChoice>,
    /// Elements: quadratic or linear bricks; linear ones are far too stiff in bending [default: hex20].
    #[arg(long, value_enum)]
    pub element: Option<ElementChoice>,
    /// Contact nodes around the circumference and along the axis [default: 24x3].
    #[arg(long, value_name = "AxL", value_parser = pair)]
    pub contact_grid: Option<[usize; 2]>,
    /// Axial positions of the first and the last contact ring (m) [default: those around rotor 37; with --contour, 10 %
    /// of its length from either end].
    #[arg(long, value_name = "FROM:TO", value_parser = axial, allow_hyphen_values = true)]
    pub contact_axial: Option<[f64; 2]>,
    /// Thermal patches around the circumference and along the axis; in `reduce casing`, 0x0 omits heat [default: 12x1].
    #[arg(long, value_name = "AxL", value_parser = pair)]
    pub patches: Option<[usize; 2]>,
    /// Elements around the circumference, through the thickness and along the axis [default: 72x1x12].
    #[arg(long, value_name = "AxTxL")]
    pub mesh: Option<MeshSize>,
}

/// Options of a casing; absent options are those of casing37.
#[derive(Debug, Clone, PartialEq, Default, Args)]
pub struct CasingArguments {
    /// Shape of the casing.
    #[command(flatten)]
    pub ring: RingArguments,
    /// Clamped end faces [default: low].
    #[arg(long, value_enum)]
    pub support: Option<SupportChoice>,
    /// Coefficient of linear thermal expansion (1/K), instead of the material's.
    #[arg(long, value_name = "A", allow_negative_numbers = true)]
    pub expansion: Option<f64>,
    /// Number of lowest modes kept in the ROM [default: 60].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Number of fixed-interface modes used for the reduction [default: 156].
    #[arg(long, value_name = "N")]
    pub fixed_interface_modes: Option<usize>,
    /// Output options; the default name is casing37, or `casing` for any other casing.
    #[command(flatten)]
    pub written: OutputArguments,
}

/// Flange, or none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlangeChoice(Option<Flange>);

/// Which end faces are held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SupportChoice {
    /// The end face at low z.
    Low,
    /// The end face at high z.
    High,
    /// Both end faces.
    Both,
    /// None: the casing can move as a rigid body.
    Free,
}

/// Elements by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ElementChoice {
    /// 20 nodes.
    Hex20,
    /// 8 nodes.
    Hex8,
}

impl RingArguments {
    /// Returns the requested casing, with the name, support and modes of casing37.
    pub fn options(&self) -> CasingOptions {
        let defaults = CasingOptions::default();
        let mut options = defaults.clone();
        if let Some(contour) = self.contour.clone() {
            let [low, high] = contour.axial();
            let margin = MARGIN * (high - low);
            options.rings.axial = [low + margin, high - margin];
            options.geometry.contour = contour;
        }
        options.geometry.thickness = self.thickness.unwrap_or(defaults.geometry.thickness);
        for (flange, choice) in options.geometry.flanges.iter_mut().zip([self.low_flange, self.high_flange]) {
            *flange = choice.map_or(*flange, |choice| choice.0);
        }
        let [around, along] = self.contact_grid.unwrap_or([defaults.rings.around, defaults.rings.along]);
        options.rings = ContactRings { around, along, axial: self.contact_axial.unwrap_or(options.rings.axial) };
        options.counts = self.mesh.map_or(defaults.counts, |size| {
            let [around, through, along] = size.0;
            RingCounts { around, through, along, flange: through }
        });
        options.material = self.material.map_or(defaults.material.clone(), MaterialChoice::material);
        options.kind = self.element.map_or(defaults.kind, ElementChoice::kind);
        options.patches = self.patches.unwrap_or(defaults.patches);
        options
    }
}

impl CasingArguments {
    /// Returns the requested casing.
    pub fn options(&self) -> CasingOptions {
        let defaults = CasingOptions::default();
        let mut options = self.ring.options();
        options.support = self.support.map_or(defaults.support, SupportChoice::support);
        options.material.expansion = self.expansion.unwrap_or(options.material.expansion);
        options.fixed_interface_modes = self.fixed_interface_modes.unwrap_or(defaults.fixed_interface_modes);
        options.modes = self.modes.unwrap_or(defaults.modes);
        // The name stands for the built-in casing only.
        if options != defaults {
            options.name = "casing".into();
        }
        options
    }
}

impl SupportChoice {
    fn support(self) -> RingSupport {
        match self {
            Self::Low => RingSupport::Low,
            Self::High => RingSupport::High,
            Self::Both => RingSupport::Both,
            Self::Free => RingSupport::Free,
        }
    }
}

impl ElementChoice {
    fn kind(self) -> ElementKind {
        match self {
            Self::Hex20 => ElementKind::Hex20,
            Self::Hex8 => ElementKind::Hex8,
        }
    }
}

fn contour(text: &str) -> Result<InnerContour, String> {
    let example = "give points z:r in m in order of increasing z, for example -0.02:0.256,0.04:0.245";
    let point = |text: &str| -> Option<[f64; 2]> {
        let (z, r) = text.split_once(':')?;
        Some([z.trim().parse().ok()?, r.trim().parse().ok()?])
    };
    let points: Option<Vec<[f64; 2]>> = text.split(',').map(point).collect();
    InnerContour::new(&points.ok_or(example)?).map_err(|error| error.to_string())
}

fn length(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("give a positive length in m".into()),
    }
}

fn flange(text: &str) -> Result<FlangeChoice, String> {
    if text == "none" {
        return Ok(FlangeChoice(None));
    }
    let lengths: Result<Vec<f64>, String> = text.split(['x', 'X']).map(length).collect();
    match lengths.as_deref() {
        Ok([thickness, height]) => Ok(FlangeChoice(Some(Flange { thickness: *thickness, height: *height }))),
        _ => {
            Err("give the axial thickness and the radial height in m as TxH, for example 0.005x0.010, or `none`".into())
        }
    }
}

//! Arguments of `tiprub reduce`: a subcommand per kind of model, with separate options.

use clap::{Args, Subcommand, ValueEnum};
use tiprub_gallery::builtin;
use tiprub_model::{
    Rotor37Options,
    cube::MassMatrix,
    cyclic::ModeSelection,
    rotor37::{MeshCounts, TipContact},
    stage::StageOptions,
};
use tiprub_shell::places::NamedFile;
use tiprub_study::arguments::positive;

use crate::{
    casing_arguments::CasingArguments,
    mesh_arguments::{BladeArguments, CasingMeshArguments, SectorArguments},
    shared_arguments::{KindChoice, MaterialChoice, MeshSize, OutputArguments, pair},
};

/// Arguments of `tiprub reduce`.
#[derive(Debug, Args)]
pub struct ReduceArguments {
    /// The model.
    #[command(subcommand)]
    pub model: ModelToReduce,
}

/// Models that can be reduced.
#[derive(Debug, Subcommand)]
pub enum ModelToReduce {
    /// Your own blades on a rigid hub, from a mesh (CalculiX/Abaqus .inp, Gmsh 4.1 .msh) or from matrices exported by any finite-element code.
    #[command(
        after_help = "Examples:\n  tiprub reduce blade blade.inp --clamp-set ROOT --sectors 36 --units mm-t-s\n  \
                            tiprub reduce blade blade.msh --contact-set TIP --clamp-set ROOT --material titanium --contact-patches 17\n  \
                            tiprub reduce blade job.inp --stiffness job.sti --mass job.mas --contact-set TIP --clamp-set ROOT\n\n\
                            Without --contact-set, the tip is detected in the mesh; without --clamp-set, the sets of \
                            the file are listed."
    )]
    Blade(Box<BladeArguments>),
    /// Your own bladed disk with coupled sectors, from a mesh or matrices of one sector, reduced per nodal diameter.
    #[command(
        after_help = "Example:\n  tiprub reduce sector sector.inp --clamp-set BORE --sectors 56 --cyclic-low LOW --cyclic-high HIGH"
    )]
    Sector(Box<SectorArguments>),
    /// Your own casing from a mesh, with a grid of contact nodes that define its surface.
    #[command(
        after_help = "Example:\n  tiprub reduce casing-mesh ring.inp --contact-set INNER --clamp-set FLANGE --contact-grid 24x3 --contact-axial 0.002:0.038"
    )]
    CasingMesh(Box<CasingMeshArguments>),
    /// A casing described on the command line, by default casing37, the one around rotor 37.
    #[command(after_help = "Examples:\n  tiprub reduce casing\n  \
                            tiprub reduce casing --material titanium --thickness 0.003 --high-flange none\n  \
                            tiprub reduce casing --contour=-0.02:0.256,0.04:0.245 --contact-axial 0.0026:0.038")]
    Casing(Box<CasingArguments>),
    /// The built-in blade: NASA rotor 37.
    #[command(after_help = "Examples:\n  tiprub reduce rotor37\n  \
                            tiprub reduce rotor37 --contact-patches 17 --modes 120 --mesh 32x2x40 -o fine.rom.safetensors")]
    Rotor37(Rotor37Arguments),
    /// The built-in disk with 56 blades.
    #[command(after_help = "Example:\n  tiprub reduce stage --coarse --inp sector.inp --vtk sector.vtu")]
    Stage(StageArguments),
    /// The built-in casing around the disk.
    #[command(after_help = "Example:\n  tiprub reduce stage-casing --coarse --material titanium")]
    StageCasing(StageCasingArguments),
    /// The built-in free cube between two rings.
    #[command(after_help = "Example:\n  tiprub reduce cube --modes 100")]
    Cube(CubeArguments),
    /// The built-in ring to the left of the cube.
    #[command(after_help = "Example:\n  tiprub reduce ring-left --modes 50 --static-responses 12")]
    RingLeft(CubeRingArguments),
    /// The built-in ring to the right of the cube.
    #[command(after_help = "Example:\n  tiprub reduce ring-right --modes 50 --static-responses 12")]
    RingRight(CubeRingArguments),
}

/// Arguments of `tiprub reduce rotor37`.
#[derive(Debug, Args)]
pub struct Rotor37Arguments {
    /// Number of modes kept [default: 80; 20 with --contact-nodes].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Number of contact nodes along the tip chord from leading to trailing edge (≥ 2), as in the paper, instead of
    /// patches.
    #[arg(long, value_name = "N")]
    pub contact_nodes: Option<usize>,
    /// Number of contact patches along the tip chord [default: 9].
    #[arg(long, value_name = "N", conflicts_with = "contact_nodes")]
    pub contact_patches: Option<usize>,
    /// Rows of patches across the thickness, from side to side; with two or more, the sides of a tilted tip touch
    /// separately; one row averages contact over the thickness [default: 2].
    #[arg(long, value_name = "R", conflicts_with = "contact_nodes")]
    pub contact_rows: Option<usize>,
    /// Kind of modes to keep [default: free-interface; craig-bampton with --contact-nodes].
    #[arg(long, value_enum)]
    pub kind: Option<KindChoice>,
    /// Elements along the chord, through the thickness and along the span [default: 24x2x40; 16x2x20 with --contact-nodes].
    #[arg(long, value_name = "CxTxS")]
    pub mesh: Option<MeshSize>,
    /// Also compute the effects of spin (stiffening, growth, Coriolis force) up to this speed (rad/s).
    #[arg(long, value_name = "SPEED", value_parser = positive, allow_negative_numbers = true)]
    pub spin: Option<f64>,
    /// Output options.
    #[command(flatten)]
    pub written: OutputArguments,
}

impl Rotor37Arguments {
    /// Returns the requested blade.
    pub fn options(&self) -> Rotor37Options {
        let of_the_paper = self.contact_nodes.is_some();
        let defaults = if of_the_paper { Rotor37Options::paper() } else { Rotor37Options::default() };
        Rotor37Options {
            mesh: self.mesh.map_or(defaults.mesh, |size| {
                let [chord, thickness, span] = size.0;
                MeshCounts { chord, thickness, span }
            }),
            tip: match (self.contact_nodes, self.contact_patches, defaults.tip.counts()) {
                (Some(nodes), ..) => TipContact::Nodes(nodes),
                (None, patches, [own, rows]) => {
                    TipContact::patches([patches.unwrap_or(own), self.contact_rows.unwrap_or(rows)])
                }
            },
            kind: KindChoice::kind(self.kind, !of_the_paper),
            modes: self.modes.unwrap_or(defaults.modes),
            spin: self.spin,
            ..defaults
        }
    }
}

impl StageArguments {
    /// Returns name and options of the disk. A coarse disk has contact nodes unless patches are requested, because its elements are wider than nine
    /// patches.
    pub fn options(&self) -> (&'static str, StageOptions) {
        let [patches, rows] = builtin::stage().1.tip.counts();
        let has_patches = self.contact_patches.or(self.contact_rows).is_some();
        let has_nodes = self.contact_nodes.is_some() || (self.coarse && !has_patches);
        let (_, defaults) = if self.coarse { builtin::stage_nodes(true) } else { builtin::stage() };
        let options = StageOptions {
            tip: match (self.contact_nodes, self.contact_patches) {
                (Some(nodes), _) => TipContact::Nodes(nodes),
                (None, None) if has_nodes => defaults.tip,
                (None, own) => TipContact::patches([own.unwrap_or(patches), self.contact_rows.unwrap_or(rows)]),
            },
            kind: KindChoice::kind(self.kind, !has_nodes),
            modes: self.modes.map_or(defaults.modes, ModeSelection::Families),
            ..defaults
        };
        let name = match (has_nodes, self.coarse) {
            (false, false) => "stage",
            (false, true) => "stage-coarse",
            (true, false) => "stage-nodes",
            (true, true) => "stage-nodes-coarse",
        };
        (name, options)
    }
}

/// Arguments of `tiprub reduce stage`.
#[derive(Debug, Args)]
pub struct StageArguments {
    /// Use a coarse mesh and few modes, for trials.
    #[arg(long)]
    pub coarse: bool,
    /// Number of modes kept per nodal diameter, in whole families [default: 25; 12 for the coarse mesh].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Number of contact nodes along the tip chord, instead of patches [default: none; 3 for the coarse mesh].
    #[arg(long, value_name = "N")]
    pub contact_nodes: Option<usize>,
    /// Number of contact patches along the tip chord [default: 9; none for the coarse mesh].
    #[arg(long, value_name = "N", conflicts_with = "contact_nodes")]
    pub contact_patches: Option<usize>,
    /// Rows of patches across the thickness, from side to side [default: 2].
    #[arg(long, value_name = "R", conflicts_with = "contact_nodes")]
    pub contact_rows: Option<usize>,
    /// Kind of modes to keep [default: free-interface; craig-bampton with contact nodes].
    #[arg(long, value_enum)]
    pub kind: Option<KindChoice>,
    /// Output options.
    #[command(flatten)]
    pub written: OutputArguments,
}

/// Arguments of `tiprub reduce stage-casing`.
#[derive(Debug, Args)]
pub struct StageCasingArguments {
    /// Use an eighth of the elements around the circumference, for trials.
    #[arg(long)]
    pub coarse: bool,
    /// Number of lowest modes kept in the ROM [default: 60].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Number of fixed-interface modes used for the reduction [default: 160].
    #[arg(long, value_name = "N")]
    pub fixed_interface_modes: Option<usize>,
    /// Contact nodes around the circumference and along the axis [default: 28x3].
    #[arg(long, value_name = "AxL", value_parser = pair)]
    pub contact_grid: Option<[usize; 2]>,
    /// Thermal patches around the circumference and along the axis [default: none].
    #[arg(long, value_name = "AxL", value_parser = pair)]
    pub patches: Option<[usize; 2]>,
    /// Material [default: titanium].
    #[arg(long, value_enum)]
    pub material: Option<MaterialChoice>,
    /// Output options.
    #[command(flatten)]
    pub written: OutputArguments,
}

/// Arguments of `tiprub reduce cube`.
#[derive(Debug, Args)]
pub struct CubeArguments {
    /// Number of modes kept; free-interface modes are counted without the rigid-body modes [default: all].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Contact patches along y and along z on each face, instead of the nodes of the face.
    #[arg(long, value_name = "YxZ", value_parser = pair)]
    pub contact_patches: Option<[usize; 2]>,
    /// Kind of modes to keep [default: craig-bampton; free-interface with patches].
    #[arg(long, value_enum, requires = "modes")]
    pub kind: Option<KindChoice>,
    /// Mass matrix of the finite elements [default: lumped].
    #[arg(long, value_enum)]
    pub mass_matrix: Option<MassChoice>,
    /// Output options.
    #[command(flatten)]
    pub written: OutputArguments,
}

/// Arguments of `tiprub reduce ring-left` and `ring-right`.
#[derive(Debug, Args)]
pub struct CubeRingArguments {
    /// Number of modes kept [default: 100].
    #[arg(long, value_name = "N")]
    pub modes: Option<usize>,
    /// Number of static responses to contact forces kept in addition to the modes [default: 0].
    #[arg(long, value_name = "N")]
    pub static_responses: Option<usize>,
    /// Mass matrix of the finite elements [default: lumped].
    #[arg(long, value_enum)]
    pub mass_matrix: Option<MassChoice>,
    /// Output options.
    #[command(flatten)]
    pub written: OutputArguments,
}

/// Mass matrix of finite elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MassChoice {
    /// Mass lumped at the nodes.
    Lumped,
    /// Mass distributed by the shape functions of the elements.
    Consistent,
}

impl From<MassChoice> for MassMatrix {
    fn from(choice: MassChoice) -> Self {
        match choice {
            MassChoice::Lumped => Self::Lumped,
            MassChoice::Consistent => Self::Consistent,
        }
    }
}

impl ModelToReduce {
    /// Returns the output options.
    pub fn written(&self) -> &OutputArguments {
        match self {
            Self::Blade(own) => &own.written,
            Self::Sector(own) => &own.written,
            Self::CasingMesh(own) => &own.written,
            Self::Casing(own) => &own.written,
            Self::Rotor37(own) => &own.written,
            Self::Stage(own) => &own.written,
            Self::StageCasing(own) => &own.written,
            Self::Cube(own) => &own.written,
            Self::RingLeft(own) | Self::RingRight(own) => &own.written,
        }
    }

    /// Returns the name that the model will have.
    pub fn name(&self) -> String {
        let [left, right] = builtin::RINGS;
        match self {
            Self::Blade(own) => own.source().name(),
            Self::Sector(own) => own.source().name(),
            Self::CasingMesh(own) => own.source().name(),
            Self::Casing(own) => own.options().name,
            Self::Rotor37(_) => "rotor37".to_owned(),
            Self::Stage(own) => own.options().0.to_owned(),
            Self::StageCasing(own) => builtin::stage_casing(own.coarse).name,
            Self::Cube(_) => builtin::CUBE.to_owned(),
            Self::RingLeft(_) => left.0.to_owned(),
            Self::RingRight(_) => right.0.to_owned(),
        }
    }

    /// Returns the files that describe the model.
    pub fn files(&self) -> Vec<NamedFile> {
        match self {
            Self::Blade(own) => own.source().files(),
            Self::Sector(own) => own.source().files(),
            Self::CasingMesh(own) => own.source().files(),
            _ => Vec::new(),
        }
    }
}

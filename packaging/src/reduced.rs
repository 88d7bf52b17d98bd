//! Reduced model of any kind, with all data for its files and its description.

use serde_json::Value;
use tiprub_core::Rom;
use tiprub_core::limits::plausibility::Slip;
use tiprub_model::{
    Material, Mesh, Reduction, SurfaceShapes,
    cyclic::CyclicReduction,
    inp::{CyclicSymmetry, calculix_cyclic_input, calculix_input},
    spin::SpinCheck,
    vtk::{self, NodalField},
};
use tiprub_shell::{Failure, Result};

/// Number of frequencies that the exported finite-element model requests.
const EXPORTED_FREQUENCIES: usize = 10;
/// Largest number of nodal diameters that the exported model of a sector requests.
const EXPORTED_DIAMETERS: usize = 3;
/// Number of modes per nodal diameter in the exported picture of a sector.
const DRAWN_MODES: usize = 3;

/// Reduced model with its full model and description.
#[derive(Debug)]
pub struct ReducedModel {
    /// Reduced-order model, including the checks.
    pub rom: Rom,
    /// Mesh and material, if there is one mesh with one material.
    pub mesh: Option<(Mesh, Material)>,
    /// Number of nodes of the full model (of one sector).
    pub nodes: usize,
    /// Number of degrees of freedom that are not clamped.
    pub free_dofs: usize,
    /// Largest relative residual of the full modes, if it is known.
    pub largest_residual: Option<f64>,
    /// Quality of the spin arrays; empty if they were not requested.
    pub spin_checks: Vec<SpinCheck>,
    /// Wall time (s).
    pub seconds: f64,
    /// Name of the set of clamped nodes, for exported files.
    pub clamped: Option<String>,
    /// Names of the sets of the two faces of a sector, for exported files.
    pub faces: Option<[String; 2]>,
    /// Mode shapes for pictures.
    pub fields: Vec<NodalField>,
    /// Surface with its displacements per reduced coordinate; `None` without a mesh.
    pub shapes: Option<SurfaceShapes>,
    /// Description of the file that was read, as text and as JSON.
    pub read: (String, Value),
    /// Warnings.
    pub warnings: Vec<String>,
    /// Implausible values.
    pub slips: Vec<Slip>,
}

impl ReducedModel {
    /// Creates the model from a general reduction; `clamped` is a set of its mesh.
    pub fn general(reduction: Reduction, clamped: Option<&str>) -> Self {
        let field = |(mode, number): (&tiprub_model::reduce::Mode, usize)| {
            NodalField::vectors(format!("mode_{number}_{:.1}_Hz", mode.frequency), mode.shape.clone())
        };
        Self {
            fields: reduction.modes.iter().zip(1..).map(field).collect(),
            shapes: reduction.shapes,
            rom: reduction.rom,
            mesh: reduction.mesh.zip(reduction.material),
            nodes: reduction.nodes,
            free_dofs: reduction.free_dofs,
            largest_residual: Some(reduction.largest_residual),
            spin_checks: reduction.spin_checks,
            seconds: 0.0,
            clamped: clamped.map(str::to_owned),
            faces: None,
            read: (String::new(), Value::Null),
            warnings: Vec::new(),
            slips: Vec::new(),
        }
    }

    /// Creates the model from the reduction of a sector with this mesh.
    pub fn cyclic(
        reduction: CyclicReduction,
        mesh: Option<(Mesh, Material)>,
        nodes: usize,
        clamped: Option<&str>,
        faces: [&str; 2],
    ) -> Self {
        let fields = reduction.nodal_diameters.iter().flat_map(|found| {
            let shapes = found.shapes.iter().zip(&found.full_frequencies).zip(1..).take(DRAWN_MODES);
            shapes.flat_map(|((shape, frequency), number)| {
                NodalField::mode(&format!("diameter_{}_mode_{number}_{frequency:.1}_Hz", found.number), shape)
            })
        });
        Self {
            fields: fields.collect(),
            shapes: reduction.shapes,
            rom: reduction.rom,
            mesh,
            nodes,
            free_dofs: reduction.free_dofs,
            largest_residual: None,
            spin_checks: Vec::new(),
            seconds: 0.0,
            clamped: clamped.map(str::to_owned),
            faces: Some(faces.map(str::to_owned)),
            read: (reduction.notes.join("\n"), Value::Null),
            warnings: Vec::new(),
            slips: Vec::new(),
        }
    }

    fn mesh_for(&self, option: &str) -> Result<&(Mesh, Material)> {
        self.mesh.as_ref().ok_or_else(|| {
            Failure::usage(option, "the model has no mesh of one material to export", format!("Omit {option}"))
        })
    }

    /// Returns the full model as a CalculiX input file, with cyclic symmetry for a sector.
    ///
    /// # Errors
    /// The model has no mesh.
    pub fn calculix(&self) -> Result<Vec<u8>> {
        let (mesh, material) = self.mesh_for("--inp")?;
        let clamped = self.clamped.as_deref();
        let text = match &self.faces {
            None => calculix_input(mesh, material, clamped, EXPORTED_FREQUENCIES),
            Some([low, high]) => {
                let sectors = self.rom.sectors;
                let diameters: Vec<usize> = (0..=sectors / 2).take(EXPORTED_DIAMETERS).collect();
                let symmetry = CyclicSymmetry { faces: [low, high], sectors, nodal_diameters: &diameters };
                calculix_cyclic_input(mesh, material, clamped, &symmetry, EXPORTED_FREQUENCIES)
            }
        };
        text.map(String::into_bytes).map_err(|error| Failure::from_below("--inp", error))
    }

    /// Returns mesh, sets and mode shapes for ParaView.
    ///
    /// # Errors
    /// The model has no mesh.
    pub fn vtk(&self) -> Result<Vec<u8>> {
        let (mesh, _) = self.mesh_for("--vtk")?;
        vtk::write(mesh, &self.fields).map_err(|error| Failure::from_below("--vtk", error))
    }
}

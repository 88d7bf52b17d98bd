//! A reduced model with everything that is written and told about it, whatever it was made of.

use serde_json::Value;
use tiprub_core::{Rom, plausibility::Slip};
use tiprub_model::{
    Material, Mesh, Reduction,
    cyclic::CyclicReduction,
    inp::{CyclicSymmetry, calculix_cyclic_input, calculix_input},
    spin::SpinCheck,
    vtk::{self, NodalField},
};
use tiprub_shell::{Failure, Result};

/// Frequencies asked for in the exported finite-element model.
const EXPORTED_FREQUENCIES: usize = 10;
/// Nodal diameters asked for in the exported model of a sector: the first few.
const EXPORTED_DIAMETERS: usize = 3;
/// Modes per nodal diameter drawn in the exported picture of a sector.
const DRAWN_MODES: usize = 3;

/// A reduced model.
#[derive(Debug)]
pub struct ReducedModel {
    /// The reduced-order model, checks included.
    pub rom: Rom,
    /// Mesh and material, where there is one mesh of one material.
    pub mesh: Option<(Mesh, Material)>,
    /// Number of nodes of the full model (of one sector).
    pub nodes: usize,
    /// Degrees of freedom that are not clamped.
    pub free_dofs: usize,
    /// Largest relative residual of the full modes, where it is known.
    pub largest_residual: Option<f64>,
    /// Quality of the spin arrays; empty if they were not requested.
    pub spin_checks: Vec<SpinCheck>,
    /// Wall time (s).
    pub seconds: f64,
    /// Set of clamped nodes, for exported files.
    pub clamped: Option<String>,
    /// Sets of the two faces of a sector, for exported files.
    pub faces: Option<[String; 2]>,
    /// Mode shapes for pictures.
    pub fields: Vec<NodalField>,
    /// Description of the file that was read: for people, and for programs.
    pub read: (String, Value),
    /// Warnings.
    pub warnings: Vec<String>,
    /// Values that are rarely meant.
    pub slips: Vec<Slip>,
}

impl ReducedModel {
    /// From a general reduction; `clamped` is a set of its mesh.
    pub fn general(reduction: Reduction, clamped: Option<&str>) -> Self {
        let field = |(mode, number): (&tiprub_model::reduce::Mode, usize)| {
            NodalField::vectors(format!("mode_{number}_{:.1}_Hz", mode.frequency), mode.shape.clone())
        };
        Self {
            fields: reduction.modes.iter().zip(1..).map(field).collect(),
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

    /// From the reduction of a sector with this mesh.
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

    /// The full model as a CalculiX input file: with cyclic symmetry, where it is a sector.
    ///
    /// # Errors
    /// A model without a mesh.
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

    /// Mesh, sets and mode shapes for ParaView.
    ///
    /// # Errors
    /// A model without a mesh.
    pub fn vtk(&self) -> Result<Vec<u8>> {
        let (mesh, _) = self.mesh_for("--vtk")?;
        vtk::write(mesh, &self.fields).map_err(|error| Failure::from_below("--vtk", error))
    }
}

//! Mesh options of a sector, and its mesh.

use super::geometry::SectorGeometry;
use crate::element::ElementKind;
use crate::mesh::Mesh;
use crate::patches::{contact_patches, row_name, tip_patches};
use crate::reduce::ContactPoint;
use crate::rotor37::{place_name, spread_contact};
use crate::{Error, Result};

/// Numbers of elements in the parts of a sector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SectorCounts {
    /// Columns of the blade, leading to trailing edge; even, so that there is a middle column.
    pub chord: usize,
    /// Rows of the blade, root to tip; the first one is the fillet, if any.
    pub span: usize,
    /// Layers through the blade.
    pub thickness: usize,
    /// Layers on either side of the blade, in the disk.
    pub side: usize,
    /// Columns of the rim before and behind the blade.
    pub overhang: usize,
    /// Rows of the rim.
    pub rim: usize,
    /// Columns and rows of the web; the number of columns is that of the rim minus an even number.
    pub web: [usize; 2],
    /// Columns of the ring at the bore on either side of the web, and its rows.
    pub bore: [usize; 2],
}

impl Default for SectorCounts {
    /// Returns the counts of a mesh with 6,734 nodes of quadratic prisms.
    fn default() -> Self {
        Self { chord: 12, span: 18, thickness: 1, side: 2, overhang: 2, rim: 3, web: [6, 12], bore: [2, 2] }
    }
}

/// Options of the sector. Lengths and numbers of elements are independent of each other.
#[derive(Debug, Clone, PartialEq)]
pub struct SectorOptions {
    /// Shape.
    pub geometry: SectorGeometry,
    /// Numbers of elements.
    pub counts: SectorCounts,
    /// Element kind: penta15 or penta6.
    pub kind: ElementKind,
}

impl Default for SectorOptions {
    /// Returns quadratic prisms with the number of nodes of the paper.
    fn default() -> Self {
        Self { geometry: SectorGeometry::default(), counts: SectorCounts::default(), kind: ElementKind::Penta15 }
    }
}

impl SectorOptions {
    /// Returns options with the number of elements of the paper, 3,764 quadratic prisms, which have 13,205 nodes.
    pub fn with_3764_elements() -> Self {
        let counts = SectorCounts {
            chord: 14,
            span: 28,
            thickness: 1,
            side: 2,
            overhang: 2,
            rim: 5,
            web: [8, 19],
            bore: [3, 4],
        };
        Self { counts, ..Self::default() }
    }

    /// Returns options with 294 nodes, for quick tests and trials: the rim ends with the blade, the bore is no wider
    /// than the web, and there is no fillet.
    pub fn coarse() -> Self {
        let counts =
            SectorCounts { chord: 2, span: 3, thickness: 1, side: 1, overhang: 0, rim: 1, web: [2, 2], bore: [0, 1] };
        let mut geometry = SectorGeometry::default();
        geometry.blade.fillet = 0.0;
        geometry.disk.rim_axial = geometry.blade.root_axial;
        geometry.disk.bore_width = geometry.disk.web_thickness[0];
        Self { geometry, counts, kind: ElementKind::Penta15 }
    }
}

impl SectorOptions {
    /// Checks that the numbers match each other and the shape.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the number or length.
    pub(crate) fn validate(&self) -> Result<()> {
        self.geometry.validate()?;
        let (counts, geometry) = (&self.counts, &self.geometry);
        let SectorCounts { chord, span, thickness, side, overhang, rim, web, bore } = *counts;
        let named = [("chord", chord), ("span", span), ("thickness", thickness), ("side", side), ("rim", rim)];
        let named = named.into_iter().chain([("web columns", web[0]), ("web rows", web[1]), ("bore rows", bore[1])]);
        for (name, count) in named {
            if count == 0 {
                return refuse(name, "it is zero".to_owned(), "Give at least one element");
            }
        }
        if chord % 2 != 0 {
            return refuse(
                "chord",
                format!("{chord} is odd"),
                "Give an even number: contact is evaluated at mid-chord",
            );
        }
        let columns = counts.columns();
        if web[0] % 2 != 0 || web[0] + 2 * bore[0] > columns {
            let problem = format!("{} for the web and 2 x {} for the bore, but {columns} for the rim", web[0], bore[0]);
            return refuse(
                "web and bore",
                problem,
                "Give an even number for the web and a total not exceeding the rim's",
            );
        }
        let kind_fits = match self.kind {
            ElementKind::Penta15 => true,
            // The middle of the thickness must be between two layers, since these edges have no mid-side nodes.
            ElementKind::Penta6 => thickness % 2 == 0,
            _ => false,
        };
        if !kind_fits {
            let name = self.kind.calculix_name();
            let problem = format!("{name} with {thickness} layers through the blade is not supported");
            return refuse("element kind", problem, "Choose penta15, or penta6 with an even number of layers");
        }
        let (disk, blade) = (&geometry.disk, &geometry.blade);
        let longer = [disk.rim_axial[0] < blade.root_axial[0], disk.rim_axial[1] > blade.root_axial[1]];
        if longer != [overhang > 0; 2] {
            let problem = format!(
                "{overhang} does not match the axial ranges of the rim, {:?} m, and of the root, {:?} m",
                disk.rim_axial, blade.root_axial
            );
            return refuse(
                "overhang",
                problem,
                "Give columns if the rim extends beyond the root at both ends, otherwise zero",
            );
        }
        if (disk.bore_width > disk.web_thickness[0]) != (bore[0] > 0) {
            let (columns, width, web) = (bore[0], disk.bore_width, disk.web_thickness[0]);
            let problem = format!("{columns} does not fit a bore width of {width} m and a web thickness of {web} m");
            return refuse("bore", problem, "Give columns if the bore is wider than the web, otherwise zero");
        }
        Ok(())
    }
}

fn refuse(count: &str, problem: String, remedy: &str) -> Result<()> {
    Err(Error::invalid(format!("stage, number of elements `{count}`"), problem, remedy))
}

impl SectorCounts {
    /// Returns the number of columns of the rim.
    pub(super) fn columns(&self) -> usize {
        self.chord + 2 * self.overhang
    }

    /// Returns the number of layers of the disk.
    pub(super) fn layers(&self) -> usize {
        self.thickness + 2 * self.side
    }
}

/// Mesh of prisms with the line of possible contact nodes on its tip.
#[derive(Debug, Clone)]
pub struct SectorMesh {
    /// Node sets `CLAMPED` (the bore, or the root if there is no disk), `TIP`, `CONTACT` (leading edge, mid-chord and
    /// trailing edge in the middle of the thickness of the tip), `BLADE`, `ROOT` (of the blade), and for a sector
    /// `CYCLIC_LOW` and `CYCLIC_HIGH`, the latter rotated by +2π/sectors.
    pub mesh: Mesh,
    /// Nodes in the middle of the thickness of the tip, leading to trailing edge.
    pub tip_line: Vec<usize>,
}

impl SectorMesh {
    /// Returns `count` contact nodes spread along [`tip_line`](Self::tip_line), named like those of
    /// [rotor 37](crate::rotor37::BladeMesh::contact_points).
    ///
    /// # Errors
    /// [`Error::Invalid`] for fewer than two nodes or more than the line has.
    pub fn contact_points(&self, count: usize) -> Result<Vec<ContactPoint>> {
        spread_contact(&self.tip_line, &vec![0.0; self.tip_line.len()], count)
    }

    /// Returns `count` contact patches over the whole tip, named like contact nodes.
    ///
    /// # Errors
    /// The errors of [`contact_patches`].
    pub fn contact_patches(&self, count: usize) -> Result<Vec<ContactPoint>> {
        contact_patches(&self.mesh, self.mesh.set("TIP")?, count, |index| place_name(index, count))
    }

    /// Returns contact patches in rows across the thickness, side to side.
    ///
    /// # Errors
    /// The errors of [`tip_patches`].
    pub fn contact_rows(&self, [count, rows]: [usize; 2]) -> Result<Vec<ContactPoint>> {
        let name = |index: usize| row_name(&place_name(index % count, count), index / count, rows);
        tip_patches(&self.mesh, self.mesh.set("TIP")?, [count, rows], name)
    }
}

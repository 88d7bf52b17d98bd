//! Mesh of one sector: triangles in the meridional plane, swept along the circumference into prisms.
//!
//! A lattice of columns (along the axis), rows (along the radius) and layers (around) has cells where the sector has
//! material; each cell is cut into two prisms by a diagonal of its meridional face. The blade uses the middle layers,
//! so that its nodes coincide with those of the disk, and the lowest and highest layer end in faces that differ by
//! exactly one pitch. The cut between sectors follows the camber line at the rim and is flat at the bore.

use std::collections::{BTreeMap, BTreeSet};

use super::geometry::SectorGeometry;
use super::sector::{SectorCounts, SectorMesh, SectorOptions};
use crate::Result;
use crate::element::ElementKind;
use crate::mesh::{Element, Mesh};

/// Position in the lattice: row, column and layer, doubled, so that the middles of edges have integer numbers.
pub(super) type LatticeIndex = [usize; 3];

/// Lattice with the numbers of its parts.
pub(super) struct Lattice<'a> {
    pub geometry: &'a SectorGeometry,
    pub counts: SectorCounts,
    kind: ElementKind,
    /// First row of the web, of the rim, of the blade.
    pub web: usize,
    pub rim: usize,
    pub hub: usize,
    /// First column of the web.
    pub web_column: usize,
}

/// Relative difference below which the lengths of diagonals count as equal.
const ALIKE: f64 = 0.05;

impl<'a> Lattice<'a> {
    fn new(options: &'a SectorOptions) -> Result<Self> {
        options.validate()?;
        let (counts, kind) = (options.counts, options.kind);
        let (web, rim) = (counts.bore[1], counts.bore[1] + counts.web[1]);
        let web_column = (counts.columns() - counts.web[0]) / 2;
        Ok(Self { geometry: &options.geometry, counts, kind, web, rim, hub: rim + counts.rim, web_column })
    }

    /// Returns the columns and layers that have cells in a row.
    fn extent(&self, row: usize) -> [core::ops::Range<usize>; 2] {
        let counts = &self.counts;
        let (web, layers) = (self.web_column..self.web_column + counts.web[0], 0..counts.layers());
        if row < self.web {
            [web.start - counts.bore[0]..web.end + counts.bore[0], layers]
        } else if row < self.rim {
            [web, layers]
        } else if row < self.hub {
            [0..counts.columns(), layers]
        } else {
            [counts.overhang..counts.overhang + counts.chord, counts.side..counts.side + counts.thickness]
        }
    }

    /// Returns the number of rows of the whole sector.
    pub(super) fn rows(&self) -> usize {
        self.hub + self.counts.span
    }

    /// Returns the elements as lattice positions, from a row outwards.
    fn prisms(&self, first_row: usize) -> Vec<Vec<LatticeIndex>> {
        let mut prisms = Vec::new();
        for row in first_row..self.rows() {
            let [columns, layers] = self.extent(row);
            for column in columns {
                for layer in layers.clone() {
                    prisms.extend(self.triangles(row, column).map(|corners| self.prism(corners, layer)));
                }
            }
        }
        prisms
    }

    /// Returns the two triangles (row, column) of a cell, counter-clockwise in the plane of z and r: cut along the
    /// shorter diagonal, or alternately if both are equal.
    fn triangles(&self, row: usize, column: usize) -> [[[usize; 2]; 3]; 2] {
        let corner = |i: usize, j: usize| [row + i, column + j];
        let [a, b, c, d] = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)];
        let length = |from: [usize; 2], to: [usize; 2]| {
            let [p, q] = [from, to].map(|[i, j]| self.position([2 * i, 2 * j, self.counts.layers()]));
            (0..3).map(|d| (p[d] - q[d]).powi(2)).sum::<f64>().sqrt()
        };
        let (rising, falling) = (length(a, c), length(b, d));
        let alike = (rising - falling).abs() < ALIKE * rising;
        if if alike { (row + column).is_multiple_of(2) } else { rising < falling } {
            [[a, b, c], [a, c, d]]
        } else {
            [[a, b, d], [b, c, d]]
        }
    }

    /// Returns the positions of the nodes of a prism in the order of its kind.
    fn prism(&self, corners: [[usize; 2]; 3], layer: usize) -> Vec<LatticeIndex> {
        let end = |layer: usize| corners.map(|[row, column]| [2 * row, 2 * column, 2 * layer]);
        let mut places = [end(layer), end(layer + 1)].concat();
        if self.kind == ElementKind::Penta15 {
            let middle = |&[a, b]: &[usize; 2]| core::array::from_fn(|d| usize::midpoint(places[a][d], places[b][d]));
            places.extend(self.kind.edges().iter().map(middle).collect::<Vec<_>>());
        }
        places
    }

    fn mesh(&self, first_row: usize) -> Result<SectorMesh> {
        let prisms = self.prisms(first_row);
        let places: BTreeSet<LatticeIndex> = prisms.iter().flatten().copied().collect();
        let numbers: BTreeMap<LatticeIndex, usize> =
            places.iter().enumerate().map(|(number, place)| (*place, number)).collect();
        let element = |places: &Vec<LatticeIndex>| Element {
            kind: self.kind,
            nodes: places.iter().map(|place| numbers[place]).collect(),
        };
        let mut mesh = Mesh {
            nodes: places.iter().map(|place| self.position(*place)).collect(),
            elements: prisms.iter().map(element).collect(),
            sets: BTreeMap::new(),
        };
        let numbered = |wanted: &dyn Fn(LatticeIndex) -> bool| -> Vec<usize> {
            numbers.iter().filter(|(place, _)| wanted(**place)).map(|(_, &number)| number).collect()
        };
        let [blade_columns, blade_layers] = self.extent(self.hub).map(|range| 2 * range.start..=2 * range.end);
        let of_blade = |[row, column, layer]: LatticeIndex| {
            row >= 2 * self.hub && blade_columns.contains(&column) && blade_layers.contains(&layer)
        };
        let layers = self.counts.layers();
        let tip_line = numbered(&|[row, _, layer]| row == 2 * self.rows() && layer == layers);
        let mut insert = |name: &str, nodes: Vec<usize>| mesh.sets.insert(name.to_owned(), nodes);
        insert("BLADE", numbered(&of_blade));
        insert("ROOT", numbered(&|place| place[0] == 2 * self.hub && of_blade(place)));
        insert("TIP", numbered(&|place| place[0] == 2 * self.rows()));
        insert("CLAMPED", numbered(&|place| place[0] == 2 * first_row));
        if first_row < self.hub {
            insert("CYCLIC_LOW", numbered(&|place| place[2] == 0));
            insert("CYCLIC_HIGH", numbered(&|place| place[2] == 2 * layers));
        }
        let mut sector = SectorMesh { mesh, tip_line };
        let contact = sector.contact_points(3)?.iter().map(|point| point.node).collect();
        sector.mesh.sets.insert("CONTACT".to_owned(), contact);
        Ok(sector)
    }
}

/// Builds the mesh of one sector of the bladed disk.
///
/// # Errors
/// [`crate::Error::Invalid`] for lengths that define no bladed disk, and for numbers of elements that do not match
/// each other or the shape.
pub fn sector_mesh(options: &SectorOptions) -> Result<SectorMesh> {
    Lattice::new(options)?.mesh(0)
}

/// Builds the mesh of the blade alone, clamped at its root.
///
/// # Errors
/// The errors of [`sector_mesh`].
pub fn blade_mesh(options: &SectorOptions) -> Result<SectorMesh> {
    let lattice = Lattice::new(options)?;
    lattice.mesh(lattice.hub)
}

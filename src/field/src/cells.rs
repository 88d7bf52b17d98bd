//! Cells between contact nodes, and copies of cells for all sectors.

use tiprub_core::Rom;
use tiprub_core::scene::settings::ContactSettings;

use crate::structure::Structure;
use crate::vtu::cell;

/// Cells with their corners and VTK types.
pub(crate) type Cells = Vec<(Vec<usize>, u8)>;

/// Returns one cell for each of `count` points.
pub(crate) fn points_alone(count: usize) -> Cells {
    (0..count).map(|point| (vec![point], cell::VERTEX)).collect()
}

/// Repeats the cells of one sector, which has `points` points, for each sector.
pub(crate) fn repeated(cells: &Cells, points: usize, sectors: usize) -> Cells {
    let of_sector = |sector: usize| {
        let moved = move |corners: &[usize]| corners.iter().map(|corner| sector * points + corner).collect();
        cells.iter().map(move |(corners, kind)| (moved(corners), *kind))
    };
    (0..sectors).flat_map(of_sector).collect()
}

/// Returns the contact nodes of each contact of a structure.
pub(crate) fn groups(structure: &Structure, contacts: &[ContactSettings]) -> Vec<Vec<usize>> {
    let nodes = &structure.rom.contact_nodes;
    let own = contacts.iter().filter(|contact| contact.master == structure.name);
    let group = |contact: &ContactSettings| {
        let start = contact.nodes.as_deref().unwrap_or_default();
        (0..nodes.len()).filter(|node| nodes[*node].name.starts_with(start)).collect()
    };
    own.map(group).collect()
}

/// Returns the cells between contact nodes: faces of a grid, faces between rows of patches, or lines along the chord.
pub(crate) fn contact_cells(rom: &Rom, groups: Vec<Vec<usize>>) -> Cells {
    let count = rom.contact_nodes.len();
    let faces = |around: usize, along: usize, closed: bool| -> Cells {
        let steps = if closed { around } else { around - 1 };
        let face = |k: usize, i: usize| {
            let next = (i + 1) % around;
            vec![k * around + i, k * around + next, (k + 1) * around + next, (k + 1) * around + i]
        };
        (0..along - 1).flat_map(|k| (0..steps).map(move |i| (face(k, i), cell::QUAD))).collect()
    };
    if let Some(grid) = rom.extras.grid {
        return faces(grid.around, grid.along, grid.closed);
    }
    if let Some(rows) = rom.extras.rows.filter(|rows| *rows > 1 && count / rows > 1 && groups.len() == 1) {
        return faces(count / rows, rows, false);
    }
    let is_line = |group: &Vec<usize>| group.len() > 1 && rom.extras.rows.is_none_or(|rows| rows == 1);
    if rom.frame == tiprub_core::scene::rom::DisplacementFrame::Cylindrical
        && groups.iter().all(is_line)
        && !groups.is_empty()
    {
        return groups.into_iter().map(|group| (group, cell::POLY_LINE)).collect();
    }
    points_alone(count)
}

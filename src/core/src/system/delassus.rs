//! The Delassus matrix W = C_Nᵀ A⁻¹ C_NT of the contact nodes of one structure, from its flexibility over one step.

use super::contact_view::ContactMember;
use crate::math::simd::Kernel;
use crate::math::vector::Vector3;
use crate::modes::bank::{Disk, ModalBank};
use nalgebra::DMatrix;

/// Contacts of a structure within a group, with their directions and the position of their block in the matrix.
pub(crate) struct DelassusBlock<'a> {
    /// The contacts.
    pub members: &'a [ContactMember],
    /// Directions of the rows, `per` for each contact.
    pub rows: &'a [Vector3],
    /// Directions of the columns, `per` for each contact.
    pub columns: &'a [Vector3],
    /// Directions per contact.
    pub per: usize,
    /// Index of the first contact of the block within the group.
    pub first: usize,
}

/// Fills the block of contacts of a structure (m/N).
pub fn fill(matrix: &mut DMatrix<f64>, bank: &ModalBank, nodes: usize, block: &DelassusBlock) {
    match bank.disk() {
        // One sector with all of its nodes.
        None if is_whole_sector(block, nodes) => {
            let flexibility = bank.flexibility(block.members[0].sector).as_slice();
            match block.per {
                1 => fill_sector::<1>(matrix, flexibility, block.rows, block.columns),
                _ => fill_sector::<3>(matrix, flexibility, block.rows, block.columns),
            }
        }
        None => fill_sectors(matrix, bank, block),
        Some(disk) => fill_disk(matrix, bank, disk, block),
    }
}

/// Fills W of nodes of a disk of coupled sectors.
#[inline(never)]
fn fill_disk(matrix: &mut DMatrix<f64>, bank: &ModalBank, disk: &Disk, block: &DelassusBlock) {
    match block.per {
        1 => bank.instruction_set.run(FillDisk::<1> { matrix, disk, block }),
        _ => bank.instruction_set.run(FillDisk::<3> { matrix, disk, block }),
    }
}

fn is_whole_sector(block: &DelassusBlock, nodes: usize) -> bool {
    let (members, first) = (block.members, block.members[0]);
    block.first == 0 && members.len() == nodes && members[members.len() - 1].sector == first.sector
}

/// Fills W of nodes of uncoupled sectors.
#[inline(never)]
fn fill_sectors(matrix: &mut DMatrix<f64>, bank: &ModalBank, block: &DelassusBlock) {
    let (height, per, start) = (bank.rows(), block.per, block.per * block.first);
    for (member, &ContactMember { node: column_node, sector, .. }) in block.members.iter().enumerate() {
        let flexibility = bank.flexibility(sector).as_slice();
        let [first, second, third] = std::array::from_fn(|j| &flexibility[(3 * column_node + j) * height..][..height]);
        for along in per * member..per * (member + 1) {
            let direction = block.columns[along];
            for (other, row) in block.members.iter().enumerate() {
                let at = 3 * row.node;
                let same = row.sector == sector;
                let value = |i: usize| first[i] * direction[0] + second[i] * direction[1] + third[i] * direction[2];
                let moved = Vector3::new(value(at), value(at + 1), value(at + 2));
                for across in per * other..per * (other + 1) {
                    let value = if same { block.rows[across].dot(&moved) } else { 0.0 };
                    matrix[(start + across, start + along)] = value;
                }
            }
        }
    }
}

/// W of nodes of a disk of coupled sectors, as a kernel.
struct FillDisk<'a, const PER: usize> {
    matrix: &'a mut DMatrix<f64>,
    disk: &'a Disk,
    block: &'a DelassusBlock<'a>,
}

impl<const PER: usize> Kernel for FillDisk<'_, PER> {
    #[inline(always)]
    fn run(self) {
        let Self { matrix, disk, block } = self;
        let (sectors, leading) = (disk.model().sectors, matrix.nrows());
        let (members, start) = (block.members, PER * block.first);
        let targets = matrix.as_mut_slice().chunks_exact_mut(PER * leading).skip(block.first);
        let columns = block.columns.as_chunks::<PER>().0;
        for ((column, directions), targets) in members.iter().zip(columns).zip(targets) {
            for ((other, row), across) in members.iter().enumerate().zip(block.rows.as_chunks::<PER>().0) {
                let difference = row.sector + if row.sector < column.sector { sectors } else { 0 } - column.sector;
                let [first, second, third] = disk.flexibility(difference, column.node, row.node);
                for (along, direction) in directions.iter().enumerate() {
                    let mut moved = [0.0; 4];
                    for i in 0..4 {
                        moved[i] = first[i] * direction[0] + second[i] * direction[1] + third[i] * direction[2];
                    }
                    let moved = Vector3::new(moved[0], moved[1], moved[2]);
                    let target = &mut targets[along * leading + start + PER * other..][..PER];
                    for (value, row) in target.iter_mut().zip(across) {
                        *value = row.dot(&moved);
                    }
                }
            }
        }
    }
}

/// Fills W of all nodes of one sector with `PER` directions each; `flexibility` is G column by column.
fn fill_sector<const PER: usize>(
    matrix: &mut DMatrix<f64>,
    flexibility: &[f64],
    rows: &[Vector3],
    columns: &[Vector3],
) {
    let components = 3 * columns.len() / PER;
    let leading = matrix.nrows();
    let targets = matrix.as_mut_slice().chunks_exact_mut(leading);
    for ((along, direction), target) in columns.iter().enumerate().zip(targets) {
        let three = &flexibility[along / PER * 3 * components..][..3 * components];
        let (first, rest) = three.split_at(components);
        let (second, third) = rest.split_at(components);
        let nodes = first.as_chunks::<3>().0.iter().zip(second.as_chunks::<3>().0).zip(third.as_chunks::<3>().0);
        let targets = target.as_chunks_mut::<PER>().0.iter_mut().zip(rows.as_chunks::<PER>().0);
        for (((first, second), third), (target, rows)) in nodes.zip(targets) {
            let [first, second, third] = [first, second, third].map(|column| Vector3::from(*column));
            let moved = first * direction[0] + second * direction[1] + third * direction[2];
            for (value, row) in target.iter_mut().zip(rows) {
                *value = row.dot(&moved);
            }
        }
    }
}

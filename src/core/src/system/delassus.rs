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
pub fn fill(matrix: &mut DMatrix<f64>, bank: &ModalBank, block: &DelassusBlock) {
    match block.per {
        1 => fill_structure::<1>(matrix, bank, block),
        _ => fill_structure::<3>(matrix, bank, block),
    }
}

#[inline(never)]
fn fill_structure<const PER: usize>(matrix: &mut DMatrix<f64>, bank: &ModalBank, block: &DelassusBlock) {
    if let Some(disk) = bank.disk() {
        return bank.instruction_set.run(FillDisk::<PER> { matrix, disk, block });
    }
    let height = bank.rows();
    fill_block::<PER>(matrix, block, |column, row| {
        let columns = &bank.flexibility(column.sector).as_slice()[3 * column.node * height..][..3 * height];
        let at = |j: usize| columns[j * height + 3 * row.node..].first_chunk::<3>();
        let [[a, b, c], [d, e, f], [g, h, i]] = [*at(0)?, *at(1)?, *at(2)?];
        (row.sector == column.sector).then_some([[a, b, c, 0.0], [d, e, f, 0.0], [g, h, i, 0.0]])
    });
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
        let (disk, sectors) = (self.disk, self.disk.model().sectors);
        fill_block::<PER>(self.matrix, self.block, |column, row| {
            let difference = row.sector + if row.sector < column.sector { sectors } else { 0 } - column.sector;
            Some(*disk.flexibility(difference, column.node, row.node))
        });
    }
}

/// Fills W from `flexibility`: the displacements (padded to four) of the second node per unit of the three force
/// components at the first node, or `None` for nodes that do not influence each other.
#[inline(always)]
fn fill_block<const PER: usize>(
    matrix: &mut DMatrix<f64>,
    block: &DelassusBlock,
    flexibility: impl Fn(&ContactMember, &ContactMember) -> Option<[[f64; 4]; 3]>,
) {
    let (leading, start) = (matrix.nrows(), PER * block.first);
    let targets = matrix.as_mut_slice().chunks_exact_mut(PER * leading).skip(block.first);
    let columns = block.members.iter().zip(block.columns.as_chunks::<PER>().0);
    for ((column, directions), targets) in columns.zip(targets) {
        let rows = block.members.iter().zip(block.rows.as_chunks::<PER>().0);
        for (other, (row, across)) in rows.enumerate() {
            let [first, second, third] = flexibility(column, row).unwrap_or_default();
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

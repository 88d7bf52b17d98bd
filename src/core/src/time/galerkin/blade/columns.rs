//! Linear combinations of columns and Gaussian elimination, in blocks of eight numbers.

use super::rows::BladeRows;
use crate::math::octet::{Eight, Octet};
use crate::time::galerkin::basis::POINTS;

/// Largest number of nodes in the last block that are summed node by node.
const FEW_NODES: usize = 2;

/// Returns the values of a block of nodes at the start of a step and at its points: `count` values in total.
#[inline(always)]
pub(super) fn values_at_points<L: Octet>(start: &[Eight], lanes: &[Eight], block: usize, count: usize) -> [L; POINTS] {
    let mut values = [L::zero(); POINTS];
    values[0] = L::load(&start[block]);
    for point in 1..count {
        values[point] = L::load(&lanes[(point - 1) * start.len() + block]);
    }
    values
}

/// `sums[d][p]` = Σ over modes of the shapes along direction d times `modes[p]`, for `B` blocks of nodes from `block`. Several
/// directions are summed in one loop, because independent additions overlap in the processor.
#[inline(always)]
pub(super) fn add_modes<L: Octet, const D: usize, const P: usize, const B: usize>(
    shapes: [&[Eight]; D],
    blocks: usize,
    block: usize,
    modes: [&[Eight]; P],
) -> [[[L; B]; P]; D] {
    let mut sums = [[[L::zero(); B]; P]; D];
    let count = shapes[0].len() / blocks;
    for k in 0..count.div_ceil(8) {
        let mut amounts = [&[0.0; 8]; P];
        for p in 0..P {
            amounts[p] = &modes[p][k].0;
        }
        let left = count - 8 * k;
        if left >= 8 {
            let mut own = shapes;
            for d in 0..D {
                // The fixed length avoids bounds checks.
                own[d] = &shapes[d][8 * k * blocks..][..8 * blocks];
            }
            for i in 0..8 {
                add_mode(&mut sums, own, i * blocks + block, amounts, i);
            }
        } else {
            for i in 0..left {
                add_mode(&mut sums, shapes, (8 * k + i) * blocks + block, amounts, i);
            }
        }
    }
    sums
}

/// Adds the displacements of one mode, whose shapes start at the index `place`.
#[inline(always)]
fn add_mode<L: Octet, const D: usize, const P: usize, const B: usize>(
    sums: &mut [[[L; B]; P]; D],
    shapes: [&[Eight]; D],
    place: usize,
    amounts: [&[f64; 8]; P],
    i: usize,
) {
    for d in 0..D {
        let shape = &shapes[d][place..][..B];
        for p in 0..P {
            let amount = L::splat(amounts[p][i]);
            for b in 0..B {
                sums[d][p][b] = sums[d][p][b] + L::load(&shape[b]) * amount;
            }
        }
    }
}

/// Writes the displacements of all nodes, Σ over modes of the shapes along each direction times `modes[p]`, to the lanes of
/// each point p.
#[inline(always)]
pub(super) fn displace<L: Octet, const D: usize, const P: usize>(
    shapes: [&[Eight]; D],
    blocks: usize,
    modes: [&[Eight]; P],
    mut lanes: [&mut [Eight]; D],
) {
    let mut block = 0;
    while block + 3 <= blocks {
        put::<L, D, P, 3>(&add_modes(shapes, blocks, block, modes), blocks, block, &mut lanes);
        block += 3;
    }
    while block < blocks {
        put::<L, D, P, 1>(&add_modes(shapes, blocks, block, modes), blocks, block, &mut lanes);
        block += 1;
    }
}

/// Like [`displace`], but along the directions `along` and for the first `mode_blocks` blocks of modes only. If the last block
/// contains only a few nodes, each of these nodes is summed over blocks of modes.
#[inline(always)]
pub(super) fn displace_nodes<L: Octet, const D: usize, const P: usize>(
    rows: &BladeRows,
    along: [usize; D],
    mode_blocks: usize,
    modes: [&[Eight]; P],
    mut lanes: [&mut [Eight]; D],
) {
    let (blocks, left) = (rows.blocks, rows.nodes % 8);
    let is_short = blocks > 1 && (1..=FEW_NODES).contains(&left);
    let whole = if is_short { blocks - 1 } else { blocks };
    let mut shapes = [&rows.shapes[0][..]; D];
    for d in 0..D {
        let of_direction = &rows.shapes[along[d]];
        shapes[d] = &of_direction[..of_direction.len().min(8 * mode_blocks * blocks)];
    }
    let mut block = 0;
    while block + 3 <= whole {
        put::<L, D, P, 3>(&add_modes(shapes, blocks, block, modes), blocks, block, &mut lanes);
        block += 3;
    }
    while block + 2 <= whole {
        put::<L, D, P, 2>(&add_modes(shapes, blocks, block, modes), blocks, block, &mut lanes);
        block += 2;
    }
    while block < whole {
        put::<L, D, P, 1>(&add_modes(shapes, blocks, block, modes), blocks, block, &mut lanes);
        block += 1;
    }
    if !is_short {
        return;
    }
    for d in 0..D {
        for p in 0..P {
            lanes[d][p * blocks + whole] = Eight::ZERO;
        }
    }
    for node in 8 * whole..rows.nodes {
        let mut of_node = [&rows.by_row[..0]; D];
        for d in 0..D {
            of_node[d] = &rows.by_row[(along[d] * rows.nodes + node) * rows.mode_blocks..][..mode_blocks];
        }
        let mut sums = [[L::zero(); P]; D];
        for k in 0..mode_blocks {
            for d in 0..D {
                let shape = L::load(&of_node[d][k]);
                for p in 0..P {
                    sums[d][p] = sums[d][p] + shape * L::load(&modes[p][k]);
                }
            }
        }
        for d in 0..D {
            for p in 0..P {
                lanes[d][p * blocks + whole].0[node % 8] = sums[d][p].total();
            }
        }
    }
}

#[inline(always)]
pub(super) fn put<L: Octet, const D: usize, const P: usize, const B: usize>(
    sums: &[[[L; B]; P]; D],
    blocks: usize,
    block: usize,
    lanes: &mut [&mut [Eight]; D],
) {
    for d in 0..D {
        for p in 0..P {
            for b in 0..B {
                sums[d][p][b].store(&mut lanes[d][p * blocks + block + b]);
            }
        }
    }
}

/// `to[i]` = `base[i]` + Σ `amounts[t]` · `columns[members[t]][i]`.
#[inline(always)]
pub(super) fn combine<L: Octet>(
    base: Option<&[Eight]>,
    columns: &[Eight],
    members: &[usize],
    amounts: impl Fn(usize) -> f64 + Copy,
    to: &mut [Eight],
) {
    let width = to.len();
    let mut from = 0;
    while from + 4 <= width {
        combine_blocks::<L, 4>(base, columns, members, amounts, from, to);
        from += 4;
    }
    while from + 2 <= width {
        combine_blocks::<L, 2>(base, columns, members, amounts, from, to);
        from += 2;
    }
    if from < width {
        combine_blocks::<L, 1>(base, columns, members, amounts, from, to);
    }
}

#[inline(always)]
pub(super) fn combine_blocks<L: Octet, const B: usize>(
    base: Option<&[Eight]>,
    columns: &[Eight],
    members: &[usize],
    amounts: impl Fn(usize) -> f64,
    from: usize,
    to: &mut [Eight],
) {
    let width = to.len();
    let mut sums = [L::zero(); B];
    if let Some(base) = base {
        for b in 0..B {
            sums[b] = L::load(&base[from + b]);
        }
    }
    for (place, member) in members.iter().enumerate() {
        let amount = L::splat(amounts(place));
        let column = &columns[member * width + from..][..B];
        for b in 0..B {
            sums[b] = sums[b] + L::load(&column[b]) * amount;
        }
    }
    for b in 0..B {
        sums[b].store(&mut to[from + b]);
    }
}

/// Solves a linear system by elimination of `count` columns of `K` blocks each. The column after them is the
/// right-hand side, which the solution replaces.
#[inline(always)]
pub(super) fn eliminate<L: Octet, const K: usize>(matrix: &mut [Eight], count: usize) {
    for pivot in 0..count {
        let (block, at) = (pivot / 8, pivot % 8);
        let (done, rest) = matrix.split_at_mut((pivot + 1) * K);
        let column = &done[pivot * K..];
        let inverse = 1.0 / column[block].0[at];
        let mut scaled = [L::zero(); K];
        for k in 0..K {
            scaled[k] = L::load(&column[k]) * L::splat(inverse);
        }
        for other in rest.chunks_exact_mut(K).take(count - pivot) {
            let value = other[block].0[at];
            let amount = L::splat(value);
            for k in 0..K {
                (L::load(&other[k]) - scaled[k] * amount).store(&mut other[k]);
            }
            other[block].0[at] = value * inverse;
        }
    }
}

/// Calls [`eliminate`] for any number of blocks.
#[inline(always)]
pub(super) fn eliminate_any<L: Octet>(matrix: &mut [Eight], count: usize, blocks: usize) {
    for pivot in 0..count {
        let (block, at) = (pivot / 8, pivot % 8);
        let (done, rest) = matrix.split_at_mut((pivot + 1) * blocks);
        let column = &done[pivot * blocks..];
        let inverse = 1.0 / column[block].0[at];
        for other in rest.chunks_exact_mut(blocks).take(count - pivot) {
            let value = other[block].0[at];
            let amount = L::splat(value * inverse);
            for (other, own) in other.iter_mut().zip(column) {
                (L::load(other) - L::load(own) * amount).store(other);
            }
            other[block].0[at] = value * inverse;
        }
    }
}

/// Returns the sum of values times weights.
#[inline(always)]
pub(super) fn sum<L: Octet>(values: &[L], weights: &[f64]) -> L {
    let mut sum = L::zero();
    for (value, weight) in values.iter().zip(weights) {
        sum = sum + *value * L::splat(*weight);
    }
    sum
}

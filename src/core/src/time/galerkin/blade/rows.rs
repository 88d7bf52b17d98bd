//! Mode shapes of a blade along the closing and the circumferential displacement, in blocks of eight nodes.

use crate::geometry::RevolutionGap;
use crate::math::octet::Eight;
use crate::math::vector::{Vector3, vector3_at};
use crate::modes::coordinates::ContactModes;
use crate::time::galerkin::basis::MOST;
use nalgebra::{DMatrix, Vector2};

/// Data of a blade that do not depend on the step length.
#[derive(Debug, Clone)]
pub(crate) struct BladeRows {
    /// ξω, 1/ω_d, ω², ω and 1/ω² of each mode. The last is 0 if ω is 0.
    pub rates: [Vec<Eight>; 5],
    /// Magnitudes of `shapes`.
    pub magnitudes: [Vec<Eight>; 2],
    /// Largest magnitude over the nodes of the closing displacement of each mode.
    pub largest: Vec<Eight>,
    /// Number of contact nodes, and number of blocks of eight that hold them.
    pub nodes: usize,
    pub blocks: usize,
    /// Mask of the entries of each block of lanes that belong to a node.
    valid: Vec<u8>,
    /// Number of blocks of modes.
    pub mode_blocks: usize,
    /// Shapes mode by mode, along the closing and the circumferential displacement.
    pub shapes: [Vec<Eight>; 2],
    /// Flexibility of the modes without inertia (m/N), `[direction of the force][direction of the displacement]`, where
    /// direction 0 is closing and 1 is circumferential. For each loaded node, the displacements of all nodes.
    pub flexibility: [[Vec<Eight>; 2]; 2],
    /// Quadratic form that gives the error of impulses. Rows and columns are the closing direction of all nodes, then
    /// their circumferential direction.
    pub error_form: Vec<Eight>,
    /// M = √(1 + m²) and its inverse for each node.
    pub steepness: Vec<Eight>,
    pub per_steepness: Vec<Eight>,
    /// Meridional slope m and axial position of each node (m).
    pub slopes: Vec<Eight>,
    pub axial: Vec<Eight>,
    /// Shapes row by row: the closing displacement of all nodes, then the circumferential one.
    pub by_row: Vec<Eight>,
    /// 1/r of each node (1/m).
    pub per_radius: Vec<Eight>,
    /// Largest norm over the nodes of the circumferential shapes.
    pub largest_around: f64,
    /// Smallest radius (m).
    pub smallest_radius: f64,
    /// True if every mode has a frequency above zero.
    pub all_vibrate: bool,
    /// Mode shapes along the meridional direction (m, 0, 1)/M, mode by mode, and meridional displacements of all nodes per unit
    /// force on each node along the closing and the circumferential direction. Empty unless the shaft can move, because only
    /// moments on a moving shaft depend on them.
    pub meridional: Vec<Eight>,
    pub meridional_flexibility: [Vec<Eight>; 2],
    /// Direction of the closing displacement of each node.
    directions: Vec<Vector3>,
}

impl BladeRows {
    /// Arranges the rows of modes by direction, for nodes that face this surface.
    pub fn new(modes: &ContactModes, error_form: &DMatrix<f64>, gap: &RevolutionGap) -> Self {
        let RevolutionGap { slopes, layout, .. } = gap;
        let per_radius = &layout.per_radius;
        let (nodes, count) = (slopes.len(), modes.len());
        let blocks = Eight::blocks(nodes);
        let directions: Vec<Vector3> = slopes.iter().map(|slope| Vector3::new(-1.0, 0.0, *slope)).collect();
        let of_nodes = |of: &dyn Fn(usize) -> f64| {
            let mut target = vec![Eight::ZERO; blocks];
            Eight::spread((0..nodes).map(of), 1.0, &mut target);
            target
        };
        let of_modes = |of: &dyn Fn(f64, f64) -> f64| {
            let mut target = vec![Eight::ZERO; Eight::blocks(count)];
            let values = modes.frequencies.iter().zip(&modes.damping_ratios).map(|(w, ratio)| of(*w, *ratio));
            Eight::spread(values, 0.0, &mut target);
            target
        };
        let mut rows = Self {
            rates: [
                of_modes(&|w, ratio| ratio * w),
                of_modes(&|w, ratio| 1.0 / (w * (1.0 - ratio * ratio).sqrt())),
                of_modes(&|w, _| w * w),
                of_modes(&|w, _| w),
                of_modes(&|w, _| if w > 0.0 { 1.0 / (w * w) } else { 0.0 }),
            ],
            magnitudes: [Vec::new(), Vec::new()],
            largest: vec![Eight::ZERO; Eight::blocks(count)],
            valid: (0..MOST * blocks)
                .map(|lane| if nodes - 8 * (lane % blocks) >= 8 { 0xff } else { (1 << (nodes % 8)) - 1 })
                .collect(),
            nodes,
            blocks,
            mode_blocks: Eight::blocks(count),
            shapes: [0, 1].map(|_| vec![Eight::ZERO; blocks * count]),
            flexibility: [0, 1].map(|_| [0, 1].map(|_| vec![Eight::ZERO; blocks * nodes])),
            error_form: vec![Eight::ZERO; 2 * nodes * 2 * blocks],
            steepness: of_nodes(&|node| (1.0 + slopes[node] * slopes[node]).sqrt()),
            per_steepness: of_nodes(&|node| 1.0 / (1.0 + slopes[node] * slopes[node]).sqrt()),
            slopes: of_nodes(&|node| slopes[node]),
            axial: of_nodes(&|node| layout.axial[node]),
            by_row: vec![Eight::ZERO; 2 * nodes * Eight::blocks(count)],
            per_radius: of_nodes(&|node| per_radius[node]),
            largest_around: 0.0,
            all_vibrate: modes.frequencies.iter().all(|frequency| *frequency > 0.0),
            smallest_radius: per_radius.iter().fold(f64::INFINITY, |least, value| least.min(1.0 / value)),
            meridional: Vec::new(),
            meridional_flexibility: [Vec::new(), Vec::new()],
            directions,
        };
        if gap.shaft_moves {
            rows.find_meridional(modes);
        }
        for (mode, shape) in modes.shapes.column_iter().enumerate() {
            for along in [0, 1] {
                let values = (0..nodes).map(|node| rows.along(along, node).dot(&vector3_at(shape.as_slice(), node)));
                let values: Vec<f64> = values.collect();
                Eight::spread(values.into_iter(), 0.0, &mut rows.shapes[along][mode * blocks..][..blocks]);
            }
        }
        rows.magnitudes =
            rows.shapes.each_ref().map(|shapes| shapes.iter().map(|block| Eight(block.0.map(f64::abs))).collect());
        let largest = |blocks: &[Eight]| blocks.iter().flat_map(|block| block.0).fold(0.0, f64::max);
        let largest: Vec<f64> = rows.magnitudes[0].chunks_exact(blocks).map(largest).collect();
        Eight::spread(largest.into_iter(), 0.0, &mut rows.largest);
        for node in 0..nodes {
            for along in [0, 1] {
                let direction = rows.along(along, node);
                let shapes: Vec<f64> = modes
                    .shapes
                    .column_iter()
                    .map(|shape| direction.dot(&vector3_at(shape.as_slice(), node)))
                    .collect();
                let first = (along * nodes + node) * rows.mode_blocks;
                Eight::spread(shapes.into_iter(), 0.0, &mut rows.by_row[first..][..rows.mode_blocks]);
                for seen in [0, 1] {
                    let moved: Vec<f64> =
                        (0..nodes).map(|other| rows.contract(&modes.residual, [other, node])[(seen, along)]).collect();
                    let target = &mut rows.flexibility[along][seen][node * blocks..][..blocks];
                    Eight::spread(moved.into_iter(), 0.0, target);
                }
                let form: Vec<[f64; 2]> = (0..nodes)
                    .map(|other| rows.contract(error_form, [node, other]))
                    .map(|block| [block[(along, 0)], block[(along, 1)]])
                    .collect();
                for other in [0, 1] {
                    let first = (along * nodes + node) * 2 * blocks + other * blocks;
                    let values = form.iter().map(|pair| pair[other]);
                    Eight::spread(values, 0.0, &mut rows.error_form[first..][..blocks]);
                }
            }
            let square = modes.shapes.row(3 * node + 1).norm_squared();
            rows.largest_around = rows.largest_around.max(square.sqrt());
        }
        rows
    }

    /// Finds mode shapes and flexibility along the meridional direction.
    fn find_meridional(&mut self, modes: &ContactModes) {
        let (nodes, blocks) = (self.nodes, self.blocks);
        let mut meridional = vec![Eight::ZERO; blocks * modes.len()];
        for (shape, target) in modes.shapes.column_iter().zip(meridional.chunks_exact_mut(blocks)) {
            let moved = |node: usize| self.meridional_direction(node).dot(&vector3_at(shape.as_slice(), node));
            Eight::spread((0..nodes).map(moved), 0.0, target);
        }
        self.meridional = meridional;
        self.meridional_flexibility = [0, 1].map(|along| {
            let mut target = vec![Eight::ZERO; blocks * nodes];
            for (node, target) in target.chunks_exact_mut(blocks).enumerate() {
                let moved = |other: usize| {
                    let block = modes.residual.fixed_view::<3, 3>(3 * other, 3 * node);
                    self.meridional_direction(other).dot(&(block * self.along(along, node)))
                };
                Eight::spread((0..nodes).map(moved), 0.0, target);
            }
            target
        });
    }

    /// Returns the unit vector along the meridian at a node, normal to the closing and the circumferential direction.
    pub fn meridional_direction(&self, node: usize) -> Vector3 {
        let slope = self.directions[node][2];
        Vector3::new(slope, 0.0, 1.0) / (1.0 + slope * slope).sqrt()
    }

    /// Mask of the entries of a block of nodes or lanes that belong to a node.
    #[inline(always)]
    pub fn valid(&self, block: usize) -> u8 {
        self.valid[block]
    }

    /// Unit direction of the closing (`along` 0) or circumferential (1) displacement of a node.
    pub fn along(&self, along: usize, node: usize) -> Vector3 {
        if along == 0 { self.directions[node] } else { Vector3::y() }
    }

    /// Components of a force on a node along the two directions, from its three components. They represent the whole
    /// force if it lies in the plane of the two directions.
    pub fn in_plane(&self, force: Vector3) -> Vector2<f64> {
        Vector2::new(-force[0], force[1])
    }

    /// Three components of a force on a node, from its components along the two directions.
    pub fn in_space(&self, node: usize, force: Vector2<f64>) -> Vector3 {
        force[0] * self.directions[node] + force[1] * Vector3::y()
    }

    /// Block of a matrix of rows that belongs to two nodes, along the two directions of each node.
    pub fn contract(&self, matrix: &DMatrix<f64>, [node, other]: [usize; 2]) -> nalgebra::Matrix2<f64> {
        let block = matrix.fixed_view::<3, 3>(3 * node, 3 * other);
        nalgebra::Matrix2::from_fn(|a, e| self.along(a, node).dot(&(block * self.along(e, other))))
    }
}

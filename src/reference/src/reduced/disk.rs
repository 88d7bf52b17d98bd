//! Disk of coupled sectors in a flexible casing under a line load, computed from the pencils and the geometry alone.
//!
//! The Hermitian pencil of every nodal diameter becomes a real one of twice the size for real and imaginary part; the
//! displacement of sector s is w_n Re(C z e^(2πi n s/N)). The contact grid of the casing carries a `Ring`; blade
//! nodes find their closest point on it, and forces return to the grid with the weights of that point.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, DVector, Vector3};

use super::modes::DampedModes;
use super::ring::Ring;
use super::{NodeContact, ReducedScene, SparseRow};

/// Reduced matrices of one nodal diameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Pencil {
    /// Mass.
    pub mass: DMatrix<Complex<f64>>,
    /// Stiffness.
    pub stiffness: DMatrix<Complex<f64>>,
    /// Radial, tangential, axial displacement of every tip node of sector 0.
    pub contact_map: DMatrix<Complex<f64>>,
}

/// Flexible casing.
#[derive(Debug, Clone, PartialEq)]
pub struct CasingModel {
    /// Mass.
    pub mass: DMatrix<f64>,
    /// Stiffness.
    pub stiffness: DMatrix<f64>,
    /// Radial, tangential, axial displacement of every grid node.
    pub contact_map: DMatrix<f64>,
    /// Radius, angle and axial position of the grid nodes, ring by ring.
    pub positions: Vec<[f64; 3]>,
    /// Number of nodes per ring.
    pub around: usize,
    /// Modal damping ratio.
    pub damping: f64,
    /// Amplitude (N/m), number of waves and phase of its line load.
    pub load: [f64; 3],
}

/// Whole stage.
#[derive(Debug, Clone, PartialEq)]
pub struct StageReference {
    /// Nodal diameters from 0.
    pub pencils: Vec<Pencil>,
    /// Radius, angle and axial position of the tip nodes of sector 0.
    pub tips: Vec<[f64; 3]>,
    /// Number of sectors.
    pub sectors: usize,
    /// Modal damping ratio of the disk.
    pub damping: f64,
    /// The casing.
    pub casing: CasingModel,
    /// Clearance (m).
    pub clearance: f64,
    /// Angular velocity (rad/s).
    pub speed: f64,
    /// Coulomb friction coefficient.
    pub friction: f64,
    /// Amplitude (m), number of waves and phase of the lobes of the surface, and the time over which they grow (s).
    pub lobes: [f64; 4],
}

/// Stage in its modes: those of the disk, then those of the casing.
#[derive(Debug, Clone, PartialEq)]
pub struct StageScene {
    stage: StageReference,
    modes: DampedModes,
    /// Number of modes of the disk.
    disk: usize,
    /// Rows of the tip nodes of all sectors over the modes of the disk, `[(sector · nodes + node) · 3 + component]`.
    rows: Vec<Vec<f64>>,
    /// Rows of the grid nodes over the modes of the casing.
    grid: Vec<Vec<f64>>,
    load: Vec<f64>,
    ring: Ring,
    /// Radius of the undeformed round surface at the grid nodes (m).
    radii: Vec<f64>,
    /// Axial positions of the rings (m).
    rings: Vec<f64>,
}

/// Returns [[Re, −Im], [Im, Re]].
fn embedded(matrix: &DMatrix<Complex<f64>>) -> DMatrix<f64> {
    let (rows, columns) = matrix.shape();
    DMatrix::from_fn(2 * rows, 2 * columns, |i, j| {
        let entry = matrix[(i % rows, j % columns)];
        match (i < rows, j < columns) {
            (true, true) | (false, false) => entry.re,
            (true, false) => -entry.im,
            (false, true) => entry.im,
        }
    })
}

/// Returns the radial and tangential directions at an angle.
fn directions(angle: f64) -> [Vector3<f64>; 2] {
    let (sine, cosine) = angle.sin_cos();
    [Vector3::new(cosine, sine, 0.0), Vector3::new(-sine, cosine, 0.0)]
}

/// Computes the modes of a nodal diameter, and the rows of all sectors over them.
fn diameter(stage: &StageReference, number: usize) -> Option<(DampedModes, Vec<DMatrix<f64>>)> {
    let pencil = &stage.pencils[number];
    let real = number == 0 || 2 * number == stage.sectors;
    let weight = (if real { 1.0 } else { 2.0 } / stage.sectors as f64).sqrt();
    let part = |matrix: &DMatrix<Complex<f64>>| matrix.map(|entry| entry.re);
    let modes = if real {
        DampedModes::new(&part(&pencil.mass), &part(&pencil.stiffness), stage.damping)?
    } else {
        DampedModes::new(&embedded(&pencil.mass), &embedded(&pencil.stiffness), stage.damping)?
    };
    let rows = (0..stage.sectors).map(|sector| {
        let (sine, cosine) = (TAU * (number * sector) as f64 / stage.sectors as f64).sin_cos();
        let turned = Complex::new(weight * cosine, weight * sine);
        let map = &pencil.contact_map * turned;
        let map = if real { part(&map) } else { embedded(&map).rows(0, map.nrows()).into_owned() };
        map * &modes.shapes
    });
    Some((modes.clone(), rows.collect()))
}

impl StageScene {
    /// Creates the scene; `None` for masses that are not positive definite, or a grid without a surface.
    pub fn new(stage: StageReference) -> Option<Self> {
        let nodes = 3 * stage.tips.len();
        let mut modes = DampedModes { frequencies: Vec::new(), damping: Vec::new(), shapes: DMatrix::zeros(0, 0) };
        let mut rows = vec![Vec::new(); nodes * stage.sectors];
        for number in 0..stage.pencils.len() {
            let (own, seen) = diameter(&stage, number)?;
            modes.frequencies.extend(&own.frequencies);
            modes.damping.extend(&own.damping);
            for (sector, seen) in seen.iter().enumerate() {
                for row in 0..nodes {
                    rows[sector * nodes + row].extend(seen.row(row).iter());
                }
            }
        }
        let disk = modes.len();
        let casing = &stage.casing;
        let own = DampedModes::new(&casing.mass, &casing.stiffness, casing.damping)?;
        modes.frequencies.extend(&own.frequencies);
        modes.damping.extend(&own.damping);
        let seen = &casing.contact_map * &own.shapes;
        let grid: Vec<Vec<f64>> = seen.row_iter().map(|row| row.iter().copied().collect()).collect();
        let (around, count) = (casing.around, casing.positions.len());
        let rings: Vec<f64> = casing.positions.chunks(around).map(|ring| ring[0][2]).collect();
        let mut load = vec![0.0; modes.len()];
        let [amplitude, waves, phase] = casing.load;
        for (node, [radius, angle, _]) in casing.positions.iter().enumerate() {
            let force = amplitude * radius * TAU / count as f64 * (waves * angle - phase).cos();
            load[disk..].iter_mut().zip(&grid[3 * node]).for_each(|(load, row)| *load += force * row);
        }
        let contour = SplineContour::new(&stage.tips)?;
        Some(Self {
            ring: Ring::new(around, rings.len())?,
            radii: casing.positions.iter().map(|place| contour.radius(place[2]) + stage.clearance).collect(),
            rings,
            rows,
            grid,
            load,
            disk,
            modes,
            stage,
        })
    }

    /// Returns the lobes at this time, and their rate, at an angle (m, m/s).
    fn lobes(&self, angle: f64, time: f64) -> [f64; 2] {
        let [amplitude, waves, phase, ramp] = self.stage.lobes;
        let shape = -amplitude * (waves * angle - phase).cos();
        if time >= ramp {
            return [shape, 0.0];
        }
        let turn = std::f64::consts::PI * time / ramp;
        [0.5 * (1.0 - turn.cos()) * shape, 0.5 * std::f64::consts::PI / ramp * turn.sin() * shape]
    }

    /// Returns the control points of the surface at this time.
    fn control(&self, time: f64, position: &[f64]) -> Vec<Vector3<f64>> {
        let moved = |row: usize| -> f64 { self.grid[row].iter().zip(&position[self.disk..]).map(|(a, b)| a * b).sum() };
        let places = self.stage.casing.positions.iter().enumerate();
        let data: Vec<Vector3<f64>> = places
            .map(|(node, [_, angle, axial])| {
                let [radial, tangential] = directions(*angle);
                let radius = self.radii[node] + self.lobes(*angle, time)[0] + moved(3 * node);
                radial * radius + tangential * moved(3 * node + 1) + Vector3::z() * (axial + moved(3 * node + 2))
            })
            .collect();
        self.ring.control(&data)
    }

    /// Returns the approximate position of a point in grid steps.
    fn guess(&self, point: Vector3<f64>) -> [f64; 2] {
        let casing = &self.stage.casing;
        let angle = point.y.atan2(point.x) - casing.positions[0][1];
        let rings = &self.rings;
        let upper = rings.iter().position(|z| point.z <= *z).unwrap_or(rings.len() - 1).max(1);
        let share = (point.z - rings[upper - 1]) / (rings[upper] - rings[upper - 1]);
        [angle.rem_euclid(TAU) / TAU * casing.around as f64, (upper - 1) as f64 + share]
    }

    /// Returns the row of the modes of the casing for a direction at a position.
    fn casing_row(&self, weights: &DVector<f64>, direction: Vector3<f64>) -> Vec<f64> {
        let mut row = vec![0.0; self.modes.len() - self.disk];
        for (node, weight) in weights.iter().enumerate() {
            let [radial, tangential] = directions(self.stage.casing.positions[node][1]);
            let along = [direction.dot(&radial), direction.dot(&tangential), direction.z];
            for (component, along) in along.into_iter().enumerate() {
                let factor = -weight * along;
                row.iter_mut().zip(&self.grid[3 * node + component]).for_each(|(row, grid)| *row += factor * grid);
            }
        }
        row
    }

    fn contact(
        &self,
        (node, sector): (usize, usize),
        (time, position): (f64, &[f64]),
        control: &[Vector3<f64>],
        within: f64,
    ) -> Option<NodeContact> {
        let stage = &self.stage;
        let [radius, angle, axial] = stage.tips[node];
        let own = angle + TAU * sector as f64 / stage.sectors as f64 + stage.speed * time;
        let [radial, tangential] = directions(own);
        let first = 3 * (sector * stage.tips.len() + node);
        let rows = &self.rows[first..first + 3];
        let moved: [f64; 3] = std::array::from_fn(|i| rows[i].iter().zip(position).map(|(a, b)| a * b).sum());
        let x = radial * (radius + moved[0]) + tangential * moved[1] + Vector3::z() * (axial + moved[2]);
        let guess = self.guess(x);
        // The surface is nearly circumferential: radial distance and gap differ by far less than this.
        let rough = self.ring.at(control, guess[0], guess[1])[0];
        if rough.xy().norm() - x.xy().norm() > within + 2e-5 {
            return None;
        }
        let (place, [foot, a, b, ..]) = self.ring.closest(control, x, guess)?;
        let outwards = a.cross(&b).normalize();
        let normal = if outwards.dot(&radial) > 0.0 { -outwards } else { outwards };
        let gap = (x - foot).dot(&normal);
        if gap > within {
            return None;
        }
        let slip = (tangential - normal * tangential.dot(&normal)).normalize();
        let force = normal - slip * stage.friction;
        let weights = self.ring.weights(place[0], place[1]);
        let growth = weights
            .iter()
            .zip(&stage.casing.positions)
            .map(|(weight, [_, angle, _])| weight * self.lobes(*angle, time)[1] * directions(*angle)[0].dot(&normal));
        let spin = Vector3::new(-x.y, x.x, 0.0) * stage.speed;
        let row = |direction: Vector3<f64>| {
            let along = [direction.dot(&radial), direction.dot(&tangential), direction.z];
            let disk = (0..self.disk).map(|mode| (0..3).map(|i| along[i] * rows[i][mode]).sum());
            SparseRow(vec![(0, disk.collect()), (self.disk, self.casing_row(&weights, direction))])
        };
        Some(NodeContact {
            node: node * stage.sectors + sector,
            group: 0,
            gap,
            rate: spin.dot(&normal) - growth.sum::<f64>(),
            normal: row(normal),
            force: row(force),
        })
    }
}

impl ReducedScene for StageScene {
    fn modes(&self) -> &DampedModes {
        &self.modes
    }

    fn contacts(&self, time: f64, position: &[f64], within: f64) -> Vec<NodeContact> {
        let control = self.control(time, position);
        let mut found = Vec::new();
        for sector in 0..self.stage.sectors {
            for node in 0..self.stage.tips.len() {
                found.extend(self.contact((node, sector), (time, position), &control, within));
            }
        }
        found
    }

    fn load(&self) -> &[f64] {
        &self.load
    }

    /// Returns the casing in equilibrium with its load.
    fn start(&self) -> (Vec<f64>, Vec<f64>) {
        let resting = |(load, frequency): (&f64, &f64)| if *load == 0.0 { 0.0 } else { load / (frequency * frequency) };
        let position = self.load.iter().zip(&self.modes.frequencies).map(resting).collect();
        (position, vec![0.0; self.modes.len()])
    }

    /// Returns the tip nodes of the disk: row by row, every sector.
    fn observed(&self, position: &[f64]) -> Vec<f64> {
        let rows = 3 * self.stage.tips.len();
        let moved = |row: usize, sector: usize| -> f64 {
            self.rows[sector * rows + row].iter().zip(position).map(|(a, b)| a * b).sum()
        };
        (0..rows).flat_map(|row| (0..self.stage.sectors).map(move |sector| moved(row, sector))).collect()
    }
}

/// Tip contour r(z): natural cubic spline, straight beyond its ends.
struct SplineContour {
    /// (z, r, r'').
    points: Vec<[f64; 3]>,
}

impl SplineContour {
    fn new(tips: &[[f64; 3]]) -> Option<Self> {
        let mut points: Vec<[f64; 3]> = tips.iter().map(|tip| [tip[2], tip[0], 0.0]).collect();
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let count = points.len();
        let mut matrix = DMatrix::identity(count, count);
        let mut right = DVector::zeros(count);
        for i in 1..count.saturating_sub(1) {
            let (low, high) = (points[i][0] - points[i - 1][0], points[i + 1][0] - points[i][0]);
            (matrix[(i, i - 1)], matrix[(i, i)], matrix[(i, i + 1)]) = (low / 6.0, (low + high) / 3.0, high / 6.0);
            right[i] = (points[i + 1][1] - points[i][1]) / high - (points[i][1] - points[i - 1][1]) / low;
        }
        let bent = matrix.lu().solve(&right)?;
        points.iter_mut().zip(bent.iter()).for_each(|(point, bent)| point[2] = *bent);
        Some(Self { points })
    }

    /// Returns the cubic between the neighbours of z, from their values and second derivatives; straight with the
    /// same slope beyond the ends.
    fn radius(&self, z: f64) -> f64 {
        let inside = z.clamp(self.points[0][0], self.points[self.points.len() - 1][0]);
        let upper = self.points.iter().position(|point| inside <= point[0]).unwrap_or(1).max(1);
        let ([from, low, bent], [to, high, bends]) = (self.points[upper - 1], self.points[upper]);
        let (size, t) = (to - from, (inside - from) / (to - from));
        let s = 1.0 - t;
        let value = s * low + t * high + size * size / 6.0 * ((s.powi(3) - s) * bent + (t.powi(3) - t) * bends);
        let slope = (high - low) / size + size / 6.0 * ((1.0 - 3.0 * s * s) * bent + (3.0 * t * t - 1.0) * bends);
        value + slope * (z - inside)
    }
}

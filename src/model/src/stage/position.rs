//! Positions of the lattice points of a sector.

use super::geometry::CamberPoint;
use super::lattice::{Lattice, LatticeIndex};

/// Interpolates linearly between two values.
fn mix(from: f64, to: f64, share: f64) -> f64 {
    from + (to - from) * share
}

/// Interpolates piecewise linearly through points (x ascending).
fn through(points: &[[f64; 2]], x: f64) -> f64 {
    let last = points.len() - 2;
    let segment = points[1..=last].iter().take_while(|point| point[0] <= x).count();
    let [[x0, y0], [x1, y1]] = [points[segment], points[segment + 1]];
    mix(y0, y1, if x1 > x0 { (x - x0) / (x1 - x0) } else { 0.0 })
}

#[expect(clippy::cast_precision_loss, reason = "numbers of rows, columns and layers are small")]
fn real(number: usize) -> f64 {
    number as f64
}

impl Lattice<'_> {
    /// Returns the Cartesian coordinates of a lattice point (m).
    pub(super) fn position(&self, [row, column, layer]: LatticeIndex) -> [f64; 3] {
        let [row, column, layer] = [row, column, layer].map(|doubled| 0.5 * real(doubled));
        let radius = self.radius(row);
        let [z, theta] = if row > real(self.hub) {
            self.in_blade(radius, column, layer)
        } else {
            self.in_disk(row, radius, column, layer)
        };
        [radius * theta.cos(), radius * theta.sin(), z]
    }

    /// Returns the radius of a row (m).
    fn radius(&self, row: f64) -> f64 {
        let (disk, blade) = (&self.geometry.disk, &self.geometry.blade);
        let mut points = vec![
            [0.0, disk.bore_radius],
            [real(self.web), disk.bore_radius + disk.bore_height],
            [real(self.rim), disk.hub_radius - disk.rim_thickness],
            [real(self.hub), disk.hub_radius],
        ];
        if blade.fillet > 0.0 {
            points.push([real(self.hub + 1), disk.hub_radius + blade.fillet]);
        }
        points.push([real(self.rows()), blade.tip_radius]);
        through(&points, row)
    }

    /// Returns the position across the layers of the blade, -1 to 1.
    fn across_blade(&self, layer: f64) -> f64 {
        2.0 * (layer - real(self.counts.side)) / real(self.counts.thickness) - 1.0
    }

    /// Returns (z, θ) in the blade: across the camber line, on a cylinder.
    fn in_blade(&self, radius: f64, column: f64, layer: f64) -> [f64; 2] {
        let counts = &self.counts;
        let CamberPoint { z, along, half } =
            self.geometry.section(radius).at((column - real(counts.overhang)) / real(counts.chord));
        let across = self.across_blade(layer);
        [z + across * half[0], (along + across * half[1]) / radius]
    }

    /// Returns (z, θ) in the disk: over the depth of the rim, the middle layers widen from the root of the blade to
    /// their fraction of the pitch; the other layers fill the sector.
    fn in_disk(&self, row: f64, radius: f64, column: f64, layer: f64) -> [f64; 2] {
        let (geometry, counts) = (self.geometry, &self.counts);
        let (disk, half_pitch) = (&geometry.disk, 0.5 * geometry.pitch());
        let root = geometry.section(disk.hub_radius);
        let z = self.axial(row, radius, column);
        let CamberPoint { along, half, .. } = root.at(root.share(z));
        let depth = ((disk.hub_radius - radius) / disk.rim_thickness).clamp(0.0, 1.0);
        let even = half_pitch * real(counts.thickness) / real(counts.layers());
        let width = mix(half[1] / disk.hub_radius, even, depth);
        let shift = (1.0 - depth) * self.towards_end(z) * half[0];
        let across = self.across_blade(layer);
        let [theta, share] = if across.abs() <= 1.0 {
            [across * width, across]
        } else {
            // Relative distance from the layers of the blade to the cut.
            let side = (across.abs() - 1.0) * 0.5 * real(counts.thickness) / real(counts.side);
            [across.signum() * mix(width, half_pitch, side), across.signum() * (1.0 - side)]
        };
        [z + share * shift, theta + self.lean(radius) * along / disk.hub_radius]
    }

    /// Returns the fraction of the camber-line shape that the cut between sectors has: one at the rim, zero at the
    /// bore.
    fn lean(&self, radius: f64) -> f64 {
        let disk = &self.geometry.disk;
        let share = (radius - disk.bore_radius) / (disk.hub_radius - disk.bore_radius);
        share * share * (3.0 - 2.0 * share)
    }

    /// Returns 1 beside the blade, decreasing to 0 at the ends of the rim, which are thus flat.
    fn towards_end(&self, z: f64) -> f64 {
        let ([low, high], [leading, trailing]) = (self.geometry.disk.rim_axial, self.geometry.blade.root_axial);
        if z < leading {
            ((z - low) / (leading - low)).max(0.0)
        } else if z > trailing {
            ((high - z) / (high - trailing)).max(0.0)
        } else {
            1.0
        }
    }

    /// Returns the axial position of a column in the disk (m).
    fn axial(&self, row: f64, radius: f64, column: f64) -> f64 {
        let (disk, blade, counts) = (&self.geometry.disk, &self.geometry.blade, &self.counts);
        let [low, high] = disk.rim_axial;
        let web = [real(self.web_column), real(self.web_column + counts.web[0])];
        let columns = real(counts.columns());
        if row >= real(self.rim) {
            let depth = (disk.hub_radius - radius) / disk.rim_thickness;
            let overhang = real(counts.overhang);
            let outside = through(
                &[
                    [0.0, low],
                    [overhang, blade.root_axial[0]],
                    [columns - overhang, blade.root_axial[1]],
                    [columns, high],
                ],
                column,
            );
            let half = 0.5 * disk.web_thickness[1];
            let inside = through(&[[0.0, low], [web[0], -half], [web[1], half], [columns, high]], column);
            return mix(outside, inside, depth.clamp(0.0, 1.0));
        }
        if row > real(self.web) {
            let half = 0.5 * self.geometry.web(radius);
            return mix(-half, half, (column - web[0]) / (web[1] - web[0]));
        }
        let (half, end, side) = (0.5 * disk.web_thickness[0], 0.5 * disk.bore_width, real(counts.bore[0]));
        through(&[[web[0] - side, -end], [web[0], -half], [web[1], half], [web[1] + side, end]], column)
    }
}

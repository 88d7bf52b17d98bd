//! Disks of coupled sectors defined by real matrices: as harmonics, and as one structure with all sectors.

use nalgebra::{Complex, DMatrix};
use tiprub_core::Scene;
use tiprub_core::scene::rom::{DisplacementFrame, Harmonic, Rom};

use crate::{SeededRandom, node, rub, structure};

/// Sectors that are coupled to their neighbours.
#[derive(Debug, Clone)]
pub struct TestDisk {
    pub sectors: usize,
    pub nodes: usize,
    /// Matrices of one sector, and of a sector with the next one (row: this sector, column: the next).
    pub mass: [DMatrix<f64>; 2],
    pub stiffness: [DMatrix<f64>; 2],
    pub contact_map: DMatrix<f64>,
}

impl TestDisk {
    /// Returns random matrices; `coupling` is the size of those between neighbours relative to those of a sector.
    pub fn random(sectors: usize, nodes: usize, order: usize, coupling: f64, seed: u64) -> Self {
        let mut numbers = SeededRandom(seed);
        let square = numbers.matrix(order, order);
        let frequency = |i: usize| std::f64::consts::TAU * (900.0 + 1100.0 * i as f64);
        let squares = DMatrix::from_fn(order, order, |i, j| if i == j { frequency(i) * frequency(i) } else { 0.0 });
        let turn = (&square - square.transpose()) * 0.3 + DMatrix::identity(order, order);
        let mass = 0.02;
        let stiffness = turn.transpose() * squares * &turn * mass;
        let spread = numbers.matrix(order, order);
        let size = coupling * frequency(0) * frequency(0) * mass;
        Self {
            sectors,
            nodes,
            mass: [
                (DMatrix::identity(order, order) + (&spread + spread.transpose()) * 0.05) * mass,
                numbers.matrix(order, order) * (0.2 * coupling * mass),
            ],
            stiffness: [stiffness, numbers.matrix(order, order) * size],
            contact_map: DMatrix::from_fn(3 * nodes, order, |row, mode| {
                let weight = if row % 3 == 0 { 0.5 } else { 0.25 };
                weight * numbers.signed() + if row == mode { 1.0 } else { 0.0 }
            }),
        }
    }

    fn harmonic(&self, nodal_diameter: usize) -> Harmonic {
        let angle = std::f64::consts::TAU * nodal_diameter as f64 / self.sectors as f64;
        let turn = if 2 * nodal_diameter == self.sectors {
            Complex::new(-1.0, 0.0)
        } else {
            Complex::new(angle.cos(), angle.sin())
        };
        let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
        let pencil = |[own, next]: &[DMatrix<f64>; 2]| {
            complex(own) + complex(next) * turn + complex(&next.transpose()) * turn.conj()
        };
        Harmonic {
            mass: pencil(&self.mass),
            stiffness: pencil(&self.stiffness),
            contact_map: complex(&self.contact_map),
        }
    }

    fn rom(&self, sectors: usize, mass: DMatrix<f64>, stiffness: DMatrix<f64>, contact_map: DMatrix<f64>) -> Rom {
        let copies = self.sectors / sectors;
        let turn = |copy: usize| std::f64::consts::TAU * copy as f64 / self.sectors as f64;
        let place = |copy: usize, n: usize| [0.25, 0.03 * n as f64 + turn(copy), 0.015 * n as f64];
        let all = (0..copies).flat_map(|copy| (0..self.nodes).map(move |n| (copy, n)));
        let nodes = all.map(|(copy, n)| node(format!("node_{copy}_{n}"), place(copy, n), -0.2)).collect();
        let rom = structure("disk", mass, stiffness, contact_map, nodes);
        Rom { sectors, frame: DisplacementFrame::Cylindrical, damping_ratio: 0.01, ..rom }
    }

    /// Returns a ROM with one pencil per nodal diameter.
    pub fn cyclic(&self) -> Rom {
        let zero = self.harmonic(0);
        let real = |matrix: DMatrix<Complex<f64>>| matrix.map(|value| value.re);
        let mut rom = self.rom(self.sectors, real(zero.mass), real(zero.stiffness), self.contact_map.clone());
        rom.extras.harmonics = (1..=self.sectors / 2).map(|n| self.harmonic(n)).collect();
        rom
    }

    /// Returns a ROM of one general structure with the contact nodes of all sectors, sector by sector.
    pub fn whole(&self) -> Rom {
        let (order, count) = (self.contact_map.ncols(), self.sectors);
        let expand = |[own, next]: &[DMatrix<f64>; 2]| {
            let mut matrix = DMatrix::zeros(count * order, count * order);
            for sector in 0..count {
                let after = (sector + 1) % count;
                let mut add = |row: usize, column: usize, block: &DMatrix<f64>| {
                    let mut view = matrix.view_mut((row * order, column * order), (order, order));
                    view += block;
                };
                add(sector, sector, own);
                add(sector, after, next);
                add(after, sector, &next.transpose());
            }
            matrix
        };
        let height = self.contact_map.nrows();
        let mut contact_map = DMatrix::zeros(count * height, count * order);
        for sector in 0..count {
            let mut view = contact_map.view_mut((sector * height, sector * order), (height, order));
            view.copy_from(&self.contact_map);
        }
        self.rom(1, expand(&self.mass), expand(&self.stiffness), contact_map)
    }
}

/// Returns [`rub`] with another rotor, of coupled sectors or as one structure.
pub fn with_rotor(rom: Rom) -> Scene {
    let mut scene = rub(1);
    scene.settings.outputs.nodal_diameters = None;
    scene.settings.outputs.watched_sectors = vec![1];
    scene.roms[0] = rom;
    scene
}

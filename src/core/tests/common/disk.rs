//! Disks of coupled sectors given by real matrices: as harmonics, and as one structure with all sectors in it.

#![allow(dead_code, reason = "each test binary uses its part")]

use nalgebra::{Complex, DMatrix};
use tiprub_core::Scene;
use tiprub_core::rom::{ContactNode, Frame, Harmonic, Rom, RomChecks, RomExtras};
use tiprub_core::settings::Meridian;

/// Numbers in (−1, 1) that are the same everywhere.
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    pub fn matrix(&mut self, rows: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| self.next())
    }
}

/// Sectors that are coupled to their neighbours.
#[derive(Clone)]
pub struct Disk {
    pub sectors: usize,
    pub nodes: usize,
    /// Matrices of one sector, and of a sector with the one after it (row: this sector, column: the next).
    pub mass: [DMatrix<f64>; 2],
    pub stiffness: [DMatrix<f64>; 2],
    pub contact_map: DMatrix<f64>,
}

impl Disk {
    /// Random matrices; `coupling` is the size of those between neighbours relative to those of a sector.
    pub fn random(sectors: usize, nodes: usize, order: usize, coupling: f64, seed: u64) -> Self {
        let mut numbers = Numbers(seed);
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
                weight * numbers.next() + if row == mode { 1.0 } else { 0.0 }
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
        let node = |copy: usize, node: usize| ContactNode {
            name: format!("node_{copy}_{node}"),
            position: [
                0.25,
                0.03 * node as f64 + std::f64::consts::TAU * copy as f64 / self.sectors as f64,
                0.015 * node as f64,
            ],
            meridional_slope: -0.2,
        };
        Rom {
            name: "disk".into(),
            origin: "random matrices".into(),
            sectors,
            frame: Frame::Cylindrical,
            mass,
            stiffness,
            damping_ratio: 0.01,
            contact_map,
            contact_nodes: (0..copies).flat_map(|copy| (0..self.nodes).map(move |n| node(copy, n))).collect(),
            checks: RomChecks::default(),
            extras: RomExtras::default(),
        }
    }

    /// As a ROM with one pencil per nodal diameter.
    pub fn cyclic(&self) -> Rom {
        let zero = self.harmonic(0);
        let real = |matrix: DMatrix<Complex<f64>>| matrix.map(|value| value.re);
        let mut rom = self.rom(self.sectors, real(zero.mass), real(zero.stiffness), self.contact_map.clone());
        rom.extras.harmonics = (1..=self.sectors / 2).map(|n| self.harmonic(n)).collect();
        rom
    }

    /// As a ROM of one general structure with the contact nodes of all sectors, sector by sector.
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

/// The rub of `super::common::scene` with another rotor.
pub fn rub(mut scene: Scene, rom: Rom) -> Scene {
    scene.settings.outputs.nodal_diameters = None;
    scene.settings.outputs.watched_sectors = vec![1];
    scene.settings.contacts[0].meridian = Meridian::Contour;
    scene.roms[0] = rom;
    scene
}

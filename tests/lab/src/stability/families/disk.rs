//! Coupled sectors whose waves depend on the direction: the whole disk at rest under forces on a few blades, and the
//! mirrored disk.
//!
//! A spring from each sector to the next acts along one direction at this end and along another one at the other end,
//! so that waves of both directions differ: exchanging harmonics with their complex conjugates, sectors or directions
//! is detected.

use std::f64::consts::TAU;

use nalgebra::{Complex, DMatrix, DVector};
use tiprub_core::scene::method::Solver;
use tiprub_core::scene::rom::Harmonic;
use tiprub_core::scene::settings::Shape;
use tiprub_core::{Result, Rom, Scene};

use super::super::{
    Cases, Check, Expected, StabilityCase,
    models::{GAP, StabilityMethod, Tower, allowed, round},
    observe::{apart, begin, displacements, set, steps, worse},
};

/// Stiffness of the spring from sector to sector (N/m).
const COUPLING: f64 = 8e6;
/// Depth of the casing (m).
const DEPTH: f64 = 5e-5;

/// Returns all cases of this family.
pub(crate) fn cases() -> Vec<StabilityCase> {
    let mut cases = Vec::new();
    for method in StabilityMethod::all() {
        let quick = method.solver == Solver::Lcp;
        for sectors in [2, 3, 8, 12] {
            for friction in [0.0, 0.3] {
                let still = Still { method, sectors, friction, coupling: COUPLING };
                let name = format!("disk/flexibility/{sectors}/µ={friction}/{}", method.name());
                let expected = Expected::right("static λ and position of every blade from the matrix of the full disk");
                cases.add(quick && sectors == 8 && friction > 0.0, name, expected, move || still.run());
            }
            let mirrored = Mirrored { method, sectors, conjugate: true };
            let name = format!("disk/mirrored/{sectors}/{}", method.name());
            let expected = Expected::right("mirrored speed, shape and disk give the mirrored result");
            cases.add(quick && sectors == 8, name, expected, move || mirrored.run());
        }
    }
    cases
}

/// Returns the stiffness of a sector, and that of a sector (rows) with the next (columns), base and tip by directions.
fn blocks(tower: &Tower, coupling: f64) -> [DMatrix<f64>; 2] {
    let here = DVector::from_row_slice(&[0.8, 0.5, 0.2, 0.0, 0.0, 0.0]);
    let there = DVector::from_row_slice(&[0.0, 0.3, 0.4, 0.6, -0.3, 0.0]);
    let own = tower.rom().stiffness + (&here * here.transpose() + &there * there.transpose()) * coupling;
    [own, &here * there.transpose() * -coupling]
}

fn tower(sectors: usize) -> Tower {
    Tower { sectors, turned: 0.2, ..Tower::default() }
}

/// Returns the disk as one pencil per nodal diameter; in the mirrored disk sector s is sector −s, and tangential motion
/// is reversed.
fn disk(sectors: usize, mirrored: bool, conjugate: bool) -> Rom {
    let tower = tower(sectors);
    let [own, next] = blocks(&tower, COUPLING);
    let mut rom = tower.rom();
    let sign = |i: usize| if mirrored && i % 3 == 1 { -1.0 } else { 1.0 };
    let pencil = |diameter: usize| -> DMatrix<Complex<f64>> {
        let angle = TAU * diameter as f64 / sectors as f64;
        let turn = Complex::new(angle.cos(), if 2 * diameter == sectors { 0.0 } else { angle.sin() });
        let turn = if mirrored && conjugate { turn.conj() } else { turn };
        DMatrix::from_fn(6, 6, |i, j| {
            (turn * next[(i, j)] + turn.conj() * next[(j, i)] + own[(i, j)]) * (sign(i) * sign(j))
        })
    };
    rom.stiffness = pencil(0).map(|value| value.re);
    let complex = |matrix: &DMatrix<f64>| matrix.map(Complex::from);
    let harmonic = |diameter: usize| Harmonic {
        mass: complex(&rom.mass),
        stiffness: pencil(diameter),
        contact_map: complex(&rom.contact_map),
    };
    rom.extras.harmonics = (1..=sectors / 2).map(harmonic).collect();
    rom
}

/// Some blades of a disk are pressed, the others follow freely.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Still {
    /// Method.
    pub method: StabilityMethod,
    /// Number of sectors.
    pub sectors: usize,
    /// Coefficient µ.
    pub friction: f64,
    /// Coupling in the closed form (N/m): a value other than that of the disk must be detected.
    pub coupling: f64,
}

impl Still {
    /// Returns the displacement of all tips per force on them, from the matrix of the whole disk.
    fn flexibility(self) -> DMatrix<f64> {
        let (count, [own, next]) = (self.sectors, blocks(&tower(self.sectors), self.coupling));
        let mut whole = DMatrix::zeros(6 * count, 6 * count);
        for sector in 0..count {
            let after = (sector + 1) % count;
            for (row, column, block) in
                [(sector, sector, own.clone()), (sector, after, next.clone()), (after, sector, next.transpose())]
            {
                let mut view = whole.view_mut((6 * row, 6 * column), (6, 6));
                view += block;
            }
        }
        let map =
            DMatrix::from_fn(6 * count, 3 * count, |i, j| f64::from(u8::from(i / 6 == j / 3 && i % 6 == 3 + j % 3)));
        let moved = whole.lu().solve(&map).unwrap_or_else(|| DMatrix::from_element(6 * count, 3 * count, f64::NAN));
        map.transpose() * moved
    }

    /// Closes, waits for rest, and compares.
    ///
    /// # Errors
    /// A rejected scene.
    pub(crate) fn run(self) -> Result<Vec<Check>> {
        let pressed: Vec<usize> = (0..self.sectors).filter(|sector| [0, 3].contains(sector)).collect();
        let rom = disk(self.sectors, false, true);
        let slope = rom.contact_nodes[0].meridional_slope;
        let mut scene = self.method.stepping(round(rom), 2e-6);
        scene.settings.contacts[0].friction = self.friction;
        scene.settings.contacts[0].sector_gaps =
            (0..self.sectors).map(|sector| if pressed.contains(&sector) { GAP } else { 10.0 * GAP }).collect();
        scene.settings.structures[0].damping_ratio = Some(0.3);
        let (mut simulation, mut watch) = begin(&scene)?;
        let length = scene.settings.experiment.communication_step;
        for index in 0..steps(40e-3, length) {
            let share = (f64::from(index) * length / 4e-3).min(1.0);
            set(&mut simulation, "casing_radius_change", -(GAP + DEPTH) * share * share * (3.0 - 2.0 * share))?;
            watch.step(&mut simulation, length)?;
        }
        let length = (1.0 + slope * slope).sqrt();
        let normal = [-1.0 / length, 0.0, slope / length];
        let push = [normal[0], -self.friction, normal[2]];
        let flexible = self.flexibility();
        let count = pressed.len();
        let delassus = DMatrix::from_fn(count, count, |i, j| {
            let block = flexible.view((3 * pressed[i], 3 * pressed[j]), (3, 3));
            (0..3).map(|a| (0..3).map(|b| normal[a] * block[(a, b)] * push[b]).sum::<f64>()).sum()
        });
        let Some(exact) = delassus.lu().solve(&DVector::from_element(count, DEPTH / length)) else {
            return Ok(vec![Check::so("a static solution exists", false)]);
        };
        let mut force = DVector::zeros(3 * self.sectors);
        for (sector, value) in pressed.iter().zip(exact.iter()) {
            (0..3).for_each(|i| force[3 * sector + i] = value * push[i]);
        }
        let place = &flexible * force;
        let system = simulation.system();
        let off =
            pressed.iter().zip(exact.iter()).map(|(sector, exact)| (system.multiplier(0, *sector) / exact - 1.0).abs());
        let moved = |row: usize| system.bank().row(row % 3, row / 3) - place[row];
        // Galerkin closes gaps to a fraction of its tolerance.
        let bound = 1e-8 + 1e-3 * allowed(&scene) / DEPTH;
        Ok([
            watch.books_of(self.method.scheme),
            vec![
                Check::so(
                    "exactly the expected blades touch",
                    system.events().len() == count && exact.iter().all(|v| *v > 0.0),
                ),
                Check::at_most("deviation of λ from the static solution", off.fold(0.0, worse), bound),
                Check::at_most(
                    "deviation of the blade positions from the static ones",
                    (0..3 * self.sectors).map(|row| moved(row).abs()).fold(0.0, worse) / DEPTH,
                    bound,
                ),
            ],
        ]
        .concat())
    }
}

/// A rub and its mirror image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mirrored {
    /// Method.
    pub method: StabilityMethod,
    /// Number of sectors.
    pub sectors: usize,
    /// True if the mirrored disk has the complex conjugate harmonics; their absence must be detected.
    pub conjugate: bool,
}

impl Mirrored {
    fn scene(self, mirrored: bool) -> Scene {
        let sense = if mirrored { -1.0 } else { 1.0 };
        let rom = disk(self.sectors, mirrored, self.conjugate);
        let mut scene = self.method.stepping(round(rom), 1e-6);
        scene.settings.structures[0].speed = 1300.0 * sense;
        scene.settings.structures[0].damping_ratio = Some(0.02);
        scene.settings.contacts[0].friction = 0.15;
        let shape = Shape::Lobes { amplitude: 0.3 * GAP, order: 1, phase: 0.7 * sense };
        scene.settings.surfaces[0].shape = shape;
        scene
    }

    /// Closes on the blades and follows them for 1.5 ms.
    fn history(self, mirrored: bool) -> Result<(Vec<f64>, u64)> {
        let scene = self.scene(mirrored);
        let (mut simulation, mut watch) = begin(&scene)?;
        let mut history = Vec::new();
        let length = scene.settings.experiment.communication_step;
        let stride = steps(1e-5, length);
        for index in 0..steps(1.5e-3, length) {
            let share = (f64::from(index) * length / 0.8e-3).min(1.0);
            set(&mut simulation, "casing_radius_change", -0.9 * GAP * share * share * (3.0 - 2.0 * share))?;
            watch.step(&mut simulation, length)?;
            if index % stride == 0 {
                let places = displacements(&simulation);
                let seen = |sector: usize| if mirrored { (self.sectors - sector) % self.sectors } else { sector };
                for sector in 0..self.sectors {
                    let [radial, tangential, axial] = std::array::from_fn(|i| places[3 * seen(sector) + i]);
                    history.extend([radial, if mirrored { -tangential } else { tangential }, axial]);
                }
            }
        }
        Ok((history, watch.contacts))
    }

    /// Runs both and compares.
    ///
    /// # Errors
    /// A rejected scene.
    pub(crate) fn run(self) -> Result<Vec<Check>> {
        let (first, contacts) = self.history(false)?;
        let (second, _) = self.history(true)?;
        // Blades are solved one after the other until the gaps hold, to a fraction of the tolerance.
        let bound = 1e-8 + allowed(&self.scene(false)) / GAP;
        Ok(vec![
            Check::so("the blades touched", contacts > if self.method.is_adaptive() { 10 } else { 100 }),
            Check::at_most("deviation of the displacements from the mirrored ones", apart(&second, &first), bound),
        ])
    }
}

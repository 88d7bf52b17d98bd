//! The step of blades on a flexible casing, implemented a second time from the ROMs and the theory chapter alone, with
//! a separate spline, closest point, dense Delassus matrix, recurrence and solver. It shares nothing with the crate.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "indices of small grids"
)]

use nalgebra::{DMatrix, DVector, Vector3};
use tiprub_core::scene::settings::Shape;
use tiprub_core::{CoSimulation, Rom, Scene, Simulation};
use tiprub_test_models::{self as models, set, set_element};

const SECTORS: usize = 3;
const GAP: f64 = 3.56e-4;
const STEP: f64 = 1e-6;
const SPEED: f64 = 1300.0;

/// Returns the cardinal cubic B-spline (support −2 … 2) and its first derivative.
fn basis(x: f64) -> [f64; 2] {
    let (a, sign) = (x.abs(), x.signum());
    if a >= 2.0 {
        [0.0, 0.0]
    } else if a >= 1.0 {
        [(2.0 - a).powi(3) / 6.0, -sign * (2.0 - a).powi(2) / 2.0]
    } else {
        [2.0 / 3.0 - a * a + a * a * a / 2.0, sign * (1.5 * a * a - 2.0 * a)]
    }
}

/// Surface over a grid: control points = interpolation · data points.
struct PaperSurface {
    around: usize,
    along: usize,
    interpolation: DMatrix<f64>,
}

impl PaperSurface {
    fn new(around: usize, along: usize) -> Self {
        let ring = DMatrix::from_fn(around, around, |i, j| match (i + around - j) % around {
            0 => 4.0 / 6.0,
            1 => 1.0 / 6.0,
            turned if turned == around - 1 => 1.0 / 6.0,
            _ => 0.0,
        });
        let line = DMatrix::from_fn(along, along, |i, j| {
            let edge = i == 0 || i == along - 1;
            match i.abs_diff(j) {
                0 => {
                    if edge {
                        1.0
                    } else {
                        4.0 / 6.0
                    }
                }
                1 if !edge => 1.0 / 6.0,
                _ => 0.0,
            }
        });
        let interpolation = line.try_inverse().unwrap().kronecker(&ring.try_inverse().unwrap());
        Self { around, along, interpolation }
    }

    /// Returns the weights of the data points at (ξ, η), in grid steps, and their derivatives along ξ and η.
    fn weights(&self, xi: f64, eta: f64) -> [DVector<f64>; 3] {
        let mut control = [(); 3].map(|()| DVector::zeros(self.around * self.along));
        let first = (xi.floor() as i64) - 1;
        for i in first..first + 4 {
            let place = i.rem_euclid(self.around as i64) as usize;
            let across = basis(xi - i as f64);
            for j in -1..=self.along as i64 {
                let up = basis(eta - j as f64);
                // Phantom points: zero second derivative at the edges.
                let last = self.along as i64 - 1;
                let shares = if j < 0 {
                    vec![(0, 2.0), (1, -1.0)]
                } else if j > last {
                    vec![(last, 2.0), (last - 1, -1.0)]
                } else {
                    vec![(j, 1.0)]
                };
                for (row, share) in shares {
                    let index = row as usize * self.around + place;
                    control[0][index] += share * across[0] * up[0];
                    control[1][index] += share * across[1] * up[0];
                    control[2][index] += share * across[0] * up[1];
                }
            }
        }
        control.map(|control| self.interpolation.transpose() * control)
    }
}

/// Returns a, b and c of q⁺ = a q − b q⁻ + c f.
fn recurrence(frequency: f64, ratio: f64) -> [f64; 3] {
    let decay = (-ratio * frequency * STEP).exp();
    let a = 2.0 * decay * (frequency * (1.0 - ratio * ratio).sqrt() * STEP).cos();
    let b = decay * decay;
    [a, b, (1.0 - a + b) / (frequency * frequency)]
}

struct PaperBody {
    rom: Rom,
    coefficients: Vec<[f64; 3]>,
    now: DVector<f64>,
    before: DVector<f64>,
    load: DVector<f64>,
}

impl PaperBody {
    fn new(rom: &Rom, factor: f64, ratio: f64, load: DVector<f64>) -> Self {
        let frequency = |mode: usize| factor * rom.stiffness[(mode, mode)].sqrt();
        let rest = DVector::from_fn(rom.order(), |mode, _| load[mode] / frequency(mode).powi(2));
        let coefficients = (0..rom.order()).map(|mode| recurrence(frequency(mode), ratio)).collect();
        Self { rom: rom.clone(), coefficients, now: rest.clone(), before: rest, load }
    }

    fn predict(&mut self) {
        let next = DVector::from_fn(self.now.len(), |mode, _| {
            let [a, b, c] = self.coefficients[mode];
            a * self.now[mode] - b * self.before[mode] + c * self.load[mode]
        });
        self.before = std::mem::replace(&mut self.now, next);
    }

    fn compliance(&self) -> DVector<f64> {
        DVector::from_fn(self.now.len(), |mode, _| self.coefficients[mode][2])
    }
}

/// Returns the radial, tangential and axial direction at an angle.
fn directions(angle: f64) -> [Vector3<f64>; 3] {
    let (s, c) = angle.sin_cos();
    [Vector3::new(c, s, 0.0), Vector3::new(-s, c, 0.0), Vector3::z()]
}

/// Returns the mode shapes along fixed directions at a contact node at `angle`: 3 × modes.
fn fixed_modes(rom: &Rom, node: usize, angle: f64) -> DMatrix<f64> {
    let axes = directions(angle);
    DMatrix::from_fn(3, rom.order(), |i, mode| (0..3).map(|k| axes[k][i] * rom.contact_map[(3 * node + k, mode)]).sum())
}

struct Second {
    surface: PaperSurface,
    data: Vec<Vector3<f64>>,
    casing: PaperBody,
    /// Mode shapes of every data point along fixed directions.
    seen: Vec<DMatrix<f64>>,
    blades: Vec<PaperBody>,
    places: Vec<[f64; 2]>,
    multipliers: Vec<f64>,
    gaps: Vec<f64>,
}

/// Mode shapes of blade and casing, normal, and force per multiplier of each contact node.
#[derive(Default)]
struct PaperContact {
    blade_rows: Vec<DMatrix<f64>>,
    casing_rows: Vec<DMatrix<f64>>,
    normals: Vec<Vector3<f64>>,
    forces: Vec<Vector3<f64>>,
}

impl Second {
    fn new(scene: &Scene, factors: &[f64], load: &DVector<f64>) -> Self {
        let (rotor, ring) = (&scene.roms[0], &scene.roms[1]);
        let nodes = &ring.contact_nodes;
        let none = DVector::zeros(rotor.order());
        Self {
            surface: PaperSurface::new(36, 3),
            // The tip contour of the synthetic blade is straight, at 0.25 m.
            data: nodes
                .iter()
                .map(|n| (0.25 + GAP) * directions(n.position[1])[0] + Vector3::z() * n.position[2])
                .collect(),
            casing: PaperBody::new(ring, 1.0, 0.01, load.clone()),
            seen: (0..nodes.len()).map(|node| fixed_modes(ring, node, nodes[node].position[1])).collect(),
            blades: factors.iter().map(|factor| PaperBody::new(rotor, *factor, 0.005, none.clone())).collect(),
            places: vec![[f64::NAN, 1.0]; 3 * SECTORS],
            multipliers: vec![0.0; 3 * SECTORS],
            gaps: vec![0.0; 3 * SECTORS],
        }
    }

    fn points(&self) -> Vec<Vector3<f64>> {
        self.data
            .iter()
            .zip(&self.seen)
            .map(|(point, seen)| point + Vector3::from_iterator((seen * &self.casing.now).iter().copied()))
            .collect()
    }

    /// Returns the closest point by Newton's method on x(ξ, η)·∂S = 0 with differences for the second derivatives.
    fn project(&self, points: &[Vector3<f64>], x: Vector3<f64>, place: &mut [f64; 2]) -> (Vector3<f64>, DVector<f64>) {
        let at = |weights: &DVector<f64>| points.iter().zip(weights).fold(Vector3::zeros(), |sum, (p, w)| sum + p * *w);
        let residual = |xi: f64, eta: f64| {
            let [value, across, up] = self.surface.weights(xi, eta);
            let apart = x - at(&value);
            [apart.dot(&at(&across)), apart.dot(&at(&up))]
        };
        for _ in 0..12 {
            let [xi, eta] = *place;
            let last = *place;
            let (r, d) = (residual(xi, eta), 1e-4);
            let [p, m] = [residual(xi + d, eta), residual(xi - d, eta)];
            let [u, v] = [residual(xi, eta + d), residual(xi, eta - d)];
            let j = [
                [(p[0] - m[0]) / (2.0 * d), (u[0] - v[0]) / (2.0 * d)],
                [(p[1] - m[1]) / (2.0 * d), (u[1] - v[1]) / (2.0 * d)],
            ];
            let determinant = j[0][0] * j[1][1] - j[0][1] * j[1][0];
            place[0] -= (r[0] * j[1][1] - r[1] * j[0][1]) / determinant;
            place[1] -= (r[1] * j[0][0] - r[0] * j[1][0]) / determinant;
            if (place[0] - last[0]).abs().max((place[1] - last[1]).abs()) < 1e-11 {
                break;
            }
        }
        let [value, ..] = self.surface.weights(place[0], place[1]);
        (at(&value), value)
    }

    /// Computes the gaps of the predicted positions at the given angle, and the contacts on which their forces act.
    fn meet(&mut self, angle: f64, closing: f64, shaft: Vector3<f64>, friction: f64) -> PaperContact {
        let points = self.points();
        let mut met = PaperContact::default();
        for sector in 0..SECTORS {
            for node in 0..3 {
                let contact = &self.blades[sector].rom.contact_nodes[node];
                let own = contact.position[1] + std::f64::consts::TAU * sector as f64 / SECTORS as f64 + angle;
                let modes = fixed_modes(&self.blades[sector].rom, node, own);
                let [radial, tangential, axial] = directions(own);
                let moved = Vector3::from_iterator((&modes * &self.blades[sector].now).iter().copied());
                let x = radial * (contact.position[0] + closing) + axial * contact.position[2] + moved + shaft;
                let index = 3 * sector + node;
                let mut place = self.places[index];
                place[0] = own.rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU * 36.0;
                place[1] = (contact.position[2] + 0.02) / 0.07 * 2.0;
                let (foot, weights) = self.project(&points, x, &mut place);
                self.places[index] = place;
                let apart = x - foot;
                let inside = foot.xy().norm() > x.xy().norm();
                let normal = if inside { apart.normalize() } else { -apart.normalize() };
                self.gaps[index] = apart.dot(&normal);
                let slip = (tangential - normal * tangential.dot(&normal)).normalize();
                met.normals.push(normal);
                met.forces.push(normal - slip * friction);
                met.casing_rows.push(
                    self.seen
                        .iter()
                        .zip(&weights)
                        .fold(DMatrix::zeros(3, self.casing.now.len()), |sum, (seen, weight)| sum + seen * *weight),
                );
                met.blade_rows.push(modes);
            }
        }
        met
    }

    /// Solves by projected Gauss-Seidel to rounding.
    fn settle(&mut self, delassus: &DMatrix<f64>) {
        let size = self.gaps.len();
        for _ in 0..20_000 {
            let mut change = 0.0_f64;
            for i in 0..size {
                let gap = self.gaps[i] + (0..size).map(|j| delassus[(i, j)] * self.multipliers[j]).sum::<f64>();
                let next = (self.multipliers[i] - gap / delassus[(i, i)]).max(0.0);
                change = change.max((next - self.multipliers[i]).abs());
                self.multipliers[i] = next;
            }
            if change < 1e-13 {
                break;
            }
        }
    }

    /// Steps to the given angle; `shaft` is the displacement of the shaft centre, `closing` reduces the casing's
    /// radius.
    fn step(&mut self, angle: f64, closing: f64, shaft: Vector3<f64>, friction: f64) {
        self.casing.predict();
        self.blades.iter_mut().for_each(PaperBody::predict);
        let PaperContact { blade_rows, casing_rows, normals, forces } = self.meet(angle, closing, shaft, friction);
        let size = 3 * SECTORS;
        let project =
            |rows: &DMatrix<f64>, v: &Vector3<f64>| rows.transpose() * DVector::from_column_slice(v.as_slice());
        let (soft, ring) =
            (self.blades.iter().map(PaperBody::compliance).collect::<Vec<_>>(), self.casing.compliance());
        let delassus = DMatrix::from_fn(size, size, |i, j| {
            let casing =
                project(&casing_rows[i], &normals[i]).dot(&project(&casing_rows[j], &forces[j]).component_mul(&ring));
            let same = i / 3 == j / 3;
            casing
                + if same {
                    project(&blade_rows[i], &normals[i])
                        .dot(&project(&blade_rows[j], &forces[j]).component_mul(&soft[i / 3]))
                } else {
                    0.0
                }
        });
        self.settle(&delassus);
        let before = self.gaps.clone();
        for i in 0..size {
            self.gaps[i] = before[i] + (0..size).map(|j| delassus[(i, j)] * self.multipliers[j]).sum::<f64>();
            let force = forces[i] * self.multipliers[i];
            self.blades[i / 3].now += project(&blade_rows[i], &force).component_mul(&soft[i / 3]);
            self.casing.now -= project(&casing_rows[i], &force).component_mul(&ring);
        }
    }
}

/// Returns mistuned blades on a whirling shaft, in an elastic, warm casing.
fn scene(factors: &[f64], friction: f64) -> Scene {
    let mut scene = models::rub(SECTORS);
    scene.roms[0] = models::rich_blade(SECTORS);
    models::flexible(&mut scene);
    scene.settings.structures[0].frequency_factors = factors.to_vec();
    scene.settings.structures[0].whirl = true;
    scene.settings.structures[0].axial_shift = true;
    scene.settings.structures[1].thermal = true;
    scene.settings.surfaces[0].shape = Shape::Circular {};
    scene.settings.contacts[0].friction = friction;
    // The gaps of watched sectors are evaluated in every step.
    scene.settings.outputs.watched_sectors = (1..=SECTORS).collect();
    scene
}

#[test]
fn a_second_implementation_of_the_flexible_rub_agrees() {
    let (factors, friction) = ([1.0, 1.02, 0.97], 0.15);
    let scene = scene(&factors, friction);
    let mut simulation = Simulation::new(&scene).unwrap();
    let temperatures = [3.0, -2.0, 1.0, 4.0];
    let thermal = scene.roms[1].extras.thermal.as_ref().unwrap();
    let load = &thermal.loads * DVector::from_row_slice(&temperatures);
    for (patch, temperature) in (0..).zip(temperatures) {
        set_element(&mut simulation, "casing_temperature", patch, temperature);
    }
    simulation.initialise(0.0).unwrap();
    let mut second = Second::new(&scene, &factors, &load);
    let (mut force_error, mut gap_error, mut moved_error) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut largest, mut moved, mut contacts, mut coupled) = (0.0_f64, 0.0_f64, 0, 0);
    for index in 1..=1500 {
        let time = STEP * f64::from(index);
        let closing = 4.5e-4 * (time / 7e-4).min(1.0);
        let shaft = Vector3::new(3e-5 * (900.0 * time).cos(), 3e-5 * (900.0 * time).sin(), 1e-4 * (700.0 * time).sin());
        for (name, value) in
            [("casing_radius_change", -closing), ("whirl_x", shaft.x), ("whirl_y", shaft.y), ("axial_shift", shaft.z)]
        {
            set(&mut simulation, name, value);
        }
        simulation.do_step(STEP * f64::from(index - 1), STEP).unwrap();
        second.step(SPEED * time, closing, shaft, friction);
        let system = simulation.system();
        for node in 0..9 {
            let (own, other) = (second.multipliers[node], system.multiplier(node % 3, node / 3));
            force_error = force_error.max((own - other).abs());
            largest = largest.max(own);
            gap_error = gap_error.max((second.gaps[node] - system.gap(node % 3, node / 3)).abs());
        }
        contacts += system.events().len();
        coupled += usize::from(system.events().windows(2).any(|pair| pair[0].sector != pair[1].sector));
        let ring = &system.structures()[1];
        for mode in 0..second.casing.now.len() {
            moved = moved.max(second.casing.now[mode].abs());
            moved_error = moved_error.max((second.casing.now[mode] - ring.modes().modal_state(mode, 0).0).abs());
        }
        for (sector, blade) in second.blades.iter().enumerate() {
            for mode in 0..blade.now.len() {
                moved_error = moved_error.max((blade.now[mode] - system.bank().modal_state(mode, sector).0).abs());
            }
        }
    }
    println!(
        "µ = {friction}: {contacts} contacts, {coupled} steps with several blades; largest force {largest:.0} N, off by {force_error:.1e} N; \
             casing mode {moved:.1e}, modes off by {moved_error:.1e}; gaps off by {gap_error:.1e} m"
    );
    assert!(contacts > 300 && coupled > 20);
    assert!(force_error < 1e-6 * largest && moved_error < 1e-7 * moved && gap_error < 1e-7 * GAP);
}

//! A disk of coupled sectors stepped by nodal diameters against the equivalent single structure.

use tiprub_core::modes::cyclic::CyclicModel;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::settings::InputInterpolation;
use tiprub_core::{CoSimulation, Simulation};
use tiprub_test_models::{
    disk::{TestDisk, with_rotor},
    real, started,
};

const SCHEMES: [Scheme; Scheme::RECURRENCES.len()] = Scheme::RECURRENCES;

/// Returns both forms of one disk with the same settings.
fn pair(disk: &TestDisk, scheme: Scheme, solver: Solver, friction: f64) -> [Simulation; 2] {
    [disk.cyclic(), disk.whole()].map(|rom| {
        let mut scene = with_rotor(rom);
        scene.settings.time.scheme = scheme;
        scene.settings.contacts[0].solver = solver;
        scene.settings.contacts[0].friction = friction;
        scene.settings.structures[0].damping_ratio = Some(0.2);
        // Values act equally in steps of every length.
        scene.settings.time.input_interpolation = InputInterpolation::Hold;
        started(&scene)
    })
}

/// Largest differences relative to the largest value: displacements, multipliers, energies.
#[derive(Default)]
struct Differences {
    apart: [f64; 3],
    size: [f64; 3],
}

impl Differences {
    fn add(&mut self, kind: usize, a: f64, b: f64) {
        self.apart[kind] = self.apart[kind].max((a - b).abs());
        self.size[kind] = self.size[kind].max(a.abs());
    }

    fn relative(&self) -> [f64; 3] {
        std::array::from_fn(|kind| self.apart[kind] / self.size[kind])
    }
}

/// Steps both until `contact_steps` internal steps had contact; the casing closes by up to `closing`, with `nudge`
/// added on the second. Returns the differences and the largest number of simultaneous contacts.
fn compare(
    disk: &TestDisk,
    [one, two]: &mut [Simulation; 2],
    contact_steps: usize,
    closing: f64,
    nudge: f64,
) -> ([f64; 3], usize) {
    let (mut differences, mut touched, mut most) = (Differences::default(), 0, 0);
    for index in 0.. {
        assert!(index < 4000, "only {touched} steps in contact");
        let length = [5e-5, 3.1e-5, 1e-6][index % 3];
        let time = one.time();
        let radius = -0.5 * closing * (1.0 - (0.04 * index as f64).cos());
        for (simulation, radius) in [(&mut *one, radius), (&mut *two, radius + nudge)] {
            let reference = simulation.table().find("casing_radius_change").unwrap().reference;
            simulation.set_real(reference, radius).unwrap();
            simulation.begin_step(time, length).unwrap();
        }
        // The nodes of all sectors are in sequence if the other disk is a single structure.
        let copies = disk.sectors / two.system().bank().sectors();
        loop {
            let finished = one.advance().unwrap().finished;
            two.advance().unwrap();
            let (a, b) = (one.system(), two.system());
            for sector in 0..disk.sectors {
                for node in 0..disk.nodes {
                    let other = if copies == 1 { (node, sector) } else { (sector * disk.nodes + node, 0) };
                    differences.add(1, a.multiplier(node, sector), b.multiplier(other.0, other.1));
                    for i in 0..3 {
                        let moved = b.bank().row(3 * other.0 + i, other.1);
                        differences.add(0, a.bank().row(3 * node + i, sector), moved);
                    }
                }
            }
            touched += usize::from(!a.events().is_empty());
            most = most.max(a.events().len());
            if finished {
                break;
            }
        }
        for name in ["kinetic_energy", "strain_energy", "damping_loss", "friction_loss", "impact_loss"] {
            // Without friction this loss does not exist.
            if one.table().find(name).is_some() {
                differences.add(2, real(one, name), real(two, name));
            }
        }
        if touched >= contact_steps {
            break;
        }
    }
    (differences.relative(), most)
}

/// Runs `check` on all disks with every scheme and solver, without and with friction.
fn every_pair(mut check: impl FnMut(&TestDisk, [Simulation; 2], String)) {
    for (sectors, nodes, order) in [(5, 1, 5), (6, 1, 5), (8, 1, 5), (6, 2, 8), (3, 1, 5), (2, 2, 8)] {
        for scheme in SCHEMES {
            let excluded = |solver: &Solver| scheme == Scheme::MasslessBoundary && *solver == Solver::Film;
            for solver in Solver::ALL.into_iter().filter(|solver| !excluded(solver)) {
                for friction in [0.0, 0.15] {
                    let disk = TestDisk::random(sectors, nodes, order, 0.2, 3 + sectors as u64);
                    let both = pair(&disk, scheme, solver, friction);
                    check(&disk, both, format!("{sectors} x {nodes} x {order} | {scheme:?} | {solver:?} | {friction}"));
                }
            }
        }
    }
}

#[test]
fn thousand_contact_steps_equal_the_whole_disk() {
    println!("| sectors x nodes x coordinates | scheme | solver | µ | most contacts | displacement | λ | energies |");
    println!("|---|---|---|---|---|---|---|---|");
    every_pair(|disk, mut both, name| {
        let ([moved, multiplier, energy], most) = compare(disk, &mut both, 1000, 1e-4, 0.0);
        println!("| {name} | {most} | {moved:.1e} | {multiplier:.1e} | {energy:.1e} |");
        assert!(moved <= 1e-12 && energy <= 1e-12, "{name}: {moved:e}, {energy:e}");
        // A multiplier is a displacement over h²/m, which amplifies the rounding of displacements.
        assert!(multiplier <= 5e-11, "{name}: {multiplier:e}");
    });
}

/// Blades that bounce against each other amplify rounding with every impact in any implementation; the reference is the
/// same disk and code with the casing 1e-19 m away.
#[test]
fn bouncing_disk_differs_only_by_rounding() {
    println!(
        "| sectors x nodes x coordinates | scheme | solver | µ | most contacts | displacement | energies | nudged |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    every_pair(|disk, mut both, name| {
        let mut twins = [both[0].clone(), both[0].clone()];
        let ([moved, _, energy], most) = compare(disk, &mut both, 1000, 5e-4, 0.0);
        let ([nudged, ..], _) = compare(disk, &mut twins, 1000, 5e-4, 1e-19);
        println!("| {name} | {most} | {moved:.1e} | {energy:.1e} | {nudged:.1e} |");
        assert!(most * 2 >= disk.sectors, "{name}: {most}");
        assert!(moved <= 1e-12 + 100.0 * nudged && energy <= 1e-12 + 100.0 * nudged, "{name}: {moved:e}, {nudged:e}");
    });
}

#[test]
fn chain_frequencies_match_closed_form() {
    // Masses m on springs k to the ground and k_c to the neighbours: ω_n² = (k + 4 k_c sin²(πn/N))/m.
    for sectors in [2, 3, 5, 8, 56] {
        let (mass, ground, between) = (0.3, 2e6, 7e5);
        let diagonal = |value: f64| nalgebra::DMatrix::from_element(1, 1, value);
        let mut disk = TestDisk::random(sectors, 1, 1, 0.0, 1);
        disk.mass = [diagonal(mass), diagonal(0.0)];
        disk.stiffness = [diagonal(ground + 2.0 * between), diagonal(-between)];
        let model = CyclicModel::from_rom(&disk.cyclic(), 0.0).unwrap();
        for (n, diameter) in model.diameters.iter().enumerate() {
            let sine = (std::f64::consts::PI * n as f64 / sectors as f64).sin();
            let expected = ((ground + 4.0 * between * sine * sine) / mass).sqrt();
            let error = (diameter.frequencies[0] / expected - 1.0).abs();
            assert!(error < 1e-14, "N = {sectors}, n = {n}: {error:e}");
        }
    }
}

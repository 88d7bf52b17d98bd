//! Golden bits: outputs of scenes that together cover every feature, scheme, solver and gap law, to the last bit, from
//! the core and from both interfaces of the library.
//!
//! `GOLDEN=write cargo test -p tiprub-tests --release --test golden` rewrites the table. Do this only for an intended
//! change, and give the reason in the commit. If the digest differs and the adjacent numbers hardly do, only rounding
//! has changed. A second table holds the work of the solver in some of the scenes.

#[path = "golden/scenes.rs"]
mod scenes;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::{CoSimulation, Scene, Simulation};
use tiprub_cosim::variables::{Causality, DataType, Variable};
use tiprub_tests::scene::UnpackedResources;
use tiprub_tests::{OK, fmi2, fmi3, root, shared, shipped};

/// Returns the lengths of the communication steps (s): internal steps of one and two lengths, and back.
fn lengths() -> impl Iterator<Item = f64> {
    let times = |count, length| std::iter::repeat_n(length, count);
    times(60, 2.5e-5).chain(times(30, 1.03e-5)).chain(times(40, 2.5e-5))
}

/// Returns value and slope of an input of a scene at `time` (s).
fn course(name: &str, time: f64) -> (f64, f64) {
    let (rate, speed) = (700.0, 1300.0);
    let (sine, cosine) = (rate * time).sin_cos();
    // Several structures or pairs use the courses of a single one.
    match name.rsplit('.').next().unwrap_or(name) {
        "speed" => (speed + 3e4 * time, 3e4),
        "whirl_x" => (6e-5 * sine, 6e-5 * rate * cosine),
        "whirl_y" => (6e-5 * (1.0 - cosine), 6e-5 * rate * sine),
        "axial_shift" => (2e-5 * sine, 2e-5 * rate * cosine),
        "casing_radius_change" => (-0.03 * time, -0.03),
        "casing_shape_factor" => (1.0 + 0.1 * sine, 0.1 * rate * cosine),
        "casing_shape_rotation" => (20.0 * time, 20.0),
        "casing_temperature" => (-4e3 * time, -4e3),
        "casing_load_amplitude" => (2e4 * time, 2e4),
        "casing_load_phase" => (50.0 * time, 50.0),
        other => panic!("no course for the input {other}"),
    }
}

/// Returns the inputs: name, and reference of each element.
fn inputs(simulation: &Simulation) -> Vec<(String, Vec<u32>)> {
    let rows = simulation.table().variables().iter().filter(|row| row.causality == Causality::Input);
    rows.map(|row| (row.name.clone(), elements(row).collect())).collect()
}

fn elements(row: &Variable) -> impl Iterator<Item = u32> + use<> {
    row.reference..row.reference + u32::try_from(row.len()).unwrap()
}

fn outputs(simulation: &Simulation) -> Vec<u32> {
    let rows = simulation.table().variables().iter();
    rows.filter(|row| row.causality == Causality::Output && row.kind == DataType::Real).flat_map(elements).collect()
}

/// Interface by which a scene can be stepped.
trait SteppedBy {
    fn set(&mut self, reference: u32, value: f64, slope: Option<f64>);
    fn step(&mut self, time: f64, length: f64);
    fn get(&self, references: &[u32]) -> Vec<f64>;
}

impl SteppedBy for Simulation {
    fn set(&mut self, reference: u32, value: f64, slope: Option<f64>) {
        self.set_real(reference, value).unwrap();
        if let Some(slope) = slope {
            self.set_input_derivative(reference, 1, slope).unwrap();
        }
    }

    fn step(&mut self, time: f64, length: f64) {
        self.do_step(time, length).unwrap_or_else(|error| panic!("{error}"));
    }

    fn get(&self, references: &[u32]) -> Vec<f64> {
        references.iter().map(|reference| self.real(*reference).unwrap()).collect()
    }
}

impl SteppedBy for fmi2::Fmi2TestSlave<'_> {
    fn set(&mut self, reference: u32, value: f64, slope: Option<f64>) {
        self.expect(self.set_reals(&[reference], &[value]));
        if let Some(slope) = slope {
            self.expect(self.set_derivatives(&[reference], 1, &[slope]));
        }
    }

    fn step(&mut self, time: f64, length: f64) {
        let status = fmi2::Fmi2TestSlave::step(self, time, length);
        assert_eq!(status, OK, "{}", self.log());
    }

    fn get(&self, references: &[u32]) -> Vec<f64> {
        self.reals(references)
    }
}

impl SteppedBy for fmi3::Fmi3TestSlave<'_> {
    /// FMI 3.0 has no derivatives of inputs.
    fn set(&mut self, reference: u32, value: f64, _slope: Option<f64>) {
        self.expect(self.set_reals(&[reference], &[value]));
    }

    fn step(&mut self, time: f64, length: f64) {
        let step = fmi3::Fmi3TestSlave::step(self, time, length);
        assert_eq!(step.status, OK, "{}", self.log());
    }

    fn get(&self, references: &[u32]) -> Vec<f64> {
        self.reals(references, references.len())
    }
}

/// Returns the digest of all real outputs at all communication points (FNV-1a, 64 bit), and the outputs at the last
/// one.
fn run(scene: &Scene, face: &mut impl SteppedBy, derivatives: bool) -> (u64, Vec<f64>) {
    let table = Simulation::new(scene).unwrap();
    let (inputs, outputs) = (inputs(&table), outputs(&table));
    let (mut time, mut digest, mut last) = (0.0, 0xcbf2_9ce4_8422_2325_u64, Vec::new());
    for (step, length) in lengths().enumerate() {
        // Inputs of steady scenes change once.
        let changes = !scene.settings.name.contains("steady") || step == 50;
        for (name, references) in inputs.iter().filter(|_| changes) {
            let (value, slope) = course(name, time);
            for reference in references {
                face.set(*reference, value, derivatives.then_some(slope));
            }
        }
        face.step(time, length);
        time += length;
        last = face.get(&outputs);
        for byte in last.iter().flat_map(|value| value.to_bits().to_le_bytes()) {
            digest = (digest ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    (digest, last)
}

fn native(scene: &Scene, derivatives: bool) -> (u64, Vec<f64>) {
    let mut simulation = Simulation::new(scene).unwrap_or_else(|error| panic!("{}: {error}", scene.settings.name));
    simulation.initialise(0.0).unwrap_or_else(|error| panic!("{}: {error}", scene.settings.name));
    run(scene, &mut simulation, derivatives)
}

/// Returns a line of the table: name, digests without and with derivatives, and some numbers at the end of the first
/// run.
fn line(scene: &Scene) -> String {
    let ((ramped, last), (led, _)) = (native(scene, false), native(scene, true));
    let table = Simulation::new(scene).unwrap();
    let references = outputs(&table);
    let mut text = format!("{}: {ramped:016x} {led:016x}", scene.settings.name);
    for name in ["external_work", "friction_loss", "strain_energy"] {
        if let Some(row) = table.table().find(name) {
            let place = references.iter().position(|reference| *reference == row.reference).unwrap();
            write!(text, " {name} {:.12e}", last[place]).unwrap();
        }
    }
    text
}

/// Returns the content of a file, which is rewritten on request.
fn held(name: &str, found: &str) -> String {
    let path = root().join("tests/data").join(name);
    if std::env::var_os("GOLDEN").is_some_and(|value| value == "write") {
        fs::write(&path, found).unwrap();
    }
    fs::read_to_string(&path).unwrap()
}

/// `preset = "paper"` is unchanged: its settings, and the settings and bits of the equivalent explicit scene.
#[test]
fn paper_preset_is_unchanged() {
    let preset = scenes::around_blades(scenes::PRESET);
    let written = tiprub_format::write_scene(&preset.settings);
    assert_eq!(written, held("preset_paper.toml", &written), "see the head of this file");
    let text = scenes::PRESET.replace("preset = \"paper\"\n", "");
    let text = text.replace("[time]\n", "[time]\nscheme = \"central-difference\"\n");
    let mut spelled = scenes::around_blades(&text.replace("friction = 0.15\n", "friction = 0.15\nsolver = \"film\"\n"));
    assert_eq!(native(&spelled, true).0, native(&preset, true).0);
    spelled.settings.preset = preset.settings.preset;
    assert_eq!(spelled.settings, preset.settings);
}

#[test]
fn every_scene_matches_its_golden_bits() {
    let found: String = scenes::all().iter().map(|scene| line(scene) + "\n").collect();
    let expected = held("golden.txt", &found);
    for (found, expected) in found.lines().zip(expected.lines()) {
        assert_eq!(found, expected, "see the head of this file");
    }
    assert_eq!(found.lines().count(), expected.lines().count());
}

/// Compares the core with both FMI versions of a library.
fn assert_matches_the_core(library: &Path) {
    let (api2, api3) = (fmi2::load(library), fmi3::load(library));
    for scene in scenes::all() {
        let resources = UnpackedResources::of(&scene, false);
        let mut two = fmi2::Fmi2TestSlave::initialised(&api2, &resources);
        assert_eq!(run(&scene, &mut two, true).0, native(&scene, true).0, "FMI 2.0, {}", scene.settings.name);
        let mut three = fmi3::Fmi3TestSlave::new(&api3, &resources);
        three.initialise();
        assert_eq!(run(&scene, &mut three, false).0, native(&scene, false).0, "FMI 3.0, {}", scene.settings.name);
    }
}

/// Scenes whose work is counted: blades with two and with three numbers per node, with steps that end at communication
/// points and with others, mistuned, sticking, and in an elastic casing, with adaptive and with fixed steps.
const COUNTED: [&str; 10] = [
    "galerkin",
    "galerkin_steady",
    "galerkin_steady_mistuned_lobes",
    "galerkin_mistuned_lobes",
    "galerkin_whirl_spline",
    "galerkin_coulomb",
    "galerkin_flexible_warm",
    "galerkin_flexible_few_outputs",
    "flexible_warm",
    "coupled_lcp",
];

/// The solver does no more work than before: numbers of steps, trials and factorisations are unchanged, and the numbers of
/// evaluated blocks of gaps (surfaces of revolution and smooth rings) and displacements (surfaces of revolution).
#[test]
fn work_of_the_solver_is_unchanged() {
    let mut found = String::new();
    for scene in scenes::all().iter().filter(|scene| COUNTED.contains(&scene.settings.name.as_str())) {
        let mut simulation = Simulation::new(scene).unwrap();
        simulation.initialise(0.0).unwrap();
        run(scene, &mut simulation, false);
        let system = simulation.system();
        let effort = system.effort();
        writeln!(
            found,
            "{}: steps {} flights {} trials {} unsolved {} constant {} missed {} factorisations {} \
             blocks of gaps {} of displacements {}",
            scene.settings.name,
            effort.steps,
            effort.flights,
            effort.trials,
            effort.unsolved,
            effort.constant,
            effort.missed,
            system.factorisations(),
            system.evaluated_blocks().gaps,
            system.evaluated_blocks().displacements,
        )
        .unwrap();
    }
    assert_eq!(found.lines().count(), COUNTED.len());
    assert_eq!(found, held("work.txt", &found), "see the head of this file");
}

#[test]
fn fmi2_and_fmi3_match_the_core_bit_for_bit() {
    assert_matches_the_core(&shipped());
}

/// The library of the demo is compiled with other options, but gives the same bits as the released library.
#[test]
fn library_of_the_demo_matches_the_released_one() {
    let (demo, released) = (shared(), shipped());
    assert_ne!(fs::read(&demo).unwrap(), fs::read(&released).unwrap(), "both paths lead to the same library");
    assert_matches_the_core(&demo);
    let scene = scenes::around_blades(scenes::PRESET);
    let resources = UnpackedResources::of(&scene, false);
    let [demo, released] = [demo, released].map(|path| {
        let api = fmi3::load(&path);
        let mut slave = fmi3::Fmi3TestSlave::new(&api, &resources);
        slave.initialise();
        let (digest, last) = run(&scene, &mut slave, false);
        (digest, last.into_iter().map(f64::to_bits).collect::<Vec<_>>())
    });
    assert_eq!(demo, released);
}

#[test]
fn golden_scenes_use_every_scheme_and_solver() {
    let scenes = scenes::all();
    for scheme in Scheme::ALL {
        assert!(scenes.iter().any(|scene| scene.settings.time.scheme == scheme), "{scheme:?}");
    }
    for solver in Solver::ALL {
        assert!(scenes.iter().any(|scene| scene.settings.contacts[0].solver == solver), "{solver:?}");
    }
}

#[test]
fn every_golden_scene_has_nontrivial_outputs() {
    for scene in scenes::all() {
        let table = Simulation::new(&scene).unwrap();
        let (_, last) = native(&scene, false);
        let place = |name: &str| {
            let row = table.table().find(name).unwrap().reference;
            outputs(&table).iter().position(|reference| *reference == row).unwrap()
        };
        let impact = last[place("impact_loss")] + last.get(place("curvature_work")).copied().unwrap_or_default().abs();
        assert!(impact > 0.0, "{}", scene.settings.name);
    }
}

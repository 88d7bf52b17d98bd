//! Fields in files against the outputs of the same run.

use std::f64::consts::TAU;
use std::io::Read as _;
use std::path::Path;

use flate2::read::ZlibDecoder;
use tiprub_core::scene::method::{Scheme, Solver};
use tiprub_core::scene::rom::{DisplacementFrame, WatchedPoints};
use tiprub_core::scene::settings::{CoatingSettings, OutputSettings};
use tiprub_core::{Rom, Scene};
use tiprub_field::{FieldOptions, FieldSeries, shape_file};
use tiprub_model::SurfaceShapes;
use tiprub_model::shapes::DiameterShapes;
use tiprub_shell::native::{self, ObservedScene, RunInputs, StartedRun};
use tiprub_shell::recording::Recording;
use tiprub_shell::schedule::Schedule;
use tiprub_test_models::disk::TestDisk;

#[path = "series/animation.rs"]
mod animation;

/// Returns the values of an array of a file, after checking the layout of its blocks.
fn array(path: &Path, name: &str) -> Vec<f64> {
    let bytes = std::fs::read(path).unwrap();
    let marker = b"<AppendedData encoding=\"raw\">\n_";
    let start = bytes.windows(marker.len()).position(|part| part == marker).unwrap();
    let text = std::str::from_utf8(&bytes[..start]).unwrap();
    let row = text.lines().find(|line| line.contains(&format!("Name=\"{name}\""))).unwrap_or_else(|| panic!("{name}"));
    let entry = |key: &str| row.split(&format!("{key}=\"")).nth(1).unwrap().split('"').next().unwrap();
    let data = &bytes[start + marker.len() + entry("offset").parse::<usize>().unwrap()..];
    let word = |index: usize| usize::try_from(u64::from_le_bytes(data[8 * index..][..8].try_into().unwrap())).unwrap();
    let (blocks, size, last) = (word(0), word(1), word(2));
    let mut from = 8 * (3 + blocks);
    let mut values = Vec::new();
    for block in 0..blocks {
        let before = values.len();
        ZlibDecoder::new(&data[from..][..word(3 + block)]).read_to_end(&mut values).unwrap();
        let expected = if block + 1 == blocks && last > 0 { last } else { size };
        assert_eq!(values.len() - before, expected);
        from += word(3 + block);
    }
    match entry("type") {
        "Float32" => values.as_chunks().0.iter().map(|word| f64::from(f32::from_le_bytes(*word))).collect(),
        "Int32" => values.as_chunks().0.iter().map(|word| f64::from(i32::from_le_bytes(*word))).collect(),
        _ => values.into_iter().map(f64::from).collect(),
    }
}

/// Returns a surface whose points are the contact nodes, so that its displacements are known.
#[expect(clippy::cast_possible_truncation, reason = "shapes have single precision")]
fn contact_surface(rom: &Rom) -> SurfaceShapes {
    let place = |node: &tiprub_core::scene::rom::ContactNode| match rom.frame {
        DisplacementFrame::Cartesian => node.position,
        DisplacementFrame::Cylindrical => {
            let [radius, angle, z] = node.position;
            [radius * angle.cos(), radius * angle.sin(), z]
        }
    };
    let nodes = rom.contact_nodes.len();
    // Turns the three displacements of each node to x, y, z.
    let cartesian = |column: Vec<f64>| -> Vec<f32> {
        let turned = column.as_chunks::<3>().0.iter().zip(&rom.contact_nodes).flat_map(|([a, b, c], node)| {
            let angle = if rom.frame == DisplacementFrame::Cylindrical { node.position[1] } else { 0.0 };
            let (sine, cosine) = angle.sin_cos();
            [cosine * a - sine * b, sine * a + cosine * b, *c]
        });
        turned.map(|value| value as f32).collect()
    };
    let real = |map: &nalgebra::DMatrix<f64>| DiameterShapes {
        order: map.ncols(),
        real: map.column_iter().flat_map(|column| cartesian(column.iter().copied().collect())).collect(),
        imaginary: Vec::new(),
    };
    let mut diameters = vec![real(&rom.contact_map)];
    for harmonic in &rom.extras.harmonics {
        let imaginary = real(&harmonic.contact_map.map(|value| value.im)).real;
        diameters.push(DiameterShapes { imaginary, ..real(&harmonic.contact_map.map(|value| value.re)) });
    }
    let corners: Vec<u32> = (0..u32::try_from(nodes).unwrap()).cycle().take(3).collect();
    SurfaceShapes { points: rom.contact_nodes.iter().map(place).collect(), corners, ends: vec![3], diameters }
}

struct Bench {
    root: tempfile::TempDir,
    recording: Recording,
    schedule: Schedule,
}

impl Bench {
    /// Runs a scene with fields; `watched` are the sectors of which the recording has all outputs.
    fn run(scene: &Scene, sectors: &[usize], every: usize) -> Self {
        Self::run_in(tempfile::tempdir().unwrap(), scene, sectors, every)
    }

    /// Runs a scene in this directory, and replaces an earlier series in it.
    fn run_in(root: tempfile::TempDir, scene: &Scene, sectors: &[usize], every: usize) -> Self {
        let directory = root.path().join("fields");
        let force = directory.exists();
        let options = FieldOptions { directory, sectors: sectors.to_vec(), every, force };
        options.check_directory().unwrap();
        let extended = options.scene(scene).unwrap();
        let schedule = Schedule::new(&scene.settings.experiment, None, None).unwrap();
        let shapes = scene.roms.iter().map(|rom| Some(contact_surface(rom))).collect();
        let mut series = FieldSeries::new(options, &extended, shapes, schedule).unwrap();
        assert!(series.without_surface().is_empty());
        let observed = ObservedScene::new(&extended, &schedule).unwrap();
        let given = RunInputs { observed: Some(&observed), ..RunInputs::default() };
        let run = StartedRun::new(&extended, &schedule, given).unwrap();
        let run = run.finish_observed(&|_| (), &mut |index, simulation| series.add(index, simulation)).unwrap();
        series.finish().unwrap();
        Self { root, recording: run.recording, schedule }
    }

    fn array(&self, part: &str, index: usize, name: &str) -> Vec<f64> {
        array(&self.root.path().join(format!("fields/{part}_{index:06}.vtu")), name)
    }

    fn output(&self, name: &str, index: usize) -> f64 {
        let column = self.recording.names.iter().position(|column| column == name);
        self.recording.row(index)[column.unwrap_or_else(|| panic!("no output {name}"))]
    }
}

fn assert_close(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let size = expected.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= 2e-7 * size, "{what}: {found} instead of {expected} of {size}");
    }
}

/// Checks points, displacements, clearance and forces of all sectors at one time against the outputs.
fn check_rotor(bench: &Bench, scene: &Scene, sectors: &[usize], index: usize) -> f64 {
    let rom = &scene.roms[0];
    let nodes = rom.contact_nodes.len();
    let angle = bench.output("rotor_angle", index);
    let (mut points, mut moved, mut clearance, mut force) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for sector in sectors {
        for (number, node) in rom.contact_nodes.iter().enumerate() {
            let [radius, theta, z] = node.position;
            let (sine, cosine) = (theta + angle + TAU * (*sector as f64 - 1.0) / rom.sectors as f64).sin_cos();
            points.extend([radius * cosine, radius * sine, z]);
            let output = |name: &str| bench.output(&format!("blade[{sector}].{name}[{}]", number + 1), index);
            let [radial, around, along] =
                ["radial", "tangential", "axial"].map(|axis| output(&format!("tip_{axis}_displacement")));
            moved.extend([cosine * radial - sine * around, sine * radial + cosine * around, along]);
            clearance.push(output("clearance"));
            force.push(output("normal_force"));
        }
    }
    let name = &scene.settings.structures[0].name;
    for part in [name.clone(), format!("{name}_contact")] {
        assert_close(&bench.array(&part, index, "Points"), &points, "points");
        assert_close(&bench.array(&part, index, "displacement"), &moved, "displacement");
    }
    let part = format!("{name}_contact");
    assert_close(&bench.array(&part, index, "clearance"), &clearance, "clearance");
    assert_close(&bench.array(&part, index, "normal_force"), &force, "normal force");
    assert_eq!(points.len(), 3 * nodes * sectors.len());
    force.iter().sum()
}

/// Returns a rub in which blades touch, with the outputs of the tips.
fn rub() -> Scene {
    let mut scene = tiprub_test_models::rub(6);
    scene.settings.outputs.tip_displacements = true;
    scene.settings.experiment.stop = 2e-3;
    scene.settings.experiment.communication_step = 2e-5;
    scene
}

#[test]
fn fields_of_blades_equal_the_outputs() {
    let scene = rub();
    let bench = Bench::run(&scene, &[], 7);
    let all: Vec<usize> = (1..=6).collect();
    let series: Vec<usize> = (0..=bench.schedule.count).filter(|k| k % 7 == 0 || *k == bench.schedule.count).collect();
    let force: f64 = series.iter().map(|index| check_rotor(&bench, &scene, &all, *index)).sum();
    assert!(force > 1.0, "the blades touch: {force}");
    let index = std::fs::read_to_string(bench.root.path().join("fields/fields.pvd")).unwrap();
    for k in 0..=bench.schedule.count {
        let time = format!("timestep=\"{:?}\"", bench.schedule.time(k));
        assert_eq!(index.matches(&time).count(), if series.contains(&k) { 3 } else { 0 }, "{k}");
    }
    // The rigid casing moves by its shape: the clearance of a blade at rest is the distance of both.
    let moved = bench.array("casing_surface", 0, "displacement");
    assert!(moved.iter().all(|value| *value == 0.0), "the shape grows from zero");
    let last = bench.schedule.count;
    let (points, moved) =
        (bench.array("casing_surface", last, "Points"), bench.array("casing_surface", last, "displacement"));
    let inwards = points.chunks(3).zip(moved.chunks(3)).map(|(p, u)| (p[0] * u[0] + p[1] * u[1]) / p[0].hypot(p[1]));
    let lowest = inwards.fold(f64::INFINITY, f64::min);
    let shape = &scene.settings.surfaces[0].shape;
    let gap = scene.settings.contacts[0].nominal_gap();
    let expected = tiprub_core::scene::shape::CompiledShape::new(shape, gap).unwrap().least();
    assert!((lowest / expected - 1.0).abs() < 1e-3, "{lowest} {expected}");
}

#[test]
fn chosen_sectors_are_shown_in_their_place() {
    let scene = rub();
    let bench = Bench::run(&scene, &[5, 2], 100);
    check_rotor(&bench, &scene, &[2, 5], 100);
    assert_eq!(bench.array("rotor", 100, "sector"), [2.0, 5.0]);
}

#[test]
fn series_replaces_exactly_the_files_of_an_earlier_one() {
    let scene = rub();
    let files = |root: &Path| {
        let entries = std::fs::read_dir(root.join("fields")).unwrap();
        let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    let expected = files(Bench::run(&scene, &[], 100).root.path());
    let first = Bench::run(&scene, &[], 10);
    let place = |name: &str| first.root.path().join("fields").join(name);
    let own = ["other_000010.vtu", "notes.txt", "../outside.vtu"];
    own.iter().for_each(|name| std::fs::write(place(name), "").unwrap());
    // The list may have been edited.
    let list = std::fs::read_to_string(place("fields.pvd")).unwrap();
    let changed =
        list.replacen("<DataSet", "<DataSet file=\"../outside.vtu\"/><DataSet file=\"notes.txt\"/>\n<DataSet", 1);
    std::fs::write(place("fields.pvd"), changed).unwrap();
    let count = files(first.root.path()).len();
    let second = Bench::run_in(first.root, &scene, &[], 100);
    let found = files(second.root.path());
    let kept = ["notes.txt", "other_000010.vtu"].map(str::to_owned);
    assert!(count > found.len(), "{count} {}", found.len());
    assert_eq!(
        found.iter().filter(|name| !kept.contains(name)).collect::<Vec<_>>(),
        expected.iter().collect::<Vec<_>>()
    );
    assert!(kept.iter().all(|name| found.contains(name)) && second.root.path().join("outside.vtu").exists());
}

#[test]
fn fields_do_not_change_the_results() {
    let mut scenes = vec![rub(), rub(), tiprub_test_models::bumps(tiprub_test_models::rich_blade(6))];
    scenes[2].settings.experiment.stop = 2e-3;
    for scene in &mut scenes {
        // Sectors whose state no output needs are then skipped.
        scene.settings.outputs = OutputSettings { watched_sectors: vec![2], ..OutputSettings::default() };
    }
    tiprub_test_models::flexible(&mut scenes[1]);
    scenes[2].settings.time.scheme = Scheme::Galerkin;
    scenes[2].settings.time.step = 8e-5;
    scenes[2].settings.contacts[0].solver = Solver::Lcp;
    for scene in scenes {
        let schedule = Schedule::new(&scene.settings.experiment, None, None).unwrap();
        let alone = native::run(&scene, &schedule, RunInputs::default(), &|_| ()).unwrap();
        let directory = "unused".into();
        let options = FieldOptions { directory, sectors: Vec::new(), every: 1, force: false };
        let observed = ObservedScene::new(&scene, &schedule).unwrap();
        let given = RunInputs { observed: Some(&observed), ..RunInputs::default() };
        let run = StartedRun::new(&options.scene(&scene).unwrap(), &schedule, given).unwrap();
        let observed = run.finish_observed(&|_| (), &mut |_, _| Ok(())).unwrap();
        assert_eq!(observed.recording.names, alone.recording.names);
        let difference = alone.recording.compare(&observed.recording).unwrap();
        assert!(difference.is_exact(), "{difference:?}");
    }
}

#[test]
fn coupled_sectors_and_casing_equal_the_outputs() {
    let ring = TestDisk::random(5, 2, 7, 0.3, 11);
    let mut scene = tiprub_test_models::disk::with_rotor(ring.cyclic());
    scene.settings.outputs.tip_displacements = true;
    scene.settings.experiment.stop = 30.0 * scene.settings.experiment.communication_step;
    let bench = Bench::run(&scene, &[], 10);
    for index in [10, 30] {
        check_rotor(&bench, &scene, &[1, 2, 3, 4, 5], index);
    }
    let moved = bench.array("rotor", 30, "displacement");
    assert!(moved.iter().any(|value| value.abs() > 1e-9), "{moved:?}");
}

#[test]
fn casing_and_its_contact_grid_move_alike() {
    let mut scene = rub();
    tiprub_test_models::flexible(&mut scene);
    scene.settings.outputs.slave_displacement = true;
    scene.settings.outputs.nodal_diameters = None;
    let bench = Bench::run(&scene, &[], 100);
    check_rotor(&bench, &scene, &[1, 2, 3, 4, 5, 6], 100);
    let carrier = &scene.settings.structures[1].name;
    let [surface, contact] = ["", "_contact"].map(|end| bench.array(&format!("{carrier}{end}"), 100, "displacement"));
    assert_close(&surface, &contact, "displacement");
    for (number, (node, moved)) in scene.roms[1].contact_nodes.iter().zip(contact.chunks(3)).enumerate() {
        let (sine, cosine) = node.position[1].sin_cos();
        let radial = cosine * moved[0] + sine * moved[1];
        let expected = bench.output(&format!("casing_displacement[{}]", number + 1), 100);
        assert!((radial - expected).abs() < 1e-6 * expected.abs().max(1e-9), "{number}: {radial} {expected}");
    }
}

#[test]
fn wear_belongs_to_the_cells_of_the_coating() {
    let mut scene = rub();
    tiprub_test_models::coating(&mut scene);
    let bench = Bench::run(&scene, &[1], 100);
    let CoatingSettings { cells_around, cells_along, .. } = scene.settings.contacts[0].coating.unwrap();
    let wear = bench.array("casing_surface", 100, "wear_depth");
    let outputs: Vec<f64> =
        (1..=cells_around * cells_along).map(|cell| bench.output(&format!("wear_depth[{cell}]"), 100)).collect();
    assert_close(&wear, &outputs, "wear");
    assert!(wear.iter().any(|depth| *depth > 0.0));
}

#[test]
fn free_body_moves_by_its_centre() {
    use tiprub_test_models::lattice::{BlockSide, block, scene};
    let mut scene = scene(block([0.0; 3], 1e6), &[(BlockSide::Left, 2.5e-2)], false, [0.3, 0.1, 0.2]);
    scene.settings.experiment.stop = 20.0 * scene.settings.experiment.communication_step;
    let bench = Bench::run(&scene, &[], 20);
    let name = &scene.settings.structures[0].name;
    let (points, moved) =
        (bench.array(&format!("{name}_contact"), 20, "Points"), bench.array(name, 20, "displacement"));
    for (number, node) in scene.roms[0].contact_nodes.iter().enumerate() {
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            let found = points[3 * number + axis] + moved[3 * number + axis] - node.position[axis];
            let expected = bench.output(&format!("{name}.node_displacement_{letter}[{}]", number + 1), 20);
            assert!((found - expected).abs() < 1e-7 * node.position[axis].abs().max(1e-2), "{found} {expected}");
        }
    }
}

#[test]
fn shape_file_is_found_by_the_digest_of_its_rom() {
    let root = tempfile::tempdir().unwrap();
    let rom = TestDisk::random(5, 2, 7, 0.3, 11).cyclic();
    let shapes = contact_surface(&rom);
    let bytes = shape_file::write(&shapes, &rom);
    assert_eq!(bytes, shape_file::write(&shapes, &rom));
    let path = root.path().join("another_name.shapes.safetensors");
    std::fs::write(&path, &bytes).unwrap();
    std::fs::write(root.path().join("text.shapes.safetensors"), "no shapes").unwrap();
    let files = || shape_file::in_directory(root.path(), None);
    assert_eq!(files().len(), 2);
    assert_eq!(shape_file::find(&rom, files()).unwrap(), Some(shapes.clone()));
    // Damping and checks do not belong to the coordinates, but the stiffness does.
    let damped = Rom { damping_ratio: 0.5 * rom.damping_ratio + 0.01, ..rom.clone() };
    assert_eq!(shape_file::find(&damped, files()).unwrap(), Some(shapes));
    let mut other = rom.clone();
    other.stiffness[(0, 0)] *= 1.0 + f64::EPSILON;
    assert_eq!(shape_file::find(&other, files()).unwrap(), None);
    assert!(shape_file::read(&path, &other).unwrap_err().to_string().contains("belongs to another ROM"));
    let header = 8 + usize::try_from(u64::from_le_bytes(bytes[..8].try_into().unwrap())).unwrap();
    for index in (header..bytes.len()).step_by(97) {
        let mut damaged = bytes.clone();
        damaged[index] ^= 1;
        std::fs::write(&path, damaged).unwrap();
        assert!(shape_file::find(&rom, files()).unwrap_err().to_string().contains("is a damaged shape file"));
    }
    std::fs::write(&path, &bytes[..bytes.len() - 8]).unwrap();
    assert!(shape_file::read(&path, &rom).is_err());
}

#[test]
fn rejects_wrong_sectors_and_directories() {
    let root = tempfile::tempdir().unwrap();
    let options = |directory: &Path, sectors: &[usize], force: bool| FieldOptions {
        directory: directory.to_owned(),
        sectors: sectors.to_vec(),
        every: 1,
        force,
    };
    let scene = rub();
    for (sectors, problem) in
        [(&[7][..], "there is no sector 7. Give sectors from 1 to 6"), (&[0], "no sector 0"), (&[2, 2], "given twice")]
    {
        let failure = options(root.path(), sectors, false).scene(&scene).unwrap_err();
        assert!(failure.usage && failure.to_string().contains(problem), "{failure}");
    }
    let below = root.path().join("new/fields");
    options(&below, &[], false).check_directory().unwrap();
    assert!(!root.path().join("new").exists(), "the check leaves nothing");
    std::fs::write(root.path().join("notes.txt"), "").unwrap();
    let failure = options(root.path(), &[], false).check_directory().unwrap_err();
    assert!(failure.usage && failure.to_string().contains("not empty"), "{failure}");
    options(root.path(), &[], true).check_directory().unwrap();
    let failure = options(&root.path().join("notes.txt"), &[], true).check_directory().unwrap_err();
    assert!(failure.to_string().contains("is a file, not a directory"), "{failure}");
}

#[test]
fn stress_is_shown_where_the_rom_has_it() {
    let mut scene = rub();
    let node = scene.roms[0].contact_nodes[0].clone();
    let map = nalgebra::DMatrix::from_fn(6, scene.roms[0].order(), |i, j| 1e12 * (1.0 + (i + 2 * j) as f64));
    scene.roms[0].extras.stress = Some(WatchedPoints { map, points: vec![node] });
    let bench = Bench::run(&scene, &[1, 4], 100);
    let expected = [1, 4].map(|sector| bench.output(&format!("blade[{sector}].von_mises_stress[1]"), 100));
    assert_close(&bench.array("rotor_stress", 100, "von_mises_stress"), &expected, "stress");
    assert!(expected.iter().all(|stress| *stress > 0.0), "{expected:?}");
    assert_eq!(bench.array("rotor_stress", 100, "sector"), [1.0, 4.0]);
}

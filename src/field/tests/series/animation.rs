//! The compact copy of a run against the outputs of the same run.

use std::io::Read as _;

use base64::Engine as _;
use flate2::read::ZlibDecoder;
use serde_json::Value;
use tiprub_field::animation::{ANGLES, Animation, Capture, MAX_TIMES};
use tiprub_field::observed_scene;

use super::*;

/// A run and its animation.
struct Film {
    capture: Capture,
    animation: Animation,
    bytes: Vec<u8>,
    recording: Recording,
}

impl Film {
    fn run(scene: &Scene) -> Self {
        let extended = observed_scene(scene, &[]).unwrap();
        let schedule = Schedule::new(&scene.settings.experiment, None, None).unwrap();
        let shapes = scene.roms.iter().map(|rom| Some(contact_surface(rom))).collect();
        let mut capture = Capture::new(&extended, shapes, schedule).unwrap();
        let observed = ObservedScene::new(&extended, &schedule).unwrap();
        let given = RunInputs { observed: Some(&observed), ..RunInputs::default() };
        let run = StartedRun::new(&extended, &schedule, given).unwrap();
        let run = run.finish_observed(&|_| (), &mut |index, simulation| {
            capture.add(index, simulation);
            Ok(())
        });
        let animation = capture.animation().unwrap();
        let packed = base64::engine::general_purpose::STANDARD.decode(&animation.data).unwrap();
        let mut bytes = Vec::new();
        ZlibDecoder::new(&packed[..]).read_to_end(&mut bytes).unwrap();
        Self { capture, animation, bytes, recording: run.unwrap().recording }
    }

    fn body(&self, name: &str) -> &Value {
        let bodies = self.animation.header["bodies"].as_array().unwrap();
        bodies.iter().find(|body| body["name"] == name).unwrap_or_else(|| panic!("{name}"))
    }

    /// Reads numbers at `[offset, unit]`.
    fn numbers(&self, place: &Value, count: usize) -> Vec<f64> {
        let start = usize::try_from(place[0].as_u64().unwrap()).unwrap();
        let (low, high) = self.bytes[start..][..2 * count].split_at(count);
        let words = low.iter().zip(high).map(|(low, high)| i16::from_le_bytes([*low, *high]));
        words.map(|word| f64::from(word) * place[1].as_f64().unwrap()).collect()
    }

    fn times(&self) -> Vec<f64> {
        self.animation.header["times"].as_array().unwrap().iter().map(|time| time.as_f64().unwrap()).collect()
    }

    /// Row of the recording at a time.
    fn row(&self, time: f64) -> usize {
        self.recording.times.iter().position(|own| own.to_bits() == time.to_bits()).expect("a communication point")
    }

    fn output(&self, name: &str, row: usize) -> f64 {
        let column = self.recording.names.iter().position(|column| column == name);
        self.recording.row(row)[column.unwrap_or_else(|| panic!("no output {name}"))]
    }

    /// Returns the displacement x, y, z of a contact node in the directions of the first sector.
    fn displacement(&self, body: &Value, time: usize, sector: usize, node: usize) -> [f64; 3] {
        let size = |name: &str| usize::try_from(body[name].as_u64().unwrap()).unwrap();
        let (rank, points, sectors, nodes) = (size("rank"), size("points"), size("sectors"), size("nodes"));
        let mut sum = [0.0; 3];
        for k in 0..rank {
            let weight = self.numbers(&body["weights"][k], sectors * self.times().len())[time * sectors + sector];
            let vector = self.numbers(&body["basis"][k], 3 * points);
            for (axis, sum) in sum.iter_mut().enumerate() {
                *sum += weight * vector[3 * (points - nodes + node) + axis];
            }
        }
        sum
    }
}

/// Checks the displacements of the contact nodes of the first structure at some times.
fn check_displacements(film: &Film, scene: &Scene) {
    let rom = &scene.roms[0];
    let body = film.body(&scene.settings.structures[0].name);
    let times = film.times();
    let mut pairs = Vec::new();
    for place in (0..times.len()).step_by(times.len().div_ceil(7)) {
        let row = film.row(times[place]);
        for sector in 0..rom.sectors {
            for (node, own) in rom.contact_nodes.iter().enumerate() {
                let [x, y, z] = film.displacement(body, place, sector, node);
                let (sine, cosine) = own.position[1].sin_cos();
                let found = [cosine * x + sine * y, cosine * y - sine * x, z];
                for (axis, found) in ["radial", "tangential", "axial"].into_iter().zip(found) {
                    let name = format!("blade[{}].tip_{axis}_displacement[{}]", sector + 1, node + 1);
                    pairs.push((found, film.output(&name, row)));
                }
            }
        }
    }
    let largest = pairs.iter().map(|(_, expected)| expected.abs()).fold(0.0, f64::max);
    assert!(largest > 0.0 && film.animation.deviation < 1e-2, "{largest} {}", film.animation.deviation);
    for (found, expected) in pairs {
        let allowed = (film.animation.deviation + 2e-3) * largest;
        assert!((found - expected).abs() <= allowed, "{found} instead of {expected} of {largest}");
    }
}

#[test]
fn animation_has_the_motion_and_the_forces_of_the_run() {
    let scene = rub();
    let film = Film::run(&scene);
    check_displacements(&film, &scene);
    let (times, body) = (film.times(), film.body("rotor"));
    assert!(times.len() <= MAX_TIMES && times.windows(2).all(|pair| pair[0] < pair[1]));
    let (sectors, nodes) = (scene.roms[0].sectors, scene.roms[0].contact_nodes.len());
    let forces = film.numbers(&body["forces"], times.len() * sectors * nodes);
    let largest = forces.iter().copied().fold(0.0, f64::max);
    assert!(largest > 0.0);
    for (place, pair) in times.windows(2).enumerate() {
        let rows = film.row(pair[0]) + 1..=film.row(pair[1]);
        for (index, force) in forces[(place + 1) * sectors * nodes..][..sectors * nodes].iter().enumerate() {
            let name = format!("blade[{}].normal_force[{}]", index / nodes + 1, index % nodes + 1);
            let expected = rows.clone().map(|row| film.output(&name, row)).fold(0.0, f64::max);
            assert!((force - expected).abs() <= 1e-4 * largest, "{name}: {force} instead of {expected}");
        }
        let angle = body["motion"][place][0].as_f64().unwrap();
        assert_eq!(angle.to_bits(), film.output("rotor_angle", film.row(pair[0])).to_bits());
    }
    // The casing is where the clearance of a blade at rest puts it.
    let wall = &film.animation.header["walls"][0];
    let changes = film.numbers(&wall["change"], ANGLES * times.len());
    let lowest = changes[ANGLES * (times.len() - 1)..].iter().copied().fold(f64::INFINITY, f64::min);
    let gap = scene.settings.contacts[0].nominal_gap();
    let shape = tiprub_core::scene::shape::CompiledShape::new(&scene.settings.surfaces[0].shape, gap).unwrap();
    assert!((lowest / shape.least() - 1.0).abs() < 2e-3, "{lowest} {}", shape.least());
    assert_eq!(wall["gap"].as_f64().unwrap().to_bits(), gap.to_bits());
}

#[test]
fn hardest_hit_blade_and_its_history_are_those_of_the_outputs() {
    let scene = rub();
    let film = Film::run(&scene);
    let blade = film.capture.hardest_hit().unwrap();
    let (sectors, nodes) = (scene.roms[0].sectors, scene.roms[0].contact_nodes.len());
    let total = |sector: usize, row: usize| {
        (1..=nodes).map(|node| film.output(&format!("blade[{sector}].normal_force[{node}]"), row)).sum::<f64>()
    };
    let rows = 0..film.recording.rows();
    let all = rows.clone().flat_map(|row| (1..=sectors).map(move |sector| (sector, row)));
    let (sector, row) = all.max_by(|a, b| total(a.0, a.1).total_cmp(&total(b.0, b.1))).unwrap();
    assert!((blade.force / total(sector, row) - 1.0).abs() < 1e-6, "{blade:?}");
    assert_eq!(blade.time.to_bits(), film.recording.times[row].to_bits());
    let history = film.capture.tip_history(&blade).unwrap();
    let name = format!("blade[{}].tip_{}_displacement[1]", blade.sector + 1, history.direction);
    assert_eq!(history.values.len(), film.recording.rows());
    let largest = history.values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    for (row, value) in history.values.iter().enumerate() {
        assert!((value - film.output(&name, row)).abs() < 1e-5 * largest, "{row}");
    }
    let by_angle = &film.capture.angle_clearances()[0];
    let smallest = rows.map(|row| film.output("clearance_minimum", row)).fold(f64::INFINITY, f64::min);
    let shown = by_angle.smallest.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(shown >= smallest - 1e-9 && shown < smallest + 0.02 * scene.settings.contacts[0].nominal_gap());
}

#[test]
fn coupled_sectors_move_as_in_the_run() {
    let ring = TestDisk::random(5, 2, 7, 0.3, 11);
    let mut scene = tiprub_test_models::disk::with_rotor(ring.cyclic());
    scene.settings.outputs.tip_displacements = true;
    scene.settings.outputs.watched_sectors = vec![1, 2, 3, 4, 5];
    scene.settings.experiment.stop = 90.0 * scene.settings.experiment.communication_step;
    let film = Film::run(&scene);
    check_displacements(&film, &scene);
    let blade = film.capture.hardest_hit().unwrap();
    let history = film.capture.tip_history(&blade).unwrap();
    let name = format!("blade[{}].tip_{}_displacement[1]", blade.sector + 1, history.direction);
    let largest = history.values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    for (row, value) in history.values.iter().enumerate() {
        assert!((value - film.output(&name, row)).abs() < 1e-5 * largest, "{row}");
    }
}

#[test]
fn elastic_casing_and_wear_are_in_the_animation() {
    let mut scene = rub();
    tiprub_test_models::flexible(&mut scene);
    let film = Film::run(&scene);
    let carrier = &scene.settings.structures[1].name;
    assert_eq!(film.body(carrier)["role"], "casing");
    assert_eq!(film.body(carrier)["wall"], 0);
    assert!(film.body(carrier)["rank"].as_u64().unwrap() > 0, "the casing moves");
    assert_eq!(film.animation.header["walls"][0]["carrier"], 1);
    let mut scene = rub();
    tiprub_test_models::coating(&mut scene);
    let film = Film::run(&scene);
    let CoatingSettings { cells_around, cells_along, .. } = scene.settings.contacts[0].coating.unwrap();
    let [wear] = film.capture.wear() else { panic!("one coating") };
    assert!(wear.depth.len() == cells_along && wear.depth.iter().all(|row| row.len() == cells_around));
    assert!(wear.depth.iter().flatten().any(|depth| *depth > 0.0));
}

#[test]
fn free_body_is_shown_without_its_flight() {
    use tiprub_test_models::lattice::{BlockSide, block, scene};
    let mut scene = scene(block([0.0; 3], 1e6), &[(BlockSide::Left, 2.5e-2)], false, [0.3, 0.1, 0.2]);
    scene.settings.experiment.stop = 20.0 * scene.settings.experiment.communication_step;
    let film = Film::run(&scene);
    let name = &scene.settings.structures[0].name;
    let body = film.body(name);
    assert!(body["role"] == "free" && !film.capture.has_rings());
    let last = film.times().len() - 1;
    for (node, _) in scene.roms[0].contact_nodes.iter().enumerate().step_by(3) {
        let moved = film.displacement(body, last, 0, node);
        for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
            let shift = body["motion"][last][axis + 1].as_f64().unwrap();
            let expected = film.output(&format!("{name}.node_displacement_{letter}[{}]", node + 1), 20);
            assert!((moved[axis] + shift - expected).abs() < 2e-3 * expected.abs().max(1e-4), "{moved:?} {expected}");
        }
    }
}

/// A long run keeps few frames, and no peak is lost.
#[test]
fn memory_of_a_long_run_is_bounded() {
    let mut scene = rub();
    scene.settings.outputs.watched_sectors = vec![1, 2, 3, 4, 5, 6];
    let full = Film::run(&scene);
    let extended = observed_scene(&scene, &[]).unwrap();
    let schedule = Schedule::new(&scene.settings.experiment, None, None).unwrap();
    let mut capture = Capture::with_limit(&extended, vec![None], schedule, 32).unwrap();
    let observed = ObservedScene::new(&extended, &schedule).unwrap();
    let given = RunInputs { observed: Some(&observed), ..RunInputs::default() };
    let run = StartedRun::new(&extended, &schedule, given).unwrap();
    run.finish_observed(&|_| (), &mut |index, simulation| {
        capture.add(index, simulation);
        Ok(())
    })
    .unwrap();
    let times = capture.times();
    assert!((17..=33).contains(&times.len()) && schedule.count > 64, "{} of {}", times.len(), schedule.count);
    let steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(steps.iter().all(|step| (step - capture.spacing()).abs() < 1e-9 * step), "{steps:?}");
    let most = |capture: &Capture| {
        let blade = capture.hardest_hit().unwrap();
        capture.node_forces(&blade).iter().flat_map(|(_, values)| values.clone()).fold(0.0, f64::max)
    };
    assert!(most(&capture) >= most(&full.capture) * (1.0 - 1e-6));
    let smallest = |capture: &Capture| capture.angle_clearances()[0].smallest.clone();
    assert_eq!(smallest(&capture), smallest(&full.capture));
    assert_eq!(capture.without_surface(), ["rotor"]);
}

use tiprub_core::Scene;
use tiprub_core::scene::rom::Spin;
use tiprub_cosim::warning::{Severity, Topic, Warning};

use super::prediction::tests::scene;
use super::*;

/// First mode of the test blade (Hz), and the speed at which engine order 4 meets it (rad/s).
const FIRST: f64 = 100.0;
const CROSSING: f64 = FIRST * std::f64::consts::TAU / 4.0;
/// Distance by which the bumps of the scene extend beyond the tips (m).
const BUMP: f64 = 0.2 * 3.56e-4;

/// Requests a map without friction and with bumps of height `intrusion` (m); the damping makes the free vibration decay soon.
fn request(intrusion: f64, speeds: Speeds) -> MapRequest {
    let settings = [
        ("damping_ratio", 0.02),
        ("friction_coefficient", 0.0),
        ("gap_offset", BUMP - intrusion),
        ("internal_step_max", 1e-5),
    ];
    MapRequest {
        speeds: Some(speeds),
        revolutions: Some(32),
        settings: settings.map(|(name, value)| (name.to_owned(), format!("{value:e}"))).to_vec(),
        ..MapRequest::default()
    }
}

fn around(crossing: f64, half: f64, count: usize) -> Speeds {
    Speeds { from: (1.0 - half) * crossing, to: (1.0 + half) * crossing, count }
}

/// Makes a map, and also returns its warnings.
fn make_map(scene: Scene, request: &MapRequest, threads: usize) -> Result<(Study, Vec<String>)> {
    let (map, speeds) = Map::prepare(scene, request)?;
    let runs = sweep::sweep(&speeds, threads, |speed| map.setup.run(*speed, &AtomicU64::new(0)), |_| {})?;
    map.finish(runs, request.quick)
}

#[track_caller]
fn run(scene: Scene, request: &MapRequest, threads: usize) -> Study {
    make_map(scene, request, threads).unwrap().0
}

/// Returns one blade of rotor 37 without friction; the damping makes the free vibration decay soon.
fn blade37() -> Scene {
    let (options, console) = (tiprub_model::Rotor37Options::paper(), Console::new(true, false));
    let mut rom = tiprub_gallery::reduction::rotor37(&options, &console).unwrap().rom;
    rom.sectors = 1;
    let mut scene = scene_source::rotor37_scene_with(rom).unwrap();
    scene.settings.structures[0].damping_ratio = Some(0.01);
    scene.settings.contacts[0].friction = 0.0;
    scene
}

fn meeting(scene: &Scene) -> f64 {
    FrequencyPrediction::new(scene, &MapStart::default(), 0.0).unwrap().meeting(4, 0).unwrap()
}

/// A very soft casing only pushes and does not hold the blade: the response is linear, with resonance at the speed of linear theory.
#[test]
fn soft_contact_has_the_linear_resonance() {
    let mut scene = blade37();
    scene.settings.contacts[0].coating = Some(tiprub_core::scene::settings::CoatingSettings {
        thickness: 2e-3,
        modulus: 1e3,
        yield_stress: 1e12,
        hardening: 0.0,
        cells_around: 720,
        cells_along: 3,
        contact_width: Some(3e-3),
        cutting: None,
    });
    let crossing = meeting(&scene);
    let request =
        MapRequest { speeds: Some(around(crossing, 0.02, 9)), revolutions: Some(32), ..MapRequest::default() };
    let study = run(scene, &request, 2);
    let coincidences = study.results["coincidences"].as_array().unwrap();
    let one = coincidences.iter().find(|one| one["engine_order"] == 4 && one["mode"] == 1).unwrap();
    assert!((one["predicted_speed"].as_f64().unwrap() / crossing - 1.0).abs() < 1e-12, "{one}");
    assert!(
        study.statements.iter().all(|one| !one.expected.starts_with("No node penetrates")),
        "gaps of an unworn coating"
    );
    let unworn = study.statements.iter().find(|one| one.expected.contains("unworn surface")).unwrap();
    assert_eq!(unworn.holds, None);
    // A tenth of the half-power width, and a fifth of the spacing of the speeds.
    assert!(one["relative_shift"].as_f64().unwrap().abs() < 1e-3, "{one}");
    let value = |peak: &serde_json::Value, name: &str| peak[name].as_f64().unwrap();
    let peaks = study.results["peaks"].as_array().unwrap();
    let largest = peaks.iter().max_by(|a, b| value(a, "amplitude").total_cmp(&value(b, "amplitude"))).unwrap();
    let rotation = crossing / std::f64::consts::TAU;
    assert!((value(largest, "frequency") - 4.0 * rotation).abs() < rotation / 32.0, "{largest}");
    assert!((value(largest, "speed") / crossing - 1.0).abs() < 1e-9, "{largest}");
}

/// The same casing, rigid and with hardly any intrusion, constrains the blade: the large response lies above the crossing.
#[test]
fn rigid_contact_moves_the_response_above_the_crossing() {
    let scene = blade37();
    let crossing = meeting(&scene);
    let request = MapRequest {
        speeds: Some(around(crossing, 0.03, 2)),
        revolutions: Some(16),
        settings: vec![("gap_offset".into(), "7.1e-5".into())],
        ..MapRequest::default()
    };
    let study = run(scene, &request, 2);
    let rows = &study.figure("amplitudes").unwrap().sheet.rows;
    assert!(rows[1][1] > 100.0 * rows[0][1], "{rows:?}");
    assert!(rows.iter().all(|row| row[6].abs() < 1.0), "{rows:?}");
}

/// Creates runs in which only one engine order moves, with the amplitude `amplitude` (m) at a speed.
fn runs_of_order(order: usize, speeds: &[f64], amplitude: impl Fn(f64) -> f64) -> Vec<SpeedRun> {
    let response = |speed: f64| {
        let mut spectrum = vec![0.0; order + 2];
        spectrum[order] = amplitude(speed);
        SpeedResponse {
            resolution: speed / std::f64::consts::TAU,
            first_blade: [spectrum.clone(), spectrum.clone()],
            largest_blade: [spectrum.clone(), spectrum],
            deflection: [0.0; 2],
            contact_share: 0.0,
            normal_force: 0.0,
            largest_force: 0.0,
            penetration: 0.0,
            drift: 0.0,
            energy_residual: 0.0,
            factor: 1,
            internal_steps: 0,
            stepping: std::time::Duration::ZERO,
            warnings: Vec::new(),
        }
    };
    speeds.iter().map(|&speed| SpeedRun { speed, outcome: Ok(response(speed)) }).collect()
}

/// Each topic and level is printed once, with the number of its runs, although the numbers in the warnings differ.
#[test]
fn warnings_of_all_runs_are_counted_by_topic() {
    let flutter = |time: f64| {
        Warning::new(Topic::Flutter, "vibration grows", format!("contact opens after {time} s"))
            .at_level(Severity::Note)
    };
    let sticking = Warning::new(Topic::Sticking, "too slow", "Turn faster");
    let mut runs = runs_of_order(1, &[100.0, 200.0, 300.0], |_| 0.0);
    for (run, warnings) in runs.iter_mut().zip([vec![flutter(1e-3)], vec![flutter(2e-3), sticking], vec![]]) {
        run.outcome.as_mut().unwrap().warnings = warnings.iter().map(run::RunWarning::new).collect();
    }
    let runs: Vec<(f64, &SpeedResponse)> = runs.iter().map(|run| (run.speed, run.outcome.as_ref().unwrap())).collect();
    let expected = [
        "note [flutter] vibration grows\n    contact opens after 0.001 s (2 of 3 runs; values from the run at 100 rad/s)",
        "warning [sticking] too slow\n    Turn faster (1 of 3 runs; values from the run at 200 rad/s)",
    ];
    assert_eq!(run::warning_lines(&runs), expected);
    assert!(run::warning_lines(&runs[2..]).is_empty());
}

/// Returns a bell curve of this height around a speed.
fn bell(speed: f64, middle: f64, height: f64) -> f64 {
    height / (1.0 + (40.0 * (speed / middle - 1.0)).powi(2))
}

/// The branch extends to +18 %, with a small maximum on the way, and another beyond the range.
#[test]
fn follows_a_leaning_resonance_branch_to_its_end() {
    let prediction = FrequencyPrediction::new(&scene(FIRST, 4), &MapStart::default(), 0.0).unwrap();
    let speeds = around(CROSSING, 0.3, 61).values();
    let [low, high] = [speeds[0], speeds[60]];
    let crossings = prediction.crossings([low, high], 1.5 * FIRST);
    let lean = |speed: f64| bell(speed, 1.18 * CROSSING, 3e-3) + bell(speed, 1.08 * CROSSING, 1e-3);
    let found = findings::coincidences(&runs_of_order(4, &speeds, lean), &prediction, &crossings, 1);
    let one = found.iter().find(|one| one.crossing.order == 4).unwrap();
    assert!((one.shift().unwrap() - 0.18).abs() < 1e-3, "{one:?}");
    assert_eq!((one.window, one.beyond), ([low, high], None));
    // The second mode, of ten times the frequency, meets the order far above.
    let more = |speed: f64| lean(speed) + bell(speed, 1.6 * CROSSING, 1.0);
    let found = findings::coincidences(&runs_of_order(4, &speeds, more), &prediction, &crossings, 1);
    let one = found.iter().find(|one| one.crossing.order == 4).unwrap();
    assert!((one.shift().unwrap() - 0.18).abs() < 0.01, "{one:?}");
    let (end, amplitude) = one.beyond.unwrap();
    assert!(end.to_bits() == high.to_bits() && amplitude > one.response.unwrap().1, "{one:?}");
}

/// Two modes are a tenth apart, and the lower one responds more: each crossing keeps its own maximum.
#[test]
fn distinguishes_neighbouring_resonances() {
    let mut scene = scene(FIRST, 4);
    let rom = &mut scene.roms[0];
    rom.stiffness[(1, 1)] = rom.stiffness[(0, 0)] * 1.1_f64.powi(2);
    let prediction = FrequencyPrediction::new(&scene, &MapStart::default(), 0.0).unwrap();
    let speeds = around(CROSSING, 0.3, 121).values();
    let crossings = prediction.crossings([speeds[0], speeds[120]], 1.5 * FIRST);
    // Half a percent below its crossing, the response still belongs to the second mode.
    for second in [1.095, 1.13] {
        let two = |speed: f64| bell(speed, 1.03 * CROSSING, 2e-3) + bell(speed, second * CROSSING, 1e-3);
        let found = findings::coincidences(&runs_of_order(4, &speeds, two), &prediction, &crossings, 1);
        let of_order = found.iter().filter(|one| one.crossing.order == 4);
        let tops: Vec<f64> = of_order.map(|one| one.response.unwrap().0 / CROSSING).collect();
        assert_eq!(tops.len(), 2, "{found:?}");
        assert!((tops[0] - 1.03).abs() < 5e-3 && (tops[1] - second).abs() < 5e-3, "{tops:?}");
    }
}

/// For any scene, there is room a fifth above the resonance for a branch that extends by another fifth.
#[test]
fn default_speeds_extend_above_the_resonance() {
    let mut scene = scene(FIRST, 4);
    let chosen = |scene: &Scene, quick| {
        let request = MapRequest { quick, ..MapRequest::default() };
        let (map, speeds) = Map::prepare(scene.clone(), &request).unwrap();
        let crossing = map.prediction.meeting(4, 0).unwrap();
        (speeds.iter().map(|speed| speed / crossing).collect::<Vec<_>>(), crossing)
    };
    for (quick, distance) in [(false, 0.005), (true, 0.1)] {
        let (speeds, _) = chosen(&scene, quick);
        assert!(speeds[0] <= 0.8 + 1e-9 && *speeds.last().unwrap() >= 1.2 * 1.2, "{speeds:?}");
        assert!(speeds.windows(2).all(|two| (two[1] - two[0] - distance).abs() < 1e-9), "{speeds:?}");
    }
    // A model that is valid up to some speed is not run beyond it.
    let rom = &mut scene.roms[0];
    rom.extras.spin = Some(Spin {
        stiffness_speed2: rom.mass.clone() * 0.1,
        stiffness_speed4: rom.mass.clone() * 0.0,
        coriolis: rom.mass.clone() * 0.0,
        centrifugal_load: vec![0.0; 2],
        centrifugal_load_speed4: vec![0.0; 2],
        largest_speed: 1.3 * CROSSING,
    });
    scene.settings.structures[0].speed = CROSSING;
    assert!((chosen(&scene, false).0.last().unwrap() - 1.5).abs() < 1e-9, "spin is not asked for");
    scene.settings.structures[0].spin.stiffening = true;
    let (speeds, crossing) = chosen(&scene, false);
    assert!((speeds.last().unwrap() * crossing / CROSSING - 1.3).abs() < 1e-9, "{speeds:?}");
}

#[test]
fn rejects_scenes_with_several_rotors_or_frictions() {
    let mut settings = scene_source::settings("builtin:rotor37").unwrap();
    assert_eq!(crate::one_rotor_and_friction(&settings), Ok(()));
    let mut other = settings.contacts[0].clone();
    other.friction += 0.1;
    settings.contacts.push(other);
    let failure = crate::one_rotor_and_friction(&settings).unwrap_err();
    assert!(failure.usage && failure.problem.contains("differ in friction"), "{failure}");
    assert_eq!(crate::one_rotor(&settings), Ok(()), "friction is not refined");
    settings.contacts[1].master = "rear".into();
    let failure = crate::one_rotor(&settings).unwrap_err();
    assert!(failure.problem.contains("`rotor` and `rear` are both masters"), "{failure}");
}

#[test]
fn rejects_a_master_at_rest_before_reduction() {
    let settings = scene_source::settings("builtin:cube-between-rings").unwrap();
    let failure = start::master(&settings).unwrap_err();
    assert!(failure.usage && failure.problem.contains("`cube` is a free body"), "{failure}");
    assert!(failure.remedy.contains("builtin:rotor37"), "{failure}");
    let without = Scene { settings, roms: Vec::new() };
    assert_eq!(make_map(without, &MapRequest::default(), 1).unwrap_err(), failure);
}

#[test]
fn numbers_do_not_depend_on_threads() {
    let request = MapRequest { revolutions: Some(4), transient: Some(3), ..request(BUMP, around(CROSSING, 0.1, 5)) };
    let [one, three] = [1, 3].map(|threads| run(scene(FIRST, 4), &request, threads));
    assert_eq!(one.figures.len(), 5);
    // Each axis has one unit.
    for (name, unit) in [("contact", "fraction of time in contact (%)"), ("normal-force", "mean normal force (N)")] {
        assert_eq!(one.figure(name).unwrap().picture.svg.matches(unit).count(), 1, "{name}");
    }
    for (a, b) in one.figures.iter().zip(&three.figures) {
        assert_eq!((a.sheet.to_csv(), &a.picture), (b.sheet.to_csv(), &b.picture), "{}", a.name);
    }
    assert_eq!((&one.statements, &one.files), (&three.statements, &three.files));
}

#[test]
fn rejected_speeds_are_marked_and_fail_if_all_rejected() {
    let mut scene = scene(FIRST, 2);
    let rom = &mut scene.roms[0];
    rom.extras.spin = Some(Spin {
        stiffness_speed2: rom.mass.clone(),
        stiffness_speed4: rom.mass.clone() * 0.0,
        coriolis: rom.mass.clone() * 0.0,
        centrifugal_load: vec![0.0; 2],
        centrifugal_load_speed4: vec![0.0; 2],
        largest_speed: 160.0,
    });
    scene.settings.structures[0].spin.stiffening = true;
    scene.settings.structures[0].speed = 150.0;
    let speeds = |from, to| Speeds { from, to, count: 3 };
    let request = |speeds| MapRequest { revolutions: Some(4), transient: Some(3), ..request(BUMP, speeds) };
    let study = run(scene.clone(), &request(speeds(150.0, 190.0)), 2);
    let refused = study.results["refused"].as_array().unwrap();
    assert_eq!(refused.len(), 2, "{refused:?}");
    assert!(refused[0][1].as_str().unwrap().contains("beyond the 160 rad/s"), "{refused:?}");
    assert_eq!(study.statements[0].holds, Some(false), "{:?}", study.statements[0]);
    let map = study.figure("map").unwrap();
    assert_eq!(map.picture.svg.matches("refused").count(), 2);
    assert_eq!(
        map.sheet.rows.iter().filter(|row| row[1].is_nan()).map(|row| row[0]).collect::<Vec<_>>(),
        [170.0, 190.0]
    );
    let failure = make_map(scene, &request(speeds(170.0, 190.0)), 1).unwrap_err();
    assert!(failure.problem.contains("all angular velocities were rejected"), "{failure}");
}

#[test]
fn rejects_too_coarse_steps_and_a_speed_override() {
    let mut coarse = request(BUMP, around(CROSSING, 0.1, 2));
    coarse.settings.retain(|(name, _)| name != "internal_step_max");
    coarse.settings.push(("internal_step_max".into(), "1e-4".into()));
    let failure = make_map(scene(FIRST, 2), &coarse, 1).unwrap_err();
    assert!(failure.problem.contains("internal_step_max="), "{failure}");
    let request = MapRequest { settings: vec![("speed".into(), "1".into())], ..MapRequest::default() };
    assert!(make_map(scene(FIRST, 2), &request, 1).unwrap_err().usage);
}

/// With friction, the sense of rotation matters; a blade mirrored about its middle that rotates in the opposite sense gives the mirrored result.
#[test]
fn rotor_keeps_the_sense_of_rotation_of_the_scene() {
    let speeds = around(CROSSING, 0.1, 2);
    let request = MapRequest { revolutions: Some(2), transient: Some(1), ..request(BUMP, speeds) };
    let request = MapRequest {
        settings: request.settings.iter().filter(|(name, _)| name != "friction_coefficient").cloned().collect(),
        ..request
    };
    let forces = |sense: f64, mirrored: bool| {
        let mut scene = scene(FIRST, 1);
        scene.settings.contacts[0].friction = 0.4;
        scene.settings.structures[0].speed = sense;
        if mirrored {
            [1, 4].iter().for_each(|row| scene.roms[0].contact_map.row_mut(*row).neg_mut());
        }
        let study = run(scene, &request, 1);
        let reported = study.facts.iter().find(|(name, _)| name == "angular velocities").unwrap().1.clone();
        assert!(reported.contains(if sense < 0.0 { "negative sense" } else { "positive sense" }), "{reported}");
        let rows = &study.figure("normal-force").unwrap().sheet.rows;
        assert!(rows.iter().all(|row| row[1] > 1.0), "{rows:?}");
        [rows[0][1], rows[1][1]]
    };
    let [forward, zero, backward, mirrored] =
        [(100.0, false), (0.0, false), (-100.0, false), (-100.0, true)].map(|(sense, mirror)| forces(sense, mirror));
    for (index, force) in forward.iter().enumerate() {
        assert_eq!(force.to_bits(), zero[index].to_bits());
        assert!((mirrored[index] / force - 1.0).abs() < 1e-6, "{forward:?} {mirrored:?}");
        assert!((backward[index] / force - 1.0).abs() > 1e-3, "{forward:?} {backward:?}");
    }
}

#[test]
fn rejects_excessive_requests_before_running() {
    let refused = |request: &MapRequest| Map::prepare(scene(FIRST, 36), request).map(|_| ()).unwrap_err();
    for revolutions in [100_000_000, usize::MAX] {
        let request = MapRequest { revolutions: Some(revolutions), ..request(BUMP, around(CROSSING, 0.1, 5)) };
        let failure = refused(&request);
        assert!(failure.usage && failure.what.contains(&format!("--revolutions {revolutions}")), "{failure}");
        // The number that the remedy names fits, and one more does not.
        let most: usize = failure.remedy.split(' ').find_map(|word| word.parse().ok()).unwrap();
        let with = |revolutions| MapRequest { revolutions: Some(revolutions), ..request.clone() };
        assert!(Map::prepare(scene(FIRST, 36), &with(most)).is_ok(), "{failure}");
        assert!(refused(&with(most + 1)).usage, "{failure}");
        assert!(most > 1000, "{failure}");
    }
    // Here, the spectra of many runs do not fit.
    let many = |count| MapRequest { revolutions: Some(2000), ..request(BUMP, around(CROSSING, 0.1, count)) };
    assert!(Map::prepare(scene(FIRST, 36), &many(5)).is_ok());
    assert!(refused(&many(1000)).what.contains("--revolutions 2000"));
    let slow = request(BUMP, Speeds { from: 1e-3, to: 1.0, count: 5 });
    let failure = refused(&slow);
    assert!(failure.usage && failure.what == "--speeds" && failure.problem.contains("0.001 rad/s"), "{failure}");
    let least: f64 = failure.remedy.split(' ').find_map(|word| word.parse().ok()).unwrap();
    let from = |from| MapRequest { revolutions: Some(1), ..request(BUMP, Speeds { from, to: 1.0, count: 5 }) };
    assert!(Map::prepare(scene(FIRST, 36), &from(least)).is_ok(), "{failure}");
    assert!(refused(&from(0.9 * least)).usage, "{failure}");
}

#[test]
fn planned_steps_match_the_work_done() {
    let request = MapRequest { revolutions: Some(4), transient: Some(3), ..request(BUMP, around(CROSSING, 0.1, 2)) };
    let (map, speeds) = Map::prepare(scene(FIRST, 4), &request).unwrap();
    let finished = AtomicU64::new(0);
    let run = map.setup.run(speeds[0], &finished).unwrap();
    // Every step of a completed run is counted when it finishes, so none is missing at the end.
    let steps = map.setup.communication_steps();
    let internal = steps * run.outcome.as_ref().unwrap().factor as u64;
    assert_eq!((finished.load(Ordering::Relaxed), run.outcome.unwrap().internal_steps), (steps, internal));
    // A rejected run performs no step, and all its steps are added at the end.
    let rejected = map.setup.run(1e9, &finished).unwrap();
    assert!(rejected.outcome.is_err() && finished.load(Ordering::Relaxed) == 2 * steps);
}

#[test]
fn start_values_affect_orders_and_facts() {
    let prepared = |change: fn(&mut Scene), set: &[(&str, &str)]| {
        let mut scene = scene(FIRST, 2);
        scene.settings.surfaces[0].moving = true;
        change(&mut scene);
        let set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
        let request = MapRequest { settings: set, speeds: Some(around(CROSSING, 0.1, 2)), ..MapRequest::default() };
        Map::prepare(scene, &request).unwrap().0
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
    let plain = prepared(|_| {}, &[]);
    assert_eq!((plain.prediction.base_order, plain.start.without()), (2, String::new()));
    near(plain.intrusion, BUMP);
    let gap = plain.start.clearance[0];
    let moved = [("gap_offset", "1e-5"), ("casing_radius_change", "2e-5"), ("casing_shape_factor", "0.5")];
    let moved = prepared(|scene| scene.settings.contacts[0].sector_gaps = vec![3e-4, 5e-4], &moved);
    near(moved.start.clearance[0], 3.3e-4);
    near(moved.start.clearance[1], 5.3e-4);
    near(moved.depth, 0.5 * plain.depth);
    near(moved.intrusion, 0.5 * (gap + BUMP) - 3.3e-4);
    let round = prepared(|_| {}, &[("casing_shape_factor", "0")]);
    assert_eq!((round.prediction.base_order, round.static_displacement), (0, None));
    let whirl = |scene: &mut Scene| scene.settings.structures[0].whirl = true;
    assert_eq!(prepared(whirl, &[]).prediction.base_order, 2, "a shaft in the middle has no order");
    let whirling = prepared(whirl, &[("whirl_y", "-1e-5")]);
    assert_eq!((whirling.prediction.base_order, whirling.start.without()), (1, ", without whirl".into()));
}

/// Without contact, no statement is made about the response.
#[test]
fn gives_no_response_verdict_without_contact() {
    let request = MapRequest { revolutions: Some(4), transient: Some(3), ..request(-1e-4, around(CROSSING, 0.1, 2)) };
    let study = run(scene(FIRST, 2), &request, 1);
    let holds = |start: &str| study.statements.iter().find(|one| one.expected.starts_with(start)).unwrap().holds;
    assert_eq!(holds("The tips touch"), Some(false));
    assert_eq!([holds("The scale of the response"), holds("The response repeats")], [None, None]);
}

#[test]
fn stiffening_verdict_requires_a_visible_effect() {
    let crossing = |order, speed| Crossing { order, mode: 0, speed, frequency: 100.0, excited: true };
    let one = |order, response, beyond| Coincidence {
        crossing: crossing(order, 100.0),
        window: [90.0, 150.0],
        response,
        beyond,
    };
    let verdict =
        |all: &[Coincidence]| statements::stiffens(all, 2.0).map(|statement| (statement.holds, statement.found));
    assert_eq!(verdict(&[one(4, None, None)]), None);
    let above = one(4, Some((110.0, 3e-3)), None);
    assert_eq!(verdict(&[above]).unwrap().0, Some(true));
    assert_eq!(verdict(&[one(4, Some((95.0, 3e-3)), None), one(6, Some((120.0, 1e-3)), None)]).unwrap().0, Some(false));
    for shift in [-1.9, 1.9] {
        let (holds, found) = verdict(&[one(4, Some((100.0 + shift, 3e-3)), None)]).unwrap();
        assert!(holds.is_none() && found.contains("smaller than the spacing of the speeds"), "{found}");
    }
    // Another crossing extends beyond the range: a smaller response there does not matter, a larger one may be the strongest.
    assert_eq!(verdict(&[above, one(6, Some((104.0, 1e-3)), Some((150.0, 2e-3)))]).unwrap().0, Some(true));
    for response in [None, Some((104.0, 1e-3))] {
        let (holds, found) = verdict(&[above, one(6, response, Some((150.0, 4e-3)))]).unwrap();
        assert!(holds.is_none() && found.starts_with("undecided: the response to engine order 6 in mode 1"), "{found}");
    }
}

/// Two runs lie beside a border of the window, and the vertex of the parabola lies beyond it.
#[test]
fn interpolated_maximum_stays_in_its_window() {
    let mut scene = scene(FIRST, 4);
    let rom = &mut scene.roms[0];
    rom.stiffness[(1, 1)] = rom.stiffness[(0, 0)] * 1.25_f64.powi(2);
    let prediction = FrequencyPrediction::new(&scene, &MapStart::default(), 0.0).unwrap();
    let speeds = [0.9, 1.0, 1.1, 1.2, 1.3].map(|share| share * CROSSING);
    let crossings = prediction.crossings([speeds[0], speeds[4]], 1.5 * FIRST);
    // The window of the second mode begins at 1.1875 times the crossing of the first one; the vertex of the parabola is at 1.15.
    let two = |speed: f64| {
        if speed < 1.15 * CROSSING && speed > 1.05 * CROSSING { 0.999e-3 } else { bell(speed, 1.2 * CROSSING, 1e-3) }
    };
    let found = findings::coincidences(&runs_of_order(4, &speeds, two), &prediction, &crossings, 1);
    for one in found.iter().filter(|one| one.crossing.order == 4) {
        let Some((speed, _)) = one.response else { continue };
        assert!((one.window[0]..=one.window[1]).contains(&speed), "{one:?}");
    }
    let second = found.iter().find(|one| one.crossing.order == 4 && one.crossing.speed > 1.1 * CROSSING).unwrap();
    assert!(second.response.is_some(), "{found:?}");
}

#[test]
fn engine_orders_fold_at_half_the_number_of_sectors() {
    let folds =
        [(2, (2, false)), (28, (28, false)), (29, (27, true)), (54, (2, true)), (56, (0, false)), (58, (2, false))];
    for (order, expected) in folds {
        assert_eq!(prediction::folded(order, 56), expected, "order {order}");
    }
    assert_eq!([3, 4, 5].map(|order| prediction::folded(order, 7)), [(3, false), (3, true), (2, true)]);
}

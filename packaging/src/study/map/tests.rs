use tiprub_core::{Scene, rom::Spin};

use super::prediction::tests::scene;
use super::*;

/// First mode of the test blade (Hz), and where engine order 4 meets it (rad/s).
const FIRST: f64 = 100.0;
const CROSSING: f64 = FIRST * std::f64::consts::TAU / 4.0;
/// How far the bumps of the scene reach beyond the tips (m).
const BUMP: f64 = 0.2 * 3.56e-4;

/// Damped enough for the free vibration to die out soon, without friction, and only `intrusion` (m) of the bumps.
fn request(intrusion: f64, speeds: Speeds) -> Request {
    let settings = [
        ("damping_ratio", 0.02),
        ("friction_coefficient", 0.0),
        ("gap_offset", BUMP - intrusion),
        ("internal_step_max", 1e-5),
    ];
    Request {
        speeds: Some(speeds),
        revolutions: Some(32),
        settings: settings.map(|(name, value)| (name.to_owned(), format!("{value:e}"))).to_vec(),
        ..Request::default()
    }
}

fn around(crossing: f64, half: f64, count: usize) -> Speeds {
    Speeds { from: (1.0 - half) * crossing, to: (1.0 + half) * crossing, count }
}

#[track_caller]
fn run(scene: Scene, request: &Request, threads: usize) -> Study {
    of_scene(scene, request, threads, |_, _, _| {}).unwrap().0
}

/// One blade of rotor 37, damped enough for the free vibration to die out soon, without friction.
fn blade37() -> Scene {
    let (options, console) = (tiprub_model::Rotor37Options::default(), Console::new(true, false));
    let mut rom = crate::reduction::rotor37(&options, &console).unwrap().rom;
    rom.sectors = 1;
    let mut scene = scene_source::rotor37_scene_with(rom).unwrap();
    scene.settings.structures[0].damping_ratio = Some(0.01);
    scene.settings.contacts[0].friction = 0.0;
    scene
}

fn meeting(scene: &Scene) -> f64 {
    Prediction::new(scene, &Start::default(), 0.0).unwrap().meeting(4, 0).unwrap()
}

/// A casing as soft as nothing pushes without holding: the response is linear, and resonance where linear theory has it.
#[test]
fn the_softest_contact_leaves_resonance_where_linear_theory_has_it() {
    let mut scene = blade37();
    scene.settings.contacts[0].coating = Some(tiprub_core::settings::CoatingSettings {
        thickness: 2e-3,
        modulus: 1e3,
        yield_stress: 1e12,
        hardening: 0.0,
        cells_around: 720,
        cells_along: 3,
    });
    let crossing = meeting(&scene);
    let request = Request { speeds: Some(around(crossing, 0.02, 9)), revolutions: Some(32), ..Request::default() };
    let study = run(scene, &request, 2);
    let coincidences = study.results["coincidences"].as_array().unwrap();
    let one = coincidences.iter().find(|one| one["engine_order"] == 4 && one["mode"] == 1).unwrap();
    assert!((one["predicted_speed"].as_f64().unwrap() / crossing - 1.0).abs() < 1e-12, "{one}");
    // A tenth of the half-power width, a fifth of the distance of the speeds.
    assert!(one["relative_shift"].as_f64().unwrap().abs() < 1e-3, "{one}");
    let value = |peak: &serde_json::Value, name: &str| peak[name].as_f64().unwrap();
    let peaks = study.results["peaks"].as_array().unwrap();
    let largest = peaks.iter().max_by(|a, b| value(a, "amplitude").total_cmp(&value(b, "amplitude"))).unwrap();
    let rotation = crossing / std::f64::consts::TAU;
    assert!((value(largest, "frequency") - 4.0 * rotation).abs() < rotation / 32.0, "{largest}");
    assert!((value(largest, "speed") / crossing - 1.0).abs() < 1e-9, "{largest}");
}

/// The same casing rigid, and with hardly any intrusion, holds the blade back: the large response lies above the crossing.
#[test]
fn rigid_contact_moves_the_response_above_the_crossing() {
    let scene = blade37();
    let crossing = meeting(&scene);
    let request = Request {
        speeds: Some(around(crossing, 0.03, 2)),
        revolutions: Some(16),
        settings: vec![("gap_offset".into(), "7.1e-5".into())],
        ..Request::default()
    };
    let study = run(scene, &request, 2);
    let rows = &study.figure("amplitudes").unwrap().sheet.rows;
    assert!(rows[1][1] > 100.0 * rows[0][1], "{rows:?}");
    assert!(rows.iter().all(|row| row[6].abs() < 1.0), "{rows:?}");
}

/// Runs in which only one engine order moves, by `amplitude` (m) at a speed.
fn runs_of_order(order: usize, speeds: &[f64], amplitude: impl Fn(f64) -> f64) -> Vec<Run> {
    let response = |speed: f64| {
        let mut spectrum = vec![0.0; order + 2];
        spectrum[order] = amplitude(speed);
        Response {
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
    speeds.iter().map(|&speed| Run { speed, outcome: Ok(response(speed)) }).collect()
}

/// A bell of this height around a speed.
fn bell(speed: f64, middle: f64, height: f64) -> f64 {
    height / (1.0 + (40.0 * (speed / middle - 1.0)).powi(2))
}

/// A branch that leans to +18 %, with a small maximum on the way, and another beyond the range.
#[test]
fn a_resonance_is_followed_as_far_as_it_leans() {
    let prediction = Prediction::new(&scene(FIRST, 4), &Start::default(), 0.0).unwrap();
    let speeds = around(CROSSING, 0.3, 61).values();
    let [low, high] = [speeds[0], speeds[60]];
    let crossings = prediction.crossings([low, high], 1.5 * FIRST);
    let lean = |speed: f64| bell(speed, 1.18 * CROSSING, 3e-3) + bell(speed, 1.08 * CROSSING, 1e-3);
    let found = findings::coincidences(&runs_of_order(4, &speeds, lean), &prediction, &crossings, 1);
    let one = found.iter().find(|one| one.crossing.order == 4).unwrap();
    assert!((one.shift().unwrap() - 0.18).abs() < 1e-3, "{one:?}");
    assert_eq!((one.window, one.beyond), ([low, high], None));
    // The second mode, ten times as high, meets the order far above.
    let more = |speed: f64| lean(speed) + bell(speed, 1.6 * CROSSING, 1.0);
    let found = findings::coincidences(&runs_of_order(4, &speeds, more), &prediction, &crossings, 1);
    let one = found.iter().find(|one| one.crossing.order == 4).unwrap();
    assert!((one.shift().unwrap() - 0.18).abs() < 0.01, "{one:?}");
    let (end, amplitude) = one.beyond.unwrap();
    assert!(end.to_bits() == high.to_bits() && amplitude > one.response.unwrap().1, "{one:?}");
}

/// Two modes a tenth apart, the lower one responding more: each crossing keeps its own maximum.
#[test]
fn neighbouring_resonances_are_told_apart() {
    let mut scene = scene(FIRST, 4);
    let rom = &mut scene.roms[0];
    rom.stiffness[(1, 1)] = rom.stiffness[(0, 0)] * 1.1_f64.powi(2);
    let prediction = Prediction::new(&scene, &Start::default(), 0.0).unwrap();
    let speeds = around(CROSSING, 0.3, 121).values();
    let crossings = prediction.crossings([speeds[0], speeds[120]], 1.5 * FIRST);
    // Half a percent below its own crossing the second one is still that of it.
    for second in [1.095, 1.13] {
        let two = |speed: f64| bell(speed, 1.03 * CROSSING, 2e-3) + bell(speed, second * CROSSING, 1e-3);
        let found = findings::coincidences(&runs_of_order(4, &speeds, two), &prediction, &crossings, 1);
        let of_order = found.iter().filter(|one| one.crossing.order == 4);
        let tops: Vec<f64> = of_order.map(|one| one.response.unwrap().0 / CROSSING).collect();
        assert_eq!(tops.len(), 2, "{found:?}");
        assert!((tops[0] - 1.03).abs() < 5e-3 && (tops[1] - second).abs() < 5e-3, "{tops:?}");
    }
}

/// Whatever the scene: a fifth above the resonance sought, there is room for a branch that leans by another fifth.
#[test]
fn the_speeds_chosen_leave_room_above_the_resonance() {
    let mut scene = scene(FIRST, 4);
    let chosen = |scene: &Scene, quick| {
        let request = Request { quick, ..Request::default() };
        let (map, speeds) = Map::prepare(scene.clone(), &request).unwrap();
        let crossing = map.prediction.meeting(4, 0).unwrap();
        (speeds.iter().map(|speed| speed / crossing).collect::<Vec<_>>(), crossing)
    };
    for (quick, distance) in [(false, 0.005), (true, 0.1)] {
        let (speeds, _) = chosen(&scene, quick);
        assert!(speeds[0] <= 0.8 + 1e-9 && *speeds.last().unwrap() >= 1.2 * 1.2, "{speeds:?}");
        assert!(speeds.windows(2).all(|two| (two[1] - two[0] - distance).abs() < 1e-9), "{speeds:?}");
    }
    // A model that holds up to some speed is not asked beyond it.
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
fn a_master_that_does_not_turn_is_refused_before_anything_is_reduced() {
    let settings = scene_source::settings("builtin:cube-between-rings").unwrap();
    let failure = prediction::master(&settings).unwrap_err();
    assert!(failure.usage && failure.problem.contains("`cube`, flies freely"), "{failure}");
    assert!(failure.remedy.contains("builtin:rotor37"), "{failure}");
    let without = Scene { settings, roms: Vec::new() };
    assert_eq!(of_scene(without, &Request::default(), 1, |_, _, _| {}).unwrap_err(), failure);
}

#[test]
fn numbers_do_not_depend_on_threads() {
    let request = Request { revolutions: Some(4), transient: Some(3), ..request(BUMP, around(CROSSING, 0.1, 5)) };
    let [one, three] = [1, 3].map(|threads| run(scene(FIRST, 4), &request, threads));
    assert_eq!(one.figures.len(), 5);
    // One unit on each axis.
    for (name, unit) in [("contact", "share of time in contact (%)"), ("normal-force", "mean normal force (N)")] {
        assert_eq!(one.figure(name).unwrap().picture.svg.matches(unit).count(), 1, "{name}");
    }
    for (a, b) in one.figures.iter().zip(&three.figures) {
        assert_eq!((a.sheet.to_csv(), &a.picture), (b.sheet.to_csv(), &b.picture), "{}", a.name);
    }
    assert_eq!((&one.statements, &one.files), (&three.statements, &three.files));
}

#[test]
fn refused_speeds_are_marked_and_all_refused_is_a_failure() {
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
    let request = |speeds| Request { revolutions: Some(4), transient: Some(3), ..request(BUMP, speeds) };
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
    let failure = of_scene(scene, &request(speeds(170.0, 190.0)), 1, |_, _, _| {}).unwrap_err();
    assert!(failure.problem.contains("every angular velocity is refused"), "{failure}");
}

#[test]
fn steps_too_coarse_for_the_filter_and_a_speed_set_are_refused() {
    let mut coarse = request(BUMP, around(CROSSING, 0.1, 2));
    coarse.settings.retain(|(name, _)| name != "internal_step_max");
    coarse.settings.push(("internal_step_max".into(), "1e-4".into()));
    let failure = of_scene(scene(FIRST, 2), &coarse, 1, |_, _, _| {}).unwrap_err();
    assert!(failure.problem.contains("internal_step_max="), "{failure}");
    let request = Request { settings: vec![("speed".into(), "1".into())], ..Request::default() };
    assert!(of_scene(scene(FIRST, 2), &request, 1, |_, _, _| {}).unwrap_err().usage);
}

//! The report of a run: complete, offline, small.

use tiprub_core::{
    Simulation,
    settings::{Scheme, Solver},
};
use tiprub_gallery::{reduction, scene_source::rotor37_scene_with};
use tiprub_model::{Rotor37Options, rotor37::MeshCounts};
use tiprub_packaging::{
    report::{
        input::{ImportedSummary, ReportFile, ReportInput},
        page::render,
    },
    rom_facts::RomFacts,
};
use tiprub_shell::{
    console::Console,
    native::{self, Given},
    schedule::Schedule,
};
use tiprub_study::{
    error_study::{self, ErrorStudy, METHODS, by_tolerance},
    estimate::Estimate,
};

/// The references meet, errors fall with h, and what is refused is a row.
fn check(study: &ErrorStudy) {
    assert!(study.references_apart < 1e-3, "{}", study.references_apart);
    // Other equations, though not far away.
    assert!((1e-3..0.3).contains(&study.massless_apart), "{}", study.massless_apart);
    for method in METHODS {
        let rows: Vec<_> = study.rows.iter().filter(|row| row.method == method).collect();
        assert_eq!(rows.len(), 5);
        let errors: Vec<f64> = rows.iter().filter_map(|row| Some(row.outcome.as_ref().ok()?.1.displacement)).collect();
        assert!(errors.last() < errors.first(), "{method:?}: {errors:?}");
        assert_eq!(method.0 == Scheme::CentralDifference, rows[0].outcome.is_err(), "{method:?} at 5 µs");
        let best = rows[4].outcome.as_ref().unwrap().1;
        assert!(
            method.1 == Solver::Film
                || (best.penetration <= if by_tolerance(method) { 1e-12 } else { 0.0 } && best.adhesion >= 0.0),
            "{best:?}"
        );
    }
    assert!(study.cheapest(METHODS[0], 1e-2).is_some() && study.cheapest(METHODS[0], 1e-9).is_none());
}

#[test]
fn a_report_is_complete_offline_and_small() {
    let options = Rotor37Options { mesh: MeshCounts { chord: 4, thickness: 1, span: 4 }, ..Rotor37Options::paper() };
    let reduction = reduction::rotor37(&options, &Console::new(true, false)).unwrap();
    let scene = rotor37_scene_with(reduction.rom.clone()).unwrap();
    let schedule = Schedule::new(&scene.settings.experiment, Some(0.004), Some(2e-6)).unwrap();
    let run = native::run(&scene, &schedule, Given::default(), &|_| {}).unwrap();
    let agreement = run.recording.compare(&run.recording).unwrap();
    let quiet = Console::new(true, false);
    let study = error_study::study(&scene, 1.5e-3, &quiet.task("study", None)).unwrap();
    check(&study);
    let html = render(&ReportInput {
        scene: &scene,
        table: Simulation::new(&scene).unwrap().table(),
        reduction: Some(&reduction),
        facts: &[RomFacts::of(&reduction.rom, None).unwrap()],
        schedule: &schedule,
        native: &run,
        study: Some(&study),
        estimates: &[Estimate { direction: "steps", left: Ok(1.5e-3), found_on: None }],
        paper: Some((Simulation::new(&scene).unwrap().table(), &run)),
        imported: &[ImportedSummary { label: "FMI 2.0".into(), stepping: 0.1, agreement }],
        files: &[ReportFile { name: "results.csv".into(), meaning: "results".into(), bytes: 1234 }],
        durations: &[("native run".into(), 0.5)],
    })
    .unwrap();
    for wanted in [
        "mode 4:",
        "estimated error of the displacements: steps 0.15 %",
        "Beside the paper's model and method",
        "clearance (µm)",
        "normal force (N)",
        "friction force (N)",
        "nodes in contact",
        "energy (J)",
        "|residual|",
        "leading edge",
        "eq. 12",
        "eq. 13",
        "all internal steps accepted below",
        "bit for bit",
        "href=\"results.csv\"",
        "relative error of the displacements",
        "ω_max·h",
    ] {
        assert!(html.contains(wanted), "{wanted}");
    }
    assert!(html.len() < 2_000_000, "{} bytes", html.len());
    let outside = html.replace("http://www.w3.org/2000/svg", "");
    assert!(!outside.contains("http") && !outside.contains("src=") && !outside.contains("url("), "opens offline");
    assert!(!html.contains("NaN") && !html.contains(">inf"), "no number is missing");
    assert_eq!(html.matches("<svg").count(), html.matches("</svg>").count());
    assert_eq!(html.matches("<figure").count(), html.matches("<figcaption").count());
}

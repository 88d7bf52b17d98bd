//! The report of a run: complete, offline, small.

use tiprub_core::Simulation;
use tiprub_model::{Rotor37Options, rotor37::MeshCounts};
use tiprub_packaging::{
    console::Console,
    native, reduction,
    report::page::{ImportedSummary, ReportFile, ReportInput, render},
    rom_facts::RomFacts,
    scene_source::rotor37_scene_with,
    schedule::Schedule,
};

#[test]
fn a_report_is_complete_offline_and_small() {
    let options = Rotor37Options { mesh: MeshCounts { chord: 4, thickness: 1, span: 4 }, ..Rotor37Options::default() };
    let reduction = reduction::rotor37(&options, &Console::new(true, false)).unwrap();
    let scene = rotor37_scene_with(reduction.rom.clone()).unwrap();
    let schedule = Schedule::new(&scene.settings.experiment, Some(0.004), Some(2e-6)).unwrap();
    let run = native::run(&scene, &schedule, &[], &|_| {}).unwrap();
    let agreement = run.recording.compare(&run.recording).unwrap();
    let html = render(&ReportInput {
        scene: &scene,
        table: Simulation::new(&scene).unwrap().table(),
        reduction: Some(&reduction),
        facts: &[RomFacts::of(&reduction.rom).unwrap()],
        schedule: &schedule,
        native: &run,
        study: None,
        imported: &[ImportedSummary { label: "FMI 2.0".into(), stepping: 0.1, agreement }],
        files: &[ReportFile { name: "results.csv".into(), meaning: "results".into(), bytes: 1234 }],
        durations: &[("native run".into(), 0.5)],
    })
    .unwrap();
    for wanted in [
        "mode 4:",
        "clearance (µm)",
        "normal force (N)",
        "friction force (N)",
        "nodes in contact",
        "energy (J)",
        "|residual|",
        "leading edge",
        "eq. 12",
        "eq. 13",
        "largest stable h",
        "bit for bit",
        "href=\"results.csv\"",
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

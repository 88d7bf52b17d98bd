//! Report of a run: complete, offline, small.

use tiprub_core::{CoSimulation, Simulation};
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
    native::{self, RunInputs},
    schedule::Schedule,
};
use tiprub_study::estimate::{ErrorSource, Estimate};

#[test]
fn a_report_is_complete_offline_and_small() {
    let options = Rotor37Options { mesh: MeshCounts { chord: 4, thickness: 1, span: 4 }, ..Rotor37Options::paper() };
    let reduction = reduction::rotor37(&options, &Console::new(true, false)).unwrap();
    let scene = rotor37_scene_with(reduction.rom.clone()).unwrap();
    let schedule = Schedule::new(&scene.settings.experiment, Some(0.004), Some(2e-6)).unwrap();
    let run = native::run(&scene, &schedule, RunInputs::default(), &|_| {}).unwrap();
    let agreement = run.recording.compare(&run.recording).unwrap();
    let html = render(&ReportInput {
        scene: &scene,
        table: Simulation::new(&scene).unwrap().table(),
        reduction: Some(&reduction),
        facts: &[RomFacts::of(&reduction.rom, None).unwrap()],
        schedule: &schedule,
        native: &run,
        estimates: &[Estimate { direction: "steps", left: Ok(1.5e-3), source: ErrorSource::Run }],
        paper: Some((Simulation::new(&scene).unwrap().table(), &run)),
        imported: &[ImportedSummary { label: "FMI 2.0".into(), stepping: 0.1, agreement }],
        files: &[ReportFile { name: "results.csv".into(), meaning: "results".into(), bytes: 1234 }],
        durations: &[("native run".into(), 0.5)],
    })
    .unwrap();
    for wanted in [
        "mode 4:",
        "estimated error of the displacements: steps 0.15 %",
        "Comparison with the paper's model and method",
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
        "tiprub study error builtin:rotor37",
        "computing time per simulated second",
        "class=\"narrow\"",
    ] {
        assert!(html.contains(wanted), "{wanted}");
    }
    assert!(html.len() < 2_000_000, "{} bytes", html.len());
    let outside = html.replace("http://www.w3.org/2000/svg", "");
    assert!(!outside.contains("http") && !outside.contains("src=") && !outside.contains("url("), "opens offline");
    assert!(!html.contains("NaN") && !html.contains(">inf"), "no number is missing");
    assert!(!html.contains("-0.00000") && !html.contains("real-time factor"));
    assert_eq!(html.matches("<svg").count(), html.matches("</svg>").count());
    assert_eq!(html.matches("<figure").count(), html.matches("<figcaption").count());
}

//! Comparison of the cube between two rings with other programs and on finer meshes, and two questions about method
//! a: `cube_outside beside TABLE.csv METHOD …`, `cube_outside level DIRECTORY N fast|slow STEP END` (writes a run on
//! a mesh) and `cube_outside mesh DIRECTORY N …` (reads them), `cube_outside gaps`, `cube_outside turning`. Tables
//! are printed as Markdown.

mod beside;
mod questions;
mod refine;

use std::path::Path;

use tiprub_reference::cube::history::CubeHistory;
use tiprub_reference::cube::scene::{CubeScene, CubeSetting};
use tiprub_reference::methods::{CubeMethod, MethodRun};

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["beside", path, words @ ..] => beside::compare(path, words),
        ["level", directory, n, case @ ("fast" | "slow"), step, end] => {
            let [step, end] = [step, end].map(|text| text.parse().expect("a time in seconds"));
            refine::level(Path::new(directory), n.parse().expect("elements per side"), case, step, end);
        }
        ["mesh", directory, counts @ ..] => {
            let counts: Vec<usize> = counts.iter().map(|n| n.parse().expect("elements per side")).collect();
            refine::table(Path::new(directory), &counts);
        }
        ["gaps"] => questions::gaps(),
        ["turning"] => questions::turning(),
        _ => {
            eprintln!(
                "cube_outside beside TABLE.csv METHOD …|level DIRECTORY N fast|slow STEP END|mesh DIRECTORY N …|gaps|turning"
            );
            std::process::exit(2);
        }
    }
}

/// Runs a method on the meshes of the paper.
fn run(method: CubeMethod, setting: CubeSetting, step: f64, end: f64, stride: usize) -> CubeHistory {
    let scene = CubeScene::new(setting).expect("the scene can be built");
    run_scene(&scene, method, step, end, stride)
}

fn run_scene(scene: &CubeScene, method: CubeMethod, step: f64, end: f64, stride: usize) -> CubeHistory {
    let history = method.run(scene, &MethodRun { step, end, stride, snapshots: vec![] }).expect("the run ends well");
    eprintln!(
        "{} {:?}, h = {step:e} s: {:.1} s of processor time, {:.1} s to prepare",
        history.method, scene.setting, history.processor_time, history.preparation_time
    );
    history
}

use tiprub_reference::cube::scene::{Mass, Scene, Setting};
use tiprub_reference::methods::{Method, Run};
use tiprub_reference::surface::SurfaceKind;

fn main() {
    let a: Vec<String> = std::env::args().collect();
    let n = |i: usize| a.get(i).map_or(1.0, |t| t.parse::<f64>().unwrap());
    let method = match a[1].as_str() {
        "film" => Method::Film(Default::default()),
        "bipotential" => Method::Bipotential,
        "augmented" => Method::Augmented(tiprub_reference::methods::augmented::Options { penalty: n(10), tolerance: n(11) }),
        _ => Method::Penalty(Default::default()),
    };
    let surface = if a[2] == "spline" { SurfaceKind::Spline } else { SurfaceKind::Facets };
    let mass = if a[3] == "lumped" { Mass::Lumped } else { Mass::Consistent };
    let setting = Setting { speed: n(6), friction: n(7), surface, mass };
    let scene = Scene::new(setting).unwrap();
    let run = Run { step: n(4), end: n(5), stride: n(8) as usize, snapshots: vec![] };
    let h = method.run(&scene, &run).unwrap();
    let total = h.total();
    let min = total.iter().cloned().fold(f64::MAX, f64::min);
    let max = total.iter().cloned().fold(0.0, f64::max);
    let fmax = h.first_force().into_iter().fold(0.0, f64::max);
    let pen = h.penetration.iter().cloned().fold(0.0, f64::max);
    let ux: Vec<f64> = h.first(0);
    println!("{a:?}: total {} .. {} .. {} kin end {} prep {} cpu {} iterations {} fmax {fmax} pen {pen:e} last {:?} v {:?} ux {} {}",
        total[0], min, max, h.kinetic.last().unwrap(), h.preparation_time, h.processor_time, h.iterations, h.last_contact(), h.velocity.last().unwrap(),
        ux.iter().cloned().fold(f64::MAX, f64::min), ux.iter().cloned().fold(f64::MIN, f64::max));
    if a.len() > 9 { std::fs::write(&a[9], h.csv()).unwrap(); }
}

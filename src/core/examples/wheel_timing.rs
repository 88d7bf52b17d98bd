use std::time::Instant;
use nalgebra::{Complex, DMatrix};
use tiprub_core::dynamics::cyclic::{CyclicBank, CyclicModel, DiameterModes};
use tiprub_core::settings::Scheme;
fn main() {
    let (sectors, modes, rows) = (56, 34, 9);
    let diameters = (0..=sectors / 2)
        .map(|n| DiameterModes {
            nodal_diameter: n,
            frequencies: (0..modes).map(|m| 5000.0 * (1.0 + m as f64) + n as f64).collect(),
            damping_ratios: vec![0.005; modes],
            contact_modes: DMatrix::from_fn(rows, modes, |r, m| {
                let x = 1.7 * r as f64 + 2.3 * m as f64 + n as f64;
                Complex::new(x.cos(), if n == 0 || 2 * n == sectors { 0.0 } else { x.sin() })
            }),
            shapes: DMatrix::identity(modes, modes),
            quasi_static: 9,
        })
        .collect();
    let model = CyclicModel { sectors, diameters };
    let mut bank = CyclicBank::new(&model, false);
    bank.set_step(Scheme::ModalExact, 1e-6);
    for n in 0..29 { for m in 0..34 { bank.set_modal_state(n, m, [1e-5, 0.0], [0.0, 0.0]); } }
    bank.recover();
    let mut best = [f64::MAX; 3];
    for _ in 0..400 {
        let t = Instant::now();
        for _ in 0..200 { bank.predict(true); }
        best[0] = best[0].min(t.elapsed().as_secs_f64() / 200.0);
        let t = Instant::now();
        for _ in 0..200 { bank.ask([(3, 0, [1.0, 0.1, 0.2]), (17, 2, [1.0, 0.1, 0.2])].into_iter()); }
        best[1] = best[1].min(t.elapsed().as_secs_f64() / 200.0);
        let t = Instant::now();
        for _ in 0..200 { bank.predict(true); bank.ask([(3, 0, [1.0, 0.1, 0.2]), (17, 2, [1.0, 0.1, 0.2])].into_iter()); bank.act(); }
        best[2] = best[2].min(t.elapsed().as_secs_f64() / 200.0);
    }
    println!("predict {:.3} ask {:.3} predict+ask+act {:.3} µs", best[0] * 1e6, best[1] * 1e6, best[2] * 1e6);
}

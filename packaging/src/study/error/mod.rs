//! Error against run time: every scheme, solver, step and number of modes of the product, and methods that share nothing with it.

pub mod bars;
pub mod case;
pub mod clock;
pub mod competitor;
pub mod measure;
pub mod outside;
pub mod rods;
pub mod run;
pub mod scene;

#[cfg(test)]
mod scratch {
    use super::{bars::Bars, case::Case, measure};
    #[test]
    fn scratch() {
        let console = crate::console::Console::new(true, false);
        for case in [Bars::carpenter(false).unwrap(), Bars::bouncing(false).unwrap(), Bars::shaken(false).unwrap(), Bars::shaken(true).unwrap()] {
            let clock = std::time::Instant::now();
            let found = measure::measure(&case, &console.task("", None)).unwrap();
            println!("== {} {:.1} s", case.name(), clock.elapsed().as_secs_f64());
            for (size, own) in case.sizes().iter().zip(&found.references) {
                println!("{size}: apart {:.1e} {:.1e}, massless {:.1e}", own.apart[0], own.apart[1], own.massless_apart);
            }
            println!("truncation {:?}", found.truncation);
            for row in &found.rows {
                match &row.outcome {
                    Ok(f) => println!("{:4} {:34} h {:.2e} {:.2e} s total {:.1e} time {:.1e} own {:.1e} imp {:.1e} {:.1e} en {:.1e} res {:.0e} pen {:.1e} adh {:.1e} rel {:.1e}", case.sizes()[row.size], row.competitor.name(), row.step, f.seconds, f.total, f.of_time, f.of_own, f.impulse, f.impulse_total, f.energy, f.residual.unwrap_or(f64::NAN), f.penetration, f.adhesion, f.release.unwrap_or(f64::NAN)),
                    Err(e) => println!("{:4} {:34} h {:.2e} {e}", case.sizes()[row.size], row.competitor.name(), row.step),
                }
            }
        }
    }
}

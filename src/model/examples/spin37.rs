//! Effects of spin on the rotor 37 blade.
use tiprub_model::{Rotor37Options, reduce_rotor37, spin};
fn main() -> tiprub_model::Result<()> {
    let n = std::env::args().nth(1).map_or(3, |a| a.parse().unwrap());
    let m = std::env::args().nth(2).map_or(20, |a| a.parse().unwrap());
    let r = reduce_rotor37(
        &Rotor37Options { spin: Some(1800.0), contact_nodes: n, fixed_interface_modes: m, ..Default::default() },
        &tiprub_model::progress::silent,
    )?;
    println!("{:?}", r.timings);
    println!("{}", r.rom.origin);
    println!("wmax {:e} order {}", r.reduced_angular_frequencies.last().unwrap(), r.rom.order());
    for c in &r.spin_checks {
        println!(
            "{} full {:.3?}\n reduced {:.3?}\n dev {:.4?} growth {:.3?}%",
            c.speed,
            c.full_frequencies,
            c.reduced_frequencies,
            c.frequency_deviation(),
            c.growth_deviation()
        );
        println!("{:.9?}\n{:.9?}", c.full_growth, c.reduced_growth);
    }
    if n > 3 {
        return Ok(());
    }
    for om in [0.0, 450.0, 900.0, 1300., 1350.0, 1800.0] {
        println!(
            "{om} {:.4?} {:.4?}",
            &spin::frequencies_at(&r.rom, om, false)?[..10],
            &spin::frequencies_at(&r.rom, om, true)?[..10]
        );
    }
    Ok(())
}

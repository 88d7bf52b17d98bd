//! Reduces the 56-sector stage of the paper's size and tells counts, times, memory and quality.
//!
//! `cargo run --release -p tiprub-model --example cyclic -- [modes per nodal diameter, 25] [checked modes, 10] [families|count]`

use std::time::Instant;

use tiprub_model::cyclic::{CyclicBoundary, CyclicOptions, ModeSelection, reduce_cyclic};
use tiprub_model::progress::silent;
use tiprub_model::stage::{SECTORS, SectorOptions, sector_mesh};
use tiprub_model::{FeModel, Material};

fn main() -> tiprub_model::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default| arguments.get(i).and_then(|text| text.parse().ok()).unwrap_or(default);
    let (modes, checked_modes) = (number(0, 25), number(1, 10));
    let families = arguments.get(2).is_none_or(|text| text != "count");
    let start = Instant::now();
    let sector = sector_mesh(&SectorOptions::default())?;
    let contact = sector.contact_points(3)?;
    let mesh = sector.mesh;
    let clamped = mesh.set("CLAMPED")?.to_vec();
    let (low, high) = (mesh.set("CYCLIC_LOW")?, mesh.set("CYCLIC_HIGH")?);
    let (boundary, pairing) = CyclicBoundary::pair(&mesh.nodes, low, high, SECTORS, 1e-9)?;
    println!("{} nodes, {} elements, {} pairs of face nodes", mesh.nodes.len(), mesh.elements.len(), low.len());
    println!("faces fit to {:.2e} m (typically {:.2e} m)", pairing.largest_mismatch, pairing.typical_mismatch);
    let model = FeModel::assembled(mesh, &Material::titanium(), "stage".into(), &silent)?;
    println!("mesh and assembly: {:.2} s", start.elapsed().as_secs_f64());
    let start = Instant::now();
    let modes = if families { ModeSelection::Families(modes) } else { ModeSelection::Count(modes) };
    let options = CyclicOptions { name: "stage".into(), modes, checked_modes, damping_ratio: 0.005 };
    let reduction = reduce_cyclic(&model, &clamped, &contact, &boundary, &options, &silent)?;
    println!("reduction: {:.2} s wall, {:?}", start.elapsed().as_secs_f64(), reduction.timings);
    println!("{}", usage());
    println!("{}\n{:?}", reduction.rom.origin, reduction.notes);
    println!("{} free dofs per nodal diameter, {} reduced in all", reduction.free_dofs, reduction.rom.total_order());
    for diameter in &reduction.nodal_diameters {
        let worst = |list: &[f64]| list.iter().copied().fold(0.0, f64::max);
        println!(
            "n = {:2}: {:4} modes, full {:8.2} {:8.2} {:8.2} {:8.2} Hz, deviation <= {:.2e} %, RCC <= {:.2e} %",
            diameter.number,
            diameter.fixed_interface_frequencies.len(),
            diameter.full_frequencies[0],
            diameter.full_frequencies[1],
            diameter.full_frequencies[2],
            diameter.full_frequencies[3],
            worst(&diameter.frequency_deviation),
            worst(&diameter.residual_criterion),
        );
    }
    for row in &reduction.convergence {
        let worst = |list: &[f64]| list.iter().copied().fold(0.0, f64::max);
        println!(
            "eta = {:2}: {} modes of the disk, deviation <= {:.3e} %, RCC <= {:.3e} %",
            row.modes,
            row.frequency_deviation.len(),
            worst(&row.frequency_deviation),
            worst(&row.residual_criterion)
        );
    }
    Ok(())
}

/// Processor time and peak memory, where /proc tells them.
fn usage() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or("VmHWM unknown").to_owned();
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks: Vec<f64> = stat.split_whitespace().skip(13).take(2).filter_map(|text| text.parse().ok()).collect();
    format!(
        "{peak}; user {:.1} s, system {:.1} s",
        ticks.first().unwrap_or(&0.0) / 100.0,
        ticks.get(1).unwrap_or(&0.0) / 100.0
    )
}

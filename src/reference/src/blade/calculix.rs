//! A statically loaded blade as CalculiX input files, and the stress that CalculiX computes at its nodes.

use std::fmt::Write as _;

use tiprub_model::inp::calculix_input;
use tiprub_model::{Material, Mesh, Result};

/// Returns the input file of the blade held at `clamped` under forces on nodes (N along x, y, z), which outputs
/// displacements and the stress of CalculiX at the nodes, from 27 points of every brick.
///
/// # Errors
/// The errors of [`calculix_input`].
pub fn pushed(mesh: &Mesh, material: &Material, clamped: &str, forces: &[(usize, [f64; 3])]) -> Result<String> {
    let mut text = calculix_input(mesh, material, Some(clamped), 1)?;
    text.truncate(text.find("*STEP").unwrap_or(text.len()));
    text.push_str("*STEP\n*STATIC\n*CLOAD\n");
    for (node, force) in forces {
        for (axis, force) in force.iter().enumerate() {
            put(&mut text, format_args!("{}, {}, {force:.12e}\n", node + 1, axis + 1));
        }
    }
    text.push_str("*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n");
    Ok(text)
}

/// Returns the input file of the same blade with prescribed displacements (m) of all nodes but one, of bricks with 2
/// × 2 × 2 points: the stress of a known field, from the points where it is most accurate. One node is free, since
/// CalculiX solves no problem without unknowns.
///
/// # Errors
/// The errors of [`calculix_input`].
pub fn moved(mesh: &Mesh, material: &Material, displacements: &[[f64; 3]], free: usize) -> Result<String> {
    let mut text = calculix_input(mesh, material, None, 1)?.replace("TYPE=C3D20,", "TYPE=C3D20R,");
    text.truncate(text.find("*STEP").unwrap_or(text.len()));
    text.push_str("*STEP\n*STATIC\n*BOUNDARY\n");
    for (node, moved) in displacements.iter().enumerate().filter(|(node, _)| *node != free) {
        for (axis, moved) in moved.iter().enumerate() {
            put(&mut text, format_args!("{}, {d}, {d}, {moved:.12e}\n", node + 1, d = axis + 1));
        }
    }
    text.push_str("*NODE FILE\nU\n*EL FILE\nS\n*END STEP\n");
    Ok(text)
}

/// Returns the values at the nodes in the last block of that name (`DISP`, `STRESS`) in a result file (`.frd`), by
/// node.
pub fn results(frd: &str, block: &str, components: usize) -> Vec<(usize, Vec<f64>)> {
    let mut found = Vec::new();
    let mut open = false;
    for line in frd.lines() {
        match line.get(..3) {
            Some(" -4") => {
                open = line[3..].trim_start().starts_with(block);
                if open {
                    found.clear();
                }
            }
            Some(" -3") => open = false,
            Some(" -1") if open => {
                let value = |index: usize| line.get(13 + 12 * index..25 + 12 * index)?.trim().parse().ok();
                let values: Option<Vec<f64>> = (0..components).map(value).collect();
                let node = line.get(3..13).and_then(|node| node.trim().parse::<usize>().ok());
                found.extend(node.zip(values).map(|(node, values)| (node - 1, values)));
            }
            _ => {}
        }
    }
    found
}

fn put(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    text.write_fmt(arguments).expect("writing to a String does not fail");
}

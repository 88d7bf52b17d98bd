//! Describes the imported model and the choices.

use std::fmt::Write as _;

use serde_json::{Value, json};
use tiprub_model::{
    cyclic::PairingReport,
    patches::FoundTip,
    read::{Imported, bounding_box, set_counts, total_mass},
    reduce::ContactPoint,
};

use super::choose::Chosen;
use crate::mesh_arguments::ModelOptions;

/// Describes the input and the choices, as text and as JSON.
pub fn describe(imported: &Imported, options: &ModelOptions, chosen: &Chosen) -> (String, Value) {
    let model = &imported.model;
    let [low, high] = bounding_box(&model.nodes);
    let mass = total_mass(model);
    let mut text = format!("{}: {} nodes", model.origin, model.nodes.len());
    if let Some((mesh, _)) = &model.mesh {
        let _ = write!(text, ", {} elements", mesh.elements.len());
    }
    for material in &imported.materials {
        let _ = write!(
            text,
            "\n  material                  {}: E = {:.4e} Pa, ν = {}, ρ = {:.1} kg/m³",
            material.name, material.young_modulus, material.poisson_ratio, material.density
        );
    }
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        let _ = write!(text, "\n  {name}                         {:.6} m to {:.6} m", low[axis], high[axis]);
    }
    let _ = write!(
        text,
        "\n  mass                      {mass:.6} kg\n  sets                      {}",
        set_counts(&model.sets)
    );
    let _ = write!(text, "\n  clamped                   {} nodes", chosen.clamped.len());
    text.push_str(&contact(imported, options, chosen));
    if let Some((boundary, report)) = &chosen.faces {
        let PairingReport { largest_mismatch, typical_mismatch, .. } = report;
        let (pairs, pitch) = (boundary.pairs.len(), boundary.pitch().to_degrees());
        let _ = write!(
            text,
            "\n  faces                     {pairs} pairs of nodes, {pitch:.4}° apart; mismatch at most \
             {largest_mismatch:.2e} m, typically {typical_mismatch:.2e} m"
        );
        if report.swapped {
            text.push_str("\n  note: the two faces were swapped: the low face is the one at the smaller angle");
        }
    }
    for note in &imported.notes {
        let _ = write!(text, "\n  note: {note}");
    }
    let json = json!({
        "origin": model.origin,
        "nodes": model.nodes.len(),
        "box": { "low": low, "high": high },
        "mass": mass,
        "sets": model.sets.iter().map(|(name, nodes)| (name.clone(), json!(nodes.len()))).collect::<serde_json::Map<_, _>>(),
        "clamped_nodes": chosen.clamped.len(),
        "faces": chosen.faces.as_ref().map(|(boundary, report)| json!({
            "pairs": boundary.pairs.len(),
            "largest_mismatch": report.largest_mismatch,
            "typical_mismatch": report.typical_mismatch,
            "swapped": report.swapped,
        })),
        "contact_nodes": chosen.contact.iter().map(|point| json!({
            "name": point.name, "patch_nodes": point.patch.len(), "node": imported.node_numbers[point.node], "slope": point.meridional_slope,
        })).collect::<Vec<_>>(),
        "tip": chosen.tip.as_ref().filter(|(_, found)| *found).map(|(tip, _)| json!({
            "faces": tip.faces, "nodes": tip.nodes.len(), "chord": tip.chord, "radius": tip.radius, "axial": tip.axial,
        })),
        "notes": imported.notes,
    });
    (text, json)
}

/// Describes contact nodes or patches, each with its node in the file, the size of a grid, and the tip if it was found.
fn contact(imported: &Imported, options: &ModelOptions, chosen: &Chosen) -> String {
    let mut text = String::new();
    let contact_set = options.contact_set.as_deref().unwrap_or("the detected tip");
    if let Some((tip, true)) = &chosen.tip {
        let FoundTip { faces, nodes, chord, radius: [low, high], axial: [from, to], .. } = tip;
        let _ = write!(
            text,
            "\n  detected tip              {faces} faces, {} nodes, chord {chord:.6} m, radius {low:.6} m to \
             {high:.6} m, z {from:.6} m to {to:.6} m",
            nodes.len()
        );
    }
    let is_patch = |point: &ContactPoint| !point.patch.is_empty();
    let what = match chosen.contact.iter().any(is_patch) {
        true if chosen.grid.is_some() => "contact points ",
        true => "contact patches",
        false => "contact nodes  ",
    };
    let _ = write!(text, "\n  {what}           {} from {contact_set}", chosen.contact.len());
    if let Some(grid) = &chosen.grid {
        let between = if grid.points.is_empty() { "" } else { ", on the faces of the mesh" };
        let _ = write!(text, ": {} around x {} along{between}", grid.around, grid.along());
    }
    for point in chosen.contact.iter().filter(|_| chosen.grid.is_none()) {
        let number = imported.node_numbers[point.node];
        let _ = match point.patch.len() {
            0 => write!(text, "\n    {:<24}node {number} of the file", point.name),
            nodes => write!(text, "\n    {:<24}{nodes} nodes around node {number} of the file", point.name),
        };
    }
    text
}

//! Rejects impossible values of an imported model, and asks about unusual ones.

use tiprub_core::Rom;
use tiprub_core::limits::plausibility::Slip;
use tiprub_model::{
    read::{Imported, plausibility},
    reduce::ContactPoint,
};
use tiprub_shell::{Failure, Result};

use super::choose::{Chosen, PATCHES};
use crate::mesh_arguments::{ModelOptions, UnitChoice};

/// Usual range of the first natural frequency of machine parts (Hz).
const USUAL_FREQUENCIES: [f64; 2] = [1.0, 1e6];

/// Rejects impossible values, unless the units are explicitly SI; asks about unusual values.
pub fn judge(imported: &Imported, options: &ModelOptions) -> Result<Vec<String>> {
    let found = plausibility(&imported.model, &imported.materials);
    let question = |list: &[String]| format!("{}: is this intended?", list.join("; "));
    let mut warnings = Vec::new();
    if !found.impossible.is_empty() {
        if options.units != Some(UnitChoice::Metre) {
            let remedy = match options.units {
                _ if options.young.is_some() && found.impossible.iter().all(|text| text.starts_with("material")) => {
                    "Give --young and --density in SI units, Pa and kg/m³, whatever the units of the file"
                }
                None => {
                    "If lengths are in mm, masses in t and stresses in MPa, use --units mm-t-s; if the values are \
                     correct, use --units m"
                }
                Some(_) => "If the units of the file are m, kg and s after all, omit --units",
            };
            let problem = format!("implausible values ({})", found.impossible.join("; "));
            return Err(Failure::new("units of the model", problem, remedy));
        }
        warnings.push(question(&found.impossible));
    }
    if !found.doubtful.is_empty() {
        warnings.push(format!("{} For files in mm, t and s, use --units mm-t-s", question(&found.doubtful)));
    }
    Ok(warnings)
}

/// Smallest radius of contact nodes at a tip, as a fraction of the largest radius of the model; shrouds and flared tips stay above it.
const TIPS: f64 = 0.9;

/// Returns a slip if the contact nodes of blades lie inside: tip and root may be exchanged, or the axis may be wrong.
pub fn radius_slip(imported: &Imported, chosen: &Chosen) -> Option<Slip> {
    let radius = |[x, y, _]: [f64; 3]| x.hypot(y);
    let nodes = &imported.model.nodes;
    let outermost = nodes.iter().copied().map(radius).fold(0.0, f64::max);
    let contact = chosen.contact.iter().map(|point| radius(nodes[point.node])).fold(0.0, f64::max);
    (chosen.grid.is_none() && contact < TIPS * outermost).then(|| Slip {
        what: "contact nodes".into(),
        problem: format!("they reach a radius of {contact:.6} m, but the model reaches {outermost:.6} m"),
        question: "Are the tip, the root and the axis of rotation correct?".into(),
    })
}

/// Largest number of element edges between two contact nodes; with more, forces at nodes represent the force on the tip poorly.
const REFINED: f64 = 2.0;

/// Returns warnings about contact at nodes if the mesh permits patches, and about a tip that may be incomplete.
pub fn contact_warnings(chosen: &Chosen) -> Vec<String> {
    let Some((tip, automatic)) = &chosen.tip else { return single(chosen).into_iter().collect() };
    let mut warnings = Vec::new();
    if *automatic && tip.elsewhere > 0 {
        warnings.push(format!(
            "besides the detected tip, {} faces that are not connected to it are as far out: if they can also touch, \
             give all of them in a set (--contact-set)",
            tip.elsewhere
        ));
    }
    let on_tip = chosen.contact.iter().all(|point| tip.nodes.binary_search(&point.node).is_ok());
    let (count, edges) = (chosen.contact.len(), tip.chord / tip.edge);
    let rows = ContactPoint::rows(&chosen.contact).unwrap_or(1);
    let patches = chosen.contact.iter().filter(|point| !point.patch.is_empty()).count() / rows;
    if patches > 0 || !on_tip {
        warnings.extend(single(chosen));
        if on_tip && patches > tip.at_most(patches) {
            warnings.push(narrow(patches, edges.round(), tip.at_most(patches)));
        }
        if on_tip && rows > tip.across + 1 {
            warnings.push(narrow_rows(rows, tip.across));
        }
    } else if count == 1 || edges > REFINED * (count - 1) as f64 {
        let nodes = if count == 1 { "a single node".to_owned() } else { format!("{count} nodes") };
        warnings.push(format!(
            "contact at {nodes} of a tip about {edges:.0} element edges long: the indentation under a nodal force \
             grows as the mesh is refined, and the tip between the nodes passes through the casing; use \
             --contact-patches {} to spread contact over the tip",
            tip.at_most(PATCHES)
        ));
    }
    warnings
}

/// Returns warnings about sets that contain only a part of the tip or root found in the mesh.
pub fn set_warnings(options: &ModelOptions, chosen: &Chosen) -> Vec<String> {
    let within = |set: &[usize], whole: &[usize]| whole.iter().filter(|node| set.binary_search(node).is_ok()).count();
    let mut warnings = Vec::new();
    if let (Some(name), Some((tip, _)), false) = (&options.contact_set, &chosen.tip, chosen.tip_set.is_empty()) {
        let (on_tip, all, own) = (within(&chosen.tip_set, &tip.nodes), tip.nodes.len(), chosen.tip_set.len());
        if on_tip < all {
            warnings.push(format!(
                "{name} has {on_tip} of the {all} nodes of the outermost faces, and the other nodes of the tip pass \
                 through the casing: is this intended? Without --contact-set, all of them are contact nodes"
            ));
        } else if own > all {
            warnings.push(format!(
                "{name} has {own} nodes, but only {all} are on the outermost faces: can the others touch? Without \
                 --contact-set, they are excluded"
            ));
        }
    }
    let (held, all) = (within(&chosen.clamped, &chosen.root), chosen.root.len());
    if 0 < held && held < all {
        warnings.push(format!(
            "{} has {held} of the {all} nodes of the innermost faces, and the other nodes of the root are free: is \
             this intended?",
            options.clamp_set.join(", ")
        ));
    }
    warnings
}

/// Returns the warning that there are more patches than the elements of a tip resolve.
pub fn narrow(patches: usize, edges: f64, most: usize) -> String {
    format!(
        "{patches} contact patches along about {edges:.0} element edges: patches narrower than elements are not \
         independent, and the mesh does not resolve their forces; request at most {most} \
         (--contact-patches {most}), or refine the tip"
    )
}

/// Returns the warning that there are more rows than the elements resolve across the thickness of a tip.
pub fn narrow_rows(rows: usize, elements: usize) -> String {
    let (plural, most) = (if elements == 1 { "" } else { "s" }, elements + 1);
    format!(
        "{rows} rows of contact patches across {elements} element{plural}: rows narrower than elements are not \
         independent, and the mesh does not resolve their forces; request at most {most} (--contact-rows {most}), or \
         refine the tip"
    )
}

fn single(chosen: &Chosen) -> Option<String> {
    let what = match chosen.contact.as_slice() {
        [point] if point.patch.is_empty() => format!("the single node `{}`", point.name),
        [point] => format!("the single patch `{}`", point.name),
        all if ContactPoint::rows(all) == Some(all.len()) => "a single patch along the chord".to_owned(),
        _ => return None,
    };
    Some(format!(
        "contact at {what}: the position of contact along the chord is not resolved, and nothing prevents tilting; \
         request more patches (--contact-patches {PATCHES})"
    ))
}

/// Returns a warning about a first frequency outside the usual range; for a `free` structure, the seventh frequency.
pub fn frequency_warning(rom: &Rom, free: bool) -> Option<String> {
    let first = *rom.checks.full_frequencies.get(if free { 6 } else { 0 })?;
    let [low, high] = USUAL_FREQUENCIES;
    (!(low..=high).contains(&first)).then(|| {
        format!("the first natural frequency is {first:.3e} Hz: are units, material and clamped nodes correct?")
    })
}

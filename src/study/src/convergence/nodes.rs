//! Assigns the contact nodes of a refined model to contact pairs. Pairs select nodes by the beginning of their names, but a reduction chooses new
//! names: without this assignment, the contact would change with the refinement.

use tiprub_core::scene::rom::ContactNode;
use tiprub_core::scene::settings::ContactSettings;
use tiprub_core::{Rom, Scene};

/// Returns the model with the names of the contact nodes of `own`, which has as many nodes at the same places.
pub(super) fn named_as(own: &Rom, mut again: Rom) -> Rom {
    for (node, own) in again.contact_nodes.iter_mut().zip(&own.contact_nodes) {
        node.name.clone_from(&own.name);
    }
    again
}

/// Returns whether a pair selects a node by the beginning of its name.
fn claims(contact: &ContactSettings, node: &ContactNode) -> bool {
    contact.nodes.as_ref().is_none_or(|start| node.name.starts_with(start))
}

/// Returns the common beginning of the names of all contact nodes of the structure at `index`, if one pair selects all of them; then new nodes
/// belong to that pair.
///
/// # Errors
/// A new node lies between two nodes that do not belong to the same pair.
pub(super) fn common_start(scene: &Scene, index: usize) -> Result<String, String> {
    let (rom, master) = (&scene.roms[index], &scene.settings.structures[index].name);
    let pairs = scene.settings.contacts.iter().enumerate().filter(|(_, contact)| contact.master == *master);
    let of = |node: &ContactNode| pairs.clone().find(|(_, contact)| claims(contact, node));
    let places: Vec<Option<usize>> = rom.contact_nodes.iter().map(|node| Some(of(node)?.0)).collect();
    if let Some(border) = places.windows(2).position(|pair| pair[0] != pair[1]) {
        let describe_node = |place: usize| {
            let pair = places[place].map_or("no contact".to_owned(), |pair| format!("contact[{}]", pair + 1));
            format!("`{}` ({pair})", rom.contact_nodes[place].name)
        };
        return Err(format!(
            "pairs select contact nodes by name, and the pair of a new node between {} and {} is undefined. Reduce the \
             blade with more --contact-nodes, choose --contact-names that begin with the `nodes` prefix of their pair, and \
             compare runs",
            describe_node(border),
            describe_node(border + 1)
        ));
    }
    let start = places.first().copied().flatten().and_then(|pair| scene.settings.contacts[pair].nodes.clone());
    Ok(start.unwrap_or_default())
}

/// Returns the model with names of contact nodes that all begin with `start`; unchanged if `start` is empty.
pub(super) fn starting_with(start: &str, mut rom: Rom) -> Rom {
    for (index, node) in rom.contact_nodes.iter_mut().enumerate().filter(|_| !start.is_empty()) {
        node.name = format!("{start}{}", index + 1);
    }
    rom
}

#[cfg(test)]
mod tests {
    use tiprub_gallery::{rom_cache::RomCache, scene_source};
    use tiprub_model::{
        Rotor37Options, reduce_rotor37,
        rotor37::{MeshCounts, TipContact},
    };
    use tiprub_shell::{Failure, Result, console::Console};

    use super::*;
    use crate::convergence::{
        directions::directions,
        refine::{Again, Meshed, RefinementDirection, RomSource},
    };

    /// Coarse blade with the node names of the reduction.
    struct CoarseBlade;

    impl RomSource for CoarseBlade {
        fn reduce(&self, other: Option<usize>, modes: usize, tip: TipContact, _: &Console) -> Result<Meshed> {
            let mesh = MeshCounts { chord: 4, thickness: 1, span: if other.is_some() { 8 } else { 4 } };
            let options = Rotor37Options { mesh, tip, modes, ..Rotor37Options::paper() };
            let found =
                reduce_rotor37(&options, &|_| {}).map_err(|error| Failure::new("blade", error.to_string(), ""))?;
            Ok(Meshed { rom: found.rom, nodes: found.nodes })
        }

        fn others(&self) -> usize {
            1
        }
    }

    /// Returns the directions of modes and contact nodes of a blade with nodes of these names, with a pair for each beginning.
    fn refined(names: [&str; 3], pairs: &[&str]) -> [RefinementDirection; 3] {
        let console = Console::new(true, false);
        let mut rom = CoarseBlade.reduce(None, 4, TipContact::Nodes(3), &console).unwrap().rom;
        rom.contact_nodes.iter_mut().zip(names).for_each(|(node, name)| node.name = name.into());
        let mut scene = scene_source::rotor37_scene_with(rom).unwrap();
        let contact = scene.settings.contacts.remove(0);
        let of = |start: &&str| ContactSettings { nodes: Some((*start).into()), ..contact.clone() };
        scene.settings.contacts = pairs.iter().map(of).collect();
        let (cache, source) = (RomCache::off(), Some(&CoarseBlade as &dyn RomSource));
        let again =
            Again { source, cache: &cache, mesh: 1.0, finest_tip: 4, only: &[], quick: true, console: &console };
        let [_, modes, nodes, mesh] = directions(&scene, 1, &again).unwrap().try_into().unwrap();
        [modes, nodes, mesh]
    }

    fn names(direction: &RefinementDirection) -> Vec<Vec<String>> {
        let of = |rom: &Rom| rom.contact_nodes.iter().map(|node| node.name.clone()).collect();
        direction.levels.iter().map(|level| of(&level.scene.roms[0])).collect()
    }

    #[test]
    fn contact_nodes_are_kept_for_other_modes_and_meshes() {
        let own = ["tip_3", "seal", "tip_1"];
        let [modes, _, mesh] = refined(own, &["tip", "seal"]);
        assert_eq!(names(&modes), [own, own, own], "{:?}", modes.missing);
        assert_eq!(names(&mesh), [own, own], "{:?}", mesh.missing);
        assert!(mesh.levels[0].own && mesh.levels[0].value < mesh.levels[1].value && !mesh.levels[1].own);
        assert!(mesh.size(mesh.levels[0].value) > mesh.size(mesh.levels[1].value));
    }

    /// Tips are refined as far as the mesh has nodes for them; the rest is reported. Only the requested directions are created.
    #[test]
    fn tip_refinement_stops_at_the_mesh_resolution() {
        let console = Console::new(true, false);
        let scene =
            scene_source::rotor37_scene_with(CoarseBlade.reduce(None, 4, TipContact::Nodes(3), &console).unwrap().rom)
                .unwrap();
        let (cache, only) = (RomCache::off(), ["nodes".to_owned()]);
        let of = |finest_tip| {
            let source = Some(&CoarseBlade as &dyn RomSource);
            let again =
                Again { source, cache: &cache, mesh: 1.0, finest_tip, only: &only, quick: false, console: &console };
            let [nodes] = directions(&scene, 1, &again).unwrap().try_into().unwrap();
            let levels = nodes.levels.iter().map(|level| level.value).collect::<Vec<_>>();
            (levels, nodes.missing)
        };
        let made = vec![2.0, 3.0, 5.0];
        assert_eq!(of(2), (made.clone(), String::new()));
        for (finest, refused) in [(4, 1), (8, 2)] {
            let (levels, missing) = of(finest);
            assert_eq!(levels, made);
            let reported = ["9 nodes: ", "17 nodes: "].iter().filter(|count| missing.contains(*count)).count();
            assert!(reported == refused && missing.contains("outside the range 2 to 5"), "{missing}");
        }
    }

    #[test]
    fn new_nodes_within_a_pair_belong_to_that_pair() {
        let [_, nodes, _] = refined(["tip_a", "tip_b", "tip_c"], &["tip_"]);
        let found = names(&nodes);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [2, 3, 5], "{}", nodes.missing);
        assert!(found.iter().flatten().all(|name| name.starts_with("tip_")), "{found:?}");
    }

    #[test]
    fn does_not_add_nodes_without_a_known_contact_pair() {
        let own = ["leading", "mid", "trailing"];
        for (pairs, reported) in [
            (&["leading"][..], "`leading` (contact[1]) and `mid` (no contact)"),
            (&["leading", "trailing"], "`leading` (contact[1]) and `mid` (no contact)"),
            (&["trailing", "l", "m"], "`leading` (contact[2]) and `mid` (contact[3])"),
        ] {
            let [_, nodes, _] = refined(own, pairs);
            assert!(nodes.levels.is_empty() && nodes.missing.contains(reported), "{pairs:?}: {}", nodes.missing);
        }
    }
}

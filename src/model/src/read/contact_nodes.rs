//! Choice of contact nodes from a set: evenly along the axis, in the middle of the thickness of the tip, with the
//! slope of the contour.

use crate::contact_point::ContactPoint;
use crate::places::Places;
use crate::{Error, Result};

/// Largest number of nodes of a set that is used as a whole.
pub(crate) const TAKEN_WHOLE: usize = 12;
/// Number of nodes chosen from a larger set: both edges and the middle.
pub(crate) const CHOSEN: usize = 3;

/// Choice of the contact nodes.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ContactChoice {
    /// Number of nodes; if absent, all nodes of a set of at most `TAKEN_WHOLE` nodes, and `CHOSEN` of a larger one.
    pub count: Option<usize>,
    /// Names by ascending z; `tip_1`, `tip_2`, ... if empty.
    pub names: Vec<String>,
}

/// Chooses contact nodes from a set, by ascending z (for equal z by angle), with slopes dr/dz of the contour of the
/// set.
///
/// # Examples
/// ```
/// # use tiprub_model::{Material, Mesh, element::ElementKind, mesh::Element};
/// # // Three cubes of 20 mm in a row along x, from a radius of 0.3 m; all nodes of ROOT are at the inner end.
/// # let at = |i: usize, j: usize, k: usize| 4 * i + 2 * j + k;
/// # let place = |n: usize| [0.3 + 0.02 * (n / 4) as f64, 0.02 * (n / 2 % 2) as f64 - 0.01, 0.02 * (n % 2) as f64];
/// # let cube = |i: usize| Element {
/// #     kind: ElementKind::Hex8,
/// #     nodes: [0, 1].into_iter().flat_map(|k| [at(i, 0, k), at(i + 1, 0, k), at(i + 1, 1, k), at(i, 1, k)]).collect(),
/// # };
/// # let mesh = Mesh {
/// #     nodes: (0..16).map(place).collect(),
/// #     elements: (0..3).map(cube).collect(),
/// #     sets: [("ROOT".to_owned(), (0..4).collect()), ("TIP".to_owned(), (12..16).collect())].into(),
/// # };
///
/// # use tiprub_model::read::{ContactChoice, choose_contact_nodes};
/// let choice = ContactChoice { count: None, names: vec!["front".into(), "rear".into()] };
/// let points = choose_contact_nodes(&mesh.nodes, mesh.set("TIP")?, &choice)?;
/// assert_eq!(points[0].name, "front");
/// # Ok::<(), tiprub_model::Error>(())
/// ```
///
/// # Errors
/// [`Error::Invalid`] for an empty set, more nodes than the set has, or another number of names than nodes.
pub fn choose_contact_nodes(nodes: &[[f64; 3]], set: &[usize], choice: &ContactChoice) -> Result<Vec<ContactPoint>> {
    let default = if set.len() <= TAKEN_WHOLE { set.len() } else { CHOSEN };
    let named = if choice.names.is_empty() { default } else { choice.names.len() };
    let count = choice.count.unwrap_or(named);
    if count == 0 || count > set.len() {
        let problem = format!("{count} requested from a set of {} nodes", set.len());
        return Err(Error::invalid("number of contact nodes", problem, "Give a number from 1 to the size of the set"));
    }
    if !choice.names.is_empty() && choice.names.len() != count {
        let problem = format!("{} names for {count} contact nodes", choice.names.len());
        return Err(Error::invalid(
            "names of contact nodes",
            problem,
            "Give one name per node, in order of increasing z",
        ));
    }
    let places = Places::new(nodes, set);
    let chosen = places.evenly(count);
    let name = |index: usize| choice.names.get(index).cloned().unwrap_or_else(|| format!("tip_{}", index + 1));
    let point = |(index, place): (usize, usize)| ContactPoint::at(name(index), set[place], places.slope(place));
    Ok(chosen.into_iter().enumerate().map(point).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the tip of a staggered blade, `through` nodes thick, on the contour r = 0.3 + 0.1 z - z².
    fn tip(along: usize, through: usize) -> Vec<[f64; 3]> {
        let mut nodes = Vec::new();
        for i in 0..along {
            for j in 0..through {
                let z = 0.04 * i as f64 / (along - 1) as f64;
                let radius = 0.3 + 0.1 * z - z * z;
                let across = if through > 1 { j as f64 / (through - 1) as f64 - 0.5 } else { 0.0 };
                // Around ±π, where angles jump.
                let angle = core::f64::consts::PI + (0.8 * z + 0.003 * across) / radius;
                nodes.push([radius * angle.cos(), radius * angle.sin(), z]);
            }
        }
        nodes
    }

    #[test]
    fn face_set_yields_mid_thickness_nodes_with_contour_slopes() {
        let nodes = tip(21, 3);
        let set: Vec<usize> = (0..nodes.len()).collect();
        let points = choose_contact_nodes(&nodes, &set, &ContactChoice::default()).unwrap();
        assert_eq!(points.iter().map(|point| point.node).collect::<Vec<_>>(), [1, 31, 61]);
        for point in &points {
            let expected = 0.1 - 2.0 * nodes[point.node][2];
            assert!((point.meridional_slope - expected).abs() < 1e-9, "{point:?}: {expected}");
        }
        assert_eq!(points[2].name, "tip_3");
    }

    #[test]
    fn small_set_is_used_entirely_and_sorted_by_z() {
        let nodes: Vec<[f64; 3]> = tip(3, 1).into_iter().rev().collect();
        let choice = ContactChoice { count: None, names: ["le", "mid", "te"].map(String::from).to_vec() };
        let points = choose_contact_nodes(&nodes, &[0, 1, 2], &choice).unwrap();
        assert_eq!(points.iter().map(|point| point.node).collect::<Vec<_>>(), [2, 1, 0]);
        assert!((points[1].meridional_slope - 0.06).abs() < 1e-9, "{points:?}");
        assert_eq!(points[0].name, "le");
    }

    #[test]
    fn rejects_invalid_counts_and_names() {
        let nodes = tip(3, 1);
        let refused = |count, names: &[&str]| {
            let names = names.iter().map(ToString::to_string).collect();
            choose_contact_nodes(&nodes, &[0, 1, 2], &ContactChoice { count, names }).unwrap_err().to_string()
        };
        assert!(refused(Some(4), &[]).contains("4 requested from a set of 3"));
        assert!(refused(Some(0), &[]).contains("0 requested from a set of 3"));
        assert!(refused(Some(2), &["a"]).contains("1 names for 2"));
    }
}

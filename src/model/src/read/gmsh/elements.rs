//! Element types of Gmsh, with their node order relative to that of Abaqus.

use crate::element::ElementKind;

/// Meaning of an element type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum GmshElement {
    /// A solid; node i of the kind is node `order[i]` of Gmsh.
    Solid(ElementKind, &'static [usize]),
    /// A point, line or face with this many nodes.
    LowerDimension(usize),
    /// Unsupported element: name and remedy.
    Refused(&'static str, &'static str),
}

const FIRST: [usize; 8] = [0, 1, 2, 3, 4, 5, 6, 7];
/// Gmsh numbers the edges of a tetrahedron differently from the fifth on: (0,3), (2,3), (1,3).
const TET10: [usize; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8];
/// Gmsh: edges (0,1) (0,3) (0,4) (1,2) (1,5) (2,3) (2,6) (3,7) (4,5) (4,7) (5,6) (6,7).
const HEX20: [usize; 20] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15];
/// Gmsh: edges (0,1) (0,2) (0,3) (1,2) (1,4) (2,5) (3,4) (3,5) (4,5).
const PENTA15: [usize; 15] = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11];

const INCOMPLETE: &str =
    "Mesh again with Mesh.SecondOrderIncomplete = 1: quadratic elements without face and interior nodes";
const LOWER_ORDER: &str = "Mesh again with Mesh.ElementOrder = 2 or 1";

/// Returns the meaning of an element type (Gmsh reference manual, MSH file format).
pub(super) fn gmsh_element(kind: i64) -> Option<GmshElement> {
    use GmshElement::{LowerDimension, Refused, Solid};
    Some(match kind {
        4 => Solid(ElementKind::Tet4, &FIRST[..4]),
        5 => Solid(ElementKind::Hex8, &FIRST),
        6 => Solid(ElementKind::Penta6, &FIRST[..6]),
        11 => Solid(ElementKind::Tet10, &TET10),
        17 => Solid(ElementKind::Hex20, &HEX20),
        18 => Solid(ElementKind::Penta15, &PENTA15),
        15 => LowerDimension(1),
        1 => LowerDimension(2),
        2 | 8 => LowerDimension(3),
        3 | 26 => LowerDimension(4),
        9 => LowerDimension(6),
        16 => LowerDimension(8),
        10 => LowerDimension(9),
        7 | 14 | 19 => {
            Refused("pyramids", "Use tetrahedra, prisms and bricks only: extrude the mesh, or do not recombine it")
        }
        12 => Refused("bricks with 27 nodes", INCOMPLETE),
        13 => Refused("prisms with 18 nodes", INCOMPLETE),
        20..=25 | 27..=83 | 90..=93 => Refused("elements of third or higher order", LOWER_ORDER),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TET_EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [3, 0], [2, 3], [1, 3]];
    const HEX_EDGES: [[usize; 2]; 12] =
        [[0, 1], [0, 3], [0, 4], [1, 2], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 7], [5, 6], [6, 7]];
    const PENTA_EDGES: [[usize; 2]; 9] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 4], [2, 5], [3, 4], [3, 5], [4, 5]];

    #[test]
    fn mid_side_nodes_stay_on_their_edges() {
        for (number, edges) in [(11, &TET_EDGES[..]), (17, &HEX_EDGES), (18, &PENTA_EDGES)] {
            let Some(GmshElement::Solid(kind, order)) = gmsh_element(number) else { panic!("{number} is a solid") };
            let corners = kind.corner_count();
            assert_eq!(order.len(), kind.node_count());
            assert!(order[..corners].iter().enumerate().all(|(i, &gmsh)| i == gmsh));
            for (edge, &gmsh) in kind.edges().iter().zip(&order[corners..]) {
                let (mut ours, mut theirs) = (*edge, edges[gmsh - corners]);
                ours.sort_unstable();
                theirs.sort_unstable();
                assert_eq!(ours, theirs, "{kind:?}");
            }
        }
    }
}

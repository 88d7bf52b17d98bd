//! Elimination orders that keep a sparse Cholesky factor small.
//!
//! Degrees of freedom with the same neighbours, such as the three of a node, are one vertex of a graph (compression,
//! as in C. Ashcraft, SIAM J. Sci. Comput. 16(6), 1995). Nested dissection (A. George, SIAM J. Numer. Anal. 10(2), 1973)
//! halves the graph by a small separator, which is eliminated last, and repeats this with the halves; the separators
//! are found on coarser and coarser graphs (G. Karypis, V. Kumar, SIAM J. Sci. Comput. 20(1), 1998). Small subgraphs
//! are ordered by approximate minimum degree. The result does not depend on time, addresses, threads or the random
//! numbers of a C library: the same pattern gives the same order on every machine.

mod graph;
mod separator;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

use crate::pattern::Pattern;
use graph::Graph;

/// Method that finds the elimination order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Ordering {
    /// Nested dissection if it is worthwhile, from a few thousand degrees of freedom.
    #[default]
    Automatic,
    /// Approximate minimum degree of faer.
    MinimumDegree,
    /// Nested dissection.
    NestedDissection,
}

/// Number of degrees of freedom from which nested dissection is worthwhile.
const LARGE: usize = 3000;
/// Number of vertices below which a subgraph is not dissected.
const LEAF: usize = 120;
/// Number of vertices above which a subgraph is dissected in parallel.
const PARALLEL: usize = 4000;

/// Returns the order of elimination, `order[new] = old`; `None` if the factorisation determines a minimum-degree
/// order.
pub(crate) fn elimination_order(pattern: &Pattern, ordering: Ordering) -> Option<Vec<usize>> {
    match ordering {
        Ordering::MinimumDegree => None,
        Ordering::Automatic if pattern.order() < LARGE => None,
        _ => Some(nested_dissection(pattern)),
    }
}

/// Computes the nested dissection of a symmetric pattern, `order[new] = old`.
pub fn nested_dissection(pattern: &Pattern) -> Vec<usize> {
    let (graph, members) = compressed(pattern);
    let order = postordered(&graph, dissected(&graph));
    order.into_iter().flat_map(|vertex| members[vertex].clone()).collect()
}

/// Returns the graph of the groups of successive rows with the same entries, weighted with their number, and the rows
/// of each group.
fn compressed(pattern: &Pattern) -> (Graph, Vec<core::ops::Range<usize>>) {
    let column = |j: usize| &pattern.rows[pattern.starts[j]..pattern.starts[j + 1]];
    let mut members: Vec<core::ops::Range<usize>> = Vec::new();
    let mut group = Vec::with_capacity(pattern.order());
    for row in 0..pattern.order() {
        match members.last_mut() {
            // Each row contains the other by symmetry, since both diagonals are present.
            Some(last) if column(row) == column(last.start) => last.end = row + 1,
            _ => members.push(row..row + 1),
        }
        group.push(members.len() - 1);
    }
    let mut graph = Graph::with_capacity(members.len(), pattern.rows.len() / 9);
    for (vertex, rows) in members.iter().enumerate() {
        let mut last = usize::MAX;
        for &row in column(rows.start) {
            // Rows ascend, and so do their groups.
            if group[row] != last && group[row] != vertex {
                graph.push_neighbour(group[row], 1);
            }
            last = group[row];
        }
        graph.finish_vertex(rows.len());
    }
    graph.weigh_edges();
    (graph, members)
}

fn dissected(graph: &Graph) -> Vec<usize> {
    if graph.order() < LEAF {
        return minimum_degree(graph);
    }
    let sides = separator::separator(graph);
    let [first, second, middle] =
        [0, 1, separator::SEPARATOR].map(|side| (0..graph.order()).filter(|&v| sides[v] == side).collect::<Vec<_>>());
    // The graph has no useful separator, such as a complete graph.
    if first.is_empty() || second.is_empty() {
        return minimum_degree(graph);
    }
    let half = |vertices: &[usize]| -> Vec<usize> {
        dissected(&graph.induced(vertices)).into_iter().map(|vertex| vertices[vertex]).collect()
    };
    let (mut order, rest) = if graph.order() > PARALLEL {
        rayon::join(|| half(&first), || half(&second))
    } else {
        (half(&first), half(&second))
    };
    order.extend(rest);
    order.extend(middle);
    order
}

/// Computes the approximate minimum degree order of a small graph.
fn minimum_degree(graph: &Graph) -> Vec<usize> {
    let order = graph.order();
    let pattern = SymbolicSparseColMatRef::new_checked(order, order, &graph.starts, None, &graph.neighbours);
    let (mut forward, mut inverse) = (vec![0_usize; order], vec![0_usize; order]);
    let mut memory = MemBuffer::new(amd::order_maybe_unsorted_scratch::<usize>(order, graph.neighbours.len()));
    let found = amd::order_maybe_unsorted(
        &mut forward,
        &mut inverse,
        pattern,
        amd::Control::default(),
        MemStack::new(&mut memory),
    );
    // It only fails for overflowing indices, which a graph in memory cannot have.
    if found.is_ok() { forward } else { (0..order).collect() }
}

/// Returns an equivalent elimination order in which each subtree of the elimination tree is contiguous, so that
/// columns of equal structure are adjacent. The fill does not change (J. W. H. Liu, SIAM J. Matrix Anal. Appl. 11(1),
/// 1990).
fn postordered(graph: &Graph, order: Vec<usize>) -> Vec<usize> {
    let size = order.len();
    let parent = elimination_tree(graph, &order);
    // Children of each vertex, ascending, as linked lists; the lists of the roots start at `size`.
    let (mut first, mut next) = (vec![usize::MAX; size + 1], vec![usize::MAX; size]);
    for vertex in (0..size).rev() {
        let above = if parent[vertex] == usize::MAX { size } else { parent[vertex] };
        next[vertex] = first[above];
        first[above] = vertex;
    }
    let mut result = Vec::with_capacity(size);
    let mut stack = vec![size];
    while let Some(&top) = stack.last() {
        let child = first[top];
        if child == usize::MAX {
            stack.pop();
            if top < size {
                result.push(order[top]);
            }
        } else {
            first[top] = next[child];
            stack.push(child);
        }
    }
    result
}

/// Returns the parent of every vertex, both counted in elimination order; `usize::MAX` for roots.
fn elimination_tree(graph: &Graph, order: &[usize]) -> Vec<usize> {
    let mut position = vec![0; order.len()];
    for (new, &old) in order.iter().enumerate() {
        position[old] = new;
    }
    let (mut parent, mut ancestor) = (vec![usize::MAX; order.len()], vec![usize::MAX; order.len()]);
    for (new, &old) in order.iter().enumerate() {
        for &neighbour in graph.neighbours_of(old) {
            let mut vertex = position[neighbour];
            // Up to the root of the connected part, shortening the path on the way.
            while vertex < new {
                let above = core::mem::replace(&mut ancestor[vertex], new);
                if above == usize::MAX {
                    parent[vertex] = new;
                    break;
                }
                vertex = above;
            }
        }
    }
    parent
}

//! Weighted graphs, their subgraphs and their coarsened versions.

use rayon::prelude::*;

/// Undirected graph: neighbours of each vertex (without itself), weights of vertices and edges.
#[derive(Debug, Clone)]
pub(super) struct Graph {
    /// Start of each vertex's neighbours, and the end of the last one's.
    pub(super) starts: Vec<usize>,
    pub(super) neighbours: Vec<usize>,
    /// Weight of the edge to each neighbour.
    edge_weights: Vec<usize>,
    /// Number of degrees of freedom per vertex.
    pub(super) weights: Vec<usize>,
}

impl Graph {
    pub(super) fn with_capacity(vertices: usize, edges: usize) -> Self {
        let mut starts = Vec::with_capacity(vertices + 1);
        starts.push(0);
        Self {
            starts,
            neighbours: Vec::with_capacity(edges),
            edge_weights: Vec::with_capacity(edges),
            weights: Vec::with_capacity(vertices),
        }
    }

    /// Adds a neighbour of the vertex that [`Self::finish_vertex`] ends.
    pub(super) fn push_neighbour(&mut self, neighbour: usize, edge_weight: usize) {
        self.neighbours.push(neighbour);
        self.edge_weights.push(edge_weight);
    }

    pub(super) fn finish_vertex(&mut self, weight: usize) {
        self.starts.push(self.neighbours.len());
        self.weights.push(weight);
    }

    pub(super) fn order(&self) -> usize {
        self.weights.len()
    }

    pub(super) fn neighbours_of(&self, vertex: usize) -> &[usize] {
        &self.neighbours[self.starts[vertex]..self.starts[vertex + 1]]
    }

    fn edges_of(&self, vertex: usize) -> impl Iterator<Item = (usize, usize)> {
        let range = self.starts[vertex]..self.starts[vertex + 1];
        self.neighbours[range.clone()].iter().copied().zip(self.edge_weights[range].iter().copied())
    }

    pub(super) fn total_weight(&self) -> usize {
        self.weights.iter().sum()
    }

    /// Weights every edge by the number of common neighbours of its ends, so that matching pairs close vertices.
    pub(super) fn weigh_edges(&mut self) {
        let graph = &*self;
        let weights = (0..graph.order()).into_par_iter().flat_map_iter(|vertex| {
            let own = graph.neighbours_of(vertex);
            own.iter().map(move |&neighbour| 1 + common(own, graph.neighbours_of(neighbour)))
        });
        self.edge_weights = weights.collect();
    }

    /// Returns the subgraph of some vertices, numbered in the given order.
    pub(super) fn induced(&self, vertices: &[usize]) -> Self {
        let mut position = vec![usize::MAX; self.order()];
        for (new, &old) in vertices.iter().enumerate() {
            position[old] = new;
        }
        let edges = vertices.iter().map(|&v| self.neighbours_of(v).len()).sum();
        let mut part = Self::with_capacity(vertices.len(), edges);
        for &vertex in vertices {
            for (neighbour, weight) in self.edges_of(vertex) {
                if position[neighbour] != usize::MAX {
                    part.push_neighbour(position[neighbour], weight);
                }
            }
            part.finish_vertex(self.weights[vertex]);
        }
        part
    }

    /// Merges pairs of vertices that are connected by a heavy edge, and returns the new vertex of each vertex.
    ///
    /// No vertex becomes heavier than `heaviest`.
    pub(super) fn coarser(&self, heaviest: usize, salt: usize) -> (Self, Vec<usize>) {
        let pairs = self.heavy_edge_matching(heaviest, salt);
        let mut coarse_of = vec![usize::MAX; self.order()];
        let mut leaders = Vec::with_capacity(self.order() / 2);
        for vertex in 0..self.order() {
            if coarse_of[vertex] == usize::MAX {
                coarse_of[vertex] = leaders.len();
                coarse_of[pairs[vertex]] = leaders.len();
                leaders.push(vertex);
            }
        }
        let mut coarse = Self::with_capacity(leaders.len(), self.neighbours.len() / 2);
        // Position of a neighbour of the current vertex in the list.
        let mut place = vec![usize::MAX; leaders.len()];
        for (number, &leader) in leaders.iter().enumerate() {
            let start = coarse.neighbours.len();
            let partner = pairs[leader];
            let members = [leader, partner];
            let members = if partner == leader { &members[..1] } else { &members };
            for (neighbour, weight) in members.iter().flat_map(|&v| self.edges_of(v)) {
                let target = coarse_of[neighbour];
                if target == number {
                    continue;
                }
                let at = place[target];
                if at != usize::MAX && at >= start {
                    coarse.edge_weights[at] += weight;
                } else {
                    place[target] = coarse.neighbours.len();
                    coarse.push_neighbour(target, weight);
                }
            }
            coarse.finish_vertex(members.iter().map(|&v| self.weights[v]).sum());
        }
        (coarse, coarse_of)
    }

    /// Returns the partner of every vertex, or the vertex itself without a partner.
    fn heavy_edge_matching(&self, heaviest: usize, salt: usize) -> Vec<usize> {
        let mut pairs = vec![usize::MAX; self.order()];
        for vertex in scrambled(self.order(), salt) {
            if pairs[vertex] != usize::MAX {
                continue;
            }
            let room = heaviest.saturating_sub(self.weights[vertex]);
            let best = self
                .edges_of(vertex)
                .filter(|&(u, _)| pairs[u] == usize::MAX && self.weights[u] <= room)
                .max_by_key(|&(u, weight)| {
                    (weight, core::cmp::Reverse(self.weights[u]), core::cmp::Reverse(scramble(salt + u)))
                });
            let partner = best.map_or(vertex, |(u, _)| u);
            pairs[vertex] = partner;
            pairs[partner] = vertex;
        }
        pairs
    }
}

/// Returns the number of common entries of two ascending lists.
fn common(first: &[usize], second: &[usize]) -> usize {
    let (mut i, mut k, mut count) = (0, 0, 0);
    while i < first.len() && k < second.len() {
        let (a, b) = (first[i], second[k]);
        count += usize::from(a == b);
        i += usize::from(a <= b);
        k += usize::from(b <= a);
    }
    count
}

/// Returns a fixed pseudo-random number (splitmix64).
pub(super) fn scramble(number: usize) -> u64 {
    let mut bits = (number as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// Returns the numbers below `count` in pseudo-random order.
fn scrambled(count: usize, salt: usize) -> Vec<usize> {
    let mut numbers: Vec<usize> = (0..count).collect();
    numbers.sort_unstable_by_key(|&number| (scramble(salt + number), number));
    numbers
}

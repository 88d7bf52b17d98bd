//! Small vertex separators that divide a graph into two parts of about equal weight.
//!
//! Multilevel method: the graph is coarsened by heavy-edge matching, the coarsest one is halved by growing regions
//! from several seeds, and during uncoarsening the separator is refined at every level by moving its vertices to one
//! side, which adds their neighbours on the other side to it (C. M. Fiduccia, R. M. Mattheyses, DAC 1982, for vertex
//! separators).

use core::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use super::graph::{Graph, scramble};

/// Mark of the vertices of the separator; those of the parts are 0 and 1.
pub(super) const SEPARATOR: usize = 2;

/// Number of vertices at which coarsening ends.
const COARSEST: usize = 40;
/// Coarsening also ends if a step keeps more than this fraction of the vertices.
const STALLED: f64 = 0.95;
/// Number of attempts at the coarser half of the levels.
const ATTEMPTS: usize = 3;
/// Ratio of the vertices of the graph to those at which the attempts begin.
const SHRINKAGE: usize = 30;
/// Number of seeds on the coarsest graph.
const SEEDS: usize = 12;
/// Refinement passes per level.
const PASSES: usize = 8;
/// Number of moves without a better separator after which a pass ends.
const PATIENCE: usize = 200;

/// Returns the side (0, 1 or [`SEPARATOR`]) of every vertex.
pub(super) fn separator(graph: &Graph) -> Vec<usize> {
    let heaviest = (3 * graph.total_weight()).div_ceil(2 * COARSEST);
    // The first coarse graphs have little influence, so that attempts may begin at a smaller one.
    let levels = coarsened(graph, graph.order().div_ceil(SHRINKAGE).max(COARSEST), heaviest, 0);
    let middle = levels.last().map_or(graph, |(coarse, _)| coarse);
    let attempts = (0..ATTEMPTS).map(|attempt| {
        let levels = coarsened(middle, COARSEST, heaviest, attempt);
        let coarsest = levels.last().map_or(middle, |(coarse, _)| coarse);
        refined(middle, &levels, initial(coarsest, attempt))
    });
    let best = attempts.min_by_key(|sides| Partition::new(middle, sides.clone()).cost()).unwrap_or_default();
    refined(graph, &levels, best)
}

/// Coarsens the graph repeatedly to about `target` vertices; each level has the map from the vertices of the finer
/// one.
fn coarsened(graph: &Graph, target: usize, heaviest: usize, salt: usize) -> Vec<(Graph, Vec<usize>)> {
    let mut levels: Vec<(Graph, Vec<usize>)> = Vec::new();
    loop {
        let finest = levels.last().map_or(graph, |(coarse, _)| coarse);
        if finest.order() <= target {
            return levels;
        }
        let (coarse, map) = finest.coarser(heaviest, salt);
        if coarse.order() as f64 > STALLED * finest.order() as f64 {
            return levels;
        }
        levels.push((coarse, map));
    }
}

/// Projects the sides of the coarsest graph to the finest, with refinement at every level.
fn refined(graph: &Graph, levels: &[(Graph, Vec<usize>)], mut sides: Vec<usize>) -> Vec<usize> {
    for (level, (_, map)) in levels.iter().enumerate().rev() {
        let finer = if level == 0 { graph } else { &levels[level - 1].0 };
        let projected = map.iter().map(|&coarse| sides[coarse]).collect();
        let mut partition = Partition::new(finer, projected);
        partition.refine();
        sides = partition.sides;
    }
    sides
}

/// Returns the best of several regions grown to half of the weight.
fn initial(graph: &Graph, salt: usize) -> Vec<usize> {
    let attempts = (0..SEEDS).map(|attempt| {
        #[expect(clippy::cast_possible_truncation, reason = "a remainder below the number of vertices")]
        let random = (scramble(salt * SEEDS + attempt) % graph.order() as u64) as usize;
        // Every other seed is as far out as two searches reach.
        let seed = if attempt % 2 == 0 { farthest(graph, farthest(graph, random)) } else { random };
        let mut partition = Partition::new(graph, grown(graph, seed));
        partition.refine();
        (partition.cost(), partition.sides)
    });
    attempts.min_by_key(|(cost, _)| *cost).map_or_else(Vec::new, |(_, sides)| sides)
}

/// Returns the vertices in breadth-first order, those unconnected with the seed last.
fn breadth_first(graph: &Graph, seed: usize) -> Vec<usize> {
    let mut seen = vec![false; graph.order()];
    let mut order = Vec::with_capacity(graph.order());
    let mut queue = VecDeque::new();
    for start in core::iter::once(seed).chain(0..graph.order()) {
        if !core::mem::replace(&mut seen[start], true) {
            queue.push_back(start);
        }
        while let Some(vertex) = queue.pop_front() {
            order.push(vertex);
            for &neighbour in graph.neighbours_of(vertex) {
                if !core::mem::replace(&mut seen[neighbour], true) {
                    queue.push_back(neighbour);
                }
            }
        }
    }
    order
}

fn farthest(graph: &Graph, seed: usize) -> usize {
    breadth_first(graph, seed).last().copied().unwrap_or(seed)
}

/// Puts half of the weight around the seed on side 0, its border into the separator, the rest on side 1.
fn grown(graph: &Graph, seed: usize) -> Vec<usize> {
    let mut sides = vec![1; graph.order()];
    let (half, mut weight) = (graph.total_weight() / 2, 0);
    for vertex in breadth_first(graph, seed) {
        if weight >= half {
            break;
        }
        sides[vertex] = 0;
        weight += graph.weights[vertex];
    }
    let border: Vec<usize> = (0..graph.order())
        .filter(|&v| sides[v] == 1 && graph.neighbours_of(v).iter().any(|&u| sides[u] == 0))
        .collect();
    for vertex in border {
        sides[vertex] = SEPARATOR;
    }
    sides
}

/// Two parts and the separator between them.
struct Partition<'a> {
    graph: &'a Graph,
    sides: Vec<usize>,
    /// Weights of the parts and of the separator.
    weights: [usize; 3],
    /// Largest allowed weight of a part.
    heaviest: usize,
}

/// A move: the vertex, and the number of neighbours that it added to the separator.
struct Move {
    vertex: usize,
    drawn: usize,
}

type Queue = BinaryHeap<(isize, Reverse<usize>)>;

impl<'a> Partition<'a> {
    fn new(graph: &'a Graph, sides: Vec<usize>) -> Self {
        let mut weights = [0; 3];
        for (side, weight) in sides.iter().zip(&graph.weights) {
            weights[*side] += weight;
        }
        let heaviest = graph.total_weight() * 3 / 5;
        Self { graph, sides, weights, heaviest }
    }

    /// Returns the cost to minimise: overweight, then the separator, which costs more the more the parts differ.
    fn cost(&self) -> (usize, u128) {
        let [first, second, middle] = self.weights;
        let overweight = first.max(second).saturating_sub(self.heaviest);
        // middle · ((first + second) / 2)² / (first · second), with a few decimals.
        let [first, second, middle] = [first, second, middle].map(|weight| weight as u128);
        (overweight, 256 * middle * (first + second).pow(2) / (first * second).max(1))
    }

    /// Alternates passes to either side. A pass that could move vertices both ways would keep a separator in place: a
    /// plane of vertices only crosses a plateau as a whole.
    fn refine(&mut self) {
        for _ in 0..PASSES {
            let before = self.cost();
            self.pass(0);
            self.pass(1);
            if self.cost() >= before {
                break;
            }
        }
    }

    /// Moves separator vertices to one side, best gain first, each at most once, and returns to the best state found.
    fn pass(&mut self, side: usize) {
        let mut locked = vec![false; self.sides.len()];
        // Decrease of the separator size if a vertex moves to that side.
        let mut gains = vec![0; self.sides.len()];
        let mut queue = Queue::new();
        for vertex in 0..self.sides.len() {
            if self.sides[vertex] == SEPARATOR {
                self.enter(vertex, side, &mut gains, &mut queue);
            }
        }
        let (mut moves, mut drawn) = (Vec::<Move>::new(), Vec::new());
        let (mut best, mut best_length) = (self.cost(), 0);
        while let Some(vertex) = self.next(&mut queue, side, &gains, &locked) {
            locked[vertex] = true;
            let first = drawn.len();
            self.shift(vertex, side);
            for &neighbour in self.graph.neighbours_of(vertex) {
                if self.sides[neighbour] == 1 - side {
                    self.shift(neighbour, SEPARATOR);
                    drawn.push(neighbour);
                }
            }
            for &entered in &drawn[first..] {
                for &near in self.graph.neighbours_of(entered) {
                    if self.sides[near] == SEPARATOR {
                        gains[near] += signed(self.graph.weights[entered]);
                        queue.push((gains[near], Reverse(near)));
                    }
                }
            }
            for &entered in &drawn[first..] {
                self.enter(entered, side, &mut gains, &mut queue);
            }
            moves.push(Move { vertex, drawn: drawn.len() - first });
            let cost = self.cost();
            if cost < best {
                (best, best_length) = (cost, moves.len());
            } else if moves.len() > best_length + PATIENCE {
                break;
            }
        }
        for undone in moves.drain(best_length..).rev() {
            let kept = drawn.len() - undone.drawn;
            for neighbour in drawn.drain(kept..) {
                self.shift(neighbour, 1 - side);
            }
            self.shift(undone.vertex, SEPARATOR);
        }
    }

    /// Adds the gain of a vertex of the separator to the queue.
    fn enter(&self, vertex: usize, side: usize, gains: &mut [isize], queue: &mut Queue) {
        let far = self.graph.neighbours_of(vertex).iter().filter(|&&near| self.sides[near] == 1 - side);
        let drawn: usize = far.map(|&near| self.graph.weights[near]).sum();
        gains[vertex] = signed(self.graph.weights[vertex]) - signed(drawn);
        queue.push((gains[vertex], Reverse(vertex)));
    }

    /// Returns the best move that keeps or improves the balance; outdated entries of the queue are dropped.
    fn next(&self, queue: &mut Queue, side: usize, gains: &[isize], locked: &[bool]) -> Option<usize> {
        while let Some((gain, Reverse(vertex))) = queue.pop() {
            let after = self.weights[side] + self.graph.weights[vertex];
            let balanced = after <= self.heaviest || after <= self.weights[1 - side];
            let current = !locked[vertex] && self.sides[vertex] == SEPARATOR && gains[vertex] == gain;
            if current && balanced {
                return Some(vertex);
            }
        }
        None
    }

    fn shift(&mut self, vertex: usize, side: usize) {
        let weight = self.graph.weights[vertex];
        self.weights[self.sides[vertex]] -= weight;
        self.weights[side] += weight;
        self.sides[vertex] = side;
    }
}

#[expect(clippy::cast_possible_wrap, reason = "weights count degrees of freedom in memory")]
fn signed(weight: usize) -> isize {
    weight as isize
}

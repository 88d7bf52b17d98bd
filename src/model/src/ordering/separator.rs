//! A small set of vertices without which a graph falls into two parts of about the same weight.
//!
//! Multilevel: the graph is coarsened by heavy-edge matching, the coarsest one is halved by growing regions from several
//! seeds, and on the way back the separator is refined at every level by moving its vertices to one side, which draws
//! their neighbours of the other side into it (C. M. Fiduccia, R. M. Mattheyses, DAC 1982, for vertex separators).

use core::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};

use super::graph::{Graph, scramble};

/// Mark of the separator's vertices; those of the parts are 0 and 1.
pub(super) const SEPARATOR: usize = 2;

/// Coarsening ends here,
const COARSEST: usize = 40;
/// or when a step leaves more than this share of the vertices.
const STALLED: f64 = 0.95;
/// Attempts at the coarser half of the levels,
const ATTEMPTS: usize = 3;
/// which is where this many vertices of the graph have become one.
const SHRINKAGE: usize = 30;
/// Seeds tried on the coarsest graph.
const SEEDS: usize = 12;
/// Refinement passes per level.
const PASSES: usize = 8;
/// A pass ends after this many moves without a better separator.
const PATIENCE: usize = 200;

/// Side (0, 1 or [`SEPARATOR`]) of every vertex.
pub(super) fn separator(graph: &Graph) -> Vec<usize> {
    let heaviest = (3 * graph.total_weight()).div_ceil(2 * COARSEST);
    // What the first coarse graphs look like matters little, so that attempts may begin at a smaller one.
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

/// Coarser and coarser graphs down to about `target` vertices, each with the vertices that those of the finer one go into.
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

/// The sides of the coarsest graph brought to the finest, better at every level.
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

/// Best of several regions grown to half of the weight.
fn initial(graph: &Graph, salt: usize) -> Vec<usize> {
    let attempts = (0..SEEDS).map(|attempt| {
        #[expect(clippy::cast_possible_truncation, reason = "a remainder below the number of vertices")]
        let random = (scramble(salt * SEEDS + attempt) % graph.order() as u64) as usize;
        // Every other one from as far out as two searches get.
        let seed = if attempt % 2 == 0 { farthest(graph, farthest(graph, random)) } else { random };
        let mut partition = Partition::new(graph, grown(graph, seed));
        partition.refine();
        (partition.cost(), partition.sides)
    });
    attempts.min_by_key(|(cost, _)| *cost).map_or_else(Vec::new, |(_, sides)| sides)
}

/// Vertices in breadth-first order, what is not connected to the seed after what is.
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

/// Half of the weight around the seed on side 0, its border as separator, the rest on side 1.
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
    /// A part is not to become heavier.
    heaviest: usize,
}

/// One move: the vertex, and how many neighbours it drew into the separator.
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
        // middle · ((first + second) / 2)² / (first · second), with a few digits behind the point.
        let [first, second, middle] = [first, second, middle].map(|weight| weight as u128);
        (overweight, 256 * middle * (first + second).pow(2) / (first * second).max(1))
    }

    /// Passes to either side in turn. One that could go both ways would hold a separator where it is: only as a whole
    /// does a plane of vertices move over a plateau.
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

    /// Move separator vertices to one side, best gain first, each at most once, and go back to the best state met.
    fn pass(&mut self, side: usize) {
        let mut locked = vec![false; self.sides.len()];
        // By how much the separator shrinks when a vertex of it goes to that side.
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

    /// The gain of a vertex of the separator, and its place in the queue.
    fn enter(&self, vertex: usize, side: usize, gains: &mut [isize], queue: &mut Queue) {
        let far = self.graph.neighbours_of(vertex).iter().filter(|&&near| self.sides[near] == 1 - side);
        let drawn: usize = far.map(|&near| self.graph.weights[near]).sum();
        gains[vertex] = signed(self.graph.weights[vertex]) - signed(drawn);
        queue.push((gains[vertex], Reverse(vertex)));
    }

    /// The best move that keeps the balance, or betters it; what stands in the queue out of date is dropped.
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

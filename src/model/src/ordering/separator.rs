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
const COARSEST: usize = 100;
/// or when a step leaves more than this share of the vertices.
const STALLED: f64 = 0.95;
/// Seeds tried on the coarsest graph.
const SEEDS: usize = 12;
/// Refinement passes per level.
const PASSES: usize = 8;
/// A pass ends after this many moves without a better separator.
const PATIENCE: usize = 200;

/// Side (0, 1 or [`SEPARATOR`]) of every vertex.
pub(super) fn separator(graph: &Graph) -> Vec<usize> {
    let heaviest = (3 * graph.total_weight()).div_ceil(2 * COARSEST);
    let mut levels: Vec<(Graph, Vec<usize>)> = Vec::new();
    loop {
        let finest = levels.last().map_or(graph, |(coarse, _)| coarse);
        if finest.order() <= COARSEST {
            break;
        }
        let (coarse, map) = finest.coarser(heaviest);
        if coarse.order() as f64 > STALLED * finest.order() as f64 {
            break;
        }
        levels.push((coarse, map));
    }
    let coarsest = levels.last().map_or(graph, |(coarse, _)| coarse);
    let mut sides = initial(coarsest);
    while let Some((_, map)) = levels.pop() {
        let finer = levels.last().map_or(graph, |(coarse, _)| coarse);
        let projected = map.iter().map(|&coarse| sides[coarse]).collect();
        let mut partition = Partition::new(finer, projected);
        partition.refine();
        sides = partition.sides;
    }
    sides
}

/// Best of several regions grown to half of the weight.
fn initial(graph: &Graph) -> Vec<usize> {
    let attempts = (0..SEEDS).map(|attempt| {
        #[expect(clippy::cast_possible_truncation, reason = "a remainder below the number of vertices")]
        let random = (scramble(attempt) % graph.order() as u64) as usize;
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

/// One move: the vertex, the side it went to, and how many neighbours it drew into the separator.
struct Move {
    vertex: usize,
    side: usize,
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

    /// What is to be small: overweight, then the separator, dearer the more the parts differ.
    fn cost(&self) -> (usize, u128) {
        let [first, second, middle] = self.weights;
        let overweight = first.max(second).saturating_sub(self.heaviest);
        // middle · ((first + second) / 2)² / (first · second), with a few digits behind the point.
        let [first, second, middle] = [first, second, middle].map(|weight| weight as u128);
        (overweight, 256 * middle * (first + second).pow(2) / (first * second).max(1))
    }

    fn refine(&mut self) {
        for _ in 0..PASSES {
            let before = self.cost();
            self.pass();
            if self.cost() >= before {
                break;
            }
        }
    }

    /// Move separator vertices, best gain first, each at most once, and go back to the best state met.
    fn pass(&mut self) {
        let mut locked = vec![false; self.sides.len()];
        // By how much the separator shrinks when a vertex of it goes to either side.
        let mut gains = vec![[0_isize; 2]; self.sides.len()];
        let mut queues = [Queue::new(), Queue::new()];
        for vertex in 0..self.sides.len() {
            if self.sides[vertex] == SEPARATOR {
                self.enter(vertex, &mut gains, &mut queues);
            }
        }
        let (mut moves, mut drawn) = (Vec::<Move>::new(), Vec::new());
        let (mut best, mut best_length) = (self.cost(), 0);
        while let Some((vertex, side)) = self.next(&mut queues, &gains, &locked) {
            locked[vertex] = true;
            let first = drawn.len();
            self.shift(vertex, side);
            for &neighbour in self.graph.neighbours_of(vertex) {
                match self.sides[neighbour] {
                    SEPARATOR => {
                        gains[neighbour][1 - side] -= signed(self.graph.weights[vertex]);
                        queues[1 - side].push((gains[neighbour][1 - side], Reverse(neighbour)));
                    }
                    other if other != side => {
                        self.shift(neighbour, SEPARATOR);
                        drawn.push(neighbour);
                    }
                    _ => {}
                }
            }
            for &entered in &drawn[first..] {
                for &near in self.graph.neighbours_of(entered) {
                    if self.sides[near] == SEPARATOR {
                        gains[near][side] += signed(self.graph.weights[entered]);
                        queues[side].push((gains[near][side], Reverse(near)));
                    }
                }
            }
            for &entered in &drawn[first..] {
                self.enter(entered, &mut gains, &mut queues);
            }
            moves.push(Move { vertex, side, drawn: drawn.len() - first });
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
                self.shift(neighbour, 1 - undone.side);
            }
            self.shift(undone.vertex, SEPARATOR);
        }
    }

    /// The gains of a vertex of the separator, and its places in the queues.
    fn enter(&self, vertex: usize, gains: &mut [[isize; 2]], queues: &mut [Queue; 2]) {
        let mut near = [0; 3];
        for &neighbour in self.graph.neighbours_of(vertex) {
            near[self.sides[neighbour]] += self.graph.weights[neighbour];
        }
        let own = self.graph.weights[vertex];
        gains[vertex] = [signed(own) - signed(near[1]), signed(own) - signed(near[0])];
        for side in 0..2 {
            queues[side].push((gains[vertex][side], Reverse(vertex)));
        }
    }

    /// The best move that keeps the balance, or betters it; what stands in the queues out of date is dropped.
    fn next(&self, queues: &mut [Queue; 2], gains: &[[isize; 2]], locked: &[bool]) -> Option<(usize, usize)> {
        let mut best: Option<(isize, usize, usize)> = None;
        for side in 0..2 {
            while let Some(&(gain, Reverse(vertex))) = queues[side].peek() {
                if !locked[vertex] && self.sides[vertex] == SEPARATOR && gains[vertex][side] == gain {
                    break;
                }
                queues[side].pop();
            }
            let Some(&(gain, Reverse(vertex))) = queues[side].peek() else { continue };
            let after = self.weights[side] + self.graph.weights[vertex];
            if after > self.heaviest && after > self.weights[1 - side] {
                continue;
            }
            let better = best
                .is_none_or(|(other, _, at)| gain > other || (gain == other && self.weights[side] < self.weights[at]));
            if better {
                best = Some((gain, vertex, side));
            }
        }
        best.map(|(_, vertex, side)| (vertex, side))
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

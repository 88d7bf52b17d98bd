//! Elimination orders: permutations, reproducibility, and small factors.

use faer::Mat;
use tiprub_model::assembly::assemble;
use tiprub_model::element::ElementKind;
use tiprub_model::mesh::Element;
use tiprub_model::ordering::{Ordering, nested_dissection};
use tiprub_model::progress::silent;
use tiprub_model::sparse::{Pattern, SparseMatrix, SymbolicFactor};
use tiprub_model::{Material, Mesh};

/// Returns K + M of a block of bricks with unit edges, positive definite without supports.
fn block([nx, ny, nz]: [usize; 3]) -> SparseMatrix {
    let node = |i: usize, j: usize, k: usize| (k * (ny + 1) + j) * (nx + 1) + i;
    let mut mesh = Mesh::default();
    for k in 0..=nz {
        for j in 0..=ny {
            mesh.nodes.extend((0..=nx).map(|i| [i as f64, j as f64, k as f64]));
        }
    }
    for (k, j, i) in (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (k, j, i)))) {
        let ring = |k| [node(i, j, k), node(i + 1, j, k), node(i + 1, j + 1, k), node(i, j + 1, k)];
        mesh.elements.push(Element { kind: ElementKind::Hex8, nodes: [ring(k), ring(k + 1)].concat() });
    }
    let material = Material { young_modulus: 1.0, density: 1.0, ..Material::steel() };
    let assembled = assemble(&mesh, &material, &silent).unwrap();
    assembled.stiffness.plus_scaled(1e-3, &assembled.mass)
}

fn entries(pattern: &Pattern, ordering: Ordering) -> usize {
    SymbolicFactor::new(pattern, ordering).unwrap().entries()
}

#[test]
fn nested_dissection_beats_minimum_degree_on_a_block() {
    let matrix = block([19, 19, 19]);
    let [dissected, minimum] =
        [Ordering::NestedDissection, Ordering::MinimumDegree].map(|ordering| entries(&matrix.pattern, ordering));
    println!("entries of the factor: {dissected} dissected, {minimum} by minimum degree");
    assert!((dissected as f64) < 0.75 * minimum as f64, "{dissected} against {minimum}");
    // A matrix of this size is dissected automatically.
    assert_eq!(entries(&matrix.pattern, Ordering::Automatic), dissected);
}

#[test]
fn every_ordering_gives_the_same_solution() {
    let matrix = block([12, 10, 9]);
    let right = Mat::from_fn(matrix.order(), 19, |i, j| ((i * 7 + j * 13) % 11) as f64 - 5.0);
    let solutions = [Ordering::NestedDissection, Ordering::MinimumDegree].map(|ordering| {
        let symbolic = SymbolicFactor::new(&matrix.pattern, ordering).unwrap();
        matrix.factor_with(&symbolic).unwrap().solve(right.clone())
    });
    for solution in &solutions {
        let residual = (matrix.times(solution.as_ref()) - &right).norm_max();
        assert!(residual < 1e-8, "{residual}");
    }
    let difference = (&solutions[0] - &solutions[1]).norm_max() / solutions[0].norm_max();
    assert!(difference < 1e-10, "{difference}");
}

#[test]
fn ordering_is_a_permutation_for_every_graph() {
    // A block; two unconnected blocks; a diagonal; a star; a complete graph.
    let arrow = |size: usize, rows: &dyn Fn(usize) -> Vec<usize>| {
        let lists: Vec<Vec<usize>> = (0..size).map(rows).collect();
        let starts = core::iter::once(0).chain(lists.iter().scan(0, |end, list| {
            *end += list.len();
            Some(*end)
        }));
        Pattern { starts: starts.collect(), rows: lists.concat() }
    };
    let single = block([11, 7, 5]).pattern;
    let half = single.order();
    let double = arrow(2 * half, &|row| {
        let (base, row) = (row / half * half, row % half);
        single.rows[single.starts[row]..single.starts[row + 1]].iter().map(|other| base + other).collect()
    });
    let diagonal = arrow(500, &|row| vec![row]);
    let star = arrow(500, &|row| {
        if row == 7 {
            (0..500).collect()
        } else if row < 7 {
            vec![row, 7]
        } else {
            vec![7, row]
        }
    });
    let complete = arrow(300, &|_| (0..300).collect());
    let chain = arrow(1000, &|row| (row.saturating_sub(1)..(row + 2).min(1000)).collect());
    for (name, pattern) in [
        ("block", &*single),
        ("two blocks", &double),
        ("diagonal", &diagonal),
        ("star", &star),
        ("complete", &complete),
        ("chain", &chain),
        ("nothing", &Pattern { starts: vec![0], rows: Vec::new() }),
    ] {
        let mut order = nested_dissection(pattern);
        order.sort_unstable();
        assert!(order.iter().copied().eq(0..pattern.order()), "{name}");
    }
    // A star has no fill if its centre comes last.
    let fill = entries(&star, Ordering::NestedDissection);
    assert!(fill < 2 * 500, "{fill}");
}

#[test]
fn ordering_and_factor_are_independent_of_thread_count() {
    let matrix = block([20, 16, 14]);
    let right = Mat::from_fn(matrix.order(), 21, |i, j| ((i * 7 + j * 13) % 11) as f64 - 5.0);
    let solve = || {
        let symbolic = SymbolicFactor::new(&matrix.pattern, Ordering::NestedDissection).unwrap();
        let solution = matrix.factor_with(&symbolic).unwrap().solve(right.clone());
        (nested_dissection(&matrix.pattern), solution)
    };
    let runs = [1, 2, 3, 8]
        .map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(solve));
    for run in &runs[1..] {
        assert_eq!(run.0, runs[0].0);
        assert!(run.1 == runs[0].1, "the solutions differ in their bits");
    }
}

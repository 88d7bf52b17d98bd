//! Time and size of sparse Cholesky factors with either ordering, on stiffness matrices of bricks.
//!
//!     cargo run --release -p tiprub-model --example factorisation -- around through along hex8|hex20 [matrix.mtx]
//!
//! A casing ring with so many elements is assembled; with a file name its stiffness is also written as Matrix Market
//! text, for other solvers (`tools/factorisation.py`).

use std::io::{BufWriter, Write as _};
use std::time::Instant;

use tiprub_model::assembly::{assemble, free_dofs};
use tiprub_model::casing::{CLAMPED, RingCounts, supported_ring};
use tiprub_model::element::ElementKind;
use tiprub_model::ordering::Ordering;
use tiprub_model::sparse::{SparseMatrix, SymbolicFactor, principal_pair};
use tiprub_model::{CasingOptions, Error, progress::silent};

fn main() -> tiprub_model::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let count = |index: usize| {
        let text = arguments.get(index).map_or("", String::as_str);
        text.parse::<usize>().map_err(|_| Error::invalid("element count", text, "Give whole numbers"))
    };
    let [around, through, along] = [count(1)?, count(2)?, count(3)?];
    let kind = if arguments.get(4).is_some_and(|kind| kind == "hex8") { ElementKind::Hex8 } else { ElementKind::Hex20 };
    let mut options = CasingOptions { kind, ..CasingOptions::default() };
    options.counts = RingCounts { around, through, along, flange: through };
    options.rings.around = around;
    let ring = supported_ring(&options)?;
    let assembled = assemble(&ring.mesh, &options.material, &silent)?;
    let free = free_dofs(ring.mesh.nodes.len(), ring.mesh.set(CLAMPED)?);
    let (stiffness, _) = principal_pair(&assembled.stiffness, &assembled.mass, &free);
    println!("{} dofs, {} entries", stiffness.order(), stiffness.values.len());
    for ordering in [Ordering::NestedDissection, Ordering::MinimumDegree] {
        measure(&stiffness, ordering);
    }
    if let Some(path) = arguments.get(5) {
        write_matrix_market(&stiffness, path).map_err(|error| Error::invalid(path, error.to_string(), "Check it"))?;
    }
    Ok(())
}

fn measure(matrix: &SparseMatrix, ordering: Ordering) {
    let start = Instant::now();
    let symbolic = SymbolicFactor::new(&matrix.pattern, ordering).expect("enough memory");
    let analysed = start.elapsed().as_secs_f64();
    let factor = matrix.factor_with(&symbolic).expect("positive definite");
    let factored = start.elapsed().as_secs_f64() - analysed;
    println!("{ordering:?}: analysis {analysed:.2} s, factorisation {factored:.2} s, {} entries", factor.entries());
    for columns in [6, 16, 128] {
        let right = faer::Mat::from_fn(matrix.order(), columns, |i, j| ((i * 7 + j * 13) % 11) as f64 - 5.0);
        let start = Instant::now();
        let solution = factor.solve(right.clone());
        let seconds = start.elapsed().as_secs_f64();
        let residual = (matrix.times(solution.as_ref()) - &right).norm_max();
        println!("  {columns} right-hand sides: {seconds:.3} s, residual {residual:.1e}");
    }
}

fn write_matrix_market(matrix: &SparseMatrix, path: &str) -> std::io::Result<()> {
    let mut file = BufWriter::new(std::fs::File::create(path)?);
    writeln!(file, "%%MatrixMarket matrix coordinate real symmetric")?;
    let order = matrix.order();
    writeln!(file, "{order} {order} {}", (matrix.values.len() + order) / 2)?;
    for column in 0..order {
        for entry in matrix.pattern.starts[column]..matrix.pattern.starts[column + 1] {
            let row = matrix.pattern.rows[entry];
            if row >= column {
                writeln!(file, "{} {} {:e}", row + 1, column + 1, matrix.values[entry])?;
            }
        }
    }
    Ok(())
}

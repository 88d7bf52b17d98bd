//! Time and size of sparse Cholesky factors with either ordering.
//!
//!     cargo run --release -p tiprub-model --example factorisation -- casing|sector [nd|amd|both] [matrix.mtx]
//!
//! `casing` is the stiffness of the stage's casing, held at its flange; `sector` that of one sector of the stage, held at
//! nothing and made definite by a thousandth of its mass. With a file name the matrix is also written as Matrix Market text,
//! for other solvers (`tools/factorisation.py`). One ordering at a time lets its peak of memory be read from outside.

use std::io::{BufWriter, Write as _};
use std::time::Instant;

use tiprub_model::assembly::{assemble, assemble_with, free_dofs};
use tiprub_model::casing::CLAMPED;
use tiprub_model::ordering::Ordering;
use tiprub_model::sparse::{SparseMatrix, SymbolicFactor, principal_pair};
use tiprub_model::stage::casing::{StageCasingOptions, stage_casing_mesh};
use tiprub_model::stage::{SectorOptions, sector_mesh};
use tiprub_model::{Error, progress::silent};

fn main() -> tiprub_model::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let matrix = match arguments.get(1).map(String::as_str) {
        Some("casing") => casing()?,
        Some("sector") => sector()?,
        other => return Err(Error::invalid("structure", format!("{other:?}"), "Give `casing` or `sector`")),
    };
    println!("{} dofs, {} entries", matrix.order(), matrix.values.len());
    let orderings: &[Ordering] = match arguments.get(2).map(String::as_str) {
        Some("nd") => &[Ordering::NestedDissection],
        Some("amd") => &[Ordering::MinimumDegree],
        _ => &[Ordering::NestedDissection, Ordering::MinimumDegree],
    };
    for ordering in orderings {
        measure(&matrix, *ordering);
    }
    if let Some(path) = arguments.get(3) {
        write_matrix_market(&matrix, path).map_err(|error| Error::invalid(path, error.to_string(), "Check it"))?;
    }
    Ok(())
}

fn casing() -> tiprub_model::Result<SparseMatrix> {
    let options = StageCasingOptions::default();
    let ring = stage_casing_mesh(&options)?;
    let assembled = assemble_with(&ring.mesh, &options.material, options.formulation, &silent)?;
    let free = free_dofs(ring.mesh.nodes.len(), ring.mesh.set(CLAMPED)?);
    Ok(principal_pair(&assembled.stiffness, &assembled.mass, &free).0)
}

fn sector() -> tiprub_model::Result<SparseMatrix> {
    let sector = sector_mesh(&SectorOptions::default())?;
    let assembled = assemble(&sector.mesh, &tiprub_model::Material::titanium(), &silent)?;
    let share = 1e-3 * assembled.stiffness.trace() / assembled.mass.trace();
    Ok(assembled.stiffness.plus_scaled(share, &assembled.mass))
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

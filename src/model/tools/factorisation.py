"""Factor a symmetric Matrix Market matrix with scipy's SuperLU: time, entries and memory for two orderings.

    python factorisation.py matrix.mtx [ordering ...]

The matrix is what `cargo run --release -p tiprub-model --example factorisation -- ... matrix.mtx` writes.
"""

import resource
import sys
import time

import numpy
import scipy.io
import scipy.sparse
import scipy.sparse.linalg

matrix = scipy.sparse.csc_matrix(scipy.io.mmread(sys.argv[1]))
print(f"scipy {scipy.__version__}: {matrix.shape[0]} dofs, {matrix.nnz} entries", flush=True)
for ordering in sys.argv[2:] or ["MMD_AT_PLUS_A", "COLAMD"]:
    start, cpu = time.perf_counter(), time.process_time()
    options = {"SymmetricMode": True} if ordering == "MMD_AT_PLUS_A" else {}
    factor = scipy.sparse.linalg.splu(matrix, permc_spec=ordering, diag_pivot_thresh=0.0, options=options)
    wall, cpu = time.perf_counter() - start, time.process_time() - cpu
    right = numpy.ones((matrix.shape[0], 6))
    start = time.perf_counter()
    solution = factor.solve(right)
    solving = time.perf_counter() - start
    residual = abs(matrix @ solution - right).max()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{ordering}: {wall:.2f} s wall, {cpu:.2f} s processor, L {factor.L.nnz} U {factor.U.nnz} entries, "
          f"6 right-hand sides {solving:.3f} s, residual {residual:.1e}, peak {peak:.2f} GB", flush=True)

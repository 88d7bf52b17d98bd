"""Makes coulomb_siconos.csv: contact problems with Coulomb friction solved by Siconos (https://nonsmooth.gricad-pages.
univ-grenoble-alpes.fr/siconos, Apache-2.0), which the Coulomb solver is compared with.

The problems come from the generator below, of which tests/coulomb.rs holds the twin: only + - * / and integers, so that
both make the same numbers but for rounding. Siconos gets them without dimension (W by its largest entry, free by its
largest entry) and solves with SOLVERS in turn, to the tolerance TOLERANCE of its own full error.

Run with the interpreter that has the siconos package: python3 coulomb_siconos.py > coulomb_siconos.csv
"""

import numpy as np
import siconos.numerics as sn

SIZES = [3, 12, 48, 168]
FRICTIONS = [0.15, 0.5, 1.0]
TOLERANCE = 1e-14
BLADE_MODES = 29
CASING_MODES = 24


class Lcg:
    def __init__(self, seed):
        self.state = seed

    def uniform(self):
        self.state = (self.state * 6364136223846793005 + 1442695040888963407) % 2**64
        return (self.state >> 11) / 2**53 * 2 - 1


def problem(contacts, seed):
    """Blades of three contact nodes, each with its own modes, rubbing a casing whose modes all of them share."""
    lcg = Lcg(seed)
    order = 3 * contacts
    w = np.zeros((order, order))
    for start in range(0, order, 9):
        shapes = np.array([[lcg.uniform() for _ in range(BLADE_MODES)] for _ in range(9)])
        flexibility = np.array([2e-9 / ((k + 1) * (k + 1)) for k in range(BLADE_MODES)])
        w[start : start + 9, start : start + 9] += (shapes * flexibility) @ shapes.T
    shapes = np.array([[lcg.uniform() for _ in range(CASING_MODES)] for _ in range(order)])
    flexibility = np.array([4e-10 / (k + 1) for k in range(CASING_MODES)])
    w += (shapes * flexibility) @ shapes.T
    free = np.zeros(order)
    for contact in range(contacts):
        free[3 * contact] = 1e-6 * lcg.uniform() - 7e-7
        free[3 * contact + 1] = 6e-7 * lcg.uniform() - 2e-7
        free[3 * contact + 2] = 3e-7 * lcg.uniform()
    return w, free


def solve(w, free, friction):
    length, flexibility = np.abs(free).max(), np.abs(w).max()
    contacts = len(free) // 3
    fc3d = sn.FrictionContactProblem(3, contacts, np.asfortranarray(w / flexibility), free / length,
                                     np.full(contacts, friction))
    start = np.zeros(3 * contacts)
    for solver in (sn.SICONOS_FRICTION_3D_NSN_AC, sn.SICONOS_FRICTION_3D_NSGS):
        reaction, velocity = start.copy(), np.zeros(3 * contacts)
        options = sn.SolverOptions(solver)
        options.dparam[sn.SICONOS_DPARAM_TOL] = TOLERANCE
        options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = 300 if solver == sn.SICONOS_FRICTION_3D_NSN_AC else 200000
        info = sn.fc3d_driver(fc3d, reaction, velocity, options)
        error = options.dparam[sn.SICONOS_DPARAM_RESIDU]
        if info == 0:
            return reaction * length / flexibility, sn.solver_options_id_to_name(solver), error
    raise SystemExit(f"not solved: {contacts} contacts, friction {friction}: info {info}, error {error}")


def main():
    print("# Reactions (N) of contact problems with Coulomb friction, solved by Siconos 4.4.0 (Debian 4.4.0+dfsg-2);")
    print("# generator and settings: coulomb_siconos.py. Per row: contacts, friction, solver, its error, reactions.")
    for size in SIZES:
        for friction in FRICTIONS:
            reaction, name, error = solve(*problem(size, 1019 + size), friction)
            print(f"{size},{friction},{name},{error:.1e}," + ",".join(f"{value:.17g}" for value in reaction))


main()

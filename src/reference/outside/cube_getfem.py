"""The cube between two rings by GetFEM: its meshes, elasticity, contact search, normals, friction and tangents.

    python3 cube_getfem.py FILES OUT.csv [options]

FILES is what `cargo run --release -p tiprub-reference --example cube -- files FILES` writes; of it only node tables, elements
and sets are used, and the matrices to say how far GetFEM's own are from them. A study, not part of the product: needs GetFEM's
Python interface, NumPy and SciPy (Debian: python3-getfem, python3-scipy).

Contact: GetFEM's rays from the cube's contact points along the deformed cube's normals to the rings' deformed outer faces
(`add_raytracing_transformation`), gaps along the normals of these faces, its law of Coulomb's friction with penalty (`Coulomb_friction_coupled_projection`), its assembly of residual and tangent. The points are
the cube's nodes (Gauss-Lobatto rule with one point per corner; `--points nodes`), with the same stiffness for each (`--stiffness`, N/m)
or one per area (`--per-area`, Pa/m), or Gauss points of the faces (`--points gauss`).

Time: Newmark's method (alpha = 1/4, delta = 1/2), `--scheme newmark`, or the trapezoidal rule in displacements with a contact force
that follows from the positions at the end of the step, `--scheme held`:
(M + h²/4 K)(u₂ − 2u₁ + u₀) = h² (f(u₂) − K u₁). Linear bodies are condensed to their contact surfaces; `--law stvk` makes the cube one
of GetFEM's finite-strain bricks (Saint Venant-Kirchhoff), newmark only.
"""

import argparse
import json
import pathlib
import sys
import time

import getfem as gf
import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from scipy.spatial import cKDTree

YOUNG = {"cube": 2.1e9, "left": 210e9, "right": 210e9}
POISSON, DENSITY = 0.3, 7800.0
# Corners of a brick in the order of GetFEM's QK elements.
ORDER = [0, 1, 3, 2, 4, 5, 7, 6]
SURFACE, ALL = 1, -1
# Newton's method ends when positions (m) and, for finite strains, forces (N) balance to this.
SETTLED, BALANCED = 1e-12, 1e-6


class Body:
    """A mesh in GetFEM, its matrices there, and the numbering of nodes on both sides."""

    def __init__(self, name, table, lumped):
        nodes = np.array(table["nodes"])
        self.name, self.count = name, len(nodes)
        self.mesh = gf.Mesh("empty", 3)
        brick = gf.GeoTrans("GT_QK(3,1)")
        for element in table["elements"]:
            self.mesh.add_convex(brick, nodes[element][ORDER].T)
        self.mf = gf.MeshFem(self.mesh, 3)
        self.mf.set_fem(gf.Fem("FEM_QK(3,1)"))
        self.mim = gf.MeshIm(self.mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(3,3)"))
        places = self.mf.basic_dof_nodes().T[::3]
        distance, mine = cKDTree(places).query(nodes)
        assert distance.max() < 1e-12 and len(places) == len(nodes)
        # Dof of component k of node i in GetFEM: 3·mine[i] + k.
        self.dofs = (3 * mine[:, None] + np.arange(3)).ravel()
        self.nodes = nodes
        lame = YOUNG[name] * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), YOUNG[name] / (2 * (1 + POISSON))
        self.stiffness = self._matrix(
            f"({lame[0]!r}*Trace(Grad_u)*Id(3)+{lame[1]!r}*(Grad_u+Grad_u')):Grad_Test_u"
        )
        self.mass = self._matrix(f"{DENSITY!r}*u.Test_u")
        self._compare(table)
        if lumped:
            self.mass = sp.diags(np.asarray(self.mass.sum(axis=1)).ravel()).tocsc()
        clamped = np.array(table["sets"].get("CLAMPED", []), dtype=int)
        free = np.ones(3 * self.count, dtype=bool)
        free[(3 * mine[clamped][:, None] + np.arange(3)).ravel()] = False
        self.free = np.flatnonzero(free)
        sides = [key for key in ("MASTER_LEFT", "MASTER_RIGHT", "SLAVE") if key in table["sets"]]
        self.sets = {key: mine[np.array(table["sets"][key])] for key in table["sets"]}
        # Contact dofs in GetFEM's numbers.
        points = np.concatenate([self.sets[key] for key in sides])
        self.contact = (3 * points[:, None] + np.arange(3)).ravel()
        for region, key in enumerate(sides, start=SURFACE):
            self._region(region, table["sets"][key], nodes)

    def _matrix(self, expression):
        matrix = gf.asm_generic(
            self.mim, 2, expression, ALL, "u", 1, self.mf, np.zeros(self.mf.nbdof())
        )
        return csc(matrix)

    def _compare(self, table):
        size = 3 * self.count
        for key, own in (("stiffness", self.stiffness), ("mass", self.mass)):
            given = sp.csc_matrix((table[key], table["rows"], table["starts"]), shape=(size, size))
            apart = abs(own[self.dofs][:, self.dofs] - given).max() / abs(given).max()
            print(f"{self.name}: {key} of GetFEM and of the file differ by {apart:.1e} of the largest entry", file=sys.stderr)

    def _region(self, region, chosen, nodes):
        tree = cKDTree(nodes[chosen])
        faces = self.mesh.outer_faces()
        kept = []
        for element, face in faces.T:
            points = self.mesh.pts_from_cvid([element])[0].T
            on_face = self.mesh.pid_in_faces(np.array([[element], [face]]))
            if tree.query(self.mesh.pts(on_face).T)[0].max() < 1e-9:
                kept.append((element, face))
        self.mesh.set_region(region, np.array(kept).T)


def csc(matrix):
    indices, rows = matrix.csc_ind()
    return sp.csc_matrix((matrix.csc_val(), rows, indices), shape=matrix.size())


class Contact:
    """Forces on the three bodies' dofs and their derivative, by GetFEM."""

    def __init__(self, bodies, options):
        self.bodies, self.options = bodies, options
        cube = bodies[0]
        self.model = gf.Model("real")
        for body in bodies:
            self.model.add_fem_variable("u_" + body.name, body.mf)
        self.offsets = np.cumsum([0] + [3 * body.count for body in bodies])
        point = gf.MeshFem(cube.mesh, 1)
        point.set_fem(gf.Fem("FEM_QK(3,1)"))
        rule = "IM_GAUSSLOBATTO1D(1)" if options.points == "nodes" else f"IM_GAUSS1D({options.gauss})"
        volume = gf.Integ(f"IM_PRODUCT(IM_PRODUCT({rule},{rule}),{rule})")
        self.mim = gf.MeshIm(cube.mesh, volume)
        self.weights = np.zeros(cube.count)
        for region in (SURFACE, SURFACE + 1):
            self.weights += gf.asm_generic(self.mim, 1, "Test_p", region, "p", 1, point, np.zeros(cube.count))
        per_area = np.full(cube.count, options.per_area or 0.0)
        if options.stiffness:
            touching = self.weights > 1e-12
            per_area[touching] = options.stiffness / self.weights[touching]
            corners = np.concatenate([cube.sets["CORNERS_LEFT"], cube.sets["CORNERS_RIGHT"]])
            per_area[corners] *= options.corners
        self.model.add_initialized_fem_data("k", point, per_area)
        self.per_area = per_area
        self.model.add_fem_data("held", cube.mf)
        for body in bodies:
            self.model.add_fem_data("old_" + body.name, body.mf)
        self.model.add_initialized_data("friction", [options.friction])
        self.expressions = []
        for region, body in ((SURFACE, bodies[1]), (SURFACE + 1, bodies[2])):
            self.expressions.append((region, self._expression(region, body)))

    def _expression(self, region, ring):
        cube, name, on = self.bodies[0], ring.name, "to_" + ring.name
        # GetFEM does not derive an interpolated `Normal`; the facets are plane, and each belongs to one brick.
        flat = gf.MeshFem(ring.mesh, 3)
        flat.set_fem(gf.Fem("FEM_QK(3,0)"))
        normals = np.zeros(flat.nbdof())
        for element, face in ring.mesh.region(SURFACE).T:
            normals[flat.basic_dof_from_cvid([element])[0]] = ring.mesh.normal_of_face(element, face).ravel()
        self.model.add_initialized_fem_data("normal_" + name, flat, normals)
        self.model.add_raytracing_transformation(on, 3e-3)
        add = "add_{}_contact_boundary_to_raytracing_transformation"
        getattr(self.model, add.format("slave"))(on, cube.mesh, "u_cube", region)
        getattr(self.model, add.format("master"))(on, ring.mesh, "u_" + name, SURFACE)
        u, other = "u_cube", f"Interpolate(u_{name},{on})"
        # Outer normal of the deformed ring at the foot, against the cube.
        normal = f"Normalized(Inv(Id(3)+Interpolate(Grad_u_{name},{on})')*Interpolate(normal_{name},{on}))"
        gap = f"((X+{u}-Interpolate(X,{on})-{other}).({normal}))"
        test = f"(Test_{u}-Interpolate(Test_u_{name},{on}))"
        normal = f"({normal})"
        force = f"(k*pos_part(-{gap})*{normal})"
        if self.options.friction:
            slid = f"({u}-old_cube-{other}+Interpolate(old_{name},{on}))"
            held = f"(held-(held.{normal})*{normal})"
            force = f"Coulomb_friction_coupled_projection({held},-{normal},{slid},{gap},friction,k)"
        return f"Interpolate_filter({on},-{force}.{test},1)"

    def set(self, displacements):
        for body, values in zip(self.bodies, displacements):
            self.model.set_variable("u_" + body.name, values)

    def forces(self):
        total = np.zeros(self.offsets[-1])
        for region, expression in self.expressions:
            total -= gf.asm_generic(self.mim, 1, expression, region, self.model)
        return total

    def tangent(self):
        """Minus the derivative of the forces."""
        parts = [csc(gf.asm_generic(self.mim, 2, e, region, self.model)) for region, e in self.expressions]
        return parts[0] + parts[1]

    def soften(self, scale):
        self.model.set_variable("k", scale * self.per_area)

    def settled(self, displacements, forces):
        """The end of a step: friction and displacements are remembered."""
        for body, values in zip(self.bodies, displacements):
            self.model.set_variable("old_" + body.name, values)
        if self.options.friction:
            held = forces[: self.offsets[1]].copy()
            weights = np.repeat(self.weights, 3)
            held[weights > 1e-12] /= weights[weights > 1e-12]
            self.model.set_variable("held", held)


class Large:
    """The cube with GetFEM's finite-strain elasticity."""

    def __init__(self, cube):
        self.model = gf.Model("real")
        self.model.add_fem_variable("u", cube.mf)
        lame = YOUNG["cube"] * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), YOUNG["cube"] / (2 * (1 + POISSON))
        self.model.add_initialized_data("lame", list(lame))
        self.model.add_finite_strain_elasticity_brick(cube.mim, "SaintVenant Kirchhoff", "u", "lame")

    def at(self, u):
        self.model.set_variable("u", u)
        self.model.assembly("build_all")
        return -self.model.rhs(), csc(self.model.tangent_matrix())


def arguments():
    parser = argparse.ArgumentParser()
    parser.add_argument("files")
    parser.add_argument("out")
    parser.add_argument("--step", type=float, default=1e-6)
    parser.add_argument("--end", type=float, default=3.8e-4)
    parser.add_argument("--speed", type=float, default=100.0)
    parser.add_argument("--friction", type=float, default=0.0)
    parser.add_argument("--stiffness", type=float)
    parser.add_argument("--corners", type=float, default=1.0, help="stiffness of corner nodes over that of the others")
    parser.add_argument("--per-area", type=float)
    parser.add_argument("--points", choices=["nodes", "gauss"], default="nodes")
    parser.add_argument("--gauss", type=int, default=5, help="order of the Gauss rule")
    parser.add_argument("--scheme", choices=["newmark", "held"], default="newmark")
    parser.add_argument("--law", choices=["linear", "stvk"], default="linear")
    parser.add_argument("--stride", type=int, default=1, help="steps per row; forces are means over them")
    parser.add_argument("--origin", default="GetFEM", help="version, for the table's first line")
    parser.add_argument("--lumped", action="store_true")
    options = parser.parse_args()
    if (options.stiffness is None) == (options.per_area is None):
        parser.error("one of --stiffness and --per-area is needed")
    if options.law == "stvk" and options.scheme != "newmark":
        parser.error("--law stvk goes with --scheme newmark")
    return options


class Stepper:
    """One step after the other; displacements of every body in GetFEM's numbering."""

    def __init__(self, bodies, options):
        self.bodies, self.options, self.h = bodies, options, options.step
        self.contact = Contact(bodies, options)
        self.quarter = 0.25 * self.h**2
        # Displacement at the end of a step per force in it.
        self.gain = self.quarter if options.scheme == "newmark" else self.h**2
        self.large = Large(bodies[0]) if options.law == "stvk" else None
        self.factors, self.surface, blocks, self.places = [], [], [], []
        for body, start in zip(bodies, self.contact.offsets):
            matrix = (body.mass + self.quarter * body.stiffness)[body.free][:, body.free]
            factor = sla.splu(matrix.tocsc())
            position = np.full(3 * body.count, -1)
            position[body.free] = np.arange(len(body.free))
            places = position[body.contact]
            unit = np.zeros((len(body.free), len(places)))
            moving = np.flatnonzero(places >= 0)
            unit[places[moving], moving] = 1.0
            solved = factor.solve(unit)
            block = np.zeros((len(places), len(places)))
            block[moving] = solved[places[moving]]
            self.factors.append(factor)
            blocks.append(self.gain * block)
            self.places.append(start + body.contact)
        self.places = np.concatenate(self.places)
        self.compliance = sl.block_diag(*blocks)
        self.u = [np.zeros(3 * body.count) for body in bodies]
        self.v = [np.zeros(3 * body.count) for body in bodies]
        self.v[0][1::3] = -options.speed
        self.a = [np.zeros(3 * body.count) for body in bodies]
        self.change = [self.h * v for v in self.v]
        self.iterations = 0
        self.before = np.zeros(len(self.places))

    def solve(self, index, load):
        result = np.zeros_like(load)
        free = self.bodies[index].free
        result[free] = self.factors[index].solve(load[free])
        return result

    def at_contact(self, vectors):
        return np.concatenate(vectors)[self.places]

    def evaluate(self, free, x):
        """Forces with the contact dofs at x."""
        values = np.concatenate(free)
        values[self.places] = x
        self.contact.set(np.split(values, self.contact.offsets[1:-1]))
        return self.contact.forces()

    def newton(self, free):
        """Contact forces of linear bodies whose positions without contact are `free`."""
        start = self.at_contact(free)
        # The forces of the step before are a good guess; where Newton's method runs in circles with it, softer contact first.
        guess = start + self.compliance @ self.before
        for scales in ([1.0], [1e-3, 1e-2, 1e-1, 1.0]):
            x = guess if len(scales) == 1 else start
            for scale in scales:
                self.contact.soften(scale)
                x, forces, left = self.iterate(free, start, x)
                if left >= SETTLED:
                    break
            else:
                self.before = forces[self.places]
                return forces
        raise SystemExit(f"Newton's method has not converged: residual {left:.1e} m")

    def iterate(self, free, start, x):
        """Newton's method from contact dofs x: where it ends, the forces there, the residual (m)."""
        for _ in range(25):
            forces = self.evaluate(free, x)
            residual = x - start - self.compliance @ forces[self.places]
            left = np.abs(residual).max()
            if left < SETTLED:
                break
            tangent = self.contact.tangent()[self.places][:, self.places].tocsc()
            active = np.flatnonzero(np.diff(tangent.indptr))
            change = -residual
            if len(active):
                slope = self.compliance @ tangent[:, active]
                moved = np.linalg.solve(np.eye(len(active)) + slope[active], -residual[active])
                change = change - slope @ moved
            x = x + change
            self.iterations += 1
        return x, forces, left

    def newton_large(self, known, free):
        """As `newton` for a cube of finite strains; also the cube's displacement."""
        cube = self.bodies[0]
        size = 3 * cube.count
        inertia = cube.mass / self.quarter
        ring_places = self.places[self.places >= size]
        first = len(self.places) - len(ring_places)
        compliance = self.compliance[first:, first:]
        start = np.concatenate(free)[ring_places]
        x, rings = known[0].copy(), start.copy()
        for _ in range(60):
            values = np.concatenate([x] + list(free[1:]))
            values[ring_places] = rings
            self.contact.set(np.split(values, self.contact.offsets[1:-1]))
            forces, tangent = self.contact.forces(), self.contact.tangent()
            inner, slope = self.large.at(x)
            load = inertia @ (x - known[0]) + inner - forces[:size]
            gap = rings - start - compliance @ forces[ring_places]
            if np.abs(load).max() < BALANCED and np.abs(gap).max() < SETTLED:
                return forces, x
            tangent = tangent.tocsr()
            mixed = tangent[ring_places].tocsc()
            rows = np.flatnonzero(np.diff(tangent[ring_places].indptr))
            own = (inertia + slope + tangent[:size, :size]).toarray()
            across = tangent[:size][:, ring_places[rows]].toarray()
            down = compliance[:, rows] @ mixed[rows][:, :size].toarray()
            among = compliance[:, rows] @ mixed[rows][:, ring_places[rows]].toarray()
            matrix = np.block([[own, across], [down[rows], np.eye(len(rows)) + among[rows]]])
            moved = np.linalg.solve(matrix, -np.concatenate([load, gap[rows]]))
            x = x + moved[:size]
            rings = rings - gap - down @ moved[:size] - among @ moved[size:]
            self.iterations += 1
        raise SystemExit(f"Newton's method has not converged: {np.abs(load).max():.1e} N, {np.abs(gap).max():.1e} m")

    def newmark(self):
        h, quarter = self.h, self.quarter
        known = [u + h * v + quarter * a for u, v, a in zip(self.u, self.v, self.a)]
        loads = [-(body.stiffness @ k) for body, k in zip(self.bodies, known)]
        new = [self.solve(i, load) for i, load in enumerate(loads)]
        free = [k + quarter * a for k, a in zip(known, new)]
        if self.large is None:
            forces = self.newton(free)
            cube = None
        else:
            forces, cube = self.newton_large(known, free)
        parts = np.split(forces, self.contact.offsets[1:-1])
        if forces.any():
            new = [self.solve(i, load + part) for i, (load, part) in enumerate(zip(loads, parts))]
        if cube is not None:
            new[0] = (cube - known[0]) / quarter
        for i in range(3):
            self.v[i] = self.v[i] + 0.5 * h * (self.a[i] + new[i])
            self.u[i] = known[i] + quarter * new[i]
        self.a = new
        return forces

    def held(self):
        square = self.h**2
        loads = [-square * (body.stiffness @ u) for body, u in zip(self.bodies, self.u)]
        second = [self.solve(i, load) for i, load in enumerate(loads)]
        free = [u + d + s for u, d, s in zip(self.u, self.change, second)]
        forces = self.newton(free)
        parts = np.split(forces, self.contact.offsets[1:-1])
        if forces.any():
            second = [self.solve(i, load + square * part) for i, (load, part) in enumerate(zip(loads, parts))]
        self.change = [d + s for d, s in zip(self.change, second)]
        self.u = [u + d for u, d in zip(self.u, self.change)]
        self.v = [d / self.h for d in self.change]
        return forces

    def step(self):
        forces = self.newmark() if self.options.scheme == "newmark" else self.held()
        self.contact.settled(self.u, forces)
        return forces


def normal_part(options, force):
    """Normal force out of the whole one while the node slides, |F|/√(1 + µ²); a little too large where it sticks."""
    return np.linalg.norm(force) / np.sqrt(1.0 + options.friction**2)


def main():
    options = arguments()
    gf.util_trace_level(0)
    started = time.process_time()
    tables = [json.loads((pathlib.Path(options.files) / f"{name}-consistent.json").read_text()) for name in YOUNG]
    bodies = [Body(name, table, options.lumped) for name, table in zip(YOUNG, tables)]
    stepper = Stepper(bodies, options)
    print(f"prepared in {time.process_time() - started:.1f} s of processor time", file=sys.stderr)
    cube = bodies[0]
    first = cube.dofs[0]
    left = 3 * cube.sets["MASTER_LEFT"][:, None] + np.arange(3)
    mass = np.asarray(cube.mass.sum(axis=1)).ravel()
    with open(options.out, "w") as out:
        given = [word for word in sys.argv[3:] if word not in ("--origin", options.origin)]
        out.write(f"# {options.origin}, {options.speed:.0f} m/s, facets; cube_getfem.py FILES TABLE {' '.join(given)}; SI units.\n")
        out.write("t,u1x,u1y,u1z,lambda1,left,vy\n")
        sums = np.zeros(2)
        for index in range(1, round(options.end / options.step) + 1):
            before = stepper.u[0][first : first + 3]
            forces = stepper.step()
            sums += normal_part(options, forces[first : first + 3]), sum(normal_part(options, forces[d]) for d in left)
            # The force that holds positions at the end of a step acts at its beginning.
            held = options.scheme == "held"
            at = index - 1 if held else index
            if at % options.stride or at == 0:
                continue
            u = before if held else stepper.u[0][first : first + 3]
            speed = (mass[1::3] @ stepper.v[0][1::3]) / mass[1::3].sum()
            row = [at * options.step, *u, *(sums / options.stride), speed]
            out.write(",".join(f"{x:.6e}" for x in row) + "\n")
            sums[:] = 0.0
            if index % 100 == 0:
                out.flush()
                spent = time.process_time() - started
                print(f"{index} steps, {stepper.iterations} iterations, {spent:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()

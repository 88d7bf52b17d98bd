"""Shafts in bearings, as partners of a rub: whirl and speed in, forces, moments and torque out.

    M q'' + (C + Ω G) q' + K q = forces and moments of the rub + load + unbalance

Forces of the rub are held over a communication step, as means; unbalance turns with the rotor. Then the solution over a step is an
exponential of the matrices, and the shaft has no step error of its own. What goes into it and is lost in it is integrated as exactly.
"""

import numpy
from scipy.linalg import eigh, expm

ENERGIES = ["force", "moment", "load", "unbalance", "damping", "torque", "drive"]


class Rotor:
    """A shaft with a rub at one node. Its speed is held over a step, and changes with drive, rub and unbalance from step to step."""

    inputs = ["whirl_x", "whirl_y", "speed"]
    outputs = ["force_x", "force_y", "moment_x", "moment_y", "torque"]

    def __init__(self, matrices, node, *, speed, clearance, inertia=numpy.inf, drive=0.0, origin="a rotor"):
        """`matrices` are M, C, G, K, each (n, n), with M and K symmetric and positive definite. `node` are the places in q of the rub's
        displacements along x and y and, where it tilts, of its turns about x and y. Speed (rad/s); clearance (m), by which whirl is
        measured; moment of inertia about the axis (kg m²), without which the speed stays; driving torque (N m)."""
        mass, damping, gyroscopic, stiffness = (numpy.asarray(matrix, dtype=float) for matrix in matrices)
        for name, matrix in (("mass", mass), ("stiffness", stiffness)):
            if not numpy.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9 * numpy.abs(matrix).max()):
                raise ValueError(f"the {name} of {origin} is not symmetric: bearings with cross-coupled stiffness have no place here")
        squares, shapes = eigh(stiffness, mass)
        if squares[0] <= 0.0:
            raise ValueError(f"{origin} can move without force (ω² = {squares[0]:.3g} 1/s²): hold it in bearings, without turns about its axis")
        # Modes of the shaft at rest, without damping: p = ω η and w = η' have all entries of one size, and energies are their squares.
        self.frequencies, self.size = numpy.sqrt(squares), len(squares)
        self.damping, self.gyroscopic = shapes.T @ damping @ shapes, shapes.T @ gyroscopic @ shapes
        self.shape = numpy.zeros((4, self.size))
        self.shape[: len(node)] = shapes[list(node)]
        self.inertia, self.drive, self.origin = inertia, drive, origin
        self.scale = numpy.array([clearance, clearance, abs(speed) or 1.0])
        self.unbalance, self.load = 0j, numpy.zeros(4)
        # p, w; angle (rad), speed (rad/s), work of the unbalance that the speed has yet to pay (J); energies since the start (J).
        self.state = numpy.zeros(2 * self.size + 3 + len(ENERGIES))
        self.state[2 * self.size + 1] = speed
        self._forms, self._cache = self._quadratic(), {}

    @property
    def angle(self):
        return self.state[2 * self.size]

    @property
    def speed(self):
        return self.state[2 * self.size + 1]

    @property
    def place(self):
        """Displacements (m) and turns (rad) of the rub's node, (4,)."""
        return self.shape @ (self.state[: self.size] / self.frequencies)

    @property
    def velocity(self):
        return self.shape @ self.state[self.size : 2 * self.size]

    @property
    def energies(self):
        """Work (J) of the rub's forces and moments, of load and unbalance on the lateral motion, loss in damping; work of the rub's torque
        and of the drive on the turning."""
        return dict(zip(ENERGIES, self.state[-len(ENERGIES) :]))

    def lateral_energy(self):
        """Kinetic and strain energy of the lateral motion (J)."""
        return 0.5 * float(self.state[: 2 * self.size] @ self.state[: 2 * self.size])

    def turning_energy(self):
        return 0.5 * self.inertia * self.speed**2

    def save(self):
        return self.state.copy()

    def restore(self, state):
        self.state = numpy.array(state, dtype=float)

    def rest(self, outputs=None):
        """Stand still under the load, and under constant outputs of the rub where they are given."""
        held = self.load + (0.0 if outputs is None else outputs[:4])
        self.state[: self.size] = (self.shape.T @ held) / self.frequencies
        self.state[self.size : 2 * self.size] = 0.0

    def turn_steadily(self):
        """Whirl as the unbalance makes it at this speed, for ever."""
        matrix = numpy.diag(self.frequencies**2 - self.speed**2) + 1j * self.speed * (self.damping + self.speed * self.gyroscopic)
        force = self.shape[:2].T @ numpy.array([1.0, -1j]) * self.unbalance * self.speed**2
        motion = numpy.linalg.solve(matrix, force) * numpy.exp(1j * self.angle)
        self.state[: self.size] = self.frequencies * motion.real
        self.state[self.size : 2 * self.size] = (1j * self.speed * motion).real

    def dynamics(self, speed):
        """d/dt of (p, w, forces and moments held, unbalance as it turns), (2n + 6, 2n + 6)."""
        size = self.size
        whole = numpy.zeros((2 * size + 6, 2 * size + 6))
        whole[range(size), range(size, 2 * size)] = self.frequencies
        whole[range(size, 2 * size), range(size)] = -self.frequencies
        whole[size : 2 * size, size : 2 * size] = -(self.damping + speed * self.gyroscopic)
        whole[size : 2 * size, 2 * size : -2], whole[size : 2 * size, -2:] = self.shape.T, self.shape[:2].T
        whole[-2, -1], whole[-1, -2] = -speed, speed
        return whole

    def _quadratic(self):
        """Powers as quadratic forms of that vector: of the unbalance, and lost in damping."""
        moving = slice(self.size, 2 * self.size)
        supplied, lost = (numpy.zeros((2 * self.size + 6,) * 2) for _ in range(2))
        supplied[moving, -2:] = self.shape[:2].T
        lost[moving, moving] = self.damping
        return [0.5 * (power + power.T) for power in (supplied, lost)]

    def exact(self, step, speed):
        """Propagator over a step at this speed, and the quadratic forms of the works over it, (2n + 6, 2n + 6) each."""
        if (step, speed) not in self._cache:
            if len(self._cache) > 8:
                self._cache.clear()
            dynamics = self.dynamics(speed)
            halvings = max(0, int(numpy.ceil(numpy.log2(numpy.abs(dynamics).sum(axis=1).max() * step))) + 1)
            short, works = step / 2**halvings, [0.0, 0.0]
            # Gauss's rule over a part so short that it is exact to rounding, then twice as long again and again.
            for node, weight in zip(*numpy.polynomial.legendre.leggauss(6)):
                part = expm(dynamics * (0.5 * short * (node + 1.0)))
                works = [work + 0.5 * short * weight * part.T @ power @ part for work, power in zip(works, self._forms)]
            part = expm(dynamics * short)
            for _ in range(halvings):
                works, part = [work + part.T @ work @ part for work in works], part @ part
            self._cache[step, speed] = part, works
        return self._cache[step, speed]

    def linear(self, step):
        """T, Γ, S of the lateral motion: x₁ = T x + Γ (force_x, force_y, moment_x, moment_y), whirl = S x."""
        propagator, _ = self.exact(step, self.speed)
        states = 2 * self.size
        reading = numpy.hstack([self.shape[:2] / self.frequencies, numpy.zeros((2, self.size))])
        return propagator[:states, :states], propagator[:states, states : states + 4], reading

    def _middle(self, step):
        """Speed in the middle of the next step, but for the torque of the rub."""
        paid = self.state[2 * self.size + 2] / (self.speed * self.inertia) if self.speed else 0.0
        return self.speed + 0.5 * (self.drive * step / self.inertia - paid)

    def _vector(self, outputs, speed):
        turned = self.unbalance * speed**2 * numpy.exp(1j * self.angle)
        return numpy.concatenate([self.state[: 2 * self.size], outputs[:4] + self.load, [turned.real, turned.imag]])

    def known(self):
        return numpy.array([*self.place[:2], self.speed])

    def law(self, step):
        """Whirl at the end, mean speed over the step."""
        speed, size = self._middle(step), self.size
        propagator, _ = self.exact(step, speed)
        reading = self.shape[:2] / self.frequencies
        free = numpy.array([*(reading @ (propagator[:size] @ self._vector(numpy.zeros(5), speed))), speed])
        compliance = numpy.zeros((3, 5))
        compliance[:2, :4] = reading @ propagator[:size, 2 * size : 2 * size + 4]
        compliance[2, 4] = 0.5 * step / self.inertia
        return free, compliance

    def commit(self, outputs, values, step):
        speed, states = self._middle(step), 2 * self.size
        propagator, (supplied, lost) = self.exact(step, speed)
        vector, before = self._vector(outputs, speed), self.place
        unbalance = vector @ supplied @ vector
        mean = speed + 0.5 * step * outputs[4] / self.inertia
        self.state[:states] = propagator[:states] @ vector
        moved = self.place - before
        # The turning pays for what the unbalance does, a step later; what it cannot is carried on.
        owed = self.state[states + 2]
        owed += unbalance - (mean * owed / self.speed if self.speed else 0.0)
        self.state[states : states + 3] = self.angle + mean * step, 2.0 * mean - self.speed, owed
        works = [
            outputs[:2] @ moved[:2], outputs[2:4] @ moved[2:], self.load @ moved, unbalance, vector @ lost @ vector,
            outputs[4] * mean * step, self.drive * mean * step,
        ]
        self.state[-len(ENERGIES) :] += works


def jeffcott(mass, damping, stiffness, *, diametral=0.0, polar=0.0, tilting=0.0, tilt_damping=0.0, **keywords):
    """A rigid disk on isotropic springs (kg, N s/m, N/m). With a diametral moment of inertia it tilts too (N m/rad, N m s/rad), and the polar
    one (kg m²) makes that gyroscopic: both motions have closed forms."""
    diagonals = [[mass] * 2 + [diametral] * 2, [damping] * 2 + [tilt_damping] * 2, [0.0] * 4, [stiffness] * 2 + [tilting] * 2]
    matrices = [numpy.diag(diagonal) for diagonal in diagonals]
    matrices[2][2, 3], matrices[2][3, 2] = polar, -polar
    free = 4 if diametral else 2
    return Rotor([matrix[:free, :free] for matrix in matrices], range(free), origin=f"the disk of {mass:g} kg", **keywords)


# Degrees of freedom of a node of ROSS: x, y, z, turns about x, y, z. These are x, y and the turns about them.
LATERAL = (0, 1, 3, 4)


def of_ross(rotor, node, **keywords):
    """The lateral motion of a rotor of ROSS with a rub at one of its nodes. Axial motion and turning about the axis are left out."""
    if rotor.number_dof != 6:
        raise ValueError(f"a rotor of ROSS with {rotor.number_dof} degrees of freedom per node has no place here: 6 are known")
    lateral = [place for place in range(rotor.ndof) if place % 6 in LATERAL]
    where = [lateral.index(6 * node + turn) for turn in LATERAL]
    cut = numpy.ix_(lateral, lateral)
    matrices = [numpy.asarray(matrix)[cut] for matrix in (rotor.M(0.0), rotor.C(0.0), rotor.G(), rotor.K(0.0))]
    return Rotor(matrices, where, origin="the rotor of ROSS", **keywords)

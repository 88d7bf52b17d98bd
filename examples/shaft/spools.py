"""Two spools that a rub brakes: speeds in, torques out.

    J Ω' = drive (1 − Ω/Ω_free) + torque of the rub ∓ c (Ω₁ − Ω₂)

Each is driven by a torque that falls with its speed, and both share a bearing between them that drags, c (N m s/rad). Torques of the rub are
held over a communication step, as means: the speeds are exact then, and so are their means, with which torque times mean speed is the work.
"""

import numpy
from scipy.linalg import expm


class Spools:
    """Two turning masses; `names` are those of the rotors in the scene."""

    def __init__(self, names, inertia, speed, drive, free_speed, drag):
        """Moments of inertia (kg m²), speeds at the start (rad/s, with sign), torques at rest (N m, with the sign of the speed), speeds (rad/s)
        at which the drive gives no torque, drag of the bearing between them."""
        self.inputs, self.outputs = [f"{name}.speed" for name in names], [f"{name}.torque" for name in names]
        self.inertia, self.drive = numpy.array(inertia, dtype=float), numpy.array(drive, dtype=float)
        self.falling, self.drag = self.drive / numpy.array(free_speed, dtype=float), drag
        self.scale = numpy.abs(speed)
        # Speeds; works since the start (J) of the rub, and of drive and drag together.
        self.state = numpy.array([*speed, 0.0, 0.0], dtype=float)
        self._cache = {}

    @property
    def speed(self):
        return self.state[:2]

    def turning_energy(self):
        return 0.5 * float(self.inertia @ self.speed**2)

    def save(self):
        return self.state.copy()

    def restore(self, state):
        self.state = numpy.array(state, dtype=float)

    def _exact(self, step):
        """Speeds at the end and their means, of (speeds, torques held): (2, 4) each."""
        if step not in self._cache:
            drags = self.drag * numpy.array([[1.0, -1.0], [-1.0, 1.0]]) + numpy.diag(self.falling)
            whole = numpy.zeros((6, 6))
            whole[:2, :2], whole[:2, 2:4] = -drags / self.inertia[:, None], numpy.diag(1.0 / self.inertia)
            whole[4:, :2] = numpy.eye(2)
            found = expm(whole * step)
            self._cache = {step: (found[:2, :4], found[4:, :4] / step)}
        return self._cache[step]

    def known(self):
        return self.speed.copy()

    def law(self, step):
        """Mean speeds over the step."""
        _, mean = self._exact(step)
        return mean @ numpy.concatenate([self.speed, self.drive]), mean[:, 2:]

    def commit(self, outputs, values, step):
        end, mean = self._exact(step)
        vector = numpy.concatenate([self.speed, self.drive + outputs])
        before, turned = self.turning_energy(), mean @ vector * step
        self.state[:2] = end @ vector
        work = float(outputs @ turned)
        self.state[2:] += work, self.turning_energy() - before - work

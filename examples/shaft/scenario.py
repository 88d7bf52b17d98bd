"""What is coupled: the scenes beside this file as FMUs, and the shafts that lean on them."""

import contextlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy

from coupling import CouplingError
from rotor import LATERAL, Rotor, jeffcott, of_ross

HERE = Path(__file__).resolve().parent
# Those of rub.toml: clearance (m), speed (rad/s).
CLEARANCE, SPEED = 3.56e-4, 1800.0
# The blade that is lost was worth so much unbalance (kg m), and the disk turns with so much inertia (kg m²).
LOST, INERTIA = 6e-3, 0.2


def package(scene, into):
    """An FMU (FMI 3.0, scalars) of a scene file, made by the program that TIPRUB names."""
    program, library = os.environ.get("TIPRUB") or shutil.which("tiprub"), os.environ.get("TIPRUB_LIBRARY")
    if not program or not Path(program).is_file():
        raise CouplingError(f"no tiprub program at {program or 'TIPRUB or on PATH'}: run examples/run.sh shaft, or set TIPRUB")
    file = Path(into) / f"{Path(scene).stem}.fmu"
    command = [program, "package", str(scene), "--fmi", "3", "--scalars", "--quiet", "-o", str(file)]
    done = subprocess.run(command + (["--library", library] if library else []), capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise CouplingError(f"{' '.join(command)} failed:\n{done.stderr.strip()}")
    return file


@contextlib.contextmanager
def silence():
    """Keep what is said, by libraries in C too, from both outputs."""
    sys.stdout.flush()
    kept = [os.dup(output) for output in (1, 2)]
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        for output, saved in zip((1, 2), kept):
            os.dup2(saved, output)
            os.close(saved)


# The node of the beam that carries the disk.
DISK = 3


def ross_rotor():
    """A steel shaft of 0.8 m in two bearings with a disk of 12 kg: it whirls first at 750 rad/s, below the speed, then near 1800 rad/s."""
    try:
        # It tells at length, and as an error, that it lacks a library for fluids which nothing here needs.
        with silence():
            import ross
    except ImportError as error:
        raise CouplingError(f"ROSS cannot be imported ({error}): run examples/run.sh shaft, or take --shaft disk") from error
    steel = ross.Material("steel", rho=7810, E=211e9, G_s=81.2e9)
    beam = [ross.ShaftElement(0.1, 0.0, 0.07, material=steel) for _ in range(8)]
    disk = ross.DiskElement(n=DISK, m=12.0, Id=0.08, Ip=0.15)
    bearings = [ross.BearingElement(n=end, kxx=2e7, cxx=1e4) for end in (0, 8)]
    return ross.Rotor(beam, [disk], bearings)


def response_of(rotor, speed):
    """What ROSS says of displacements and turns about x and y at the disk under 1e-3 kg m: amplitudes of exp(iΩt), (4,)."""
    found = rotor.run_unbalance_response(DISK, 1e-3, 0.0, frequency=numpy.array([speed])).forced_resp[:, 0]
    return found[[rotor.number_dof * DISK + turn for turn in LATERAL]]


class Shafts:
    """Maker of fresh shafts; matrices of ROSS are asked for once."""

    def __init__(self, kind):
        self.kind, self._ross = kind, None

    @property
    def ross(self):
        """The rotor of ROSS."""
        if self._ross is None:
            self._ross = ross_rotor()
        return self._ross

    def whirling(self, **keywords):
        """The shaft of the studies: of ROSS, or a disk on springs of about the same first frequency, mass and damping."""
        keywords = {"speed": SPEED, "clearance": CLEARANCE, "inertia": INERTIA, **keywords}
        if self.kind == "disk":
            return jeffcott(20.0, 2.6e3, 1.1e7, diametral=0.08, polar=0.15, tilting=8e5, tilt_damping=20.0, **keywords)
        return of_ross(self.ross, DISK, **keywords)


def pressed(mass, stiffness=2e7, damping_ratio=0.1):
    """A disk on springs whose load presses it through the clearance and a third of it more, with a smooth start of 5 ms; no unbalance."""
    disk = jeffcott(mass, 2.0 * damping_ratio * numpy.sqrt(stiffness * mass), stiffness, speed=SPEED, clearance=CLEARANCE)
    load = numpy.array([1.3 * stiffness * CLEARANCE, 0.0, 0.0, 0.0])

    def before(index, partner, step):
        partner.load = load * (0.5 - 0.5 * numpy.cos(numpy.pi * min(1.0, (index + 1) * step / 5e-3)))

    return disk, before


def blade_off(at):
    """From the time `at` (s) on a blade is missing."""

    def before(index, partner, step):
        partner.unbalance = LOST if (index + 0.5) * step > at else 0.0

    return before


def place_of(run, rotor: Rotor):
    """Displacement of the shaft's centre at the ends of steps, as shares of the clearance, (steps, 2)."""
    return (run.states[:, : rotor.size] / rotor.frequencies) @ rotor.shape[:2].T / CLEARANCE

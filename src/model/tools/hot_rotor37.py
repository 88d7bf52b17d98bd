"""Growth of rotor 37 that turns and is warm, by CalculiX: src/model/tests/data/rotor37_hot_calculix.csv.

    tiprub reduce rotor37 --mesh 16x2x20 --contact-nodes 3 --modes 20 --inp rotor37.inp -o rotor37.rom.safetensors
    python3 src/model/tools/hot_rotor37.py rotor37.inp > src/model/tests/data/rotor37_hot_calculix.csv

Needs ccx (Debian package calculix-ccx) and nothing else of Python than its library.
"""

import pathlib
import subprocess
import sys
import tempfile

SPEED = 1800.0  # rad/s
WARM = 200.0  # K above the temperature without stress
EXPANSION = 10.1e-6  # 1/K, maraging steel as tiprub has it
MODULUS = 180e9  # Pa, cold
SOFTENING = 2.5e-4  # 1/K
LINE = range(103, 3752, 456)  # along the middle of the tip, leading to trailing edge
STATES = {"spin": (SPEED, 0.0, 0.0), "warm": (0.0, WARM, 0.0), "hot": (SPEED, WARM, 0.0), "soft": (SPEED, WARM, SOFTENING)}
HEADER = f"""\
# Rotor 37 turning about the z axis at {SPEED:g} rad/s (spin), {WARM:g} K warm throughout (warm), both (hot), and with a modulus that falls by
# {SOFTENING:g} of itself per kelvin (soft): displacement of nodes along the middle of the tip, from CalculiX 2.20 (Debian package calculix-ccx
# 2.20-1). Blade of 3813 nodes, 640 elements C3D20, hub clamped, E = 180 GPa, nu = 0.3, rho = 8000 kg/m3, alpha = {EXPANSION:g} 1/K.
# linear: *STATIC. nlgeom: *STEP, NLGEOM with residuals to 1e-9. Seven digits are what it prints.
# Written by src/model/tools/hot_rotor37.py, which says how.
analysis,state,node,x,y,z
"""


def deck(model, analysis, state):
    """The exported model with its own steps replaced by one static step."""
    speed, warm, softening = STATES[state]
    text, _ = model.split("*STEP", 1)
    modulus = "*ELASTIC\n{:.12e}, 0.3\n".format(MODULUS * (1.0 - softening * warm))
    start = text.index("*ELASTIC")
    text = text[:start] + modulus + text[text.index("*DENSITY") :]
    text = text.replace("*DENSITY", f"*EXPANSION, ZERO=0.\n{EXPANSION}\n*DENSITY")
    text += "*NSET, NSET=LINE\n" + ",\n".join(str(node) for node in LINE) + "\n"
    text += "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nNALL, 0.\n"
    text += "*STEP, NLGEOM\n" if analysis == "nlgeom" else "*STEP\n"
    text += "*STATIC\n" + ("*CONTROLS, PARAMETERS=FIELD\n1.e-9, 1.e-9\n" if analysis == "nlgeom" else "")
    text += f"*TEMPERATURE\nNALL, {warm}\n"
    if speed:
        text += f"*DLOAD\nEALL, CENTRIF, {speed * speed:.9e}, 0., 0., 0., 0., 0., 1.\n"
    return text + "*NODE PRINT, NSET=LINE\nU\n*END STEP\n"


def displacements(text):
    """Of the last increment that a .dat file holds: node, then x, y, z as printed."""
    last = text.rsplit("displacements", 1)[1].splitlines()
    return [line.split() for line in last if line.split() and line.split()[0].isdigit()]


def main():
    model = pathlib.Path(sys.argv[1]).read_text()
    lines = [HEADER]
    for analysis in ("linear", "nlgeom"):
        for state in STATES:
            with tempfile.TemporaryDirectory() as directory:
                job = pathlib.Path(directory, "job")
                job.with_suffix(".inp").write_text(deck(model, analysis, state))
                subprocess.run(["ccx", "-i", job], check=True, stdout=subprocess.DEVNULL)
                found = displacements(job.with_suffix(".dat").read_text())
            assert len(found) == len(LINE), found
            lines += [",".join([analysis, state, *one]) + "\n" for one in found]
    sys.stdout.write("".join(lines))


main()

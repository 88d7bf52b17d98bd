"""A rub on a shaft: the FMU of tiprub coupled to a whirling beam shaft of ROSS, and to two spools that it brakes.

Studies; all of them run if you name none:
  response   the shaft without rub against ROSS
  errors     the orbit after the loss of a blade, for each H and coupling method
  stability  the longest communication step
  energy     energy and impulse across the coupling
  rollback   bits after restoring a state, in the same and in another process
  blade-off  loss of a blade at speed
  run-up     two spools that a rub brakes
"""

import os

# Matrices are small, so threads of the linear algebra would only wait for each other. Set this before importing NumPy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import sys
import time
from pathlib import Path

import figures
import studies
from coupling import CouplingError
from scenario import CLEARANCE, HERE, Shafts, package

STUDIES = ["response", "errors", "stability", "energy", "rollback", "blade-off", "run-up"]
SCENES = {**dict.fromkeys(["errors", "stability", "energy", "rollback", "blade-off"], "rub"), "run-up": "two_spools"}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", nargs="*", metavar="STUDY", help=f"studies to run: {', '.join(STUDIES)}")
    parser.add_argument("--into", metavar="DIR", type=Path, default=Path("shaft"), help="directory of figures and tables (default: %(default)s)")
    parser.add_argument("--quick", action="store_true", help="use short runs and few steps: fast, but figures are coarse")
    parser.add_argument("--shaft", choices=["ross", "disk"], default="ross", help="beam shaft of ROSS, or a disk on springs that needs no ROSS")
    parser.add_argument("--resume", help=argparse.SUPPRESS)
    found = parser.parse_args()
    unknown = [name for name in found.studies if name not in STUDIES]
    if unknown:
        parser.error(f"no study {', '.join(unknown)}: there are {', '.join(STUDIES)}")
    if found.shaft == "disk" and "response" in found.studies:
        parser.error("response compares with ROSS: leave out --shaft disk")
    return found


class Progress:
    """What is being done, on stderr; how long it took, at the end."""

    def __init__(self):
        self.start = time.perf_counter()

    def __call__(self, what):
        print(f"[{time.perf_counter() - self.start:6.1f} s] {what}", file=sys.stderr, flush=True)


def study(name, asked, shafts, files, say):
    """Tables of one study."""
    rub, quick = files.get("rub"), asked.quick
    if name == "response":
        return studies.response(shafts, say)
    if name == "errors":
        return studies.errors(rub, shafts, quick, say)
    if name == "stability":
        return studies.stability(rub, quick, say)
    if name == "energy":
        return studies.energy(rub, shafts, quick, say)
    if name == "rollback":
        return studies.rollback(rub, shafts, asked.into, quick, say)
    if name == "blade-off":
        return studies.lost_blade(rub, shafts, quick, say)
    return studies.run_up(files["two_spools"], quick, say)


def draw(name, tables, into):
    if name == "errors":
        figures.errors(tables, into)
    elif name == "blade-off":
        figures.blade_off(tables, into, CLEARANCE)
    elif name == "run-up":
        figures.run_up(tables, into)


def main():
    asked = arguments()
    if asked.resume:
        studies.resume(json.loads(asked.resume), Shafts)
        return
    asked.into.mkdir(parents=True, exist_ok=True)
    say, shafts = Progress(), Shafts(asked.shaft)
    chosen = asked.studies or [name for name in STUDIES if asked.shaft == "ross" or name != "response"]
    scenes = {SCENES[name] for name in chosen if name in SCENES}
    if scenes:
        say("packaging the FMUs (models that ship are reduced once)")
    files = {scene: package(HERE / f"{scene}.toml", asked.into) for scene in sorted(scenes)}
    for name in chosen:
        begun = time.perf_counter(), time.process_time()
        tables = study(name, asked, shafts, files, say)
        for table in tables:
            figures.write(table, asked.into)
            if len(table.rows) < 60:
                print(f"\n{name}: {table.name}\n\n{figures.markdown(table)}", flush=True)
        draw(name, tables, asked.into)
        took = time.perf_counter() - begun[0], time.process_time() - begun[1]
        print(f"\n{name} took {took[0]:.0f} s, {took[1]:.0f} s of them on the processor; tables and figures are in {asked.into}", flush=True)


if __name__ == "__main__":
    try:
        main()
    except (CouplingError, ValueError) as error:
        sys.exit(f"error: {error}")

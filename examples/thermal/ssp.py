"""The pair as one file: an SSP 1.0 package, and the tools that run it."""

import contextlib
import csv
import ctypes.util
import io
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, register_namespace, tostring

import numpy
from pair import HEAT, TEMPERATURE, Course

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"


def write(file, rub, casing, patches, stop):
    """`file`.ssp with the FMUs `rub` and `casing`, connected patch by patch. One date for all members: the same bytes each time."""
    register_namespace("ssd", SSD)
    register_namespace("ssc", SSC)
    root = Element(f"{{{SSD}}}SystemStructureDescription", version="1.0", name="thermal_rub", generationTool="examples/thermal of tiprub")
    system = SubElement(root, f"{{{SSD}}}System", name="thermal_rub", description="A rub that heats its casing, which grows")
    elements = SubElement(system, f"{{{SSD}}}Elements")
    ports = {"rub": [(TEMPERATURE, "input"), (HEAT, "output")], "casing": [("casing_heat", "input"), (TEMPERATURE, "output")]}
    for name, connectors in ports.items():
        component = SubElement(elements, f"{{{SSD}}}Component", name=name, type="application/x-fmu-sharedlibrary", source=f"resources/{name}.fmu")
        listed = SubElement(component, f"{{{SSD}}}Connectors")
        for stem, kind in connectors:
            for k in range(1, patches + 1):
                connector = SubElement(listed, f"{{{SSD}}}Connector", name=f"{stem}[{k}]", kind=kind)
                SubElement(connector, f"{{{SSC}}}Real", unit="K" if stem == TEMPERATURE else "W")
    connections = SubElement(system, f"{{{SSD}}}Connections")
    for k in range(1, patches + 1):
        for start, out, end, into in (("rub", HEAT, "casing", "casing_heat"), ("casing", TEMPERATURE, "rub", TEMPERATURE)):
            ends = {"startElement": start, "startConnector": f"{out}[{k}]", "endElement": end, "endConnector": f"{into}[{k}]"}
            SubElement(connections, f"{{{SSD}}}Connection", ends)
    units = SubElement(root, f"{{{SSD}}}Units")
    for name, base in (("K", {"K": "1"}), ("W", {"kg": "1", "m": "2", "s": "-3"})):
        SubElement(SubElement(units, f"{{{SSC}}}Unit", name=name), f"{{{SSC}}}BaseUnit", base)
    SubElement(root, f"{{{SSD}}}DefaultExperiment", startTime="0.0", stopTime=repr(stop))
    indent(root)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo("SystemStructure.ssd"), tostring(root, encoding="UTF-8", xml_declaration=True), zipfile.ZIP_DEFLATED)
        for name, source in (("rub", rub), ("casing", casing)):
            archive.writestr(zipfile.ZipInfo(f"resources/{name}.fmu"), Path(source).read_bytes(), zipfile.ZIP_DEFLATED)


def validate(file):
    """Its system, once it is valid by the schema of SSP 1.0, which FMPy brings."""
    from fmpy.ssp.ssd import read_ssd

    return read_ssd(str(file))


def _course(table, step, count, patches):
    """A course from columns by name, of the points 1 to `count`; both start from 0."""
    columns = [[f"casing.{TEMPERATURE}[{k}]" for k in range(1, patches + 1)], [f"rub.{HEAT}[{k}]" for k in range(1, patches + 1)]]
    found = [numpy.array([table[name] for name in names]).T[:count] for names in columns]
    start = numpy.zeros((1, patches))
    return Course(step * numpy.arange(count + 1), *(numpy.vstack([start, part]) for part in found))


def run_fmpy(file, step, count, patches):
    """By FMPy's `simulate_ssp`: FMI 2.0 only. Its rows are those of the end of a step, under the time of its start."""
    from fmpy.ssp.simulation import simulate_ssp

    with contextlib.redirect_stdout(io.StringIO()):
        found = simulate_ssp(str(file), stop_time=step * (count - 0.5), step_size=step)
    return _course(found, step, count, patches)


# In a process of its own: Ecos ends the process on errors of its own. Its library wants libtbb, which the package tbb brings.
ECOS = """
import ctypes, sys
tbb, file, step, count, *names = sys.argv[1:]
if tbb:
    ctypes.CDLL(tbb, mode=ctypes.RTLD_GLOBAL)
from ecospy import EcosLib, EcosSimulation
with EcosSimulation(ssp_path=file, step_size=float(step)) as simulation:
    simulation.init()
    print(",".join(names))
    for index in range(int(count)):
        simulation.step()
        print(*(repr(simulation.get_real(name.replace(".", "::", 1))) for name in names), sep=",")
"""


def tbb():
    """The library libtbb that Ecos wants, of the package tbb in this environment or of the system; None without."""
    own = next(iter(sorted(Path(sys.prefix).glob("lib/libtbb.so.12"))), None)
    return str(own) if own else ctypes.util.find_library("tbb")


def run_ecos(file, step, count, patches):
    """By Ecos (ecospy)."""
    names = [f"casing.{TEMPERATURE}[{k}]" for k in range(1, patches + 1)] + [f"rub.{HEAT}[{k}]" for k in range(1, patches + 1)]
    command = [sys.executable, "-c", ECOS, tbb() or "", str(file), repr(step), str(count), *names]
    run = subprocess.run(command, capture_output=True, text=True)
    lines = [line for line in run.stdout.splitlines() if line[:1] in "-0123456789" or line.startswith("casing.")]
    if run.returncode != 0 or len(lines) != count + 1:
        raise RuntimeError(f"Ecos ran {file} for {max(0, len(lines) - 1)} of {count} steps (exit code {run.returncode}):\n{run.stderr[-2000:]}{run.stdout[-500:]}")
    rows = list(csv.DictReader(lines))
    return _course({name: [float(row[name]) for row in rows] for name in names}, step, count, patches)

"""A small bar of bricks by Gmsh, and its matrices by CalculiX; see README.md."""
import os, re, shutil, subprocess, tempfile
import gmsh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
point = gmsh.model.geo.addPoint
base = [point(100, -4, -10), point(100, 4, -10), point(100, 4, 10), point(100, -4, 10)]
lines = [gmsh.model.geo.addLine(base[i], base[(i + 1) % 4]) for i in range(4)]
for line, count in zip(lines, (2, 4, 2, 4)):
    gmsh.model.geo.mesh.setTransfiniteCurve(line, count)
face = gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop(lines)])
gmsh.model.geo.mesh.setTransfiniteSurface(face)
gmsh.model.geo.mesh.setRecombine(2, face)
extruded = gmsh.model.geo.extrude([(2, face)], 40, 2, 0, numElements=[3], recombine=True)
gmsh.model.geo.synchronize()
gmsh.model.addPhysicalGroup(2, [face], name="ROOT")
gmsh.model.addPhysicalGroup(2, [extruded[0][1]], name="TIP")
gmsh.model.addPhysicalGroup(3, [extruded[1][1]], name="BAR")
gmsh.model.mesh.generate(3)
gmsh.write("bar.inp")
gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
gmsh.write("bar.msh")
gmsh.option.setNumber("Mesh.Binary", 1)
gmsh.write("bar_binary.msh")
gmsh.finalize()

text, nodes, keep, faces = [], {}, True, {}
kind = None
for line in open("bar.inp"):
    upper = line.upper().replace(" ", "")
    if upper.startswith("*") and not upper.startswith("**"):
        kind = "node" if upper.startswith("*NODE") else "face" if "CPS4" in upper else "root" if "ELSET=ROOT" in upper and upper.startswith("*ELSET") else None
        keep = not ("CPS4" in upper or upper.startswith("*ELSET"))
        root = [] if kind == "root" else (root if "root" in globals() else [])
    elif kind == "face":
        v = [int(x) for x in line.split(",")]
        faces[v[0]] = v[1:]
    elif kind == "root":
        root += [int(x) for x in line.split(",") if x.strip()]
    if keep:
        text.append(line)
held = sorted({n for e in root for n in faces[e]})
volumes = sorted(set(re.findall(r"ELSET=(Volume\d+)", "".join(text))))
deck = "".join(text) + "*NSET, NSET=HELD\n" + ",\n".join(map(str, held)) + "\n*MATERIAL, NAME=STEEL\n*ELASTIC\n210000, 0.3\n*DENSITY\n7.85e-9\n"
deck += f"*SOLID SECTION, ELSET={volumes[0]}, MATERIAL=STEEL\n"
step = "*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n10\n*END STEP\n"
for name, boundary in (("bar", ""), ("bar_held", "*BOUNDARY\nHELD, 1, 3\n")):
    with tempfile.TemporaryDirectory() as directory:
        open(f"{directory}/{name}.inp", "w").write(deck + boundary + step)
        subprocess.run(["ccx", name], cwd=directory, check=True, capture_output=True)
        for extension in ("sti", "mas", "dof"):
            shutil.copy(f"{directory}/{name}.{extension}", ".")

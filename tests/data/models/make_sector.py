"""A sector of a disk of 12 with a blade, by Gmsh; its frequencies by CalculiX. See README.md."""
import math, re, subprocess, tempfile
import gmsh

SECTORS = 12
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
geo = gmsh.model.geo
pitch = 2 * math.pi / SECTORS
RADII, WIDTH, TIP = (60.0, 100.0), 16.0, 130.0
angles = [-pitch / 2, -pitch / 8, pitch / 8, pitch / 2]
at = lambda r, a: geo.addPoint(r * math.cos(a), r * math.sin(a), -WIDTH / 2)
centre = geo.addPoint(0, 0, -WIDTH / 2)
inner = [at(RADII[0], a) for a in angles]
outer = [at(RADII[1], a) for a in angles]
half = RADII[1] * math.sin(pitch / 8)
tip = [at(TIP, s * math.asin(half * 0.7 / TIP)) for s in (-1, 1)]
arcs_in = [geo.addCircleArc(inner[i], centre, inner[i + 1]) for i in range(3)]
arcs_out = [geo.addCircleArc(outer[i], centre, outer[i + 1]) for i in range(3)]
radial = [geo.addLine(inner[i], outer[i]) for i in range(4)]
sides = [geo.addLine(outer[1], tip[0]), geo.addLine(outer[2], tip[1])]
top = geo.addCircleArc(tip[0], centre, tip[1])
faces = [geo.addPlaneSurface([geo.addCurveLoop([arcs_in[i], radial[i + 1], -arcs_out[i], -radial[i]])]) for i in range(3)]
faces.append(geo.addPlaneSurface([geo.addCurveLoop([arcs_out[1], sides[1], -top, -sides[0]])]))
for curves, count in ((arcs_in + arcs_out + [top], 2), (radial, 3), (sides, 4)):
    for curve in curves:
        geo.mesh.setTransfiniteCurve(curve, count)
for face in faces:
    geo.mesh.setTransfiniteSurface(face)
    geo.mesh.setRecombine(2, face)
volumes, low, high, bore, crown = [], [], [], [], []
for index, face in enumerate(faces):
    made = geo.extrude([(2, face)], 0, 0, WIDTH, numElements=[2], recombine=True)
    volumes.append(made[1][1])
    lateral = [tag for _, tag in made[2:]]
    if index < 3:
        bore.append(lateral[0])
    if index == 0:
        low.append(lateral[3])
    if index == 2:
        high.append(lateral[1])
    if index == 3:
        crown.append(lateral[2])
geo.synchronize()
for name, tags in (("BORE", bore), ("LOW", low), ("HIGH", high), ("TIP", crown)):
    gmsh.model.addPhysicalGroup(2, tags, name=name)
gmsh.model.addPhysicalGroup(3, volumes, name="SECTOR")
gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
gmsh.option.setNumber("Mesh.ElementOrder", 2)
gmsh.model.mesh.generate(3)
gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
gmsh.write("sector.msh")
gmsh.write("sector.inp")
print(len(gmsh.model.mesh.getNodes()[0]))

def nodes_of(dim, name):
    for d, tag in gmsh.model.getPhysicalGroups(dim):
        if gmsh.model.getPhysicalName(d, tag) == name:
            return sorted(set(int(n) for n in gmsh.model.mesh.getNodesForPhysicalGroup(d, tag)[0]))

def listed(name, nodes):
    return f"*NSET, NSET={name}\n" + ",\n".join(map(str, nodes)) + "\n"

held = nodes_of(2, "BORE")
keep, text = True, []
for line in open("sector.inp"):
    upper = line.upper().replace(" ", "")
    if upper.startswith("*") and not upper.startswith("**"):
        keep = not ("CPS" in upper or upper.startswith("*ELSET"))
    if keep:
        text.append(line)
names = re.findall(r"ELSET=(Volume\d+)", "".join(text))
deck = "".join(text) + "*ELSET, ELSET=EALL\n" + ",\n".join(dict.fromkeys(names)) + "\n"
deck += listed("HELD", held) + listed("L", [n for n in nodes_of(2, "LOW") if n not in held]) + listed("H", [n for n in nodes_of(2, "HIGH") if n not in held])
deck += "*MATERIAL, NAME=STEEL\n*ELASTIC\n210000, 0.3\n*DENSITY\n7.85e-9\n*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL\n*BOUNDARY\nHELD, 1, 3\n"
deck += "*SURFACE, NAME=SL, TYPE=NODE\nL\n*SURFACE, NAME=SH, TYPE=NODE\nH\n*TIE, NAME=T, CYCLIC SYMMETRY\nSH, SL\n"
deck += f"*CYCLIC SYMMETRY MODEL, N={SECTORS}, TIE=T, ELSET=EALL\n0, 0, 0, 0, 0, 1\n"
deck += "*STEP\n*FREQUENCY\n12\n*SELECT CYCLIC SYMMETRY MODES, NMIN=0, NMAX=6\n*END STEP\n"
with tempfile.TemporaryDirectory() as d:
    open(f"{d}/job.inp", "w").write(deck)
    run = subprocess.run(["ccx", "job"], cwd=d, capture_output=True, text=True)
    dat = open(f"{d}/job.dat").read()
rows, seen = {}, False
for line in dat.splitlines():
    w = line.split()
    if "P A R T I C" in line: seen = False
    if "E I G E N V A L U E   O U T P U T" in line: seen = True
    if seen and len(w) == 6 and w[0].isdigit():
        rows.setdefault(int(w[0]), []).append(float(w[4]))
with open("sector_calculix.csv", "w") as f:
    f.write("# Natural frequencies (Hz) of sector.msh in a disk of 12 by nodal diameter, BORE held: CalculiX 2.20,\n# *SELECT CYCLIC SYMMETRY MODES, which lists every frequency twice: one of each pair is kept\nnodal_diameter,f1,f2,f3,f4\n")
    for n, fr in sorted(rows.items()):
        f.write(f"{n}," + ",".join(f"{x:.7E}" for x in sorted(fr)[0:8:2]) + "\n")
print(run.stdout[-400:], dat[:1500])
print(open("sector_calculix.csv").read())

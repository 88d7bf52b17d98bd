"""Frequencies of the committed meshes by CalculiX; writes frequencies_calculix.csv."""
import re, subprocess, sys, os, tempfile
KINDS = ["tet4", "tet10", "penta6", "penta15", "hex8", "hex20"]

def deck(path):
    out, keep, elsets = [], True, []
    for line in open(path):
        if line.startswith("*") and not line.startswith("**"):
            up = line.upper()
            keep = not (up.startswith("*ELEMENT") and "CPS" in up)
            m = re.match(r"\*ELSET\s*,\s*ELSET=(\w+)", up)
            keep = keep and not m
        if keep:
            out.append(line)
    return "".join(out)

def root(path):
    nodes, grab = set(), None
    elements, ids, cur = {}, [], None
    for line in open(path):
        up = line.upper().strip()
        if up.startswith("*"):
            cur = None
            m = re.match(r"\*ELEMENT\s*,\s*TYPE=CPS(\d)", up)
            if m: cur = ("e", int(m.group(1)), [])
            elif up.startswith("*ELSET,ELSET=ROOT"): cur = ("s",)
            continue
        v = [int(x) for x in line.replace(" ", "").strip().strip(",").split(",") if x]  if cur else None
        if cur and cur[0] == "e":
            cur[2].extend(v)
            while len(cur[2]) > cur[1]:
                elements[cur[2][0]] = cur[2][1:cur[1]+1]
                del cur[2][:cur[1]+1]
        elif cur: ids += v
    return sorted({n for i in ids for n in elements[i]})

rows = []
for kind in KINDS:
    path = f"blade_{kind}.inp"
    text = deck(path) + "*NSET, NSET=HELD\n" + ",\n".join(map(str, root(path))) + "\n"
    text += "*ELSET, ELSET=ALL\nVolume1, Volume2\n*MATERIAL, NAME=STEEL\n*ELASTIC\n210000, 0.3\n*DENSITY\n7.85e-9\n*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL\n*BOUNDARY\nHELD, 1, 3\n*STEP\n*FREQUENCY\n10\n*END STEP\n"
    with tempfile.TemporaryDirectory() as d:
        open(f"{d}/job.inp", "w").write(text)
        r = subprocess.run(["ccx", "job"], cwd=d, capture_output=True, text=True)
        dat = open(f"{d}/job.dat").read()
    fr = []
    for line in dat.splitlines():
        w = line.split()
        if len(w) == 5 and w[0].isdigit(): fr.append(float(w[3]))
        if "P A R T I C" in line: break
    rows.append((kind, fr[:10]))
    print(kind, fr[:10])
with open("frequencies_calculix.csv", "w") as f:
    f.write("# Natural frequencies (Hz) by CalculiX 2.20, *FREQUENCY, of the meshes beside this file; ROOT held, see README.md\n")
    f.write("mesh," + ",".join(f"f{i+1}" for i in range(10)) + "\n")
    for k, fr in rows: f.write(k + "," + ",".join(f"{x:.7E}" for x in fr) + "\n")

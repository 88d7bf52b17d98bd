"""Small blade-like meshes, written by Gmsh; see README.md."""
import sys, math
import gmsh

NAMES = {"tet4": ("tet", 1), "tet10": ("tet", 2), "penta6": ("penta", 1), "penta15": ("penta", 2), "hex8": ("hex", 1), "hex20": ("hex", 2)}

def build(shape, order):
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("blade")
    g = gmsh.model.geo
    # Tapered, twisted plate: root at r = 0.20 m, tip on the cylinder r = 0.26 m; axis z. Millimetres, as many CAD files are.
    stations = [(200.0, 40.0, 6.0, 25.0), (230.0, 36.0, 4.5, 33.0), (260.0, 32.0, 3.0, 40.0)]
    def corner(r, chord, thick, angle, u, v):
        c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
        a, b = u * chord / 2, v * thick / 2
        z, t = a * c - b * s, a * s + b * c
        return math.sqrt(r * r - t * t), t, z
    rings = []
    for st in stations:
        rings.append([g.addPoint(*corner(*st, u, v)) for u, v in [(-1, -1), (1, -1), (1, 1), (-1, 1)]])
    lines = [[g.addLine(ring[i], ring[(i + 1) % 4]) for i in range(4)] for ring in rings]
    up = [[g.addLine(rings[k][i], rings[k + 1][i]) for i in range(4)] for k in range(2)]
    caps = [g.addPlaneSurface([g.addCurveLoop(l)]) if False else g.addSurfaceFilling([g.addCurveLoop(l)]) for l in lines]
    sides = [[g.addSurfaceFilling([g.addCurveLoop([lines[k][i], up[k][(i + 1) % 4], -lines[k + 1][i], -up[k][i]])]) for i in range(4)] for k in range(2)]
    vols = [g.addVolume([g.addSurfaceLoop([caps[k], caps[k + 1], *sides[k]])]) for k in range(2)]
    nc, nt, ns = 6, 2, 4
    for k in range(3):
        for i in range(4):
            g.mesh.setTransfiniteCurve(lines[k][i], (nc if i % 2 == 0 else nt) + 1)
    for k in range(2):
        for i in range(4):
            g.mesh.setTransfiniteCurve(up[k][i], ns + 1)
    for s in caps + [s for side in sides for s in side]:
        g.mesh.setTransfiniteSurface(s)
    for v in vols:
        g.mesh.setTransfiniteVolume(v)
    if shape == "hex":
        for s in caps + [s for side in sides for s in side]:
            g.mesh.setRecombine(2, s)
    if shape == "penta":
        # Prisms: triangles on the faces along the thickness, quadrilaterals on the others.
        for k in range(3):
            g.mesh.setRecombine(2, caps[k])
        for side in sides:
            for i in (1, 3):
                g.mesh.setRecombine(2, side[i])
    g.synchronize()
    gmsh.model.addPhysicalGroup(2, [caps[0]], name="ROOT")
    gmsh.model.addPhysicalGroup(2, [caps[2]], name="TIP")
    gmsh.model.addPhysicalGroup(3, vols, name="BLADE")
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    gmsh.model.mesh.generate(3)

if __name__ == "__main__":
    for name in sys.argv[1:] or NAMES:
        build(*NAMES[name])
        kinds = [gmsh.model.mesh.getElementProperties(t)[0] for t in gmsh.model.mesh.getElementTypes(3)]
        print(name, kinds, len(gmsh.model.mesh.getNodes()[0]))
        gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 0)
        gmsh.write(f"blade_{name}.inp")
        gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
        gmsh.option.setNumber("Mesh.Binary", 0)
        gmsh.write(f"blade_{name}.msh")
        if name in ("tet10", "hex20"):
            gmsh.option.setNumber("Mesh.Binary", 1)
            gmsh.write(f"blade_{name}_binary.msh")
        gmsh.finalize()

"""Fit the NASA rotor 37 blade by 12 compact sections and write them as Rust.

    python fit_rotor37.py rotor37geometry.dat ../src/rotor37/sections.rs ../tests/data/rotor37_sample.csv

The input is the blade coordinate table of NASA TP-1659 (Moore and Reid, 1980), table IV, as text: for each of
13 surfaces of revolution 100 lines `J Z R THETA1 THETA2` (cm, rad). Surface 13 (intersection with the shroud)
is not used. Needs numpy and scipy.

Each section lies on a surface of revolution and is described in the conformal plane of that surface,
X = R0 * integral(ds / r) along the meridian and Y = R0 * theta, R0 the section's mean radius, in which circles of
the surface stay circles. Its parts: z(X) and r(X) as Chebyshev series; the leading- and trailing-edge circles;
and, in the chord frame (from circle centre to circle centre, abscissa u = 0..1), camber and half thickness as
cubic B-splines with the same knots.
"""

import sys

import numpy as np
from scipy.interpolate import make_lsq_spline
from scipy.optimize import least_squares

SECTIONS = 12
MILLIMETRE = 1e-3
SPLINE_END = 0.005  # the splines live on [-SPLINE_END, 1 + SPLINE_END] of the chord
SIDE_TOLERANCE = 8e-3  # mm, knots are added until the sides are this close
CIRCLE_TOLERANCE = 3e-3  # mm, points this close to a common circle belong to the edge


def read_table(path):
    surfaces = []
    for line in open(path):
        words = line.split()
        if "SURFACE NUMBER" in line:
            surfaces.append([])
        elif surfaces and len(words) == 5 and words[0].isdigit():
            surfaces[-1].append([float(word) for word in words[1:]])
    table = np.array(surfaces)[:SECTIONS]
    assert table.shape == (SECTIONS, 100, 4), table.shape
    return table * np.array([10.0, 10.0, 1.0, 1.0])  # cm -> mm


def fit_circle(points):
    centre = points.mean(axis=0)
    residual = lambda c: np.hypot(points[:, 0] - c[0], points[:, 1] - c[1]) - c[2]
    solution = least_squares(residual, [*centre, 0.2], xtol=1e-14, ftol=1e-14).x
    return solution, np.abs(residual(solution)).max()


def edge_circle(side1, side2):
    """The circle through the most points of the two sides, counted from the nose."""
    best = None
    for count1 in range(4, 19):
        for count2 in range(4, 19):
            circle, error = fit_circle(np.vstack([side1[:count1], side2[:count2]]))
            total = count1 + count2
            if error < CIRCLE_TOLERANCE and (best is None or (total, -error) > (best[0], -best[1])):
                best = (total, error, circle, (count1, count2))
    return best[2], best[3], best[1]


def fit_sides(sides):
    """Cubic splines with common knots, refined where either side is worst."""
    knots = list(np.linspace(0.0, 1.0, 7)[1:-1])
    while True:
        full = np.r_[[-SPLINE_END] * 4, knots, [1.0 + SPLINE_END] * 4]
        splines = [make_lsq_spline(side[:, 0], side[:, 1], full) for side in sides]
        errors = [np.abs(spline(side[:, 0]) - side[:, 1]) for spline, side in zip(splines, sides)]
        worst = int(np.argmax([error.max() for error in errors]))
        if errors[worst].max() < SIDE_TOLERANCE:
            return knots, splines, errors[worst].max()
        assert len(knots) < 30
        place = sides[worst][errors[worst].argmax(), 0]
        edges = np.r_[-SPLINE_END, knots, 1.0 + SPLINE_END]
        index = np.searchsorted(edges, place)
        knots = sorted(knots + [0.5 * (edges[index - 1] + edges[index])])


def fit_section(points):
    z, r, theta1, theta2 = points.T
    mean_radius = r.mean()
    step = np.hypot(np.diff(z), np.diff(r)) / (0.5 * (r[1:] + r[:-1]))
    x = mean_radius * np.r_[0.0, np.cumsum(step)]
    domain = [x[0] - 0.1, x[-1] + 0.1]
    z_series = np.polynomial.Chebyshev.fit(x, z, 8, domain=domain)
    r_series = np.polynomial.Chebyshev.fit(x, r, 12, domain=domain)
    side1, side2 = np.c_[x, mean_radius * theta1], np.c_[x, mean_radius * theta2]
    leading, leading_counts, leading_error = edge_circle(side1, side2)
    trailing, trailing_counts, trailing_error = edge_circle(side1[::-1], side2[::-1])
    chord = np.hypot(*(trailing - leading)[:2])
    along = (trailing - leading)[:2] / chord
    across = np.array([-along[1], along[0]])
    sides = []
    for index, side in enumerate((side1, side2)):
        middle = side[leading_counts[index] - 1 : len(side) - trailing_counts[index] + 1] - leading[:2]
        local = np.c_[middle @ along / chord, middle @ across]
        sides.append(local[np.argsort(local[:, 0])])
    knots, splines, side_error = fit_sides(sides)
    return {
        "mean_radius": mean_radius,
        "domain": domain,
        "z": z_series.coef,
        "r": r_series.coef,
        "leading_edge": leading,
        "trailing_edge": trailing,
        "knots": np.array(knots),
        "camber": 0.5 * (splines[0].c + splines[1].c),
        "half_thickness": 0.5 * (splines[0].c - splines[1].c),
        "errors": (leading_error, trailing_error, side_error),
    }


def array(values, scale=1.0, digits=9):
    # 8 significant places of a metre are 0.01 micrometre; trailing zeros are dropped.
    texts = [np.format_float_positional(value * scale, precision=digits, trim="-") for value in values]
    return "[" + ", ".join(text if "." in text else text + ".0" for text in texts) + "]"


def number(value):
    return array([value], MILLIMETRE)[1:-1]


def write_rust(path, sections):
    with open(path, "w") as out:
        out.write("//! Coefficients of the twelve sections of the rotor 37 blade, hub to tip. Lengths in m.\n//!\n")
        out.write("//! Written by `tools/fit_rotor37.py` from the coordinate table of NASA TP-1659 (table IV); do not edit.\n")
        out.write("#![cfg_attr(rustfmt, rustfmt_skip)]\n\nuse super::section::Section;\n\n")
        out.write("/// Sections 1 (intersection with the hub) to 12 (blade tip) of NASA TP-1659.\n")
        out.write(f"pub(super) static SECTIONS: [Section; {SECTIONS}] = [\n")
        for s in sections:
            out.write("    Section {\n")
            out.write(f"        mean_radius: {number(s['mean_radius'])},\n")
            out.write(f"        meridional_range: {array(s['domain'], MILLIMETRE)},\n")
            for name in ("z", "r"):
                out.write(f"        {name}: {array(s[name], MILLIMETRE)},\n")
            for name in ("leading_edge", "trailing_edge"):
                out.write(f"        {name}: {array(s[name], MILLIMETRE)},\n")
            out.write(f"        knots: &{array(s['knots'])},\n")
            for name in ("camber", "half_thickness"):
                out.write(f"        {name}: &{array(s[name], MILLIMETRE)},\n")
            out.write("    },\n")
        out.write("];\n")


def write_sample(path, table):
    """Every seventh station and both noses: what the tests of the crate compare with."""
    stations = [0, 4, 9, 15, 22, 29, 36, 43, 50, 57, 64, 71, 78, 85, 90, 95, 99]
    with open(path, "w") as out:
        out.write("# Thinned copy of NASA TP-1659 (Moore and Reid, 1980), table IV: blade geometry of rotor 37.\n")
        out.write("# surface 1 is the intersection with the hub, 12 the tip; z and r in cm, theta in rad.\n")
        out.write("surface,j,z,r,theta1,theta2\n")
        for index, section in enumerate(table):
            for j in stations:
                z, r, theta1, theta2 = section[j]
                out.write(f"{index + 1},{j + 1},{z / 10:.7f},{r / 10:.7f},{theta1:.7f},{theta2:.7f}\n")


def main():
    source, rust, sample = sys.argv[1:]
    table = read_table(source)
    sections = [fit_section(points) for points in table]
    for index, section in enumerate(sections):
        print(f"section {index + 1}: edges {section['errors'][0]:.4f} {section['errors'][1]:.4f}, "
              f"sides {section['errors'][2]:.4f} mm, {len(section['knots'])} knots")
    write_rust(rust, sections)
    write_sample(sample, table)


if __name__ == "__main__":
    main()

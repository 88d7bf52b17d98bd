"""The paper's method for identical blades in a rigid casing with two bumps, with dense matrices in NumPy.

Central differences with forward-increment Lagrange multipliers (section 4.3, eqs 9 to 11). The directory given as the argument contains
scene.json and matrices.bin (64-bit numbers, row by row: mass, stiffness, damping, contact map, tips). The script writes the displacements of all
contact rows at the end of each sample to displacements.bin and prints the processor time of the steps (s).
"""

import json
import sys
import time
from pathlib import Path

import numpy as np


def casing_shape(angle, now, height, width, ramp):
    """Returns the change of the casing radius (m) and its slope (m/rad)."""
    away = (np.mod(angle, np.pi) / np.pi - 0.5) / width
    bump = -height * np.exp(-(away**2))
    grown = 1.0 if now >= ramp else 0.5 * (1.0 - np.cos(np.pi * now / ramp))
    return grown * bump, grown * bump * -2.0 * away / (np.pi * width)


def main(directory):
    scene = json.loads((directory / "scene.json").read_text())
    order, nodes, blades = scene["order"], scene["nodes"], scene["sectors"]
    h, speed, friction = scene["step"], scene["speed"], scene["friction"]
    values = np.fromfile(directory / "matrices.bin", dtype="<f8")
    shapes = [(order, order)] * 3 + [(3 * nodes, order), (nodes, 3)]
    ends = np.cumsum([rows * columns for rows, columns in shapes])
    parts = np.split(values, ends[:-1])
    mass, stiffness, damping, contact, tips = (part.reshape(shape) for part, shape in zip(parts, shapes))
    radius, angle, meridional = (column[:, None] for column in tips.T)
    angle = angle + 2.0 * np.pi * np.arange(blades) / blades

    # Products that do not change from step to step.
    inertia, viscous = mass / h**2, damping / (2.0 * h)
    solve = np.linalg.inv(inertia + viscous)
    first, second = solve @ (2.0 * inertia - stiffness), solve @ (viscous - inertia)
    response = solve @ contact.T
    compliance = (contact @ response).reshape(nodes, 3, nodes, 3)

    now, before = np.zeros((order, blades)), np.zeros((order, blades))
    samples = []
    start = time.process_time()
    for step in range(1, scene["samples"] * scene["steps_per_sample"] + 1):
        # Equation 9: displacements without contact.
        predicted = first @ now + second @ before
        radial, tangential, axial = (contact @ predicted).reshape(nodes, 3, blades).transpose(1, 0, 2)
        # Equation 3: gaps at the predicted displacements.
        shape, slope = casing_shape(angle + speed * h * step + tangential / radius, h * step, *scene["bumps"])
        distance = scene["clearance"] + shape - radial + meridional * axial
        for blade in np.flatnonzero((distance < 0.0).any(axis=0)):
            closed = np.flatnonzero(distance[:, blade] < 0.0)
            gradient = np.stack(
                [-np.ones(len(closed)), slope[closed, blade] / radius[closed, 0], meridional[closed, 0]], axis=1
            )
            length = np.linalg.norm(gradient, axis=1, keepdims=True)
            normal = gradient / length
            along = np.array([0.0, 1.0, 0.0]) - normal[:, 1:2] * normal
            force = normal - friction * along / np.linalg.norm(along, axis=1, keepdims=True)
            # Equations 10 and 11: multipliers that close the gaps, and corrected displacements.
            gaps = distance[closed, blade] / length[:, 0]
            delassus = np.einsum("ia,iajb,jb->ij", normal, compliance[closed][:, :, closed], force)
            multipliers = np.linalg.solve(delassus, -gaps)
            rows = (3 * closed[:, None] + np.arange(3)).ravel()
            predicted[:, blade] += response[:, rows] @ (force * multipliers[:, None]).ravel()
        now, before = predicted, now
        if step % scene["steps_per_sample"] == 0:
            samples.append(contact @ now)
    seconds = time.process_time() - start
    np.concatenate(samples).astype("<f8").tofile(directory / "displacements.bin")
    print(json.dumps({"seconds": seconds}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""A flexible casing written as a ROM file by hand, as docs/rom-file.md describes the format."""

import json
import struct

import numpy

AROUND, ALONG, PATCHES = 24, 3, 4


def write_rom(path, arrays, metadata):
    """safetensors: length of the header (8 bytes, little-endian), the header as JSON, the arrays one after the other."""
    header, data = {"__metadata__": metadata}, b""
    for name, array in arrays.items():
        content = numpy.ascontiguousarray(array, dtype="<f8").tobytes()
        header[name] = {"dtype": "F64", "shape": list(array.shape), "data_offsets": [len(data), len(data) + len(content)]}
        data += content
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + data)


def read_rom(path):
    """Arrays and metadata of a ROM file."""
    content = path.read_bytes()
    (length,) = struct.unpack("<Q", content[:8])
    header = json.loads(content[8 : 8 + length])
    metadata, data = header.pop("__metadata__"), content[8 + length :]
    array = lambda entry: numpy.frombuffer(data[slice(*entry["data_offsets"])], dtype="<f8").reshape(entry["shape"])
    return {name: array(entry) for name, entry in header.items()}, metadata


def write_ring(path, along=ALONG, length=0.04):
    """Breathing and the pairs of two to four nodal diameters of a steel ring of 2 kg, each straight and tilting in z."""
    angle = 2 * numpy.pi * numpy.arange(AROUND) / AROUND
    axial = numpy.linspace(0.0, length, along)
    modes, frequencies = [], []
    for order, frequency in [(0, 3300.0), (2, 180.0), (3, 420.0), (4, 800.0)]:
        for tilt in (0, 1):
            for phase in (0.0, numpy.pi / 2)[: 1 if order == 0 else 2]:
                share = (axial - 0.5 * length) / (0.5 * length) if tilt else numpy.ones(along)
                radial = numpy.outer(share, numpy.cos(order * angle - phase))
                tangential = -numpy.outer(share, numpy.sin(order * angle - phase)) / max(order, 1)
                modes.append(numpy.stack([radial, tangential, 0.0 * radial], axis=-1).reshape(-1, 3))
                frequencies.append(frequency * (1.5 if tilt else 1.0))
    n = len(modes)
    z = numpy.repeat(axial, AROUND)
    positions = numpy.stack([0.2545 - 0.27 * z, numpy.tile(angle, along), z], axis=-1)
    edges = 2 * numpy.pi * numpy.arange(PATCHES + 1) / PATCHES
    patches = numpy.stack([edges[:-1], edges[1:], 0.0 * edges[:-1], length + 0.0 * edges[:-1]], axis=-1)
    # Heat lifts the radius of its patch: 11.7e-6 1/K times the stiffness of the shape.
    stiffness = 2.0 * (2 * numpy.pi * numpy.array(frequencies)) ** 2
    middle = 0.5 * (edges[:-1] + edges[1:])
    heat = [[1.0 if order == 0 else numpy.cos(order * at - phase) for at in middle]
            for order in (0, 2, 3, 4) for _ in (0, 1) for phase in (0.0, numpy.pi / 2)[: 1 if order == 0 else 2]]
    loads = 11.7e-6 * 0.25 / PATCHES * stiffness[:, None] * numpy.array(heat)
    arrays = {
        "mass": 2.0 * numpy.eye(n),
        "stiffness": numpy.diag(stiffness),
        "contact_map": numpy.stack(modes, axis=-1),
        "contact_positions": positions,
        "thermal_loads": loads,
        "thermal_patches": patches,
    }
    metadata = {
        "format": "tiprub-rom", "format_version": "1", "name": "ring", "origin": "shapes of a ring", "sectors": "1",
        "frame": "cylindrical", "damping_ratio": "0.01", "contact_grid": f"{AROUND},{along}",
    }
    write_rom(path, arrays, metadata)

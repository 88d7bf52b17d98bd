"""Write ROM files from NumPy arrays, without other packages."""

from __future__ import annotations

import json
import os
import re
import struct
import tempfile
from pathlib import Path
from typing import Any, Union

import numpy

from ._program import Error, call, called, place, text

#: Entries of the file that are text; all others are arrays.
ENTRIES = {"origin", "contact_names", "largest_speed", "contact_grid", "watched_names", "stress_names", "basis", "contact_rows",
           "rub_errors", "rub_errors_found_on", "units"}


def rom(
    path: Union[str, "os.PathLike[str]"],
    mass: Any,
    stiffness: Any,
    contact_map: Any,
    contact_positions: Any,
    *,
    name: str,
    sectors: int = 1,
    frame: str = "cylindrical",
    damping_ratio: float = 0.0,
    check: bool = True,
    **more: Any,
) -> Path:
    """Write the reduced-order model of a structure from matrices of any program.

    With `n` reduced coordinates q of one sector: M q'' + D q' + K q = Cᵀ f and u = C q.

    Parameters
    ----------
    path : path
        ROM file, by convention NAME.rom.safetensors. An existing file is replaced, unless the new one is rejected.
    mass : array_like, shape (n, n), kg
        M: symmetric, positive definite.
    stiffness : array_like, shape (n, n), N/m
        K: symmetric, positive semidefinite.
    contact_map : array_like, shape (nodes, 3, n), m per unit coordinate
        C: displacement components of each contact node caused by each coordinate.
    contact_positions : array_like, shape (nodes, 3), m, rad, m or m
        (r, theta, z) with `frame="cylindrical"`, (x, y, z) with `frame="cartesian"`.
    name : str
        Name of the structure.
    sectors : int
        Number of identical sectors around the axis.
    frame : {"cylindrical", "cartesian"}
        Directions of positions and displacements.
    damping_ratio : float
        Modal damping ratio, at least 0 and below 1.
    check : bool
        Let the program check the file, so that errors are raised here, before an existing file is replaced.
    **more
        Other arrays or entries of the format by name: `contact_names=["le", "te"]`, `contact_grid=(24, 3)`,
        `stiffness_speed2=K1`, ... For coupled sectors, `mass_3`, `stiffness_3`, `contact_map_3` and so on are complex
        arrays of shapes (m, m), (m, m) and (nodes, 3, m).

    Returns
    -------
    pathlib.Path
        Path of the ROM file.

    Raises
    ------
    Error
        The program rejects the file, a value is neither a number nor text, or the file cannot be written.
    """
    arrays = {"mass": mass, "stiffness": stiffness, "contact_map": contact_map, "contact_positions": contact_positions}
    arrays.update((key, item) for key, item in more.items() if key not in ENTRIES)
    path = place("path", path)
    entries = {"format": "tiprub-rom", "format_version": "1", "name": name, "sectors": sectors,
               "frame": frame, "damping_ratio": damping_ratio}
    entries.update((key, item) for key, item in more.items() if key in ENTRIES)
    header: dict[str, Any] = {"__metadata__": {key: entry(f"{path}: `{key}`", item) for key, item in entries.items()}}
    data = []
    end = 0
    for key, item in arrays.items():
        try:
            content = array(key, item)
        except (TypeError, ValueError) as error:
            raise Error(f"{path}: array `{key}`", f"is not an array of numbers: {error}", "Give numbers, or see docs/rom-file.md for its name") from None
        header[key] = {"dtype": "F64", "shape": list(content.shape), "data_offsets": [end, end + content.nbytes]}
        end += content.nbytes
        data.append(content.tobytes())
    head = json.dumps(header).encode()
    head += b" " * (-len(head) % 8)
    # Written beside the target under the same name, so that an existing file is unchanged until the new one is valid. Links are followed.
    try:
        file = Path(os.path.realpath(path))
        with tempfile.TemporaryDirectory(prefix=".tiprub-", dir=file.parent) as own:
            new = Path(own) / file.name
            new.write_bytes(b"".join([struct.pack("<Q", len(head)), head, *data]))
            if check:
                with called(path, new):
                    call(["inspect"], [str(new)], quiet=True)
            os.replace(new, file)
    except (OSError, ValueError) as error:
        problem = getattr(error, "strerror", None) or error
        raise Error(path, f"cannot be written: {problem}", "Give a file in a directory that is there and may be written to") from None
    return Path(path)


def array(key: str, item: Any) -> numpy.ndarray:
    """Convert an array to the form of the file; the last axis of complex arrays holds real and imaginary parts."""
    found = numpy.asarray(item)
    if found.dtype.kind not in "biufc":
        raise TypeError(f"dtype {found.dtype}")
    coupled = re.fullmatch(r"(mass|stiffness|contact_map)_[0-9]+", key)
    if numpy.iscomplexobj(found) or (coupled and found.ndim == (3 if coupled[1] == "contact_map" else 2)):
        found = numpy.stack([found.real, found.imag], axis=-1)
    # ascontiguousarray would turn a number into a vector.
    return numpy.array(found, dtype="<f8", order="C")


def entry(what: str, item: Any) -> str:
    """Convert an entry to text; several words or numbers are separated by commas."""
    item = item.tolist() if hasattr(item, "tolist") else item
    found = ",".join(text(what, one) for one in item) if isinstance(item, (list, tuple)) else text(what, item)
    if not found:
        raise Error(what, "is empty", "Give a text, or leave it out", 2)
    return found

"""Scenes: files, built-in scenes, TOML text and dicts."""

from __future__ import annotations

import contextlib
import json
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any, Iterator, Mapping, Union

from ._program import Error, called, place, text

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

Scene = Union[str, "os.PathLike[str]", Mapping[str, Any]]
BUILTIN = "builtin:"


def rom_place(rom: Any, directory: Path) -> Any:
    """Return the path of a model for a scene in another directory; values that are not paths stay unchanged."""
    if not isinstance(rom, (str, os.PathLike)):
        return rom
    name = place("scene: rom", rom)
    return name if name.startswith(BUILTIN) else str(directory / name)


def value(where: str, item: Any) -> str:
    """Convert a value of a scene to one line of TOML; errors name `where`."""
    if isinstance(item, Mapping):
        return "{ " + ", ".join(f"{quoted(str(key))} = {value(f'{where}.{key}', one)}" for key, one in item.items()) + " }"
    if isinstance(item, (str, os.PathLike)):
        return quoted(place(where, item))
    if hasattr(item, "tolist"):
        item = item.tolist()
    if isinstance(item, (list, tuple)):
        return "[" + ", ".join(value(f"{where}[{index}]", one) for index, one in enumerate(item, 1)) + "]"
    return text(where, item)


def quoted(string: str) -> str:
    """Quote a string for TOML: as in JSON, except for one character that JSON does not escape."""
    return json.dumps(string, ensure_ascii=False).replace("\x7f", "\\u007f")


def toml(scene: Mapping[str, Any]) -> str:
    """Convert a scene to TOML: plain values first, then a table or an array of tables for each other key."""
    tables = {key: item for key, item in scene.items() if isinstance(item, Mapping)}
    arrays = {key: item for key, item in scene.items()
              if isinstance(item, (list, tuple)) and item and all(isinstance(one, Mapping) for one in item)}
    def lines(where: str, table: Mapping[str, Any]) -> str:
        return "".join(f"{quoted(str(key))} = {value(f'{where}{key}', item)}\n" for key, item in table.items())
    parts = [lines("scene: ", {key: item for key, item in scene.items() if key not in tables and key not in arrays})]
    parts += [f"\n[[{quoted(str(key))}]]\n{lines(f'scene: {key}[{index}].', one)}"
              for key, item in arrays.items() for index, one in enumerate(item, 1)]
    parts += [f"\n[{quoted(str(key))}]\n{lines(f'scene: {key}.', item)}" for key, item in tables.items()]
    return "".join(parts)


#: Comments and strings of TOML, the only tokens that can contain the delimiters of others; a string may follow `rom =` in a table or inline.
TOKEN = re.compile(r"""\#[^\n]*|(?P<key>(?<![\w.-])(?:"rom"|'rom'|rom)[ \t]*=[ \t]*)?"""
                   r"""(?P<string>\"{3}(?:\\.|[^\\])*?\"{3,5}|'{3}.*?'{3,5}|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')""", re.DOTALL)


def placed(token: "re.Match[str]", directory: Path) -> str:
    """Adapt a TOML token to a scene in another directory, with the same number of lines."""
    if token["key"] is None:
        return token[0]
    try:
        name = tomllib.loads(f"rom = {token['string']}")["rom"]
    except tomllib.TOMLDecodeError:
        # The program reports this error with its place.
        return token[0]
    found = quoted(rom_place(name, directory))
    lines = token["string"].count("\n")
    return token["key"] + (f'""{found[0]}' + "\\\n" * lines + f'{found[1:]}""' if lines else found)


def as_text(scene: Union[str, Mapping[str, Any]], directory: Path) -> str:
    """Convert a scene that is not a file to TOML; relative paths of its ROMs refer to `directory`."""
    if isinstance(scene, str):
        return TOKEN.sub(lambda token: placed(token, directory), scene)
    def structure(one: Any) -> Any:
        return {**one, "rom": rom_place(one["rom"], directory)} if isinstance(one, Mapping) and "rom" in one else one
    structures = scene.get("structure")
    return toml({**scene, "structure": list(map(structure, structures))} if isinstance(structures, (list, tuple)) else scene)


@contextlib.contextmanager
def scene_file(scene: Scene, directory: Union[str, "os.PathLike[str]"] = ".") -> Iterator[str]:
    """Return the scene as a command-line argument. Other forms than files are written to a temporary file, which errors call `scene`.

    Raises
    ------
    Error
        The scene has none of these forms, or contains an invalid value.
    """
    if isinstance(scene, os.PathLike) or (isinstance(scene, str) and "\n" not in scene):
        yield place("scene", scene)
        return
    if not isinstance(scene, (str, Mapping)):
        remedy = "Give a file, `builtin:NAME`, TOML text of several lines, or a dict"
        raise Error("scene", f"is of type {type(scene).__name__}", remedy, 2)
    try:
        content = as_text(scene, Path(place("keyword `directory`", directory)).absolute()).encode()
    except UnicodeEncodeError as error:
        raise Error("scene", f"is not valid text: {error}", "Use UTF-8 names", 2) from None
    with tempfile.TemporaryDirectory(prefix="tiprub-") as own:
        path = Path(own) / "scene.toml"
        path.write_bytes(content)
        with called("scene", path):
            yield str(path)

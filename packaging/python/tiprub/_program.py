"""Run the program `tiprub` and read its results."""

from __future__ import annotations

import contextlib
import difflib
import html
import inspect
import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import threading
from pathlib import Path
from types import MappingProxyType
from typing import Any, Iterable, Iterator, Mapping, Optional, Sequence

import numpy


class Error(Exception):
    """Failure of a command, with the message of the command line.

    Attributes
    ----------
    what : str
        Subject of the problem: a file, an option, a scene field.
    problem : str
        The problem.
    remedy : str
        The remedy; empty if the problem already contains it.
    exit_code : int
        1: the work failed; 2: the request is wrong.
    """

    # Tracebacks show the name that callers use.
    __module__ = "tiprub"

    def __init__(self, what: str, problem: str, remedy: str = "", exit_code: int = 1) -> None:
        super().__init__(what, problem, remedy, exit_code)
        self.what, self.problem, self.remedy, self.exit_code = what, problem, remedy, exit_code

    def __str__(self) -> str:
        def sentence(text: str) -> str:
            text = text.rstrip()
            return text if text.endswith(("?", "...")) else text.rstrip(".") + "."

        return " ".join(sentence(text) for text in [f"{self.what}: {self.problem}", self.remedy] if text)


class Report(dict):
    """Result of a command: a dict with the keys of `tiprub COMMAND --json`.

    It can be used as the path of the file or directory that was written or read, wherever Python accepts a path, and as `rom` of a scene.

    Attributes
    ----------
    path : pathlib.Path or None
        That file or directory; None for built-in models and scenes.
    """

    def __init__(self, values: Mapping[str, Any], path: Optional[Path] = None) -> None:
        super().__init__(values)
        self.path = path

    @property
    def warnings(self) -> list[str]:
        """Warnings of the command."""
        return self.get("warnings") or (self.get("scene") or {}).get("warnings") or []

    def __fspath__(self) -> str:
        if self.path is None:
            raise TypeError("this report stands for no file")
        return str(self.path)

    def _repr_html_(self) -> str:
        title = "" if self.path is None else f"<b>{html.escape(str(self.path))}</b>"
        return title + as_html(self)


#: Largest number of list items that notebooks show.
MOST_SHOWN = 12


def as_html(value: Any) -> str:
    """Return JSON values as nested HTML tables."""
    if isinstance(value, dict):
        rows = (f"<tr><th style='text-align:left'>{html.escape(str(key))}</th>"
                f"<td style='text-align:left'>{as_html(item)}</td></tr>" for key, item in value.items())
        return f"<table>{''.join(rows)}</table>"
    if isinstance(value, list):
        between = "<br>" if any(isinstance(item, (dict, list, str)) for item in value) else ", "
        more = [f"… {len(value)} in all"] if len(value) > MOST_SHOWN else []
        return between.join([as_html(item) for item in value[:MOST_SHOWN]] + more)
    return html.escape(f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value))


def program() -> str:
    """Return the program: the one that TIPRUB names, else the one installed with this module, else the one on PATH."""
    named = os.environ.get("TIPRUB")
    if named:
        return named
    name = "tiprub.exe" if os.name == "nt" else "tiprub"
    user = sysconfig.get_path("scripts", f"{os.name}_user")
    # The last directory is that of `pip install --target`.
    for directory in [sysconfig.get_path("scripts"), user, Path(__file__).resolve().parents[1] / "bin"]:
        if (Path(directory) / name).is_file():
            return str(Path(directory) / name)
    found = shutil.which("tiprub")
    if found is None:
        raise Error("tiprub", "the program is not installed", "Install the wheel, or name the program in the environment variable TIPRUB")
    return found


#: Options that are not available as keywords, with the alternatives.
INSTEAD = {
    "csv": "The result is a pandas.DataFrame: write it with its `to_csv`",
    "help": "Call Python's help, such as help(tiprub.run), or `tiprub COMMAND --help`",
    "json": "Leave it out: the answer is a Python object",
    "out": "`study` and `demo` take `out`, `package` and `reduce` take `output`",
    "output": "`package` and `reduce` take `output`, `study` and `demo` take `out`; a result of `run` has `to_csv`",
    "set": "`run` and `study` take `set`; elsewhere write start values into the scene",
    "version": "Use tiprub.__version__",
}


#: Keywords whose option has another name, by option.
KEYWORDS = {"platform": "platforms"}


def options(own: Mapping[str, Any], more: Mapping[str, Any] = MappingProxyType({}), function: str = "") -> list[str]:
    """Convert keywords to options: `contact_nodes=3` is `--contact-nodes=3`, True gives an option without value, several values repeat it.

    Raises
    ------
    Error
        A keyword of `more` is also in `INSTEAD` or among the `own` options of `function`, or a value has a wrong type.
    """
    for key in more:
        if key in own or key in INSTEAD:
            remedy = INSTEAD.get(key, "See the function's help for the keyword that does the same")
            raise Error(f"keyword `{key}`", "is not an argument of this function", remedy, 2)
    words = []
    for key, value in {**own, **more}.items():
        option = "--" + key.replace("_", "-")
        value = value.tolist() if hasattr(value, "tolist") else value
        several = isinstance(value, Iterable) and not isinstance(value, (str, bytes, Mapping, os.PathLike))
        for one in value if several else [value]:
            if one is True:
                words.append(option)
            elif several or (one is not None and one is not False):
                # The program rejects misspelled keywords. A value without a text form never reaches it, so such a keyword is checked here.
                if key in more and not is_text(one) and similar_keyword(key, function):
                    raise unknown_keyword(key, [function])
                words.append(f"{option}={text(f'keyword `{KEYWORDS.get(key, key) if key in own else key}`', one)}")
    return words


def similar_keyword(name: str, function: str, option: Optional[str] = None) -> Optional[str]:
    """Return the keyword of a function of this module that is similar to `name`, or else the keyword of the `option` that the program proposes."""
    known = getattr(sys.modules[__package__], function, None)
    names = [] if known is None else [keyword for keyword in inspect.signature(known).parameters if keyword != "more"]
    keyword = option.replace("-", "_") if option else None
    return next(iter(difflib.get_close_matches(name, names, 1, 0.75)), keyword if keyword in names or keyword not in INSTEAD else None)


def unknown_keyword(name: str, command: Sequence[str], option: Optional[str] = None) -> Error:
    """Return the error for a keyword that neither the function nor the command has; `option` is the similar option that the program proposes."""
    similar = similar_keyword(name, command[0], option)
    remedy = f"See help(tiprub.{command[0]}) and `tiprub {' '.join(command)} --help`"
    return Error(f"keyword `{name}`", f"tiprub.{command[0]} has no such argument", f"Did you mean `{similar}`? {remedy}" if similar else remedy, 2)


def kind_of(kind: Any) -> str:
    """Check the kind of a reduction or study, which must not be an option."""
    if not isinstance(kind, str) or not kind or kind.startswith("-"):
        raise Error("kind", f"{kind!r} is not a kind of reduction or study", "See `tiprub reduce --help` or `tiprub study --help`", 2)
    return kind


def assignments(values: Optional[Mapping[str, Any]]) -> list[str]:
    """Convert start values to options; an array becomes a list in brackets, whose length the program checks."""
    if not isinstance(values, (Mapping, type(None))):
        raise Error("keyword `set`", f"is of type {type(values).__name__}", 'Give a dict of names and values, such as {"speed": 1700.0}', 2)
    return [f"--set={name}={start_value(f'keyword `set`, `{name}`', value)}" for name, value in (values or {}).items()]


def start_value(what: str, value: Any) -> str:
    """Convert a number, a word or a one-dimensional array to text."""
    try:
        # asarray would drop masks.
        array = numpy.asanyarray(value)
    except ValueError:
        # Rows of different lengths.
        array = numpy.empty((0, 0))
    if array.ndim == 0:
        return text(what, array.item())
    if array.ndim > 1 or array.size == 0 or array.dtype.kind not in "biuf":
        raise Error(what, "is not a list of numbers", "Give a number, or a number for each element of an array", 2)
    return "[" + ",".join(text(what, one) for one in array.tolist()) + "]"


def text(what: str, value: Any) -> str:
    """Convert a value to text for the command line and TOML; numbers keep their bits. Errors name `what`."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if not is_text(value):
        raise Error(what, f"is of type {type(value).__name__}", "Give a number, a text or a truth value", 2)
    if isinstance(value, (str, os.PathLike)):
        return place(what, value)
    if isinstance(value, bool):
        return str(value).lower()
    return repr(int(value) if isinstance(value, int) else float(value))


def is_text(value: Any) -> bool:
    """Return whether `text` accepts a value."""
    return isinstance(value.tolist() if hasattr(value, "tolist") else value, (str, os.PathLike, int, float))


def place(what: str, value: Any) -> str:
    """Convert a path to text. Errors name `what`."""
    if isinstance(value, (str, os.PathLike)):
        # A report may have no file.
        with contextlib.suppress(TypeError):
            return os.fsdecode(value)
    raise Error(what, f"is not a path (type {type(value).__name__})", "Give the path of a file or directory", 2)


@contextlib.contextmanager
def called(name: str, file: "os.PathLike[str]") -> Iterator[None]:
    """Replace the temporary file in errors by the name that the user knows."""
    try:
        yield
    except Error as error:
        words = (part.replace(str(file), name) for part in (error.what, error.problem, error.remedy))
        raise Error(*words, error.exit_code) from None


@contextlib.contextmanager
def _interrupts_wait() -> Iterator[None]:
    """Delay an interrupt (Ctrl-C) until the end of the context.

    An interrupt within `subprocess.Popen` would lose the process that it has just started.
    """
    previous = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield
        return
    waiting: list[tuple[int, Any]] = []
    signal.signal(signal.SIGINT, lambda number, frame: waiting.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)
        if waiting:
            previous(*waiting[0])


def call(words: Sequence[str], files: Iterable[str] = (), quiet: bool = False) -> dict[str, Any]:
    """Run a command and return its JSON object.

    Progress and warnings are printed on stderr, also in a notebook; `quiet` suppresses them. Errors are raised and not printed.

    Raises
    ------
    Error
        The command failed.
    """
    command = [program(), "--json", *(["--quiet"] if quiet else []), *words, *(["--", *files] if files else [])]
    # A terminal shows progress bars; a Python stream, as in a notebook, shows lines.
    inherited = sys.stderr is sys.__stderr__ and sys.stderr is not None
    stderr = subprocess.DEVNULL if quiet else None if inherited else subprocess.PIPE
    environment = {**os.environ, "TIPRUB_ERRORS_IN_JSON": "1"}
    with tempfile.TemporaryFile() as answer:
        process = None
        try:
            with _interrupts_wait():
                process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=answer, stderr=stderr, env=environment)
            for line in process.stderr or ():
                if sys.stderr is not None:
                    sys.stderr.write(line.decode("utf-8", "replace"))
            process.wait()
        except BaseException as error:
            if process is not None:
                process.kill()
                process.wait()
            elif isinstance(error, ValueError):
                raise Error("tiprub", f"cannot be run: {error}", "Use names and values without zero bytes", 2) from None
            elif isinstance(error, OSError):
                raise Error(command[0], f"cannot be started: {error}", "Name the program in the environment variable TIPRUB") from error
            raise
        finally:
            if process is not None and process.stderr is not None:
                process.stderr.close()
        answer.seek(0)
        content = answer.read()
    try:
        result = json.loads(content)
    except ValueError:
        raise Error("tiprub", f"ended with {process.returncode} and without an answer", "See what it says on stderr") from None
    if "error" in result and process.returncode != 0:
        error = result["error"]
        unknown = re.fullmatch("unexpected argument '--(.+)' found", error["problem"])
        if unknown:
            proposed = re.search("similar argument exists: '--(.+?)'", error["remedy"])
            kind = itertools.takewhile(lambda word: not word.startswith("--"), words)
            raise unknown_keyword(unknown[1].replace("-", "_"), list(kind), proposed[1] if proposed else None)
        raise Error(error["what"], error["problem"], error["remedy"], error["exit_code"])
    return result

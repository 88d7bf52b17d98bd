#!/usr/bin/env python3
"""Run the cases of the gallery and write its page, with a picture and a paragraph for each case.

All cases run if you name none. The page is gallery.md, and the pictures are in the directory images beside it.
"""

import os

# The matrices are small, so threads of the linear algebra would only wait for each other. This must be set before NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import datetime
import sys
import time
from pathlib import Path
from textwrap import fill

HERE = Path(__file__).resolve().parent
NAMES = ["rub", "wear", "thermal", "whirl", "flutter", "stage", "cube", "mesh", "sweep", "map"]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"cases to run [default: all]: {', '.join(NAMES)}")
    parser.add_argument("--into", type=Path, default=Path("gallery"), help="directory for the page, pictures and results [default: gallery]")
    given = parser.parse_args()
    unknown = [name for name in given.cases if name not in NAMES]
    if unknown:
        parser.error(f"unknown case {unknown[0]!r}: choose from {', '.join(NAMES)}")
    return given


def wrapped(text):
    """Return the text with lines of at most 160 characters, except for code."""
    paragraphs = [part if part.startswith("    ") else fill(part, 160, break_long_words=False, break_on_hyphens=False) for part in text.strip("\n").split("\n\n")]
    return "\n\n".join(paragraphs)


def case_title(name):
    """Return the title of a case."""
    return (HERE / f"{name}.md").read_text(encoding="utf-8").split("\n", 1)[0].removeprefix("# ")


def contents(names):
    """Return the list of contents of the page, with a link to each case."""
    return "\n".join(f"* [{case_title(name)}](#{case_title(name).lower().replace(' ', '-')})" for name in names)


def section(name, facts):
    """Return the section of the page about one case: its text with the numbers of the run, its picture and its scene."""
    title, text = case_title(name), (HERE / f"{name}.md").read_text(encoding="utf-8").format_map(facts).split("\n", 1)[1]
    return f"""## {title}

![{title}](images/gallery-{name}.png)

<!-- written: examples/run.sh gallery {name}; {datetime.date.today()}, version {facts["version"]} -->
{wrapped(text)}
<!-- end -->

<details><summary>{name}.toml</summary>

```toml
{(HERE / f"{name}.toml").read_text(encoding="utf-8").strip()}
```

</details>
"""


def main():
    given = arguments()
    try:
        from cases import CASES, ERRORS, Work, command, tiprub
    except ImportError as error:
        sys.exit(f"error: {error}. Start with examples/run.sh gallery, or run: pip install -r {HERE / 'requirements.txt'}")
    title, text = (HERE / "page.md").read_text(encoding="utf-8").split("\n", 1)
    names = given.cases or NAMES
    parts = [f"{title}\n\n{wrapped(text).replace('{contents}', contents(names))}\n"]
    started = time.monotonic()
    try:
        # The code of the other examples runs the same program.
        os.environ["TIPRUB"] = tiprub.program()
        version = command("--version").split()[-1]
        for number, name in enumerate(names, 1):
            begun = time.monotonic()
            print(f"{number} of {len(names)}: {name} ...", end="", file=sys.stderr, flush=True)
            parts.append(section(name, {"version": version, **CASES[name](Work(name, given.into))}))
            print(f" {time.monotonic() - begun:.0f} s", file=sys.stderr)
            (given.into / "gallery.md").write_text("\n".join(parts), encoding="utf-8")
    except ERRORS as error:
        print(file=sys.stderr)
        sys.exit(f"error: {error}")
    print(f"written: {given.into / 'gallery.md'}, {time.monotonic() - started:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()

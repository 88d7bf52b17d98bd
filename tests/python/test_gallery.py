"""The gallery: its page states the numbers and shows the scenes of examples/gallery. Two quick cases are run again."""

import os
import re
import subprocess
import sys

import numpy
import pytest
from PIL import Image

from conftest import ROOT

GALLERY = ROOT / "examples" / "gallery"
PAGE = ROOT / "docs" / "gallery.md"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?")


def sections(page):
    """Text of each case by its name, without headings and comments."""
    texts = re.findall(r"<!-- written: examples/run.sh gallery (\w+); 20\S+, version \S+ -->\n(.*?)\n<!-- end -->", page, re.DOTALL)
    return {name: " ".join(text.split()) for name, text in texts}


def run(*words, **environment):
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment}, check=False)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Directory with the page and the pictures of the two cases."""
    into = tmp_path_factory.mktemp("gallery")
    done = run(GALLERY / "gallery.py", "rub", "cube", "--into", into)
    assert done.returncode == 0, done.stderr
    assert "2 of 2: cube ..." in done.stderr
    return into


def digits(number):
    """Value of one unit in the last shown digit."""
    mantissa, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


@pytest.mark.parametrize("name", ["rub", "cube"])
def test_page_of_the_guide_is_up_to_date(made, name):
    shown, again = (sections(page.read_text(encoding="utf-8"))[name] for page in (PAGE, made / "gallery.md"))
    assert NUMBER.sub("#", shown) == NUMBER.sub("#", again)
    for old, new in zip(NUMBER.findall(shown), NUMBER.findall(again)):
        # A rounded number may differ by one in its last digit on another processor.
        assert abs(float(old) - float(new)) <= 1.01 * digits(old), f"{old} in docs/gallery.md, {new} now: run {GALLERY / 'gallery.py'}"


def test_text_has_the_numbers_of_the_run(made, tiprub):
    texts = sections((made / "gallery.md").read_text(encoding="utf-8"))
    rub, cube = (tiprub("run", GALLERY / f"{name}.toml") for name in ("rub", "cube"))
    assert f"{rub['answer']['heat']:.0f} J of friction heat" in texts["rub"]
    assert f"brakes the rotor with {-rub['answer']['torque']:.1f} N m on average" in texts["rub"]
    assert f"{rub['extremes']['largest_total_normal_force']['value']:.0f} N" in texts["rub"]
    assert f"up to {rub['extremes']['most_contacts']['value']:.0f} of the 648" in texts["rub"]
    assert f"{-cube['last']['cube.velocity_y']:.2f} m/s" in texts["cube"]
    assert f"Friction heat is {cube['answer']['heat']:.0f} J, which" in texts["cube"]


@pytest.mark.parametrize("name", ["rub", "cube"])
def test_pictures_are_not_empty(made, name):
    with Image.open(made / "images" / f"gallery-{name}.png") as picture:
        pixels = numpy.asarray(picture.convert("L"))
    height, width = pixels.shape
    assert width > 800 and height > 400
    # The 3-D view in the left half, and the diagram in the right half.
    for half in (pixels[:, : width // 2], pixels[:, width // 2 :]):
        assert (half < 230).mean() > 0.03 and len(numpy.unique(half)) > 100


def test_every_case_is_on_the_page():
    page = PAGE.read_text(encoding="utf-8")
    scenes = {path.stem: path.read_text(encoding="utf-8") for path in GALLERY.glob("*.toml")}
    assert set(sections(page)) == set(scenes) and len(scenes) == 10
    for name, scene in scenes.items():
        assert len(scene.splitlines()) <= 20, name
        assert f"```toml\n{scene.strip()}\n```" in page, f"{name}.toml differs from docs/gallery.md"
        assert f"images/gallery-{name}.png" in page
        title = (GALLERY / f"{name}.md").read_text(encoding="utf-8").split("\n", 1)[0].removeprefix("# ")
        assert f"* [{title}](#{title.lower().replace(' ', '-')})\n" in page and f"\n## {title}\n" in page
    assert "(python.md#notebooks)" in page
    sizes = [(ROOT / "docs" / "images" / f"gallery-{name}.png").stat().st_size for name in scenes]
    assert min(sizes) > 20_000 and sum(sizes) < 1_200_000


@pytest.mark.parametrize(("name", "words"), [("rubb", "Examples: gallery shaft thermal."), ("rub", "examples/run.sh gallery rub")])
def test_unknown_example_is_rejected_with_the_known_names(name, words):
    done = subprocess.run([ROOT / "examples" / "run.sh", name], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and f"there is no example `{name}`" in done.stderr and words in done.stderr, done.stderr


def test_errors_state_problem_and_remedy(tmp_path):
    done = run(GALLERY / "gallery.py", "rubb", "--into", tmp_path)
    assert done.returncode == 2 and "unknown case 'rubb': choose from rub, wear" in done.stderr
    done = run(GALLERY / "gallery.py", "rub", "--into", tmp_path, TIPRUB=str(tmp_path / "none"))
    assert done.returncode == 1 and "cannot be started" in done.stderr and "Set TIPRUB" in done.stderr
    assert "Traceback" not in done.stderr
    done = run("-S", GALLERY / "gallery.py", "rub", "--into", tmp_path)
    assert done.returncode == 1 and "No module named" in done.stderr and "examples/run.sh gallery" in done.stderr

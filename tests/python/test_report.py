"""The report in headless Chromium: no error occurs, the animation is drawn, sliders change it, and the page fits a phone."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

BROWSER = Path(__file__).parent / "browser.py"
# Number of different colours, and a checksum of the picture.
PICTURE = """
const canvas = document.querySelector("#viewer canvas"), gl = canvas.getContext("webgl2");
const pixels = new Uint8Array(4 * canvas.width * canvas.height);
gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
const colors = new Set(), words = new Uint32Array(pixels.buffer); let sum = 0, filled = 0, hot = 0;
for (let i = 0; i < words.length; i++) {
  colors.add(words[i]); sum = (31 * sum + words[i]) % 4294967291; if (words[i]) filled++;
  if (pixels[4 * i + 3] > 200 && pixels[4 * i] > 200 && pixels[4 * i + 2] < 120) hot++;
}
return { colors: colors.size, sum, filled: filled / words.length, hot };
"""
PAUSE = 'const button = document.querySelector(".play"); if (button.textContent === "Pause") button.click();'


def slide(name, value):
    """JavaScript that moves a slider and sends its event."""
    return f'const own = document.querySelector("input[name={name}]"); own.value = {value}; own.dispatchEvent(new Event("input", {{ bubbles: true }}));'


def started(page, *expressions, width=1400, height=900, scheme="light"):
    command = [sys.executable, str(BROWSER), str(page), str(width), str(height), scheme, *expressions]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


def browse(page, *expressions, **options):
    """Run expressions in the page, and check that its console shows no error."""
    result = started(page, *expressions, **options)
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout.strip().splitlines()[-1])
    assert answer["problem"] is None, answer
    errors = [message for message in answer["console"] if message["level"] != "InfoMessageLevel"]
    assert not errors, errors
    return answer["results"]


@pytest.fixture(scope="module")
def browser(work):
    """Skip the tests if no browser with WebGL 2 can run here."""
    page = work / "empty.html"
    page.write_text("<!DOCTYPE html><title>empty</title>")
    result = started(page, 'return !!document.createElement("canvas").getContext("webgl2");')
    reason = (result.stderr.strip().splitlines() or ["no message"])[-1]
    if result.returncode != 0:
        pytest.skip(f"no browser can run here (exit code {result.returncode}): {reason}")
    if json.loads(result.stdout.strip().splitlines()[-1])["results"] != [True]:
        pytest.skip("the browser has no WebGL 2 here")


@pytest.fixture(scope="module")
def reports(browser, tiprub, scene, work):
    """Reports of blades in a rigid casing, with a shape file and without, of an elastic casing and of a free body."""
    pages = {name: work / f"{name}.html" for name in ("rotor", "nodes", "casing", "cube")}
    tiprub("run", scene, "--report", pages["rotor"])
    alone = work / "alone"
    alone.mkdir()
    for file in (scene, work / "rotor37.rom.safetensors"):
        (alone / file.name).write_bytes(file.read_bytes())
    tiprub("run", alone / scene.name, "--report", pages["nodes"])
    tiprub("run", "builtin:flexible-casing", "--report", pages["casing"])
    tiprub("run", "builtin:cube-between-rings", "--stop", "0.001", "--report", pages["cube"])
    return pages


@pytest.mark.parametrize("name", ["rotor", "nodes", "casing", "cube"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_animation_is_drawn_without_errors(reports, name, scheme):
    (ready, _, picture) = browse(reports[name], 'return document.getElementById("viewer").dataset.ready;', PAUSE, PICTURE, scheme=scheme)
    assert ready == "true"
    if name == "nodes":
        assert picture["filled"] > 0.01 and picture["colors"] > 20, picture
    else:
        assert picture["filled"] > 0.1 and picture["colors"] > 200, picture


def test_sliders_and_views_change_the_picture(reports):
    results = browse(
        reports["rotor"],
        PAUSE,
        slide("time", 0),
        PICTURE,
        slide("time", 900),
        PICTURE,
        slide("scale", 1000),
        PICTURE,
        'document.querySelector("input[value=blade]").click();',
        PICTURE,
        'const canvas = document.querySelector("#viewer canvas"); canvas.focus();'
        'canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true }));',
        PICTURE,
        slide("time", 0),
        slide("scale", 0),
        'document.querySelector("input[value=all]").click();',
        PICTURE,
        'return [...document.querySelectorAll("input[type=range]")].map(own => own.getAttribute("aria-valuetext"));',
    )
    pictures = [result for result in results if isinstance(result, dict)]
    assert len(pictures) == 6
    sums = [picture["sum"] for picture in pictures]
    assert len(set(sums)) == len(sums), sums
    time, scale = results[-1]
    assert time.endswith(" ms") and float(time.split()[0]) >= 0 and scale == "×1"


def test_contacts_light_up(reports):
    """Contacts are orange at the time of the largest force, and nothing is orange at the start of the run."""
    (_, _, before, _, during) = browse(
        reports["rotor"],
        PAUSE,
        slide("time", 0),
        PICTURE,
        'const path = document.querySelector(".strip path").getAttribute("d").split("L").slice(1, -1).map(pair => pair.split(" ").map(Number));'
        "const peak = path.reduce((most, point) => point[1] < most[1] ? point : most);"
        'const own = document.querySelector("input[name=time]"); own.value = 2 * peak[0]; own.dispatchEvent(new Event("input"));',
        PICTURE,
    )
    assert during["hot"] > before["hot"] + 20, (before, during)


def test_animation_plays_and_pauses(reports):
    clock = 'return document.querySelector("input[name=time]").value;'
    (first, second, _, third, fourth) = browse(reports["rotor"], clock, clock, PAUSE, clock, clock)
    assert first != second and third == fourth


@pytest.mark.parametrize("name", ["rotor", "nodes", "casing", "cube"])
@pytest.mark.parametrize("width", [400, 700, 1000, 1400, 1900])
def test_page_fits_its_width(reports, name, width):
    measure = """
    const wide = document.documentElement.clientWidth, outside = [];
    for (const own of document.querySelectorAll("body *")) {
      const box = own.getBoundingClientRect();
      if (box.width > 0 && box.right > wide + 1 && !own.closest(".numbers, pre")) outside.push(own.tagName + "." + own.className);
    }
    return { scroll: document.documentElement.scrollWidth, wide, outside: outside.slice(0, 5) };
    """
    (found,) = browse(reports[name], measure, width=width, height=800)
    assert found["scroll"] <= found["wide"] and not found["outside"], found


def test_controls_have_labels_and_figures_have_captions(reports):
    (controls, figures) = browse(
        reports["rotor"],
        'return [...document.querySelectorAll("#viewer button, #viewer input, #viewer select, #viewer canvas")].map(own => [own.tagName, (own.labels?.[0] ?? own).textContent || own.getAttribute("aria-label"), own.tabIndex]);',
        'return [...document.querySelectorAll("figure")].map(own => own.querySelector("figcaption").textContent.length);',
    )
    assert len(controls) >= 7 and all(label and index >= 0 for _, label, index in controls), controls
    assert len(figures) >= 6 and min(figures) > 40

"""The page that runs a rub in the browser: bits, controls, errors and layout."""

import base64
import csv
import os
import re
import shutil
import subprocess
import zipfile

import numpy
import pytest

from conftest import ROOT
from test_report import browse, browser, slide  # noqa: F401 (a fixture)

TARGET = "wasm32-unknown-unknown"
SCENE = ROOT / "src" / "gallery" / "scenes" / "rotor37.toml"
# Reads the rows of a run as bytes, and the five numbers.
RUN = """
const rows = tryIt.state.rows, bytes = new Uint8Array(8 * tryIt.WIDTH * rows.length);
rows.forEach((row, index) => bytes.set(new Uint8Array(row.buffer, row.byteOffset, row.byteLength), 8 * tryIt.WIDTH * index));
let text = "";
for (let i = 0; i < bytes.length; i += 4096) text += String.fromCharCode(...bytes.subarray(i, i + 4096));
return { names: tryIt.NAMES, rows: btoa(text), numbers: tryIt.state.numbers, worker: tryIt.state.inWorker,
  shown: [...document.querySelectorAll(".numbers dd[data-name]")].map(own => own.textContent), command: document.querySelector(".command").textContent };
"""
# Speed (rad/s), friction and clearance (µm) of the sliders. With the last setting, no blade touches.
SETTINGS = [(1800, 0.15, 356), (1100, 0.34, 330), (2240, 0.04, 300), (1800, 0.0, 356), (1800, 0.15, 440)]


@pytest.fixture(scope="module")
def page(browser, tiprub, work):  # noqa: F811
    """The page, with the ROM of the FMU of the built-in scene."""
    root = subprocess.run(["rustc", "--print", "sysroot"], capture_output=True, text=True, check=False) if shutil.which("rustc") else None
    if root is None or not os.path.isdir(os.path.join(root.stdout.strip(), "lib", "rustlib", TARGET)):
        pytest.skip(f"the Rust target {TARGET} is not installed: rustup target add {TARGET}")
    library = ["--library", os.environ["TIPRUB_LIBRARY"]] if "TIPRUB_LIBRARY" in os.environ else []
    fmu = work / "try_it.fmu"
    tiprub("package", "builtin:rotor37", "--fmi", "2", "-o", fmu, *library)
    rom = work / "try_it.rom.safetensors"
    with zipfile.ZipFile(fmu) as archive:
        rom.write_bytes(archive.read("resources/rotor.rom.safetensors"))
    file = work / "rub.html"
    subprocess.run([ROOT / "packaging" / "try_it.sh", file, rom], check=True)
    return file


def move_sliders(speed, friction, clearance):
    """Return JavaScript that moves the sliders."""
    return "".join(f"{{ {slide(name, value)} }}" for name, value in [("speed", speed), ("friction", friction), ("clearance", clearance)])


def decode_rows(run):
    return numpy.frombuffer(base64.b64decode(run["rows"])).reshape(-1, len(run["names"]) + 1)


def read_table(file):
    with file.open(newline="") as lines:
        names, *rows = csv.reader(lines)
    return names, numpy.array(rows, dtype=float)


def bits(values):
    return numpy.ascontiguousarray(values).view(numpy.uint64)


@pytest.fixture(scope="module")
def runs(page):
    """Runs of the page, one for each setting."""
    expressions = [expression for setting in SETTINGS for expression in [move_sliders(*setting), RUN]]
    return [result for result in browse(page, *expressions) if result]


@pytest.fixture(scope="module")
def scene_of_the_page(work):
    """The built-in scene, with the outputs of every blade."""
    file = work / "try_it.toml"
    file.write_text(re.sub(r"(?m)^(watched_sectors = .*)$", r"\1\nall_sectors = true", SCENE.read_text()))
    return file


@pytest.mark.parametrize("index", range(len(SETTINGS)))
def test_page_has_the_bits_of_the_program(runs, tiprub, scene_of_the_page, work, index):
    run, (speed, friction, clearance) = runs[index], SETTINGS[index]
    settings = ["--set", f"speed={speed}", "--set", f"friction_coefficient={friction}", "--set", f"gap_offset={clearance - 356}e-6"]
    summary = tiprub("run", scene_of_the_page, "--csv", work / "try_it.csv", *settings)
    names, native = read_table(work / "try_it.csv")
    found = decode_rows(run)
    columns = [names.index(name) for name in ["time", *run["names"]]]
    assert len(columns) > 75 and found.shape == (1051, len(columns))
    different = (bits(found) != bits(native[:, columns])).any(axis=0)
    assert not different.any(), [names[column] for column, differs in zip(columns, different) if differs]
    answer = {name: value for name, value in summary["answer"].items() if name in run["numbers"]}
    assert len(answer) == 5 and run["numbers"] == answer
    # Blades rub with friction, unless the setting excludes contact or friction.
    forces = found[:, 1 + run["names"].index("normal_impulse")]
    assert forces.any() == (clearance < 420) and (summary["answer"]["heat"] > 0) == (clearance < 420 and friction > 0)


def test_command_on_the_page_gives_its_numbers(runs, tiprub):
    """The command does not request the outputs of every blade, but prints the same five numbers as the page."""
    words = runs[1]["command"].replace("\\\n", " ").split()
    assert words[:3] == ["tiprub", "run", "builtin:rotor37"] and words.count("--set") == 3
    assert tiprub(*words[1:])["answer"] == runs[1]["numbers"]


def test_other_settings_have_other_bits(runs):
    """Every slider has an effect, so the comparison of bits is not trivial."""
    first = bits(decode_rows(runs[0]))
    for run in runs[1:]:
        assert (bits(decode_rows(run))[:, 1:] != first[:, 1:]).any(axis=0).mean() > 0.5


def test_page_without_workers_has_the_same_bits(page, runs):
    (_, inside) = browse(page, 'tryIt.start(null, false);', RUN)
    assert runs[0]["worker"] and not inside["worker"]
    assert inside["rows"] == runs[0]["rows"] and inside["shown"] == runs[0]["shown"]


def test_page_stays_responsive_while_it_computes(page):
    """Frames are drawn during a run, even if it runs in the page instead of a worker."""
    count = "window.frames_drawn = 0; window.longest = 0; let last = performance.now(); (function next(now) { if (document.body.dataset.busy === 'true') { frames_drawn++; longest = Math.max(longest, performance.now() - last); } last = performance.now(); requestAnimationFrame(next); })();"
    for worker in ["true", "false"]:
        results = browse(page, f"tryIt.start(null, {worker});", count + slide("speed", 1500), "return [frames_drawn, longest, tryIt.state.done];")
        frames, longest, done = results[-1]
        assert done and frames >= 5 and longest < 1000, results  # ms


def test_errors_are_shown_and_the_page_starts_again(page):
    """The page shows a rejected value, a wrong scene and a module that stops. It then starts again."""
    wrong = 'tryIt.state.engine({ kind: "run", id: tryIt.state.id, values: { speed: NaN } });'
    wait = 'document.body.dataset.busy = "true";'
    read_note = 'const own = document.querySelector(".note"); return { shown: !own.hidden, text: own.querySelector("span").textContent };'
    again = 'document.querySelector(".again").click();'
    broken = 'tryIt.start("speed = ", true);'
    # The module cannot allocate a file of this size: it panics and traps.
    huge = "tryIt.start({ length: 4e9 }, true);"
    causes = [wait + wrong, broken, huge]
    results = browse(page, *(expression for cause in causes for expression in (cause, read_note, again, read_note)))
    notes = results[1::2]
    assert [note["shown"] for note in notes] == [True, False] * 3, notes
    rejected, scene, trapped = (note["text"] for note in notes[::2])
    assert "speed" in rejected and "scene" in scene and "the simulation stopped" in trapped and "capacity" in trapped, notes


@pytest.mark.parametrize("width", [400, 700, 1000, 1400])
def test_page_fits_its_width(page, width):
    measure = """
    const wide = document.documentElement.clientWidth;
    const outside = [...document.querySelectorAll("body *")].filter(own => own.getBoundingClientRect().width > 0 && own.getBoundingClientRect().right > wide + 1);
    return { scroll: document.documentElement.scrollWidth, wide, outside: outside.map(own => own.tagName + "." + own.className).slice(0, 5) };
    """
    (found,) = browse(page, measure, width=width, height=800)
    assert found["scroll"] <= found["wide"] and not found["outside"], found


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pictures_are_drawn_and_change_with_time(page, scheme):
    picture = """
    return [...document.querySelectorAll("canvas")].map(canvas => {
      const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
      copy.drawImage(canvas, 0, 0);
      const data = new Uint32Array(copy.getImageData(0, 0, canvas.width, canvas.height).data.buffer);
      return [new Set(data).size, data.reduce((sum, word) => (31 * sum + word) % 4294967291, 0)];
    });
    """
    (_, first, _, second) = browse(page, slide("time", 0), picture, slide("time", 627), picture, scheme=scheme)
    assert len(first) == 3 and all(colors > 5 for colors, _ in first), first
    assert all(before[1] != after[1] for before, after in zip(first, second))


def test_run_button_plays_and_pauses(page):
    clock, press = 'return Number(document.querySelector("input[name=time]").value);', 'document.querySelector(".play").click();'
    (_, _, start, later, _, first, second) = browse(page, slide("time", 0), press, clock, clock, press, clock, clock)
    assert later > start and first == second


def test_controls_have_labels(page):
    (labels,) = browse(page, 'return [...document.querySelectorAll("button, input, canvas, progress")].map(own => (own.labels?.[0] ?? own).textContent.trim() || own.getAttribute("aria-label"));')
    assert len(labels) >= 10 and all(labels), labels


def test_book_shows_the_page_in_a_frame_of_its_height(page):
    """The script of the book replaces the picture with the page, even if the book is opened from a file."""
    script = (ROOT / "docs" / "try-it.js").read_text()
    link = re.search(r'(?s)<a href="rub.html" id="try-it">.*?</a>', (ROOT / "docs" / "try-it.md").read_text()).group()
    book = page.with_name("book.html")
    book.write_text(f'<!DOCTYPE html><title>book</title><main style="width: 750px">{link}</main><script>{script}</script>')
    read_frame = 'const frame = document.querySelector("iframe"); return [frame.src.split("/").pop(), frame.offsetHeight, document.querySelectorAll("a").length];'
    name, height, links = browse(book, "", "", read_frame)[-1]
    assert name == page.name == "rub.html" and links == 0
    assert 900 < height < 2000 and height != 1400

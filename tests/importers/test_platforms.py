"""One .fmu on Linux, on Windows (wine) and on 64-bit Arm (qemu): the same bits in every output."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
from conftest import LIBRARIES, TARGET, tiprub

# Scene and communication steps: some of each rub.
SCENES = {
    "rotor37": 60,
    "rotor37-paper": 200,
    "flexible-casing": 40,
    "stage-nodes": 3,
    "cube-between-rings": 10,
    "abradable": 40,
}
SYSROOT = Path("/usr/aarch64-linux-gnu")


def driver(platform):
    """Command that drives an FMU on a platform, or the reason why not."""
    program = TARGET / "drivers" / f"{platform}{'.exe' if 'windows' in platform else ''}"
    if not program.exists():
        pytest.skip(f"no driver for {platform} (tests/importers/run.sh builds it)")
    if "windows" in platform:
        wine = shutil.which("wine") or pytest.skip("wine is not installed")
        return [wine, program]
    if "aarch64" in platform:
        qemu = shutil.which("qemu-aarch64") or pytest.skip("qemu-aarch64 is not installed (qemu-user)")
        if not SYSROOT.exists():
            pytest.skip("no libraries of Arm (libc6-arm64-cross)")
        return [qemu, "-L", SYSROOT, program]
    return [program]


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    work = tmp_path_factory.mktemp("platforms")
    for scene in SCENES:
        tiprub("package", f"builtin:{scene}", "--library", LIBRARIES, "-o", work / scene)
    return work


def run(platform, file, steps):
    environment = os.environ | {"WINEDEBUG": "-all"}
    answer = subprocess.run([*driver(platform), file, str(steps)], capture_output=True, text=True, env=environment)
    assert answer.returncode == 0, answer.stderr[-2000:]
    return answer.stdout.replace("\r\n", "\n")


@pytest.mark.parametrize("fmi", ["2", "3"])
@pytest.mark.parametrize("platform", ["x86_64-windows", "aarch64-linux"])
@pytest.mark.parametrize("scene", SCENES)
def test_bits_are_those_of_linux(fmus, record, scene, platform, fmi):
    (file,) = (fmus / scene).glob(f"*_fmi{fmi}.fmu")
    here = run("x86_64-linux", file, SCENES[scene])
    assert here.count("\n") == SCENES[scene] + 2
    assert run(platform, file, SCENES[scene]) == here
    with_what = {"x86_64-windows": "wine", "aarch64-linux": "qemu-aarch64"}[platform]
    record(f"{with_what}, `{scene}`", "", f"{fmi}.0", f"bits of x86-64 Linux in all outputs of {SCENES[scene]} steps")

"""Validate the recorded model descriptions with FMPy: official XML schemas, names, units, model structure.

    python modelDescription/tests/validate.py [modelDescription.xml ...]

Needs FMPy (written against 0.3.32). Without arguments it takes the files in snapshots/. Exit code 1 on any problem.
"""

import sys
import tempfile
import zipfile
from pathlib import Path

from fmpy.validation import validate_fmu


def problems(description: Path) -> list[str]:
    with tempfile.TemporaryDirectory() as directory:
        fmu = Path(directory) / "model.fmu"
        with zipfile.ZipFile(fmu, "w") as archive:
            archive.write(description, "modelDescription.xml")
        return validate_fmu(str(fmu))


def main() -> int:
    files = [Path(name) for name in sys.argv[1:]]
    files = files or sorted((Path(__file__).parent / "snapshots").glob("*.xml"))
    found = {file: problems(file) for file in files}
    for file, list_of_problems in found.items():
        print(f"{file.name}: {'no problem' if not list_of_problems else ''}")
        for problem in list_of_problems:
            print(f"  {problem}")
    return 1 if not files or any(found.values()) else 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env bash
# Run the gallery, or an example that couples the FMU with other models: create a Python environment from pinned packages, build
# tiprub unless TIPRUB is set, run the example, and write figures and tables to target/examples/NAME.
#
#     examples/run.sh NAME [options of the example]     examples/run.sh NAME --help
#
# TIPRUB gives the path of a tiprub program to use instead of building one, TIPRUB_LIBRARY that of an FMU library.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
known=$(shopt -s nullglob; cd "$root/examples" && for main in */*.py; do [ "${main%/*}" = "$(basename "$main" .py)" ] && echo -n " ${main%/*}"; done; true)
name=${1:-}
if [ -z "$name" ]; then
    sed -n '2,7s/^# \{0,1\}//p' "$0" >&2
    echo "Examples:$known" >&2
    exit 2
fi
if [ ! -f "$root/examples/$name/$name.py" ]; then
    echo "error: there is no example \`$name\`. Examples:$known." >&2
    if [ -f "$root/examples/gallery/$name.toml" ]; then
        echo "\`$name\` is a case of the gallery: run examples/run.sh gallery $name" >&2
    fi
    exit 2
fi
shift
out=$root/target/examples/$name
venv=$root/target/examples/$name-venv
requirements=$root/examples/$name/requirements.txt
if ! cmp -s "$requirements" "$venv/requirements.txt"; then
    rm -rf "$venv"
    python3 -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r "$requirements"
    cp "$requirements" "$venv/requirements.txt"
fi
if [ -z "${TIPRUB:-}" ]; then
    cargo build --manifest-path "$root/Cargo.toml" --release --quiet -p tiprub
    export TIPRUB=$root/target/release/tiprub
fi
mkdir -p "$out"
exec "$venv/bin/python" "$root/examples/$name/$name.py" --into "$out" "$@"

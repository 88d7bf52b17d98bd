#!/usr/bin/env bash
# Test the packaged FMUs with independent importers and on other platforms: FMPy, fmuloader, Ecos, libcosim, FMU Manipulation Toolbox
# and fmi-sim; Windows with wine and 64-bit Arm with qemu. Missing tools are skipped with a reason.
# Writes the table of tools to target/importers.md. Arguments are passed to pytest.
set -euo pipefail
cd "$(dirname "$0")/../.."
target_dir=$(realpath -m "${CARGO_TARGET_DIR:-target}")
venv=$target_dir/importers-venv
if ! cmp -s tests/importers/requirements.txt "$venv/requirements.txt"; then
    rm -rf "$venv"
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check -r tests/importers/requirements.txt
    cp tests/importers/requirements.txt "$venv/requirements.txt"
fi
cargo build --quiet --release -p tiprub
packaging/libraries.sh x86_64-linux x86_64-windows aarch64-linux
mkdir -p "$target_dir/drivers"
for platform in x86_64-linux x86_64-windows aarch64-linux; do
    case $platform in
    *-linux) triple=${platform%-linux}-unknown-linux-gnu suffix= ;;
    *-windows) triple=${platform%-windows}-pc-windows-gnu suffix=.exe ;;
    esac
    PATH=$target_dir/cross-venv/bin:$PATH cargo zigbuild --quiet --release -p tiprub-fmi-host --example drive --target "$triple"
    cp "$target_dir/$triple/release/examples/drive$suffix" "$target_dir/drivers/$platform$suffix"
done
# The Rust standard library requires a random number source that wine before version 9 lacks; the FMU does not.
"$target_dir/cross-venv/bin/python" -m ziglang cc -target x86_64-windows-gnu -shared -O2 -ladvapi32 \
    -o "$target_dir/drivers/bcryptprimitives.dll" tests/importers/bcryptprimitives.c
TIPRUB_TARGET=$target_dir TIPRUB=$target_dir/release/tiprub PATH=$venv/bin:$PATH \
    "$venv/bin/python" -m pytest -q -rs -p no:cacheprovider tests/importers "$@"
cat "$target_dir/importers.md"

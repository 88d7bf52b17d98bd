#!/usr/bin/env bash
# Build the FMU library for any x86-64 Linux with glibc 2.17 or later, and show what it needs.
#
# The ordinary build links against the glibc of the machine it runs on. This one uses the Zig linker (both packages
# come from PyPI, pinned) and leaves target/portable/tiprub.so, which `tiprub package --library` and
# `tiprub demo --library` take.
set -euo pipefail
cd "$(dirname "$0")/.."
target_dir=${CARGO_TARGET_DIR:-target}
venv=$target_dir/portable/venv
if [ ! -x "$venv/bin/cargo-zigbuild" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check ziglang==0.17.0 cargo-zigbuild==0.24.0
fi
cargo fetch --locked --quiet
. packaging/remap.sh
CARGO_ENCODED_RUSTFLAGS=$library_flags PATH=$(cd "$venv/bin" && pwd):$PATH \
    cargo zigbuild -p tiprub-fmi --profile fmu --target x86_64-unknown-linux-gnu.2.17
cp "$target_dir/x86_64-unknown-linux-gnu/fmu/libtiprub_fmi.so" "$target_dir/portable/tiprub.so"
library=$target_dir/portable/tiprub.so
echo "$library: $(stat -c %s "$library") bytes"
objdump -p "$library" | awk '/NEEDED/ {print "  needs " $2}'
echo "  newest glibc symbol: $(objdump -T "$library" | grep -o 'GLIBC_[0-9.]*' | sort -uV | tail -1)"

#!/usr/bin/env bash
# Build the Python wheels in target/wheels, for all supported platforms or for the given ones:
#
#     packaging/wheels.sh [x86_64-linux|x86_64-windows|aarch64-linux]...
#     packaging/wheels.sh --native
#
# A wheel contains the program for its platform, the module of packaging/python, and the FMU libraries in target/libraries. If that
# folder is empty, packaging/libraries.sh builds them; delete the folder after changing the sources.
# Linux wheels require glibc 2.17 or later. Equal sources, Rust version and SOURCE_DATE_EPOCH give equal bytes.
#
# --native builds quickly for this machine only, with the library of `cargo build`: for tests, not for distribution.
set -euo pipefail
cd "$(dirname "$0")/.."
mkdir -p "${CARGO_TARGET_DIR:-target}/wheels"
export CARGO_TARGET_DIR=$(cd "${CARGO_TARGET_DIR:-target}" && pwd)
target_dir=$CARGO_TARGET_DIR
venv=$target_dir/wheel-venv
# Where packaging/python/pyproject.toml looks.
data=target/wheel-data/data/lib/tiprub
all="x86_64-linux x86_64-windows aarch64-linux"
if [ ! -x "$venv/bin/cargo-zigbuild" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check maturin==1.16.0 ziglang==0.17.1 cargo-zigbuild==0.24.0
fi
PATH=$venv/bin:$PATH
cargo fetch --locked --quiet
. packaging/remap.sh
export CARGO_ENCODED_RUSTFLAGS=$library_flags
# The program does not keep where it was built.
export TIPRUB_HANDED_ON=1
# Times of the files in the wheel: those of the last commit, unless told otherwise.
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || echo 315532800)}

# The libraries given, and nothing of before.
place() {
    rm -rf target/wheel-data
    mkdir -p "$data"
    cp "$@" "$data"
    chmod 755 "$data"/*
}

wheel() {
    (cd packaging/python && maturin build --quiet --locked --release --out "$target_dir/wheels" "$@")
}

if [ "${1:-}" = --native ]; then
    # Apart from what cargo builds for the sources, which is told where they are.
    triple=$(rustc -vV | sed -n 's/^host: //p')
    # One after the other: together their features would be one.
    for crate in tiprub-fmi tiprub-fmi-thermal; do
        cargo build --quiet -p $crate --profile fmu --target "$triple"
    done
    place "$target_dir/$triple"/fmu/libtiprub{,_thermal}_fmi.so
    mv "$data/libtiprub_fmi.so" "$data/$(uname -m)-linux.so"
    mv "$data/libtiprub_thermal_fmi.so" "$data/thermal-$(uname -m)-linux.so"
    wheel --target "$triple" --compatibility linux
    ls -l "$target_dir/wheels"
    exit
fi

[ -n "$(ls "$target_dir/libraries" 2>/dev/null)" ] || packaging/libraries.sh
[ $# -gt 0 ] || set -- $all
place "$target_dir"/libraries/*
for platform in "$@"; do
    case $platform in
    *-linux) triple=${platform%-linux}-unknown-linux-gnu ;;
    x86_64-windows) triple=x86_64-pc-windows-gnu ;;
    *) echo "wheels.sh: $platform is none of $all" >&2; exit 2 ;;
    esac
    rustup target add --toolchain "$(rustc -V | cut -d' ' -f2)" "$triple" >/dev/null 2>&1 || rustup target add "$triple"
    case $platform in
    *-linux) wheel --zig --target "$triple" --compatibility manylinux2014 ;;
    *) wheel --zig --target "$triple" ;;
    esac
done
ls -l "$target_dir/wheels"

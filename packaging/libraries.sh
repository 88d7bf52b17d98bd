#!/usr/bin/env bash
# Build the FMU libraries for scenes and for heat conduction (thermal-PLATFORM) into target/libraries, for all platforms or for the
# given ones, and print the system libraries that each requires:
#
#     packaging/libraries.sh [x86_64-linux|x86_64-windows|aarch64-linux|x86_64-darwin|aarch64-darwin]...
#
# Linux libraries require glibc 2.17 or later. The Zig linker (pinned, from PyPI) links for other platforms; no Microsoft or Apple
# software is required. Equal sources and an equal Rust version give equal bytes on every machine.
# `tiprub package --library target/libraries` uses these libraries.
set -euo pipefail
cd "$(dirname "$0")/.."
target_dir=${CARGO_TARGET_DIR:-target}
out=$target_dir/libraries
venv=$target_dir/cross-venv
if [ ! -x "$venv/bin/cargo-zigbuild" ]; then
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check ziglang==0.17.1 cargo-zigbuild==0.24.0
fi
bin=$(cd "$venv/bin" && pwd)
all="x86_64-linux x86_64-windows aarch64-linux x86_64-darwin aarch64-darwin"
[ $# -gt 0 ] || set -- $all
cargo fetch --locked --quiet
. packaging/remap.sh
# The linker for Windows writes a time stamp into the library.
export SOURCE_DATE_EPOCH=315532800
export MACOSX_DEPLOYMENT_TARGET=11.0
mkdir -p "$out"
for platform in "$@"; do
    case $platform in
    *-linux) triple=${platform%-linux}-unknown-linux-gnu glibc=.2.17 prefix=lib extension=so ;;
    *-windows) triple=${platform%-windows}-pc-windows-gnu glibc= prefix= extension=dll ;;
    *-darwin) triple=${platform%-darwin}-apple-darwin glibc= prefix=lib extension=dylib ;;
    *) echo "libraries.sh: $platform is none of $all" >&2; exit 2 ;;
    esac
    rustup target add --toolchain "$(rustc -V | cut -d' ' -f2)" "$triple" >/dev/null 2>&1 || rustup target add "$triple"
    # Crate, its file, and the identifier of the FMUs that it is in.
    for unit in tiprub-fmi:tiprub_fmi:tiprub: tiprub-fmi-thermal:tiprub_thermal_fmi:tiprub_thermal:thermal-; do
        IFS=: read -r crate file identifier named <<< "$unit"
        flags=$library_flags
        # A name that does not tell where it was built, and an identifier (LC_UUID) made of what is left without symbols, which do.
        [ $extension != dylib ] || flags=$flags$separator-Clink-arg=-Wl,-install_name,@rpath/$identifier.dylib$separator-Clink-arg=-Wl,-S
        CARGO_ENCODED_RUSTFLAGS=$flags PATH=$bin:$PATH \
            cargo zigbuild --quiet -p "$crate" --profile fmu --target "$triple$glibc"
        library=$out/$named$platform.$extension
        cp "$target_dir/$triple/fmu/$prefix$file.$extension" "$library"
        echo "$library: $(stat -c %s "$library") bytes, $(gzip -9 -c "$library" | wc -c) packed"
        if [ $extension = so ]; then
            readelf -d "$library" | sed -n 's/.*(NEEDED).*\[\(.*\)\]/  needs \1/p'
            echo "  newest glibc symbol: $(readelf -V --wide "$library" | grep -o 'GLIBC_[0-9.]*' | sort -uV | tail -1)"
        fi
    done
done

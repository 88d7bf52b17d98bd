#!/usr/bin/env bash
# Build the page that runs a rub in the browser: one HTML file with the simulation as WebAssembly, a ROM and a scene.
#
#     packaging/try_it.sh FILE.html [ROM]
#
# Without ROM, `tiprub reduce rotor37` writes one to target/wasm. It is reused as long as it is newer than the program.
set -euo pipefail
here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
output=$(realpath -m -- "${1:?give the HTML file to write}")
rom=${2:+$(realpath -- "$2")}
cd "$here/.."
target=wasm32-unknown-unknown
if ! [ -d "$(rustc --print sysroot)/lib/rustlib/$target" ]; then
    echo "the Rust target $target is not installed: rustup target add $target" >&2
    exit 1
fi
# With a separate directory, other builds can run at the same time.
build=${CARGO_TARGET_DIR:-$PWD/target}/wasm
. packaging/remap.sh
separator=$(printf '\037')
CARGO_ENCODED_RUSTFLAGS=$library_flags${separator}-Ctarget-feature=+simd128 \
    cargo build --quiet -p tiprub-browser --profile browser --target "$target" --target-dir "$build"
wasm=$build/$target/browser/tiprub_browser.wasm

if [ -z "$rom" ]; then
    cargo build --quiet --release -p tiprub
    program=${CARGO_TARGET_DIR:-$PWD/target}/release/tiprub
    rom=$build/rotor37.rom.safetensors
    [ "$rom" -nt "$program" ] || "$program" reduce rotor37 --quiet --force -o "$rom" > /dev/null
fi
# The page needs the clearance and the force of every blade as outputs.
scene=$build/rotor37.toml
awk '{ print } /^watched_sectors = / { print "all_sectors = true" }' src/gallery/scenes/rotor37.toml > "$scene"
grep -q '^all_sectors = true$' "$scene"

page=src/browser/page
data() {
    printf '<script type="text/plain" id="%s">' "$1"
    gzip -9nc "$2" | base64 -w0
    printf '</script>\n'
}
mkdir -p "$(dirname -- "$output")"
{
    printf '<!DOCTYPE html>\n<html lang="en">\n<meta charset="utf-8">\n'
    printf '<meta name="viewport" content="width=device-width, initial-scale=1">\n<title>A rub in the browser</title>\n<style>\n'
    cat "$page/page.css"
    printf '</style>\n'
    cat "$page/page.html"
    data wasm "$wasm"
    data rom "$rom"
    data scene "$scene"
    printf '<script id="engine">\n'
    cat "$page/engine.js"
    printf '</script>\n<script>\n'
    cat "$page/page.js"
    printf '</script>\n</html>\n'
} > "$output.part"
mv -- "$output.part" "$output"
echo "$output: $(wc -c < "$output") bytes, module $(wc -c < "$wasm") bytes"

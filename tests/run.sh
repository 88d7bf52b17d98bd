#!/bin/sh
# All tests: Rust (workspace, release), then Python (FMPy) against the packaged FMUs of rotor 37.
# Works from any directory; ends with pytest's summary line; exit code 1 on any failure.
set -u

here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
root=$(dirname -- "$here")
venv=$root/target/tests-venv
failed=0

section() {
    printf '\n=== %s ===\n' "$1"
}

cd "$root" || exit 1

section "FMU library, as it ships and with a panic on request: cargo build"
. packaging/remap.sh
library() {
    CARGO_ENCODED_RUSTFLAGS=$library_flags \
        cargo build -p tiprub-fmi --profile fmu --target-dir target/product "$@" || exit 1
}
library --features test-panic
cp target/product/fmu/libtiprub_fmi.so target/product/test_panic.so || exit 1
library
TIPRUB_LIBRARY=$root/target/product/fmu/libtiprub_fmi.so
TIPRUB_LIBRARY_TEST_PANIC=$root/target/product/test_panic.so
export TIPRUB_LIBRARY TIPRUB_LIBRARY_TEST_PANIC

section "Rust: cargo test --workspace --release"
cargo test --workspace --release || failed=1

section "Command line: cargo build"
cargo build --release || exit 1
TIPRUB=$root/target/release/tiprub
export TIPRUB

section "Python environment: $venv"
stamp=$venv/requirements.txt
if ! cmp -s "$here/requirements.txt" "$stamp"; then
    rm -rf "$venv"
    python3 -m venv "$venv" || exit 1
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r "$here/requirements.txt" || exit 1
    cp "$here/requirements.txt" "$stamp" || exit 1
fi
echo "ready: $("$venv/bin/python" --version), $(grep -c == "$here/requirements.txt") pinned packages"

if [ "$failed" -ne 0 ]; then
    echo "the Rust tests failed, see above"
fi

section "Python: pytest tests/python"
"$venv/bin/python" -m pytest -p no:cacheprovider "$here/python" || failed=1

exit "$failed"

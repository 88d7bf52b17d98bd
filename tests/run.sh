#!/bin/sh
# All tests: Rust (workspace, release), and beside them Python (FMPy) against the packaged FMUs of rotor 37.
# Works from any directory; ends with pytest's summary line; exit code 1 on any failure.
#
# Jobs that use one core (the library as one code unit, pytest) run beside jobs that use all cores. Their output is
# written to target/tests-logs and printed when they end.
set -u

here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
root=$(dirname -- "$here")
venv=$root/target/tests-venv
logs=$root/target/tests-logs
failed=0

section() {
    printf '\n=== %s ===\n' "$1"
}

cd "$root" || exit 1
mkdir -p "$logs" || exit 1
. packaging/remap.sh

library() {
    crate=$1
    shift
    CARGO_ENCODED_RUSTFLAGS=$library_flags cargo rustc -p "$crate" --profile fmu --target-dir target/product "$@"
}

# Shared dependencies are compiled once. Only the library that ships is optimised as a whole.
libraries() {
    library tiprub-fmi --features test-panic -- -C opt-level=0 -C debug-assertions=off &&
        cp target/product/fmu/libtiprub_fmi.so target/product/test_panic.so &&
        library tiprub-fmi && library tiprub-fmi-thermal
}

python_environment() {
    stamp=$venv/requirements.txt
    if ! cmp -s "$here/requirements.txt" "$stamp"; then
        rm -rf "$venv"
        python3 -m venv "$venv" &&
            "$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r "$here/requirements.txt" &&
            cp "$here/requirements.txt" "$stamp" || return 1
    fi
    echo "ready: $("$venv/bin/python" --version), $(grep -c == "$here/requirements.txt") pinned packages"
}

# Prints the output of a job that ended with the status $2.
print_log() {
    cat "$logs/$1"
    [ "$2" -eq 0 ]
}

libraries > "$logs/library" 2>&1 &
library_job=$!
python_environment > "$logs/environment" 2>&1 &
environment_job=$!
trap 'kill "$library_job" "$environment_job" 2> /dev/null' INT TERM

section "Rust: cargo test --workspace --release --tests, compiled"
cargo test --workspace --release --tests --no-run || failed=1

section "FMU library, as it ships and with a panic on request: cargo build"
wait "$library_job"
print_log library $? || exit 1

section "Python environment: $venv"
wait "$environment_job"
print_log environment $? || exit 1

[ "$failed" -eq 0 ] || exit 1
TIPRUB_LIBRARY=$root/target/product/fmu/libtiprub_fmi.so
TIPRUB_LIBRARY_THERMAL=$root/target/product/fmu/libtiprub_thermal_fmi.so
TIPRUB_LIBRARY_TEST_PANIC=$root/target/product/test_panic.so
# The command line that the Rust tests run.
TIPRUB=$root/target/release/tiprub
export TIPRUB_LIBRARY TIPRUB_LIBRARY_THERMAL TIPRUB_LIBRARY_TEST_PANIC TIPRUB

"$venv/bin/python" -m pytest -p no:cacheprovider "$here/python" > "$logs/pytest" 2>&1 &
pytest_job=$!
trap 'kill "$pytest_job" 2> /dev/null' INT TERM

section "Rust: cargo test --workspace --release --tests"
cargo test --workspace --release --tests || failed=1

section "Rust: cargo test --workspace --release --doc"
cargo test --workspace --release --doc || failed=1

if [ "$failed" -ne 0 ]; then
    echo "the Rust tests failed, see above"
fi

section "Python: pytest tests/python"
wait "$pytest_job"
print_log pytest $? || failed=1

exit "$failed"

#!/usr/bin/env bash
# Build the guide as a book, target/book/index.html, with mdBook, and the page that runs a rub in the browser. Warnings are errors.
set -euo pipefail
cd "$(dirname "$0")/.."
if ! command -v mdbook >/dev/null; then
    echo "mdbook is not installed: cargo install mdbook --version 0.4.52 --locked" >&2
    exit 1
fi
directory=${CARGO_TARGET_DIR:-$PWD/target}/book
log=$(mdbook build docs --dest-dir "$directory" 2>&1) || { echo "$log" >&2; exit 1; }
if grep -qE 'WARN|ERROR' <<<"$log"; then
    echo "$log" >&2
    exit 1
fi
packaging/try_it.sh "$directory/rub.html"
echo "$directory/index.html: $(find "$directory" -name '*.html' | wc -l) pages"

#!/usr/bin/env bash
# Build all files of a release in target/release-VERSION:
#
#     wheels, the libraries of all platforms, the guide as a book, the sources, licences, a bill of materials (CycloneDX),
#     the study results of the guide (docs), and SHA-256 checksums of all files.
#
# Network access is required for the registries of Rust and Python and for the advisory database. `--no-check` skips cargo deny,
# `--no-wheels` skips the wheels.
set -euo pipefail
cd "$(dirname "$0")/.."
check=yes wheels=yes
for option in "$@"; do
    case $option in
    --no-check) check=no ;;
    --no-wheels) wheels=no ;;
    *) sed -n '2,8s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
    esac
done
[ -z "$(git status --porcelain)" ] || { echo "release.sh: the tree has changes; commit them first" >&2; exit 1; }
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
target_dir=$(realpath -m "${CARGO_TARGET_DIR:-target}")
out=$target_dir/release-$version
tools=$target_dir/release-tools
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
rm -rf "$out"
mkdir -p "$out"

if [ $check = yes ]; then
    [ -x "$tools/bin/cargo-deny" ] || cargo install --quiet --locked --root "$tools" cargo-deny@0.20.2
    "$tools/bin/cargo-deny" --log-level error check
fi
[ -x "$tools/bin/cargo-cyclonedx" ] || cargo install --quiet --locked --root "$tools" cargo-cyclonedx@0.5.9
"$tools/bin/cargo-cyclonedx" cyclonedx --quiet --format json --override-filename bill-of-materials
# Without the directory of these sources.
for part in packaging:tiprub fmi:tiprub-fmi fmi/thermal:tiprub-fmi-thermal; do
    sed "s|path+file://$PWD/|path+file:///tiprub/|g" "${part%:*}/bill-of-materials.json" > "$out/${part#*:}-$version.cdx.json"
done
find . -name bill-of-materials.json -not -path './target/*' -delete

packaging/libraries.sh
# Reproducible archives: order, owner, times and modes do not depend on the machine or its umask.
tarred() {
    tar --sort=name --owner=0 --group=0 --numeric-owner --mode=a=rX,u+w --mtime="@$SOURCE_DATE_EPOCH" -C "$1" -c "$2" |
        gzip -9n > "$out/$3.tar.gz"
}
tarred "$target_dir" libraries "tiprub-libraries-$version"
if command -v mdbook > /dev/null; then
    packaging/book.sh
    tarred "$target_dir" book "tiprub-guide-html-$version"
else
    tarred . docs "tiprub-guide-markdown-$version"
fi
git -c tar.umask=0022 archive --format=tar --prefix="tiprub-$version/" HEAD | gzip -9n > "$out/tiprub-$version.tar.gz"
cp packaging/assets/third-party.txt LICENSE-MIT LICENSE-APACHE CHANGELOG.md "$out"
if [ $wheels = yes ]; then
    packaging/wheels.sh
    cp "$target_dir"/wheels/*.whl "$out"
fi
(cd "$out" && sha256sum -- * > SHA256SUMS)
cat "$out/SHA256SUMS"

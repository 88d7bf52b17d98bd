# Sourced by scripts that build the FMU library. Replaces the paths of the workspace, of cargo's home and of its registry by neutral
# names, so that equal sources give equal bytes on every machine (as with `tiprub package`).
# $PWD must be the workspace. Encoded flags are separated by the byte 0x1f and may contain spaces.
cargo_home=${CARGO_HOME:-$HOME/.cargo}
separator=$(printf '\037')
library_flags=--remap-path-prefix=$PWD=tiprub$separator--remap-path-prefix=$cargo_home=cargo
for registry in "$cargo_home"/registry/src/*/; do
    library_flags=$library_flags$separator--remap-path-prefix=${registry%/}=crates
done

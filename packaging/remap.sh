# To be sourced by scripts that build the FMU library: the places of the workspace, of cargo's home and of its registry
# get neutral names in it, so that the same sources give the same bytes for everybody (as `tiprub package` builds it).
# Needs $PWD to be the workspace. Encoded flags are separated by the byte 0x1f and may hold spaces.
cargo_home=${CARGO_HOME:-$HOME/.cargo}
separator=$(printf '\037')
library_flags=--remap-path-prefix=$PWD=tiprub$separator--remap-path-prefix=$cargo_home=cargo
for registry in "$cargo_home"/registry/src/*/; do
    library_flags=$library_flags$separator--remap-path-prefix=${registry%/}=crates
done

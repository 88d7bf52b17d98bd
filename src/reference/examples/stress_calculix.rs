//! Comparison of the static stress of a loaded blade with CalculiX.
//!
//! `stress_calculix write DIR` writes `pushed.inp` and `moved.inp`; after `ccx -i DIR/pushed` and `ccx -i DIR/moved`,
//! `stress_calculix read DIR` prints the table of `tests/data/blade_stress_calculix.csv`.

use std::{fs, path::Path};

use tiprub_reference::blade::{PushedBlade, calculix};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, verb, directory] = arguments.as_slice() else { panic!("write DIR, or read DIR") };
    let file = |name: &str| Path::new(directory).join(name);
    if verb == "write" {
        let texts = PushedBlade::new().and_then(|blade| blade.inputs()).expect("the blade is sound");
        for (name, text) in ["pushed.inp", "moved.inp"].into_iter().zip(texts) {
            fs::write(file(name), text).expect("the file is written");
        }
        return;
    }
    let [pushed, moved] =
        ["pushed.frd", "moved.frd"].map(|name| fs::read_to_string(file(name)).expect("CalculiX has run"));
    let blocks = [(&pushed, "DISP", 3), (&moved, "STRESS", 6), (&pushed, "STRESS", 6)];
    let blocks = blocks.map(|(text, block, count)| calculix::results(text, block, count));
    println!("place,node,ux,uy,uz,xx,yy,zz,xy,yz,zx,own_xx,own_yy,own_zz,own_xy,own_yz,own_zx");
    for (name, node) in PushedBlade::places() {
        let of = |block: &Vec<(usize, Vec<f64>)>| {
            block.iter().find(|(other, _)| *other == node).expect("the node is in the results").1.clone()
        };
        let values = blocks.iter().flat_map(of).map(|value| format!("{value:e}"));
        println!("{name},{},{}", node + 1, values.collect::<Vec<_>>().join(","));
    }
}

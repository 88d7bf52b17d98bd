//! Writes the CalculiX input file of the cube between two rings:
//! `cube_calculix FILE.inp [increment in s] [end in s] [µ] [Pa/m of contact] [Pa/m of sticking] [small] [surfaces]`.

use tiprub_reference::cube::{FRICTION, calculix};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let number = |index: usize, default: f64| {
        arguments.get(index).map_or(default, |text| text.parse().expect("a number in seconds"))
    };
    let says = |word: &str| arguments.iter().any(|argument| argument == word);
    let file = arguments.get(1).expect("the name of the file to write");
    let run = calculix::CalculixRun {
        speed: 100.0,
        friction: number(4, FRICTION),
        increment: number(2, 2e-6),
        end: number(3, 5e-4),
        contact_stiffness: number(5, 1e13),
        stick_stiffness: number(6, 1e12),
        large: !says("small"),
        surfaces: says("surfaces"),
    };
    std::fs::write(file, calculix::input(&run)).expect("the input file could be written");
}

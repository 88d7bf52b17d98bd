//! Exports of the released library, and its requirements on the system.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use tiprub_fmi_host::api::{Fmi2Api, Fmi3Api};
use tiprub_tests::{shipped, thermal};

fn run(program: &str, arguments: &[&str], path: &Path) -> String {
    let output = Command::new(program).args(arguments).arg(path).output();
    let output = output.unwrap_or_else(|error| panic!("{program} (binutils) is needed: {error}"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn library_exports_exactly_the_fmi_functions() {
    assert_eq!((Fmi2Api::NAMES.len(), Fmi3Api::NAMES.len()), (44, 75), "counts of the standards' headers");
    let expected: BTreeSet<_> = Fmi2Api::NAMES.iter().chain(Fmi3Api::NAMES).map(|name| (*name).to_owned()).collect();
    for path in [shipped(), thermal()] {
        let listing = run("nm", &["-D", "--defined-only"], &path);
        let exported: BTreeSet<_> =
            listing.lines().filter_map(|line| line.split_whitespace().last()).map(str::to_owned).collect();
        let missing: Vec<_> = expected.difference(&exported).collect();
        let extra: Vec<_> = exported.difference(&expected).collect();
        assert!(missing.is_empty() && extra.is_empty(), "{}: missing {missing:?}, extra {extra:?}", path.display());
    }
    println!("exports: {} of FMI 2.0, {} of FMI 3.0, nothing else", Fmi2Api::NAMES.len(), Fmi3Api::NAMES.len());
}

#[test]
fn library_depends_only_on_system_libraries() {
    [shipped(), thermal()].iter().for_each(|path| needs_only_the_system(path));
}

fn needs_only_the_system(path: &Path) {
    let dynamic = run("objdump", &["-p"], path);
    let needed: Vec<_> = dynamic.lines().filter_map(|line| line.trim().strip_prefix("NEEDED")).map(str::trim).collect();
    let allowed = ["libc.so.6", "libgcc_s.so.1", "libm.so.6", "libpthread.so.0", "libdl.so.2", "ld-linux-x86-64.so.2"];
    assert!(needed.iter().all(|name| allowed.contains(name)), "{needed:?}");
    let symbols = run("objdump", &["-T"], path);
    let version = |line: &str| {
        let text = line.split("GLIBC_").nth(1)?.split([')', ' ']).next()?;
        let mut numbers = text.split('.').map(|number| number.parse::<u32>().unwrap_or(0));
        Some((numbers.next()?, numbers.next().unwrap_or(0), numbers.next().unwrap_or(0)))
    };
    let newest = symbols.lines().filter_map(version).max();
    let size = std::fs::metadata(path).expect("the library is there").len();
    println!("library: {size} bytes, needs {needed:?}, newest glibc symbol version {newest:?}");
    assert!(size < 8_000_000, "{size} bytes");
}

/// The library must not print or change process-wide state: it does not even import the functions for this. It starts
/// threads only if the parameter `threads` requests them (`threads.rs`); the library of heat conduction never does.
#[test]
fn library_does_not_print_fork_or_change_the_process() {
    let never = ["printf", "puts", "fesetround", "fesetenv", "chdir", "setlocale", "fork", "system", "setenv"];
    [shipped(), thermal()].iter().for_each(|path| imports_none_of(path, &never));
    imports_none_of(&thermal(), &["pthread_create"]);
}

fn imports_none_of(path: &Path, functions: &[&str]) {
    let symbols = run("nm", &["-D", "--undefined-only"], path);
    let imported: BTreeSet<_> = symbols
        .lines()
        .filter_map(|line| line.split_whitespace().last())
        .map(|name| name.split('@').next().unwrap_or(name))
        .collect();
    for name in functions {
        assert!(!imported.contains(*name), "{} imports {name}", path.display());
    }
}

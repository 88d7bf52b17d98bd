use super::*;

/// Text that every library of an FMU contains.
const FUNCTIONS: &[u8] = b"fmi2DoStep\0fmi3DoStep\0";

/// Returns bytes with the functions of both FMI versions and this release.
fn content() -> Vec<u8> {
    [FUNCTIONS, LIBRARY_RELEASE.as_bytes()].concat()
}

/// Returns the headers of an empty shared library for Linux (ELF, machine 62 is x86-64 and 183 AArch64).
fn elf(machine: u8) -> Vec<u8> {
    let mut bytes = vec![0_u8; 64];
    bytes.extend(content());
    bytes[..20].copy_from_slice(b"\x7fELF\x02\x01\x01\0\0\0\0\0\0\0\0\0\x03\0\0\0");
    bytes[18] = machine;
    bytes
}

/// Returns the headers of an empty library for macOS (Mach-O, file type 6; the last byte of the processor type is 7 or 12).
fn mach_o(processor: u8) -> Vec<u8> {
    let mut bytes = vec![0_u8; 32];
    bytes.extend(content());
    bytes[..8].copy_from_slice(&[0xcf, 0xfa, 0xed, 0xfe, processor, 0, 0, 1]);
    bytes[12] = 6;
    bytes
}

/// Returns the headers of an empty library for Windows: DOS header, COFF header (x86-64, a DLL), optional header of PE32+, one empty section.
fn pe() -> Vec<u8> {
    let mut bytes = vec![0_u8; 64 + 24 + 112 + 16 * 8 + 40];
    bytes[..2].copy_from_slice(b"MZ");
    bytes[60] = 64;
    bytes[64..71].copy_from_slice(b"PE\0\0\x64\x86\x01");
    bytes[84..88].copy_from_slice(&[240, 0, 0x22, 0x20]);
    bytes[88..90].copy_from_slice(&[0x0b, 0x02]);
    bytes[88 + 108] = 16;
    bytes.extend(content());
    bytes
}

fn arguments(library: &[PathBuf], platform: &[Platform]) -> LibraryArguments {
    let platform = platform.iter().copied().map(PlatformChoice).collect();
    LibraryArguments { library: library.to_vec(), platform }
}

fn load(unit: LibraryUnit, arguments: &LibraryArguments, console: &Console) -> Result<Vec<Library>> {
    super::load(unit, LibraryBuild::Released, arguments, console)
}

#[test]
fn selects_libraries_of_a_directory_by_their_content() {
    let root = tempfile::tempdir().unwrap();
    let console = Console::new(true, false);
    let names = ["c.so", "e.DLL", "a.so", "d.dylib", "b.dylib"];
    for (name, bytes) in names.iter().zip([elf(62), pe(), elf(183), mach_o(7), mach_o(12)]) {
        std::fs::write(root.path().join(name), bytes).unwrap();
    }
    std::fs::write(root.path().join("README.md"), "Libraries of all platforms.").unwrap();
    let directory = [root.path().to_path_buf()];
    let platforms = |libraries: Vec<Library>| Vec::from_iter(libraries.iter().map(|library| library.platform));
    assert_eq!(platforms(load(LibraryUnit::Scene, &arguments(&directory, &[]), &console).unwrap()), Platform::ALL);
    let two = [Platform::Aarch64Darwin, Platform::X86_64Windows];
    let chosen = platforms(load(LibraryUnit::Scene, &arguments(&directory, &two), &console).unwrap());
    assert_eq!(chosen, [Platform::X86_64Windows, Platform::Aarch64Darwin]);
    let one = [root.path().join("e.DLL")];
    let missing = load(LibraryUnit::Scene, &arguments(&one, &two), &console).unwrap_err();
    assert!(missing.what.contains("aarch64-darwin") && missing.problem.contains("x86_64-windows"), "{missing}");
    let twice = load(LibraryUnit::Scene, &arguments(&[one[0].clone(), one[0].clone()], &[]), &console).unwrap_err();
    assert!(twice.problem.contains("a second library for x86_64-windows"), "{twice}");
}

#[test]
fn finds_libraries_beside_the_program_or_in_its_prefix() {
    let root = tempfile::tempdir().unwrap();
    let program = root.path().join("bin/tiprub");
    for name in ["bin/x86_64-windows.dll", "lib/tiprub/x86_64-linux.so", "lib/tiprub/other.so"] {
        let path = root.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "").unwrap();
    }
    let found = installed(LibraryUnit::Scene, &program);
    let names: Vec<_> = found.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["x86_64-linux.so", "x86_64-windows.dll"]);
}

#[test]
fn installed_program_builds_and_caches_a_missing_library() {
    let root = tempfile::tempdir().unwrap();
    let [sources, cache] = ["sources", "cache"].map(|name| root.path().join(name));
    let program = root.path().join("bin/tiprub");
    let origin = |sources, cache| origin(LibraryUnit::Scene, &program, sources, cache);
    assert_eq!(origin(None, Some(cache.as_path())), Origin::Nowhere);
    assert_eq!(origin(Some(sources.as_path()), Some(cache.as_path())), Origin::Sources(&sources));
    let kept = build::kept(LibraryUnit::Scene, &cache).expect("this platform is known");
    assert!(build::kept(LibraryUnit::Thermal, &cache).is_some_and(|other| other != kept));
    std::fs::create_dir_all(kept.parent().unwrap()).unwrap();
    std::fs::write(&kept, "").unwrap();
    // Also if the sources no longer exist.
    assert_eq!(origin(None, Some(cache.as_path())), Origin::Kept(kept.clone()));
    assert_eq!(origin(Some(sources.as_path()), None), Origin::Sources(&sources));
    let beside = root.path().join("bin").join(Platform::X86_64Linux.file_name());
    std::fs::create_dir_all(beside.parent().unwrap()).unwrap();
    std::fs::write(&beside, "").unwrap();
    assert!(
        matches!(origin(Some(sources.as_path()), Some(cache.as_path())), Origin::Installed(files) if files.len() == 1)
    );
    std::fs::write(root.path().join(".rustc_info.json"), "").unwrap();
    assert!(
        matches!(origin(Some(sources.as_path()), Some(cache.as_path())), Origin::Target { target, .. } if target == root.path())
    );
}

#[test]
fn rejects_library_of_another_release_by_version() {
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("old.so");
    let other = LIBRARY_RELEASE.replacen(env!("CARGO_PKG_VERSION"), "9.8.7", 1);
    for (reported, named) in [(other.as_str(), other.as_str()), ("", "contains no release number")] {
        let mut bytes = elf(62);
        bytes.truncate(64);
        std::fs::write(&path, [&bytes, FUNCTIONS, reported.as_bytes()].concat()).unwrap();
        let refused =
            load(LibraryUnit::Scene, &arguments(std::slice::from_ref(&path), &[]), &Console::new(true, false))
                .unwrap_err();
        assert!(refused.what.ends_with("old.so") && refused.problem.contains(named), "{refused}");
        assert!(refused.problem.ends_with(LIBRARY_RELEASE), "{refused}");
    }
}

#[test]
fn rejects_file_that_is_not_a_library_by_name() {
    let root = tempfile::tempdir().unwrap();
    let console = Console::new(true, false);
    let refused = |path: PathBuf| load(LibraryUnit::Scene, &arguments(&[path], &[]), &console).unwrap_err();
    std::fs::write(root.path().join("README.md"), "None yet.").unwrap();
    assert!(refused(root.path().to_path_buf()).problem.contains("contains no library"));
    let mut program = elf(62);
    program[16] = 2;
    let (mut big_endian, mut other) = (elf(62), elf(243));
    big_endian[5] = 2;
    other[16] = 3;
    for bytes in [b"hello".to_vec(), vec![], program, big_endian, other, pe()[..80].to_vec(), mach_o(9)] {
        let path = root.path().join("tiprub.so");
        std::fs::write(&path, bytes).unwrap();
        assert!(refused(path).problem.contains("64-bit shared library"));
    }
    let path = root.path().join("other.so");
    std::fs::write(&path, &elf(62)[..64]).unwrap();
    assert!(refused(path).problem.contains("of an FMU"));
    let mut cut = pe();
    // The only section begins after the end of the file.
    cut[88 + 240 + 8..][..4].copy_from_slice(&[0, 2, 0, 0]);
    cut[88 + 240 + 16..][..8].copy_from_slice(&[0, 2, 0, 0, 0, 2, 0, 0]);
    let path = root.path().join("cut.dll");
    std::fs::write(&path, cut).unwrap();
    assert!(refused(path).problem.contains("not a complete"));
    let path = root.path().join("x86_64-linux.so");
    std::fs::write(&path, elf(183)).unwrap();
    let other = refused(path.clone());
    assert!(other.what.ends_with("x86_64-linux.so") && other.problem.contains("aarch64-linux"), "{other}");
    std::fs::write(&path, elf(62)).unwrap();
    assert!(load(LibraryUnit::Scene, &arguments(&[path], &[]), &console).is_ok());
    let missing = refused(root.path().join("none.so"));
    assert!(missing.what.ends_with("none.so") && missing.problem.contains("cannot be read"), "{missing}");
}

#[test]
fn distinguishes_contact_and_thermal_libraries() {
    let (root, console) = (tempfile::tempdir().unwrap(), Console::new(true, false));
    let [scene, thermal] = ["x86_64-linux.so", "thermal-x86_64-linux.so"].map(|name| root.path().join(name));
    let conducts = [elf(62), tiprub_format::THERMAL_FILE.as_bytes().to_vec()].concat();
    std::fs::write(&scene, elf(62)).unwrap();
    std::fs::write(&thermal, &conducts).unwrap();
    for (unit, bytes, other) in [(LibraryUnit::Scene, elf(62), thermal), (LibraryUnit::Thermal, conducts, scene)] {
        let found = load(unit, &arguments(&[root.path().to_path_buf()], &[]), &console).unwrap();
        assert!(found.len() == 1 && found[0].bytes == bytes, "{unit:?}");
        assert!(load(unit, &arguments(&[other], &[]), &console).unwrap_err().problem.contains("the other kind of FMU"));
    }
}

//! Tests of names, permissions, links and devices.

use super::*;

fn names(directory: &Path) -> Vec<String> {
    let entries = fs::read_dir(directory).unwrap();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn creates_missing_directories_and_leaves_only_the_target() {
    let root = tempfile::tempdir().unwrap();
    let target = root.path().join("a/b/result.csv");
    write(&target, "1\n").unwrap();
    write(&target, "2\n").unwrap();
    assert_eq!(fs::read_to_string(&target).unwrap(), "2\n");
    assert_eq!(names(&root.path().join("a/b")), ["result.csv"]);
}

#[test]
fn abandoned_file_is_removed_and_old_file_is_kept() {
    let root = tempfile::tempdir().unwrap();
    let target = root.path().join("rom.safetensors");
    write(&target, "old").unwrap();
    let file = begin(&target).unwrap();
    assert!(names(root.path()).iter().all(|name| name.starts_with('.') || name == "rom.safetensors"));
    drop(file);
    assert_eq!(names(root.path()), ["rom.safetensors"]);
    assert_eq!(fs::read_to_string(&target).unwrap(), "old");
}

#[test]
#[cfg(unix)]
fn symlinks_are_followed_and_preserved() {
    let root = tempfile::tempdir().unwrap();
    let (real, link) = (root.path().join("elsewhere/real.csv"), root.path().join("link.csv"));
    write(&real, "old").unwrap();
    std::os::unix::fs::symlink(&real, &link).unwrap();
    write(&link, "new").unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read_to_string(&real).unwrap(), "new");
}

#[test]
#[cfg(unix)]
fn dangling_links_are_followed_and_link_loops_reported() {
    let root = tempfile::tempdir().unwrap();
    let [link, chain, circle] = ["link.csv", "chain.csv", "circle"].map(|name| root.path().join(name));
    std::os::unix::fs::symlink("new.csv", &link).unwrap();
    std::os::unix::fs::symlink("link.csv", &chain).unwrap();
    std::os::unix::fs::symlink("circle", &circle).unwrap();
    write(&chain, "new").unwrap();
    assert!([&link, &chain].iter().all(|link| fs::symlink_metadata(link).unwrap().is_symlink()));
    assert_eq!(fs::read_to_string(root.path().join("new.csv")).unwrap(), "new");
    assert!(write(&circle, "x").unwrap_err().problem.contains("loop"));
}

#[cfg(unix)]
fn mode(path: &Path) -> u32 {
    use std::os::unix::fs::PermissionsExt;
    fs::metadata(path).unwrap().permissions().mode() & 0o7777
}

/// The umask belongs to the whole process; a file that the system creates shows its value.
#[test]
#[cfg(unix)]
fn files_follow_the_umask_or_keep_permissions() {
    use std::os::unix::fs::PermissionsExt;
    let root = tempfile::tempdir().unwrap();
    let [plain, target] = ["plain", "target"].map(|name| root.path().join(name));
    fs::write(&plain, "").unwrap();
    write(&target, "1").unwrap();
    assert_eq!(mode(&target), mode(&plain));
    for kept in [0o600, 0o640, 0o755] {
        fs::set_permissions(&target, fs::Permissions::from_mode(kept)).unwrap();
        write(&target, "2").unwrap();
        assert_eq!(mode(&target), kept);
    }
}

/// If the file system does not support unnamed files, hidden ones are used.
#[test]
#[cfg(unix)]
fn hidden_temporary_file_gives_the_same_result() {
    let root = tempfile::tempdir().unwrap();
    let [plain, target] = ["plain", "target"].map(|name| root.path().join(name));
    fs::write(&plain, "").unwrap();
    let named = temporary().tempfile_in(root.path()).unwrap();
    let mut draft = PendingFile { file: named.reopen().unwrap(), named: Some(named) };
    draft.write_all(b"bytes").unwrap();
    persist(draft, &target).unwrap();
    assert_eq!((fs::read_to_string(&target).unwrap().as_str(), mode(&target)), ("bytes", mode(&plain)));
    assert_eq!(names(root.path()).len(), 2);
}

#[test]
#[cfg(target_os = "linux")]
fn unfinished_file_is_not_visible_in_the_directory() {
    let root = tempfile::tempdir().unwrap();
    let draft = begin(&root.path().join("x")).unwrap();
    // If the file system supports unnamed files.
    assert!(draft.named.is_some() || names(root.path()).is_empty());
}

#[test]
fn rejects_invalid_names_before_any_work() {
    let root = tempfile::tempdir().unwrap();
    for name in ["", ".", "..", "missing/", &"l".repeat(300)] {
        let target = if name.is_empty() { PathBuf::new() } else { root.path().join(name) };
        assert!(try_target(&target).is_err() && begin(&target).is_err(), "{name}");
    }
    try_target(&root.path().join("a/b/c")).unwrap();
    assert_eq!(names(root.path()).len(), 0);
}

/// Links replace the devices here, since replacing a real device would damage the machine that runs the tests.
#[test]
#[cfg(target_os = "linux")]
fn devices_are_written_to_and_never_replaced() {
    let root = tempfile::tempdir().unwrap();
    for (device, works) in [("/dev/null", true), ("/dev/full", false)] {
        let link = root.path().join("device");
        std::os::unix::fs::symlink(device, &link).unwrap();
        let outcome = write(&link, "bytes");
        assert_eq!(outcome.is_ok(), works, "{device}");
        assert!(outcome.err().is_none_or(|failure| failure.problem.contains("cannot be written")), "{device}");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink(), "{device} was replaced");
        assert_eq!(names(root.path()), ["device"]);
        fs::remove_file(&link).unwrap();
    }
}

#[test]
fn a_directory_is_not_a_target() {
    let root = tempfile::tempdir().unwrap();
    let failure = write(root.path(), "x").unwrap_err();
    assert!(failure.problem.contains("is a directory"), "{failure}");
    assert_eq!(names(root.path()).len(), 0);
}

#[test]
fn protects_only_files_with_different_contents() {
    let root = tempfile::tempdir().unwrap();
    let target = root.path().join("scene.toml");
    refuse_to_replace(&target, "old", "Move it").unwrap();
    write(&target, "old").unwrap();
    refuse_to_replace(&target, "old", "Move it").unwrap();
    let failure = refuse_to_replace(&target, "new", "Move it").unwrap_err();
    assert!(failure.what.ends_with("scene.toml") && failure.remedy == "Move it", "{failure}");
}

#[test]
fn write_check_of_a_directory_leaves_no_files() {
    let root = tempfile::tempdir().unwrap();
    try_directory(&root.path().join("a/b")).unwrap();
    assert_eq!(names(root.path()).len(), 0);
    fs::create_dir(root.path().join("there")).unwrap();
    try_directory(&root.path().join("there")).unwrap();
    assert_eq!(names(root.path()), ["there"]);
    assert_eq!(names(&root.path().join("there")).len(), 0);
    fs::write(root.path().join("file"), "").unwrap();
    for bad in ["file", "file/inside"] {
        let failure = try_directory(&root.path().join(bad)).unwrap_err();
        assert!(failure.problem.contains("cannot create the directory"), "{failure}");
    }
    // The directory exists, but no files can be created in it.
    #[cfg(target_os = "linux")]
    assert!(try_directory(Path::new("/proc/self")).unwrap_err().problem.contains("cannot write to this directory"));
}

#[test]
fn reports_a_target_that_cannot_be_written() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("file"), "").unwrap();
    let failure = write(&root.path().join("file/inside.csv"), "x").unwrap_err();
    assert!(failure.problem.contains("cannot create the directory"), "{failure}");
}

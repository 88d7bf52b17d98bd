//! Outputs and inputs as files: pipes, names, permissions, and no replacement by accident.

use std::{fs, path::PathBuf, process::Command};

use crate::project::{Project, SCENE, json};

#[test]
#[cfg(target_os = "linux")]
fn failed_write_to_stdout_is_a_failure() {
    let project = Project::new();
    let onto = |stdout: fs::File| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        command.current_dir(project.root.path()).args(["run", "scene.toml", "--csv", "-", "-q"]);
        command.stdout(stdout).output().unwrap()
    };
    let full = onto(fs::OpenOptions::new().write(true).open("/dev/full").unwrap());
    assert_eq!(full.status.code(), Some(1));
    let message = String::from_utf8(full.stderr).unwrap();
    assert!(message.contains("stdout: cannot be written"), "{message}");
    let good = onto(fs::File::create(project.path("good.csv")).unwrap());
    assert_eq!(good.status.code(), Some(0));
}

#[test]
#[cfg(unix)]
fn accepts_file_names_that_are_not_utf8() {
    use std::{ffi::OsStr, os::unix::ffi::OsStrExt};
    let project = Project::new();
    let odd = OsStr::from_bytes(b"a\xffb");
    let run = |words: &[&str], last: &OsStr| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
        command.current_dir(project.root.path()).arg("--json").arg("--quiet").args(words).arg(last).output().unwrap()
    };
    let csv = run(&["run", "scene.toml", "--csv"], odd);
    assert_eq!(csv.status.code(), Some(0), "{csv:?}");
    assert_eq!(json(&csv)["csv"], "a\u{fffd}b");
    assert!(fs::read_to_string(project.path("").join(odd)).unwrap().starts_with("time,"));
    fs::remove_file(project.path("").join(odd)).unwrap();
    let package = run(&["package", "scene.toml", "--library", "library.so", "-o"], odd);
    assert_eq!(package.status.code(), Some(0), "{package:?}");
    assert!(json(&package)["fmus"][0]["file"].as_str().unwrap().starts_with("a\u{fffd}b/"));
    let scene = OsStr::from_bytes(b"s\xff.toml");
    fs::write(project.path("").join(scene), SCENE).unwrap();
    let inspect = run(&["inspect"], scene);
    assert_eq!((inspect.status.code(), &json(&inspect)["kind"]), (Some(0), &"scene".into()), "{inspect:?}");
}

/// A table of results must not be replaced by one of the files that `--vtk` writes.
#[test]
fn rejects_results_with_names_of_vtk_files() {
    let project = Project::new();
    fs::create_dir(project.path("fields")).unwrap();
    for (option, file, directory) in [
        ("--csv", "fields/rotor_000001.vtu", "fields"),
        ("--csv", "fields/../fields/x.VTU", "fields"),
        ("--report", "new/fields.pvd", "./new"),
        ("--csv", "x.vtu", "."),
    ] {
        let error = project.fail(&["run", "scene.toml", option, file, "--vtk", directory, "--force"], 2);
        assert!(error.contains(&format!("{option} {file}")) && error.contains("--vtk"), "{error}");
    }
    for (option, file, directory) in
        [("--csv", "new", "new"), ("--parquet", "./new", "new/"), ("--report", "new", "new/a/b")]
    {
        let error = project.fail(&["run", "scene.toml", option, file, "--vtk", directory, "--force"], 2);
        assert!(error.contains(&format!("{option} {file}: is a directory of --vtk {directory}")), "{error}");
    }
    assert!(!project.path("new").exists());
    project.succeed(&["run", "scene.toml", "--csv", "fields/run.csv", "--vtk", "fields", "--force"]);
}

#[cfg(unix)]
fn pipe(project: &Project, name: &str) -> PathBuf {
    let path = project.path(name);
    assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    path
}

#[test]
#[cfg(unix)]
fn rejects_pipes_as_inputs_and_stdout_twice() {
    let project = Project::new();
    for name in ["pipe", "pipe.toml", "pipe.fmu", "pipe.safetensors", "pipe.inp", "pipe.so"] {
        pipe(&project, name);
    }
    std::os::unix::fs::symlink("/dev/zero", project.path("zero.toml")).unwrap();
    let mesh = ["--contact-set", "A", "--clamp-set", "B"];
    for words in [
        &["run", "pipe"][..],
        &["run", "zero.toml"],
        &["package", "pipe.toml", "-o", "out"],
        &["package", "scene.toml", "-o", "out", "--library", "pipe.so"],
        &["inspect", "pipe.toml"],
        &["inspect", "zero.toml"],
        &["inspect", "pipe.fmu"],
        &["inspect", "pipe.safetensors"],
        &["inspect", "pipe"],
        &[&["reduce", "blade", "pipe.inp"], &mesh[..]].concat(),
    ] {
        let message = project.fail(words, 1);
        assert!(message.contains("pipe or a device"), "{message}");
    }
    // Stdout is a pipe here, and receives the summary.
    for words in [&["run", "scene.toml", "--csv", "/dev/stdout"][..], &["reduce", "rotor37", "-o", "/proc/self/fd/1"]] {
        let message = project.fail(words, 2);
        assert!(message.contains("is the same file as stdout"), "{message}");
    }
    project.succeed(&["run", "scene.toml", "--csv", "/dev/null"]);
}

#[test]
#[cfg(unix)]
fn waits_for_the_reader_of_a_pipe_with_a_message() {
    use std::io::{BufRead, BufReader};
    let project = Project::new();
    let path = pipe(&project, "pipe");
    let mut command = Command::new(env!("CARGO_BIN_EXE_tiprub"));
    command.current_dir(project.root.path()).args(["run", "scene.toml", "--quiet", "--csv", "pipe"]);
    let mut child = command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped()).spawn().unwrap();
    let said =
        BufReader::new(child.stderr.take().unwrap()).lines().find(|line| line.as_ref().unwrap().contains("pipe"));
    assert_eq!(said.unwrap().unwrap(), "pipe is a pipe without a reader: waiting for one");
    let read = fs::read_to_string(&path).unwrap();
    assert!(child.wait().unwrap().success());
    assert_eq!(read, project.succeed(&["run", "scene.toml", "--quiet", "--csv", "-"]));
}

#[test]
#[cfg(unix)]
fn rejects_outputs_that_coincide_with_other_files() {
    let project = Project::new();
    fs::hard_link(project.path("scene.toml"), project.path("hard.csv")).unwrap();
    std::os::unix::fs::symlink("small.rom.safetensors", project.path("soft.csv")).unwrap();
    fs::create_dir(project.path("out")).unwrap();
    fs::write(project.path("out/scene.json"), SCENE).unwrap();
    fs::copy(project.path("library.so"), project.path("library.fmu")).unwrap();
    let inputs = "time,speed\n0,1000\n0.05,1100\n";
    fs::write(project.path("speed.csv"), inputs).unwrap();
    std::os::unix::fs::symlink("speed.csv", project.path("link.csv")).unwrap();
    let before = project.files();
    for words in [
        &["run", "scene.toml", "--csv", "scene.toml"][..],
        &["run", "scene.toml", "--csv", "./out/../scene.toml"],
        &["run", "scene.toml", "--csv", "hard.csv"],
        &["run", "scene.toml", "--csv", "soft.csv"],
        &["run", "scene.toml", "--inputs", "speed.csv", "--csv", "speed.csv"],
        &["run", "scene.toml", "--inputs", "speed.csv", "--csv", "link.csv"],
        &["reduce", "rotor37", "-o", "x", "--vtk", "x"],
        &["reduce", "rotor37", "-o", "new/x", "--inp", "new/y/../x"],
        &["reduce", "blade", "small.msh", "-o", "y", "--vtk", "small.msh", "--force"],
        &["package", "scene.toml", "--fmi", "2", "--library", "library.fmu", "-o", "library.fmu"],
        &["demo", "--out", "out", "--library", "out/report.html"],
    ] {
        fs::write(project.path("small.msh"), "").unwrap();
        fs::write(project.path("out/report.html"), "").unwrap();
        let message = project.fail(words, 2);
        assert!(message.contains("is the same file as"), "{message}");
    }
    let message = project.fail(&["study", "map", "out/scene.json", "--out", "out"], 2);
    assert!(message.contains("which this command may overwrite"), "{message}");
    assert_eq!(fs::read_to_string(project.path("scene.toml")).unwrap(), SCENE);
    assert_eq!(fs::read_to_string(project.path("speed.csv")).unwrap(), inputs);
    assert_eq!(project.files().len(), before.len() + 1);
}

#[test]
#[cfg(unix)]
fn new_files_follow_the_umask() {
    use std::os::unix::fs::PermissionsExt;
    let project = Project::new();
    for (mask, mode) in [("077", 0o600), ("022", 0o644), ("002", 0o664)] {
        let line = format!("umask {mask}; exec \"$0\" run scene.toml --quiet --csv {mask}.csv");
        let mut shell = Command::new("sh");
        shell.current_dir(project.root.path()).args(["-c", &line, env!("CARGO_BIN_EXE_tiprub")]);
        assert!(shell.output().unwrap().status.success());
        let made = fs::metadata(project.path(&format!("{mask}.csv"))).unwrap().permissions().mode();
        assert_eq!(made & 0o777, mode, "umask {mask}");
    }
}

/// The same files give the same archive, independent of the umask.
#[test]
#[cfg(target_os = "linux")]
fn archives_of_a_release_do_not_depend_on_the_umask() {
    let root = tempfile::tempdir().unwrap();
    let script = format!(
        "set -eu\n\
         eval \"$(sed -n '/^tarred() {{/,/^}}/p' {}/release.sh)\"\n\
         export SOURCE_DATE_EPOCH=0\n\
         for mask in 077 002; do\n\
             out=$PWD/$mask\n\
             (umask $mask; mkdir -p $out/tree/below; echo x > $out/tree/below/file; touch $out/tree/run; chmod u+x $out/tree/run)\n\
             tarred $out tree name\n\
         done\n\
         cmp 077/name.tar.gz 002/name.tar.gz",
        env!("CARGO_MANIFEST_DIR")
    );
    let output = Command::new("bash").current_dir(root.path()).args(["-c", &script]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&[output.stdout, output.stderr].concat()));
}

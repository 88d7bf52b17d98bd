//! Files and results that a sweep does not replace.

use super::*;

/// A changed plan, ROM or scene does not replace finished runs.
#[test]
fn edited_plan_keeps_results_of_removed_runs() {
    let bench = Bench::new();
    bench.run(GRID, "a.parquet");
    let whole = bench.table("a.parquet");
    let rejected = |plan: &str, output: &str, runs: &str| {
        let failure = bench.try_part(plan, output, Part::WHOLE, 1).unwrap_err();
        assert!(failure.problem.contains(&format!("results of {runs} that the plan no longer has")), "{failure}");
    };
    rejected(&format!("stop = 0.005\n{GRID}"), "a.parquet", "6 runs");
    rejected(&GRID.replace("values = [5e-4, 1e-3]", "values = [1e-3]"), "a.parquet", "3 runs");
    fs::write(bench.path("small.rom.safetensors"), tiprub_format::write_rom(&rom(2e5))).unwrap();
    rejected(GRID, "a.parquet", "6 runs");
    fs::write(bench.path("small.rom.safetensors"), tiprub_format::write_rom(&rom(1e5))).unwrap();
    fs::write(bench.path("scene.toml"), SCENE.replace("friction = 0.1", "friction = 0.2")).unwrap();
    rejected(GRID, "a.parquet", "6 runs");
    assert_eq!(bench.run(GRID, "b.parquet").resumed, 0);
    assert!(bench.table("a.parquet") == whole && !bench.path("a.parquet.journal").exists());
    // A journal of an interrupted sweep is kept as well.
    let row = Row::without_results(&"0".repeat(64), Status::Failed, &Failure::new("a", "b", "c"), 1.0);
    Journal::open(&bench.path("c.parquet.journal")).unwrap().0.append(&row).unwrap();
    rejected(GRID, "c.parquet", "1 run");
    assert!(bench.path("c.parquet.journal").exists() && !bench.path("c.parquet").exists());
}

/// A part does not replace finished runs of another part, or runs that move to another part when values are added to the plan.
#[test]
fn results_of_runs_of_other_parts_are_kept() {
    let bench = Bench::new();
    let [first, second] = [1, 2].map(|number| Part::new(number, 2).unwrap());
    bench.try_part(GRID, "two.parquet", second, 1).unwrap();
    let whole = bench.table("two.parquet");
    let longer = GRID.replace("to = 120, count = 3", "to = 160, count = 5");
    for (plan, part, runs) in [(&longer, second, "2 runs"), (&GRID.to_owned(), first, "3 runs")] {
        let failure = bench.try_part(plan, "two.parquet", part, 1).unwrap_err();
        assert!(failure.problem.contains(&format!("results of {runs} that this part does not have")), "{failure}");
    }
    assert_eq!(bench.table("two.parquet"), whole);
    assert_eq!(bench.run(GRID, "two.parquet").resumed, 3, "the whole plan has all runs of its parts");
}

/// Journals and outputs over time of other runs are kept, and the error names their file.
#[test]
fn journals_and_outputs_over_time_of_other_runs_are_kept() {
    let bench = Bench::new();
    let plan = format!("{GRID}[histories]\noutputs = [\"torque\"]\n");
    bench.run(&plan, "a.parquet");
    let row = Row::without_results(&"0".repeat(64), Status::Failed, &Failure::new("a", "b", "c"), 1.0);
    Journal::open(&bench.path("a.parquet.journal")).unwrap().0.append(&row).unwrap();
    let failure = bench.try_part(&plan, "a.parquet", Part::WHOLE, 1).unwrap_err();
    assert!(failure.to_string().contains("a.parquet.journal: contains the results of 1 run "), "{failure}");
    fs::remove_file(bench.path("a.parquet.journal")).unwrap();
    fs::rename(bench.path("a.parquet"), bench.path("b.parquet")).unwrap();
    let other = plan.replace("to = 120", "to = 110");
    let failure = bench.try_part(&other, "a.parquet", Part::WHOLE, 1).unwrap_err();
    assert!(failure.to_string().contains("a.histories.parquet: contains the outputs over time of other"), "{failure}");
    assert!(!bench.path("a.parquet.journal").exists());
}

/// A plan does not replace the results of another plan with the same name. An edited or copied plan continues with its rows.
#[test]
fn plan_keeps_results_of_another_plan_with_the_same_name() {
    let bench = Bench::new();
    bench.run(GRID, "a.parquet");
    let whole = bench.table("a.parquet");
    let edited = bench.run(&GRID.replace("count = 3", "count = 5"), "a.parquet");
    assert_eq!((edited.runs, edited.resumed), (10, 6));
    fs::remove_file(bench.path("a.parquet")).unwrap();
    bench.run(GRID, "a.parquet");
    let elsewhere = Bench::new();
    fs::copy(bench.path("a.parquet"), elsewhere.path("a.parquet")).unwrap();
    assert_eq!(elsewhere.run(GRID, "a.parquet").resumed, 6, "a copy of the plan");
    fs::copy(bench.path("a.parquet"), elsewhere.path("a.parquet")).unwrap();
    let other = GRID.replace("to = 120", "to = 110");
    let failure = elsewhere.try_part(&other, "a.parquet", Part::WHOLE, 1).unwrap_err();
    assert!(failure.problem.contains("results of another plan that is also named `plan`"), "{failure}");
    fs::copy(elsewhere.path("a.parquet"), bench.path("b.parquet")).unwrap();
    let copied = bench.path("copy.toml");
    fs::write(&copied, other).unwrap();
    let copied = Plan::load(&copied, &bench).unwrap();
    let failure = bench.sweep(&copied, "b.parquet", Part::WHOLE, 1).unwrap_err();
    assert!(failure.problem.contains("results of the plan `plan`, not of `"), "{failure}");
    assert!(failure.problem.contains("copy.toml") && failure.remedy.contains("--output"), "{failure}");
    assert_eq!(elsewhere.table("a.parquet"), whole);
}

#[test]
fn other_files_are_never_replaced() {
    let bench = Bench::new();
    fs::write(bench.path("a.parquet"), "my own file").unwrap();
    let failure = bench.try_part(GRID, "a.parquet", Part::WHOLE, 1).unwrap_err();
    assert!(failure.problem.contains("not the result of a sweep"), "{failure}");
    assert_eq!(fs::read_to_string(bench.path("a.parquet")).unwrap(), "my own file");
}

/// A sweep never replaces a file that no sweep wrote, even if it has the columns of results.
#[test]
fn files_of_users_are_not_replaced() {
    let bench = Bench::new();
    let cells = |name: &str| tiprub_table::Column::new(name, vec![Some(Cell::Text("mine".into()))]);
    let mine = Table { columns: vec![cells("status"), cells("digest")] };
    parquet_file::write(&bench.path("mine.parquet"), &mine, &[]).unwrap();
    let failure = bench.try_part(GRID, "mine.parquet", Part::WHOLE, 1).unwrap_err();
    assert!(failure.problem.contains("not the result of a sweep"), "{failure}");
    fs::write(bench.path("a.histories.parquet"), "mine").unwrap();
    let plan = format!("{GRID}[histories]\noutputs = [\"torque\"]\n");
    let failure = bench.try_part(&plan, "a.parquet", Part::WHOLE, 1).unwrap_err();
    assert!(failure.what.contains("a.histories.parquet"), "{failure}");
    assert_eq!(fs::read_to_string(bench.path("a.histories.parquet")).unwrap(), "mine");
    let [two, three] = ["part.2", "part.3"].map(|name| SweepFiles::new(&bench.path(name)).histories);
    assert_ne!(two, three);
}

/// The results of the plan `a.histories` have the name of the outputs over time of the plan `a`.
#[test]
fn outputs_over_time_do_not_replace_results_of_another_plan() {
    let bench = Bench::new();
    let plan = format!("{GRID}[histories]\noutputs = [\"torque\"]\n");
    bench.run(&plan, "a.parquet");
    fs::remove_file(bench.path("a.histories.parquet")).unwrap();
    bench.run(GRID, "a.histories.parquet");
    let results = fs::read(bench.path("a.histories.parquet")).unwrap();
    let failure = bench.try_part(&plan, "a.parquet", Part::WHOLE, 1).unwrap_err();
    assert!(failure.to_string().contains("a.histories.parquet: contains the results of another sweep"), "{failure}");
    assert_eq!(fs::read(bench.path("a.histories.parquet")).unwrap(), results);
    fs::remove_file(bench.path("a.histories.parquet")).unwrap();
    bench.run(&plan, "a.parquet");
    let failure = bench.try_part(GRID, "a.histories.parquet", Part::WHOLE, 1).unwrap_err();
    assert!(failure.problem.contains("is not the result of a sweep"), "{failure}");
}

/// A sweep locks its journal. If another sweep removes the journal just after it was opened, it is opened again.
#[test]
fn simultaneous_sweeps_compute_each_run_once() {
    for round in 0..20 {
        let bench = Bench::new();
        let plan = bench.plan(GRID).unwrap();
        let sweep = || loop {
            match bench.sweep(&plan, "a.parquet", Part::WHOLE, 1) {
                Ok(outcome) => return outcome.finished - outcome.resumed,
                Err(failure) => assert!(failure.problem.contains("another process"), "{failure}"),
            }
        };
        let computed: Vec<usize> = std::thread::scope(|scope| {
            let sweeps: Vec<_> = (0..4).map(|_| scope.spawn(sweep)).collect();
            sweeps.into_iter().map(|sweep| sweep.join().unwrap()).collect()
        });
        assert_eq!(computed.iter().sum::<usize>(), 6, "round {round}: {computed:?}");
        assert_eq!(bench.table("a.parquet").rows(), 6);
        assert!(!bench.path("a.parquet.journal").exists());
    }
}

/// Values that no sweep wrote are never taken over.
#[test]
fn damaged_results_are_rejected() {
    let bench = Bench::new();
    bench.run(GRID, "a.parquet");
    let (path, whole) = (bench.path("a.parquet"), bench.table("a.parquet"));
    let bytes = fs::read(&path).unwrap();
    let mut damaged = 0;
    for place in (0..bytes.len()).step_by(97) {
        let mut other = bytes.clone();
        other[place] ^= 4;
        fs::write(&path, &other).unwrap();
        match bench.try_part(GRID, "a.parquet", Part::WHOLE, 1) {
            Ok(outcome) => assert!(outcome.resumed == 6 && bench.table("a.parquet") == whole, "{place}"),
            Err(failure) => {
                damaged += usize::from(failure.problem.contains("is damaged"));
                assert_eq!(fs::read(&path).unwrap(), other, "{failure}");
            }
        }
        assert!(!bench.path("a.parquet.journal").exists(), "{place}");
    }
    assert!(damaged > 5, "{damaged}");
}

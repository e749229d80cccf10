//! Shards on schedulers: which one a process is, how far all are, and the scripts that start them.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::process::{signal, wait_until};
use crate::support::{Answer, Bench, Json, SMALL, has_keys};

/// 96 static cases, one a block.
const STUDY: &str = r#"
name = "moved"
scenario = "s.toml"
mode = "static"
replanned_cases = 2
seed = 1
[sampling]
samples = 48
[[factors]]
name = "along"
key = "phantom.position_mm[0]"
range = [-20, 20]
relative = true
[[factors]]
name = "height"
key = "robot.base_position_mm[2]"
role = "control"
values = [790, 800]
"#;

/// A task of a scheduler.
fn task(bench: &Bench, variables: &[(&str, &str)]) -> Answer {
    let mut all = vec![];
    for name in [
        "NEEDLEBENCH_SHARD",
        "NEEDLEBENCH_SHARDS",
        "SLURM_ARRAY_TASK_ID",
        "SLURM_ARRAY_TASK_MIN",
        "SLURM_ARRAY_TASK_MAX",
        "SLURM_ARRAY_TASK_COUNT",
        "JOB_COMPLETION_INDEX",
        "PBS_ARRAY_INDEX",
        "AWS_BATCH_JOB_ARRAY_INDEX",
        "AWS_BATCH_JOB_ARRAY_SIZE",
    ] {
        let set = variables.iter().find(|(each, _)| *each == name);
        all.push((name, set.map(|(_, value)| *value)));
    }
    let arguments = "study study.toml --shard auto --out shards --resume --yes --quiet --jobs 1";
    bench.run_with(&all, arguments)
}

fn status(bench: &Bench, more: &str) -> Answer {
    let arguments = format!("study study.toml --status shards {more}");
    bench.run_with(&[("NEEDLEBENCH_SHARDS", None)], &arguments)
}

#[test]
fn shards_of_any_scheduler_are_told_apart_counted_and_merged_from_their_folder() {
    let bench = Bench::with_study(STUDY);
    status(&bench, "--missing")
        .exits_with(2)
        .complains(["the number of shards is unknown", "NEEDLEBENCH_SHARDS"]);
    task(&bench, &[])
        .exits_with(2)
        .complains(["--shard auto", "SLURM_ARRAY_TASK_ID"]);
    task(
        &bench,
        &[("JOB_COMPLETION_INDEX", "4"), ("NEEDLEBENCH_SHARDS", "4")],
    )
    .exits_with(2)
    .complains([
        "JOB_COMPLETION_INDEX=4, NEEDLEBENCH_SHARDS=4",
        "from 0 to 3",
    ]);
    let of = |name, value| [(name, value), ("NEEDLEBENCH_SHARDS", "4")];
    task(&bench, &of("JOB_COMPLETION_INDEX", "0"))
        .exits_with(0)
        .complains(["shard 1/4, by Kubernetes (JOB_COMPLETION_INDEX=0, NEEDLEBENCH_SHARDS=4)"]);
    task(&bench, &of("PBS_ARRAY_INDEX", "2")).exits_with(0);
    let answer = status(&bench, "").exits_with(1);
    assert_eq!(
        answer.stdout,
        "moved: 48 of 96 cases complete, in shards of 4\n\
         done         2  1,2\n\
         running      0\n\
         stopped      0\n\
         missing      2  3,4\n\
         to start or restart: 3,4\n"
    );
    assert_eq!(status(&bench, "--missing").exits_with(1).stdout, "3,4\n");
    let merge = "merge study.toml shards --no-page --quiet";
    bench
        .run(merge)
        .exits_with(2)
        .complains(["48 of 96 cases are missing", "shard 3/4"]);
    // Asked for again in an array of its own.
    task(
        &bench,
        &[
            ("SLURM_ARRAY_TASK_ID", "4"),
            ("SLURM_ARRAY_TASK_MIN", "3"),
            ("SLURM_ARRAY_TASK_MAX", "4"),
            ("SLURM_ARRAY_TASK_COUNT", "2"),
            ("NEEDLEBENCH_SHARDS", "4"),
        ],
    )
    .exits_with(0)
    .complains(["shard 4/4, by Slurm"]);
    task(&bench, &of("AWS_BATCH_JOB_ARRAY_INDEX", "2")).exits_with(0);
    let answer = status(&bench, "--json").exits_with(0).json();
    has_keys(
        &answer,
        "schema_version name study_id complete cases done blocks shards mixed missing running folders",
    );
    assert_eq!(answer["complete"], true);
    assert_eq!(answer["folders"].list().len(), 4);
    assert_eq!(status(&bench, "--missing").exits_with(0).stdout, "");
    bench.run(merge).exits_with(0);
    let whole = "study study.toml --out whole --no-page --quiet";
    bench.run(whole).exits_with(0);
    for file in ["results.parquet", "summary.json"] {
        assert!(
            bench.read(&format!("out/moved/{file}")) == bench.read(&format!("whole/moved/{file}")),
            "{file}"
        );
    }
}

#[test]
fn a_folder_in_use_may_pass_and_a_wrong_one_never_does() {
    let bench = Bench::with_study(STUDY);
    let of = [("PBS_ARRAY_INDEX", "2"), ("NEEDLEBENCH_SHARDS", "4")];
    task(&bench, &of).exits_with(0);
    let manifest = bench.text("shards/2/moved/study.json");
    bench.write(
        "shards/2/moved/study.json",
        manifest.replace("\"complete\"", "\"running\""),
    );
    // In the middle of a block.
    let journal = std::fs::File::options()
        .write(true)
        .open(bench.path("shards/2/moved/journal.nbj"))
        .unwrap();
    journal
        .set_len(journal.metadata().unwrap().len() - 10)
        .unwrap();
    journal.try_lock().unwrap();
    task(&bench, &of)
        .exits_with(3)
        .complains(["another process is writing here"]);
    bench
        .run("merge study.toml shards --quiet")
        .exits_with(3)
        .complains(["another process is writing here"]);
    let running = status(&bench, "--json").exits_with(1).json();
    assert_eq!(running["running"], serde_json::json!([2]));
    assert_eq!(running["folders"][0]["state"], "running");
    assert_eq!(running["done"], 23);
    assert_eq!(running["missing"], serde_json::json!([1, 3, 4]));
    drop(journal);
    task(&bench, &of).exits_with(0);
    let arguments = "study study.toml --shard 1/3 --out shards/2 --resume";
    bench
        .run(arguments)
        .exits_with(2)
        .complains(["holds shard 2/4"]);
}

/// Runs a line of a shell in the bench's folder.
fn shell(bench: &Bench, line: &str) -> Answer {
    let mut command = Command::new("bash");
    command.args(["-c", line]).current_dir(bench.path("."));
    command.env("PROGRAM", env!("CARGO_BIN_EXE_needlebench"));
    Answer::of(command.stdin(Stdio::null()).output().unwrap())
}

#[test]
fn more_shards_than_a_process_may_have_files_are_merged_and_counted() {
    const SHARDS: u32 = 288;
    const LANES: u32 = 4;
    let bench = Bench::with_study(&STUDY.replace("samples = 48", "samples = 144"));
    bench
        .run("study study.toml --out whole --no-page --quiet")
        .exits_with(0);
    let compute = |part: u32| {
        let (shard, out) = (format!("{part}/{SHARDS}"), format!("shards/{part}"));
        let arguments = format!("study study.toml --shard {shard} --out {out} --quiet --jobs 1");
        bench.run(arguments).exits_with(0);
    };
    // They wait for the disk most of the time.
    std::thread::scope(|scope| {
        for lane in 1..=LANES {
            let compute = &compute;
            scope.spawn(move || (lane..=SHARDS).step_by(LANES as usize).for_each(compute));
        }
    });
    for command in [
        "study study.toml --status shards",
        "merge study.toml shards --no-page --quiet --jobs 3",
    ] {
        shell(
            &bench,
            &format!("ulimit -n 64 && exec \"$PROGRAM\" {command}"),
        )
        .exits_with(0);
    }
    assert!(bench.read("out/moved/results.parquet") == bench.read("whole/moved/results.parquet"));
}

#[test]
fn a_launch_is_refused_where_it_cannot_go_well_and_writes_the_same_bytes_elsewhere() {
    let bench = Bench::with_study(STUDY);
    let launch = |what: &str| bench.run(format!("study study.toml --launch {what}"));
    launch("slurm:97")
        .exits_with(2)
        .complains(["the study has 96 blocks of 1 cases", "slurm:96"]);
    launch("lsf:4").exits_with(2).complains(["slurm:N"]);
    let answer = launch("slurm:8").exits_with(0);
    answer.says([
        "start:\n  sbatch out/moved/launch/job.sh\n",
        "start missing shards:\n  sh out/moved/launch/missing.sh\n",
        "merge:\n  sh out/moved/launch/merge.sh\n",
        "  needlebench study study.toml --status out/moved/shards\n",
    ]);
    answer.complains(["a shard takes about 1 s", "5 min"]);
    let files = bench.tree("out/moved");
    let texts = || {
        files
            .iter()
            .map(|file| bench.read(&format!("out/moved/{}", file.display())))
    };
    let before: Vec<Vec<u8>> = texts().collect();
    launch("slurm:8").exits_with(0);
    assert_eq!(texts().collect::<Vec<_>>(), before);
    let answer = bench
        .run("study study.toml --launch kubernetes:8 --json")
        .exits_with(0)
        .json();
    has_keys(
        &answer,
        "schema_version folder shards blocks files steps advice",
    );
    assert!(bench.path("out/moved/launch/job.yaml").is_file());
    // What would start shards of another number is gone.
    assert!(!bench.path("out/moved/launch/job.sh").exists());
}

#[test]
fn local_shards_are_killed_and_stopped_and_end_with_the_same_bytes() {
    let bench = Bench::new();
    // Whatever a folder is called.
    let folder = "jo's $(touch pwned) \"study\" 50%";
    std::fs::create_dir(bench.path(folder)).unwrap();
    bench.write(&format!("{folder}/s.toml"), SMALL);
    let study = STUDY.replace("samples = 48", "samples = 192");
    bench.write(&format!("{folder}/study.toml"), study);
    bench.write("folder", folder);
    let inside = "cd \"$(cat folder)\" && ";
    shell(
        &bench,
        &format!("{inside} \"$PROGRAM\" study study.toml --launch local:3"),
    )
    .exits_with(0);
    let whole = "study study.toml --out whole --no-page --quiet";
    shell(&bench, &format!("{inside} \"$PROGRAM\" {whole}")).exits_with(0);
    // Stopped in the middle, it leaves nothing running and goes on.
    let script = bench.path(folder).join("out/moved/launch/run.sh");
    let start = || {
        let mut command = Command::new("bash");
        command.arg(&script).stdin(Stdio::null());
        command.spawn().unwrap()
    };
    let mut launched = start();
    let shards = bench.path(folder).join("out/moved/shards");
    wait_until("a journal", || (journals(&shards) > 0).then_some(()));
    signal("TERM", i64::from(launched.id()));
    assert_eq!(launched.wait().unwrap().code(), Some(130));
    assert_eq!(shards_in(&bench.path(folder)), Vec::<i64>::new());
    // Shards that are killed are started again.
    let mut launched = start();
    let running = wait_until("a shard", || {
        Some(shards_in(&bench.path(folder))).filter(|shards| !shards.is_empty())
    });
    for shard in running {
        signal("KILL", shard);
    }
    assert_eq!(launched.wait().unwrap().code(), Some(0));
    let merge = bench.path(folder).join("out/moved/launch/merge.sh");
    let merged = Command::new(merge)
        .args(["--no-page", "--quiet"])
        .output()
        .unwrap();
    assert!(merged.status.success(), "{merged:?}");
    let table = |place: &str| bench.read(&format!("{folder}/{place}/moved/results.parquet"));
    assert!(table("out") == table("whole"));
    assert!(!bench.path("pwned").exists() && !bench.path(folder).join("pwned").exists());
}

fn journals(shards: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(shards) else {
        return 0;
    };
    let has = |path: PathBuf| path.join("moved/journal.nbj").exists();
    entries
        .filter(|entry| has(entry.as_ref().unwrap().path()))
        .count()
}

/// Shards that are computed in a folder.
fn shards_in(folder: &Path) -> Vec<i64> {
    let folder = folder.canonicalize().unwrap();
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let processes = processes.filter(|process| {
        let line = std::fs::read(process.path().join("cmdline")).unwrap_or_default();
        let there = std::fs::read_link(process.path().join("cwd")).unwrap_or_default();
        String::from_utf8_lossy(&line).contains("--shard\0auto") && there == folder
    });
    let ids = processes.filter_map(|process| process.file_name().to_str()?.parse().ok());
    ids.collect()
}

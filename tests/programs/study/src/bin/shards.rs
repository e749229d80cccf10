//! Shards of a study without physics, by the thousand: what it costs to merge them.
//!
//! ```text
//! cargo run --release -p needlebench-programs-study --bin shards -- make FOLDER CASES SHARDS THREADS
//! cargo run --release -p needlebench-programs-study --bin shards -- merge OUT FOLDER THREADS
//! ```
//!
//! Shards are made in processes of their own, so that what merging takes is seen by itself.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Instant;

use needlebench_study::{Progress, Shard, StudyError, StudyRun, merge};
use synthetic::{SyntheticDesign, SyntheticEvaluator};

#[path = "../../../../../crates/study/tests/study/store/synthetic.rs"]
mod synthetic;

/// Cases of a block, as large studies have.
const MOST_BLOCK_CASES: u64 = 64;
/// As many shards can be made of any number of cases.
const MOST_SHARDS: u32 = 10_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        ["make", folder, cases, shards, threads] => make(
            &PathBuf::from(folder),
            cases.parse()?,
            shards.parse()?,
            threads.parse()?,
        )?,
        ["merge", out, folder, threads] => {
            merge_all(&PathBuf::from(out), PathBuf::from(folder), threads.parse()?)?;
        }
        _ => {
            return Err(
                "usage: shards make FOLDER CASES SHARDS THREADS | merge OUT FOLDER THREADS".into(),
            );
        }
    }
    Ok(())
}

fn make(folder: &std::path::Path, cases: u64, shards: u32, threads: u32) -> Result<(), StudyError> {
    let design = SyntheticDesign::new(cases);
    let block_cases = (cases / u64::from(MOST_SHARDS)).clamp(1, MOST_BLOCK_CASES);
    let block_cases = u32::try_from(block_cases).expect("at most 64");
    let next = AtomicU32::new(1);
    let failure = Mutex::new(None);
    let work = || {
        while let Some(shard) = Shard::new(next.fetch_add(1, Ordering::Relaxed), shards) {
            let mut manifest = design.manifest(block_cases);
            manifest.shard = Some(shard);
            let run = StudyRun {
                manifest,
                design: &design,
                evaluator: &SyntheticEvaluator::FAST,
                threads: 1,
                resume: true,
            };
            let folder = folder.join(shard.part().to_string()).join("synthetic");
            if let Err(error) = run.run(&folder, &AtomicBool::new(false), &|_| {}) {
                *failure.lock().expect("nobody panics") = Some(error);
                return;
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(work);
        }
    });
    let failure = failure.into_inner().expect("nobody panics");
    failure.map_or(Ok(()), Err)
}

fn merge_all(out: &std::path::Path, folder: PathBuf, threads: usize) -> Result<(), StudyError> {
    let begin = Instant::now();
    merge(out, None, &[folder], threads, true, &|event| match event {
        Progress::Space { .. } => {
            println!("{event}");
            println!("looked through {:8.2} s", begin.elapsed().as_secs_f64());
        }
        Progress::Table { done, total } if done == total => {
            println!("table          {:8.2} s", begin.elapsed().as_secs_f64());
        }
        _ => {}
    })?;
    println!("all            {:8.2} s", begin.elapsed().as_secs_f64());
    Ok(())
}

//! Runs a study without physics: what the runner, the journal and the tables cost by themselves.
//!
//! ```text
//! cargo run --release -p needlebench-programs-study --bin synthetic -- FOLDER CASES THREADS DRAWS [csv]
//! ```
//!
//! DRAWS random numbers per case stand for the work of computing it: 200 000 take about half a
//! millisecond.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use needlebench_numerics::random::SplitMix64;
use needlebench_study::{
    CSV_FILE, CaseError, CaseEvaluator, CaseResult, CaseWorker, ParquetResults, Progress,
    RESULTS_FILE, Results, StudyRun, write_csv,
};
use synthetic::{SyntheticDesign, SyntheticEvaluator};

#[path = "../../../../../crates/study/tests/study/store/synthetic.rs"]
mod synthetic;

/// Works for its rows.
struct Busy(u64);

struct BusyWorker<'a>(&'a Busy, Box<dyn CaseWorker>);

impl CaseEvaluator for Busy {
    fn worker(&self) -> Box<dyn CaseWorker + '_> {
        let worker = SyntheticEvaluator::FAST.worker();
        Box::new(BusyWorker(self, worker))
    }
}

impl CaseWorker for BusyWorker<'_> {
    fn evaluate(&mut self, case: u64) -> Result<CaseResult, CaseError> {
        let mut random = SplitMix64::new(case);
        for _ in 0..self.0.0 {
            std::hint::black_box(random.next_u64());
        }
        self.1.evaluate(case)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, cases, threads, draws, rest @ ..] = arguments.as_slice() else {
        return Err("usage: synthetic FOLDER CASES THREADS DRAWS [csv]".into());
    };
    let (folder, threads) = (PathBuf::from(folder), threads.parse()?);
    let design = SyntheticDesign::new(cases.parse()?);
    let begin = Instant::now();
    let computed = std::sync::OnceLock::new();
    let run = StudyRun {
        manifest: design.manifest(64),
        design: &design,
        evaluator: &Busy(draws.parse()?),
        threads,
        resume: true,
    };
    run.run(&folder, &AtomicBool::new(false), &|progress| {
        if let Progress::Table { .. } = progress {
            computed.get_or_init(|| begin.elapsed());
        }
    })?;
    let total = begin.elapsed();
    let computed = computed.get().copied().unwrap_or_default().as_secs_f64();
    let table = folder.join(RESULTS_FILE);
    let bytes = std::fs::metadata(&table)?.len();
    let results = ParquetResults::open(&table)?;
    let rows = results.cases() * 8;
    println!("cases       {computed:8.2} s");
    println!("table       {:8.2} s", total.as_secs_f64() - computed);
    println!("bytes a row {:8.2}", bytes as f64 / rows as f64);
    let begin = Instant::now();
    let mut good = 0;
    results.visit(&mut |_, case| {
        good += case.rows.iter().filter(|row| row.detail.is_empty()).count();
    })?;
    println!(
        "read        {:8.2} s, {good} rows are ok",
        begin.elapsed().as_secs_f64()
    );
    if rest.iter().any(|word| word == "csv") {
        let begin = Instant::now();
        write_csv(&results, &folder.join(CSV_FILE), threads)?;
        println!("csv         {:8.2} s", begin.elapsed().as_secs_f64());
    }
    // Linux only; elsewhere the system's own tools tell.
    if let Ok(status) = std::fs::read_to_string("/proc/self/status") {
        for line in status.lines().filter(|line| line.starts_with("VmHWM")) {
            println!("{line}");
        }
    }
    Ok(())
}

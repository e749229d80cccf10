//! Folders of synthetic studies.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use needlebench_study::{
    CSV_FILE, CaseEvaluator, ParquetResults, RESULTS_FILE, RunEnd, Shard, StudyError, StudyRun,
    write_csv,
};

use super::synthetic::{SyntheticDesign, SyntheticEvaluator};

/// What a run is to be.
pub struct Request<'a> {
    pub cases: u64,
    pub block_cases: u32,
    pub threads: usize,
    pub shard: Option<Shard>,
    pub resume: bool,
    pub evaluator: &'a dyn CaseEvaluator,
}

impl Request<'_> {
    pub const fn new(cases: u64, block_cases: u32) -> Self {
        Self {
            cases,
            block_cases,
            threads: 2,
            shard: None,
            resume: false,
            evaluator: &SyntheticEvaluator::FAST,
        }
    }

    pub fn run(&self, folder: &Path) -> Result<RunEnd, StudyError> {
        self.run_watched(folder).0
    }

    /// The same, with what it says about damage.
    pub fn run_watched(&self, folder: &Path) -> (Result<RunEnd, StudyError>, Vec<String>) {
        let design = SyntheticDesign::new(self.cases);
        let mut manifest = design.manifest(self.block_cases);
        manifest.shard = self.shard;
        let run = StudyRun {
            design: &design,
            manifest,
            evaluator: self.evaluator,
            threads: self.threads,
            resume: self.resume,
        };
        let lines = Mutex::new(Vec::new());
        let end = run.run(folder, &AtomicBool::new(false), &|progress| {
            lines.lock().unwrap().push(progress.to_string());
        });
        (end, lines.into_inner().unwrap())
    }
}

/// A shard of a synthetic study where `--out DIR/K` has it.
pub fn nested_shard(
    place: &Path,
    [part, parts]: [u32; 2],
    cases: u64,
    block_cases: u32,
) -> PathBuf {
    let folder = place.join(part.to_string()).join("synthetic");
    let request = Request {
        shard: Shard::new(part, parts),
        ..Request::new(cases, block_cases)
    };
    request.run(&folder).unwrap();
    folder
}

/// Bytes of a folder's tables; the CSV is made here.
pub fn tables(folder: &Path) -> [Vec<u8>; 2] {
    let results = ParquetResults::open(&folder.join(RESULTS_FILE)).unwrap();
    write_csv(&results, &folder.join(CSV_FILE), 2).unwrap();
    [RESULTS_FILE, CSV_FILE].map(|name| std::fs::read(folder.join(name)).unwrap())
}

/// Names of all files of a folder.
pub fn files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.collect();
    names.sort();
    names
}

//! `needlebench search`.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result};
use clap::Args;
use needlebench_bench::search::{GenerationEvaluator, PreparedSearch, out_of_reach, worth_of};
use needlebench_parallel::Progress as _;
use needlebench_report::files::{FilesError, SearchDocument, write_search, write_search_log};
use needlebench_scenario::study::load_study;
use needlebench_study::search::{
    Answer, CaseWorth, Generation, GenerationDesign, Judge, SearchError, SearchLog,
    search as search_for,
};
use needlebench_study::{
    FactorValue, Manifest, ParquetResults, Results as _, RunEnd, Shard, Status, StudyError,
    StudyRun, merge,
};

use super::results_folder::prepare_folder;
use super::study::{ShardArgument, shard_of, show};
use super::{overrides, print_json, print_text};
use crate::arguments::RobotArguments;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::interrupts::{threads, watch_interrupts};
use crate::output::{complain, shown};
use crate::progress::TerminalProgress;

pub(crate) const SEARCH_HELP: &str = "\
Control factors (`role = \"control\"`) are optimised; noise factors define the layouts that every candidate is evaluated \
on. [search] in the study file selects the objective: a lower quantile of the constraint margin, the share of feasible layouts, the \
RMS tip error, or the probability of the lesion.

Writes DIR/NAME/search.json, search.html and a folder for each generation, DIR/NAME/search/gen_000 and so on, each a \
complete study. --resume continues an interrupted search. With --shard K/N a process computes its part of the next \
generation and ends; a search without --shard joins complete parts and continues.

Example: needlebench search scenarios/studies/search_base.toml
Example: needlebench search scenarios/studies/tools.toml --json";

/// Folder of generations in a study's folder.
const GENERATIONS: &str = "search";

/// Arguments of `search`.
#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct SearchArguments {
    /// Study file.
    #[arg(value_name = "STUDY")]
    pub study: PathBuf,
    /// Folder for results; the study has a subfolder of its name.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Continue an interrupted search.
    #[arg(long)]
    pub resume: bool,
    /// Compute one of N parts of the next generation and end: 1/N to N/N, or `auto` to read it from the scheduler's
    /// environment.
    #[arg(long, value_name = "K/N|auto")]
    pub shard: Option<ShardArgument>,
    /// Print one JSON document instead of the tables.
    #[arg(long)]
    pub json: bool,
    /// Number of threads [default: all cores]; does not affect results.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    /// Do not write the page.
    #[arg(long)]
    pub no_page: bool,
    /// Do not show progress.
    #[arg(long)]
    pub quiet: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Optimises the control factors of a study.
pub(crate) fn search(arguments: &SearchArguments) -> Result<ExitStatus, Failure> {
    let overrides = overrides(&arguments.robot)?;
    let study = load_study(&arguments.study, &overrides)?;
    for note in &study.notes {
        complain(&format!("note: {note}"));
    }
    let prepared = PreparedSearch::new(study)?;
    let folder = arguments.out.join(&prepared.study.file.name);
    prepare_folder(&folder)?;
    let generations = folder.join(GENERATIONS);
    // Shards are started again for each generation.
    if generations.exists() && !arguments.resume && arguments.shard.is_none() {
        return Err(Failure::from(StudyError::Exists {
            folder: generations,
            what: "a search".to_owned(),
        }));
    }
    let shard = arguments.shard.map(shard_of).transpose()?;
    let cancel = watch_interrupts()?;
    let progress = TerminalProgress::new(arguments.quiet);
    let mut judge = GenerationJudge {
        search: &prepared,
        folder: &folder,
        generations: &generations,
        shard,
        threads: threads(arguments.jobs),
        cancel: &cancel,
        progress: &progress,
        has_computed: false,
    };
    let found = search_for(&prepared.plan, prepared.space.choices(), &mut judge);
    progress.finish();
    let log = match found {
        Ok(log) => log,
        Err(SearchError::Stopped(stop)) => return stop.status(&folder),
        Err(error) => return Err(prepared.finding(&error).into()),
    };
    let text = write_search(&prepared, &log, &folder, !arguments.no_page)
        .with_context(|| format!("cannot write the results to {}", folder.display()))?;
    if arguments.json {
        print_json(&SearchDocument::new(&prepared, &log))?;
    } else {
        print_text(&format!("{text}results: {}", shown(&folder)))?;
    }
    let recommended = log.answer.as_ref().is_some_and(Answer::is_recommended);
    Ok(if recommended {
        ExitStatus::Success
    } else {
        ExitStatus::CriterionFailed
    })
}

/// Computes generations as studies, each in its own folder.
struct GenerationJudge<'a> {
    search: &'a PreparedSearch,
    folder: &'a Path,
    generations: &'a Path,
    shard: Option<Shard>,
    threads: usize,
    cancel: &'a AtomicBool,
    progress: &'a TerminalProgress,
    has_computed: bool,
}

/// Reasons to end a search early.
enum Stop {
    Interrupted,
    /// A part of a generation is complete.
    Part {
        generation: u32,
        shard: Shard,
        cases: u64,
        folder: PathBuf,
    },
    /// A generation has fewer parts than processes.
    NoPart {
        generation: u32,
        parts: u32,
    },
    Study(StudyError),
    Files(FilesError),
}

impl Stop {
    fn status(self, folder: &Path) -> Result<ExitStatus, Failure> {
        match self {
            Self::Interrupted => Err(Failure::interrupted(format!(
                "interrupted: completed generations are in {}; --resume continues",
                shown(folder)
            ))),
            Self::Part {
                generation,
                shard,
                cases,
                folder,
            } => {
                print_text(&format!(
                    "{cases} cases of generation {generation}, part {shard}, are in {}; once all parts are complete, \
                     `needlebench search --resume` joins them and continues",
                    shown(&folder)
                ))?;
                Ok(ExitStatus::Success)
            }
            Self::NoPart { generation, parts } => {
                print_text(&format!(
                    "generation {generation} has only {parts} parts: nothing to do for this one"
                ))?;
                Ok(ExitStatus::Success)
            }
            Self::Study(error) => Err(error.into()),
            Self::Files(error) => Err(anyhow::Error::from(error)
                .context(format!("cannot write to {}", folder.display()))
                .into()),
        }
    }
}

impl From<StudyError> for Stop {
    fn from(error: StudyError) -> Self {
        Self::Study(error)
    }
}

impl GenerationJudge<'_> {
    fn path(&self, generation: u32) -> PathBuf {
        self.generations.join(format!("gen_{generation:03}"))
    }

    fn part(&self, generation: u32, shard: Shard) -> PathBuf {
        let (part, parts) = (shard.part(), shard.parts());
        self.generations
            .join(format!("gen_{generation:03}.part_{part}_of_{parts}"))
    }

    /// Computes what is missing of a generation, or of a part of it.
    fn compute(&self, generation: &Generation, shard: Option<Shard>) -> Result<(), Stop> {
        let design = GenerationDesign {
            space: &self.search.space,
            generation,
        };
        let evaluator = GenerationEvaluator {
            search: self.search,
            design,
        };
        let folder = match shard {
            Some(shard) => self.part(generation.number, shard),
            None => self.path(generation.number),
        };
        let run = StudyRun {
            design: &evaluator.design,
            manifest: self.search.manifest(generation, shard),
            evaluator: &evaluator,
            threads: self.threads,
            resume: true,
        };
        self.progress
            .message(&format!("generation {}", generation.number));
        match run.run(&folder, self.cancel, &|event| show(self.progress, event))? {
            RunEnd::Finished { .. } => Ok(()),
            RunEnd::Partial { .. } => Err(Stop::Interrupted),
        }
    }

    /// Joins the parts of a generation if all are complete.
    fn join(&self, generation: &Generation) -> Result<(), Stop> {
        let Some(parts) = self.complete_parts(generation)? else {
            return Ok(());
        };
        let folder = self.path(generation.number);
        let ours = self.search.manifest(generation, None);
        merge(&folder, Some(&ours), &parts, self.threads, true, &|event| {
            show(self.progress, event);
        })?;
        Ok(())
    }

    /// Folders of all parts of a generation; none unless all are complete.
    fn complete_parts(&self, generation: &Generation) -> Result<Option<Vec<PathBuf>>, Stop> {
        let prefix = format!("gen_{:03}.part_", generation.number);
        let Ok(entries) = self.generations.read_dir() else {
            return Ok(None);
        };
        let mut found: Vec<(Shard, PathBuf)> = Vec::new();
        let ours = self.search.manifest(generation, None);
        for entry in entries.flatten() {
            if !entry.file_name().to_string_lossy().starts_with(&prefix) {
                continue;
            }
            let path = entry.path();
            let Some(manifest) = Manifest::read(&path)? else {
                continue;
            };
            if let Some(error) = ours.other_study(&path, &manifest) {
                return Err(error.into());
            }
            if let (Some(shard), Status::Complete) = (manifest.shard, manifest.status) {
                found.push((shard, path));
            }
        }
        found.sort();
        let parts = |shard: Shard| {
            found
                .iter()
                .filter(move |(each, _)| each.parts() == shard.parts())
        };
        let whole = found
            .iter()
            .find(|(shard, _)| parts(*shard).count() == shard.parts() as usize);
        Ok(whole.map(|(shard, _)| parts(*shard).map(|(_, path)| path.clone()).collect()))
    }

    fn is_complete(&self, generation: u32) -> Result<bool, Stop> {
        let path = self.path(generation);
        Ok(Manifest::read(&path)?.is_some_and(|manifest| manifest.status == Status::Complete))
    }
}

impl Judge for GenerationJudge<'_> {
    type Stop = Stop;

    fn out_of_reach(&mut self, generation: &Generation) -> Result<Vec<Vec<Option<f64>>>, Stop> {
        Ok(out_of_reach(self.search, generation, self.threads))
    }

    fn judge(&mut self, generation: &Generation) -> Result<Vec<Vec<CaseWorth>>, Stop> {
        let number = generation.number;
        if !self.is_complete(number)? {
            if let Some(shard) = self.shard {
                // A generation of fewer blocks than parts is for the first ones.
                let blocks = self.search.manifest(generation, None).blocks();
                let parts =
                    u32::try_from(blocks).map_or(shard.parts(), |all| all.min(shard.parts()));
                let Some(own) = Shard::new(shard.part(), parts) else {
                    return Err(Stop::NoPart {
                        generation: number,
                        parts,
                    });
                };
                self.compute(generation, Some(own))?;
                let cases = self.search.manifest(generation, Some(own)).own_cases();
                return Err(Stop::Part {
                    generation: number,
                    shard: own,
                    cases,
                    folder: self.part(number, own),
                });
            }
            self.join(generation)?;
            self.has_computed = true;
        }
        // For a complete one this checks that it belongs to this search and is intact.
        self.compute(generation, None)?;
        let table = self.path(number).join(needlebench_study::RESULTS_FILE);
        let results = ParquetResults::open(&table).map_err(StudyError::from)?;
        let columns = results.columns().to_vec();
        let count = usize::try_from(generation.count).expect("held in memory");
        let mut worth = vec![Vec::with_capacity(count); generation.candidates.len()];
        results
            .visit(&mut |_, case| {
                let candidate = usize::try_from(case.case).expect("held in memory") / count;
                worth[candidate].push(worth_of(&columns, case));
            })
            .map_err(StudyError::from)?;
        Ok(worth)
    }

    fn describe(&self, candidate: &[FactorValue]) -> Vec<(String, serde_json::Value)> {
        self.search.space.describe(candidate)
    }

    fn note(&mut self, log: &SearchLog) -> Result<(), Stop> {
        // Generations read again are in the file already, perhaps with the answer.
        if !self.has_computed {
            return Ok(());
        }
        write_search_log(self.search, log, self.folder).map_err(Stop::Files)
    }
}

//! Arguments of `study` and `merge`.

use std::path::PathBuf;

use clap::Args;
use needlebench_bench::study::LaunchRequest;
use needlebench_study::Shard;

use crate::arguments::{PicturesArguments, RobotArguments, TableArguments};

pub(crate) const STUDY_HELP: &str = "\
A study is one TOML file: a scenario, factors that vary it, and criteria. The number of a case determines all \
its values.

Writes DIR/NAME/results.parquet, summary.json, summary.md, report.html and study.json. --resume continues an \
interrupted study.

Shards may run on several machines; `merge` joins them. --launch writes the scripts for a cluster. Shard exit \
status: 0 complete, 3 or 130 retry, 2 do not retry. Exit status of --status and --missing: 0 all shards complete, \
1 not.

Example: needlebench study scenarios/studies/layouts.toml
Example: needlebench study scenarios/studies/layouts.toml --case 1234
Example: needlebench study scenarios/studies/accuracy_budget.toml --table accuracy --by source
Example: needlebench study scenarios/studies/layouts.toml --shard 1/3 --out shard1
Example: needlebench study scenarios/studies/layouts.toml --launch slurm:100
Example: needlebench study scenarios/studies/layouts.toml --status out/layouts/shards
Example: needlebench merge scenarios/studies/layouts.toml shard1/layouts shard2/layouts shard3/layouts";

/// Arguments of `study`.
#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct StudyArguments {
    /// Study file.
    #[arg(value_name = "STUDY")]
    pub study: PathBuf,
    /// Folder for results; the study has a subfolder of its name.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Continue an interrupted study.
    #[arg(long)]
    pub resume: bool,
    /// Start regardless of the expected time.
    #[arg(long)]
    pub yes: bool,
    /// Compute one of N parts: 1/N to N/N. auto: that of the job array (Slurm, Kubernetes, PBS, AWS Batch) or of
    /// NEEDLEBENCH_SHARD and NEEDLEBENCH_SHARDS, in DIR/K.
    #[arg(long, value_name = "K/N|auto")]
    pub shard: Option<ShardArgument>,
    /// Print the progress of the shards in or below these folders, also while they run.
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with_all = ["resume", "shard", "case", "csv", "table"])]
    pub status: Vec<PathBuf>,
    /// With --status: print only the numbers of the shards to start or restart, in the format of `sbatch --array`.
    #[arg(long, requires = "status", conflicts_with = "json")]
    pub missing: bool,
    /// Write scripts that compute the study in N shards, slurm:N, kubernetes:N, or local:N for N processes on this
    /// machine, and print the commands to start them. Nothing is started.
    #[arg(long, value_name = "WHAT:N", conflicts_with_all = ["resume", "shard", "status", "case", "csv", "table"])]
    pub launch: Option<LaunchRequest>,
    /// Compute these cases only and print their rows; nothing is written.
    #[arg(long, value_name = "ID", conflicts_with_all = ["resume", "shard", "csv", "table"])]
    pub case: Vec<u64>,
    /// With --case: run it like `run`, with engines, images and a page, in the study's folder.
    #[arg(long, requires = "case")]
    pub run: bool,
    #[command(flatten)]
    pub pictures: PicturesArguments,
    #[command(flatten)]
    pub results: StudyResultArguments,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// A requested shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ShardArgument {
    /// This one.
    This(Shard),
    /// That of the environment.
    Auto,
}

impl std::str::FromStr for ShardArgument {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let shard: Result<Shard, String> = text.parse();
        shard
            .map(Self::This)
            .map_err(|message| format!("{message}, or auto"))
    }
}

/// Arguments of `merge`.
#[derive(Debug, Args)]
pub(crate) struct MergeArguments {
    /// Study file.
    #[arg(value_name = "STUDY")]
    pub study: PathBuf,
    /// Folders of all shards (with the file `study.json`), or folders that contain them.
    #[arg(required = true, value_name = "SHARD")]
    pub shards: Vec<PathBuf>,
    /// Folder for results; the study has a subfolder of its name.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    #[command(flatten)]
    pub results: StudyResultArguments,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Outputs of a complete table.
#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct StudyResultArguments {
    /// Also write results.csv.
    #[arg(long)]
    pub csv: bool,
    /// Print one JSON document instead of the tables.
    #[arg(long)]
    pub json: bool,
    /// Print all tables, not only the answer and its basis.
    #[arg(long)]
    pub wide: bool,
    /// Write JUnit XML of the study's criteria to this file.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
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
    pub table: TableArguments,
}

//! Arguments of `study` and `merge`.

use std::path::PathBuf;

use clap::Args;
use needlebench_bench::study::LaunchRequest;
use needlebench_study::Shard;

use crate::arguments::{PicturesArguments, RobotArguments, TableArguments};

pub(crate) const STUDY_HELP: &str = "\
A study is one TOML file: a scenario, factors that vary it, and what is asked of the results. Every case \
has a number that decides everything about it.

Writes DIR/NAME/results.parquet, summary.json, summary.md, report.html and study.json. An interrupted \
study goes on with --resume.

Shards may run on several machines; `merge` joins them. --launch writes the scripts for a cluster. A shard ends \
with 0 if it is there, with 3 or 130 if it is worth asking for it again, with 2 if it is not. --status and \
--missing end with 0 if all is there, with 1 if it is not.

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
    /// Folder for results; the study gets a folder of its name in it.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Go on with a study that was interrupted.
    #[arg(long)]
    pub resume: bool,
    /// Start without asking, however long it will take.
    #[arg(long)]
    pub yes: bool,
    /// Compute one of N parts: 1/N to N/N. auto: the one that the array of Slurm, Kubernetes, PBS or AWS Batch
    /// says, or NEEDLEBENCH_SHARD and NEEDLEBENCH_SHARDS, into DIR/K.
    #[arg(long, value_name = "K/N|auto")]
    pub shard: Option<ShardArgument>,
    /// Say how far the shards in these folders are, or below them; also while they are computed.
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with_all = ["resume", "shard", "case", "csv", "table"])]
    pub status: Vec<PathBuf>,
    /// With --status: print only the numbers of the shards to start (again), as `sbatch --array` takes them.
    #[arg(long, requires = "status", conflicts_with = "json")]
    pub missing: bool,
    /// Write scripts that compute the study in N shards: slurm:N, kubernetes:N, or local:N for N processes of
    /// this machine; and print what to type. Nothing is started.
    #[arg(long, value_name = "WHAT:N", conflicts_with_all = ["resume", "shard", "status", "case", "csv", "table"])]
    pub launch: Option<LaunchRequest>,
    /// Compute these cases alone and print their rows; nothing is written.
    #[arg(long, value_name = "ID", conflicts_with_all = ["resume", "shard", "csv", "table"])]
    pub case: Vec<u64>,
    /// With --case: run it with engines, pictures and a page, as `run` does, into the study's folder.
    #[arg(long, requires = "case")]
    pub run: bool,
    #[command(flatten)]
    pub pictures: PicturesArguments,
    #[command(flatten)]
    pub results: StudyResultArguments,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// A shard that was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ShardArgument {
    /// This one.
    This(Shard),
    /// The one that the environment says.
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
    /// Folders of all its shards, those with the file `study.json`; or folders that they are in.
    #[arg(required = true, value_name = "SHARD")]
    pub shards: Vec<PathBuf>,
    /// Folder for results; the study gets a folder of its name in it.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    #[command(flatten)]
    pub results: StudyResultArguments,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// What is made of a complete table, and how.
#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct StudyResultArguments {
    /// Write results.csv too.
    #[arg(long)]
    pub csv: bool,
    /// Print one JSON document instead of the tables.
    #[arg(long)]
    pub json: bool,
    /// Print all tables, not only the answer and what it rests on.
    #[arg(long)]
    pub wide: bool,
    /// Write JUnit XML of the study's criteria to this file.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Threads; the number of cores if left out. Results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    /// Write no page.
    #[arg(long)]
    pub no_page: bool,
    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
    #[command(flatten)]
    pub table: TableArguments,
}

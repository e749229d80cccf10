//! Scripts with which a study runs on several machines, or in several processes.
//!
//! A shard is a process that may be killed and asked for again: `shard.sh` is one, and whatever runs a command
//! many times and repeats what failed will do. Nothing is started here. The texts depend on the request alone.

mod kubernetes;
mod local;
mod shell;
mod slurm;

use std::path::{Component, Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use needlebench_input::Finding;

use super::prepare::in_words;
use shell::quoted;

/// What starts the shards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Launcher {
    /// An array of jobs.
    Slurm,
    /// A job with indices.
    Kubernetes,
    /// Processes of this machine.
    Local,
}

impl Launcher {
    const ALL: [(&'static str, Self); 3] = [
        ("slurm", Self::Slurm),
        ("kubernetes", Self::Kubernetes),
        ("local", Self::Local),
    ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        Self::ALL
            .iter()
            .find(|(_, each)| *each == self)
            .map_or("", |(name, _)| name)
    }
}

/// What is to start how many shards: `slurm:400`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LaunchRequest {
    /// Which launcher.
    pub launcher: Launcher,
    /// Number of shards, at least one.
    pub shards: u32,
}

impl FromStr for LaunchRequest {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let expected = || {
            format!(
                "\"{text}\" is not a launcher with a number of shards: expected slurm:N, kubernetes:N or local:N, such as slurm:400"
            )
        };
        let (name, shards) = text.split_once(':').ok_or_else(expected)?;
        let launcher = Launcher::ALL.iter().find(|(each, _)| *each == name);
        let (_, launcher) = launcher.ok_or_else(expected)?;
        let shards: u32 = shards.parse().map_err(|_| expected())?;
        if shards == 0 {
            return Err(expected());
        }
        Ok(Self {
            launcher: *launcher,
            shards,
        })
    }
}

impl std::fmt::Display for LaunchRequest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.launcher.name(), self.shards)
    }
}

/// A study that is to be launched.
#[derive(Debug, Clone)]
pub struct Launch<'a> {
    /// By what, in how many shards.
    pub request: LaunchRequest,
    /// Name of the study.
    pub name: &'a str,
    /// How the program is called.
    pub program: &'a Path,
    /// Where the request was made: relative paths are relative to it. Absolute.
    pub folder: &'a Path,
    /// The study file, as it was given.
    pub study: &'a Path,
    /// Folder for results, as it was given; the study's is one of its name in it.
    pub out: &'a Path,
    /// Further options of `study` and `merge`, such as another robot.
    pub options: &'a [String],
    /// Threads of each shard.
    pub jobs: u16,
    /// `NEEDLEBENCH_CACHE_DIR` as it is set.
    pub cache: Option<&'a Path>,
    /// Whether cases need MuJoCo.
    pub needs_mujoco: bool,
}

/// A file of a launch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LaunchFile {
    /// Its name in the folder of the launch.
    pub name: &'static str,
    /// What is in it.
    pub text: String,
}

impl LaunchFile {
    /// Whether it is a program.
    pub fn is_executable(&self) -> bool {
        Path::new(self.name)
            .extension()
            .is_some_and(|extension| extension == "sh")
    }
}

/// A command line of the launch, and its purpose.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LaunchStep {
    /// What it does: `start`, `missing`, `merge` ...
    pub does: &'static str,
    /// The command line.
    pub line: String,
}

/// Files and lines of a launch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LaunchPlan {
    /// Folder of the files, from where the request was made.
    pub folder: PathBuf,
    /// Folders that must exist before it starts.
    pub folders: Vec<PathBuf>,
    /// The files.
    pub files: Vec<LaunchFile>,
    /// Names of files of other launches, which do not match these.
    pub stale: Vec<&'static str>,
    /// The command lines, in this order.
    pub steps: Vec<LaunchStep>,
}

/// All files that a launch may have.
const FILES: [&str; 7] = [
    "shard.sh",
    "merge.sh",
    "prepare.sh",
    "job.sh",
    "missing.sh",
    "run.sh",
    "job.yaml",
];

/// Folder of a study's shards, in the study's own.
const SHARDS: &str = "shards";

/// Makes the files of a launch, and the command lines.
///
/// # Errors
/// A path that the launcher cannot have.
pub fn launch_plan(launch: &Launch) -> Result<LaunchPlan, Finding> {
    let texts = Texts::new(launch)?;
    let mut steps = Vec::new();
    let mut files = vec![texts.shard(), texts.merge()];
    if let Some(prepare) = texts.prepare() {
        files.push(prepare);
        steps.push(texts.step("prepare", "prepare.sh"));
    }
    let mut folders = vec![
        texts.launch_folder.join("logs"),
        texts.shards_folder.clone(),
    ];
    match launch.request.launcher {
        Launcher::Slurm => {
            files.push(slurm::job(launch, &texts)?);
            files.push(slurm::missing(&texts));
            steps.push(LaunchStep {
                does: "start",
                line: format!("sbatch {}", texts.file("job.sh")),
            });
            steps.push(texts.status_step());
            steps.push(texts.step("start missing shards", "missing.sh"));
        }
        Launcher::Local => {
            files.push(local::run(launch, &texts));
            steps.push(texts.step("start, or continue", "run.sh"));
            steps.push(texts.status_step());
        }
        Launcher::Kubernetes => {
            // Nodes have the image's program, and no shell is needed.
            files = vec![kubernetes::job(launch, &texts)?];
            folders = vec![texts.shards_folder.clone()];
            steps = vec![LaunchStep {
                does: "start, after setting image and claimName",
                line: format!("kubectl apply --filename {}", texts.file("job.yaml")),
            }];
            steps.push(texts.status_step());
            files.push(texts.merge());
        }
    }
    steps.push(texts.step("merge", "merge.sh"));
    let is_here = |name: &&str| files.iter().any(|file| file.name == *name);
    let stale = FILES.into_iter().filter(|name| !is_here(name)).collect();
    Ok(LaunchPlan {
        stale,
        folder: texts.launch_folder,
        folders,
        files,
        steps,
    })
}

/// What the texts of all launchers share.
struct Texts<'a> {
    launch: &'a Launch<'a>,
    launch_folder: PathBuf,
    shards_folder: PathBuf,
    /// `cd` to where relative paths are relative to.
    there: String,
    program: String,
    study: String,
    shards: String,
    out: String,
    options: String,
    cache: Option<String>,
}

impl<'a> Texts<'a> {
    fn new(launch: &'a Launch<'a>) -> Result<Self, Finding> {
        let study_folder = launch.out.join(launch.name);
        let launch_folder = study_folder.join("launch");
        let shards_folder = study_folder.join(SHARDS);
        // Of a machine that has no Python environment yet: on the disk that results are on.
        let cache = launch.cache.map(Path::to_owned).or_else(|| {
            let shared = launch.request.launcher == Launcher::Slurm && launch.needs_mujoco;
            shared.then(|| launch.folder.join(launch_folder.join("cache")))
        });
        let path = |what: &str, path: &Path| {
            let text = path.to_str().filter(|text| !text.contains(['\n', '\r']));
            text.map(quoted).ok_or_else(|| {
                Finding::new(
                    path.display().to_string(),
                    format!("{what}: this name cannot be used in a script"),
                )
                .key("--launch")
                .hint("use a UTF-8 name without line breaks")
            })
        };
        let options = launch
            .options
            .iter()
            .map(|option| format!(" {}", quoted(option)));
        Ok(Self {
            launch,
            there: format!("cd {} || exit 3", path("this folder", launch.folder)?),
            program: path("the program", launch.program)?,
            study: path("the study", launch.study)?,
            shards: path("the folder for results", &shards_folder)?,
            out: path("the folder for results", launch.out)?,
            options: options.collect(),
            cache: cache
                .as_deref()
                .map(|cache| path("NEEDLEBENCH_CACHE_DIR", cache))
                .transpose()?,
            launch_folder,
            shards_folder,
        })
    }

    /// Head of a script.
    fn head(&self, shell: &str, about: &str) -> String {
        format!(
            "#!{shell}\n# {about}\n# Written by `needlebench study --launch {}`, for the study {}.\n",
            self.launch.request, self.launch.name
        )
    }

    /// What scripts share of their environment.
    fn environment(&self) -> String {
        let cache = self.cache.as_ref();
        let cache = cache.map(|cache| format!("export NEEDLEBENCH_CACHE_DIR={cache}\n"));
        format!(
            "{}\nexport NEEDLEBENCH_SHARDS={}\n{}",
            self.there,
            self.launch.request.shards,
            cache.unwrap_or_default()
        )
    }

    fn shard(&self) -> LaunchFile {
        let Self {
            program,
            study,
            shards,
            options,
            ..
        } = self;
        LaunchFile {
            name: "shard.sh",
            text: format!(
                "{}{}\
                 # Signals go to the program itself. It may be killed at any time and started again.\n\
                 exec {program} study {study} --shard auto --out {shards} \\\n    \
                 --resume --yes --quiet --jobs {}{options}\n",
                self.head(
                    "/bin/sh",
                    "One shard; NEEDLEBENCH_SHARD or the scheduler selects it."
                ),
                self.environment(),
                self.launch.jobs,
            ),
        }
    }

    fn merge(&self) -> LaunchFile {
        let Self {
            program,
            study,
            shards,
            out,
            options,
            ..
        } = self;
        LaunchFile {
            name: "merge.sh",
            text: format!(
                "{}{}exec {program} merge {study} {shards} --out {out}{options} \"$@\"\n",
                self.head("/bin/sh", "Merges the shards when all are complete."),
                self.environment(),
            ),
        }
    }

    fn prepare(&self) -> Option<LaunchFile> {
        let program = &self.program;
        (self.launch.needs_mujoco && self.cache.is_some()).then(|| LaunchFile {
            name: "prepare.sh",
            text: format!(
                "{}{}exec {program} doctor --prepare \"$@\"\n",
                self.head(
                    "/bin/sh",
                    "Sets up the MuJoCo environment in advance; requires a network connection."
                ),
                self.environment(),
            ),
        })
    }

    /// A file of the launch, quoted, from where the request was made.
    fn file(&self, name: &str) -> String {
        quoted(&self.launch_folder.join(name).display().to_string())
    }

    /// The same from anywhere, not quoted.
    fn absolute(&self, name: &str) -> String {
        let path = self.launch.folder.join(&self.launch_folder).join(name);
        path.display().to_string()
    }

    fn step(&self, does: &'static str, name: &str) -> LaunchStep {
        LaunchStep {
            does,
            line: format!("sh {}", self.file(name)),
        }
    }

    fn status_step(&self) -> LaunchStep {
        LaunchStep {
            does: "show progress",
            line: format!(
                "needlebench study {} --status {}{}",
                self.study, self.shards, self.options
            ),
        }
    }
}

/// Whether a path stays below where it begins.
fn is_below(path: &Path) -> bool {
    path.components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}

/// Least recommended duration of a shard.
fn least_worth(launcher: Launcher) -> Duration {
    match launcher {
        // About a second of the scheduler's for each, one after the other.
        Launcher::Slurm => Duration::from_mins(5),
        Launcher::Kubernetes => Duration::from_mins(1),
        Launcher::Local => Duration::from_secs(2),
    }
}

/// Slurm's `MaxArraySize` where nobody has set it: indices are below it.
const SLURM_ARRAY: u32 = 1001;

/// Recommended changes of a request, from the time that a case takes on one thread.
pub fn advice(request: LaunchRequest, cases: u64, jobs: u16, each: Duration) -> Vec<String> {
    let mut advice = Vec::new();
    let shards = f64::from(request.shards);
    let total = each.mul_f64(cases as f64 / f64::from(jobs.max(1)));
    let shard = total.div_f64(shards);
    let least = least_worth(request.launcher);
    if shard < least && request.shards > 1 {
        let worth = (total.as_secs_f64() / least.as_secs_f64()).floor().max(1.0);
        advice.push(format!(
            "a shard takes about {}; {} should take at least {}: use {worth} shards, or one per worker if you have \
             more workers",
            in_words(shard),
            match request.launcher {
                Launcher::Slurm => "a job",
                Launcher::Kubernetes => "a pod",
                Launcher::Local => "a process",
            },
            in_words(least),
        ));
    }
    if request.launcher == Launcher::Slurm && request.shards >= SLURM_ARRAY {
        advice.push(format!(
            "Slurm limits array indices to below MaxArraySize (default {SLURM_ARRAY}): \
             `scontrol show config | grep MaxArraySize`"
        ));
    }
    advice
}

#[cfg(test)]
mod tests;

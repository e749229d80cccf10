//! The commands, and what each ends with.

use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{CommandFactory, Parser, Subcommand};
use needlebench_bench::progress::Progress;
use needlebench_bench::provenance::PROGRAM_VERSION;

use crate::clock;
use crate::command::{
    self, AtlasArguments, CheckArguments, ClearanceArguments, CompareArguments, CtArguments,
    DOCTOR_HELP, DoctorArguments, ExportArguments, FkArguments, ISO9283_HELP, IkArguments,
    InitArguments, Iso9283Arguments, MergeArguments, PairsArguments, PaperArguments, REPLAY_HELP,
    REPORT_HELP, RecordPlanArguments, ReplayArguments, ReportArguments, RunArguments, SEARCH_HELP,
    STUDY_HELP, SchemaFormat, SearchArguments, ServoArguments, StudyArguments, SuggestArguments,
    VIEW_HELP, ViewArguments,
};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::host::{Invocation, hosted};
use crate::log::{LogLevel, told};
use crate::output::{complain, keep_to_width, print_as_it_is};

/// Testbench for needle-guide robots: which of the eight arm configurations put the needle guide
/// on its place, how far off the needle's tip is, and how close anything comes to anything.
#[derive(Debug, Parser)]
#[command(name = "needlebench", version = PROGRAM_VERSION, propagate_version = true, max_term_width = 100)]
#[command(
    after_help = "Exit status: 0 all criteria met, 1 a criterion failed or was not judged, 2 bad input, \
                        3 the environment or an engine failed, 130 interrupted."
)]
struct Cli {
    /// Tell what was read, decided and skipped, on standard error.
    #[arg(long = "log", global = true, value_enum, value_name = "LEVEL")]
    log_level: Option<LogLevel>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a first scenario: small, commented, and one that passes.
    #[command(
        after_help = "Example: needlebench init my_cell.toml --arm ur5e --lesion left_upper_lobe"
    )]
    Init(InitArguments),
    /// Propose entries for a lesion, and places for the robot's base, as TOML to paste.
    #[command(
        after_help = "Example: needlebench suggest scenarios/supine_suite.toml --lesion left_upper_lobe --out out"
    )]
    Suggest(Box<SuggestArguments>),
    /// Plan, simulate and measure every configuration of every goal.
    #[command(after_help = "Example: needlebench run scenarios/table3.toml")]
    Run(RunArguments),
    /// Parse, resolve and validate scenarios without simulating.
    #[command(after_help = "Example: needlebench check scenarios/*.toml")]
    Check(CheckArguments),
    /// All joint positions for a pose of the flange or a goal of a scenario.
    #[command(
        after_help = "Example: needlebench ik --pose 0.1942,-0.3593,0.1701,-0.8567,2.7197,-1.1407"
    )]
    Ik(Box<IkArguments>),
    /// Pose of the flange and of every link for joint positions.
    #[command(
        after_help = "Example: needlebench fk --joints -0.735,2.370,1.883,-1.967,1.274,0.114"
    )]
    Fk(FkArguments),
    /// Signed clearance of one posture in a scenario's cell.
    #[command(
        after_help = "Example: needlebench clearance scenarios/table3.toml --joints 0,-1.57,-1,-1.57,1.57,0"
    )]
    Clearance(ClearanceArguments),
    /// Every configuration at every angle of the guide about the needle: what works, and why not.
    #[command(
        after_help = "Example: needlebench atlas scenarios/supine_suite.toml --goal right_upper_anterior"
    )]
    Atlas(AtlasArguments),
    /// A scenario in the format of another tool: the whole cell for MuJoCo, for ROS, or as glTF; one of its motions for
    /// ROS 2 or for a controller.
    #[command(after_help = "Example: needlebench export scenarios/table3.toml --as mjcf")]
    Export(Box<ExportArguments>),
    /// Two results side by side: what changed, and whether more was lost than is allowed.
    #[command(
        after_help = "Example: needlebench compare out/before/table3 out/after/table3 --max-loss clearance=0.5mm",
        after_long_help = command::compare_help()
    )]
    Compare(Box<CompareArguments>),
    /// CT volumes: what one is, and synthetic ones of phantoms.
    #[command(after_help = "Example: needlebench ct info scan.nii.gz")]
    Ct(CtArguments),
    /// The planning page on a patient's CT, served on this machine: lesion, target, entry, and which configurations reach it.
    #[command(
        after_help = "Example: needlebench view out/patient",
        after_long_help = VIEW_HELP
    )]
    View(ViewArguments),
    /// Many cases of one scenario: a table of results, statistics, and a page to look at them.
    #[command(
        after_help = "Example: needlebench study scenarios/studies/layouts.toml",
        after_long_help = STUDY_HELP
    )]
    Study(Box<StudyArguments>),
    /// The best of a study's choices, looked for instead of listed: where the base should stand, which tool.
    #[command(
        after_help = "Example: needlebench search scenarios/studies/search_base.toml",
        after_long_help = SEARCH_HELP
    )]
    Search(Box<SearchArguments>),
    /// Join the shards of a study.
    #[command(
        after_help = "Example: needlebench merge scenarios/studies/layouts.toml shard1/layouts shard2/layouts"
    )]
    Merge(MergeArguments),
    /// Accuracy and repeatability of a real robot by ISO 9283, from a laser tracker's log.
    #[command(
        after_help = "Example: needlebench iso9283 --csv robot.csv --commanded commanded.csv --max-rp 0.1",
        after_long_help = ISO9283_HELP
    )]
    Iso9283(Iso9283Arguments),
    /// A safe run that excites every joint, for a log from which an arm is calibrated and identified: as a
    /// scenario and as URScript, with its proven clearances.
    #[command(
        after_help = "Example: needlebench record-plan --arm ur3e --payload-kg 0,1 --out out"
    )]
    RecordPlan(Box<RecordPlanArguments>),
    /// A recorded run of a real arm: what it says of the arm, and the same set-points in the engines.
    #[command(
        after_help = "Example: needlebench replay models/ur3e/recorded/ur3e_rad_20211005.csv",
        after_long_help = REPLAY_HELP
    )]
    Replay(Box<ReplayArguments>),
    /// Every pair of bodies: measured or left out, why, and the evidence; and checks an SRDF.
    #[command(after_help = "Example: needlebench pairs scenarios/table3.toml --srdf arm.srdf")]
    Pairs(PairsArguments),
    /// The joint servo's data sheet: settings with sources, closed loop, step and sine responses.
    #[command(after_help = "Example: needlebench servo scenarios/table3.toml --joint wrist_1")]
    Servo(ServoArguments),
    /// Evidence for the credibility of results, in the frame of ASME V&V 40.
    #[command(
        after_help = "Example: needlebench report out/table3 --credibility",
        after_long_help = REPORT_HELP
    )]
    Report(ReportArguments),
    /// Reproduce the paper: Table 3, every equation, both methods, and Figure 6.
    #[command(after_help = "Example: needlebench paper --out out/paper")]
    Paper(PaperArguments),
    /// JSON schema of scenario, study or arm files, for editors; the table of metrics.
    #[command(after_help = "Example: needlebench schema scenario > scenario.schema.json")]
    Schema {
        /// What to describe.
        #[arg(value_enum)]
        format: SchemaFormat,
        /// Print it as Markdown, for people.
        #[arg(long)]
        markdown: bool,
    },
    /// What this machine has and lacks for running both engines; sets MuJoCo up ahead, with and without a network.
    #[command(
        after_help = "Example: needlebench doctor --prepare",
        after_long_help = DOCTOR_HELP
    )]
    Doctor(DoctorArguments),
    /// Licences of everything of others that is inside the program.
    #[command(
        alias = "licenses",
        after_help = "Example: needlebench licences | less"
    )]
    Licences,
    /// Completions for a shell.
    #[command(after_help = "Example: needlebench completions bash > needlebench.bash")]
    Completions {
        /// The shell.
        #[arg(value_enum)]
        shell: clap_complete::Shell,
    },
}

/// The command line, for completions and documentation.
pub fn command_line() -> clap::Command {
    Cli::command()
}

/// Runs the program.
pub fn main() -> ExitCode {
    main_with(std::env::args_os().collect()).into()
}

/// The same with arguments from elsewhere, the program's name first.
pub fn main_with(arguments: Vec<OsString>) -> ExitStatus {
    caught(|| {
        let cli = Cli::parse_from(arguments);
        run(cli)
    })
}

/// Runs a command as part of another program, on this thread. The arguments begin with the command; nothing is printed, and
/// signals and the process are left alone.
///
/// Setting `cancel` is an interrupt. A panic is a bug, and is told as one.
pub fn invoke(
    arguments: Vec<OsString>,
    cancel: Arc<AtomicBool>,
    progress: Arc<dyn Progress + Send + Sync>,
) -> Invocation {
    let program = std::iter::once(OsString::from("needlebench"));
    hosted(cancel, progress, || {
        caught(|| match Cli::try_parse_from(program.chain(arguments)) {
            Ok(cli) => run(cli),
            Err(error) => {
                let text = error.render().to_string();
                if error.use_stderr() {
                    complain(text.trim_end());
                    return ExitStatus::BadInput;
                }
                // Nobody but the host reads it.
                let _ = print_as_it_is(text.trim_end());
                ExitStatus::Success
            }
        })
    })
}

/// What is wrong is on standard error by then; a bug of ours has a status as everything else.
fn caught(run: impl FnOnce() -> ExitStatus) -> ExitStatus {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)).unwrap_or_else(|_| {
        complain("error: this is a bug of needlebench, not of your input");
        ExitStatus::EnvironmentFailed
    })
}

fn run(cli: Cli) -> ExitStatus {
    clock::start();
    keep_to_width();
    let result = told(cli.log_level, || carried_out(cli.command));
    result.unwrap_or_else(Failure::tell)
}

fn carried_out(command: Command) -> Result<ExitStatus, Failure> {
    match command {
        Command::Init(arguments) => command::init(&arguments),
        Command::Suggest(arguments) => command::suggest(&arguments),
        Command::Run(arguments) => command::run(&arguments),
        Command::Check(arguments) => command::check(&arguments),
        Command::Ik(arguments) => command::ik(&arguments),
        Command::Fk(arguments) => command::fk(&arguments),
        Command::Clearance(arguments) => command::clearance(&arguments),
        Command::Atlas(arguments) => command::atlas(&arguments),
        Command::Export(arguments) => command::export(&arguments),
        Command::Compare(arguments) => command::compare(&arguments),
        Command::Ct(arguments) => command::ct(&arguments),
        Command::View(arguments) => command::view(&arguments),
        Command::Study(arguments) => command::study(&arguments),
        Command::Search(arguments) => command::search(&arguments),
        Command::Merge(arguments) => command::merge(&arguments),
        Command::Iso9283(arguments) => command::iso9283(&arguments),
        Command::RecordPlan(arguments) => command::record_plan(&arguments),
        Command::Replay(arguments) => command::replay(&arguments),
        Command::Pairs(arguments) => command::pairs(&arguments),
        Command::Servo(arguments) => command::servo(&arguments),
        Command::Report(arguments) => command::report(&arguments),
        Command::Paper(arguments) => command::paper(&arguments),
        Command::Schema { format, markdown } => command::schema(format, markdown),
        Command::Doctor(arguments) => command::doctor(&arguments),
        Command::Licences => command::licences(),
        Command::Completions { shell } => command::completions(shell, &mut command_line()),
    }
}

#[cfg(test)]
mod tests {
    use needlebench_bench::progress::Silent;

    use super::*;

    fn command(arguments: &[&str]) -> Invocation {
        let arguments = arguments.iter().map(OsString::from).collect();
        invoke(
            arguments,
            Arc::new(AtomicBool::new(false)),
            Arc::new(Silent),
        )
    }

    #[test]
    fn answers_are_handed_over_and_not_printed() {
        let made = command(&["fk", "--arm", "UR3", "--joints", "0,0,0,0,0,0", "--json"]);
        assert_eq!(made.status, ExitStatus::Success);
        assert!(
            made.output.starts_with("{\n") && made.output.ends_with("}\n"),
            "{made:?}"
        );
        assert!(made.messages.is_empty() && made.findings.is_empty());
    }

    #[test]
    fn what_is_wrong_is_told_as_lines_and_as_values() {
        let made = command(&["check", "there_is_no_such.toml"]);
        assert_eq!(made.status, ExitStatus::BadInput);
        assert_eq!(made.findings.len(), 1);
        assert_eq!(made.findings[0].file, "there_is_no_such.toml");
        assert!(made.messages.contains("there_is_no_such.toml"));
        assert!(!made.messages.contains('\u{1b}'), "{}", made.messages);
    }

    #[test]
    fn wrong_arguments_end_the_command_and_nothing_else() {
        let made = command(&["check", "--no-such"]);
        assert_eq!(made.status, ExitStatus::BadInput);
        assert!(made.messages.contains("--no-such"), "{made:?}");
        let help = command(&["--help"]);
        assert_eq!(help.status, ExitStatus::Success);
        assert!(help.output.contains("Usage:"));
    }
}

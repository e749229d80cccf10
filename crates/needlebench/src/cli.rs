//! The commands and their exit status.

use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{CommandFactory, Parser, Subcommand};
use needlebench_bench::provenance::PROGRAM_VERSION;
use needlebench_parallel::Progress;

use crate::clock;
use crate::command::{
    self, AtlasArguments, BREATH_HELP, BreathArguments, CheckArguments, ClearanceArguments,
    CompareArguments, CtArguments, DOCTOR_HELP, DoctorArguments, ExportArguments, FkArguments,
    ISO9283_HELP, IkArguments, InitArguments, Iso9283Arguments, JUDGE_HELP, JudgeArguments,
    MergeArguments, NeedleArguments, PairsArguments, PaperArguments, REPLAY_HELP, REPORT_HELP,
    ROBOT_HELP, RecordPlanArguments, ReplayArguments, ReportArguments, RobotCommandArguments,
    RunArguments, SEARCH_HELP, STUDY_HELP, SchemaFormat, SearchArguments, ServoArguments,
    StudyArguments, SuggestArguments, VIEW_HELP, ViewArguments,
};
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::host::{Invocation, hosted};
use crate::log::{LogLevel, told};
use crate::output::{complain, keep_to_width, print_as_it_is};
use crate::renamed::tell_former_names;

/// Simulation testbench for needle-guide robots: feasible arm configurations, needle-tip accuracy, clearances.
#[derive(Debug, Parser)]
#[command(name = "needlebench", version = PROGRAM_VERSION, propagate_version = true, max_term_width = 100)]
#[command(
    after_help = "Exit status: 0 all criteria met, 1 a criterion failed or was not evaluated, 2 invalid input, \
                        3 environment or engine failure, 130 interrupted."
)]
struct Cli {
    /// Log what is read, decided and skipped to standard error.
    #[arg(long = "log", global = true, value_enum, value_name = "LEVEL")]
    log_level: Option<LogLevel>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a small, commented first scenario that passes.
    #[command(
        after_help = "Example: needlebench init my_cell.toml --arm ur5e --lesion left_upper_lobe"
    )]
    Init(InitArguments),
    /// Propose entries for a lesion and base placements for the robot, as TOML to paste.
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
    /// Compute all inverse-kinematics solutions for a flange pose or a scenario goal.
    #[command(
        after_help = "Example: needlebench ik --pose 0.1942,-0.3593,0.1701,-0.8567,2.7197,-1.1407"
    )]
    Ik(Box<IkArguments>),
    /// Compute the poses of the flange and of every link for joint positions.
    #[command(
        after_help = "Example: needlebench fk --joints -0.735,2.370,1.883,-1.967,1.274,0.114"
    )]
    Fk(FkArguments),
    /// Compute the signed clearances of one posture in a scenario's cell.
    #[command(
        after_help = "Example: needlebench clearance scenarios/table3.toml --joints 0,-1.57,-1,-1.57,1.57,0"
    )]
    Clearance(ClearanceArguments),
    /// Map feasibility of every configuration over the roll angle about the needle.
    #[command(
        name = "roll-map",
        alias = "atlas",
        after_help = "Example: needlebench roll-map scenarios/supine_suite.toml --goal right_upper_anterior"
    )]
    Atlas(AtlasArguments),
    /// Export a scenario to another tool: the whole cell for MuJoCo, for ROS or as glTF; one of its motions for ROS 2
    /// or for a controller; its needles for 3D Slicer.
    #[command(after_help = "Example: needlebench export scenarios/table3.toml --as mjcf")]
    Export(Box<ExportArguments>),
    /// Compare two results; fail on regressions beyond given thresholds.
    #[command(
        after_help = "Example: needlebench compare out/before/table3 out/after/table3 --max-loss clearance=0.5mm",
        after_long_help = command::compare_help()
    )]
    Compare(Box<CompareArguments>),
    /// Inspect, convert and synthesise CT volumes; plan needle paths.
    #[command(after_help = "Example: needlebench ct info scan.nii.gz")]
    Ct(CtArguments),
    /// Serve the planning page for a patient's CT on this machine: lesion, target, entry and feasible configurations.
    #[command(
        after_help = "Example: needlebench view out/patient",
        after_long_help = VIEW_HELP
    )]
    View(ViewArguments),
    /// Compute many cases of one scenario; write a table of results, statistics and a report page.
    #[command(
        after_help = "Example: needlebench study scenarios/studies/layouts.toml",
        after_long_help = STUDY_HELP
    )]
    Study(Box<StudyArguments>),
    /// Optimise a study's control factors, such as base placement or tool.
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
    /// Evaluate accuracy and repeatability of a real robot by ISO 9283 from a laser tracker's log.
    #[command(
        after_help = "Example: needlebench iso9283 --csv robot.csv --commanded commanded.csv --max-rp 0.1",
        after_long_help = ISO9283_HELP
    )]
    Iso9283(Iso9283Arguments),
    /// Plan a collision-free excitation run for calibration and dynamic identification; write it as scenario and
    /// URScript.
    #[command(
        name = "plan-excitation",
        alias = "record-plan",
        after_help = "Example: needlebench plan-excitation --arm ur3e --payload-kg 0,1 --out out"
    )]
    RecordPlan(Box<RecordPlanArguments>),
    /// Identify the parameters of a real arm from a log and replay its set-points in the engines.
    #[command(
        after_help = "Example: needlebench replay models/ur3e/recorded/ur3e_rad_20211005.csv",
        after_long_help = REPLAY_HELP
    )]
    Replay(Box<ReplayArguments>),
    /// Judge a motion that another planner or program made, before any arm moves.
    #[command(
        after_help = "Example: needlebench judge scenarios/table3.toml --motion plan.json",
        after_long_help = JUDGE_HELP
    )]
    Judge(Box<JudgeArguments>),
    /// Run a program in URScript on a virtual controller, and judge what the arm does.
    #[command(
        after_help = "Example: needlebench robot scenarios/table3.toml --script my.script",
        after_long_help = ROBOT_HELP
    )]
    Robot(Box<RobotCommandArguments>),
    /// Insert a needle into tissue by itself; find the force across its tip from recorded bends.
    #[command(after_help = "Example: needlebench needle insert guide/examples/needle.toml")]
    Needle(NeedleArguments),
    /// Read recordings of breath: amplitude, period, level, drift and time within a window, each with its interval.
    #[command(
        after_help = "Example: needlebench breath guide/examples/breath.csv",
        after_long_help = BREATH_HELP
    )]
    Breath(BreathArguments),
    /// List collision pairs, enabled or disabled, with reasons; check an SRDF.
    #[command(after_help = "Example: needlebench pairs scenarios/table3.toml --srdf arm.srdf")]
    Pairs(PairsArguments),
    /// Measure the joint servo; write its data sheet: settings with sources, closed loop, step and sine responses.
    #[command(after_help = "Example: needlebench servo scenarios/table3.toml --joint wrist_1")]
    Servo(ServoArguments),
    /// Collect evidence for the credibility of results, in the framework of ASME V&V 40.
    #[command(
        after_help = "Example: needlebench report out/table3 --credibility",
        after_long_help = REPORT_HELP
    )]
    Report(ReportArguments),
    /// Reproduce the paper: Table 3, every equation, both methods, and Figure 6.
    #[command(after_help = "Example: needlebench paper --out out/paper")]
    Paper(PaperArguments),
    /// Print the JSON schema of scenario, study or arm files, for editors, or the table of metrics.
    #[command(after_help = "Example: needlebench schema scenario > scenario.schema.json")]
    Schema {
        /// Format to describe.
        #[arg(value_enum)]
        format: SchemaFormat,
        /// Print Markdown instead of JSON.
        #[arg(long)]
        markdown: bool,
    },
    /// Check the environment; pre-install MuJoCo, online or offline.
    #[command(
        after_help = "Example: needlebench doctor --prepare",
        after_long_help = DOCTOR_HELP
    )]
    Doctor(DoctorArguments),
    /// Print third-party licences.
    #[command(
        alias = "licenses",
        after_help = "Example: needlebench licences | less"
    )]
    Licences,
    /// Print completions for a shell.
    #[command(after_help = "Example: needlebench completions bash > needlebench.bash")]
    Completions {
        /// Shell.
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

/// Runs the program with these arguments, the program's name first.
pub fn main_with(arguments: Vec<OsString>) -> ExitStatus {
    caught(|| {
        tell_former_names(&arguments);
        let cli = Cli::parse_from(arguments);
        run(cli)
    })
}

/// Runs a command as part of another program, on this thread. The arguments begin with the command; nothing is printed, and
/// signals and the process are left alone.
///
/// Setting `cancel` is an interrupt. A panic is a bug, and is reported as one.
pub fn invoke(
    arguments: Vec<OsString>,
    cancel: Arc<AtomicBool>,
    progress: Arc<dyn Progress + Send + Sync>,
) -> Invocation {
    let program = std::iter::once(OsString::from("needlebench"));
    let arguments: Vec<OsString> = program.chain(arguments).collect();
    hosted(cancel, progress, || {
        caught(|| {
            tell_former_names(&arguments);
            match Cli::try_parse_from(arguments) {
                Ok(cli) => run(cli),
                Err(error) => {
                    let text = error.render().to_string();
                    if error.use_stderr() {
                        complain(text.trim_end());
                        return ExitStatus::BadInput;
                    }
                    // Only the host reads it.
                    let _ = print_as_it_is(text.trim_end());
                    ExitStatus::Success
                }
            }
        })
    })
}

/// Turns a panic into an exit status; its message is on standard error by then.
fn caught(run: impl FnOnce() -> ExitStatus) -> ExitStatus {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(run)).unwrap_or_else(|_| {
        complain("error: this is a bug in needlebench, not in your input");
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
        Command::Judge(arguments) => command::judge(&arguments),
        Command::Robot(arguments) => command::robot(&arguments),
        Command::Needle(arguments) => command::needle(&arguments),
        Command::Breath(arguments) => command::breath(&arguments),
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
    use needlebench_parallel::Silent;

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

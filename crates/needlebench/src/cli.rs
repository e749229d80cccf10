//! Arguments of the command line.

mod study;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
use nalgebra::Matrix3x4;
use needlebench_kinematics::UrModel;

use study::STUDY_HELP;
pub(crate) use study::{MergeArguments, StudyArguments, StudyResultArguments};

use crate::command;
use crate::exit::ExitStatus;
use crate::pipeline::EngineChoice;

/// Testbench for needle-guide robots: which of the eight arm configurations put the needle guide
/// on its place, how far off the needle's tip is, and how close anything comes to anything.
#[derive(Debug, Parser)]
#[command(name = "needlebench", version = VERSION, propagate_version = true, max_term_width = 100)]
#[command(
    after_help = "Exit status: 0 all criteria met, 1 a criterion failed, 2 bad input, \
                        3 the environment or an engine failed, 130 interrupted."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const VERSION: &str = concat!(
    env!("CARGO_PKG_VERSION"),
    " (",
    env!("NEEDLEBENCH_GIT_REVISION"),
    ")"
);

#[derive(Debug, Subcommand)]
enum Command {
    /// Plan, simulate and measure every configuration of every goal.
    #[command(after_help = "Example: needlebench run scenarios/table3.toml --out out/table3")]
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
    /// Two results side by side: what changed, and whether more was lost than is allowed.
    #[command(
        after_help = "Example: needlebench compare out/before/table3 out/after/table3 --max-loss clearance=0.5mm",
        after_long_help = COMPARE_HELP
    )]
    Compare(Box<CompareArguments>),
    /// Many cases of one scenario: a table of results, statistics, and a page to look at them.
    #[command(
        after_help = "Example: needlebench study scenarios/studies/layouts.toml",
        after_long_help = STUDY_HELP
    )]
    Study(Box<StudyArguments>),
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
    /// Every pair of bodies: measured or left out, why, and the evidence; and checks an SRDF.
    #[command(after_help = "Example: needlebench pairs scenarios/table3.toml --srdf arm.srdf")]
    Pairs(PairsArguments),
    /// The joint servo's data sheet: settings with sources, closed loop, step and sine responses.
    #[command(after_help = "Example: needlebench servo scenarios/table3.toml --joint wrist_1")]
    Servo(ServoArguments),
    /// Reproduce the paper: Table 3, every equation, both methods, and Figure 6.
    #[command(after_help = "Example: needlebench paper --out out/paper")]
    Paper(PaperArguments),
    /// JSON schema of scenario or study files, for editors.
    #[command(after_help = "Example: needlebench schema scenario > scenario.schema.json")]
    Schema {
        /// Which file format.
        #[arg(value_enum)]
        format: SchemaFormat,
    },
    /// What this machine has and lacks for running both engines.
    #[command(after_help = "Example: needlebench doctor")]
    Doctor {
        /// Print one JSON document.
        #[arg(long)]
        json: bool,
    },
    /// Completions for a shell.
    #[command(after_help = "Example: needlebench completions bash > needlebench.bash")]
    Completions {
        /// The shell.
        #[arg(value_enum)]
        shell: clap_complete::Shell,
    },
}

/// Formats that have a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum SchemaFormat {
    /// Scenario files.
    Scenario,
    /// Study files.
    Study,
}

/// Another robot than the scenario's.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct RobotArguments {
    /// URDF of another UR arm instead of the scenario's or the shipped UR3.
    #[arg(long, value_name = "URDF")]
    pub robot: Option<PathBuf>,
    /// Folder of a ROS package that the URDF's meshes name; may be given several times.
    #[arg(long, value_name = "NAME=DIR")]
    pub package_path: Vec<String>,
    /// Factory calibration of the arm, as ROS's `ur_calibration` writes it: its joint origins
    /// replace the URDF's.
    #[arg(long, value_name = "YAML")]
    pub calibration: Option<PathBuf>,
    /// What to do when a moving link has no mass.
    #[arg(long, value_enum, value_name = "POLICY")]
    pub missing_inertia: Option<MissingInertiaArgument>,
}

/// Another robot than the shipped UR3, where its kinematics are enough.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct ArmArguments {
    /// A UR arm by name, with its nominal lengths: UR3, UR3e, UR5, UR5e, UR10, UR10e or UR16e.
    #[arg(
        long,
        value_name = "MODEL",
        conflicts_with_all = ["robot", "package_path", "missing_inertia"]
    )]
    pub arm: Option<UrModel>,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// What to do when a moving link has no mass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MissingInertiaArgument {
    /// Refuse the robot.
    Error,
    /// Take the shipped UR3's mass properties and say so in the report.
    NominalUr3,
}

#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct RunArguments {
    /// Scenario files.
    #[arg(required = true, value_name = "SCENARIO")]
    pub scenarios: Vec<PathBuf>,
    /// Engines, instead of the scenario's own choice.
    #[arg(long, value_enum)]
    pub engine: Option<EngineChoice>,
    /// Hold every simulated motion against the referee, our own dynamics integrated to rounding, at
    /// the scenario's time step, its half and its quarter; three to ten times as long.
    #[arg(long)]
    pub referee: bool,
    /// Folder for results; each scenario gets a folder of its name in it.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print the report as one JSON document instead of the table.
    #[arg(long)]
    pub json: bool,
    /// Write JUnit XML of all scenarios to this file besides the one in the results folder.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Threads; the number of cores if left out. Results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    /// Draw no pictures.
    #[arg(long)]
    pub no_pictures: bool,
    /// Write no report page.
    #[arg(long)]
    pub no_page: bool,
    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

#[derive(Debug, Args)]
pub(crate) struct AtlasArguments {
    /// Scenario whose goals are looked at.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// One goal; all of them if left out.
    #[arg(long, value_name = "NAME")]
    pub goal: Option<String>,
    /// Rolls all round.
    #[arg(long, value_name = "N", default_value_t = 360, value_parser = clap::value_parser!(u32).range(3..=36_000))]
    pub rolls: u32,
    /// What the marked roll of each range is best at; the scenario's `planning.roll_aim` if left out.
    /// The report has all aims.
    #[arg(long, value_enum)]
    pub aim: Option<AimArgument>,
    /// Folder for results; the scenario gets a folder of its name in it.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print the atlas as one JSON document instead of the table.
    #[arg(long)]
    pub json: bool,
    /// Draw no pictures.
    #[arg(long)]
    pub no_pictures: bool,
    /// Write no page.
    #[arg(long)]
    pub no_page: bool,
    /// Threads; the number of cores if left out. Results do not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub jobs: Option<u16>,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// What a roll is best at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub(crate) enum AimArgument {
    /// Soft least clearance over all classes.
    Clearance,
    /// Margin to the joint limits.
    JointMargin,
    /// Distance from singularities.
    Singularity,
    /// Least motion of the needle's tip under errors of the joints.
    TipAccuracy,
    /// Weighted mean of the utilities of all these.
    Balanced,
}

#[derive(Debug, Args)]
pub(crate) struct CheckArguments {
    /// Scenario files.
    #[arg(required = true, value_name = "SCENARIO")]
    pub scenarios: Vec<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Methods of inverse kinematics.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum IkMethod {
    /// All configurations.
    ClosedForm,
    /// One, near the seed.
    GaussNewton,
    /// One, from any seed: damped, and started again until it converges.
    Damped,
}

#[derive(Debug, Args)]
pub(crate) struct IkArguments {
    /// Scenario, of which `--goal` is solved.
    #[arg(
        value_name = "SCENARIO",
        conflicts_with_all = ["pose", "matrix", "arm"],
        requires = "goal"
    )]
    pub scenario: Option<PathBuf>,
    /// Goal of the scenario.
    #[arg(long, requires = "scenario")]
    pub goal: Option<String>,
    /// Pose of the flange in the controller's base frame: x,y,z (m) and rotation vector (rad).
    #[arg(
        long,
        value_name = "x,y,z,rx,ry,rz",
        allow_hyphen_values = true,
        required_unless_present_any = ["scenario", "matrix"]
    )]
    pub pose: Option<Six>,
    /// The same as a matrix: 12 or 16 numbers, row by row, rotation and position (m).
    #[arg(
        long,
        value_name = "NUMBERS",
        allow_hyphen_values = true,
        conflicts_with = "pose"
    )]
    pub matrix: Option<PoseMatrix>,
    /// Take the rotation that is nearest to the matrix if it is not exactly one, such as after
    /// rounding.
    #[arg(long, requires = "matrix")]
    pub nearest_rotation: bool,
    /// Method.
    #[arg(long, value_enum, default_value = "closed-form")]
    pub method: IkMethod,
    /// Joint positions to start from or to be near to, rad.
    #[arg(long, value_name = "q1,..,q6", allow_hyphen_values = true)]
    pub seed: Option<Six>,
    /// Steps after which a numerical method gives up.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub max_iterations: Option<u32>,
    /// Time after which a numerical method gives up, ms. What it has found by then depends on the
    /// machine.
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(1..))]
    pub time_limit_ms: Option<u32>,
    /// List whole turns within the joint limits too, nearest to the seed (or to zero) first; at most
    /// one turn more or less of a joint without limits.
    #[arg(long)]
    pub wraps: bool,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub arm: ArmArguments,
}

#[derive(Debug, Args)]
pub(crate) struct FkArguments {
    /// Joint positions, shoulder pan to wrist 3, rad.
    #[arg(long, value_name = "q1,..,q6", allow_hyphen_values = true)]
    pub joints: Six,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub arm: ArmArguments,
}

#[derive(Debug, Args)]
pub(crate) struct ClearanceArguments {
    /// Scenario whose cell is used.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// Joint positions, shoulder pan to wrist 3, rad.
    #[arg(long, value_name = "q1,..,q6", allow_hyphen_values = true)]
    pub joints: Six,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

#[derive(Debug, Args)]
pub(crate) struct ServoArguments {
    /// Scenario whose robot and servo are looked at, at the first goal that is reached.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// One joint, such as `wrist_1`; all of them if left out.
    #[arg(long, value_name = "JOINT")]
    pub joint: Option<String>,
    /// Engines; the scenario's own choice if left out.
    #[arg(long, value_enum)]
    pub engine: Option<EngineChoice>,
    /// Folder for results; the scenario gets a folder of its name in it.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print one JSON document instead of the tables.
    #[arg(long)]
    pub json: bool,
    /// Draw no pictures.
    #[arg(long)]
    pub no_pictures: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

const ISO9283_HELP: &str = "\
Both files are tables whose first line names the columns and their units; comma, semicolon (with \
decimal commas) or tab between them; lines that start with #, // or % are comments. `needlebench \
run` of a scenario with [iso9283] writes both as an example.

  pose         P1 to P5 or 1 to 5; P3_07 is pose 3 in cycle 7
  x_mm y_mm z_mm   or x [mm], X (m) and so on: m, mm, um or in
  cycle        1, 2, 3 ...; counted if there is none
  direction    x, y or z where a pose was approached along an axis (for vAP), else empty
  qw qx qy qz  orientation, or rx_deg ry_deg rz_deg with --rotation
  time_s       seconds, or dates like 2026-01-31T12:00:00

Positions are in the robot's base frame; --fit-frame finds the tracker's own frame first.

Example: needlebench iso9283 --csv robot.csv --commanded commanded.csv --max-rp 0.1
Example: needlebench iso9283 --csv export.txt --commanded poses.csv --length-unit mm --fit-frame";

#[derive(Debug, Args)]
pub(crate) struct Iso9283Arguments {
    /// The tracker's log: a row for each measured pose.
    #[arg(long, value_name = "CSV")]
    pub csv: PathBuf,
    /// Commanded poses: a row for each pose.
    #[arg(long, value_name = "CSV")]
    pub commanded: PathBuf,
    /// The log is in the tracker's own frame: find it by the best fit of the mean positions to the
    /// commanded ones. AP is then without the error of the base's place.
    #[arg(long)]
    pub fit_frame: bool,
    /// Unit of lengths where the header does not say it.
    #[arg(long, value_enum, value_name = "UNIT")]
    pub length_unit: Option<LengthUnit>,
    /// Unit of angles where the header does not say it.
    #[arg(long, value_enum, value_name = "UNIT")]
    pub angle_unit: Option<AngleUnit>,
    /// What columns rx, ry, rz mean.
    #[arg(long, value_enum, value_name = "MEANING")]
    pub rotation: Option<RotationArgument>,
    /// Largest pose accuracy AP of any pose, mm.
    #[arg(long, value_name = "MM")]
    pub max_ap: Option<f64>,
    /// Largest pose repeatability RP of any pose, mm.
    #[arg(long, value_name = "MM")]
    pub max_rp: Option<f64>,
    /// Largest multi-directional variation vAP of any pose, mm.
    #[arg(long, value_name = "MM")]
    pub max_vap: Option<f64>,
    /// Folder for report.json, the measurements in the base frame, and a picture.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    /// Draw no picture.
    #[arg(long)]
    pub no_pictures: bool,
}

/// Units of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LengthUnit {
    /// Metres.
    M,
    /// Millimetres.
    Mm,
    /// Micrometres.
    Um,
    /// Inches.
    In,
}

impl LengthUnit {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Mm => "mm",
            Self::Um => "um",
            Self::In => "in",
        }
    }
}

/// Units of angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum AngleUnit {
    /// Degrees.
    Deg,
    /// Radians.
    Rad,
    /// Milliradians.
    Mrad,
}

impl AngleUnit {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Deg => "deg",
            Self::Rad => "rad",
            Self::Mrad => "mrad",
        }
    }
}

/// What three columns of a rotation mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RotationArgument {
    /// Axis times angle, as a UR controller shows poses.
    RotationVector,
    /// Turns about the fixed axes x, then y, then z, as SpatialAnalyzer shows frames.
    FixedXyz,
}

const COMPARE_HELP: &str = "\
Exits with 1 if a configuration that worked is missing, fails or is rejected (unless \
--allow-status-change), or if a metric got worse than its --max-loss allows.

Metrics: clearance, self_clearance, needle_corridor, tip_error, tip_sensitivity, joint_margin, \
singularity_margin, shoulder_margin, motion_time, peak_torque, free_fraction, sight_fraction, \
hand_cone, preference, needle_angle_error, lateral_error, guide_position_error, settling_time, \
tracking_error, contact_force, engine_difference_peak, engine_difference_settled, arm_to_skin, \
tool_to_skin, guide_to_skin, to_table, to_gantry, to_mount, needle_route

Two studies (folders with results.parquet, or such tables) are compared case by case if they have \
the same cases, else by 95 % intervals. They exit with 1 if more than chance was lost of the layouts \
that work or of a configuration's success rate (unless --allow-status-change, or a --max-loss is on \
it), or if a --max-loss is exceeded. Its metrics are then METRIC[@PERCENT][:CONFIGURATION]: the \
quantile at PERCENT (default 5, of errors 95) of a configuration, of `every` one, or of the `best` of \
each layout (default).

Metrics of studies: working_layouts, success_rate (of `every` by default), invalid_layouts, clearance, \
certified_clearance, self_clearance, tip_error, tip_lateral, tip_rms, tip_sensitivity, surplus

Example: needlebench compare out/before/layouts out/after/layouts --max-loss clearance@5=1mm \
--max-loss success_rate:Right-Up-Fold=0.02 --max-loss tip_error@95:every=0.1mm
Example: needlebench compare out/before/table3 out/after/table3 --max-loss clearance=0.5mm
Example: needlebench compare scenarios/table3.toml other_table.toml --max-loss motion_time=10%";

#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(crate) struct CompareArguments {
    /// First result: a report.json, a results folder, or a scenario, which is then run; or a study's
    /// folder or results.parquet.
    #[arg(value_name = "A")]
    pub a: PathBuf,
    /// Second result, likewise.
    #[arg(value_name = "B")]
    pub b: PathBuf,
    /// Engine for scenarios that have to be run first.
    #[arg(long, value_enum, default_value = "rapier")]
    pub engine: EngineChoice,
    /// A goal of A that is called otherwise in B; may be given several times.
    #[arg(long, value_name = "A=B")]
    pub goal: Vec<Pair>,
    /// Largest loss of a metric that is allowed, with its unit: clearance=0.5mm, tip_error=5%; may be
    /// given several times. `--help` lists the metrics. 0 allows no loss at all, not even rounding.
    #[arg(long, value_name = "METRIC=VALUE")]
    pub max_loss: Vec<Pair>,
    /// TOML file with such losses under [max_loss]; those of the command line go before it.
    #[arg(long, value_name = "TOML")]
    pub thresholds: Option<PathBuf>,
    /// Do not fail where a configuration no longer works.
    #[arg(long)]
    pub allow_status_change: bool,
    /// List values that did not change too.
    #[arg(long)]
    pub all: bool,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    /// Write JUnit XML to this file.
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Write a Markdown summary to this file.
    #[arg(long, value_name = "FILE")]
    pub markdown: Option<PathBuf>,
    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
}

/// Two texts with `=` between.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Pair(pub (String, String));

impl std::str::FromStr for Pair {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.split_once('=') {
            Some((a, b)) if !a.trim().is_empty() && !b.trim().is_empty() => {
                Ok(Self((a.trim().to_owned(), b.trim().to_owned())))
            }
            _ => Err("needs a name, `=` and what it stands for".to_owned()),
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct PairsArguments {
    /// Scenario whose cell is looked at.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// SRDF whose disabled pairs are checked against the model. needlebench measures every pair
    /// that can move, whatever an SRDF says.
    #[arg(long, value_name = "FILE")]
    pub srdf: Option<PathBuf>,
    /// Write the arm's pairs that cannot collide as an SRDF.
    #[arg(long, value_name = "FILE")]
    pub write_srdf: Option<PathBuf>,
    /// Random postures that the collision rates are taken from.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub samples: u32,
    /// Boxes of joint positions after which the proof that a pair never touches gives up.
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    pub proof_boxes: u32,
    /// Seed of the postures.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub seed: u64,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

#[derive(Debug, Args)]
pub(crate) struct PaperArguments {
    /// Folder for `paper.json`, `paper.html` and the pictures.
    #[arg(long, value_name = "DIR", default_value = "out/paper")]
    pub out: PathBuf,
    /// Print the results as one JSON document instead of the tables.
    #[arg(long)]
    pub json: bool,
    /// Draw no pictures.
    #[arg(long)]
    pub no_pictures: bool,
    /// Show no progress.
    #[arg(long)]
    pub quiet: bool,
}

/// Six comma-separated finite numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Six(pub [f64; 6]);

impl std::str::FromStr for Six {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Vec<f64> = text
            .split(',')
            .map(|word| finite(word.trim()))
            .collect::<Result<_, _>>()?;
        let count = numbers.len();
        numbers
            .try_into()
            .map(Self)
            .map_err(|_| format!("needs six numbers separated by commas, got {count}"))
    }
}

/// The upper three rows `[R | p]` of a pose's matrix, as they were given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PoseMatrix(pub Matrix3x4<f64>);

impl std::str::FromStr for PoseMatrix {
    type Err = String;

    /// Reads what programs print: numbers between commas, semicolons, brackets and white space.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Vec<f64> = text
            .split(|each: char| each.is_whitespace() || ",;[]()".contains(each))
            .filter(|word| !word.is_empty())
            .map(finite)
            .collect::<Result<_, _>>()?;
        let count = numbers.len();
        let rows = match count {
            12 => &numbers[..],
            16 => {
                let (rows, last) = numbers.split_at(12);
                if last != [0.0, 0.0, 0.0, 1.0] {
                    let columns = [3, 7, 11].iter().all(|&at| rows[at] == 0.0) && last[3] == 1.0;
                    return Err(if columns {
                        "the numbers are column by column; give them row by row".to_owned()
                    } else {
                        format!("the last row is {last:?}, but has to be 0, 0, 0, 1")
                    });
                }
                rows
            }
            _ => {
                return Err(format!(
                    "needs 12 numbers (three rows of rotation and position) or 16, got {count}"
                ));
            }
        };
        Ok(Self(Matrix3x4::from_row_slice(rows)))
    }
}

fn finite(word: &str) -> Result<f64, String> {
    let number: f64 = word
        .parse()
        .map_err(|_| format!("`{word}` is not a number"))?;
    if number.is_finite() {
        Ok(number)
    } else {
        Err(format!("`{word}` is not finite"))
    }
}

/// The command line, for completions and documentation.
pub fn command_line() -> clap::Command {
    Cli::command()
}

/// Runs the program.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match cli.command {
        Command::Run(arguments) => command::run(&arguments),
        Command::Check(arguments) => command::check(&arguments),
        Command::Ik(arguments) => command::ik(&arguments),
        Command::Fk(arguments) => command::fk(&arguments),
        Command::Clearance(arguments) => command::clearance(&arguments),
        Command::Atlas(arguments) => command::atlas(&arguments),
        Command::Compare(arguments) => command::compare(&arguments),
        Command::Study(arguments) => command::study(&arguments),
        Command::Merge(arguments) => command::merge(&arguments),
        Command::Iso9283(arguments) => command::iso9283(&arguments),
        Command::Pairs(arguments) => command::pairs(&arguments),
        Command::Servo(arguments) => command::servo(&arguments),
        Command::Paper(arguments) => command::paper(&arguments),
        Command::Schema { format } => command::schema(format),
        Command::Doctor { json } => command::doctor(json),
        Command::Completions { shell } => command::completions(shell),
    };
    match result {
        Ok(status) => status.into(),
        Err(error) => {
            // A closed pipe (`needlebench ... | head`) is the reader's choice.
            let closed = error
                .downcast_ref::<std::io::Error>()
                .is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe);
            if closed {
                return ExitStatus::Success.into();
            }
            anstream::eprintln!("error: {error:#}");
            ExitStatus::EnvironmentFailed.into()
        }
    }
}

//! `needlebench plan-excitation`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use needlebench_bench::Runnable;
use needlebench_bench::record_plan::PlanReport;
use needlebench_cell::pair_in_words;
use needlebench_clearance::ClearanceModel;
use needlebench_evaluation::excitation::proven_m;
use needlebench_export::excitation_script;
use needlebench_input::{Finding, read_text};
use needlebench_kinematics::{JOINT_LABELS, Joints};
use needlebench_planning::excitation::{
    Aim, ExcitationPlan, FoundRun, SearchError, SearchOptions, search,
};
use needlebench_report::files::{Folder, write_plan};
use needlebench_report::table::excitation::plan_text;
use needlebench_scenario::excitation::{ExcitationSection, FEWEST_POSTURES, Load, SweepSection};
use needlebench_scenario::scenario::PayloadSection;
use needlebench_scenario::{ExcitationText, Overrides, resolve_scenario};

use super::results_folder::prepare_folder;
use super::{overrides, print_json, print_text};
use crate::arguments::RobotArguments;
use crate::exit::ExitStatus;
use crate::failure::Failure;
use crate::output::{complain, shown};

/// Speeds of sweeps, deg/s: the section's defaults, if the arm permits them.
const SWEEP_SPEEDS_DEG_S: [f64; 2] = [6.0, 40.0];

/// Time between two rows of a simulated log, ms: 125 Hz, which every controller supports.
const PERIOD_MS: f64 = 8.0;

/// Distance of a payload's centre from the axis of the last joint, mm: 0.5 N m with 1 kg, several times the uncertainty
/// of a current.
const BESIDE_AXIS_MM: f64 = 50.0;

/// Number of searches with other seeds if the run found is too close to something between samples.
const ATTEMPTS: u64 = 5;

#[derive(Debug, Args)]
pub(crate) struct RecordPlanArguments {
    /// Scenario with the cell [default: the arm of --arm alone on a large bench].
    #[arg(value_name = "SCENARIO", required_unless_present_any = ["arm", "robot"])]
    pub scenario: Option<PathBuf>,
    /// Number of static postures.
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u16).range(1..=300))]
    pub poses: u16,
    /// Random seed of the search [default: that of the scenario].
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Payloads mounted in addition to the tool, kg; the run is made once with each.
    #[arg(
        long,
        value_name = "KG[,KG]",
        value_delimiter = ',',
        default_value = "0,1",
        allow_negative_numbers = true
    )]
    pub payload_kg: Vec<f64>,
    /// Centre of a payload in the flange frame, mm [default: half its depth in front of the flange and 50 mm off its axis,
    /// so that gravity loads the last joint].
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub payload_centre_mm: Option<Three>,
    /// Edges of the box around a payload, mm [default: a steel cube of its mass].
    #[arg(long, value_name = "X,Y,Z")]
    pub payload_size_mm: Option<Three>,
    /// Speed of the leading joint between postures, deg/s; every second motion has half of it.
    #[arg(long, value_name = "DEG_S", default_value_t = 60.0)]
    pub speed: f64,
    /// Required certified clearance of arm, tool and payload from everything else, mm.
    #[arg(long, value_name = "MM", default_value_t = 30.0)]
    pub clearance_mm: f64,
    /// Required certified self-clearance of arm, tool and payload, mm.
    #[arg(long, value_name = "MM", default_value_t = 5.0)]
    pub self_clearance_mm: f64,
    /// Folder for results; the run has a subfolder of the scenario's or arm's name.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print one JSON document instead of the tables.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Three finite numbers between commas.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Three(pub [f64; 3]);

impl std::str::FromStr for Three {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Vec<f64> = text
            .split(',')
            .map(|word| {
                let number = word.trim().parse::<f64>().ok();
                let finite = number.filter(|number| number.is_finite());
                finite.ok_or_else(|| format!("`{}` is not a number", word.trim()))
            })
            .collect::<Result<_, _>>()?;
        let count = numbers.len();
        let three = numbers.try_into();
        three
            .map(Self)
            .map_err(|_| format!("expected three comma-separated numbers, got {count}"))
    }
}

/// Plans a run, writes it as a scenario and as a program, and prints its clearances and predicted uncertainties.
pub(crate) fn record_plan(arguments: &RecordPlanArguments) -> Result<ExitStatus, Failure> {
    let mut made = plan(arguments, &overrides(&arguments.robot)?)?;
    let folder = Folder(&made.folder);
    write_plan(&mut made.report, &made.scenario, &made.script, folder)
        .with_context(|| format!("cannot write the run to {}", made.folder.display()))?;
    for note in &made.notes {
        complain(&format!("note: {note}"));
    }
    if arguments.json {
        print_json(&made.report)?;
    } else {
        print_text(&format!(
            "{}\nresults: {}",
            plan_text(&made.report).trim_end(),
            shown(&made.folder)
        ))?;
    }
    Ok(ExitStatus::Success)
}

/// A run to write.
struct Made {
    folder: PathBuf,
    report: PlanReport,
    scenario: String,
    script: String,
    notes: Vec<String>,
}

fn plan(arguments: &RecordPlanArguments, overrides: &Overrides) -> Result<Made, Failure> {
    let wanted = wanted(arguments)?;
    if let Some(expanded) = &overrides.expanded {
        let file = expanded.path.display();
        let message =
            "the scenario that is written names its robot's URDF, and this is a xacro file";
        return Err(vec![Finding::new(file.to_string(), message).hint(format!(
            "expand it first: xacro {file} > robot.urdf; then --robot robot.urdf"
        ))]
        .into());
    }
    let cell = cell_text(arguments, overrides)?;
    // The draft contains the overrides of the robot.
    let others = Overrides {
        robot_urdf: None,
        arm: None,
        calibration: None,
        ..overrides.clone()
    };
    let name = cell.name().unwrap_or("excitation").to_owned();
    let file = arguments.scenario.as_ref().map_or_else(
        || "the command line".to_owned(),
        |path| path.display().to_string(),
    );
    let placeholder = ExcitationSection {
        postures_deg: vec![[0.0; 6]],
        ..wanted.clone()
    };
    let draft = cell.with(&name, "", "", None, &placeholder, &[]);
    // Line numbers are those of the draft, which is not a file.
    let without_lines = |findings: Vec<Finding>| {
        findings
            .into_iter()
            .map(|finding| {
                of_arguments(Finding {
                    line: None,
                    ..finding
                })
            })
            .collect::<Vec<_>>()
    };
    let resolved =
        resolve_scenario(&file, &draft, Path::new(""), &others).map_err(without_lines)?;
    let protocol = resolved.excitation.clone().expect("the draft has a run");
    let folder = arguments.out.join(&name);
    prepare_folder(&folder)?;
    let seed = arguments.seed.unwrap_or(resolved.scenario.seed);
    let model = ClearanceModel::new(&resolved.cell);
    let mut refused = None;
    for attempt in 0..ATTEMPTS {
        let options = SearchOptions {
            postures: usize::from(arguments.poses),
            seed: seed ^ (attempt << 32),
        };
        let mut found = search(&resolved, &protocol, &model, options)
            .map_err(|error| not_found(&file, &error))?;
        let section = section_of(&wanted, &found);
        let text = |head: &str, remarks: &[String]| {
            cell.with(
                &format!("{name}_excitation"),
                &format!("Excitation run in the cell of {name}, by needlebench plan-excitation."),
                head,
                Some(degrees(&resolved.start)),
                &section,
                remarks,
            )
        };
        let file = folder.join("excitation.toml").display().to_string();
        let planned = resolve_scenario(&file, &text("", &[]), &folder, &others)?;
        let runnable = Runnable::new(planned);
        let plan = runnable.excitation().expect("the scenario has a run");
        let plan = match plan {
            Ok(plan) => plan,
            Err(error) => {
                refused = Some(Finding::new(&file, error.to_string()));
                continue;
            }
        };
        let resolved = runnable.scenario();
        if let Some(planned) = &resolved.excitation {
            found.protocol = planned.clone();
        }
        let report = PlanReport::of(resolved, plan, &found, seed);
        let scenario = text(&head(&report), &remarks(&report, plan));
        let script = excitation_script(resolved, &found.protocol, plan, &report);
        return Ok(Made {
            folder,
            report,
            scenario,
            script,
            notes: resolved.notes.clone(),
        });
    }
    Err(Failure::BadInput(refused.into_iter().collect()))
}

/// The section without postures and sweeps.
fn wanted(arguments: &RecordPlanArguments) -> Result<ExcitationSection, Finding> {
    let refuse = |key: &str, message: String, hint: &str| {
        Err(Finding::new("the command line", message)
            .key(key)
            .hint(hint))
    };
    let poses = usize::from(arguments.poses);
    if poses < FEWEST_POSTURES {
        return refuse(
            "--poses",
            format!("{poses} postures, at least {FEWEST_POSTURES} required"),
            "a calibration has 30 unknowns and degrades the arm with too few postures: use 24",
        );
    }
    for (key, value, range) in [
        ("--speed", arguments.speed, 1.0..=360.0),
        ("--clearance-mm", arguments.clearance_mm, 0.0..=1000.0),
        (
            "--self-clearance-mm",
            arguments.self_clearance_mm,
            0.0..=1000.0,
        ),
    ] {
        if !range.contains(&value) {
            let message = format!("{value} is outside {} to {}", range.start(), range.end());
            return refuse(key, message, "speeds are in deg/s, clearances in mm");
        }
    }
    for (index, mass) in arguments.payload_kg.iter().enumerate() {
        if !(0.0..=50.0).contains(mass) {
            let message = format!("a payload of {mass} kg, outside 0 to 50");
            return refuse(
                "--payload-kg",
                message,
                "give the mass mounted in addition to the tool, kg",
            );
        }
        if arguments.payload_kg[..index].contains(mass) {
            let message = format!("{mass} kg is given twice");
            return refuse("--payload-kg", message, "the run is made once with each");
        }
    }
    let payloads = arguments.payload_kg.iter();
    let payloads = payloads
        .map(|&mass_kg| payload(arguments, mass_kg))
        .collect();
    Ok(ExcitationSection {
        speeds_deg_s: vec![arguments.speed, 0.5 * arguments.speed],
        sweep_speeds_deg_s: SWEEP_SPEEDS_DEG_S
            .into_iter()
            .map(|speed| speed.min(arguments.speed))
            .collect(),
        payloads,
        period_ms: Some(PERIOD_MS),
        clearance_mm: arguments.clearance_mm,
        self_clearance_mm: arguments.self_clearance_mm,
        ..ExcitationSection::default()
    })
}

/// A payload as the section has it.
fn payload(arguments: &RecordPlanArguments, mass_kg: f64) -> PayloadSection {
    if mass_kg == 0.0 {
        return PayloadSection::default();
    }
    let on_axis = PayloadSection {
        mass_kg,
        centre_mm: None,
        size_mm: arguments.payload_size_mm.map(|three| three.0),
    };
    let depth_mm = Load::of(&on_axis).body.com_m.z * 1e3;
    let centre_mm = arguments.payload_centre_mm.map_or(
        [BESIDE_AXIS_MM, 0.0, (depth_mm * 10.0).round() / 10.0],
        |three| three.0,
    );
    PayloadSection {
        centre_mm: Some(centre_mm),
        ..on_axis
    }
}

/// The cell: of the scenario, or an arm alone on a bench.
fn cell_text(
    arguments: &RecordPlanArguments,
    overrides: &Overrides,
) -> Result<ExcitationText, Finding> {
    if let Some(path) = &arguments.scenario {
        let file = path.display().to_string();
        let text = read_text(path).map_err(|error| {
            let hint = error.hint("scenarios are TOML files, such as scenarios/table3.toml");
            Finding::new(&file, format!("cannot read the scenario: {error}")).hint(hint)
        })?;
        let base = path.parent().unwrap_or(Path::new(""));
        return ExcitationText::new(&file, &text, base, overrides);
    }
    let named = overrides.arm.clone().or_else(|| {
        let path = overrides.robot_urdf.as_ref()?;
        Some(path.display().to_string())
    });
    let named = named.unwrap_or_default();
    let stem = Path::new(&named).file_stem();
    let name: String = stem
        .map_or(String::new(), |stem| stem.to_string_lossy().into_owned())
        .chars()
        .filter(|each| each.is_ascii_alphanumeric() || "-_".contains(*each))
        .take(80)
        .collect();
    let name = if name.is_empty() { "arm" } else { &name };
    // The mounting surface is unknown: a bench larger than the reach of the arm.
    let text = format!(
        "name = \"{name}\"\nseed = 1\n\n[[obstacles]]\nname = \"bench_top\"\nclass = \"robot_mount\"\n\
         attached_to = \"robot_base\"\nposition_mm = [0, 0, -20]\n\
         shape = {{ box = {{ size_mm = [3000, 3000, 40] }} }}\n"
    );
    ExcitationText::new("the command line", &text, Path::new(""), overrides)
}

/// A finding about a key of the run, assigned to the argument that set it.
fn of_arguments(finding: Finding) -> Finding {
    let argument = match finding.key.as_deref() {
        Some(key) if key.contains(".size_mm") => "--payload-size-mm",
        Some(key) if key.contains(".centre_mm") => "--payload-centre-mm",
        Some(key) if key.starts_with("excitation.payloads") => "--payload-kg",
        Some(key) if key.starts_with("excitation.speeds") => "--speed",
        Some("robot.arm") => "--arm",
        _ => return finding,
    };
    finding.key(argument)
}

fn not_found(file: &str, error: &SearchError) -> Finding {
    let finding = Finding::new(file, error.to_string());
    match error {
        SearchError::Start { .. } => finding.key("start.joints_deg").hint(
            "choose another start posture under [start] of a scenario, or lower --clearance-mm or \
             --self-clearance-mm",
        ),
        SearchError::Postures { .. } => finding.key("--clearance-mm").hint(
            "lower --clearance-mm, --self-clearance-mm or --poses, or choose a start posture with more free \
             space",
        ),
        SearchError::Sweep { .. } => finding
            .key("--clearance-mm")
            .hint("lower --clearance-mm or --self-clearance-mm"),
    }
}

/// The section with what was found, in hundredths of a degree.
fn section_of(wanted: &ExcitationSection, found: &FoundRun) -> ExcitationSection {
    ExcitationSection {
        postures_deg: found.protocol.postures.iter().map(degrees).collect(),
        sweeps: found
            .protocol
            .sweeps
            .iter()
            .map(|sweep| SweepSection {
                joint: JOINT_LABELS[sweep.joint].to_owned(),
                posture: sweep.posture,
                by_deg: sweep.by_rad.to_degrees().round(),
            })
            .collect(),
        ..wanted.clone()
    }
}

fn degrees(q: &Joints) -> [f64; 6] {
    q.map(|rad| (rad.to_degrees() * 100.0).round() / 100.0)
        .into()
}

fn head(report: &PlanReport) -> String {
    let millimetres = |value: Option<f64>| {
        value.map_or("nothing nearby".to_owned(), |metres| {
            format!("{:.1} mm", metres * 1e3)
        })
    };
    let [others, itself] = proven_m(&report.planned).map(millimetres);
    let mut text = format!(
        "An excitation run for a {}, by needlebench plan-excitation with seed {}.\n\
         Certified clearance of arm, tool and payload: {others} from everything else, {itself} from itself.\n",
        report.arm, report.seed
    );
    for (class, found) in &report.planned.classes {
        if *class != "needle_corridor" {
            let proven = millimetres(found.certified_lower_bound_m);
            // Writing to a String cannot fail.
            let _ = writeln!(text, "  {class}: {proven} ({})", pair_in_words(&found.pair));
        }
    }
    text.push_str("Beside each posture: certified clearances of the motion to it, from everything else / itself, mm.\n\n");
    text
}

/// The certified clearances of the motion to each posture.
fn remarks(report: &PlanReport, plan: &ExcitationPlan) -> Vec<String> {
    let ways = plan.motions.iter().zip(&report.motions);
    ways.filter(|(motion, _)| matches!(motion.aim, Aim::Posture(_)))
        .map(|(_, motion)| {
            let [others, itself] = proven_m(&motion.clearance)
                .map(|value| value.map_or("-".to_owned(), |metres| format!("{:.1}", metres * 1e3)));
            format!("{others} / {itself}")
        })
        .collect()
}

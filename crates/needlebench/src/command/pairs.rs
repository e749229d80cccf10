//! `needlebench pairs`.

mod srdf;

use crate::arguments::RobotArguments;
use clap::Args;
use std::fmt::Write as _;
use std::path::Path;
use std::path::PathBuf;

use anyhow::{Context, Result};
use needlebench_cell::{Cell, ClearanceClass};
use needlebench_clearance::{
    PairConcern, PairExamination, PairSettings, PairState, RangeBound, examine_pairs,
};
use needlebench_input::Finding;
use needlebench_robot::Srdf;
use needlebench_scenario::{ResolvedScenario, load_scenario};
use serde::Serialize;

use super::{overrides, print_json, print_text};
use srdf::{SrdfAnswer, SrdfVerdict, check_srdf};

use crate::exit::ExitStatus;
use crate::failure::Failure;
use needlebench_report::write_atomically;
use needlebench_show::plain_table;
use quick_xml::escape::escape;

#[derive(Debug, Args)]
pub(crate) struct PairsArguments {
    /// Scenario with the cell to examine.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// SRDF whose disabled pairs are checked against the model; needlebench itself measures every pair that can move.
    #[arg(long, value_name = "FILE")]
    pub srdf: Option<PathBuf>,
    /// Write the arm's pairs that cannot collide to an SRDF.
    #[arg(long, value_name = "FILE")]
    pub write_srdf: Option<PathBuf>,
    /// Number of random postures for the collision rates.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    pub samples: u32,
    /// Limit of joint-position boxes for the proof that a pair never collides.
    #[arg(long, value_name = "N", default_value_t = 100_000, value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    pub proof_boxes: u32,
    /// Random seed of the postures.
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub seed: u64,
    /// Print one JSON document.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub robot: RobotArguments,
}

#[derive(Serialize)]
struct PairsAnswer {
    schema_version: u32,
    samples: usize,
    seed: u64,
    pairs: Vec<PairAnswer>,
    #[serde(skip_serializing_if = "Option::is_none")]
    srdf: Option<SrdfReport>,
}

#[derive(Serialize)]
struct PairAnswer {
    pair: [String; 2],
    class: Option<&'static str>,
    state: PairState,
    measured: bool,
    joints_between: usize,
    least_m: f64,
    least_joints_rad: [f64; 6],
    collision_rate: f64,
    nearest_m: Option<BoundAnswer>,
    farthest_m: Option<BoundAnswer>,
    concern: Option<PairConcern>,
}

#[derive(Serialize)]
struct BoundAnswer {
    lower: f64,
    upper: f64,
    boxes: usize,
}

#[derive(Serialize)]
struct SrdfReport {
    file: String,
    robot: String,
    disabled: Vec<SrdfPairAnswer>,
}

#[derive(Serialize)]
struct SrdfPairAnswer {
    links: [String; 2],
    reason: String,
    verdict: SrdfVerdict,
    state: Option<PairState>,
    collision_rate: Option<f64>,
    least_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    finding: Option<Finding>,
}

/// Prints every pair of bodies with its state and the reason, and checks an SRDF.
pub(crate) fn pairs(arguments: &PairsArguments) -> Result<ExitStatus, Failure> {
    let overrides = overrides(&arguments.robot)?;
    // Unlike for a run, the start posture may collide: the command looks for errors of the model.
    let resolved = load_scenario(&arguments.scenario, &overrides)?;
    let srdf = arguments.srdf.as_deref().map(Srdf::load).transpose()?;
    let cell = &resolved.cell;
    let settings = PairSettings {
        samples: arguments.samples as usize,
        seed: arguments.seed,
        boxes: arguments.proof_boxes as usize,
        ..PairSettings::default()
    };
    let examined = examine_pairs(cell, &settings);
    let answers = srdf
        .as_ref()
        .map(|srdf| check_srdf(srdf, cell, &resolved.robot_description.members, &examined))
        .unwrap_or_default();
    if let Some(path) = &arguments.write_srdf {
        write_srdf(path, &resolved, &examined, &settings)?;
    }
    if arguments.json {
        print_json(&PairsAnswer {
            schema_version: 1,
            samples: settings.samples,
            seed: settings.seed,
            pairs: examined.iter().map(|each| answer(cell, each)).collect(),
            srdf: srdf
                .as_ref()
                .map(|srdf| srdf_report(srdf, &answers, &examined)),
        })?;
    } else {
        print_text(&table(cell, &examined, &settings))?;
        if let Some(srdf) = &srdf {
            print_text(&srdf_text(srdf, cell, &answers))?;
        }
    }
    let findings: Vec<Finding> = answers
        .iter()
        .filter_map(|answer| answer.finding.clone())
        .collect();
    if findings.is_empty() {
        Ok(ExitStatus::Success)
    } else {
        Err(findings.into())
    }
}

fn names(cell: &Cell, pair: &PairExamination) -> [String; 2] {
    [pair.a, pair.b].map(|body| cell.bodies[body].name.clone())
}

fn answer(cell: &Cell, pair: &PairExamination) -> PairAnswer {
    let bound = |bound: RangeBound| BoundAnswer {
        lower: bound.lower_m,
        upper: bound.upper_m,
        boxes: bound.boxes,
    };
    PairAnswer {
        pair: names(cell, pair),
        class: pair.class.map(ClearanceClass::name),
        state: pair.state,
        measured: pair.state.is_measured(),
        joints_between: pair.joints.len(),
        least_m: pair.least_m,
        least_joints_rad: pair.least_at.into(),
        collision_rate: pair.collision_rate,
        nearest_m: pair.nearest.map(bound),
        farthest_m: pair.farthest.map(bound),
        concern: pair.concern(),
    }
}

fn table(cell: &Cell, examined: &[PairExamination], settings: &PairSettings) -> String {
    let mut table = plain_table(&[
        "bodies",
        "class",
        "state",
        "joints",
        "in\ncollision",
        "sampled min.\n(mm)",
        "proven min.\n(mm)",
    ]);
    for pair in examined {
        // Pairs fixed in the world say nothing about the arm.
        if pair.state == PairState::Fixed {
            continue;
        }
        let [a, b] = names(cell, pair);
        table.add_row([
            format!("{a}, {b}"),
            pair.class.map_or("-", ClearanceClass::name).to_owned(),
            pair.state.name().to_owned(),
            pair.joints.len().to_string(),
            format!("{:.2} %", pair.collision_rate * 100.0),
            format!("{:.1}", pair.least_m * 1e3),
            pair.nearest.map_or_else(String::new, |bound| {
                format!("{:.1} to {:.1}", bound.lower_m * 1e3, bound.upper_m * 1e3)
            }),
        ]);
    }
    let count = |state| examined.iter().filter(|pair| pair.state == state).count();
    let mut text = String::new();
    let _ = write!(
        text,
        "{} pairs measured ({} proven never to collide, {} always in collision); {} excluded as adjacent, {} as \
         fixed to each other ({} random postures, seed {})",
        examined
            .iter()
            .filter(|pair| pair.state.is_measured())
            .count(),
        count(PairState::Never),
        count(PairState::Always),
        count(PairState::Adjacent),
        count(PairState::Fixed),
        settings.samples,
        settings.seed,
    );
    for pair in examined {
        let Some(concern) = pair.concern() else {
            continue;
        };
        let [a, b] = names(cell, pair);
        let _ = match concern {
            PairConcern::AlwaysInCollision => write!(
                text,
                "\nwarning: {a} and {b} collide in every posture: no posture of this model is collision-free"
            ),
            PairConcern::LeftOutButDependsOnPosture => write!(
                text,
                "\nwarning: {a} and {b} share a joint and are excluded, but collide at only {:.1} % of its angles: \
                 these collisions are not detected",
                pair.collision_rate * 100.0
            ),
        };
    }
    let _ = write!(text, "\n\n{table}");
    text
}

fn srdf_report(srdf: &Srdf, answers: &[SrdfAnswer], examined: &[PairExamination]) -> SrdfReport {
    SrdfReport {
        file: srdf.file.clone(),
        robot: srdf.robot.clone(),
        disabled: answers
            .iter()
            .map(|answer| {
                let pair = &srdf.disabled[answer.pair];
                let found = answer.examination.map(|index| &examined[index]);
                SrdfPairAnswer {
                    links: pair.links.clone(),
                    reason: pair.reason.clone(),
                    verdict: answer.verdict,
                    state: found.map(|found| found.state),
                    collision_rate: found.map(|found| found.collision_rate),
                    least_m: found.map(|found| found.least_m),
                    finding: answer.finding.clone(),
                }
            })
            .collect(),
    }
}

fn srdf_text(srdf: &Srdf, cell: &Cell, answers: &[SrdfAnswer]) -> String {
    let count = |verdict| {
        answers
            .iter()
            .filter(|answer| answer.verdict == verdict)
            .count()
    };
    let mut text = format!(
        "{} ('{}') disables {} pairs: {} justified, {} unproven, {} refuted, {} with unknown links",
        srdf.file,
        srdf.robot,
        answers.len(),
        count(SrdfVerdict::Justified),
        count(SrdfVerdict::Unproven),
        count(SrdfVerdict::Refuted),
        count(SrdfVerdict::UnknownLink),
    );
    if srdf.robot != cell.robot.name {
        let _ = write!(
            text,
            "\nwarning: the SRDF is for '{}', the robot is '{}'",
            srdf.robot, cell.robot.name
        );
    }
    for answer in answers {
        if answer.verdict == SrdfVerdict::Unproven {
            let [a, b] = &srdf.disabled[answer.pair].links;
            let _ = write!(
                text,
                "\nunproven: {a} and {b} collide in no sampled posture, which is no proof"
            );
        }
    }
    text
}

/// Writes the arm's pairs that need no check: those that share a joint and those that are proven never to collide.
/// Pairs that always collide stay enabled, because disabling them hides an error of the model.
fn write_srdf(
    path: &Path,
    resolved: &ResolvedScenario,
    examined: &[PairExamination],
    settings: &PairSettings,
) -> Result<()> {
    let (cell, description) = (&resolved.cell, &resolved.robot_description);
    let robot = &cell.robot;
    let links_of = |body: usize| -> Vec<&str> {
        let name = &cell.bodies[body].name;
        let labels = std::iter::once(&robot.base).chain(&robot.links);
        let owner = labels.map(|link| &link.name).position(|each| each == name);
        description
            .members
            .iter()
            .filter(|member| Some(member.owner) == owner && member.has_geometry)
            .map(|member| member.name.as_str())
            .collect()
    };
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<!-- Pairs that cannot collide, derived by needlebench from {}.\n     \
         Adjacent: they share a joint. Never: proven over the whole joint ranges, to {} mm. -->\n\
         <robot name=\"{}\">\n",
        escape(description.source.file.replace("--", "-")),
        settings.tolerance_m * 1e3,
        escape(&*robot.name),
    );
    for pair in examined {
        let reason = match pair.state {
            PairState::Adjacent => "Adjacent",
            PairState::Never => "Never",
            _ => continue,
        };
        for first in links_of(pair.b) {
            for second in links_of(pair.a) {
                let _ = writeln!(
                    text,
                    "  <disable_collisions link1=\"{}\" link2=\"{}\" reason=\"{reason}\"/>",
                    escape(first),
                    escape(second),
                );
            }
        }
    }
    text.push_str("</robot>\n");
    write_atomically(path, text.as_bytes())
        .with_context(|| format!("cannot write {}", path.display()))
}

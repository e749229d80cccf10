//! `needlebench servo`.

use crate::arguments::{EngineArgument, EngineParser, PicturesArguments, RobotArguments};
use crate::output::{complain, shown};
use anyhow::{Context, Result};
use clap::Args;
use needlebench_clearance::ClearanceModel;
use needlebench_engine::{ArmSpec, Engine, EngineError, EnginePool, Servo};
use needlebench_input::{Finding, nearest_name};
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, Joints};
use needlebench_planning::Planner;
use needlebench_scenario::ResolvedScenario;
use std::path::PathBuf;

use super::results_folder::ResultsFolder;
use super::{load, overrides, print_json, print_text};

use crate::exit::ExitStatus;
use crate::failure::Failure;
use needlebench_bench::RunOptions;
use needlebench_bench::servo::linear::{Linear, Margins};
use needlebench_bench::servo::settings::settings;
use needlebench_bench::servo::{ServoReport, joints, measure};
use needlebench_report::files::{Folder, write_servo};
use needlebench_report::table::servo::text;

#[derive(Debug, Args)]
pub(crate) struct ServoArguments {
    /// Scenario with robot and servo; measured at the first goal reached.
    #[arg(value_name = "SCENARIO")]
    pub scenario: PathBuf,
    /// Joint, e.g. `wrist_1` [default: all joints].
    #[arg(long, value_name = "JOINT")]
    pub joint: Option<String>,
    /// Physics engines [default: those of the scenario].
    #[arg(long, value_name = "ENGINE[,ENGINE]", value_parser = EngineParser)]
    pub engine: Option<EngineArgument>,
    /// Folder for results; the scenario has a subfolder of its name.
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print one JSON document instead of the tables.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub pictures: PicturesArguments,
    #[command(flatten)]
    pub robot: RobotArguments,
}

/// Measures the servo and writes its data sheet.
pub(crate) fn servo(arguments: &ServoArguments) -> Result<ExitStatus, Failure> {
    let overrides = overrides(&arguments.robot)?;
    let wanted = wanted_joints(arguments.joint.as_deref())?;
    let resolved = load(&arguments.scenario, &overrides)?;
    let folder = arguments.out.join(&resolved.scenario.name).join("servo");
    let _taken = ResultsFolder::take(&folder)?;
    let (described, posture) = posture(&resolved)?;
    let servo = needlebench_uncertainty::servo_of(&resolved);
    let timestep_s = resolved.scenario.engines.timestep_ms * 1e-3;
    let linear = Linear::new(&servo, &posture, timestep_s);
    let margins = Margins::new(&servo, &posture, timestep_s);
    let mut report = ServoReport {
        schema_version: 1,
        scenario: resolved.scenario.name.clone(),
        posture: described,
        posture_rad: posture.into(),
        timestep_s,
        settings: settings(&resolved, &servo),
        margins,
        joints: joints(&linear, &servo, &wanted, timestep_s),
    };
    // An unstable loop has no response; its data sheet has the stability margins.
    let mut status = ExitStatus::Success;
    if margins.spectral_radius < 1.0 {
        let options = RunOptions {
            engines: arguments.engine.as_ref().map(EngineArgument::names),
            ..RunOptions::default()
        };
        let engines = options.chosen_engines(&resolved);
        for engine in engines.map_err(anyhow::Error::from)? {
            if let Err(error) =
                measure_in(&resolved, engine, &mut report, &servo, &linear, &posture)
            {
                complain(&format!("error: {}: {error}", engine.name()));
                status = ExitStatus::EnvironmentFailed;
            }
        }
    } else {
        complain(
            "warning: the servo is unstable with these kp, kd, rotor inertia and step: no responses",
        );
        status = ExitStatus::CriterionFailed;
    }
    write_servo(
        &report,
        Folder(&folder),
        arguments.pictures.are_wanted(false),
    )
    .with_context(|| format!("cannot write the results to {}", shown(&folder)))?;
    if arguments.json {
        print_json(&report)?;
    } else {
        print_text(&format!("{}\nresults: {}", text(&report), shown(&folder)))?;
    }
    Ok(status)
}

fn wanted_joints(name: Option<&str>) -> Result<Vec<usize>, Finding> {
    let Some(name) = name else {
        return Ok((0..JOINT_COUNT).collect());
    };
    if let Some(joint) = JOINT_LABELS.iter().position(|label| *label == name) {
        return Ok(vec![joint]);
    }
    let hint = nearest_name(name, JOINT_LABELS).map_or_else(
        || format!("the joints are {}", JOINT_LABELS.join(", ")),
        |near| format!("did you mean `{near}`?"),
    );
    Err(
        Finding::new("the command line", format!("there is no joint `{name}`"))
            .key("--joint")
            .hint(hint),
    )
}

/// The posture at the first goal that a configuration reaches; the start posture if none does.
fn posture(resolved: &ResolvedScenario) -> Result<(String, Joints), Finding> {
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(resolved, &model).map_err(|error| {
        Finding::new(&resolved.robot_description.source.file, error.to_string())
    })?;
    for goal in &resolved.goals {
        let plan = planner.plan(goal);
        let works = plan
            .configurations
            .iter()
            .find(|each| each.rejections.is_empty());
        if let Some((each, trajectory)) =
            works.and_then(|each| Some((each, each.trajectory.as_ref()?)))
        {
            let described = format!("{} {}", goal.name, each.configuration);
            return Ok((described, trajectory.end()));
        }
    }
    Ok(("the start posture".to_owned(), resolved.start))
}

fn measure_in(
    resolved: &ResolvedScenario,
    engine: &'static dyn Engine,
    report: &mut ServoReport,
    servo: &Servo,
    linear: &Linear,
    posture: &Joints,
) -> Result<(), EngineError> {
    let settings = &resolved.scenario.engines.settings();
    EnginePool::new(&[engine]).lend(engine, settings, |session| {
        let mut plant = session.make_plant(&ArmSpec::new(&resolved.cell, settings))?;
        measure(report, plant.as_mut(), servo, linear, posture)
    })
}

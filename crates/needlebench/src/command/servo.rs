//! `needlebench servo`.

use anyhow::{Context, Result};
use needlebench_cell::scenario::EngineName;
use needlebench_cell::{Finding, ResolvedScenario, nearest_name};
use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::{JOINT_COUNT, JOINT_LABELS, Joints};
use needlebench_planning::Planner;

use super::{load, overrides, print_json, print_text};
use crate::atomic::write_atomically;
use crate::cli::ServoArguments;
use crate::exit::ExitStatus;
use crate::output::findings::print_findings;
use crate::pipeline::EngineChoice;
use crate::plants::{plant, start_harness};
use crate::progress::Progress;
use crate::reality;
use crate::servo::linear::{Linear, Margins};
use crate::servo::settings::settings;
use crate::servo::text::{course_csv, frequency_csv, text};
use crate::servo::{ServoReport, joints, measure, picture};

/// Measures the servo and writes its data sheet.
pub(crate) fn servo(arguments: &ServoArguments) -> Result<ExitStatus> {
    let refuse = |finding: Finding| {
        print_findings(&[finding]);
        Ok(ExitStatus::BadInput)
    };
    let overrides = match overrides(&arguments.robot) {
        Ok(overrides) => overrides,
        Err(finding) => return refuse(finding),
    };
    let wanted = match wanted_joints(arguments.joint.as_deref()) {
        Ok(wanted) => wanted,
        Err(finding) => return refuse(finding),
    };
    let Some(resolved) = load(&arguments.scenario, &overrides) else {
        return Ok(ExitStatus::BadInput);
    };
    let folder = arguments.out.join(&resolved.scenario.name).join("servo");
    if let Err(error) = std::fs::create_dir_all(&folder) {
        return refuse(
            Finding::new(
                folder.display().to_string(),
                format!("the results folder cannot be written: {error}"),
            )
            .key("--out")
            .hint("choose another folder with --out DIR"),
        );
    }
    let (described, posture) = match posture(&resolved) {
        Ok(found) => found,
        Err(finding) => return refuse(finding),
    };
    let servo = reality::servo(&resolved);
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
    // An unstable loop has no response; its data sheet says how far it is from stability.
    let mut status = ExitStatus::Success;
    if margins.spectral_radius < 1.0 {
        for engine in EngineChoice::engines(arguments.engine, &resolved) {
            if let Err(error) =
                measure_in(&resolved, engine, &mut report, &servo, &linear, &posture)
            {
                anstream::eprintln!("error: {}: {error:#}", engine.name());
                status = ExitStatus::EnvironmentFailed;
            }
        }
    } else {
        anstream::eprintln!(
            "warning: the servo is unstable with kp, kd, rotor inertia and step as they are: no responses"
        );
        status = ExitStatus::CriterionFailed;
    }
    write(&report, &folder, !arguments.no_pictures)
        .with_context(|| format!("cannot write the results to {}", folder.display()))?;
    if arguments.json {
        print_json(&report)?;
    } else {
        print_text(&format!("{}\nresults: {}", text(&report), folder.display()))?;
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
    let planner = Planner::new(resolved, &model)
        .map_err(|error| Finding::new(&resolved.cell.robot.source.file, error.to_string()))?;
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
    engine: EngineName,
    report: &mut ServoReport,
    servo: &needlebench_engine::Servo,
    linear: &Linear,
    posture: &Joints,
) -> Result<()> {
    let harness = (engine == EngineName::Mujoco)
        .then(|| start_harness(resolved, &Progress::new(true)).map_err(anyhow::Error::msg))
        .transpose()?;
    let mut process = harness
        .as_ref()
        .map(|harness| harness.lock().expect("nobody else uses it"));
    let (cell, engines) = (&resolved.cell, &resolved.scenario.engines);
    let mut plant = plant(
        engine,
        cell,
        engines,
        report.timestep_s,
        process.as_deref_mut(),
    )?;
    measure(report, plant.as_mut(), servo, linear, posture)?;
    Ok(())
}

fn write(report: &ServoReport, folder: &std::path::Path, pictures: bool) -> Result<()> {
    let mut json = serde_json::to_vec_pretty(report)?;
    json.push(b'\n');
    write_atomically(&folder.join("servo.json"), &json)?;
    write_atomically(
        &folder.join("frequency.csv"),
        frequency_csv(report).as_bytes(),
    )?;
    for joint in &report.joints {
        if joint.responses.is_empty() {
            continue;
        }
        let csv = |name: &str, text: String| {
            let path = folder.join(format!("{}.{name}.csv", joint.joint));
            write_atomically(&path, text.as_bytes())
        };
        let timestep_s = report.timestep_s;
        csv(
            "small_step",
            course_csv(joint, timestep_s, |each| &each.small),
        )?;
        csv(
            "large_step",
            course_csv(joint, timestep_s, |each| &each.large),
        )?;
        csv("sine", course_csv(joint, timestep_s, |each| &each.sine))?;
        csv(
            "tracked_sine",
            course_csv(joint, timestep_s, |each| &each.tracked),
        )?;
        if pictures {
            let path = folder.join(format!("{}.png", joint.joint));
            picture::page(report, joint).write_png(&path)?;
        }
    }
    Ok(())
}

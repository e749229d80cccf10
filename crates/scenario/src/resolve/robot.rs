//! The robot of a scenario, or of the command line alone.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use needlebench_input::{Finding, Location, TomlText};
use needlebench_kinematics::Pose;
use needlebench_robot::arm::{Arm, DEFAULT_ARM, robot_location};
use needlebench_robot::{Calibration, LoadedRobot, read_robot};

use super::names::with_model_names;
use super::overrides::Overrides;
use crate::scenario::RobotSection;

/// Reads a robot without a scenario: the one of the overrides, or the shipped default, with its
/// `base_link` at the world's origin.
///
/// # Errors
/// What is wrong with the URDF or the calibration.
pub fn load_robot(overrides: &Overrides) -> Result<LoadedRobot, Finding> {
    let (arm, location) = overrides.arm_and_urdf()?;
    let policy = overrides.missing_inertia.clone().unwrap_or_default();
    let mut robot = read_robot(
        &location,
        &overrides.packages,
        &policy,
        Pose::identity(),
        arm.as_ref(),
        overrides.prefix.as_deref(),
    )?;
    robot.complete_shapes(&BTreeMap::new())?;
    calibrate(&mut robot, overrides)?;
    calibrate_by_data(&mut robot)?;
    Ok(robot)
}

/// Gives a robot its true joint origins, if the command line names a calibration.
fn calibrate(robot: &mut LoadedRobot, overrides: &Overrides) -> Result<(), Finding> {
    match &overrides.calibration {
        Some(path) => Calibration::load(path)?.apply_to(robot),
        None => Ok(()),
    }
}

/// The same by the arm's own data, if they are of one arm and nobody gave it another calibration.
fn calibrate_by_data(robot: &mut LoadedRobot) -> Result<(), Finding> {
    let Some(used) = robot
        .description
        .arm
        .as_ref()
        .filter(|_| robot.description.calibration.is_none())
    else {
        return Ok(());
    };
    let Some(own) = &used.arm.data.calibration else {
        return Ok(());
    };
    let location = used.arm.file(&own.file);
    let file = location.display();
    let text = location.read().map_err(|error| {
        Finding::new(
            &used.arm.source.file,
            format!("cannot read the calibration {file}: {error}"),
        )
        .key("calibration.file")
        .hint("the path is relative to the arm's data")
    })?;
    let text = String::from_utf8_lossy(&text);
    Calibration::parse(&file, &text)?.apply_to(robot)
}

/// The scenario's robot, with its `base_link` at the world's origin.
pub(super) fn scenario_robot(
    toml: &TomlText<'_>,
    section: &RobotSection,
    base: &Path,
    overrides: &Overrides,
) -> Result<LoadedRobot, Finding> {
    let (arm, location) = arm_and_urdf(toml, section, base, overrides)?;
    let policy = overrides.missing_inertia.as_ref();
    // The scenario's prefix is that of the scenario's robot.
    let own = section
        .prefix
        .as_deref()
        .filter(|_| !overrides.replace_robot());
    let prefix = overrides.prefix.as_deref().or(own);
    let mut robot = read_robot(
        &location,
        &overrides.packages,
        policy.unwrap_or(&section.missing_inertia),
        Pose::identity(),
        arm.as_ref(),
        prefix,
    )
    .map_err(|finding| {
        // The command line's robot is not the one that the scenario names.
        if overrides.replace_robot() {
            finding
        } else {
            let names: Vec<String> = Arm::shipped_names().map(str::to_owned).collect();
            with_model_names(toml, finding, &location, "robot.urdf", &names)
        }
    })?;
    // What the scenario says of links is of its own robot.
    if overrides.replace_robot() {
        robot.complete_shapes(&BTreeMap::new())?;
    } else {
        robot
            .complete_shapes(&section.shape)
            .map_err(|finding| Finding {
                hint: finding.hint,
                ..toml.finding("robot.shape", finding.message)
            })?;
    }
    calibrate(&mut robot, overrides)?;
    // The scenario's calibration is that of the scenario's robot.
    if let Some(reference) = &section.calibration
        && overrides.calibration.is_none()
        && !overrides.replace_robot()
    {
        let path = base.join(reference);
        if !path.is_file() {
            return Err(toml
                .finding(
                    "robot.calibration",
                    format!("there is no file {}", path.display()),
                )
                .hint("the path is relative to the scenario's folder"));
        }
        Calibration::load(&path).and_then(|calibration| calibration.apply_to(&mut robot))?;
    }
    calibrate_by_data(&mut robot)?;
    Ok(robot)
}

/// The named arm, and where the robot's URDF is.
fn arm_and_urdf(
    toml: &TomlText<'_>,
    section: &RobotSection,
    base: &Path,
    overrides: &Overrides,
) -> Result<(Option<Arc<Arm>>, Location), Finding> {
    if overrides.replace_robot() {
        return overrides.arm_and_urdf();
    }
    let arm = section
        .arm
        .as_ref()
        .map(|name| Arm::of_reference(name, base))
        .transpose()
        .map_err(|finding| {
            // What is wrong inside the file is said of the file.
            if finding.line.is_some() {
                return finding;
            }
            Finding {
                hint: finding.hint,
                ..toml.finding("robot.arm", finding.message)
            }
        })?;
    let location = match (&section.urdf, &arm) {
        (Some(urdf), _) => robot_location(urdf, base),
        (None, Some(arm)) => arm.urdf(),
        (None, None) => robot_location(DEFAULT_ARM, base),
    };
    Ok((arm, location))
}

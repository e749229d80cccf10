//! Ranges of a scenario's numbers, and its names.

use needlebench_kinematics::JOINT_COUNT;

use crate::Finding;
use crate::envelope::check_envelope;
use crate::events::check_events;
use crate::imperfections::check_imperfections;
use crate::iso9283::check_iso9283;
use crate::people::check_people;
use crate::ranking::check_ranking;
use crate::scenario::Scenario;
use crate::toml_text::TomlText;

/// Values outside their sensible ranges: a factor of a thousand is mostly a wrong unit.
pub(crate) fn check_values(toml: &TomlText<'_>, scenario: &Scenario) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut range = |key: &str, value: f64, least: f64, most: f64, unit: &str| {
        if !(least..=most).contains(&value) {
            findings.push(if unit.is_empty() {
                toml.finding(
                    key,
                    format!("`{key}` is {value}, outside {least} to {most}"),
                )
                .hint("it is a plain number, without a unit")
            } else {
                toml.finding(
                    key,
                    format!("`{key}` is {value} {unit}, outside {least} to {most}"),
                )
                .hint(format!("the value is in {unit}"))
            });
        }
    };
    for (i, value) in scenario.robot.base_position_mm.iter().enumerate() {
        range(
            &format!("robot.base_position_mm[{i}]"),
            *value,
            -5000.0,
            5000.0,
            "mm",
        );
    }
    if let Some(phantom) = &scenario.phantom {
        for (i, value) in phantom.position_mm.iter().enumerate() {
            range(
                &format!("phantom.position_mm[{i}]"),
                *value,
                -5000.0,
                5000.0,
                "mm",
            );
        }
    }
    if let Some(table) = &scenario.table {
        range(
            "table.top_height_mm",
            table.top_height_mm,
            100.0,
            2000.0,
            "mm",
        );
    }
    let tool = &scenario.tool;
    range(
        "tool.mount_rotation_deg",
        tool.mount_rotation_deg,
        -360.0,
        360.0,
        "deg",
    );
    range(
        "tool.corridor_radius_mm",
        tool.corridor_radius_mm,
        0.5,
        200.0,
        "mm",
    );
    range(
        "tool.hand_cone_half_angle_deg",
        tool.hand_cone_half_angle_deg,
        0.0,
        80.0,
        "deg",
    );
    for (key, value, least, most) in [
        (
            "tool.corridor_length_mm",
            tool.corridor_length_mm,
            1.0,
            1000.0,
        ),
        ("tool.needle_length_mm", tool.needle_length_mm, 20.0, 500.0),
        ("tool.bore_mm", tool.bore_mm, 0.2, 10.0),
    ] {
        if let Some(value) = value {
            range(key, value, least, most, "mm");
        }
    }
    let motion = &scenario.motion;
    range(
        "motion.joint_velocity_deg_s",
        motion.joint_velocity_deg_s,
        0.1,
        360.0,
        "deg/s",
    );
    range(
        "motion.joint_acceleration_deg_s2",
        motion.joint_acceleration_deg_s2,
        1.0,
        3000.0,
        "deg/s^2",
    );
    range(
        "motion.joint_jerk_deg_s3",
        motion.joint_jerk_deg_s3,
        10.0,
        1e6,
        "deg/s^3",
    );
    range(
        "motion.line_velocity_mm_s",
        motion.line_velocity_mm_s,
        0.1,
        1000.0,
        "mm/s",
    );
    range(
        "motion.line_acceleration_mm_s2",
        motion.line_acceleration_mm_s2,
        1.0,
        1e4,
        "mm/s^2",
    );
    range(
        "motion.line_jerk_mm_s3",
        motion.line_jerk_mm_s3,
        10.0,
        1e6,
        "mm/s^3",
    );
    range("motion.hold_s", motion.hold_s, 0.1, 60.0, "s");
    let planning = &scenario.planning;
    range(
        "planning.min_clearance_mm",
        planning.min_clearance_mm,
        -10.0,
        500.0,
        "mm",
    );
    range(
        "planning.min_self_clearance_mm",
        planning.min_self_clearance_mm,
        -10.0,
        500.0,
        "mm",
    );
    range(
        "planning.min_singularity_sine",
        planning.min_singularity_sine,
        0.0,
        0.9,
        "",
    );
    range(
        "planning.min_shoulder_distance_mm",
        planning.min_shoulder_distance_mm,
        0.0,
        300.0,
        "mm",
    );
    range(
        "planning.sample_spacing_mm",
        planning.sample_spacing_mm,
        0.1,
        100.0,
        "mm",
    );
    range(
        "planning.certificate_tolerance_mm",
        planning.certificate_tolerance_mm,
        0.001,
        100.0,
        "mm",
    );
    range(
        "planning.roll_samples",
        f64::from(planning.roll_samples),
        1.0,
        3600.0,
        "directions",
    );
    let controller = &scenario.controller;
    for i in 0..JOINT_COUNT {
        range(
            &format!("controller.stiffness_nm_rad[{i}]"),
            controller.stiffness_nm_rad[i],
            0.0,
            1e6,
            "N m/rad",
        );
        range(
            &format!("controller.damping_nms_rad[{i}]"),
            controller.damping_nms_rad[i],
            0.0,
            1e5,
            "N m s/rad",
        );
        range(
            &format!("controller.armature_kgm2[{i}]"),
            controller.armature_kgm2[i],
            0.0,
            10.0,
            "kg m^2",
        );
    }
    let engines = &scenario.engines;
    range("engines.timestep_ms", engines.timestep_ms, 0.01, 5.0, "ms");
    range("engines.friction", engines.friction, 0.0, 10.0, "");
    let rapier = &engines.rapier;
    range(
        "engines.rapier.contact_natural_frequency_hz",
        rapier.contact_natural_frequency_hz,
        1.0,
        1e6,
        "Hz",
    );
    range(
        "engines.rapier.contact_damping_ratio",
        rapier.contact_damping_ratio,
        1e-3,
        1e3,
        "",
    );
    range(
        "engines.rapier.contact_sweeps",
        f64::from(rapier.contact_sweeps),
        1.0,
        1000.0,
        "sweeps",
    );
    let mujoco = &engines.mujoco;
    range(
        "engines.mujoco.contact_stiffness_per_s2",
        mujoco.contact_stiffness_per_s2,
        1.0,
        1e9,
        "1/s^2",
    );
    range(
        "engines.mujoco.contact_damping_per_s",
        mujoco.contact_damping_per_s,
        0.1,
        1e6,
        "1/s",
    );
    range(
        "engines.mujoco.contact_impedance",
        mujoco.contact_impedance,
        0.01,
        0.9999,
        "",
    );
    range(
        "engines.harness_timeout_s",
        engines.harness_timeout_s,
        0.1,
        3600.0,
        "s",
    );
    let recording = &scenario.recording;
    range(
        "recording.period_ms",
        recording.period_ms,
        engines.timestep_ms,
        1000.0,
        "ms",
    );
    range(
        "criteria.settling_band_mm",
        scenario.criteria.settling_band_mm,
        1e-6,
        100.0,
        "mm",
    );
    let criteria = &scenario.criteria;
    for (key, value, most, unit) in [
        (
            "criteria.min_free_fraction",
            criteria.min_free_fraction,
            1.0,
            "",
        ),
        (
            "criteria.min_sight_fraction",
            criteria.min_sight_fraction,
            1.0,
            "",
        ),
        (
            "criteria.min_hand_cone_deg",
            criteria.min_hand_cone_deg,
            90.0,
            "deg",
        ),
    ] {
        if let Some(value) = value {
            range(key, value, 0.0, most, unit);
        }
    }
    findings.extend(check_people(toml, scenario));
    findings.extend(check_envelope(toml, scenario));

    let is_name = |name: &str| {
        !name.is_empty()
            && name
                .chars()
                .all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_')
    };
    let mut name = |key: &str, value: &str| {
        if !is_name(value) {
            findings.push(
                toml.finding(key, format!("`{value}` is not a usable name"))
                    .hint("letters, digits, `-` and `_`: names become file names"),
            );
        }
    };
    name("name", &scenario.name);
    for (i, goal) in scenario.goals.iter().enumerate() {
        name(&format!("goals[{i}].name"), &goal.name);
    }
    for (i, goal) in scenario.goals.iter().enumerate() {
        if scenario.goals[..i]
            .iter()
            .any(|earlier| earlier.name == goal.name)
        {
            findings.push(
                toml.finding(
                    &format!("goals[{i}].name"),
                    format!("two goals are named `{}`", goal.name),
                )
                .hint("give each its own name: results go to a folder of that name"),
            );
        }
    }
    findings.extend(check_ranking(toml, &scenario.ranking));
    findings.extend(check_events(toml, scenario));
    if let Some(section) = &scenario.imperfections {
        let timestep_ms = scenario.engines.timestep_ms;
        findings.extend(check_imperfections(toml, section, timestep_ms));
        if scenario.events.is_some() {
            findings.push(
                toml.finding(
                    "events",
                    "`[events]` are staged and measured on the nominal robot",
                )
                .hint(
                    "leave out `[imperfections]`, or put the events into a scenario of their own",
                ),
            );
        }
    }
    findings.extend(check_iso9283(toml, scenario));
    if scenario.goals.is_empty() && scenario.iso9283.is_none() {
        findings.push(
            toml.finding(
                "goals",
                match toml.span_of("goals") {
                    Some(_) => "the scenario has no goal",
                    None => "the key `goals` is missing",
                },
            )
            .hint("add a [[goals]], or an [iso9283] for a test of the robot itself"),
        );
    }
    if scenario.engines.run.is_empty() {
        findings.push(
            toml.finding("engines.run", "no engine is named")
                .hint("[\"rapier\", \"mujoco\"]"),
        );
    }
    findings
}

//! Measurements against closed forms.

use std::path::Path;

use nalgebra::{Translation3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_engine::{Contact, Cost, EngineIdentity, PlantState, Recording, Saturation};
use needlebench_evaluation::{
    LEAST_SHADOW, engine_difference, measure_guide, measure_motion, measure_needle,
};
use needlebench_kinematics::trajectory::{
    JointState, JointTrajectory, MotionLimits, Phase, ProfileLimits,
};
use needlebench_kinematics::{Joints, Pose};
use needlebench_scenario::{Overrides, ResolvedScenario, load_scenario};

/// Rounding of lengths below 2 m through half a dozen transforms.
const ROUNDING: f64 = 1e-13;

fn table3() -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    load_scenario(&path, &Overrides::default()).expect("the shipped scenario is sound")
}

/// Flange pose that puts the guide's exit where the goal wants it, moved by `world_shift`.
fn flange(resolved: &ResolvedScenario, world_shift: &Pose) -> Pose {
    let planned = resolved.goals[0].world_from_guide_exit;
    let about_exit = planned * world_shift;
    about_exit * resolved.cell.tool.flange_from_guide_exit.inverse()
}

#[test]
fn the_planned_pose_has_no_error() {
    let resolved = table3();
    let found = measure_needle(
        &resolved.cell,
        resolved.phantom.as_ref(),
        &resolved.goals[0],
        &flange(&resolved, &Pose::identity()),
    );
    assert!(found.tip_position_error_m < ROUNDING);
    assert!(found.lateral_error_m < ROUNDING && found.depth_error_m.abs() < ROUNDING);
    assert!(found.needle_angle_error_rad < ROUNDING && found.guide_position_error_m < ROUNDING);
    assert!(found.entry_point_error_m.expect("there is a phantom") < ROUNDING);
    assert!(found.entry_lateral_error_m.expect("there is an entry") < ROUNDING);
    for angle in [found.axial_angle_error_rad, found.sagittal_angle_error_rad] {
        assert!(angle.is_none_or(|angle| angle < ROUNDING));
    }
}

#[test]
fn a_shift_along_the_needle_is_a_depth_error() {
    let resolved = table3();
    let found = measure_needle(
        &resolved.cell,
        resolved.phantom.as_ref(),
        &resolved.goals[0],
        &flange(&resolved, &Pose::translation(0.0, 0.0, 0.003)),
    );
    assert!((found.depth_error_m - 0.003).abs() < ROUNDING);
    assert!((found.tip_position_error_m - 0.003).abs() < ROUNDING);
    assert!(found.lateral_error_m < ROUNDING && found.needle_angle_error_rad < ROUNDING);
    assert!(
        found.entry_point_error_m.unwrap() < ROUNDING,
        "the axis is the same"
    );
}

#[test]
fn a_shift_across_the_needle_is_a_lateral_error() {
    let resolved = table3();
    let found = measure_needle(
        &resolved.cell,
        None,
        &resolved.goals[0],
        &flange(&resolved, &Pose::translation(0.002, 0.0, 0.0)),
    );
    assert!((found.lateral_error_m - 0.002).abs() < ROUNDING);
    assert!((found.tip_position_error_m - 0.002).abs() < ROUNDING);
    assert!(found.depth_error_m.abs() < ROUNDING);
    assert!((found.entry_lateral_error_m.unwrap() - 0.002).abs() < ROUNDING);
    assert_eq!(found.entry_point_error_m, None);
    assert_eq!(found.axial_angle_error_rad, None);
}

#[test]
fn a_tilt_about_the_exit_grows_with_the_insertion() {
    let resolved = table3();
    let tilt_rad: f64 = 0.02;
    let tilt = Pose::from_parts(
        Translation3::identity(),
        UnitQuaternion::from_axis_angle(&UnitVector3::new_normalize(Vector3::y()), tilt_rad),
    );
    let goal = &resolved.goals[0];
    let found = measure_needle(&resolved.cell, None, goal, &flange(&resolved, &tilt));
    let length_m = goal.insertion_length_m;
    // A chord of the circle that the tip runs on; `e_t = e_s + L (v - u)` with `e_s = 0`.
    assert!(
        (found.tip_position_error_m - 2.0 * length_m * libm::sin(0.5 * tilt_rad)).abs() < ROUNDING
    );
    assert!((found.depth_error_m - length_m * (libm::cos(tilt_rad) - 1.0)).abs() < ROUNDING);
    assert!((found.lateral_error_m - length_m * libm::sin(tilt_rad)).abs() < ROUNDING);
    assert!((found.needle_angle_error_rad - tilt_rad).abs() < ROUNDING);
    assert!(found.guide_position_error_m < ROUNDING);
    // The entry lies the stand-off behind the exit.
    let standoff_m = goal.standoff_m.unwrap();
    let entry_m = found.entry_lateral_error_m.unwrap();
    assert!((entry_m - standoff_m * libm::sin(tilt_rad)).abs() < ROUNDING);
}

#[test]
fn a_turn_about_the_normal_of_a_plane_shows_in_that_plane_as_it_is() {
    let resolved = table3();
    let goal = &resolved.goals[0];
    let phantom = resolved.phantom.as_ref().unwrap();
    let planned = goal.world_from_guide_exit;
    let needle = phantom.world_from_phantom.rotation.inverse() * goal.axis.into_inner();
    let mut measured = 0;
    // The axial plane's normal is the patient's z, the sagittal one's his x.
    for (normal, plane) in [(Vector3::z(), 0), (Vector3::x(), 1)] {
        for turn_rad in [0.01, -0.03_f64] {
            let about = UnitVector3::new_normalize(phantom.world_from_phantom.rotation * normal);
            let turn = UnitQuaternion::from_axis_angle(&about, turn_rad);
            let exit = Pose::from_parts(planned.translation, turn * planned.rotation);
            let found = measure_guide(Some(phantom), goal, &exit);
            let angles = [found.axial_angle_error_rad, found.sagittal_angle_error_rad];
            let shadow = (needle - normal * normal.dot(&needle)).norm();
            assert_eq!(angles[plane].is_some(), shadow >= LEAST_SHADOW, "{shadow}");
            if let Some(angle) = angles[plane] {
                assert!((angle - turn_rad.abs()).abs() < ROUNDING, "{angle}");
                measured += 1;
            }
        }
    }
    assert!(measured >= 2, "one of the planes shows the needle");
}

fn trajectory(resolved: &ResolvedScenario) -> JointTrajectory {
    let limits = MotionLimits {
        velocity: Joints::repeat(1.0),
        acceleration: Joints::repeat(2.0),
        jerk: Joints::repeat(20.0),
        line: ProfileLimits {
            velocity: 0.1,
            acceleration: 1.0,
            jerk: 10.0,
        },
    };
    JointTrajectory::starting_at(resolved.start)
        .then_straight_to(
            Phase::Transfer,
            resolved.start + Joints::repeat(0.3),
            &limits,
        )
        .then_hold(Phase::Hold, 0.5)
}

/// A plant that follows its reference but for `error(time)` at wrist 3, and touches as told.
fn recording(
    resolved: &ResolvedScenario,
    trajectory: &JointTrajectory,
    error_rad: impl Fn(f64) -> f64,
    force_n: impl Fn(f64) -> f64,
) -> Recording {
    let steps = 2000_u32;
    let timestep_s = trajectory.duration_s() / f64::from(steps);
    let mut made = Recording {
        engine: EngineIdentity {
            name: "made up",
            version: "1".into(),
            settings: Vec::new(),
        },
        timestep_s,
        velocity_age_s: 0.5 * timestep_s,
        time_s: Vec::new(),
        state: Vec::new(),
        reference: Vec::new(),
        torque_nm: (0..steps).map(|_| Joints::repeat(6.0)).collect(),
        drive_nm: (0..steps).map(|_| Joints::repeat(6.0)).collect(),
        saturated_steps: 3,
        saturation: std::array::from_fn(|joint| Saturation {
            steps: if joint == 5 { 3 } else { 0 },
            first_time_s: (joint == 5).then_some(0.25),
        }),
        cost: Cost::default(),
    };
    for k in 0..=steps {
        let time_s = timestep_s * f64::from(k);
        let reference: JointState = trajectory.sample(time_s);
        let mut position = reference.position;
        position[5] += error_rad(time_s);
        let force = force_n(time_s);
        made.time_s.push(time_s);
        made.reference.push(reference);
        made.state.push(PlantState {
            position,
            velocity: reference.velocity,
            world_from_flange: resolved.cell.robot.world_from_flange(&position),
            contact: Contact {
                count: u32::from(force > 0.0),
                deepest_penetration_m: 1e-6 * force,
                normal_force_n: force,
                pair: (force > 0.0).then_some((7, 10)),
            },
        });
    }
    made
}

/// Distance of the needle's tip from wrist 3's axis: what an error of wrist 3 moves the tip by.
fn lever_m(resolved: &ResolvedScenario) -> f64 {
    let exit = resolved.cell.tool.flange_from_guide_exit.translation.vector;
    libm::hypot(exit.x, exit.y)
}

#[test]
fn settling_ends_when_the_tip_stays_in_its_band() {
    let resolved = table3();
    let trajectory = trajectory(&resolved);
    let motion_end_s = trajectory.phases()[0].2;
    // Outside the band until 0.2 s after the motion, inside afterwards.
    let error = |time_s: f64| {
        if time_s < motion_end_s + 0.2 {
            1e-3
        } else {
            0.0
        }
    };
    let recording = recording(&resolved, &trajectory, error, |_| 0.0);
    let found = measure_motion(
        &resolved.cell,
        &resolved.goals[0],
        &trajectory,
        &recording,
        1e-5,
        None,
    );
    let settled_s = found.settling_time_s.expect("it settles");
    assert!(
        (settled_s - 0.2).abs() <= 2.0 * recording.timestep_s,
        "{settled_s}"
    );
    let expected_m = 2.0 * lever_m(&resolved) * libm::sin(0.5e-3_f64);
    assert!((found.peak_tracking_error_m - expected_m).abs() < 1e-12);
    // 6 N m of wrist 3's 12 N m.
    assert!((found.peak_torque_ratio - 0.5).abs() < 1e-12);
    assert_eq!(found.saturated_steps, 3);
    let [cut] = found.saturated_joints.as_slice() else {
        panic!("{:?}", found.saturated_joints);
    };
    assert_eq!((cut.joint, cut.steps), ("wrist_3", 3));
    assert_eq!(cut.first_time_s, Some(0.25));
    assert!((cut.share - 3.0 / recording.steps() as f64).abs() < 1e-15);
    assert!(!found.contact.occurred);
}

#[test]
fn a_tip_that_ends_outside_its_band_never_settles() {
    let resolved = table3();
    let trajectory = trajectory(&resolved);
    let recording = recording(&resolved, &trajectory, |_| 1e-3, |_| 0.0);
    let found = measure_motion(
        &resolved.cell,
        &resolved.goals[0],
        &trajectory,
        &recording,
        1e-5,
        None,
    );
    assert_eq!(found.settling_time_s, None);
}

#[test]
fn contact_is_reported_with_its_first_time_pair_force_and_impulse() {
    let resolved = table3();
    let trajectory = trajectory(&resolved);
    let force = |time_s: f64| {
        if (0.3..0.5).contains(&time_s) {
            10.0
        } else {
            0.0
        }
    };
    let recording = recording(&resolved, &trajectory, |_| 0.0, force);
    let contact = measure_motion(
        &resolved.cell,
        &resolved.goals[0],
        &trajectory,
        &recording,
        1e-5,
        None,
    )
    .contact;
    assert!(contact.occurred);
    assert!((contact.first_time_s.unwrap() - 0.3).abs() <= recording.timestep_s);
    assert_eq!(contact.first_phase, Some("transfer"));
    let expected = [7, 10].map(|body: usize| resolved.cell.bodies[body].name.clone());
    assert_eq!(contact.first_pair, Some(expected));
    assert_eq!(contact.peak_force_n, 10.0);
    assert!((contact.impulse_ns - 2.0).abs() <= 10.0 * 2.0 * recording.timestep_s);
}

#[test]
fn the_difference_of_engines_is_that_of_their_tips() {
    let resolved = table3();
    let trajectory = trajectory(&resolved);
    let still = recording(&resolved, &trajectory, |_| 0.0, |_| 0.0);
    let end_s = trajectory.duration_s();
    let bump = |time_s: f64| if time_s < 0.5 * end_s { 2e-3 } else { 1e-3 };
    let moved = recording(&resolved, &trajectory, bump, |_| 0.0);
    let (cell, goal) = (&resolved.cell, &resolved.goals[0]);
    let found = engine_difference(cell, goal, &[&still, &moved]).unwrap();
    let chord_m = |angle_rad: f64| 2.0 * lever_m(&resolved) * libm::sin(0.5 * angle_rad);
    assert!((found.peak_tip_m - chord_m(2e-3)).abs() < 1e-12);
    assert!((found.settled_tip_m - chord_m(1e-3)).abs() < 1e-12);
    assert_eq!((found.peak_engines, found.settled_engines), (None, None));
    assert_eq!(engine_difference(cell, goal, &[&still]), None);
    // The largest of three pairs, with their names.
    let mut third = recording(&resolved, &trajectory, |_| -2e-3, |_| 0.0);
    third.engine.name = "third";
    let found = engine_difference(cell, goal, &[&still, &moved, &third]).unwrap();
    assert!((found.peak_tip_m - chord_m(4e-3)).abs() < 1e-12);
    assert_eq!(found.peak_engines, Some(["made up", "third"]));
    assert!((found.settled_tip_m - chord_m(3e-3)).abs() < 1e-12);
    assert_eq!(found.settled_engines, Some(["made up", "third"]));
}

/// Central differences with steps of 1e-6 rad: truncation 1e-12, rounding 1e-16 / 1e-6.
const DIFFERENCE_M_PER_RAD: f64 = 1e-8;

#[test]
fn sensitivity_of_the_tip_is_the_norm_of_its_displacements_under_each_joint() {
    let resolved = table3();
    let (cell, goal) = (&resolved.cell, &resolved.goals[0]);
    let tip = |q: &Joints| {
        cell.robot.world_from_flange(q)
            * cell.tool.flange_from_guide_exit
            * nalgebra::Point3::new(0.0, 0.0, goal.insertion_length_m)
    };
    let step_rad = 1e-6;
    for q in [
        Joints::new(-0.735, 2.370, 1.883, -1.967, 1.274, 0.114),
        Joints::new(0.3, -1.2, 0.9, 0.4, -1.1, 2.0),
    ] {
        let squares: f64 = (0..6)
            .map(|joint| {
                let mut step = Joints::zeros();
                step[joint] = step_rad;
                ((tip(&(q + step)) - tip(&(q - step))) / (2.0 * step_rad)).norm_squared()
            })
            .sum();
        let found = needlebench_evaluation::tip_sensitivity(cell, goal, &q);
        assert!(
            (found - squares.sqrt()).abs() < DIFFERENCE_M_PER_RAD,
            "{found}"
        );
    }
}

#[test]
fn a_lesion_that_is_elsewhere_is_missed_by_as_much_across_and_along_the_needle() {
    let mut resolved = table3();
    let planned = flange(&resolved, &Pose::identity());
    let measured = |resolved: &ResolvedScenario| {
        measure_needle(
            &resolved.cell,
            resolved.phantom.as_ref(),
            &resolved.goals[0],
            &planned,
        )
    };
    let without = measured(&resolved);
    assert_eq!(without.true_target_error_m, None);
    assert_eq!(without.true_target_lateral_m, None);
    // 3 mm and 4 mm across, 12 mm along: 5 mm and 13 mm.
    let goal = &mut resolved.goals[0];
    let off_m = goal.world_from_guide_exit.rotation * Vector3::new(3e-3, 4e-3, 12e-3);
    goal.true_target_m = Some(goal.target_m + off_m);
    let found = measured(&resolved);
    assert!((found.true_target_error_m.unwrap() - 13e-3).abs() < ROUNDING);
    assert!((found.true_target_lateral_m.unwrap() - 5e-3).abs() < ROUNDING);
    // The planned target is met all the same.
    assert_eq!(found.tip_position_error_m, without.tip_position_error_m);
}

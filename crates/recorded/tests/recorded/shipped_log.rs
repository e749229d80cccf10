//! The recorded run of a real UR3e. The reference values are of a recursion and a fit of their own,
//! made outside this workspace from the same file (models/ur3e/README.md, step 8).

use nalgebra::Vector3;
use needlebench_kinematics::Joints;
use needlebench_recorded::{
    KnownArm, LogKind, ReadOptions, arm_fits, calibrate, identify, read_log, tracking,
};

use crate::common::{robot, shipped};

#[test]
fn it_is_read_whole_and_named() {
    let run = read_log(&shipped(), &ReadOptions::default()).unwrap();
    assert_eq!((run.len(), run.stretches.len()), (888, 1));
    assert_eq!(run.kind, LogKind::Arm);
    assert!((run.period_s() - 0.04).abs() < 1e-9);
    assert!((run.duration_s() - 35.48).abs() < 0.01);
    assert!(run.notes.is_empty(), "{:?}", run.notes);
    let [(0, load)] = run.loads[..] else {
        panic!("{:?}", run.loads)
    };
    assert_eq!((load.mass_kg, load.centre_m), (1.07, [0.0, 0.0, 0.058]));
    let fits = arm_fits(&run);
    assert_eq!((fits[0].arm, fits[1].arm), ("UR3e", "UR3"));
    // 0.457 mm with factory calibration left out; lengths of the CB3 arm are centimetres off.
    assert!((fits[0].rms_m - 0.457e-3).abs() < 1e-6, "{fits:?}");
    assert!(fits[1].rms_m > 0.01);
}

#[test]
fn its_controllers_torques_are_explained() {
    /// Differences of the two fits, kg m^2: that of shoulder lift is known to 0.0014.
    const ROTOR_KGM2: f64 = 0.002;
    let run = read_log(&shipped(), &ReadOptions::default()).unwrap();
    let robot = robot("ur3e");
    let known = KnownArm {
        robot: &robot,
        rotor_inertia_kgm2: None,
        torque_constant_nm_a: None,
        gravity_m_s2: 9.80665,
    };
    let found = identify(&run, &known);
    let controller = found.controller.unwrap();
    assert!(!controller.has_tensors);
    for (found, wanted) in controller
        .rotor_inertia_kgm2
        .iter()
        .zip([0.612, 0.612, 0.212, 0.0714, 0.0714, 0.0715])
    {
        let (value, half) = (found.known().unwrap(), found.half_width.unwrap());
        assert!(
            (value - wanted).abs() < ROTOR_KGM2 && half < ROTOR_KGM2,
            "{found:?}"
        );
    }
    let gravity = controller.gravity_m_s2;
    assert!((gravity.known().unwrap() - 9.82).abs() < gravity.half_width.unwrap());
    for (rms, most) in controller
        .held_out_rms_nm
        .iter()
        .zip([0.001, 0.0101, 0.004, 0.002, 0.001, 0.001])
    {
        assert!(rms < &most, "{:?}", controller.held_out_rms_nm);
    }
    let load = &controller.loads[0];
    assert!((load.mass_kg.known().unwrap() - 1.07).abs() < 0.003);
    for (found, wanted) in load.centre_m.iter().zip([0.0, 0.0, 0.058]) {
        assert!(
            (found.known().unwrap() - wanted).abs() < 0.0005,
            "{found:?}"
        );
    }
}

#[test]
fn its_currents_give_constants_and_friction_but_not_of_wrist_3() {
    let run = read_log(&shipped(), &ReadOptions::default()).unwrap();
    let robot = robot("ur3e");
    let known = KnownArm {
        robot: &robot,
        rotor_inertia_kgm2: None,
        torque_constant_nm_a: None,
        gravity_m_s2: 9.80665,
    };
    let law = identify(&run, &known).current.unwrap();
    assert_eq!(law.of, "target_current");
    // Constant (N m/A), sliding (A) and viscous friction (A s/rad) of the reference.
    let wanted = [
        (10.6, 0.32, 0.34),
        (10.9, 0.33, 0.25),
        (7.5, 0.22, 0.20),
        (3.6, 0.24, 0.19),
        (3.8, 0.16, 0.13),
    ];
    for (drive, (constant, coulomb, viscous)) in law.joints.iter().zip(wanted) {
        let k = drive.torque_constant_nm_a.known().unwrap();
        assert!((k - constant).abs() < 0.1, "{drive:?}");
        // Read to two digits, and differently weighted.
        assert!(
            (drive.coulomb_nm.known().unwrap() / k - coulomb).abs() < 0.03,
            "{drive:?}"
        );
        assert!(
            (drive.viscous_nms_rad.value.unwrap() / k - viscous).abs() < 0.04,
            "{drive:?}"
        );
        assert!(drive.held_out_rms_a < 0.035);
    }
    assert_eq!(law.joints[5].torque_constant_nm_a.known(), None);
    assert_eq!(law.joints[5].coulomb_nm.known(), None);
}

#[test]
fn its_lag_and_its_stands_are_measured() {
    let run = read_log(&shipped(), &ReadOptions::default()).unwrap();
    let target = run.target.as_ref().unwrap();
    let (q, speed): (Vec<Joints>, Vec<Joints>) = target
        .iter()
        .map(|state| (state.position, state.velocity))
        .unzip();
    let tip = Vector3::new(0.0, 0.0, 0.2);
    let found = tracking(&robot("ur3e").chain, &tip, &q, &speed, &run.actual_q);
    let lag_s = found.lag_of_all_s.known().unwrap();
    assert!((lag_s - 0.5e-3).abs() < 0.1e-3, "{lag_s}");
    assert_eq!(found.standing_rows, 166);
    // The reference: 0.037 mm rms and 0.134 worst at rest; 0.10 and 0.31 over the run.
    assert!((found.standing_tip_rms_m.unwrap() - 0.037e-3).abs() < 0.001e-3);
    assert!((found.standing_tip_largest_m.unwrap() - 0.134e-3).abs() < 0.001e-3);
    assert!((found.tip_rms_m - 0.10e-3).abs() < 0.001e-3);
    assert!((found.tip_largest_m - 0.31e-3).abs() < 0.005e-3);
}

#[test]
fn its_calibration_predicts_what_it_has_not_seen() {
    let run = read_log(&shipped(), &ReadOptions::default()).unwrap();
    let found = calibrate(&run, &robot("ur3e").chain).unwrap();
    assert!(found.is_worth);
    assert!((found.nominal.rms_m - 0.457e-3).abs() < 2e-6);
    assert!(found.nominal_held_out.rms_m > 0.4e-3);
    // Positions have nine digits: 1e-9 m.
    assert!(found.held_out.rms_m < 2e-9, "{:?}", found.held_out);
    assert!(found.second_half.rms_m < 2e-9, "{:?}", found.second_half);
    assert!((found.tool_position_m[2] - 0.150).abs() < 1e-3);
}

/// On a few short motions the numbers of the links fit anything and predict nothing.
#[test]
fn a_calibration_from_too_few_poses_is_not_kept() {
    let run = read_log(&shipped(), &ReadOptions::default()).unwrap();
    // Of a stand every row is the same pose, with noise of a micrometre on it.
    let mut few = run.clone();
    few.tcp.as_mut().unwrap().truncate(60);
    few.actual_q.truncate(60);
    few.time_s.truncate(60);
    let mut random = needlebench_numerics::random::SplitMix64::new(1);
    for pose in few.tcp.as_mut().unwrap() {
        for value in &mut pose[..3] {
            *value += random.uniform(-1e-4, 1e-4);
        }
    }
    let found = calibrate(&few, &robot("ur3e").chain).unwrap();
    assert!(
        !found.is_worth,
        "{:?} {:?}",
        found.held_out, found.nominal_held_out
    );
}

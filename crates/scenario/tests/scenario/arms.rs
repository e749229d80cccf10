//! The arms that ship: each loads, moves, and has its data or says what it lacks.

use nalgebra::{Matrix3, Vector3};
use needlebench_kinematics::ik::Kinematics;
use needlebench_kinematics::{Body, Dynamics, Joints};
use needlebench_robot::{Arm, Recognition};
use needlebench_scenario::{
    Change, KeyPath, Overrides, ResolvedScenario, ScenarioFamily, Setting, load_robot,
    load_scenario,
};

fn named(arm: &str) -> Overrides {
    Overrides {
        arm: Some(arm.to_owned()),
        ..Overrides::default()
    }
}

fn scenario(text: &str) -> Result<ResolvedScenario, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("s.toml");
    std::fs::write(&file, text).unwrap();
    load_scenario(&file, &Overrides::default()).map_err(|findings| {
        let texts = findings.iter().map(ToString::to_string);
        texts.collect::<Vec<_>>().join("\n")
    })
}

/// A scenario with `robot` as its `[robot]`.
fn with_robot(robot: &str, more: &str) -> String {
    format!(
        "name = \"s\"\n[robot]\n{robot}\n[[goals]]\nname = \"g\"\ninsertion_length_mm = 100\n\
         [goals.flange_pose]\nposition_mm = [200, -400, 300]\n\
         rotation_vector_rad = [3.1, 0, 0]\n{more}"
    )
}

#[test]
fn every_shipped_arm_loads_and_is_its_own() {
    for arm in Arm::shipped() {
        let robot = load_robot(&named(&arm.key)).unwrap();
        let used = robot.description.arm.as_ref().unwrap();
        assert_eq!((used.recognition, &used.arm), (Recognition::Own, arm));
        assert_eq!(robot.description.arm_name, arm.data.name);
        let note = format!("arm data: {} (models/{}/arm.toml)", arm.key, arm.key);
        assert!(
            robot.description.notes.contains(&note),
            "{:?}",
            robot.description.notes
        );
        assert!(robot.links.iter().all(|link| !link.solids.is_empty()));
    }
}

#[test]
fn every_shipped_arm_reaches_what_its_inverse_kinematics_say() {
    /// Rounding of the closed form over a metre.
    const RESIDUAL_M: f64 = 1e-12;
    for arm in Arm::shipped() {
        let chain = load_robot(&named(&arm.key)).unwrap().chain;
        let kinematics = Kinematics::new(chain).unwrap();
        assert!(kinematics.is_nominal(), "{}", arm.key);
        for i in 0..20 {
            let q = Joints::from_fn(|joint, _| libm::sin(f64::from(i) * 1.3 + joint as f64) * 3.0);
            let flange = chain.base_link_from_flange(&q);
            let found = kinematics.solve(&flange, None).solutions;
            assert!(!found.is_empty(), "{}", arm.key);
            for solution in found {
                let reached = chain.base_link_from_flange(&solution.joints);
                let off_m = (reached.translation.vector - flange.translation.vector).norm();
                assert!(off_m < RESIDUAL_M, "{}: {off_m}", arm.key);
            }
        }
    }
}

/// Gains swing the stretched arm with its rated load at 6 Hz about the shoulder, damped at 0.6, and a wrist
/// by its rotor: the rule that their sources name.
#[test]
fn gains_of_shipped_arms_are_those_of_their_rule() {
    /// Gains are rounded to two digits.
    const DIGITS: f64 = 0.025;
    const PER_ROTOR: [f64; 2] = [20_000.0, 600.0];
    for arm in Arm::shipped() {
        let robot = load_robot(&named(&arm.key)).unwrap();
        let servo = arm.data.servo.as_ref().unwrap();
        let rotors = arm.data.rotors.as_ref().unwrap().inertia_kgm2;
        let mut bodies = robot.bodies;
        let load = Body {
            mass_kg: arm.data.payload.as_ref().unwrap().kg,
            com_m: robot.chain.wrist_3_from_flange.translation.vector,
            inertia_kgm2: Matrix3::zeros(),
        };
        bodies[5] = bodies[5].combined_with(&load);
        let stretched = Dynamics {
            chain: robot.chain,
            bodies,
            armature_kgm2: rotors.into(),
            gravity_m_s2: Vector3::zeros(),
        };
        let inertia_kgm2 = stretched.mass_matrix(&Joints::zeros())[(1, 1)];
        let (kp, kd) = (servo.stiffness_nm_rad[1], servo.damping_nms_rad[1]);
        let frequency_hz = (kp / inertia_kgm2).sqrt() / std::f64::consts::TAU;
        let damping = 0.5 * kd / (kp * inertia_kgm2).sqrt();
        println!(
            "{}: {inertia_kgm2:.3} kg m^2, {frequency_hz:.3} Hz, {damping:.3}",
            arm.key
        );
        assert!((frequency_hz / 6.0 - 1.0).abs() < DIGITS, "{}", arm.key);
        assert!((damping / 0.6 - 1.0).abs() < DIGITS, "{}", arm.key);
        for (wrist, rotor_kgm2) in rotors.iter().enumerate().skip(3) {
            let gains = [servo.stiffness_nm_rad[wrist], servo.damping_nms_rad[wrist]];
            for (gain, per_rotor) in gains.iter().zip(PER_ROTOR) {
                let ratio = gain / (per_rotor * rotor_kgm2);
                assert!((ratio - 1.0).abs() < DIGITS, "{} {wrist}: {ratio}", arm.key);
            }
        }
    }
}

/// What a UR3's drives are derived from is said where the scenario leaves them to the arm.
#[test]
fn drives_that_are_assumed_are_noted() {
    let noted = |robot: &str, more: &str| {
        let resolved = scenario(&with_robot(robot, more)).unwrap();
        let notes = resolved.notes.into_iter();
        notes
            .filter(|note| note.starts_with("assumed for"))
            .collect::<Vec<_>>()
    };
    assert_eq!(
        noted("urdf = \"ur3\"", ""),
        [
            "assumed for the UR3: rotor inertia and friction (derived from UR3e values identified \
          from a recorded run)"
        ]
    );
    let own = "[controller]\narmature_kgm2 = [0.6, 0.6, 0.2, 0.1, 0.1, 0.1]\n";
    assert_eq!(
        noted("urdf = \"ur3\"", own),
        ["assumed for the UR3: friction (derived from UR3e values identified from a recorded run)"]
    );
    assert!(noted("urdf = \"ur3e\"", "").is_empty());
}

/// The controller believes in the world's gravity until the scenario says otherwise.
#[test]
fn gravity_is_the_worlds_and_the_controllers() {
    let with = |more: &str| scenario(&with_robot("urdf = \"ur3e\"", more));
    let resolved = with("").unwrap();
    let gravity = &resolved.gravity;
    assert_eq!(
        (gravity.world_m_s2, gravity.believed_m_s2),
        (9.80665, 9.80665)
    );
    assert!(
        gravity.believed_source.contains("9.82"),
        "{}",
        gravity.believed_source
    );
    assert!(resolved.imperfections.is_none());
    let is_noted =
        |resolved: &ResolvedScenario| resolved.notes.iter().any(|note| note.contains("gravity"));
    assert!(!is_noted(&resolved), "{:?}", resolved.notes);

    let lunar = with("[engines]\ngravity_m_s2 = 1.62\n").unwrap();
    assert_eq!(lunar.cell.gravity_m_s2, Vector3::new(0.0, 0.0, -1.62));
    assert_eq!(lunar.gravity.believed_m_s2, 1.62);
    assert!(is_noted(&lunar));

    let real = with("[controller]\ngravity_m_s2 = 9.82\n").unwrap();
    assert_eq!(real.cell.gravity_m_s2, Vector3::new(0.0, 0.0, -9.80665));
    assert_eq!(real.gravity.believed_m_s2, 9.82);
    assert!(
        real.imperfections.is_some(),
        "an arm that is not what its controller believes"
    );
    assert!(is_noted(&real));

    for (key, value) in [
        ("engines", "-9.81"),
        ("controller", "9820"),
        ("engines", "\"9.81\""),
    ] {
        let refused = with(&format!("[{key}]\ngravity_m_s2 = {value}\n")).unwrap_err();
        assert!(refused.contains("gravity_m_s2"), "{refused}");
        println!("{refused}");
    }
}

/// A stop shows the arm's own figures, or is refused with the reason that the data give.
#[test]
fn stops_have_the_arms_own_brakes_or_are_refused() {
    for arm in Arm::shipped() {
        let text = with_robot(
            &format!("urdf = \"{}\"", arm.key),
            "[events.stop]\ncategory = 0\n",
        );
        match (&arm.data.brakes, scenario(&text)) {
            (Some(brakes), Ok(resolved)) => {
                let used = resolved.robot_description.arm.as_ref().unwrap();
                assert_eq!(used.brakes().unwrap().file, arm.source.file);
                let note = format!("stopping data of the {}: {}", arm.data.name, brakes.source);
                assert!(
                    resolved.notes.iter().any(|each| each.contains(&note)),
                    "{:?}",
                    resolved.notes
                );
            }
            (None, Err(findings)) => {
                assert!(findings.contains("events.stop.category"), "{findings}");
                assert!(findings.contains("no [brakes]"), "{findings}");
                assert!(findings.contains(&arm.data.lacks["brakes"]), "{findings}");
            }
            (known, answer) => panic!("{}: {known:?} {answer:?}", arm.key),
        }
    }
}

#[test]
fn an_arm_of_which_nothing_is_known_is_told_so_and_gets_no_other_arms_data() {
    let longer = include_str!("foreign_urdf/arm.urdf").replacen(
        "xyz=\"0 0 0.1219\"",
        "xyz=\"0 0 0.1339\"",
        1,
    );
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("arm.urdf"), longer).unwrap();
    let load = |more: &str| {
        let file = folder.path().join("s.toml");
        std::fs::write(&file, with_robot("urdf = \"arm.urdf\"", more)).unwrap();
        load_scenario(&file, &Overrides::default()).map_err(|findings| findings[0].to_string())
    };
    let resolved = load("").unwrap();
    assert_eq!(resolved.robot_description.arm, None);
    let notes = resolved.notes.join("\n");
    assert!(notes.contains("arm data: none"), "{notes}");
    assert!(
        notes.contains("the servo of other_frames is assumed"),
        "{notes}"
    );
    assert!(notes.contains("base at [0.0, 0.0, 800.0] mm"), "{notes}");
    for (more, key) in [
        ("[events.stop]\ncategory = 0\n", "events.stop.category"),
        ("[events.stop]\ncategory = 1\n", "events.stop.category"),
        ("[imperfections.calibration]\n", "imperfections.calibration"),
        ("[imperfections.elasticity]\n", "stiffness_nm_rad"),
        ("[imperfections.friction]\n", "coulomb_nm"),
        ("[imperfections.control]\n", "period_ms"),
    ] {
        let finding = load(more).unwrap_err();
        assert!(finding.contains(key), "{finding}");
        assert!(finding.contains("no arm data for"), "{finding}");
    }
    load("[events.stop]\ncategory = 2\n").unwrap();
    load("[imperfections.calibration]\narm = \"ur3-1\"\n").unwrap();
    // Named, it has that arm's data, and says how far off they are.
    let file = folder.path().join("s.toml");
    let text = with_robot("urdf = \"arm.urdf\"\narm = \"ur3\"", "[events.stop]\n");
    std::fs::write(&file, text).unwrap();
    let resolved = load_scenario(&file, &Overrides::default()).unwrap();
    let notes = resolved.notes.join("\n");
    assert!(
        notes.contains("as named; the URDF's lengths differ from the arm's by up to 12.0 mm"),
        "{notes}"
    );
}

#[test]
fn a_scenario_names_an_arm_by_its_file_alone() {
    let folder = tempfile::tempdir().unwrap();
    let text = include_str!("../../../../models/ur3/arm.toml")
        .replace("\"UR3\"", "\"mine\"")
        .replace("kg = 3.0", "kg = 2.0");
    let text = text[..text.find("# Factory calibrations").unwrap()].to_owned();
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    std::fs::write(folder.path().join("mine/arm.toml"), text).unwrap();
    let urdf = include_str!("../../../../models/ur3/ur3.urdf");
    std::fs::write(folder.path().join("mine/ur3.urdf"), urdf).unwrap();
    for robot in [
        "arm = \"mine/arm.toml\"",
        "arm = \"mine\"",
        "urdf = \"mine/ur3.urdf\"",
    ] {
        let file = folder.path().join("s.toml");
        std::fs::write(&file, with_robot(robot, "")).unwrap();
        let resolved = load_scenario(&file, &Overrides::default()).unwrap();
        let used = resolved.robot_description.arm.as_ref().unwrap();
        assert_eq!(used.arm.data.payload.as_ref().unwrap().kg, 2.0, "{robot}");
        assert_eq!(used.recognition, Recognition::Own);
    }
    let finding = scenario(&with_robot("arm = \"ur4\"", "")).unwrap_err();
    assert!(finding.contains("s.toml:3"), "{finding}");
    assert!(finding.contains("there is no arm `ur4`"), "{finding}");
}

/// The shipped UR5e's URDF as somebody else's file.
fn ur5e_from_elsewhere(text: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = text.replace("<robot name=\"ur5e\"", "<robot name=\"theirs\"");
    std::fs::write(folder.path().join("theirs.urdf"), text).unwrap();
    folder
}

const UR5E: &str = include_str!("../../../../models/ur5e/ur5e.urdf");

#[test]
fn a_urdf_with_the_lengths_of_a_ur5e_has_a_ur5es_data_and_no_value_of_a_ur3() {
    let folder = ur5e_from_elsewhere(UR5E);
    let load = |more: &str| {
        let file = folder.path().join("s.toml");
        std::fs::write(&file, with_robot("urdf = \"theirs.urdf\"", more)).unwrap();
        load_scenario(&file, &Overrides::default()).map_err(|findings| findings[0].to_string())
    };
    let resolved = load(
        "[imperfections.calibration]\n[imperfections.elasticity]\n[imperfections.friction]\n\
         [imperfections.control]\n",
    )
    .unwrap();
    let robot = &resolved.robot_description;
    assert_eq!(
        (resolved.cell.robot.name.as_str(), robot.arm_name.as_str()),
        ("theirs", "UR5e")
    );
    let used = robot.arm.as_ref().unwrap();
    assert_eq!(used.recognition, Recognition::Lengths);
    let note = "arm data: ur5e (models/ur5e/arm.toml), recognised by its lengths";
    assert!(
        robot.notes.iter().any(|each| each == note),
        "{:?}",
        robot.notes
    );
    let data = &used.arm.data;
    let servo = data.servo.as_ref().unwrap();
    assert_eq!(resolved.servo.stiffness_nm_rad, servo.stiffness_nm_rad);
    assert_eq!(resolved.servo.stiffness_source, servo.source);
    let rotors = data.rotors.as_ref().unwrap();
    assert_eq!(resolved.cell.armature_kgm2.as_slice(), rotors.inertia_kgm2);
    let imperfections = resolved.imperfections.as_ref().unwrap();
    let friction = imperfections.friction.as_ref().unwrap();
    let known = data.friction.as_ref().unwrap();
    assert_eq!(friction.coulomb_nm, known.coulomb_nm);
    let period_ms = data.control.as_ref().unwrap().period_ms;
    assert_eq!(imperfections.control.unwrap()[0], period_ms * 1e-3);
    let sources = &imperfections.sources;
    let calibrations = &data.population.as_ref().unwrap().calibrations;
    assert_eq!(sources.len(), calibrations.len());
    assert!(
        sources.iter().all(|source| source.file.contains("ur5e")),
        "{sources:?}"
    );
    // But for what its own data are derived from.
    let notes = resolved
        .notes
        .iter()
        .filter(|note| !note.starts_with("assumed for the UR5e"));
    let notes = notes.cloned().collect::<Vec<_>>().join("\n").to_lowercase();
    assert!(!notes.contains("ur3"), "{notes}");
    // Its own figures, or a refusal that says why there are none.
    match load("[events.stop]\ncategory = 0\n") {
        Ok(_) => assert!(data.brakes.is_some()),
        Err(finding) => {
            assert!(finding.contains("the data of the UR5e"), "{finding}");
            assert!(finding.contains(&data.lacks["brakes"]), "{finding}");
        }
    }
}

/// Every mass of the file at zero.
fn massless(text: &str) -> String {
    let zeroed = |line: &str| match line.trim_start() {
        line if line.starts_with("<mass ") => "<mass value=\"0\"/>".to_owned(),
        _ => line.to_owned(),
    };
    let lines: Vec<String> = text.lines().map(zeroed).collect();
    lines.join("\n")
}

#[test]
fn nominal_masses_are_those_of_the_arm_that_it_is() {
    let folder = ur5e_from_elsewhere(&massless(UR5E));
    let load = |policy: &str| {
        load_robot(&Overrides {
            robot_urdf: Some(folder.path().join("theirs.urdf")),
            missing_inertia: Some(policy.parse().unwrap()),
            ..Overrides::default()
        })
    };
    let shipped = load_robot(&named("ur5e")).unwrap();
    for policy in ["nominal", "nominal-ur5e"] {
        let robot = load(policy).unwrap();
        for (ours, theirs) in robot.bodies.iter().zip(&shipped.bodies) {
            assert_eq!(ours.mass_kg, theirs.mass_kg);
        }
        let note = "has no mass: the shipped UR5e's upper_arm is used";
        assert!(
            robot
                .description
                .notes
                .iter()
                .any(|each| each.contains(note))
        );
    }
    let finding = load("error").unwrap_err().to_string();
    assert!(
        finding.contains("`missing_inertia = \"nominal-ur5e\"`"),
        "{finding}"
    );
    let finding = load("nominal-ur3").unwrap_err().to_string();
    assert!(finding.contains("lengths are not a UR3's"), "{finding}");
}

/// An offset is added to the arm's own place, where the scenario gives none; to the right arm's.
#[test]
fn what_a_scenario_leaves_to_its_arm_can_be_varied() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("s.toml");
    let vary = |robot: &str, changes: &[(&str, Change)]| {
        std::fs::write(&file, with_robot(robot, "")).unwrap();
        let family = ScenarioFamily::load(&file, &Overrides::default()).unwrap();
        let changes = changes.iter();
        let changes: Vec<(KeyPath, Change)> = changes
            .map(|(key, change)| (KeyPath::parse(key).unwrap(), change.clone()))
            .collect();
        let varied = family.vary("g", &changes);
        varied.map_err(|findings| findings[0].to_string())
    };
    let higher = ("robot.base_position_mm[2]", Change::Add(50.0));
    let stiffer = ("controller.stiffness_nm_rad[1]", Change::Add(1000.0));
    let resolved = vary("urdf = \"ur5e\"", &[higher.clone(), stiffer.clone()]).unwrap();
    let height_m = resolved.cell.robot.world_from_base_link.translation.z;
    assert!((height_m - 0.85).abs() < 1e-12, "{height_m}");
    let own = resolved
        .robot_description
        .arm
        .as_ref()
        .unwrap()
        .arm
        .data
        .servo
        .as_ref();
    let mut wanted = own.unwrap().stiffness_nm_rad;
    wanted[1] += 1000.0;
    assert_eq!(resolved.servo.stiffness_nm_rad, wanted);
    let other = ("robot.urdf", Change::Set(Setting::from("ur5e")));
    let resolved = vary("urdf = \"ur3\"", std::slice::from_ref(&other)).unwrap();
    assert_eq!(resolved.robot_description.arm_name, "UR5e");
    assert_eq!(
        resolved.servo.stiffness_nm_rad,
        own.unwrap().stiffness_nm_rad
    );
    // The UR3's gains are no base for a UR5e's.
    let finding = vary("urdf = \"ur3\"", &[other, stiffer]).unwrap_err();
    assert!(finding.contains("set the whole list"), "{finding}");
}

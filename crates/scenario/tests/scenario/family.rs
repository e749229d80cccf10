//! A varied scenario is what its file would give with the keys changed in it.

use std::path::{Path, PathBuf};

use needlebench_scenario::{
    Change, KeyPath, Overrides, ResolvedScenario, ScenarioFamily, Setting, resolve_scenario,
};

fn scenario_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../scenarios")
        .join(format!("{name}.toml"))
}

fn family(name: &str) -> ScenarioFamily {
    ScenarioFamily::load(&scenario_path(name), &Overrides::default()).unwrap()
}

fn set(path: &str, setting: impl Into<Setting>) -> (KeyPath, Change) {
    (KeyPath::parse(path).unwrap(), Change::Set(setting.into()))
}

fn add(path: &str, number: f64) -> (KeyPath, Change) {
    (KeyPath::parse(path).unwrap(), Change::Add(number))
}

/// What the scenario's file gives with `goal` alone and keys changed in its text.
fn from_text(
    name: &str,
    goal: &str,
    edit: impl FnOnce(&mut toml::Table),
) -> Result<ResolvedScenario, Vec<needlebench_input::Finding>> {
    let path = scenario_path(name);
    let text = std::fs::read_to_string(&path).unwrap();
    let mut table: toml::Table = text.parse().unwrap();
    let goals = table["goals"].as_array_mut().unwrap();
    goals.retain(|each| each["name"].as_str() == Some(goal));
    edit(&mut table);
    let text = toml::to_string(&table).unwrap();
    resolve_scenario(
        &path.display().to_string(),
        &text,
        path.parent().unwrap(),
        &Overrides::default(),
    )
}

fn same(varied: &ResolvedScenario, mut from_text: ResolvedScenario) {
    // The hash of another text.
    from_text.source = varied.source.clone();
    assert!(*varied == from_text);
}

#[test]
fn a_varied_scenario_is_that_of_the_changed_text() {
    let suite = family("supine_suite");
    let varied = suite
        .vary(
            "right_pleural_lateral",
            &[
                add("phantom.position_mm[0]", 12.5),
                set("phantom.body_roll_deg", 4.0),
                set("phantom.head_yaw_deg", -3.25),
                set("robot.base_position_mm", [-290.0, 345.0, 1040.5]),
                set("goal.roll_deg", 20.0),
                set("tool.urdf", "offset"),
                set("seed", 77.0),
            ],
        )
        .unwrap();
    let text = from_text("supine_suite", "right_pleural_lateral", |table| {
        let phantom = table["phantom"].as_table_mut().unwrap();
        phantom.insert("position_mm".into(), vec![12.5, 0.0, 0.0].into());
        phantom.insert("body_roll_deg".into(), 4.0.into());
        phantom.insert("head_yaw_deg".into(), (-3.25).into());
        table["robot"]["base_position_mm"] = vec![-290.0, 345.0, 1040.5].into();
        let goal = table["goals"][0].as_table_mut().unwrap();
        goal.insert("roll_deg".into(), 20.0.into());
        table["tool"]["urdf"] = "offset".into();
        table["seed"] = 77.into();
    })
    .unwrap();
    same(&varied, text);
}

/// Numbers in [-1, 1] that look random and are always the same.
fn scatter(k: u32, salt: u32) -> f64 {
    let mut bits = u64::from(k) << 32 | u64::from(salt);
    bits = (bits ^ 0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    f64::from((bits >> 40) as u32) / f64::from(1 << 23) - 1.0
}

#[test]
fn many_poses_of_phantom_and_base_are_those_of_their_texts() {
    let suite = family("supine_suite");
    let goals: Vec<String> = suite.goals().map(str::to_owned).collect();
    let mut both_impossible = 0;
    for k in 0..24 {
        let goal = &goals[k as usize % goals.len()];
        let number = |salt, most: f64| (most * scatter(k, salt) * 8.0).round() / 8.0;
        let position = [number(1, 40.0), number(2, 40.0), number(3, 4.0).abs()];
        let (yaw, roll) = (number(4, 6.0), number(5, 6.0));
        let base = [-280.0 + number(6, 60.0), 350.0 + number(7, 60.0), 1050.0];
        let varied = suite.vary(
            goal,
            &[
                set("phantom.position_mm", position),
                set("phantom.head_yaw_deg", yaw),
                set("phantom.body_roll_deg", roll),
                set("robot.base_position_mm", base),
            ],
        );
        let text = from_text("supine_suite", goal, |table| {
            let phantom = table["phantom"].as_table_mut().unwrap();
            phantom.insert("position_mm".into(), position.to_vec().into());
            phantom.insert("head_yaw_deg".into(), yaw.into());
            phantom.insert("body_roll_deg".into(), roll.into());
            table["robot"]["base_position_mm"] = base.to_vec().into();
        });
        match (varied, text) {
            (Ok(varied), Ok(text)) => same(&varied, text),
            (Err(varied), Err(text)) => {
                both_impossible += 1;
                let said = |findings: &[needlebench_input::Finding]| -> Vec<_> {
                    findings
                        .iter()
                        .map(|each| (each.key.clone(), each.message.clone()))
                        .collect()
                };
                assert_eq!(said(&varied), said(&text));
                assert!(varied.iter().all(|each| each.line.is_none()));
            }
            (varied, text) => panic!("{k}: {:?} {:?}", varied.err(), text.err()),
        }
    }
    assert!(both_impossible < 12, "most layouts exist");
}

#[test]
fn sizes_tools_and_imperfections_are_those_of_their_texts() {
    let imperfect = family("imperfect");
    let goal = imperfect.goals().next().unwrap().to_owned();
    for (k, tool) in ["offset", "perpendicular", "offset"].iter().enumerate() {
        let scale = 1.0 + k as f64 * 0.5;
        let varied = imperfect.vary(
            &goal,
            &[
                set("imperfections.calibration.scale", scale),
                set("tool.urdf", *tool),
                set("phantom.length_mm", 421.5),
            ],
        );
        let text = from_text("imperfect", &goal, |table| {
            let section = table["imperfections"].as_table_mut().unwrap();
            let calibration = section.entry("calibration");
            let calibration = calibration.or_insert_with(|| toml::Table::new().into());
            let calibration = calibration.as_table_mut().unwrap();
            calibration.insert("scale".into(), scale.into());
            let section = table.entry("tool");
            let section = section.or_insert_with(|| toml::Table::new().into());
            let section = section.as_table_mut().unwrap();
            section.insert("urdf".into(), (*tool).into());
            let phantom = table["phantom"].as_table_mut().unwrap();
            phantom.insert("length_mm".into(), 421.5.into());
        });
        match (varied, text) {
            (Ok(varied), Ok(text)) => same(&varied, text),
            (Err(varied), Err(text)) => assert_eq!(varied[0].message, text[0].message),
            (varied, text) => panic!("{:?} {:?}", varied.err(), text.err()),
        }
    }
}

#[test]
fn a_change_is_checked_with_the_name_that_was_meant() {
    let suite = family("supine_suite");
    let refuse = |path: &str, change: Change| {
        suite
            .check(&KeyPath::parse(path).unwrap(), &change)
            .unwrap_err()
    };
    let number = || Change::Set(Setting::from(1.5));
    let message = refuse("phantom.head_yaw_degrees", number());
    assert!(message.contains("`head_yaw_deg`"), "{message}");
    let message = refuse("phantom.head_yaw_rad", number());
    assert!(message.contains("The key states the unit"), "{message}");
    let message = refuse("phantom.position_mm[3]", number());
    assert!(message.contains("it has 3 numbers"), "{message}");
    let message = refuse("goals[0].roll_deg", number());
    assert!(message.contains("`goal.`"), "{message}");
    let message = refuse("phantom.posture", Change::Set(Setting::from("supin")));
    assert!(message.contains("did you mean `supine`?"), "{message}");
    let message = refuse("phantom.head_yaw_deg", Change::Set(Setting::from("left")));
    assert!(message.contains("degrees"), "{message}");
    let message = refuse("phantom.breadth_mm", Change::Add(5.0));
    assert!(message.contains("no value to add to"), "{message}");
    let message = refuse("tool.urdf", Change::Add(5.0));
    assert!(message.contains("only numbers"), "{message}");
    let message = refuse("tool.needle_gauge", number());
    assert!(message.contains("whole number"), "{message}");
}

#[test]
fn keys_that_the_file_leaves_out_can_be_changed() {
    let suite = family("supine_suite");
    for (path, change) in [
        ("phantom.body_roll_deg", Change::Add(2.0)),
        ("phantom.position_mm[2]", Change::Add(3.0)),
        ("phantom.breadth_mm", Change::Set(Setting::from(310.0))),
        ("goal.roll_deg", Change::Set(Setting::from(30.0))),
        ("goal.target_offset_mm", Change::Set([0.0, 1.0, 2.0].into())),
        ("seed", Change::Set(Setting::from(9.0))),
        ("tool.needle_gauge", Change::Set(Setting::from(17.0))),
        (
            "imperfections.breathing.phase",
            Change::Set(Setting::from(0.25)),
        ),
        (
            "criteria.min_clearance_mm.robot_phantom",
            Change::Set(Setting::from(5.0)),
        ),
    ] {
        suite
            .check(&KeyPath::parse(path).unwrap(), &change)
            .unwrap();
    }
}

#[test]
fn every_section_of_a_scenario_can_be_changed() {
    let suite = family("supine_suite");
    let schema = needlebench_scenario::scenario::scenario_schema();
    for section in schema["properties"].as_object().unwrap().keys() {
        if section == "goals" {
            continue;
        }
        let path = KeyPath::parse(section).unwrap();
        // A truth value fits no section, and is refused for its type, not for the section's name.
        let message = suite
            .check(&path, &Change::Set(Setting::from(true)))
            .unwrap_err();
        assert!(!message.contains("unknown key"), "{message}");
    }
}

#[test]
fn an_impossible_layout_says_which_key_and_which_value() {
    let suite = family("supine_suite");
    let findings = suite
        .vary(
            "right_pleural_lateral",
            &[set("phantom.position_mm[1]", 900.0)],
        )
        .unwrap_err();
    assert_eq!(findings[0].key.as_deref(), Some("phantom.position_mm"));
    assert!(findings[0].message.contains("900 mm"), "{}", findings[0]);
    let findings = suite.vary("right_pleural", &[]).unwrap_err();
    let said = findings[0].to_string();
    assert!(said.contains("`right_pleural_lateral`"), "{said}");
}

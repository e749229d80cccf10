//! A varied scenario is what its file would give with the keys changed in it.

use std::path::{Path, PathBuf};

use needlebench_cell::{
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
) -> Result<ResolvedScenario, Vec<needlebench_cell::Finding>> {
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

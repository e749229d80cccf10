//! What a short scenario leaves out is assumed as a set: written down, it is the same cell.

use std::path::Path;

use needlebench_scenario::{Overrides, ResolvedScenario, resolve_open_scenario, resolve_scenario};

const GOAL: &str = "[[goals]]\nlesion = \"right_upper_lobe\"\nentry_direction_deg = [-61, -1]\n";

fn resolved(text: &str) -> ResolvedScenario {
    resolve_scenario("short.toml", text, Path::new(""), &Overrides::default()).unwrap()
}

/// What stands between the ticks of the notes that say what is assumed.
fn assumed(resolved: &ResolvedScenario) -> Vec<&str> {
    let notes = resolved.notes.iter();
    let notes = notes.filter(|note| note.starts_with("assumed, since"));
    notes
        .flat_map(|note| note.split('`').skip(1).step_by(2))
        .collect()
}

#[test]
fn what_is_assumed_can_be_written_down_as_it_is_said() {
    let short = resolved(GOAL);
    let said = assumed(&short);
    let key = |name: &str| {
        let found = said.iter().find(|each| each.starts_with(name));
        (*found.unwrap_or_else(|| panic!("{name}: {said:?}"))).to_owned()
    };
    let place = format!(
        "[robot]\n{}\n{}\n",
        key("base_position_mm"),
        key("base_rpy_deg")
    );
    let mount = format!("{}\n", key("[mount]"));
    let tool = format!("[tool]\n{}\n{}\n", key("urdf"), key("needle_length_mm"));
    let phantom = format!("[phantom]\n{}\n", key("model"));
    // One after the other, and all of them.
    for text in [
        format!("{place}{mount}{GOAL}"),
        format!("{tool}{GOAL}"),
        format!("{phantom}{GOAL}"),
        format!("{place}{mount}{tool}{phantom}{GOAL}"),
    ] {
        let long = resolved(&text);
        assert_eq!(long.cell.tool, short.cell.tool, "{text}");
        assert_eq!(
            long.cell.robot.world_from_base_link, short.cell.robot.world_from_base_link,
            "{text}"
        );
        let names = |resolved: &ResolvedScenario| -> Vec<String> {
            resolved
                .cell
                .bodies
                .iter()
                .map(|body| body.name.clone())
                .collect()
        };
        assert_eq!(names(&long), names(&short), "{text}");
        assert_eq!(long.goals, short.goals, "{text}");
    }
}

/// The patient lies across the room: the place that is assumed beside one who lies along it is not, and the arm's general
/// place, in the middle of the room, is in the patient.
const ACROSS: &str = "[phantom]\nhead_yaw_deg = 90\n";

#[test]
fn a_bad_place_that_nobody_gave_is_called_assumed_with_the_command_that_finds_one() {
    let text = format!("{ACROSS}{GOAL}");
    let refused = resolve_scenario("short.toml", &text, Path::new(""), &Overrides::default());
    let finding = &refused.unwrap_err()[0];
    assert_eq!(finding.key.as_deref(), Some("robot.base_position_mm"));
    let message = &finding.message;
    assert!(
        message
            .starts_with("the robot's place is assumed, since [robot] gives none, and cannot be:"),
        "{message}"
    );
    let hint = finding.hint.as_deref().unwrap();
    assert!(hint.contains("needlebench suggest short.toml"), "{hint}");
    assert!(hint.contains("base_position_mm"), "{hint}");
    // One that is given is told as it was.
    let given = format!("[robot]\nbase_position_mm = [0, 0, 800]\n{text}");
    let refused = resolve_scenario("short.toml", &given, Path::new(""), &Overrides::default());
    let finding = &refused.unwrap_err()[0];
    assert!(!finding.message.contains("assumed"), "{}", finding.message);
}

#[test]
fn a_place_is_still_to_be_chosen_where_nobody_gave_one() {
    let text = format!("{ACROSS}{GOAL}");
    let open = |text: &str| {
        resolve_open_scenario("short.toml", text, Path::new(""), &Overrides::default())
    };
    let notes = open(&text).unwrap().resolved.notes;
    let told = notes
        .iter()
        .find(|note| note.starts_with("assumed, since [robot]"));
    assert!(told.unwrap().contains("one that cannot be"), "{told:?}");
    // A given one is not to be replaced without a word.
    assert!(open(&format!("[robot]\nbase_position_mm = [0, 0, 800]\n{text}")).is_err());
}

#[test]
fn an_arm_without_data_has_a_place_by_its_reach() {
    let folder = tempfile::tempdir().unwrap();
    let urdf =
        include_str!("../../../../models/ur10e/ur10e.urdf").replace("-0.6127 0 0", "-0.7127 0 0");
    let file = folder.path().join("theirs.urdf");
    std::fs::write(&file, urdf).unwrap();
    let overrides = Overrides {
        robot_urdf: Some(file),
        ..Overrides::default()
    };
    let found = resolve_open_scenario("short.toml", GOAL, Path::new(""), &overrides).unwrap();
    assert!(found.resolved.robot_description.arm.is_none());
    let base = found
        .resolved
        .cell
        .robot
        .world_from_base_link
        .translation
        .vector
        * 1e3;
    // Half the table's 420 mm, and 140 mm for the UR3's 457 mm of reach, 390 mm for the UR5e's 817 mm: 710 mm for 1284 mm.
    assert!(
        (base.x - -350.0).abs() < 1e-9 && (base.y - 920.0).abs() < 1e-9,
        "{base}"
    );
}

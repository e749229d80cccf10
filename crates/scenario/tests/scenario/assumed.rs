//! What a short scenario leaves out is assumed as a set: written down, it is the same cell.

use std::path::Path;

use needlebench_scenario::{Overrides, ResolvedScenario, resolve_scenario};

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

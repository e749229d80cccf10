//! A scenario whose first goal enters by its direction, to be varied.

use std::path::Path;

use needlebench_scenario::{Overrides, ScenarioEdit, ScenarioFamily, resolve_scenario};

/// The scenario of a file, with some direction in place of the first goal's entry.
pub fn entering_by_direction(path: &Path) -> ScenarioFamily {
    let text = std::fs::read_to_string(path).unwrap();
    let mut edit = ScenarioEdit::new("s.toml", &text).unwrap();
    edit.remove("goals[0]", "entry_mm").unwrap();
    edit.set("goals[0]", "entry_direction_deg", "[-32, -9]")
        .unwrap();
    let base = resolve_scenario("s.toml", edit.text(), Path::new(""), &Overrides::default());
    ScenarioFamily::of(base.unwrap(), Path::new(""), &Overrides::default()).unwrap()
}

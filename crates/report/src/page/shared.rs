//! Parts of report pages that other pages share: style, scripts, and the cell in three dimensions.

use needlebench_evaluation::room::RoomModel;
use needlebench_kinematics::Joints;
use needlebench_scenario::ResolvedScenario;
use serde_json::{Value, json};

use super::pack::Pack;
use super::room;
use super::scene::{pose, surroundings};
use super::words::words;

/// Style of all pages.
pub const STYLE: &str = include_str!("assets/page.css");
/// three.js, as the global `THREE`; MIT licence.
pub const THREE: &str = include_str!("assets/three.bundle.js");
/// The global `NB`: elements, tables, payloads.
pub const CORE: &str = include_str!("assets/core.js");
/// Numbers as people read them.
pub const NUMBER: &str = include_str!("assets/number.js");
/// `View`: a cell in three dimensions.
pub const VIEW: &str = include_str!("assets/view.js");

/// The cell of a scenario for `View`, and words for its parts, as bytes that `NB.unpack` takes.
pub fn scene(resolved: &ResolvedScenario) -> Vec<u8> {
    let mut pack = Pack::default();
    let document = json!({
        "scene": surroundings(resolved, &mut pack),
        "start": Vec::from(resolved.start.as_slice()),
        "words": words(resolved),
    });
    pack.bytes(&document)
}

/// The people at a goal, their lines of sight past a posture, and the guide's pose, for `View`.
pub fn people(
    resolved: &ResolvedScenario,
    model: &RoomModel<'_>,
    goal: usize,
    q: &Joints,
) -> Value {
    let mut view = room::people(resolved, model, goal);
    view["sight"] = json!(room::lines_of_sight(resolved, model, goal, q));
    view["guideEntry"] = json!(pose(&model.guide_entry(q)));
    view
}

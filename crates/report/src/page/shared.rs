//! What pages that are not reports take from those that are: style, scripts, and the cell in three dimensions.

use needlebench_cell::ResolvedScenario;
use serde_json::json;

use super::pack::Pack;
use super::scene::surroundings;
use super::words::words;

/// Style of all pages.
pub const STYLE: &str = include_str!("assets/page.css");
/// three.js, as the global `THREE`; MIT licence.
pub const THREE: &str = include_str!("assets/three.bundle.js");
/// The global `NB`: elements, tables, payloads.
pub const CORE: &str = include_str!("assets/core.js");
/// Numbers as people read them.
pub const NUMBER: &str = include_str!("assets/number.js");
/// `NB.View`: a cell in three dimensions.
pub const VIEW: &str = include_str!("assets/view.js");

/// The cell of a scenario for `NB.View`, and words for its parts, as bytes that `NB.unpack` takes.
pub fn scene(resolved: &ResolvedScenario) -> Vec<u8> {
    let mut pack = Pack::default();
    let document = json!({
        "scene": surroundings(resolved, &mut pack),
        "start": Vec::from(resolved.start.as_slice()),
        "words": words(resolved),
    });
    pack.bytes(&document)
}

//! Why a configuration does not work, in words.

use needlebench_cell::ClearanceClass;

/// Rules, as rows of tables name them, in words.
const RULES: [(&str, &str); 11] = [
    ("needle_route", "the needle's route is blocked"),
    ("unreachable", "out of reach"),
    ("merged", "same posture as another"),
    ("nearest_only", "out of reach"),
    ("joint_limit", "a joint at its limit"),
    ("singular", "near a singularity"),
    ("needle_corridor", "no room behind the guide"),
    ("approach", "no straight way to the skin"),
    ("no_motion", "no motion found"),
    ("collision", "a collision"),
    ("max_tip_position_error_mm", "tip error over its limit"),
];

/// What meets what.
fn class_in_words(class: ClearanceClass) -> [&'static str; 2] {
    match class {
        ClearanceClass::RobotPhantom => ["arm", "patient"],
        ClearanceClass::RobotTable => ["arm", "table"],
        ClearanceClass::RobotGantry => ["arm", "gantry"],
        ClearanceClass::RobotMount => ["arm", "mount"],
        ClearanceClass::RobotObstacle => ["arm", "obstacle"],
        ClearanceClass::SelfCollision => ["arm", "itself"],
        ClearanceClass::ToolPhantom => ["tool", "patient"],
        ClearanceClass::GuideStandoff => ["guide", "skin"],
        ClearanceClass::NeedleCorridor => ["something", "the space behind the guide"],
        ClearanceClass::NeedleRoute => ["needle", "what it must not meet"],
    }
}

/// The detail of an outcome in words: `collision robot_mount` is `arm hits mount`.
pub fn reason_in_words(detail: &str) -> String {
    if let Some((_, words)) = RULES.iter().find(|(name, _)| *name == detail) {
        return (*words).to_owned();
    }
    let of_class = |prefix: &str, words: &str| {
        let class = ClearanceClass::named(detail.strip_prefix(prefix)?)?;
        let [this, other] = class_in_words(class);
        Some(format!("{this} {words} {other}"))
    };
    of_class("collision ", "hits")
        .or_else(|| of_class("no_motion ", "cannot get past"))
        .or_else(|| of_class("min_clearance_mm.", "too near"))
        // A key of the scenario stays one, for layouts that cannot exist.
        .unwrap_or_else(|| {
            if detail.contains('.') {
                detail.to_owned()
            } else {
                detail.replace('_', " ")
            }
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn details_are_said_in_words_and_what_is_not_known_stays() {
        for (detail, words) in [
            ("collision robot_mount", "arm hits mount"),
            ("collision self", "arm hits itself"),
            ("no_motion robot_table", "arm cannot get past table"),
            ("min_clearance_mm.robot_phantom", "arm too near patient"),
            ("unreachable", "out of reach"),
            ("phantom.position_mm", "phantom.position_mm"),
            ("max_peak_torque_ratio", "max peak torque ratio"),
        ] {
            assert_eq!(reason_in_words(detail), words);
        }
    }
}

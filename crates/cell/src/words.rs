//! Words for the parts of the room.
//!
//! Bodies and solids have names for machines, such as `wrist_2.1` and `intercostal_vessels_right_5.7`: these
//! stand in JSON, Parquet and criteria, and stay as they are. Sentences, tables, charts and pages say
//! [`part_in_words`]. What a scenario names itself, an obstacle or a part of its own, keeps that name.

use std::borrow::Cow;

use crate::{ClearanceClass, Rule};

/// Parts that exist once.
const SINGLE: [(&str, &str); 28] = [
    ("base", "base"),
    ("shoulder", "shoulder"),
    ("upper_arm", "upper arm"),
    ("forearm", "forearm"),
    ("wrist_1", "wrist 1"),
    ("wrist_2", "wrist 2"),
    ("wrist_3", "wrist 3"),
    ("tool", "tool"),
    ("guide_tube", "needle guide"),
    ("needle_corridor", "access zone"),
    ("hand_cone", "access zone"),
    ("skin", "skin"),
    ("head", "patient's head"),
    ("neck", "patient's neck"),
    ("phantom", "patient"),
    ("table", "table"),
    ("gantry", "gantry"),
    ("mount", "mount"),
    ("sternum_body", "body of the sternum"),
    ("manubrium", "manubrium of the sternum"),
    ("xiphoid", "xiphoid process of the sternum"),
    ("heart", "heart"),
    ("liver", "liver"),
    ("pulmonary_trunk", "pulmonary trunk"),
    ("vena_cava_superior", "superior vena cava"),
    ("vena_cava_inferior", "inferior vena cava"),
    ("spine", "spine"),
    ("doctor", "physician"),
];

/// Parts that exist on the left and on the right, as `NAME_SIDE`.
const SIDED: [(&str, &str); 9] = [
    ("arm", "arm"),
    ("lung", "lung"),
    ("scapula", "shoulder blade"),
    ("pulmonary_artery", "pulmonary artery"),
    ("main_bronchus", "main bronchus"),
    ("mammary_artery", "internal mammary artery"),
    ("mammary_vein", "internal mammary vein"),
    ("fissure_oblique", "oblique fissure"),
    ("fissure_horizontal", "horizontal fissure"),
];

/// Parts of each rib, as `NAME_SIDE_NUMBER`, and what stands before the rib's own words.
const OF_RIBS: [(&str, &str); 3] = [
    ("rib", ""),
    ("cartilage", "cartilage of the "),
    ("intercostal_vessels", "intercostal vessels of the "),
];

/// What people call a body or a solid: `wrist 2` for `wrist_2.1`, `intercostal vessels of the right 5th rib`
/// for `intercostal_vessels_right_5.7`. A name that is none of the program's own stays as it is.
pub fn part_in_words(name: &str) -> Cow<'_, str> {
    let body = name.split_once('.').map_or(name, |(body, _)| body);
    if let Some((_, words)) = SINGLE.iter().find(|(known, _)| *known == body) {
        return Cow::Borrowed(words);
    }
    let composed = sided(body).or_else(|| of_rib(body)).or_else(|| named(body));
    composed.map_or(Cow::Borrowed(name), Cow::Owned)
}

/// What people call two bodies or solids that are near each other.
pub fn pair_in_words(pair: &[String; 2]) -> String {
    let [a, b] = pair;
    format!("{} to {}", part_in_words(a), part_in_words(b))
}

/// Reasons that are no rules, as rows of studies name them, in words.
const OTHER_REASONS: [(&str, &str); 3] = [
    ("no_entry", "no feasible entry"),
    ("max_tip_position_error_mm", "tip error above limit"),
    ("max_tip_rms_mm", "RMS tip error above limit"),
];

/// The reason of this name in words, if it is a rule's or one of the others.
fn known_reason(name: &str) -> Option<&'static str> {
    let other = OTHER_REASONS.iter().find(|(known, _)| *known == name);
    let rule = || Rule::named(name).map(Rule::in_words);
    other.map(|(_, words)| *words).or_else(rule)
}

/// The reason for rejection by a rule, in words; an unknown name stays as it is.
pub fn rule_in_words(rule: &str) -> &str {
    known_reason(rule).unwrap_or(rule)
}

/// The two bodies of a class, in words.
fn class_in_words(class: ClearanceClass) -> [&'static str; 2] {
    match class {
        ClearanceClass::RobotPhantom => ["arm", "patient"],
        ClearanceClass::RobotTable => ["arm", "table"],
        ClearanceClass::RobotGantry => ["arm", "gantry"],
        ClearanceClass::RobotMount => ["arm", "mount"],
        ClearanceClass::RobotObstacle => ["arm", "obstacle"],
        ClearanceClass::RobotPerson => ["arm", "person"],
        ClearanceClass::SelfCollision => ["arm", "itself"],
        ClearanceClass::ToolPhantom => ["tool", "patient"],
        ClearanceClass::GuideStandoff => ["guide", "skin"],
        ClearanceClass::NeedleCorridor => ["body", "access zone"],
        ClearanceClass::NeedleRoute => ["needle", "structure at risk"],
    }
}

/// Why a configuration is infeasible, as rows of studies name it, in words: `collision robot_mount` is `arm
/// collides with mount`.
pub fn reason_in_words(detail: &str) -> String {
    if let Some(words) = known_reason(detail) {
        return words.to_owned();
    }
    let of_class = |prefix: &str, words: &str| {
        let class = ClearanceClass::named(detail.strip_prefix(prefix)?)?;
        let [this, other] = class_in_words(class);
        Some(format!("{this} {words} {other}"))
    };
    of_class("collision ", "collides with")
        .or_else(|| of_class("too_close ", "too close to"))
        .or_else(|| of_class("no_motion ", "blocked by"))
        .or_else(|| of_class("min_clearance_mm.", "too close to"))
        .or_else(|| {
            let class = ClearanceClass::named(detail.strip_prefix(SCAN_ENDS)?.trim_start())?;
            let [this, other] = class_in_words(class);
            Some(format!("{this} to {other} not evaluated (scan ends)"))
        })
        // A key of the scenario stays one, for invalid layouts.
        .unwrap_or_else(|| {
            if detail.contains('.') {
                detail.to_owned()
            } else {
                detail.replace('_', " ")
            }
        })
}

/// Why a clearance from the patient is not evaluated.
pub const UNSEEN_BODY: &str = "where the scan ends, the unseen body may be nearer";

/// Name of that reason before the class of the clearance: `scan_ends robot_phantom`.
pub const SCAN_ENDS: &str = "scan_ends";

/// `left lung` for `lung_left`.
fn sided(body: &str) -> Option<String> {
    let (what, side) = body.rsplit_once('_')?;
    let (_, words) = SIDED.iter().find(|(known, _)| *known == what)?;
    let whose = if what == "arm" { "patient's " } else { "" };
    is_side(side).then(|| format!("{whose}{side} {words}"))
}

/// `right 5th rib` for `rib_right_5`.
fn of_rib(body: &str) -> Option<String> {
    let (what, number) = body.rsplit_once('_')?;
    let (what, side) = what.rsplit_once('_')?;
    let (_, before) = OF_RIBS.iter().find(|(known, _)| *known == what)?;
    let number: u8 = number.parse().ok()?;
    is_side(side).then(|| format!("{before}{side} {number}{} rib", ordinal(number)))
}

/// `vertebra T5` for `vertebra_t5`, `lesion pleural_based` for `lesion_pleural_based`.
fn named(body: &str) -> Option<String> {
    match body.split_once('_')? {
        (what @ "vertebra", level) => Some(format!("{what} {}", level.to_uppercase())),
        (what @ "lesion", name) => Some(format!("{what} {name}")),
        ("doctor", number) if number.parse::<u8>().is_ok() => Some(format!("physician {number}")),
        _ => None,
    }
}

fn is_side(word: &str) -> bool {
    ["left", "right"].contains(&word)
}

/// Ending of the numbers of ribs.
fn ordinal(number: u8) -> &'static str {
    match number {
        1 => "st",
        2 => "nd",
        3 => "rd",
        _ => "th",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_the_room_have_words() {
        for (name, words) in [
            ("wrist_2.1", "wrist 2"),
            ("wrist_2", "wrist 2"),
            ("upper_arm.3", "upper arm"),
            ("guide_tube", "needle guide"),
            ("gantry.12", "gantry"),
            ("mount.wedge", "mount"),
            ("rib_right_5.7", "right 5th rib"),
            ("rib_left_1", "left 1st rib"),
            ("cartilage_left_2.1", "cartilage of the left 2nd rib"),
            (
                "intercostal_vessels_right_3.7",
                "intercostal vessels of the right 3rd rib",
            ),
            ("lung_left", "left lung"),
            ("arm_right.forearm", "patient's right arm"),
            ("fissure_oblique_left", "left oblique fissure"),
            ("vertebra_t5.process", "vertebra T5"),
            ("lesion_pleural_based", "lesion pleural_based"),
            ("doctor", "physician"),
            ("doctor_2", "physician 2"),
        ] {
            assert_eq!(part_in_words(name), words, "{name}");
        }
    }

    #[test]
    fn details_are_said_in_words_and_what_is_not_known_stays() {
        for (detail, words) in [
            ("collision robot_mount", "arm collides with mount"),
            ("collision self", "arm collides with itself"),
            ("too_close robot_mount", "arm too close to mount"),
            ("no_motion robot_table", "arm blocked by table"),
            ("min_clearance_mm.robot_phantom", "arm too close to patient"),
            ("unreachable", "out of reach"),
            ("phantom.position_mm", "phantom.position_mm"),
            ("max_peak_torque_ratio", "max peak torque ratio"),
        ] {
            assert_eq!(reason_in_words(detail), words);
        }
    }

    #[test]
    fn names_of_others_stay_as_they_are() {
        for name in [
            "iv_pole",
            "lamp.2",
            "rib_spreader",
            "arm_rest",
            "monitor_left",
            "",
        ] {
            assert_eq!(part_in_words(name), name);
        }
    }
}

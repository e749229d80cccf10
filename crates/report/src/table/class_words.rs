//! Words for classes of clearance.

/// Each class by its name in reports.
pub(crate) const CLASSES: [(&str, &str); 11] = [
    ("robot_phantom", "arm to patient"),
    ("tool_phantom", "tool to patient"),
    ("guide_standoff", "guide to skin"),
    ("robot_table", "arm to table"),
    ("robot_gantry", "arm to gantry"),
    ("robot_mount", "arm to its mount"),
    ("robot_obstacle", "arm to obstacles"),
    ("robot_person", "arm to people"),
    ("self", "self-clearance"),
    ("needle_corridor", "access zone"),
    ("needle_route", "needle path"),
];

/// A class in words.
pub(crate) fn class_in_words(class: &str) -> &str {
    let found = CLASSES.iter().find(|(name, _)| *name == class);
    found.map_or(class, |(_, words)| words)
}

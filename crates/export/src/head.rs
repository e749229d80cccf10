//! What every export says of itself.

use needlebench_bench::provenance::PROGRAM_VERSION;
use needlebench_scenario::ResolvedScenario;

/// Lines for the head of a file in the units and the world frame of the scenario: those of [`head_in`].
pub(crate) fn head(resolved: &ResolvedScenario, what: &str) -> Vec<String> {
    head_in(
        resolved,
        what,
        "units: m, kg, s, rad, N m; z up; world frame of the scenario",
    )
}

/// Lines for the head of a file: which scenario, from which bytes, by which program, in which `units` and frame, and
/// what was assumed. No time and no path of this machine: the same scenario gives the same lines.
pub(crate) fn head_in(resolved: &ResolvedScenario, what: &str, units: &str) -> Vec<String> {
    let robot = &resolved.robot_description;
    let mut lines = vec![
        format!("{what}, of the scenario {}", resolved.scenario.name),
        format!("scenario file: sha256 {}", resolved.source.sha256),
        format!("made by needlebench {PROGRAM_VERSION}"),
        format!("arm: {}, tool: {}", robot.arm_name, resolved.cell.tool.name),
        units.to_owned(),
    ];
    if resolved.imperfections.is_some() {
        lines.push("nominal cell, without the imperfections sampled in the scenario".to_owned());
    }
    lines.extend(robot.notes.iter().map(|note| format!("note: {note}")));
    let own = resolved.notes.iter();
    let own = own.filter(|note| !robot.notes.contains(note));
    lines.extend(own.map(|note| format!("note: {note}")));
    lines
}

/// What cannot end a line before its end.
pub(crate) fn on_one_line(text: &str) -> String {
    text.chars()
        .map(|letter| if letter.is_control() { ' ' } else { letter })
        .collect()
}

/// The lines as one comment of an XML file.
pub(crate) fn xml_comment(lines: &[String]) -> String {
    let lines: Vec<String> = lines
        .iter()
        // A comment may not hold two hyphens, nor what no XML holds.
        .map(|line| {
            let line = on_one_line(line).replace("--", "- -");
            format!("  {}", line.strip_suffix('-').unwrap_or(&line))
        })
        .collect();
    format!("<!--\n{}\n-->\n", lines.join("\n"))
}

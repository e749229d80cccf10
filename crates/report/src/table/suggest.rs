//! Proposals as tables, with the keys to paste.

use std::fmt::Write;

use needlebench_bench::preview::ConfigurationPreview;
use needlebench_bench::suggest::{
    ENTRY_TERMS, Entry, EntryRule, EntrySearch, PlaceSearch, TissueMargin,
};
use needlebench_patient::Refused;

use needlebench_cell::{part_in_words, reason_in_words};
use needlebench_show::plain_table;

use super::routes::bend_terms;

/// Entries for a target.
pub fn entries_text(found: &EntrySearch) -> String {
    let base = found.base_position_m.map(|m| format!("{:.0}", m * 1e3));
    let mut text = format!(
        "entries for {}, base at [{}] mm ({})\n",
        found.goal,
        base.join(", "),
        found.basis
    );
    let [x, y, z] = found.target_in_phantom_m.map(|m| m * 1e3);
    let _ = writeln!(
        text,
        "target [{x:.1}, {y:.1}, {z:.1}] mm; {} of {} directions have an admissible path{}",
        found.allowed,
        found.tried,
        counts(&found.refused, |each| {
            EntryRule::of_name(&each.rule).map_or(String::new(), |rule| rule.in_words().to_owned())
        }),
    );
    if found.entries.is_empty() {
        let _ = write!(text, "none: {}", found.why_none());
        return text;
    }
    let mut header = vec!["", "direction\n(deg)", "depth\n(mm)", "to normal\n(deg)"];
    let tissues: Vec<&str> = found.entries[0]
        .margins
        .iter()
        .map(|each| each.tissue.as_str())
        .collect();
    let headings: Vec<String> = tissues
        .iter()
        .map(|tissue| format!("{tissue}\n(mm)"))
        .collect();
    header.extend(headings.iter().map(String::as_str));
    let bent = found.entries.iter().find_map(|entry| entry.bent.as_ref());
    if bent.is_some() {
        header.insert(4, "bend\n(mm)");
    }
    header.extend(["feasible", "score\nof 100"]);
    let is_planned = found
        .entries
        .iter()
        .any(|each| each.working_planned.is_some());
    if is_planned {
        header.insert(header.len() - 1, "with\nmotion");
    }
    let mut table = plain_table(&header);
    for (index, entry) in found.entries.iter().enumerate() {
        table.add_row(entry_row(index, entry, &tissues, is_planned));
    }
    let _ = writeln!(text, "{table}\n{ENTRY_TERMS}");
    if let Some(bent) = bent {
        let _ = writeln!(text, "{}", bend_terms(bent.is_side_known));
    }
    for (index, entry) in found.entries.iter().enumerate() {
        let nearest = entry.margins.iter().map(|each| part_in_words(&each.part));
        let nearest: Vec<_> = nearest.collect();
        let _ = write!(text, "\n# {}: nearest {}", index + 1, nearest.join(", "));
        if !entry.fissures_crossed.is_empty() {
            let crossed = entry
                .fissures_crossed
                .iter()
                .map(|each| part_in_words(each));
            let crossed: Vec<_> = crossed.collect();
            let _ = write!(text, "; crosses {}", crossed.join(", "));
        }
        let fails = entry.configurations.iter().filter(|each| !each.works);
        let fails: Vec<String> = fails.map(why_not).collect();
        if !fails.is_empty() {
            let _ = write!(text, "\n# infeasible: {}", fails.join(", "));
        }
        let _ = writeln!(text, "\n{}", entry.toml);
    }
    text.trim_end().to_owned()
}

fn entry_row(index: usize, entry: &Entry, tissues: &[&str], is_planned: bool) -> Vec<String> {
    let [azimuth, elevation] = entry.direction_deg;
    let mut row = vec![
        (index + 1).to_string(),
        format!("{azimuth}, {elevation}"),
        format!("{:.0}", entry.depth_m * 1e3),
        format!("{:.0}", entry.angle_to_skin_normal_rad.to_degrees()),
    ];
    if let Some(bent) = &entry.bent {
        row.push(format!("{:.1}", bent.bend_m.abs() * 1e3));
    }
    for tissue in tissues {
        let clearance = |margins: &[TissueMargin]| {
            let margin = margins.iter().find(|each| each.tissue == *tissue);
            margin.map_or_else(
                || "-".to_owned(),
                |each| format!("{:.1}", each.distance_m * 1e3),
            )
        };
        let straight = clearance(&entry.margins);
        row.push(match &entry.bent {
            Some(bent) if bent.is_side_known => {
                format!("{straight}/{}", clearance(&bent.bent_margins))
            }
            _ => straight,
        });
    }
    row.push(format!("{} of 8", entry.working));
    if is_planned {
        let planned = entry.working_planned;
        row.push(planned.map_or_else(|| "-".to_owned(), |count| format!("{count} of 8")));
    }
    row.push(format!("{:.0}", 100.0 * entry.score));
    row
}

fn why_not(each: &ConfigurationPreview) -> String {
    format!("{} ({})", each.label, reason_in_words(each.reason()))
}

/// Base placements of the robot.
pub fn places_text(found: &PlaceSearch) -> String {
    let mut text = format!(
        "base placements for {} ({})\n{} of {} placements feasible for {}{}\n",
        found.goals.join(", "),
        found.basis,
        found.allowed,
        found.tried,
        if found.goals.len() == 1 {
            "it"
        } else {
            "all of them"
        },
        counts(&found.refused, Refused::in_words),
    );
    if found.places.is_empty() {
        let _ = write!(text, "none: {}", found.why_none());
        return text;
    }
    let is_planned = found
        .places
        .iter()
        .flat_map(|place| &place.goals)
        .any(|goal| goal.working_planned.is_some());
    let mut header = vec!["", "position (mm)", "yaw\n(deg)", "goal", "feasible"];
    if is_planned {
        header.push("with\nmotion");
    }
    header.extend(["arm\nclearance (mm)", "best\nconfiguration"]);
    let mut table = plain_table(&header);
    let present = found.present.iter().map(|place| ("now".to_owned(), place));
    let proposed = found.places.iter().enumerate();
    let proposed = proposed.map(|(index, place)| ((index + 1).to_string(), place));
    for (name, place) in proposed.chain(present) {
        for (row, goal) in place.goals.iter().enumerate() {
            let [x, y, z] = place.position_mm;
            let first = |text: String| if row == 0 { text } else { String::new() };
            let mut cells = vec![
                first(name.clone()),
                first(format!("{x:.0}, {y:.0}, {z:.0}")),
                first(format!("{:.0}", place.rpy_deg[2])),
                goal.goal.clone(),
                format!("{} of 8", goal.working),
            ];
            if is_planned {
                let planned = goal.working_planned;
                cells.push(planned.map_or_else(|| "-".to_owned(), |count| format!("{count} of 8")));
            }
            let clear = goal.clearance_m;
            cells.push(clear.map_or_else(|| "-".to_owned(), |m| format!("{:.0}", m * 1e3)));
            cells.push(goal.best.clone());
            table.add_row(cells);
        }
    }
    let _ = writeln!(
        text,
        "{table}\nsorted by feasible configurations of the worst goal, then by arm clearance from \
         patient, table, gantry, mount and obstacles; `run` ranks by all metrics"
    );
    for (index, place) in found.places.iter().enumerate() {
        let _ = writeln!(text, "\n# {}\n[robot]\n{}", index + 1, place.toml);
    }
    text.trim_end().to_owned()
}

fn counts(refused: &[Refused], words: impl Fn(&Refused) -> String) -> String {
    /// Lines of them; the others are counted together.
    const MOST: usize = 6;
    let mut text = String::new();
    for each in refused.iter().take(MOST) {
        let _ = write!(text, "\n  {:5} rejected: {}", each.count, words(each));
    }
    let others: usize = refused.iter().skip(MOST).map(|each| each.count).sum();
    if others > 0 {
        let _ = write!(text, "\n  {others:5} rejected: others");
    }
    text
}

//! Two results side by side.

use needlebench_evaluation::compare::Comparison;
use needlebench_evaluation::report::Verdict;
use needlebench_show::markdown::{code, inline, paragraph};

use crate::table::comparison::{
    failure_text, goal_title, metric_texts, remarks, rows, side_text, unchanged, verdict,
};

/// The comparison as Markdown, for pull requests: what changed alone.
pub fn comparison_markdown(comparison: &Comparison) -> String {
    let mut lines = vec![
        format!(
            "# {} compared with {}: {}",
            inline(&comparison.a.source),
            inline(&comparison.b.source),
            match comparison.verdict {
                Verdict::Pass => "pass".to_owned(),
                other => format!("**{}**", other.name()),
            }
        ),
        String::new(),
        format!("{}.\n", paragraph(&verdict(comparison))),
        format!("- {}", inline(&side_text("A", &comparison.a))),
        format!("- {}", inline(&side_text("B", &comparison.b))),
    ];
    for difference in &comparison.provenance_differences {
        let text = |side: &Option<String>| code(side.as_deref().unwrap_or("none"));
        lines.push(format!(
            "- {}: {} -> {}",
            inline(&difference.what),
            text(&difference.a),
            text(&difference.b)
        ));
    }
    lines.extend(
        comparison
            .notes
            .iter()
            .map(|note| format!("- note: {}", inline(note))),
    );
    lines.push(String::new());
    for reason in &comparison.incomplete {
        lines.push(format!("- **incomplete** {}", inline(reason)));
    }
    for failure in &comparison.failures {
        lines.push(format!(
            "- **regression** {}",
            inline(&failure_text(failure))
        ));
    }
    for goal in &comparison.goals {
        lines.push(format!("\n## {}\n", inline(&goal_title(goal))));
        lines.extend(
            remarks(goal)
                .into_iter()
                .map(|line| format!("- {}", inline(&line))),
        );
        let rows = rows(goal, false);
        if !rows.is_empty() {
            lines.push("\n| Configuration | Metric | A | B | Change | |".to_owned());
            lines.push("|---|---|--:|--:|--:|---|".to_owned());
            for (configuration, found) in rows {
                let [words, a, b, change, outcome] = metric_texts(found);
                lines.push(format!(
                    "| {} | {} | {a} | {b} | {change} | {outcome} |",
                    inline(&configuration.label),
                    inline(&words)
                ));
            }
        }
        if goal.a.is_some() && goal.b.is_some() {
            lines.push(format!("\n{} values are unchanged.", unchanged(goal)));
        }
    }
    lines.push(String::new());
    lines.join("\n")
}

//! Two studies side by side.

use needlebench_show::markdown::{inline, paragraph};
use needlebench_study::compare::StudyComparison;

use crate::table::study_comparison::{failure_text, intro, row, shown, verdict as summary_line};

/// The comparison as Markdown, for pull requests: what changed alone.
pub fn study_comparison_markdown(comparison: &StudyComparison) -> String {
    let verdict = if comparison.pass { "pass" } else { "**fail**" };
    let mut lines = vec![format!(
        "# {} compared with {}: {verdict}\n",
        inline(&comparison.a.source),
        inline(&comparison.b.source)
    )];
    lines.push(format!("{}.\n", paragraph(&summary_line(comparison))));
    lines.extend(
        intro(comparison)
            .into_iter()
            .map(|line| format!("- {}", inline(&line))),
    );
    for failure in &comparison.failures {
        lines.push(format!(
            "- **regression** {}",
            inline(&failure_text(failure))
        ));
    }
    let rows = shown(comparison, false);
    if !rows.is_empty() {
        lines.push("\n| Quantity | A | B | B - A | |".to_owned());
        lines.push("|---|--:|--:|--:|---|".to_owned());
        for change in &rows {
            lines.push(format!(
                "| {} |",
                row(change).map(|cell| inline(&cell)).join(" | ")
            ));
        }
    }
    let same = comparison.changes.len() - rows.len();
    lines.push(format!("\n{same} rates and quantiles are unchanged.\n"));
    lines.join("\n")
}

//! Findings as diagnostics with a caret under the place.

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use needlebench_cell::Finding;

/// Prints findings to standard error.
pub(crate) fn print_findings(findings: &[Finding]) {
    for finding in findings {
        anstream::eprintln!("{}\n", rendered(finding));
    }
}

fn rendered(finding: &Finding) -> String {
    let title = match &finding.key {
        Some(key) if !finding.message.contains(key.as_str()) => {
            format!("{key}: {}", finding.message)
        }
        _ => finding.message.clone(),
    };
    // Shipped models have no file on disk to quote.
    let text = std::fs::read_to_string(&finding.file).unwrap_or_default();
    let span = finding
        .span
        .clone()
        .filter(|span| text.get(span.clone()).is_some());
    let place = match (&span, finding.line) {
        (Some(_), _) => None,
        (None, Some(line)) => Some(format!("{}:{line}", finding.file)),
        (None, None) => Some(finding.file.clone()),
    };
    let mut group = Level::ERROR
        .primary_title(&title)
        .elements(span.map(|span| {
            Snippet::source(&text)
                .path(&finding.file)
                .annotation(AnnotationKind::Primary.span(span))
        }));
    if let Some(place) = &place {
        group = group.element(annotate_snippets::Origin::path(place));
    }
    if let Some(hint) = &finding.hint {
        group = group.element(Level::HELP.with_name("hint").message(hint));
    }
    Renderer::styled().render(&[group])
}

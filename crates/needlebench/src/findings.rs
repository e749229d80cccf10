//! Findings as diagnostics with a caret under the place.

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use std::path::Path;

use needlebench_input::{Finding, printable, printable_line, read_text};

use crate::host::take_findings;
use crate::output::complain_styled;

/// Prints findings to standard error.
pub(crate) fn print_findings(findings: &[Finding]) {
    take_findings(findings);
    for finding in findings {
        complain_styled(&format!("{}\n", rendered(finding)));
    }
}

/// Findings as printed by the command line, without colours.
pub fn findings_text(findings: &[Finding]) -> String {
    let each = findings
        .iter()
        .map(|finding| format!("{}\n\n", rendered(finding)));
    anstream::adapter::strip_str(&each.collect::<String>()).to_string()
}

fn rendered(finding: &Finding) -> String {
    // Bundled models have no file on disk to quote.
    let text = read_text(Path::new(&finding.file)).unwrap_or_default();
    let finding = &Finding {
        file: printable_line(&finding.file),
        key: finding.key.as_deref().map(printable_line),
        message: printable(&finding.message).into_owned(),
        hint: finding
            .hint
            .as_deref()
            .map(|hint| printable(hint).into_owned()),
        ..finding.clone()
    };
    let title = match &finding.key {
        Some(key) if !finding.message.contains(key.as_str()) => {
            format!("{key}: {}", finding.message)
        }
        _ => finding.message.clone(),
    };
    // A position would be wrong in a text that is printed with escapes.
    let text = if printable(&text) == text {
        text
    } else {
        String::new()
    };
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

//! Which engines a report shows, and what they are called.

use needlebench_engine::Engine;
use needlebench_evaluation::report::Report;

/// An engine in the heading of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct EngineHeading {
    /// Its name in the report.
    pub name: String,
    /// Its title.
    pub title: String,
}

/// Engines that run by default and those that the report has, in the order of those that there are;
/// then those of the report that there are not.
pub(crate) fn engine_headings(
    report: &Report,
    known: &[&'static dyn Engine],
) -> Vec<EngineHeading> {
    let configurations = report.goals.iter().flat_map(|goal| &goal.configurations);
    let mut measured: Vec<&String> = configurations
        .flat_map(|each| each.engines.keys())
        .collect();
    measured.sort_unstable();
    measured.dedup();
    let is_shown = |engine: &&&'static dyn Engine| {
        engine.runs_by_default() || measured.iter().any(|name| *name == engine.name())
    };
    let shown = known.iter().filter(is_shown).map(|engine| EngineHeading {
        name: engine.name().to_owned(),
        title: engine.title().to_owned(),
    });
    let is_unknown = |name: &&&String| known.iter().all(|engine| engine.name() != name.as_str());
    let others = measured
        .iter()
        .filter(is_unknown)
        .map(|name| EngineHeading {
            name: (*name).clone(),
            title: (*name).clone(),
        });
    shown.chain(others).collect()
}

//! What `needlebench compare --help` prints after the arguments, with every metric of the table.

use needlebench_engine::{ENGINES, engine_names};
use needlebench_evaluation::metric::{Metric, MetricKey, metrics};
use needlebench_study::compare::STUDY_RATES;

const INTRODUCTION: &str = "\
Exit status 1: a feasible configuration fails or is rejected in B (unless --allow-status-change); a goal, a \
configuration or a metric is missing in B (unless --allow-lost); a metric is worse by more than its --max-loss, \
METRIC[:CONFIGURATION]=VALUE; or either result is incomplete.

Two studies (folders with results.parquet, or such tables) are compared case by case if they have the same \
cases, otherwise by 95 % confidence intervals. Exit status 1: the share of feasible layouts or the success rate \
of a configuration is significantly lower in B (unless --allow-status-change, or a --max-loss is on it); cases or \
a metric are missing in B (unless --allow-lost); or a --max-loss is exceeded, \
METRIC[@PERCENT][:CONFIGURATION]=VALUE: the percentile PERCENT (default 5, 95 for errors) of a configuration, of \
`every` one, or of the `best` per layout (default).

Run and study: with --case, the rows of the case are compared like a run of its goal.

Each line lists variants of one quantity. If the first result lacks the first variant of a line, the next one \
that both results have is used, with a note. `_static` marks static cases of studies.
";

const EXAMPLES: &str = "\
Example: needlebench compare out/before/layouts out/after/layouts --max-loss clearance@5=1mm \
--max-loss success_rate:Right-Up-Fold=0.02 --max-loss tip_error@95:every=0.1mm
Example: needlebench compare out/layouts/cases/7 out/layouts --case 7
Example: needlebench compare out/before/table3 out/after/table3 --max-loss clearance=0.5mm
Example: needlebench compare scenarios/table3.toml other_table.toml --max-loss motion_time=10%";

/// The help.
pub(crate) fn compare_help() -> String {
    let mut families: Vec<&str> = Vec::new();
    for metric in metrics() {
        if !families.contains(&metric.family) {
            families.push(metric.family);
        }
    }
    let lines: Vec<String> = families.into_iter().map(family).collect();
    let rates: Vec<String> = STUDY_RATES
        .iter()
        .map(|rate| format!("  {}: {}", rate.name, rate.words))
        .collect();
    format!(
        "{INTRODUCTION}\nMetrics:\n{}\n\nRates of studies:\n{}\n\n{EXAMPLES}",
        lines.join("\n"),
        rates.join("\n")
    )
}

/// The metrics of a family, the most informative first.
fn family(name: &str) -> String {
    let members = || metrics().rev().filter(|metric| metric.family == name);
    let of_runs = members().map(|metric| metric.key.to_owned());
    let of_static_cases = members()
        .filter_map(MetricKey::of_static_case)
        .map(|key| key.key().into_owned());
    let of_engines = members()
        .filter(|metric| metric.each_engine)
        .flat_map(|metric| {
            let engines = engine_names(ENGINES).into_iter();
            engines.filter_map(move |engine| MetricKey::of_engine(metric, engine))
        })
        .map(|key| key.key().into_owned());
    let mut keys: Vec<String> = of_runs.chain(of_static_cases).chain(of_engines).collect();
    keys.dedup();
    let words = Metric::of_key(name).map_or(name, |metric| metric.words);
    format!("  {}: {words}", keys.join(", "))
}

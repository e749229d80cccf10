//! Permitted losses, from the command line and from a file.

use needlebench_engine::{ENGINES, engine_names};
use needlebench_evaluation::{Compared, Threshold};
use needlebench_input::Finding;
use needlebench_scenario::ThresholdsFile;

use super::{CompareArguments, Pair};

/// What was given.
pub(super) struct Given {
    pub thresholds: Vec<Threshold>,
    pub allow_status_change: bool,
    pub allow_lost: bool,
}

/// Reads the file of thresholds and the arguments, which take precedence; of several on one number the last
/// counts.
pub(super) fn thresholds(
    arguments: &CompareArguments,
    compared: Compared<'_>,
) -> Result<Given, Vec<Finding>> {
    let mut given = Given {
        thresholds: Vec::new(),
        allow_status_change: arguments.allow_status_change,
        allow_lost: arguments.allow_lost,
    };
    let mut findings = Vec::new();
    let engines = engine_names(ENGINES);
    let parse = |key: &str, limit: &str| Threshold::parse(key, limit, compared, &engines);
    if let Some(path) = &arguments.thresholds {
        let file = ThresholdsFile::load(path).map_err(|finding| vec![finding])?;
        given.allow_status_change |= file.allow_status_change();
        given.allow_lost |= file.allow_lost();
        for (key, limit) in file.max_loss() {
            match parse(key, limit) {
                Ok(threshold) => given.thresholds.push(threshold),
                Err(error) => findings.push(file.finding(key, error.message).hint(error.hint)),
            }
        }
    }
    for Pair((key, limit)) in &arguments.max_loss {
        match parse(key, limit) {
            Ok(threshold) => {
                given
                    .thresholds
                    .retain(|known| !known.is_on_that_of(&threshold));
                given.thresholds.push(threshold);
            }
            Err(error) => findings.push(
                Finding::new(format!("{key}={limit}"), error.message)
                    .key("--max-loss")
                    .hint(error.hint),
            ),
        }
    }
    if findings.is_empty() {
        Ok(given)
    } else {
        Err(findings)
    }
}

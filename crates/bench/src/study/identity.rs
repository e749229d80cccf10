//! What decides the results of a study.

use std::collections::BTreeMap;

use needlebench_input::{Finding, ModelSource, sha256_hex};
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::study::{FactorValues, ResolvedStudy};

use crate::provenance::{SOURCE_SHA256, provenance};

/// Hashes of everything that a study reads, by what it is, with a hash over all of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// Hash over all inputs and the program's version.
    pub id: String,
    /// SHA-256 of each input, by role and the name that the study or the scenario calls it by.
    pub inputs: BTreeMap<String, String>,
}

impl Identity {
    /// Reads every file that a level of a factor names too.
    ///
    /// # Errors
    /// A level that names a file which cannot be used.
    pub fn new(study: &ResolvedStudy) -> Result<Self, Vec<Finding>> {
        let mut inputs: BTreeMap<String, String> = BTreeMap::new();
        inputs.insert(
            "program".to_owned(),
            format!("{} source {SOURCE_SHA256}", env!("CARGO_PKG_VERSION")),
        );
        let mut add = |role: &str, name: &str, sha256: &str| {
            // Files of the same name in different folders are told apart by their order.
            let named = |k: usize| {
                if k == 1 {
                    format!("{role} {name}")
                } else {
                    format!("{role} {name} ({k})")
                }
            };
            let free = (1..=inputs.len() + 1)
                .map(named)
                .find(|name| inputs.get(name).is_none_or(|known| known == sha256))
                .expect("one name more than there are");
            inputs.insert(free, sha256.to_owned());
        };
        add("study", file_name(&study.source), &study.source.sha256);
        let mut add_scenario = |resolved: &ResolvedScenario| {
            for input in provenance(resolved, Vec::new()).inputs {
                let name = input.file.rsplit(['/', '\\']).next().unwrap_or(&input.file);
                add(input.role, name, &input.sha256);
            }
        };
        add_scenario(study.family.base());
        for factor in &study.factors {
            let FactorValues::Levels(levels) = &factor.values else {
                continue;
            };
            for level in levels {
                // Texts may name files; numbers name none.
                let of_texts: Vec<_> = level
                    .changes
                    .iter()
                    .filter(|(_, change)| match change {
                        needlebench_scenario::Change::Set(setting) => setting.number().is_none(),
                        needlebench_scenario::Change::Add(_) => false,
                    })
                    .cloned()
                    .collect();
                if of_texts.is_empty() {
                    continue;
                }
                let keys: Vec<String> = of_texts.iter().map(|(key, _)| key.to_string()).collect();
                match study.family.vary(&study.goals[0], &of_texts) {
                    Ok(resolved) => add_scenario(&resolved),
                    Err(findings) => {
                        // A level that no layout can have; others are results.
                        let own = findings.iter().any(|finding| {
                            finding.key.as_ref().is_some_and(|key| keys.contains(key))
                        });
                        if own {
                            return Err(findings
                                .into_iter()
                                .map(|finding| Finding {
                                    file: study.source.file.clone(),
                                    message: format!(
                                        "factor `{}`, level `{}`: {}",
                                        factor.name, level.label, finding.message
                                    ),
                                    ..finding
                                })
                                .collect());
                        }
                    }
                }
            }
        }
        let lines: Vec<String> = inputs
            .iter()
            .map(|(name, hash)| format!("{name} {hash}\n"))
            .collect();
        let text = lines.concat();
        Ok(Self {
            id: sha256_hex(text.as_bytes()),
            inputs,
        })
    }
}

/// The last part of a file's path: results must not depend on where a study lies.
fn file_name(source: &ModelSource) -> &str {
    source
        .file
        .rsplit(['/', '\\'])
        .next()
        .unwrap_or(&source.file)
}

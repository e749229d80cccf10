//! The rows of a case, by what the study computes of it.

use needlebench_cell::study::{ResolvedStudy, StudyMode};
use needlebench_study::{CaseError, CaseEvaluator, CaseResult, CaseWorker, Design};

use super::case::StudyCase;
use super::dynamic::dynamic_rows;
use super::engines::EngineSet;
use super::planned::planned_rows;
use super::static_case::{StaticWorker, invalid_rows};

/// Computes the cases of a study.
pub(crate) struct StudyEvaluator<'a> {
    study: &'a ResolvedStudy,
    design: &'a Design,
}

impl<'a> StudyEvaluator<'a> {
    pub fn new(study: &'a ResolvedStudy, design: &'a Design) -> Self {
        Self { study, design }
    }
}

impl CaseEvaluator for StudyEvaluator<'_> {
    fn worker(&self) -> Result<Box<dyn CaseWorker + '_>, String> {
        Ok(Box::new(Worker {
            study: self.study,
            design: self.design,
            postures: StaticWorker::default(),
            engines: EngineSet::default(),
        }))
    }
}

struct Worker<'a> {
    study: &'a ResolvedStudy,
    design: &'a Design,
    postures: StaticWorker,
    engines: EngineSet,
}

impl CaseWorker for Worker<'_> {
    fn evaluate(&mut self, case: u64) -> Result<CaseResult, CaseError> {
        let layout = StudyCase::new(self.study, self.design, case);
        let rows = match layout.scenario(self.study) {
            Err(findings) => invalid_rows(&findings),
            Ok(resolved) => match layout.mode {
                StudyMode::Static => self.postures.rows(&resolved),
                StudyMode::Planned => {
                    planned_rows(&resolved).map_err(|message| CaseError { case, message })?
                }
                StudyMode::Dynamic => {
                    let engines = layout
                        .engines
                        .as_ref()
                        .unwrap_or(&resolved.scenario.engines.run);
                    dynamic_rows(&resolved, engines, &mut self.engines)
                        .map_err(|message| CaseError { case, message })?
                }
            },
        };
        Ok(CaseResult { case, rows })
    }
}

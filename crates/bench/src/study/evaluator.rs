//! The rows of a case, by what the study computes of it.

use needlebench_cell::study::{ResolvedStudy, StudyMode};
use needlebench_engine::{ENGINES, Engine, EnginePool, choose_engines};
use needlebench_study::{CaseError, CaseEvaluator, CaseResult, CaseWorker, Design};

use super::case::StudyCase;
use super::dynamic::dynamic_rows;
use super::planned::planned_rows;
use super::rows::StudyColumns;
use super::static_case::{StaticWorker, invalid_rows};

/// Computes the cases of a study.
pub struct StudyEvaluator<'a> {
    study: &'a ResolvedStudy,
    design: &'a Design,
    columns: &'a StudyColumns,
    engines: &'static [&'static dyn Engine],
}

impl<'a> StudyEvaluator<'a> {
    /// Of a study with its design, as rows of such columns.
    pub fn new(study: &'a ResolvedStudy, design: &'a Design, columns: &'a StudyColumns) -> Self {
        Self {
            study,
            design,
            columns,
            engines: ENGINES,
        }
    }

    /// With other engines than those of the program.
    #[must_use]
    pub fn with_engines(self, engines: &'static [&'static dyn Engine]) -> Self {
        Self { engines, ..self }
    }
}

impl CaseEvaluator for StudyEvaluator<'_> {
    fn worker(&self) -> Result<Box<dyn CaseWorker + '_>, String> {
        Ok(Box::new(Worker {
            study: self.study,
            design: self.design,
            columns: self.columns,
            postures: StaticWorker::default(),
            engines: self.engines,
            pool: EnginePool::new(self.engines),
        }))
    }
}

struct Worker<'a> {
    study: &'a ResolvedStudy,
    design: &'a Design,
    columns: &'a StudyColumns,
    postures: StaticWorker,
    engines: &'static [&'static dyn Engine],
    pool: EnginePool,
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
                    let named = layout
                        .engines
                        .as_ref()
                        .or(resolved.scenario.engines.run.as_ref());
                    choose_engines(self.engines, named.map(Vec::as_slice))
                        .map_err(|error| error.to_string())
                        .and_then(|engines| dynamic_rows(&resolved, &engines, &self.pool))
                        .map_err(|message| CaseError { case, message })?
                }
            },
        };
        Ok(CaseResult {
            case,
            rows: self.columns.rows(&rows),
        })
    }
}

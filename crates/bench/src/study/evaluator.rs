//! The rows of a case, by what the study computes of it.

use needlebench_engine::{ENGINES, EnginePool, choose_engines};
use needlebench_patient::ct::{LastScan, scanned};
use needlebench_scenario::study::{ResolvedStudy, StudyMode};
use needlebench_study::{CaseError, CaseEvaluator, CaseResult, CaseWorker, Design};

use super::case::StudyCase;
use super::dynamic::dynamic_case;
use super::failure::CaseFailure;
use super::likely::Likely;
use super::margin::CountedClasses;
use super::planned::planned_case;
use super::rows::StudyColumns;
use super::static_case::{StaticWorker, rows_without_scenario};

/// Computes the cases of a study.
pub struct StudyEvaluator<'a> {
    study: &'a ResolvedStudy,
    design: &'a Design,
    columns: &'a StudyColumns,
}

impl<'a> StudyEvaluator<'a> {
    /// Of a study with its design, as rows of such columns.
    pub fn new(study: &'a ResolvedStudy, design: &'a Design, columns: &'a StudyColumns) -> Self {
        Self {
            study,
            design,
            columns,
        }
    }
}

impl CaseEvaluator for StudyEvaluator<'_> {
    fn worker(&self) -> Box<dyn CaseWorker + '_> {
        Box::new(Worker {
            study: self.study,
            design: self.design,
            columns: self.columns,
            postures: StaticWorker::counting(counted_classes(self.study))
                .asking(Likely::of(self.study)),
            pool: EnginePool::new(ENGINES),
            scan: LastScan::default(),
        })
    }
}

/// The classes that a study's margins count.
pub(crate) fn counted_classes(study: &ResolvedStudy) -> CountedClasses {
    let search = study.file.search.as_ref();
    search.map_or_else(CountedClasses::default, |search| {
        CountedClasses::of(|class| search.counts(class))
    })
}

struct Worker<'a> {
    study: &'a ResolvedStudy,
    design: &'a Design,
    columns: &'a StudyColumns,
    postures: StaticWorker,
    pool: EnginePool,
    scan: LastScan,
}

impl CaseWorker for Worker<'_> {
    fn evaluate(&mut self, case: u64) -> Result<CaseResult, CaseError> {
        let failed = |failure: CaseFailure| CaseError {
            case,
            message: failure.to_string(),
        };
        let likely = Likely::of(self.study);
        let layout = StudyCase::new(self.study, self.design, case);
        let scenario = layout
            .scenario(self.study)
            .and_then(|resolved| scanned(resolved, self.study.family.overrides(), &mut self.scan));
        let rows = match scenario {
            Err(findings) => rows_without_scenario(&findings, layout.mode),
            Ok(resolved) => match layout.mode {
                StudyMode::Static => self.postures.rows(&resolved),
                StudyMode::Planned => planned_case(&resolved, likely).map_err(failed)?,
                StudyMode::Dynamic => {
                    let named = layout
                        .engines
                        .as_ref()
                        .or(resolved.scenario.engines.run.as_ref());
                    choose_engines(ENGINES, named.map(Vec::as_slice))
                        .map_err(CaseFailure::from)
                        .and_then(|engines| dynamic_case(&resolved, &engines, &self.pool, likely))
                        .map_err(failed)?
                        .rows
                }
            },
        };
        Ok(CaseResult {
            case,
            rows: self.columns.rows(&rows),
        })
    }
}

//! Some static cases of a study, with their motions planned.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

use needlebench_input::nothing_serves;
use needlebench_numerics::random::SplitMix64;
use needlebench_parallel::{Progress, in_parallel};
use needlebench_patient::ct::{LastScan, scanned};
use needlebench_scenario::study::StudyMode;
use needlebench_study::statistics::{ChoiceRanking, Gap, ReplannedCase, gaps};
use needlebench_study::{Outcome, Results, ResultsError};
use serde::Serialize;

use super::case::StudyCase;
use super::failure::CaseFailure;
use super::planned::planned_rows;
use super::prepare::PreparedStudy;
use super::static_case::rows_without_scenario;

/// Separates the sampling of cases from that of the samples, which have the same seed.
const STREAM: u64 = 0x7265_706c_616e;

/// Static cases that are sampled to be planned, and how many there are.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReplanDraw {
    /// The cases, in the order of their numbers, by their postures alone; `planned` is 0 until they are.
    pub cases: Vec<ReplannedCase>,
    /// Cases that they are sampled from: static ones of valid layouts, of the best candidate.
    pub of: u64,
}

/// Overestimate of postures only.
#[derive(Debug, Clone, Serialize)]
pub struct Replanned {
    /// Static cases that were also planned, sampled at random.
    pub cases: u64,
    /// Static cases that they were sampled from, of the best candidate with control factors.
    pub of: u64,
    /// Gap of at least one configuration, then of each: share that is feasible as postures minus share that is feasible
    /// with motions.
    pub gaps: Vec<Gap>,
    /// The cases: configurations that are ok, as bits, by postures and with motions.
    pub drawn: Vec<ReplannedCase>,
}

impl Replanned {
    /// Of a draw, all of whose cases are planned.
    pub fn new(draw: &ReplanDraw, drawn: Vec<ReplannedCase>) -> Self {
        Self {
            cases: drawn.len() as u64,
            of: draw.of,
            gaps: gaps(&drawn),
            drawn,
        }
    }
}

/// Samples the cases that the study requests, each equally likely, by its seed alone.
///
/// # Errors
/// What cannot be read of the table.
pub fn replan_draw(
    prepared: &PreparedStudy,
    results: &dyn Results,
    choices: Option<&ChoiceRanking>,
) -> Result<ReplanDraw, ResultsError> {
    let wanted = prepared.study.file.replanned_cases as usize;
    let mut draw = ReplanDraw::default();
    if wanted == 0 || !prepared.modes().contains(&StudyMode::Static) {
        return Ok(draw);
    }
    let seed = SplitMix64::new(prepared.study.file.seed ^ STREAM).next_u64();
    let always_static = prepared.modes().len() == 1;
    // Those with the least random numbers, which are the cases' own: no order and no memory matters.
    let mut least: BTreeMap<(u64, u64), u8> = BTreeMap::new();
    results.visit(&mut |values, result| {
        let is_valid = result
            .rows
            .iter()
            .all(|row| row.outcome != Outcome::Invalid);
        if !is_valid || choices.is_some_and(|choices| !choices.is_best(values)) {
            return;
        }
        let is_static = || {
            StudyCase::new(&prepared.study, &prepared.design, result.case).mode == StudyMode::Static
        };
        if !always_static && !is_static() {
            return;
        }
        draw.of += 1;
        let number = SplitMix64::new(seed ^ result.case).next_u64();
        let ok = result.rows.iter().enumerate();
        let ok = ok.filter(|(_, row)| row.outcome == Outcome::Ok);
        let bits = ok.fold(0, |bits, (index, _)| bits | 1 << index);
        least.insert((number, result.case), bits);
        if least.len() > wanted {
            least.pop_last();
        }
    })?;
    draw.cases = least
        .into_iter()
        .map(|((_, case), postures)| ReplannedCase {
            case,
            postures,
            planned: 0,
        })
        .collect();
    draw.cases.sort_by_key(|each| each.case);
    Ok(draw)
}

/// Plans the cases of a draw. Those that `known` has are not planned again; `done` is told of each other
/// one, from any thread. None if it was cancelled.
///
/// # Errors
/// A case that cannot be planned at all.
pub fn replanned(
    prepared: &PreparedStudy,
    draw: &ReplanDraw,
    known: &BTreeMap<u64, u8>,
    control: ReplanControl<'_>,
    done: &(dyn Fn(u64, u8) + Sync),
) -> Result<Option<Vec<ReplannedCase>>, CaseFailure> {
    let ReplanControl {
        threads,
        cancel,
        progress,
    } = control;
    progress.message("planning some cases");
    progress.at(0, draw.cases.len() as u64);
    let planned = in_parallel(threads, &draw.cases, |each| {
        if cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
            return Ok(None);
        }
        let planned = if let Some(bits) = known.get(&each.case) {
            *bits
        } else {
            let bits = planned_bits(prepared, each.case)?;
            done(each.case, bits);
            bits
        };
        progress.step();
        Ok(Some(ReplannedCase { planned, ..*each }))
    });
    let planned: Result<Vec<Option<ReplannedCase>>, CaseFailure> = planned.into_iter().collect();
    Ok(planned?.into_iter().collect())
}

/// How cases are planned.
#[derive(Clone, Copy)]
pub struct ReplanControl<'a> {
    /// Threads.
    pub threads: usize,
    /// Ends it between two cases.
    pub cancel: Option<&'a AtomicBool>,
    /// Who is told.
    pub progress: &'a dyn Progress,
}

/// Configurations that are ok with their motions.
fn planned_bits(prepared: &PreparedStudy, case: u64) -> Result<u8, CaseFailure> {
    let of_case = |source| CaseFailure::Replanned {
        case,
        source: Box::new(source),
    };
    let layout = StudyCase::new(&prepared.study, &prepared.design, case);
    let resolved = layout.scenario(&prepared.study).and_then(|resolved| {
        scanned(
            resolved,
            prepared.study.family.overrides(),
            &mut LastScan::default(),
        )
    });
    let rows = match resolved {
        Ok(resolved) => planned_rows(&resolved).map_err(of_case)?,
        Err(findings) if nothing_serves(&findings) => {
            rows_without_scenario(&findings, StudyMode::Planned)
        }
        Err(findings) => {
            return Err(of_case(CaseFailure::Refused(findings)));
        }
    };
    let ok = rows.iter().enumerate();
    let ok = ok.filter(|(_, row)| row.outcome == Outcome::Ok);
    Ok(ok.fold(0, |bits, (index, _)| bits | 1 << index))
}

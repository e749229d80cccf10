//! Reachability of cases: which of them no configuration reaches.

use needlebench_kinematics::ik::Kinematics;
use needlebench_parallel::in_parallel;
use needlebench_planning::out_of_reach_m;
use needlebench_study::CaseDesign as _;
use needlebench_study::search::{Generation, GenerationDesign};

use super::PreparedSearch;
use crate::study::StudyCase;

/// By candidate and circumstance an upper bound of the margin, mm, where no configuration reaches; none
/// where any does, or nothing is known.
///
/// A number here is as the table of results would have it. No clearance is asked for.
pub fn out_of_reach(
    search: &PreparedSearch,
    generation: &Generation,
    threads: usize,
) -> Vec<Vec<Option<f64>>> {
    let design = GenerationDesign {
        space: &search.space,
        generation,
    };
    let candidates: Vec<u64> = (0..generation.candidates.len() as u64).collect();
    in_parallel(threads, &candidates, |candidate| {
        let mut known = None;
        (0..generation.count)
            .map(|circumstance| {
                let case = candidate * generation.count + circumstance;
                of_case(search, &design, case, &mut known)
            })
            .collect()
    })
}

fn of_case(
    search: &PreparedSearch,
    design: &GenerationDesign<'_>,
    case: u64,
    known: &mut Option<Kinematics>,
) -> Option<f64> {
    let study = &search.study;
    // What scans and planned routes make of a layout is not known before.
    if study.family.base().scenario.ct.is_some() {
        return None;
    }
    let layout = StudyCase::of_values(study, case, design.values(case));
    // Layouts that cannot exist are told by their rows.
    let resolved = layout.scenario(study).ok()?;
    let chain = resolved.cell.robot.chain;
    let kinematics = match known {
        Some(kinematics) if kinematics.chain == chain => kinematics,
        _ => known.insert(Kinematics::new(chain).ok()?),
    };
    let kinematics = kinematics.within(resolved.cell.robot.limits);
    let missing_m = out_of_reach_m(&resolved, resolved.goals.first()?, &kinematics)?;
    #[expect(clippy::cast_possible_truncation, reason = "as in the table")]
    let in_table = (missing_m.min(-1e-9) * 1e3) as f32;
    Some(f64::from(in_table))
}

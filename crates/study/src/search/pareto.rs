//! Two objectives: the candidates that cannot be improved in one without loss in the other.

use needlebench_numerics::pareto::pareto_front;

use super::finite::{Round, listed, planned};
use super::log::{Decision, FrontMember};
use super::pool::{Found, Pool};
use super::ranges::spread_point;
use super::{ALPHA, Choices, Judge, SearchError, SearchPlan};

/// Candidates of the last round, at least.
const FRONT_FINALISTS: usize = 16;
/// Most members that are evaluated on held-out circumstances.
const JUDGED_ANEW: usize = 8;
/// Points over ranges, for each combination of finite control factors.
const POINTS: u32 = 64;

pub(super) fn check<S>(plan: &SearchPlan, choices: &Choices) -> Result<(), SearchError<S>> {
    let points = if choices.dimensions() == 0 {
        1
    } else {
        POINTS as usize
    };
    planned_for(plan, listed(choices)? * points).map(|_| ())
}

fn planned_for<S>(plan: &SearchPlan, count: usize) -> Result<Vec<Round>, SearchError<S>> {
    let reserved = plan.fresh * JUDGED_ANEW.min(count) as u64;
    planned(
        count,
        plan,
        FRONT_FINALISTS,
        reserved,
        format!("{count} candidates and a Pareto front"),
    )
}

pub(super) fn search<J: Judge>(
    pool: &mut Pool<'_, J>,
    choices: &Choices,
) -> Result<(), SearchError<J::Stop>> {
    let combinations = listed(choices)?;
    let dimensions = choices.dimensions();
    let mut all = Vec::new();
    for combination in 0..combinations {
        if dimensions == 0 {
            all.push(pool.add(choices.candidate(combination, &[])));
            continue;
        }
        for index in 0..POINTS {
            let point = spread_point(dimensions, index, pool.plan.seed);
            all.push(pool.add(choices.candidate(combination, &point)));
        }
    }
    let plan = pool.plan;
    let rounds = planned_for(plan, all.len())?;
    let mut undecided = Vec::new();
    for round in &rounds {
        let purpose = round.purpose(plan);
        pool.evaluate(&all, round.circumstances, purpose)?;
        let mut ordered = by_layers(pool, &all, round.circumstances);
        let dropped = ordered.split_off(round.keep.min(ordered.len()));
        undecided.extend(dropped.iter().copied());
        pool.decide(Decision {
            after: 0,
            purpose,
            circumstances: round.circumstances,
            kept: ordered.clone(),
            told_apart: Vec::new(),
            dropped,
            ruled_out: Vec::new(),
        });
        all = ordered;
    }
    let samples = plan.samples;
    let scores = scores(pool, &all, samples);
    // Both objectives share the chance.
    let better = pool.told_apart(&all, samples, 0.5 * ALPHA);
    let mut front: Vec<FrontMember> = all
        .iter()
        .enumerate()
        .filter_map(|(i, &id)| {
            let others = || (0..all.len()).filter(|&j| j != i);
            let is_out = others().any(|j| better.iter().all(|better| better[j][i]));
            (!is_out).then(|| FrontMember {
                id,
                by_estimate: !others().any(|j| dominates(&scores[j], &scores[i])),
                is_certain: others().all(|j| better.iter().any(|better| better[i][j])),
                fresh: None,
            })
        })
        .collect();
    let place = |id: usize| all.iter().position(|&each| each == id).expect("one of all");
    // Along the front, the best in the first objective first.
    front.sort_by(|a, b| {
        let [a_score, b_score] = [a, b].map(|each| scores[place(each.id)]);
        b_score[0]
            .total_cmp(&a_score[0])
            .then(b_score[1].total_cmp(&a_score[1]))
            .then(a.id.cmp(&b.id))
    });
    let members: Vec<usize> = front
        .iter()
        .filter(|member| member.by_estimate)
        .map(|member| member.id)
        .collect();
    let judged = evenly(&members, JUDGED_ANEW);
    pool.judge_anew(&judged)?;
    for member in &mut front {
        member.fresh = judged.contains(&member.id).then(|| pool.fresh(member.id));
    }
    let found = Found {
        ranked: members,
        // A front has members, not equals.
        equals: Vec::new(),
        undecided,
    };
    pool.answer_with(found, front);
    Ok(())
}

fn scores<J: Judge>(pool: &Pool<'_, J>, ids: &[usize], circumstances: u64) -> Vec<[f64; 2]> {
    let second = pool.plan.second.expect("two objectives");
    ids.iter()
        .map(|&id| [pool.plan.objective, second].map(|each| pool.score(id, circumstances, each)))
        .collect()
}

fn dominates(a: &[f64; 2], b: &[f64; 2]) -> bool {
    a[0] >= b[0] && a[1] >= b[1] && a != b
}

/// Candidates layer by layer: the front, then the front of the rest, and so on; within a layer those with
/// the widest gap to their neighbours first, so that a front that is cut keeps its ends (Deb and others, "NSGA-II",
/// IEEE Transactions on Evolutionary Computation 6 (2002) 182).
fn by_layers<J: Judge>(pool: &Pool<'_, J>, ids: &[usize], circumstances: u64) -> Vec<usize> {
    let scores = scores(pool, ids, circumstances);
    let mut rest: Vec<usize> = (0..ids.len()).collect();
    let mut ordered = Vec::new();
    while !rest.is_empty() {
        let front = pareto_front(&rest, |&j, &i| dominates(&scores[j], &scores[i]));
        let layer: Vec<usize> = front.into_iter().map(|at| rest[at]).collect();
        rest.retain(|i| !layer.contains(i));
        ordered.extend(by_gaps(layer, &scores).into_iter().map(|i| ids[i]));
    }
    ordered
}

fn by_gaps(mut layer: Vec<usize>, scores: &[[f64; 2]]) -> Vec<usize> {
    layer.sort_by(|&a, &b| scores[b][0].total_cmp(&scores[a][0]).then(a.cmp(&b)));
    let width = |axis: usize| {
        let of = layer.iter().map(|&i| scores[i][axis]);
        let finite = of.filter(|score| score.is_finite());
        let ends = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), score| {
            (low.min(score), high.max(score))
        });
        (ends.1 - ends.0).max(f64::MIN_POSITIVE)
    };
    let widths = [width(0), width(1)];
    let mut keyed: Vec<(f64, usize)> = (0..layer.len())
        .map(|place| {
            let ends = place
                .checked_sub(1)
                .zip((place + 1 < layer.len()).then_some(place + 1));
            let gap = ends.map_or(f64::INFINITY, |(before, after)| {
                let [a, b] = [before, after].map(|at| scores[layer[at]]);
                (0..2)
                    .map(|axis| (a[axis] - b[axis]).abs() / widths[axis])
                    .sum()
            });
            (gap, layer[place])
        })
        .collect();
    // The sort is stable.
    keyed.sort_by(|a, b| b.0.total_cmp(&a.0));
    keyed.into_iter().map(|(_, index)| index).collect()
}

/// At most so many, evenly over the list, both ends included.
fn evenly(ids: &[usize], most: usize) -> Vec<usize> {
    if ids.len() <= most {
        return ids.to_vec();
    }
    (0..most)
        .map(|k| ids[k * (ids.len() - 1) / (most - 1)])
        .collect()
}

//! Searches of which the truth is known.

use needlebench_numerics::normal;
use needlebench_numerics::random::SplitMix64;
use serde_json::Value;

use super::*;
use crate::FactorValue;

/// Candidates of known margins under normal circumstances: a part that they have in common, and one of their own.
struct Known<F> {
    /// Mean margin of a candidate, mm.
    mean_mm: F,
    /// What does not reach.
    unreached: fn(&[FactorValue], f64) -> bool,
    has_filter: bool,
    seed: u64,
    asked: u64,
}

const COMMON_SD_MM: f64 = 3.0;
const OWN_SD_MM: f64 = 1.0;

fn number(value: FactorValue) -> f64 {
    match value {
        FactorValue::Level(level) => level as f64,
        FactorValue::Number(number) => number,
    }
}

fn draw(seed: u64, parts: &[u64]) -> f64 {
    let seed = parts.iter().fold(seed, |seed, part| {
        SplitMix64::new(seed ^ part.wrapping_mul(0x9e37_79b9_7f4a_7c15)).next_u64()
    });
    SplitMix64::new(seed).standard_normal()
}

impl<F: Fn(&[FactorValue]) -> f64> Known<F> {
    fn new(mean_mm: F, seed: u64) -> Self {
        Self {
            mean_mm,
            unreached: |_, _| false,
            has_filter: true,
            seed,
            asked: 0,
        }
    }

    fn common(&self, stream: Stream, circumstance: u64) -> f64 {
        draw(self.seed, &[stream as u64, circumstance])
    }

    fn worth(&self, candidate: &[FactorValue], stream: Stream, circumstance: u64) -> CaseWorth {
        let common = self.common(stream, circumstance);
        if (self.unreached)(candidate, common) {
            return CaseWorth {
                margin_mm: -5.0 - common.abs(),
                works: false,
                tip_error_mm: None,
                lesion_probability: None,
            };
        }
        let mut parts = vec![stream as u64, circumstance, 77];
        parts.extend(candidate.iter().map(|&value| number(value).to_bits()));
        let own = draw(self.seed, &parts);
        let margin_mm = (self.mean_mm)(candidate) + COMMON_SD_MM * common + OWN_SD_MM * own;
        CaseWorth {
            margin_mm,
            works: margin_mm >= 0.0,
            tip_error_mm: (margin_mm >= 0.0).then_some(1.0 + number(candidate[0]) / 10.0),
            lesion_probability: None,
        }
    }
}

impl<F: Fn(&[FactorValue]) -> f64> Judge for Known<F> {
    type Stop = ();

    fn out_of_reach(&mut self, generation: &Generation) -> Result<Vec<Vec<Option<f64>>>, ()> {
        let circumstances = generation.first..generation.first + generation.count;
        let of = |candidate: &Candidate| {
            let each = circumstances.clone().map(|circumstance| {
                let common = self.common(generation.stream, circumstance);
                let is_out = self.has_filter && (self.unreached)(candidate, common);
                is_out.then(|| -5.0 - common.abs())
            });
            each.collect()
        };
        Ok(generation.candidates.iter().map(of).collect())
    }

    fn judge(&mut self, generation: &Generation) -> Result<Vec<Vec<CaseWorth>>, ()> {
        self.asked += generation.cases();
        let circumstances = generation.first..generation.first + generation.count;
        let of = |candidate: &Candidate| {
            let each = circumstances.clone();
            each.map(|circumstance| self.worth(candidate, generation.stream, circumstance))
                .collect()
        };
        Ok(generation.candidates.iter().map(of).collect())
    }

    fn describe(&self, candidate: &[FactorValue]) -> Vec<(String, Value)> {
        let named = candidate.iter().enumerate();
        named
            .map(|(index, &value)| (format!("c{index}"), number(value).into()))
            .collect()
    }
}

/// Standard deviation of a candidate's margin, mm.
fn sd_mm() -> f64 {
    (COMMON_SD_MM * COMMON_SD_MM + OWN_SD_MM * OWN_SD_MM).sqrt()
}

fn plan(objective: Objective, budget: u64, seed: u64) -> SearchPlan {
    SearchPlan {
        objective,
        second: None,
        samples: 128,
        fresh: 256,
        budget,
        seed,
    }
}

const MARGIN: Objective = Objective::Margin { quantile: 0.05 };

/// A flat hill over a grid of 10 by 10.
fn hill(candidate: &[FactorValue]) -> f64 {
    let [x, y] = [candidate[0], candidate[1]].map(number);
    7.0 - 0.08 * ((x - 6.0).powi(2) + (y - 3.0).powi(2))
}

fn grid() -> Choices {
    Choices(vec![ChoiceAxis::Levels(10), ChoiceAxis::Levels(10)])
}

/// 200 searches among many alike: the interval of the winner's rate on fresh circumstances has the truth as often
/// as it says, that on those that selected it has not.
#[test]
fn the_interval_of_the_winner_s_rate_has_the_truth() {
    const SEARCHES: u64 = 200;
    /// 95 % of 200 less two standard deviations of a binomial distribution.
    const LEAST: u32 = 184;
    let mean = |candidate: &[FactorValue]| 3.0 + 0.3 * (number(candidate[0]) / 60.0);
    let (mut fresh, mut naive) = (0, 0);
    for seed in 0..SEARCHES {
        let mut judge = Known::new(mean, 500 + seed);
        let choices = Choices(vec![ChoiceAxis::Levels(60)]);
        let plan = SearchPlan {
            samples: 64,
            ..plan(Objective::Rate, 60 * 64 + 256, seed)
        };
        let log = search(&plan, &choices, &mut judge).unwrap();
        let answer = log.answer.unwrap();
        let truth = normal::probability_below(mean(&[FactorValue::Level(answer.winner)]) / sd_mm());
        let has = |estimate: &Estimate| {
            let Ends { low, high } = estimate.interval;
            (low.unwrap()..=high.unwrap()).contains(&truth)
        };
        fresh += u32::from(has(&answer.rate));
        naive += u32::from(has(&answer.selected_by[0]));
    }
    println!("fresh {fresh}, of those that selected {naive}, of {SEARCHES}");
    assert!(fresh >= LEAST, "{fresh}");
    assert!(naive < LEAST, "{naive}");
}

/// A third of the cases of the grid, and at most half a millimetre worse than the best of it, in 9 of 10.
#[test]
fn halving_finds_the_best_with_a_third_of_the_cases() {
    const REGRET_MM: f64 = 0.5;
    let mut good = 0;
    for seed in 0..20 {
        let mut judge = Known::new(hill, seed);
        let log = search(&plan(MARGIN, 100 * 128 / 3, seed), &grid(), &mut judge).unwrap();
        assert!(log.cases * 3 <= 100 * 128 && log.cases == judge.asked);
        let answer = log.answer.unwrap();
        let winner = [answer.winner / 10, answer.winner % 10].map(FactorValue::Level);
        good += u32::from(7.0 - hill(&winner) <= REGRET_MM);
        assert!(answer.equals.contains(&answer.winner));
        assert_eq!(answer.figures[0].cases, 256);
    }
    assert!(good >= 18, "{good} of 20");
}

/// The same hill over ranges: better than the best of the grid by less than a third of its cases.
#[test]
fn evolution_finds_the_top_of_a_hill() {
    const REGRET_MM: f64 = 0.5;
    let range = |low, high| ChoiceAxis::Range { low, high };
    let choices = Choices(vec![range(0.0, 9.0), range(0.0, 9.0)]);
    let mut good = 0;
    for seed in 0..20 {
        let mut judge = Known::new(hill, seed);
        let log = search(&plan(MARGIN, 100 * 128 / 3, seed), &choices, &mut judge).unwrap();
        assert!(log.cases * 3 <= 100 * 128);
        let winner = &log.candidates[log.answer.unwrap().winner];
        let at: Vec<FactorValue> = winner
            .choice
            .iter()
            .map(|(_, value)| FactorValue::Number(value.as_f64().unwrap()))
            .collect();
        good += u32::from(7.0 - hill(&at) <= REGRET_MM);
    }
    assert!(good >= 18, "{good} of 20");
}

/// Finite choices beside ranges: the best hill of five.
#[test]
fn evolution_chooses_among_combinations() {
    let choices = Choices(vec![
        ChoiceAxis::Levels(5),
        ChoiceAxis::Range {
            low: -50.0,
            high: 50.0,
        },
    ]);
    let mean = |candidate: &[FactorValue]| {
        let [which, x] = [candidate[0], candidate[1]].map(number);
        let top = match which {
            0.0 => 3.0,
            1.0 => 6.0,
            2.0 => 9.0,
            3.0 => 5.0,
            _ => 4.0,
        };
        top - 0.005 * (x - 10.0 * which).powi(2)
    };
    for seed in 0..5 {
        let mut judge = Known::new(mean, seed);
        let log = search(&plan(MARGIN, 12_000, seed), &choices, &mut judge).unwrap();
        let winner = &log.candidates[log.answer.unwrap().winner].choice;
        assert_eq!(winner[0].1.as_f64(), Some(2.0));
        assert!((winner[1].1.as_f64().unwrap() - 20.0).abs() < 10.0);
    }
}

/// What cannot be reached is never asked for, and the answer is the same as without the filter.
#[test]
fn ruling_out_by_reach_changes_no_answer() {
    let unreached = |candidate: &[FactorValue], common: f64| {
        let x = number(candidate[0]);
        x > 7.0 || (x < 3.0 && common < -1.2)
    };
    let range = |low, high| ChoiceAxis::Range { low, high };
    let of_ranges = Choices(vec![range(0.0, 9.0), range(0.0, 9.0)]);
    let tip = Objective::TipError { without_mm: 10.0 };
    for objective in [MARGIN, Objective::Rate, tip] {
        let (mut spared, mut ruled_out) = (0, 0);
        for choices in [grid(), of_ranges.clone()] {
            for seed in 0..4 {
                let run = |has_filter| {
                    let mut judge = Known {
                        unreached,
                        has_filter,
                        ..Known::new(hill, seed)
                    };
                    let plan = plan(objective, 9000, seed);
                    (search(&plan, &choices, &mut judge).unwrap(), judge.asked)
                };
                let ((with, fewer), (without, all)) = (run(true), run(false));
                let (a, b) = (with.answer.unwrap(), without.answer.unwrap());
                let choice = |id: usize| with.candidates[id].choice.clone();
                assert_eq!(choice(a.winner), without.candidates[b.winner].choice);
                assert_eq!(a.figures, b.figures);
                assert_eq!(without.ruled_out, 0);
                if choices.dimensions() == 0 {
                    assert_eq!(a.equals, b.equals);
                }
                spared += all - fewer;
                ruled_out += with.ruled_out;
            }
        }
        assert!(
            spared > 0 && ruled_out > 0,
            "{objective:?}: {spared} {ruled_out}"
        );
    }
}

#[test]
fn the_same_seed_gives_the_same_log() {
    let run = |seed| {
        let mut judge = Known::new(hill, 3);
        search(&plan(MARGIN, 5000, seed), &grid(), &mut judge).unwrap()
    };
    assert_eq!(run(1), run(1));
}

#[test]
fn a_front_has_what_is_best_in_either() {
    // More margin costs tip error: all of them are on the front, and what is worse in both is not.
    let mean = |candidate: &[FactorValue]| {
        let [x, worse] = [candidate[0], candidate[1]].map(number);
        8.0 + 2.0 * x - 6.0 * worse
    };
    let choices = Choices(vec![ChoiceAxis::Levels(6), ChoiceAxis::Levels(3)]);
    let mut judge = Known::new(mean, 2);
    let plan = SearchPlan {
        second: Some(Objective::TipError { without_mm: 10.0 }),
        ..plan(MARGIN, 20_000, 1)
    };
    let log = search(&plan, &choices, &mut judge).unwrap();
    let answer = log.answer.unwrap();
    let members: Vec<usize> = answer.front.iter().map(|member| member.id).collect();
    let certain = answer.front.iter().filter(|member| member.is_certain);
    assert_eq!(answer.winner, 15, "the most margin: {members:?}");
    assert!(certain.count() >= 3, "{:?}", answer.front);
    for member in &answer.front {
        let worse = member.id % 3;
        assert!(worse == 0 || !member.is_certain, "{member:?}");
        assert!(!member.by_estimate || worse == 0, "{member:?}");
    }
    assert!(answer.front[0].fresh.is_some());
}

#[test]
fn too_small_a_budget_says_what_is_needed() {
    let mut judge = Known::new(hill, 0);
    let found = search(&plan(MARGIN, 500, 0), &grid(), &mut judge);
    let Err(SearchError::Budget { least, .. }) = found else {
        panic!("{found:?}");
    };
    assert!(search(&plan(MARGIN, least, 0), &grid(), &mut judge).is_ok());
    let range = ChoiceAxis::Range {
        low: 0.0,
        high: 1.0,
    };
    let choices = Choices(vec![range.clone(), range]);
    let found = search(&plan(MARGIN, 500, 0), &choices, &mut judge);
    let Err(SearchError::Budget { least, .. }) = found else {
        panic!("{found:?}");
    };
    let log = search(&plan(MARGIN, least, 0), &choices, &mut judge).unwrap();
    assert!(log.cases <= least);
}

//! How much worse than the best a search by halving ends, with a third of the cases of a stored grid.
//!
//! `cargo run --example search_regret -- TABLE ORDERS`: TABLE is the table of a generation that has all candidates with all
//! circumstances (`needlebench search` with a budget for it). For each of so many random orders of the circumstances a
//! search gets the first half of them, a third of whose cases it may use, and its winner is held against the best of all candidates on the
//! other half.

use std::cell::RefCell;

use needlebench_numerics::random::SplitMix64;
use needlebench_study::search::{
    CaseWorth, ChoiceAxis, Choices, Generation, Judge, Objective, SearchPlan, search,
};
use needlebench_study::{FactorValue, Outcome, ParquetResults, Results as _};

struct Stored<'a> {
    worth: &'a [Vec<CaseWorth>],
    order: Vec<usize>,
}

impl Judge for Stored<'_> {
    type Stop = ();

    fn out_of_reach(&mut self, generation: &Generation) -> Result<Vec<Vec<Option<f64>>>, ()> {
        let count = usize::try_from(generation.count).map_err(|_| ())?;
        Ok(vec![vec![None; count]; generation.candidates.len()])
    }

    fn judge(&mut self, generation: &Generation) -> Result<Vec<Vec<CaseWorth>>, ()> {
        let first = usize::try_from(generation.first).map_err(|_| ())?;
        let count = usize::try_from(generation.count).map_err(|_| ())?;
        let of = |&id: &usize| {
            let places = self.order[first..first + count].iter();
            places.map(|&place| self.worth[id][place]).collect()
        };
        Ok(generation.ids.iter().map(of).collect())
    }

    fn describe(&self, _: &[FactorValue]) -> Vec<(String, serde_json::Value)> {
        Vec::new()
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let table = arguments.next().expect("the table of a generation");
    let orders: u64 = arguments
        .next()
        .map_or(10, |text| text.parse().expect("a number"));
    let results = ParquetResults::open(table.as_ref()).expect("a table");
    let margin = results
        .columns()
        .iter()
        .position(|column| column.key == "margin")
        .expect("a column of margins");
    let flat = RefCell::new(Vec::new());
    results
        .visit(&mut |_, case| {
            let margins = case.rows.iter().filter_map(|row| row.get(margin));
            flat.borrow_mut().push(CaseWorth {
                margin_mm: margins.map(f64::from).fold(f64::NEG_INFINITY, f64::max),
                works: case.rows.iter().any(|row| row.outcome == Outcome::Ok),
                tip_error_mm: None,
                lesion_probability: None,
            });
        })
        .expect("a sound table");
    let flat = flat.into_inner();
    let candidates: usize = arguments
        .next()
        .map_or(105, |text| text.parse().expect("a number"));
    let circumstances = flat.len() / candidates;
    let worth: Vec<Vec<CaseWorth>> = flat.chunks(circumstances).map(<[_]>::to_vec).collect();
    let objective = Objective::Margin { quantile: 0.05 };
    let samples = circumstances / 2;
    let grid = candidates * samples;
    let mut regrets = Vec::new();
    for seed in 0..orders {
        let mut random = SplitMix64::new(seed);
        let mut order: Vec<usize> = (0..circumstances).collect();
        for at in (1..circumstances).rev() {
            let bound = u32::try_from(at + 1).expect("few");
            order.swap(at, random.below(bound) as usize);
        }
        let held_out: Vec<usize> = order[samples..].to_vec();
        let mut judge = Stored {
            worth: &worth,
            order,
        };
        let plan = SearchPlan {
            objective,
            second: None,
            samples: samples as u64,
            fresh: 1,
            budget: grid as u64 / 3,
            seed,
        };
        let choices = Choices(vec![ChoiceAxis::Levels(candidates)]);
        let log = search(&plan, &choices, &mut judge).expect("an answer");
        let truth = |id: usize| {
            let cases: Vec<CaseWorth> = held_out.iter().map(|&place| worth[id][place]).collect();
            objective.score(&cases)
        };
        let answer = log.answer.expect("an answer");
        // What a grid of all candidates with the same circumstances would have chosen.
        let of_grid = |id: usize| {
            let places = judge.order[..samples].iter();
            let cases: Vec<CaseWorth> = places.map(|&place| worth[id][place]).collect();
            objective.score(&cases)
        };
        let chosen = (0..candidates)
            .max_by(|&a, &b| of_grid(a).total_cmp(&of_grid(b)))
            .expect("candidates");
        let regret = of_grid(chosen) - of_grid(answer.winner);
        println!(
            "order {seed}: {} of {grid} cases, {regret:.2} mm less than the grid's best by the same layouts, \
             {:.2} mm less than it by the others",
            log.cases,
            truth(chosen) - truth(answer.winner)
        );
        regrets.push(regret);
    }
    let good = regrets.iter().filter(|&&regret| regret <= 0.5).count();
    println!("{good} of {orders} within 0.5 mm");
}

//! All candidates of a search with their outcomes, and the requests for them.

use super::log::{
    Answer, CandidateLog, CandidateStanding, Decision, GenerationLog, Purpose, SearchLog,
};
use super::objective::{CaseWorth, Estimate, Objective};
use super::race::Race;
use super::{Candidate, Generation, Judge, SearchError, SearchPlan, Stream};

/// Candidates of a race, at most: all their pairs are compared.
const MOST_RACED: usize = 1000;

struct Entry {
    choice: Candidate,
    worth: Vec<CaseWorth>,
    /// Of cases out of reach, the most of their margin, mm.
    out_of_reach: Vec<Option<f64>>,
    fresh: Vec<CaseWorth>,
    /// Circumstances that count against the budget.
    charged: u64,
}

/// The outcome of a search with one objective.
pub(super) struct Found {
    /// Those with all circumstances, the best first.
    pub ranked: Vec<usize>,
    /// Those not significantly different from the first.
    pub equals: Vec<usize>,
    /// Eliminated by order alone.
    pub undecided: Vec<usize>,
}

pub(super) struct Pool<'a, J: Judge> {
    pub plan: &'a SearchPlan,
    judge: &'a mut J,
    entries: Vec<Entry>,
    log: SearchLog,
}

impl<'a, J: Judge> Pool<'a, J> {
    pub fn new(plan: &'a SearchPlan, judge: &'a mut J) -> Self {
        let objectives = std::iter::once(plan.objective).chain(plan.second);
        Self {
            plan,
            judge,
            entries: Vec::new(),
            log: SearchLog {
                objectives: objectives.collect(),
                samples: plan.samples,
                fresh: plan.fresh,
                budget: plan.budget,
                cases: 0,
                cases_spared: 0,
                ruled_out: 0,
                candidates: Vec::new(),
                generations: Vec::new(),
                decisions: Vec::new(),
                answer: None,
            },
        }
    }

    /// Number of a candidate; a known one keeps its own.
    pub fn add(&mut self, choice: Candidate) -> usize {
        let known = self.entries.iter().position(|each| each.choice == choice);
        known.unwrap_or_else(|| {
            self.entries.push(Entry {
                choice,
                worth: Vec::new(),
                out_of_reach: Vec::new(),
                fresh: Vec::new(),
                charged: 0,
            });
            self.entries.len() - 1
        })
    }

    /// Cases that count against the budget, including those eliminated by reachability, so that this elimination
    /// changes nothing else.
    pub fn charged(&self) -> u64 {
        self.entries.iter().map(|each| each.charged).sum()
    }

    /// Number of common circumstances that a candidate was evaluated under.
    pub fn known(&self, id: usize) -> u64 {
        self.entries[id].worth.len() as u64
    }

    fn worth(&self, id: usize, circumstances: u64) -> &[CaseWorth] {
        &self.entries[id].worth[..index(circumstances)]
    }

    /// Score of an objective by so many circumstances.
    pub fn score(&self, id: usize, circumstances: u64, objective: Objective) -> f64 {
        objective.score(self.worth(id, circumstances))
    }

    /// Some candidates by the first objective, the best first; of equals the one with more margin in its worst
    /// twentieth, then the one with more on average, then the earlier one.
    pub fn ranked(&self, ids: &[usize], circumstances: u64) -> Vec<usize> {
        const WORST: Objective = Objective::Margin { quantile: 0.05 };
        let mut keyed: Vec<(usize, [f64; 3])> = ids
            .iter()
            .map(|&id| {
                let worth = self.worth(id, circumstances);
                let mean = worth.iter().map(|each| each.margin_mm).sum::<f64>();
                (
                    id,
                    [self.plan.objective.score(worth), WORST.score(worth), mean],
                )
            })
            .collect();
        keyed.sort_by(|(a, of_a), (b, of_b)| {
            let pairs = of_b.iter().zip(of_a);
            let first = pairs
                .map(|(b, a)| b.total_cmp(a))
                .find(|order| order.is_ne());
            first.unwrap_or(std::cmp::Ordering::Equal).then(a.cmp(b))
        });
        keyed.into_iter().map(|(id, _)| id).collect()
    }

    /// Requests the missing cases of some candidates up to a number of circumstances.
    pub fn evaluate(
        &mut self,
        ids: &[usize],
        circumstances: u64,
        purpose: Purpose,
    ) -> Result<(), SearchError<J::Stop>> {
        let mut missing: Vec<usize> = ids.to_vec();
        missing.retain(|&id| self.known(id) < circumstances);
        missing.sort_unstable();
        missing.dedup();
        while let Some(&first) = missing.first() {
            // Those that are as far.
            let from = self.known(first);
            let (now, later): (Vec<usize>, Vec<usize>) =
                missing.into_iter().partition(|&id| self.known(id) == from);
            missing = later;
            let generation = self.generation(purpose, Stream::Common, &now, from, circumstances);
            let worth = self.ask(&generation)?;
            for (&id, worth) in now.iter().zip(worth) {
                self.entries[id].worth.extend(worth);
                self.charge(id, circumstances);
            }
            self.note(&generation, circumstances)?;
        }
        Ok(())
    }

    fn generation(
        &self,
        purpose: Purpose,
        stream: Stream,
        ids: &[usize],
        from: u64,
        until: u64,
    ) -> Generation {
        let candidates = ids.iter().map(|&id| self.entries[id].choice.clone());
        Generation {
            number: u32::try_from(self.log.generations.len()).expect("far fewer generations"),
            purpose,
            stream,
            first: from,
            count: until - from,
            ids: ids.to_vec(),
            candidates: candidates.collect(),
        }
    }

    fn ask(
        &mut self,
        generation: &Generation,
    ) -> Result<Vec<Vec<CaseWorth>>, SearchError<J::Stop>> {
        let worth = self.judge.judge(generation).map_err(SearchError::Stopped)?;
        self.log.cases += generation.cases();
        Ok(worth)
    }

    fn note(
        &mut self,
        generation: &Generation,
        circumstances: u64,
    ) -> Result<(), SearchError<J::Stop>> {
        let standings = generation.ids.iter().map(|&id| CandidateStanding {
            id,
            figures: self
                .log
                .objectives
                .iter()
                .map(|&objective| {
                    let worth = match generation.stream {
                        Stream::Common => self.worth(id, circumstances),
                        Stream::Fresh => &self.entries[id].fresh,
                    };
                    objective.figure(objective.score(worth))
                })
                .collect(),
        });
        let candidates = standings.collect();
        self.log.generations.push(GenerationLog {
            generation: generation.number,
            purpose: generation.purpose,
            stream: generation.stream,
            circumstances: [generation.first, generation.first + generation.count],
            cases: generation.cases(),
            candidates,
        });
        self.describe();
        self.judge.note(&self.log).map_err(SearchError::Stopped)
    }

    fn describe(&mut self) {
        let judge = &*self.judge;
        let objectives = &self.log.objectives;
        // What counts against the budget without having been computed.
        let spared = self
            .entries
            .iter()
            .map(|each| each.charged - each.worth.len() as u64);
        self.log.ruled_out = spared.clone().filter(|&cases| cases > 0).count();
        self.log.cases_spared = spared.sum();
        self.log.candidates = self
            .entries
            .iter()
            .enumerate()
            .map(|(id, entry)| CandidateLog {
                id,
                choice: judge.describe(&entry.choice),
                cases: entry.worth.len() as u64,
                figures: objectives
                    .iter()
                    .map(|objective| objective.estimate(&entry.worth))
                    .collect(),
                rate: Objective::Rate.estimate(&entry.worth),
            })
            .collect();
    }

    /// The best `keep` of some candidates, the best first, and those eliminated by reachability alone.
    ///
    /// Those out of reach in so many cases that their score is bounded wait until the others are evaluated. If `keep`
    /// of those are better than the bound, they are never evaluated: the answer is the same.
    pub fn best(
        &mut self,
        ids: &[usize],
        circumstances: u64,
        keep: usize,
        purpose: Purpose,
    ) -> Result<Best, SearchError<J::Stop>> {
        self.look_at_reach(ids, circumstances, purpose)?;
        let most = self.plan.objective.most(&[None]);
        let bound = |pool: &Self, id: usize| {
            let out_of_reach = &pool.entries[id].out_of_reach[..index(circumstances)];
            pool.plan.objective.most(out_of_reach)
        };
        let (open, bounded): (Vec<usize>, Vec<usize>) =
            ids.iter().partition(|&&id| bound(self, id) >= most);
        self.evaluate(&open, circumstances, purpose)?;
        let ranked = self.ranked(&open, circumstances);
        let last = ranked
            .get(keep.wrapping_sub(1))
            .map(|&id| self.score(id, circumstances, self.plan.objective));
        let (ruled_out, others): (Vec<usize>, Vec<usize>) = bounded
            .into_iter()
            .partition(|&id| last.is_some_and(|last| bound(self, id) < last));
        self.evaluate(&others, circumstances, purpose)?;
        for &id in &ruled_out {
            self.charge(id, circumstances);
        }
        let judged: Vec<usize> = open.into_iter().chain(others).collect();
        Ok(Best {
            ranked: self.ranked(&judged, circumstances),
            ruled_out,
        })
    }

    fn charge(&mut self, id: usize, circumstances: u64) {
        let charged = &mut self.entries[id].charged;
        *charged = circumstances.max(*charged);
    }

    fn look_at_reach(
        &mut self,
        ids: &[usize],
        circumstances: u64,
        purpose: Purpose,
    ) -> Result<(), SearchError<J::Stop>> {
        let reached = |pool: &Self, id: usize| pool.entries[id].out_of_reach.len() as u64;
        let mut missing: Vec<usize> = ids.to_vec();
        missing.retain(|&id| reached(self, id) < circumstances);
        while let Some(&first) = missing.first() {
            let from = reached(self, first);
            let (now, later): (Vec<usize>, Vec<usize>) = missing
                .into_iter()
                .partition(|&id| reached(self, id) == from);
            missing = later;
            let asked = self.generation(purpose, Stream::Common, &now, from, circumstances);
            let found = self
                .judge
                .out_of_reach(&asked)
                .map_err(SearchError::Stopped)?;
            for (&id, found) in now.iter().zip(found) {
                self.entries[id].out_of_reach.extend(found);
            }
        }
        Ok(())
    }

    /// Which of some candidates, the best first, are not significantly different from the best of them; shorter where
    /// they are too many to be compared.
    pub fn equals(&self, ranked: &[usize], circumstances: u64, alpha: f64) -> Vec<bool> {
        let raced = &ranked[..ranked.len().min(MOST_RACED)];
        let worth = raced.iter().map(|&id| self.worth(id, circumstances));
        let seed = self.plan.seed ^ circumstances;
        Race::new(self.plan.objective, worth.collect(), seed).equals(alpha)
    }

    /// Which is significantly better, by objective, then pair.
    pub fn told_apart(&self, ids: &[usize], circumstances: u64, alpha: f64) -> Vec<Vec<Vec<bool>>> {
        let objectives = self.log.objectives.iter();
        objectives
            .map(|&objective| {
                let worth = ids
                    .iter()
                    .map(|&id| self.worth(id, circumstances))
                    .collect();
                Race::new(objective, worth, self.plan.seed ^ circumstances).told_apart(alpha)
            })
            .collect()
    }

    /// Estimates of a candidate on held-out circumstances.
    pub fn fresh(&self, id: usize) -> Vec<Estimate> {
        let objectives = self.log.objectives.iter();
        let worth = &self.entries[id].fresh;
        objectives
            .map(|objective| objective.estimate(worth))
            .collect()
    }

    pub fn decide(&mut self, decision: Decision) {
        self.log.decisions.push(Decision {
            after: u32::try_from(self.log.generations.len()).expect("far fewer generations"),
            ..decision
        });
    }

    /// Evaluates candidates on held-out circumstances.
    pub fn judge_anew(&mut self, ids: &[usize]) -> Result<(), SearchError<J::Stop>> {
        let fresh = self.plan.fresh;
        let generation = self.generation(Purpose::Fresh, Stream::Fresh, ids, 0, fresh);
        let worth = self.ask(&generation)?;
        for (&id, worth) in ids.iter().zip(worth) {
            self.entries[id].fresh = worth;
        }
        self.note(&generation, fresh)
    }

    pub fn answer(&mut self, found: Found) {
        self.answer_with(found, Vec::new());
    }

    pub fn answer_with(&mut self, found: Found, front: Vec<super::FrontMember>) {
        let winner = found.ranked[0];
        let entry = &self.entries[winner];
        let objectives = self.log.objectives.iter();
        self.log.answer = Some(Answer {
            winner,
            figures: self.fresh(winner),
            rate: Objective::Rate.estimate(&entry.fresh),
            selected_by: objectives.map(|each| each.estimate(&entry.worth)).collect(),
            equals: found.equals,
            undecided: found.undecided,
            front,
        });
    }

    pub fn finish(mut self) -> Result<SearchLog, SearchError<J::Stop>> {
        self.describe();
        self.judge.note(&self.log).map_err(SearchError::Stopped)?;
        Ok(self.log)
    }
}

/// Those that are kept, and those that cannot be.
pub(super) struct Best {
    /// All evaluated ones, the best first.
    pub ranked: Vec<usize>,
    /// Never evaluated.
    pub ruled_out: Vec<usize>,
}

fn index(circumstances: u64) -> usize {
    usize::try_from(circumstances).expect("held in memory")
}

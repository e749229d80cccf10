//! What is seen where the phantom is moved to.

use std::borrow::Cow;
use std::cell::OnceCell;

use needlebench_input::Finding;
use needlebench_kinematics::Joints;
use needlebench_kinematics::ik::Configuration;
use needlebench_scenario::{MovedPhantom, PhantomMove, PhantomMoves, ResolvedScenario, Roll};
use needlebench_study::Outcome;

use super::proofs::Proofs;
use super::search::Verdict;
use crate::study::static_case::StaticWorker;

/// Rolls that are tried before a configuration is swept over all of them.
const MOST_ROLLS: usize = 6;

/// What is asked of a layout.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Question {
    /// Whether the configuration is feasible, with its posture recomputed.
    Aware,
    /// Whether an arm fixed in this posture has the required clearances.
    Unaware(Joints),
}

/// The layouts of one configuration, their phantom moved.
pub(super) struct Layouts<'a> {
    moves: &'a PhantomMoves<'a>,
    configuration: Configuration,
    worker: StaticWorker,
    /// None where every layout is evaluated.
    proofs: Option<Proofs<'a>>,
    /// Whether the roll is the plan's to choose.
    roll_is_free: bool,
    /// Rolls that were ok in some layout, the one that was last is the last. Where the goal fixes the roll,
    /// there is none.
    rolls_rad: Vec<f64>,
}

/// A layout, resolved as far as was asked for.
struct Layout<'a> {
    moves: &'a PhantomMoves<'a>,
    by: &'a PhantomMove,
    moved: Option<MovedPhantom>,
    resolved: OnceCell<Result<ResolvedScenario, Vec<Finding>>>,
}

impl Layout<'_> {
    /// All of it.
    ///
    /// # Errors
    /// What is seen where there is no such layout.
    fn resolved(&self) -> Result<&ResolvedScenario, Verdict> {
        let resolved = self.resolved.get_or_init(|| self.moves.resolved(self.by));
        resolved.as_ref().map_err(|findings| verdict_on(findings))
    }
}

/// What is seen where there is no such layout.
fn verdict_on(findings: &[Finding]) -> Verdict {
    match goal_at_fault(findings) {
        Some(_) => Verdict::Breaks,
        None => Verdict::Impossible,
    }
}

/// The goal's key at fault, where the move leaves the goal without a needle. A place that the phantom
/// cannot have, in the table or off it, is no evidence.
fn goal_at_fault(findings: &[Finding]) -> Option<String> {
    let keys = findings.iter().filter_map(|finding| finding.key.clone());
    keys.into_iter().find(|key| key.starts_with("goals"))
}

impl<'a> Layouts<'a> {
    pub fn new(
        moves: &'a PhantomMoves<'a>,
        configuration: Configuration,
        proofs: Option<Proofs<'a>>,
    ) -> Self {
        let roll = moves.base().goals.first().map(|goal| goal.roll);
        Self {
            moves,
            configuration,
            worker: StaticWorker::default(),
            proofs,
            roll_is_free: roll == Some(Roll::Free),
            rolls_rad: Vec::new(),
        }
    }

    pub fn moves(&self) -> &'a PhantomMoves<'a> {
        self.moves
    }

    /// Final positions of the joints with the phantom where it is; none where there is no posture.
    pub fn joints_rad(&mut self) -> Option<[f64; 6]> {
        let row = self.worker.row(self.moves.base(), self.configuration);
        row.measured.joints_rad
    }

    /// What is seen after a move.
    pub fn verdict(&mut self, question: Question, by: &PhantomMove) -> Verdict {
        let mut layout = Layout {
            moves: self.moves,
            by,
            moved: None,
            resolved: OnceCell::new(),
        };
        if self.proofs.is_some() {
            match self.moves.moved(by) {
                // Of one who does not lie as he did, distances do not follow travel.
                Ok(moved) => layout.moved = Some(moved).filter(|moved| moved.is_moved_as_one),
                Err(findings) => return verdict_on(&findings),
            }
        }
        let seen = match question {
            Question::Aware => self.aware(&layout),
            Question::Unaware(q) => self.unaware(&layout, &q),
        };
        seen.unwrap_or_else(|impossible| impossible)
    }

    fn aware(&mut self, layout: &Layout<'_>) -> Result<Verdict, Verdict> {
        // There is such a layout, or nothing is seen in it.
        if layout.moved.is_none() {
            layout.resolved()?;
        }
        // Mostly the posture at the roll of the layout before is ok too, and needs no sweep.
        for known in (0..self.rolls_rad.len()).rev() {
            if self.works_at(layout, self.rolls_rad[known])? {
                self.rolls_rad[known..].rotate_left(1);
                return Ok(Verdict::Holds);
            }
        }
        let row = self.worker.row(layout.resolved()?, self.configuration);
        Ok(match row.outcome {
            Outcome::Ok => {
                if let Some(roll_rad) = row.measured.roll_rad.filter(|_| self.roll_is_free) {
                    if self.rolls_rad.len() == MOST_ROLLS {
                        self.rolls_rad.remove(0);
                    }
                    self.rolls_rad.push(roll_rad);
                }
                Verdict::Holds
            }
            Outcome::Failed | Outcome::Rejected | Outcome::NotJudged => Verdict::Breaks,
            Outcome::Invalid => Verdict::Impossible,
        })
    }

    /// Whether the configuration is feasible at a roll.
    fn works_at(&mut self, layout: &Layout<'_>, roll_rad: f64) -> Result<bool, Verdict> {
        if let (Some(proofs), Some(moved)) = (&mut self.proofs, &layout.moved)
            && let Some(works) = proofs.works_at(moved, roll_rad)
        {
            return Ok(works);
        }
        let resolved = layout.resolved()?;
        let row = self.worker.row_at(resolved, self.configuration, roll_rad);
        Ok(row.outcome == Outcome::Ok)
    }

    fn unaware(&mut self, layout: &Layout<'_>, q: &Joints) -> Result<Verdict, Verdict> {
        if let (Some(proofs), Some(moved)) = (&mut self.proofs, &layout.moved)
            && let Some(keeps) = proofs.keeps_clear(moved, q)
        {
            return Ok(if keeps {
                Verdict::Holds
            } else {
                Verdict::Breaks
            });
        }
        let broken = self.worker.clearance_broken(layout.resolved()?, q);
        Ok(match broken {
            Ok(None) => Verdict::Holds,
            Ok(Some(_)) => Verdict::Breaks,
            Err(_) => Verdict::Impossible,
        })
    }

    /// The rule or criterion that is broken after a move, or the goal's key at fault.
    pub fn detail(&mut self, question: Question, by: &PhantomMove) -> String {
        let resolved = match self.moves.resolved(by) {
            Ok(resolved) => resolved,
            Err(findings) => return goal_at_fault(&findings).unwrap_or_default(),
        };
        let broken = match question {
            Question::Aware => Some(self.worker.row(&resolved, self.configuration).detail),
            Question::Unaware(q) => self.worker.clearance_broken(&resolved, &q).ok().flatten(),
        };
        broken.map(Cow::into_owned).unwrap_or_default()
    }
}

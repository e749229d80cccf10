//! The error budget of a configuration: covariance and bias of the needle, by source, analytically
//! and by Monte Carlo.

mod analytic;
mod breath;
mod monte_carlo;
mod path;
mod within;

use nalgebra::{Matrix3, Point3, Rotation3, SymmetricEigen, Vector3};
use needlebench_cell::Cell;
use needlebench_engine::Servo;
use needlebench_kinematics::registration::RegistrationError;
use needlebench_kinematics::trajectory::JointTrajectory;
use needlebench_kinematics::{Joints, Pose};
use needlebench_scenario::imperfections::{Breathing, Imperfections, SkinMarkers};
use needlebench_scenario::{Goal, ResolvedScenario};
use serde::Serialize;

use crate::bend::{Bends, NoBend};
use crate::truth::only;
use crate::{RestingFriction, SettleError, Source, Stage, resting_friction};
pub use path::{PathError, path_law};

/// What a budget is made for: one configuration of one goal.
#[derive(Debug, Clone, Copy)]
pub struct BudgetCase<'a> {
    /// The nominal cell.
    pub cell: &'a Cell,
    /// The goal.
    pub goal: &'a Goal,
    /// The phantom's planned place, if there is one.
    pub place: Option<&'a Pose>,
    /// The servo. Where it assumes another gravity than the cell has, the bias of every source has what that does.
    pub servo: &'a Servo,
    /// All imperfections.
    pub imperfections: &'a Imperfections,
    /// The motion that ends in the configuration: friction remembers it.
    pub trajectory: &'a JointTrajectory,
    /// Step of the servo, s.
    pub timestep_s: f64,
    /// How far the arm is commanded to hold the needle off where the goal wants it, at the depths of skin and target, world, m:
    /// see [`Self::as_held`].
    pub held_off_m: [Vector3<f64>; 2],
}

/// What the inverse kinematics leaves of a pose is less, m.
const HELD_M: f64 = 1e-9;

impl<'a> BudgetCase<'a> {
    /// Of a scenario's cell, its patient where it is planned, and its step.
    pub fn of(
        resolved: &'a ResolvedScenario,
        goal: &'a Goal,
        servo: &'a Servo,
        imperfections: &'a Imperfections,
        trajectory: &'a JointTrajectory,
    ) -> Self {
        let place = resolved.phantom.as_ref();
        Self {
            cell: &resolved.cell,
            goal,
            place: place.map(|placed| &placed.world_from_phantom),
            servo,
            imperfections,
            trajectory,
            timestep_s: resolved.scenario.engines.timestep_ms * 1e-3,
            held_off_m: [Vector3::zeros(); 2],
        }
    }

    /// The same where the motion may end beside the goal, as one of another planner does: what it is off by is a bias of all
    /// sources together, and of no source alone.
    pub fn as_held(self) -> Self {
        let goal = self.goal.world_from_guide_exit;
        let planned = self
            .depths_m()
            .map(|depth_m| goal * Point3::new(0.0, 0.0, depth_m));
        let held = self.planned();
        let off_m = [0, 1].map(|index| held[index] - planned[index]);
        Self {
            held_off_m: off_m.map(|off_m| {
                if off_m.norm() > HELD_M {
                    off_m
                } else {
                    Vector3::zeros()
                }
            }),
            ..self
        }
    }

    /// Of a part of what is off alone.
    fn of_a_part(self) -> Self {
        Self {
            held_off_m: [Vector3::zeros(); 2],
            ..self
        }
    }
}

impl BudgetCase<'_> {
    /// Joint positions that the arm holds.
    fn target(&self) -> Joints {
        self.trajectory.end()
    }

    /// Pose of the guide's exit that the controller assumes, world.
    fn world_from_exit(&self) -> Pose {
        self.cell.robot.world_from_flange(&self.target()) * self.cell.tool.flange_from_guide_exit
    }

    /// Turns world vectors into the axes of the budget.
    fn axes_from_world(&self) -> Rotation3<f64> {
        let world_from_goal = self.goal.world_from_guide_exit.rotation;
        world_from_goal.inverse().to_rotation_matrix()
    }

    /// Depths beyond the guide's exit at which the needle is looked at: skin and target, m.
    fn depths_m(&self) -> [f64; 2] {
        [
            self.goal.standoff_m.unwrap_or(0.0),
            self.goal.insertion_length_m,
        ]
    }

    /// Where the needle should be at those depths, world.
    fn planned(&self) -> [Point3<f64>; 2] {
        let exit = self.world_from_exit();
        self.depths_m()
            .map(|depth_m| exit * Point3::new(0.0, 0.0, depth_m))
    }

    /// How the needle bends, if it does so in tissue: the same for all sources and configurations.
    fn bends(&self) -> Result<Option<Bends>, NoBend> {
        let needle = self.imperfections.tissue();
        needle
            .map(|needle| Bends::new(needle, self.goal))
            .transpose()
    }

    fn friction(&self, imperfections: &Imperfections) -> Option<RestingFriction> {
        let friction =
            crate::truth::joint_friction(imperfections.friction.as_ref()?, Joints::repeat(1.0));
        Some(resting_friction(&friction, self.trajectory))
    }
}

/// Why there is no budget.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BudgetError {
    /// The markers determine no pose.
    #[error(transparent)]
    Registration(#[from] RegistrationError),
    /// The arm does not come to rest.
    #[error(transparent)]
    Settle(#[from] SettleError),
    /// The needle.
    #[error(transparent)]
    Bend(#[from] NoBend),
}

/// Bias and covariance of a point of the needle, real minus where it should be.
///
/// Axes are those of the goal's guide exit at roll 0, the same for all configurations: x and y lateral to the needle, x
/// as near to the patient's head as it gets, z along the insertion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Moments {
    /// Mean, m.
    pub bias_m: [f64; 3],
    /// Covariance, m^2, row by row.
    pub covariance_m2: [[f64; 3]; 3],
    /// Root mean square distance, m: `sqrt(|bias|^2 + trace)`.
    pub rms_m: f64,
    /// Root mean square distance lateral to the needle, m.
    pub lateral_rms_m: f64,
}

impl Moments {
    pub(crate) fn new(bias: &Vector3<f64>, covariance: &Matrix3<f64>) -> Self {
        let across = |k: usize| bias[k] * bias[k] + covariance[(k, k)];
        Self {
            bias_m: (*bias).into(),
            covariance_m2: rows(covariance),
            rms_m: (bias.norm_squared() + covariance.trace()).sqrt(),
            lateral_rms_m: (across(0) + across(1)).sqrt(),
        }
    }

    /// Covariance, m^2.
    pub fn covariance(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|row, column| self.covariance_m2[row][column])
    }

    /// Mean, m.
    pub fn bias(&self) -> Vector3<f64> {
        Vector3::from(self.bias_m)
    }

    /// Standard deviations along the principal axes, m, largest first, and those axes.
    pub fn principal(&self) -> [(f64, Vector3<f64>); 3] {
        let eigen = SymmetricEigen::new(self.covariance());
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        order.map(|k| {
            (
                eigen.eigenvalues[k].max(0.0).sqrt(),
                eigen.eigenvectors.column(k).into_owned(),
            )
        })
    }
}

/// The two ways to the moments of one point, and how far they are apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PointBudget {
    /// By Jacobians.
    pub analytic: Moments,
    /// By many draws, each settled and measured as a run is; none if no samples were asked for.
    pub monte_carlo: Option<Moments>,
    /// Distance that the point stays within in 95 % of all cases, m, by the analytic moments with the breath and the
    /// play in the guide as they are distributed: known to 0.2 %. Of all sources together alone, and none without
    /// samples, which it is compared with.
    pub radius_95_m: Option<f64>,
    /// The draws' own, m: the two between which it is with a confidence of 95 %.
    pub drawn_radius_95_m: Option<[f64; 2]>,
    /// Frobenius norm of the difference of the covariances over that of the analytic one; none
    /// without samples or without spread.
    pub covariance_difference: Option<f64>,
    /// Distance of the two biases, m.
    pub bias_difference_m: Option<f64>,
}

/// What the size of a source rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Basis {
    /// A covariance that was measured.
    Measured,
    /// What the scenario's block assumes.
    Assumed,
}

/// Budget of one source, or of all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SourceBudget {
    /// The source; none for all together.
    pub source: Option<Source>,
    /// Of the localisation of markers and target, in a budget of which either was measured: what it rests on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub basis: Option<Basis>,
    /// Needle where it should enter the skin (at the guide's exit without a phantom).
    pub at_skin: PointBudget,
    /// Needle's tip at the end of the insertion.
    pub at_target: PointBudget,
    /// How both go together; none where their moments alone are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skin_with_target: Option<CrossBudget>,
}

/// Covariance of what is off at the skin with what is off at the target, m^2, row by row: rows are of the skin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CrossBudget {
    /// By Jacobians.
    pub analytic_m2: [[f64; 3]; 3],
    /// By many draws; none if no samples were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub monte_carlo_m2: Option<[[f64; 3]; 3]>,
}

fn rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

impl SourceBudget {
    /// What people call the source: its name, and of localisations in a budget of which one was measured what they
    /// rest on.
    pub fn in_words(&self) -> &'static str {
        let markers = match self.source {
            None => return "all",
            Some(Source::Registration) => true,
            Some(Source::Imaging) => false,
            Some(other) => return other.name(),
        };
        match (self.basis, markers) {
            (Some(Basis::Measured), true) => "marker localisation, measured",
            (Some(Basis::Assumed), true) => "marker localisation, assumed",
            (Some(Basis::Measured), false) => "target localisation, measured",
            (Some(Basis::Assumed), false) => "target localisation, assumed",
            (None, true) => Source::Registration.name(),
            (None, false) => Source::Imaging.name(),
        }
    }
}

/// How many draws a budget takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Samples {
    /// For all sources together; 0 for the analytic budget alone.
    pub total: usize,
    /// For each source alone.
    pub each_source: usize,
}

/// Error budget of one configuration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorBudget {
    /// Samples of the Monte Carlo for all sources together.
    pub samples: usize,
    /// Each source as if it were alone.
    pub sources: Vec<SourceBudget>,
    /// All together. Not quite the sum: elastic joints sag under a wrong payload too.
    pub total: SourceBudget,
    /// Source with the largest mean square at the target.
    pub dominant: Option<Source>,
    /// Of the needle's line at the target before it goes in, in a phantom that lies still: without
    /// markers that move, bending, indentation and breathing. By Jacobians; none in a budget of totals.
    pub before_insertion: Option<Moments>,
    /// Of what tissue does to the needle, at the target: bending with play, and indentation. None in a budget of totals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_tissue: Option<Moments>,
    /// Of the breath, at the target: how it is held, and markers that move with the skin. None in a budget of totals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of_breath: Option<Moments>,
    /// At the target of a patient who breathes freely, where the breath is held in the rest of the
    /// budget. By Jacobians; none in a budget of totals.
    pub breathing_freely: Option<Moments>,
}

impl ErrorBudget {
    /// What people call the source with the largest mean square at the target.
    pub fn dominant_in_words(&self) -> Option<&'static str> {
        let dominant = self.dominant?;
        let own = self
            .sources
            .iter()
            .find(|each| each.source == Some(dominant));
        Some(own.map_or(dominant.name(), SourceBudget::in_words))
    }
}

/// The budget of a configuration; `seed` is that of its draws.
///
/// # Errors
/// [`BudgetError`].
pub fn budget(
    case: &BudgetCase<'_>,
    samples: Samples,
    seed: u64,
) -> Result<ErrorBudget, BudgetError> {
    let bends = case.bends()?;
    let bends = bends.as_ref();
    let part = case.of_a_part();
    let sources = Source::ALL
        .into_iter()
        .filter(|source| source.is_in(case.imperfections))
        .map(|source| source_budget(&part, Some(source), bends, samples.each_source, seed))
        .collect::<Result<Vec<_>, _>>()?;
    let dominant = sources
        .iter()
        .max_by(|a, b| {
            let rms = |each: &SourceBudget| each.at_target.analytic.rms_m;
            rms(a).total_cmp(&rms(b))
        })
        .and_then(|each| each.source);
    let of_stage = |stage: Stage| -> Result<Option<Moments>, BudgetError> {
        let all = only(case.imperfections, |source| source.stage() == stage);
        let [_, at_target] = analytic::moments(&part, &all, bends)?;
        Ok(Some(at_target))
    };
    Ok(ErrorBudget {
        sources,
        dominant,
        in_tissue: of_stage(Stage::InTissue)?,
        of_breath: of_stage(Stage::Breath)?,
        ..totals(case, bends, samples.total, seed)?
    })
}

/// The same of all sources together alone.
///
/// # Errors
/// [`BudgetError`].
pub fn total_budget(
    case: &BudgetCase<'_>,
    samples: usize,
    seed: u64,
) -> Result<ErrorBudget, BudgetError> {
    totals(case, case.bends()?.as_ref(), samples, seed)
}

fn totals(
    case: &BudgetCase<'_>,
    bends: Option<&Bends>,
    samples: usize,
    seed: u64,
) -> Result<ErrorBudget, BudgetError> {
    let at_target = |imperfections: &Imperfections| -> Result<Moments, BudgetError> {
        let [_, at_target] = analytic::moments(case, imperfections, bends)?;
        Ok(at_target)
    };
    Ok(ErrorBudget {
        samples,
        sources: Vec::new(),
        total: source_budget(case, None, bends, samples, seed)?,
        dominant: None,
        before_insertion: Some(at_target(&only(
            case.imperfections,
            Source::is_before_insertion,
        ))?),
        in_tissue: None,
        of_breath: None,
        breathing_freely: breathing_freely(case.imperfections)
            .map(|free| at_target(&free))
            .transpose()?,
    })
}

/// The budget of a source, or of all.
fn source_budget(
    case: &BudgetCase<'_>,
    source: Option<Source>,
    bends: Option<&Bends>,
    samples: usize,
    seed: u64,
) -> Result<SourceBudget, BudgetError> {
    let imperfections = source.map_or_else(
        || case.imperfections.clone(),
        |source| only(case.imperfections, |each| each == source),
    );
    let errors = analytic::errors(case, &imperfections, bends)?;
    let [(_, skin), (_, target)] = &errors;
    let cross = analytic::cross(case, &imperfections, [skin, target])?;
    let sampled = if samples > 1 {
        Some(monte_carlo::moments(case, &imperfections, samples, seed)?)
    } else {
        None
    };
    let point = |index: usize| {
        let (analytic, errors) = &errors[index];
        let analytic = *analytic;
        let sampled = sampled.as_ref().map(|drawn| drawn.points[index]);
        let size = analytic.covariance().norm();
        PointBudget {
            analytic,
            monte_carlo: sampled.map(|(moments, _)| moments),
            radius_95_m: (sampled.is_some() && source.is_none()).then(|| errors.within_m(0.95)),
            drawn_radius_95_m: sampled.map(|(_, between_m)| between_m),
            covariance_difference: sampled
                .filter(|_| size > LEAST_VARIANCE_M2)
                .map(|(moments, _)| (moments.covariance() - analytic.covariance()).norm() / size),
            bias_difference_m: sampled
                .map(|(moments, _)| (moments.bias() - analytic.bias()).norm()),
        }
    };
    Ok(SourceBudget {
        source,
        basis: source.and_then(|source| basis(source, case.imperfections)),
        at_skin: point(0),
        at_target: point(1),
        skin_with_target: Some(CrossBudget {
            analytic_m2: rows(&cross),
            monte_carlo_m2: sampled.as_ref().map(|drawn| rows(&drawn.cross_m2)),
        }),
    })
}

/// What a localisation rests on, where that is not the same for all.
fn basis(source: Source, all: &Imperfections) -> Option<Basis> {
    let is_measured = |source: Source| source.is_measured_in(all);
    let own = is_measured(source)?;
    let any = Source::ALL.into_iter().filter_map(is_measured);
    let mut any = any.filter(|measured| *measured);
    any.next()?;
    Some(if own { Basis::Measured } else { Basis::Assumed })
}

/// The same patient with no breath held; none who does not hold it, or does not breathe.
fn breathing_freely(imperfections: &Imperfections) -> Option<Imperfections> {
    let held = imperfections
        .breathing
        .filter(|breathing| breathing.phase_spread.is_some())?;
    let free = |breathing: Breathing| Breathing {
        phase_spread: None,
        drift_m: None,
        ..breathing
    };
    Some(Imperfections {
        breathing: Some(free(held)),
        skin_markers: imperfections.skin_markers.clone().map(|skin| SkinMarkers {
            breathing: free(skin.breathing),
            ..skin
        }),
        ..imperfections.clone()
    })
}

/// Analytic moments of all sources together, at the skin and at the target: those of
/// [`ErrorBudget::total`], without the sources one by one.
///
/// # Errors
/// [`BudgetError`].
pub fn analytic_total(case: &BudgetCase<'_>) -> Result<[Moments; 2], BudgetError> {
    analytic::moments(case, case.imperfections, case.bends()?.as_ref())
}

/// A variance below this is none, m^2: a nanometre squared.
const LEAST_VARIANCE_M2: f64 = 1e-18;

//! The voxels around the planned target: they take a second to prepare, and are needed at every drag.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use nalgebra::{Point3, UnitVector3};
use needlebench_patient::routes::FreeRoutes;
use needlebench_routing::{
    Anatomy, Candidate, Obstacle, RouteRules, VoxelAnatomy, bent_reason, judge,
};
use serde::Serialize;

/// The voxels around the target of the last request.
#[derive(Default)]
pub(crate) struct LastTarget(Mutex<Option<Arc<Around>>>);

/// What is known around a target.
pub(crate) struct Around {
    /// Name of the goal.
    pub goal: String,
    /// The target, frame `phantom`, m.
    pub target: Point3<f64>,
    /// The voxels.
    pub anatomy: VoxelAnatomy,
    /// The path rules.
    pub rules: RouteRules,
    /// Evaluated directions, once they are.
    pub free: OnceLock<FreeRoutes>,
}

/// Result of the path rules for a needle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judged {
    /// Whether it is admissible.
    pub free: bool,
    /// The first rule that it violates, in words.
    pub broken: Option<&'static str>,
    /// What the needle as tissue bends it comes too close to, where that is the rule.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bent: Option<String>,
    /// The value of that rule, in `unit`.
    pub value: Option<f64>,
    /// Its limit.
    pub limit: Option<f64>,
    /// Whether the limit is a minimum.
    pub is_least: bool,
    /// `m`, `rad` or `1`.
    pub unit: Option<&'static str>,
    /// Odds ratio of a pneumothorax relative to a path without risk factors.
    pub odds_ratio: Option<f64>,
    /// Bone, vessels and organs that are not labelled: distances from these are not evaluated.
    pub unknown: Vec<&'static str>,
}

impl LastTarget {
    pub(crate) fn get(&self) -> Option<Arc<Around>> {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    pub(crate) fn keep(&self, around: &Arc<Around>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(around));
    }

    pub(crate) fn forget(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Result of the path rules for a needle, if its target is that of the last request.
    pub(crate) fn judged(
        &self,
        goal: &str,
        target: &Point3<f64>,
        outwards: &UnitVector3<f64>,
    ) -> Option<Judged> {
        let around = self.get()?;
        if around.goal != goal || (around.target - target).norm() > 1e-9 {
            return None;
        }
        let Candidate {
            outcome, straight, ..
        } = judge(&around.anatomy, &around.rules, outwards);
        let bent = straight.and_then(|route| bent_reason(&around.anatomy, &around.rules, &route));
        let (route, refusal) = (outcome.as_ref().ok(), outcome.as_ref().err());
        let unseen = |obstacle: &Obstacle| !around.anatomy.knows(*obstacle);
        Some(Judged {
            free: route.is_some(),
            broken: refusal.map(|refusal| refusal.rule.in_words()),
            bent,
            value: refusal.map(|refusal| refusal.value),
            limit: refusal.map(|refusal| refusal.limit),
            is_least: refusal.is_some_and(|refusal| refusal.rule.is_least()),
            unit: refusal.map(|refusal| refusal.rule.unit()),
            odds_ratio: route.map(|route| route.risk.odds_ratio),
            unknown: Obstacle::ALL
                .into_iter()
                .filter(unseen)
                .map(Obstacle::name)
                .collect(),
        })
    }
}

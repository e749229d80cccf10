//! From goals to candidates and motions: which configurations are feasible, and why the others are not.
//!
//! For each goal all eight configurations get a [`ConfigurationPlan`], never fewer: one that is infeasible carries the
//! rules that reject it, the first failing one first.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod blocked;
pub mod excitation;
mod family;
mod given;
pub mod iso9283;
mod limits;
mod margin;
mod motion;
mod motion_plan;
mod plan;
mod planner;
mod press;
mod reach;
mod rejection;
mod route;
mod transfer;

pub use family::{Aim, Best, EDGE_RAD, Edge, Family, Member, Merit, RollRange};
pub use given::{GivenMotion, Held, Nearest};
pub use limits::{ByClass, ClassLimit, ClassLimits, Shortfall};
pub use margin::{ClassMargin, LimitedBy, Margin, SearchEnd, Straight};
pub use motion::MotionChecker;
pub use motion_plan::{ConfigurationPlan, SearchEffort};
pub use plan::GoalPlan;
pub use planner::{Candidate, Planner, PostureMargins};
pub use press::{PressError, PressPlan, stage_press};
pub use reach::out_of_reach_m;
pub use rejection::Rejection;
pub use route::{
    NeedleStructure, RouteClearance, RouteJudgement, bent_route, crossed_fissures, judge_route,
    judge_route_beside, judged_straight, judged_tissues, needle_route, needle_structures,
    route_rejection,
};

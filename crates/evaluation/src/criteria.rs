//! Criteria of a scenario on the values of a configuration.

use needlebench_cell::scenario::{ClearanceCriteria, CriteriaSection};

use crate::adjudication::sentence;
use crate::report::{ConfigurationReport, CriterionResult};

/// A limit that a value has to keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criterion {
    /// Key of the scenario's `[criteria]`.
    pub key: &'static str,
    /// Limit, in SI units.
    pub limit: f64,
    /// Unit.
    pub unit: &'static str,
    /// The value has to be at least the limit instead of at most.
    pub at_least: bool,
}

impl Criterion {
    fn at_most(
        key: &'static str,
        limit: Option<f64>,
        scale: f64,
        unit: &'static str,
    ) -> Option<Self> {
        limit.map(|limit| Self {
            key,
            limit: limit * scale,
            unit,
            at_least: false,
        })
    }

    /// Whether a value meets it; a value that is missing does not.
    fn met_by(&self, value: Option<f64>) -> bool {
        value.is_some_and(|value| {
            if self.at_least {
                value >= self.limit
            } else {
                value <= self.limit
            }
        })
    }
}

const MM: f64 = 1e-3;

/// Checks a configuration that works against all criteria.
///
/// Values of the engines are checked for each engine that ran, clearances over all of them and by
/// their proven lower bounds.
pub fn check_configuration(
    goal: &str,
    configuration: &ConfigurationReport,
    criteria: &CriteriaSection,
    both_engines_ran: bool,
) -> Vec<CriterionResult> {
    let mut results = Vec::new();
    let mut check =
        |criterion: Option<Criterion>, engine: Option<&str>, value: Option<f64>, detail: String| {
            let Some(criterion) = criterion else { return };
            results.push(CriterionResult {
                goal: goal.to_owned(),
                label: Some(configuration.label.to_owned()),
                engine: engine.map(str::to_owned),
                criterion: criterion.key.to_owned(),
                value,
                limit: Some(criterion.limit),
                unit: criterion.unit,
                pass: criterion.met_by(value),
                detail,
            });
        };
    let most = Criterion::at_most;
    for (engine, report) in &configuration.engines {
        let (needle, motion) = (&report.needle, &report.motion);
        let engine = Some(engine.as_str());
        check(
            most(
                "max_tip_position_error_mm",
                criteria.max_tip_position_error_mm,
                MM,
                "m",
            ),
            engine,
            Some(needle.tip_position_error_m),
            String::new(),
        );
        check(
            most(
                "max_needle_angle_error_deg",
                criteria.max_needle_angle_error_deg.map(f64::to_radians),
                1.0,
                "rad",
            ),
            engine,
            Some(needle.needle_angle_error_rad),
            String::new(),
        );
        check(
            most(
                "max_guide_position_error_mm",
                criteria.max_guide_position_error_mm,
                MM,
                "m",
            ),
            engine,
            Some(needle.guide_position_error_m),
            String::new(),
        );
        check(
            most(
                "max_settling_time_s",
                criteria.max_settling_time_s,
                1.0,
                "s",
            ),
            engine,
            motion.settling_time_s,
            format!("into a band of {:.4} mm", criteria.settling_band_mm),
        );
        check(
            most(
                "max_peak_torque_ratio",
                criteria.max_peak_torque_ratio,
                1.0,
                "1",
            ),
            engine,
            Some(motion.peak_torque_ratio),
            String::new(),
        );
        if !criteria.allow_contact {
            let contact = &motion.contact;
            check(
                Some(Criterion {
                    key: "allow_contact",
                    limit: 0.0,
                    unit: "N",
                    at_least: false,
                }),
                engine,
                Some(if contact.occurred {
                    contact.peak_force_n.max(f64::MIN_POSITIVE)
                } else {
                    0.0
                }),
                contact.first_pair.as_ref().map_or(String::new(), |[a, b]| {
                    format!(
                        "{a} touches {b} at {:.2} s",
                        contact.first_time_s.unwrap_or(0.0)
                    )
                }),
            );
        }
    }
    if both_engines_ran {
        let difference = configuration.engine_difference;
        check(
            most(
                "max_engine_difference_peak_mm",
                criteria.max_engine_difference_peak_mm,
                MM,
                "m",
            ),
            None,
            difference.map(|difference| difference.peak_tip_m),
            String::new(),
        );
        check(
            most(
                "max_engine_difference_settled_mm",
                criteria.max_engine_difference_settled_mm,
                MM,
                "m",
            ),
            None,
            difference.map(|difference| difference.settled_tip_m),
            String::new(),
        );
        for judged in configuration
            .adjudication
            .iter()
            .flat_map(|each| &each.quantities)
        {
            check(
                Some(Criterion {
                    key: judged.quantity,
                    limit: judged.limit,
                    unit: judged.unit,
                    at_least: false,
                }),
                None,
                Some(judged.value),
                sentence(judged).unwrap_or_default(),
            );
        }
    }
    let budget = configuration
        .budget
        .as_ref()
        .map(|budget| &budget.total.at_target.analytic);
    for (key, limit_mm, value) in [
        (
            "max_tip_rms_mm",
            criteria.max_tip_rms_mm,
            budget.map(|moments| moments.rms_m),
        ),
        (
            "max_tip_lateral_rms_mm",
            criteria.max_tip_lateral_rms_mm,
            budget.map(|moments| moments.lateral_rms_m),
        ),
    ] {
        let detail = configuration.budget_failure.clone().unwrap_or_default();
        check(most(key, limit_mm, MM, "m"), None, value, detail);
    }
    let room = configuration.room.as_ref();
    let mut at_least = |key, limit: Option<f64>, unit, value: Option<f64>, detail: String| {
        let criterion = limit.map(|limit| Criterion {
            key,
            limit,
            unit,
            at_least: true,
        });
        check(criterion, None, value, detail);
    };
    at_least(
        "min_free_fraction",
        criteria.min_free_fraction,
        "1",
        room.map(|room| room.free_fraction),
        String::new(),
    );
    at_least(
        "min_sight_fraction",
        criteria.min_sight_fraction,
        "1",
        room.map(|room| room.sight_fraction),
        String::new(),
    );
    at_least(
        "min_hand_cone_deg",
        criteria.min_hand_cone_deg.map(f64::to_radians),
        "rad",
        room.map(|room| room.hand_cone_half_angle_rad),
        room.and_then(|room| room.hand_cone_blocker.as_ref())
            .map_or(String::new(), |blocker| format!("blocked by {blocker}")),
    );
    for (class, key, limit_mm) in clearance_limits(&criteria.min_clearance_mm) {
        // A class that the cell has no part for cannot be violated.
        let Some(found) = configuration.clearance.classes.get(class) else {
            continue;
        };
        check(
            limit_mm.map(|mm| Criterion {
                key,
                limit: mm * MM,
                unit: "m",
                at_least: true,
            }),
            None,
            // What was merely sampled is no proof.
            Some(found.certified_lower_bound_m.unwrap_or(found.minimum_m)),
            format!(
                "{} and {} in the {}",
                found.pair[0], found.pair[1], found.phase
            ),
        );
    }
    if let Some(events) = &configuration.events {
        results.extend(events.checks.iter().cloned());
    }
    results
}

/// Class, key of the scenario's `[criteria]`, and limit in mm.
pub fn clearance_limits(
    limits: &ClearanceCriteria,
) -> [(&'static str, &'static str, Option<f64>); 9] {
    macro_rules! limit {
        ($class:literal, $limit:expr) => {
            ($class, concat!("min_clearance_mm.", $class), $limit)
        };
    }
    [
        limit!("robot_phantom", limits.robot_phantom),
        limit!("robot_table", limits.robot_table),
        limit!("robot_gantry", limits.robot_gantry),
        limit!("robot_mount", limits.robot_mount),
        limit!("self", limits.self_collision),
        limit!("tool_phantom", limits.tool_phantom),
        limit!("guide_standoff", limits.guide_standoff),
        limit!("needle_corridor", limits.needle_corridor),
        limit!("needle_route", limits.needle_route),
    ]
}

//! Weights and utilities of the ranking: the scenario's `[ranking]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use needlebench_input::{Finding, TomlText};

/// Declares the section: each key once, with what it is and its defaults, in the order of reports.
macro_rules! ranking_section {
    ($($(#[doc = $doc:literal])+ $key:ident: $default:expr,)+) => {
        /// Ranking of the feasible configurations: a weighted mean of utilities from 0 to 1.
        ///
        /// A metric's utility is 0 at `worst`, 0.5 at `half`, 1 at `best`, linear in between and constant
        /// outside. The weights need not add up to 1. A metric that was not measured is ignored.
        #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct RankingSection {
            $($(#[doc = $doc])+ pub $key: MetricRanking,)+
        }

        /// The keys with their defaults.
        const DEFAULTS: &[(&str, Aim)] = &[$((stringify!($key), $default)),+];

        impl RankingSection {
            /// What the scenario says of each key, in the order of [`DEFAULTS`].
            fn given(&self) -> [MetricRanking; DEFAULTS.len()] {
                [$(self.$key),+]
            }
        }
    };
}

ranking_section! {
    /// Minimum clearance of arm and tool from their surroundings, mm: the certified bound along the simulated motion.
    /// Default weight 3, worst 0, half 20, best 100: contact ends the procedure, 20 covers model errors and patient
    /// motion, and nobody works closer to the arm than 100.
    clearance_mm: Aim::bent(3.0, 0.0, 20.0, 100.0),
    /// Minimum self-clearance of arm and tool, mm. Default weight 0.5, worst 0, best 10: in most postures the arm's
    /// shape limits it to 10.
    self_clearance_mm: Aim::straight(0.5, 0.0, 10.0),
    /// Minimum clearance of the access zone behind the guide during the hold, mm. Default weight 1, worst 0, half 10,
    /// best 50: a hand works there.
    needle_corridor_mm: Aim::bent(1.0, 0.0, 10.0, 50.0),
    /// Tip error, mm: RMS over the arm and patient population where it is computed (`tip_rms`), else the settled
    /// tip error of the worst engine (`tip_error`). Default weight 2, worst 2.7, best 0: 2.7 is the mean of the
    /// maximum errors that 153 interventional radiologists accept.
    tip_error_mm: Aim::straight(2.0, 2.7, 0.0),
    /// Displacement of the needle tip under independent joint errors, mm/mrad. Default weight 1, worst 1.5, best 0.5:
    /// an arm of 0.5 m stretched and folded.
    tip_sensitivity_mm_mrad: Aim::straight(1.0, 1.5, 0.5),
    /// Joint-limit margin of the final posture; 1 in the middle of every range. Default weight 1, worst 0, best 0.5.
    joint_margin: Aim::straight(1.0, 0.0, 0.5),
    /// Minimum of `|sin q5|` and `|sin q3|` of the final posture. Default weight 1, worst 0, best 0.5: 30 degrees from
    /// the singularity.
    singularity_margin: Aim::straight(1.0, 0.0, 0.5),
    /// Distance of wrist 2 from the singular cylinder about the shoulder axis, mm. Default weight 0.5, worst 0, best
    /// 100.
    shoulder_margin_mm: Aim::straight(0.5, 0.0, 100.0),
    /// Motion time until the arm is in its final posture, s. Default weight 0.5, worst 20, best 2: short compared with
    /// the minutes of an insertion.
    motion_time_s: Aim::straight(0.5, 20.0, 2.0),
    /// Maximum ratio of joint torque to its limit. Default weight 0.5, worst 1, best 0.3: holding the arm against
    /// gravity needs 0.3.
    peak_torque_ratio: Aim::straight(0.5, 1.0, 0.3),
    /// Free share of the space around the entry point. Default weight 1, worst 0, best 1.
    free_fraction: Aim::straight(1.0, 0.0, 1.0),
    /// Unobstructed share of the lines of sight to the entry point. Default weight 1, worst 0, best 1.
    sight_fraction: Aim::straight(1.0, 0.0, 1.0),
    /// Half-angle of the free hand cone behind the guide, deg. Default weight 1, worst 0, best 45.
    hand_cone_deg: Aim::straight(1.0, 0.0, 45.0),
    /// Match with the physician's preferences: mean of the preferred elbow position, 0 or 1, and the free share of the
    /// preferred side. Default weight 1, worst 0, best 1.
    preference: Aim::straight(1.0, 0.0, 1.0),
}

/// Weight and anchors of one metric; keys that are not given keep their defaults.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MetricRanking {
    /// Weight relative to the other metrics; 0 excludes the metric.
    #[schemars(range(min = 0.0, max = 1e6), extend("x-hint" = "weights are relative: 0 excludes a metric, 2 counts twice as much as 1"))]
    pub weight: Option<f64>,
    /// Value of utility 0, in the unit of the metric's name.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub worst: Option<f64>,
    /// Value of utility 0.5, between the other two. Default, if `worst` or `best` is given: their midpoint.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub half: Option<f64>,
    /// Value of utility 1, at which the utility saturates.
    #[schemars(range(min = -1e6, max = 1e6))]
    pub best: Option<f64>,
}

/// Weight and utility of a metric, in the unit of its key.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Weight, not negative.
    pub weight: f64,
    /// Value of utility 0.
    pub worst: f64,
    /// Value of utility 0.5, strictly between the other two.
    pub half: f64,
    /// Value of utility 1.
    pub best: f64,
}

impl Aim {
    const fn straight(weight: f64, worst: f64, best: f64) -> Self {
        Self {
            weight,
            worst,
            half: 0.5 * (worst + best),
            best,
        }
    }

    const fn bent(weight: f64, worst: f64, half: f64, best: f64) -> Self {
        Self {
            weight,
            worst,
            half,
            best,
        }
    }

    /// With what the scenario says.
    fn with(self, given: MetricRanking) -> Self {
        let worst = given.worst.unwrap_or(self.worst);
        let best = given.best.unwrap_or(self.best);
        let moved = given.worst.is_some() || given.best.is_some();
        let otherwise = if moved {
            f64::midpoint(worst, best)
        } else {
            self.half
        };
        Self {
            weight: given.weight.unwrap_or(self.weight),
            worst,
            half: given.half.unwrap_or(otherwise),
            best,
        }
    }

    /// The same in a unit of which the key's unit is `scale`.
    pub fn scaled(self, scale: f64) -> Self {
        Self {
            weight: self.weight,
            worst: self.worst * scale,
            half: self.half * scale,
            best: self.best * scale,
        }
    }

    /// Utility of a value, 0 to 1; of NaN 0.
    pub fn utility(&self, value: f64) -> f64 {
        let between = |from: f64, to: f64| (value - from) / (to - from);
        let upper = between(self.half, self.best);
        // Beyond `half` the second piece, which is 0 there, goes on from 0.5.
        let utility = if upper >= 0.0 {
            0.5 + 0.5 * upper
        } else {
            0.5 * between(self.worst, self.half)
        };
        if utility.is_nan() {
            0.0
        } else {
            utility.clamp(0.0, 1.0)
        }
    }
}

impl RankingSection {
    /// Every key with what the scenario says of it, completed by the defaults.
    pub fn aims(&self) -> [(&'static str, Aim); DEFAULTS.len()] {
        let given = self.given();
        std::array::from_fn(|at| {
            let (key, default) = DEFAULTS[at];
            (key, default.with(given[at]))
        })
    }
}

/// Whether less of a key is better, by its defaults.
pub fn less_is_better(key: &str) -> bool {
    let mut all = DEFAULTS.iter();
    all.any(|(known, aim)| *known == key && aim.best < aim.worst)
}

/// Anchors out of order, and weights that are all 0.
pub(super) fn check(toml: &TomlText<'_>, ranking: &RankingSection) -> Vec<Finding> {
    let mut findings = Vec::new();
    let aims = ranking.aims();
    for (key, aim) in aims {
        let Aim {
            worst, half, best, ..
        } = aim;
        let less = less_is_better(key);
        let ordered = if less {
            best < half && half < worst
        } else {
            worst < half && half < best
        };
        if !ordered {
            let direction = if less {
                "lower is better, so best < half < worst"
            } else {
                "higher is better, so worst < half < best"
            };
            findings.push(
                toml.finding(
                    &format!("ranking.{key}"),
                    format!("worst {worst}, half {half}, best {best} are not in order"),
                )
                .hint(direction),
            );
        }
    }
    if findings.is_empty() && aims.iter().all(|(_, aim)| aim.weight == 0.0) {
        findings.push(
            toml.finding("ranking", "all weights are 0")
                .hint("give at least one metric a weight"),
        );
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;
    use needlebench_input::schema::FileSchema;

    #[test]
    fn default_anchors_are_in_order_and_their_utilities_are_0_a_half_and_1() {
        for (key, aim) in RankingSection::default().aims() {
            let at = [aim.worst, aim.half, aim.best].map(|value| aim.utility(value));
            assert_eq!(at, [0.0, 0.5, 1.0], "{key}");
        }
    }

    #[test]
    fn utility_is_level_outside_its_anchors_and_straight_between() {
        let aim = Aim::bent(1.0, 0.0, 20.0, 100.0);
        let values = [-5.0, 10.0, 60.0, 300.0, f64::INFINITY, f64::NEG_INFINITY];
        let expected = [0.0, 0.25, 0.75, 1.0, 1.0, 0.0];
        assert_eq!(values.map(|value| aim.utility(value)), expected);
        let less = Aim::straight(1.0, 20.0, 2.0);
        assert_eq!(
            [25.0, 20.0, 15.5, 6.5, 1.0].map(|value| less.utility(value)),
            [0.0, 0.0, 0.25, 0.75, 1.0]
        );
    }

    #[test]
    fn not_a_number_has_no_utility() {
        assert_eq!(Aim::straight(1.0, 0.0, 1.0).utility(f64::NAN), 0.0);
    }

    #[test]
    fn anchors_that_are_given_move_the_middle_unless_it_is_given_too() {
        let given = |half| RankingSection {
            clearance_mm: MetricRanking {
                best: Some(50.0),
                half,
                ..MetricRanking::default()
            },
            ..RankingSection::default()
        };
        let aim = |half| given(half).aims()[0].1;
        assert_eq!(aim(None), Aim::bent(3.0, 0.0, 25.0, 50.0));
        assert_eq!(aim(Some(5.0)), Aim::bent(3.0, 0.0, 5.0, 50.0));
    }

    #[derive(Deserialize, JsonSchema)]
    struct File {
        ranking: RankingSection,
    }

    #[test]
    fn wrong_weights_and_anchors_are_found_where_they_stand() {
        let findings = |text: &str| {
            let toml = TomlText::parse("s.toml", text).unwrap();
            let findings = match toml.read::<File>(&FileSchema::of::<File>()) {
                Ok(file) => check(&toml, &file.ranking),
                Err(findings) => findings,
            };
            findings
                .into_iter()
                .map(|found| (found.line, found.key.unwrap_or_default()))
                .collect::<Vec<_>>()
        };
        assert_eq!(findings("[ranking.joint_margin]\nweight = 5"), []);
        assert_eq!(
            findings("[ranking.joint_margin]\nweight = -1"),
            [(Some(2), "ranking.joint_margin.weight".to_owned())]
        );
        assert_eq!(
            findings("[ranking]\n\n[ranking.motion_time_s]\nworst = 1\nbest = 5"),
            [(Some(3), "ranking.motion_time_s".to_owned())]
        );
        let mut nothing = vec!["[ranking]".to_owned()];
        for (key, _) in RankingSection::default().aims() {
            nothing.push(format!("{key}.weight = 0"));
        }
        assert_eq!(
            findings(&nothing.join("\n")),
            [(Some(1), "ranking".to_owned())]
        );
    }
}

//! What counts how much when configurations are ranked: the scenario's `[ranking]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Finding;
use crate::toml_text::TomlText;

/// How the configurations that work are ranked: a weighted mean of utilities from 0 to 1.
///
/// A metric's utility is 0 at `worst`, 0.5 at `half`, 1 at `best`, straight in between and level
/// outside. The weights need not add up to 1. A metric that was not measured does not count.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RankingSection {
    /// Least clearance of arm and tool from their surroundings, mm; certified where it is. Default
    /// weight 3, worst 0, half 20, best 100: touching ends the procedure, 20 is what models and a
    /// moving patient may take, and nobody works nearer to the arm than 100.
    pub clearance_mm: MetricRanking,
    /// Least clearance of arm and tool from themselves, mm. Default weight 0.5, worst 0, best 10:
    /// the arm's own shape leaves 10 in most postures.
    pub self_clearance_mm: MetricRanking,
    /// Least clearance of the volume behind the guide while the arm holds, mm. Default weight 1,
    /// worst 0, half 10, best 50: a hand is in there.
    pub needle_corridor_mm: MetricRanking,
    /// Settled distance of the needle's tip from the target in the worst engine, mm. Default
    /// weight 2, worst 2.7, best 0: 2.7 is the mean of the largest errors that 153
    /// interventional radiologists allow.
    pub tip_error_mm: MetricRanking,
    /// How far the needle's tip moves when every joint is off by independent errors, mm/mrad.
    /// Default weight 1, worst 1.5, best 0.5: an arm of 0.5 m stretched and folded.
    pub tip_sensitivity_mm_mrad: MetricRanking,
    /// Margin of the final posture to the joint limits: 1 in the middle of every range. Default
    /// weight 1, worst 0, best 0.5.
    pub joint_margin: MetricRanking,
    /// Less of `|sin q5|` and `|sin q3|` of the final posture. Default weight 1, worst 0, best 0.5:
    /// 30 degrees from the singularity.
    pub singularity_margin: MetricRanking,
    /// Distance of wrist 2 from the cylinder about the shoulder axis, mm. Default weight 0.5,
    /// worst 0, best 100.
    pub shoulder_margin_mm: MetricRanking,
    /// Time until the arm stands in its place, s. Default weight 0.5, worst 20, best 2: short
    /// beside the minutes of an insertion.
    pub motion_time_s: MetricRanking,
    /// Largest torque over its joint's limit. Default weight 0.5, worst 1, best 0.3: holding the
    /// arm against gravity takes 0.3.
    pub peak_torque_ratio: MetricRanking,
    /// Free share of the space around the entry point. Default weight 1, worst 0, best 1.
    pub free_fraction: MetricRanking,
    /// Unobstructed share of the lines of sight to the entry point. Default weight 1, worst 0,
    /// best 1.
    pub sight_fraction: MetricRanking,
    /// Half-angle of the free cone behind the guide, deg. Default weight 1, worst 0, best 45.
    pub hand_cone_deg: MetricRanking,
    /// How well the doctor's stated preferences are met: mean of the elbow as preferred, 0 or 1, and
    /// the free share of the preferred side. Default weight 1, worst 0, best 1.
    pub preference: MetricRanking,
}

/// Weight and anchors of one metric; what is left out keeps its default.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MetricRanking {
    /// Weight beside the other metrics' weights; 0 leaves the metric out.
    pub weight: Option<f64>,
    /// Value of utility 0, in the unit of the metric's name.
    pub worst: Option<f64>,
    /// Value of utility 0.5, between the other two. Where `worst` or `best` is given and this is
    /// not, it is their middle.
    pub half: Option<f64>,
    /// Value of utility 1: what is better still counts no more.
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
    pub fn aims(&self) -> [(&'static str, Aim); 14] {
        let complete = |given: MetricRanking, default: Aim| {
            let worst = given.worst.unwrap_or(default.worst);
            let best = given.best.unwrap_or(default.best);
            let moved = given.worst.is_some() || given.best.is_some();
            let otherwise = if moved {
                f64::midpoint(worst, best)
            } else {
                default.half
            };
            Aim {
                weight: given.weight.unwrap_or(default.weight),
                worst,
                half: given.half.unwrap_or(otherwise),
                best,
            }
        };
        macro_rules! aims {
            ($($key:ident: $default:expr,)*) => {
                [$((stringify!($key), complete(self.$key, $default))),*]
            };
        }
        aims! {
            clearance_mm: Aim::bent(3.0, 0.0, 20.0, 100.0),
            self_clearance_mm: Aim::straight(0.5, 0.0, 10.0),
            needle_corridor_mm: Aim::bent(1.0, 0.0, 10.0, 50.0),
            tip_error_mm: Aim::straight(2.0, 2.7, 0.0),
            tip_sensitivity_mm_mrad: Aim::straight(1.0, 1.5, 0.5),
            joint_margin: Aim::straight(1.0, 0.0, 0.5),
            singularity_margin: Aim::straight(1.0, 0.0, 0.5),
            shoulder_margin_mm: Aim::straight(0.5, 0.0, 100.0),
            motion_time_s: Aim::straight(0.5, 20.0, 2.0),
            peak_torque_ratio: Aim::straight(0.5, 1.0, 0.3),
            free_fraction: Aim::straight(1.0, 0.0, 1.0),
            sight_fraction: Aim::straight(1.0, 0.0, 1.0),
            hand_cone_deg: Aim::straight(1.0, 0.0, 45.0),
            preference: Aim::straight(1.0, 0.0, 1.0),
        }
    }
}

/// Keys of which less is better.
pub const LESS_IS_BETTER: [&str; 4] = [
    "tip_error_mm",
    "tip_sensitivity_mm_mrad",
    "motion_time_s",
    "peak_torque_ratio",
];

/// Largest weight: more of a spread is a mistake of typing.
const MOST_WEIGHT: f64 = 1e6;

/// Weights and anchors that make no sense.
pub(crate) fn check_ranking(toml: &TomlText<'_>, ranking: &RankingSection) -> Vec<Finding> {
    let mut findings = Vec::new();
    let aims = ranking.aims();
    for (key, aim) in aims {
        let Aim {
            weight,
            worst,
            half,
            best,
        } = aim;
        if !(0.0..=MOST_WEIGHT).contains(&weight) {
            findings.push(
                toml.finding(
                    &format!("ranking.{key}.weight"),
                    format!("the weight {weight} is outside 0 to {MOST_WEIGHT}"),
                )
                .hint("weights are relative: 0 leaves a metric out, 2 counts twice as much as 1"),
            );
        }
        let less = LESS_IS_BETTER.contains(&key);
        let ordered = if less {
            best < half && half < worst
        } else {
            worst < half && half < best
        };
        if !ordered {
            let direction = if less {
                "less is better, so best < half < worst"
            } else {
                "more is better, so worst < half < best"
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
            toml.finding("ranking", "all weights are 0: nothing would count")
                .hint("give at least one metric a weight"),
        );
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_anchors_are_in_order_and_their_utilities_are_0_a_half_and_1() {
        for (key, aim) in RankingSection::default().aims() {
            assert_eq!(aim.best < aim.worst, LESS_IS_BETTER.contains(&key), "{key}");
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

    #[derive(Deserialize)]
    struct File {
        ranking: RankingSection,
    }

    #[test]
    fn wrong_weights_and_anchors_are_found_where_they_stand() {
        let check = |text: &str| {
            let toml = TomlText::parse("s.toml", text).unwrap();
            let file: File = toml.deserialize().unwrap();
            let findings = check_ranking(&toml, &file.ranking);
            findings
                .into_iter()
                .map(|found| (found.line, found.key.unwrap_or_default()))
                .collect::<Vec<_>>()
        };
        assert_eq!(check("[ranking.joint_margin]\nweight = 5"), []);
        assert_eq!(
            check("[ranking.joint_margin]\nweight = -1"),
            [(Some(2), "ranking.joint_margin.weight".to_owned())]
        );
        assert_eq!(
            check("[ranking]\n\n[ranking.motion_time_s]\nworst = 1\nbest = 5"),
            [(Some(3), "ranking.motion_time_s".to_owned())]
        );
        let mut nothing = vec!["[ranking]".to_owned()];
        for (key, _) in RankingSection::default().aims() {
            nothing.push(format!("{key}.weight = 0"));
        }
        assert_eq!(
            check(&nothing.join("\n")),
            [(Some(1), "ranking".to_owned())]
        );
    }
}

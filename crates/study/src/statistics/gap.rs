//! Overestimate of a study of postures only: the same cases with their motions planned.

use needlebench_kinematics::ik::Configuration;
use serde::{Deserialize, Serialize};

use super::interval::{Interval, TAIL, clopper_pearson_with};

/// Name of "at least one configuration" in [`Gap::of`].
pub const ANY: &str = "any";

/// A case by its postures and by its motions: configurations that are ok, as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReplannedCase {
    /// Its number.
    pub case: u64,
    /// By postures alone.
    #[serde(rename = "static")]
    pub postures: u8,
    /// With planned motions.
    pub planned: u8,
}

/// Share of cases that are feasible as postures, minus the share that is feasible with motions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Label of the configuration, or [`ANY`].
    pub of: String,
    /// Cases.
    pub cases: u64,
    /// Cases in which it is ok by its posture.
    pub by_postures: u64,
    /// Cases in which it is ok with its motion.
    pub planned: u64,
    /// Cases feasible as postures, but not with a motion.
    pub lost: u64,
    /// Cases feasible with a motion only: a plan may end in another posture.
    pub gained: u64,
    /// Difference of the shares; none of no cases.
    pub gap: Option<f64>,
    /// Its interval.
    pub interval: Option<Interval>,
}

/// The gap of at least one configuration, then of each.
///
/// The difference is the share of lost cases less the share of gained ones. Each of these two has Clopper
/// and Pearson's interval of 97.5 %, so that both hold together with at least 95 % (Bonferroni), and the
/// difference then lies between their differences. The cases are sampled at random from those of the study,
/// each as likely as any other, so they are independent whatever repeats in the design.
pub fn gaps(cases: &[ReplannedCase]) -> Vec<Gap> {
    let labels = Configuration::ALL.iter().map(|each| each.label());
    let each = labels.enumerate().map(|(index, label)| (label, 1 << index));
    [(ANY, u8::MAX)]
        .into_iter()
        .chain(each)
        .map(|(of, mask)| gap(of, mask, cases))
        .collect()
}

fn gap(of: &str, mask: u8, cases: &[ReplannedCase]) -> Gap {
    let count = |wanted: &dyn Fn(bool, bool) -> bool| {
        let found = cases
            .iter()
            .filter(|each| wanted(each.postures & mask != 0, each.planned & mask != 0));
        found.count() as u64
    };
    let (lost, gained) = (count(&|a, b| a && !b), count(&|a, b| !a && b));
    let size = cases.len() as f64;
    let some = !cases.is_empty();
    let share = |count: u64| clopper_pearson_with(count as f64 / size, size, 0.5 * TAIL);
    Gap {
        of: of.to_owned(),
        cases: cases.len() as u64,
        by_postures: count(&|a, _| a),
        planned: count(&|_, b| b),
        lost,
        gained,
        gap: some.then(|| (lost as f64 - gained as f64) / size),
        interval: some.then(|| {
            let (lost, gained) = (share(lost), share(gained));
            Interval {
                low: lost.low - gained.high,
                high: lost.high - gained.low,
            }
        }),
    }
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    #[test]
    fn a_gap_is_what_motions_take_less_what_they_give() {
        // Of 8: 3 work both ways, 4 by their posture alone, 1 with a motion in another posture.
        let bits = [
            (1, 1),
            (1, 1),
            (1, 3),
            (1, 0),
            (3, 2),
            (1, 0),
            (1, 0),
            (0, 1),
        ];
        let cases: Vec<ReplannedCase> = (0..)
            .zip(bits)
            .map(|(case, (postures, planned))| ReplannedCase {
                case,
                postures,
                planned,
            })
            .collect();
        let found = gaps(&cases);
        let first = found
            .iter()
            .find(|each| each.of == "Right-Down-Fold")
            .unwrap();
        assert_eq!((first.by_postures, first.planned), (7, 4));
        assert_eq!(
            (first.lost, first.gained, first.gap),
            (4, 1, Some(3.0 / 8.0))
        );
        assert_eq!(
            (found[0].of.as_str(), found[0].lost, found[0].gained),
            (ANY, 3, 1)
        );
        let interval = first.interval.unwrap();
        assert!(interval.low < 0.0 && interval.high > 0.375, "{interval:?}");
        assert_eq!(gaps(&[])[0].gap, None);
    }

    /// Four standard errors of 95 % of 2000 samples.
    const MONTE_CARLO: f64 = 0.02;

    #[test]
    fn intervals_hold_the_gap_of_all_cases() {
        let mut random = SplitMix64::new(2);
        for (lost, gained) in [(0.0, 0.0), (0.45, 0.0), (0.1, 0.05), (0.9, 0.02)] {
            let mut covered = 0;
            for _ in 0..2000 {
                let cases: Vec<ReplannedCase> = (0..32)
                    .map(|case| {
                        let u = random.uniform(0.0, 1.0);
                        let is_lost = u < lost;
                        let is_gained = !is_lost && u < lost + gained;
                        ReplannedCase {
                            case,
                            postures: u8::from(!is_gained),
                            planned: u8::from(!is_lost),
                        }
                    })
                    .collect();
                let interval = gaps(&cases)[0].interval.unwrap();
                let truth = lost - gained;
                covered += u32::from(interval.low <= truth && truth <= interval.high);
            }
            let coverage = f64::from(covered) / 2000.0;
            assert!(
                coverage >= 0.95 - MONTE_CARLO,
                "{lost} {gained}: {coverage}"
            );
        }
    }
}

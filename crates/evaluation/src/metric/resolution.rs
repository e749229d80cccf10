//! Which metric of a family two results are compared by.

use super::key::MetricKey;
use super::metrics;

/// The metric that is compared, and what there is to say where it is not the one that was asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Resolved {
    /// What is compared.
    pub key: MetricKey,
    /// Why, where it is another one.
    pub note: Option<String>,
}

/// The metric by which two results are compared where `wanted` is asked for: itself, if the first has
/// it or nothing else can be compared; else the one of its family, saying most, that both have.
///
/// A name such as `clearance` so works for studies of static cases too, which have `clearance_static`
/// alone; the note says so.
pub fn resolve(
    wanted: &MetricKey,
    first_has: impl Fn(&str) -> bool,
    second_has: impl Fn(&str) -> bool,
) -> Resolved {
    let itself = Resolved {
        key: wanted.clone(),
        note: None,
    };
    if first_has(&wanted.key()) || wanted.metric().family != wanted.key() {
        return itself;
    }
    let family = || {
        metrics()
            .rev()
            .filter(|metric| metric.family == wanted.metric().family)
    };
    let of_runs = family().map(MetricKey::of_run);
    let of_static_cases = family().filter_map(MetricKey::of_static_case);
    let mut members = of_runs.chain(of_static_cases);
    let found = members.find(|each| first_has(&each.key()) && second_has(&each.key()));
    match found {
        None => itself,
        Some(key) => {
            let note = format!(
                "`{}` was not measured; compared by `{}` instead ({})",
                wanted.key(),
                key.key(),
                key.description()
            );
            Resolved {
                key,
                note: Some(note),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(name: &str, first: &[&str], second: &[&str]) -> (String, bool) {
        let wanted = MetricKey::named(name, &["rapier"]).unwrap();
        let found = resolve(
            &wanted,
            |key| first.contains(&key),
            |key| second.contains(&key),
        );
        (found.key.key().into_owned(), found.note.is_some())
    }

    #[test]
    fn what_was_asked_for_counts_if_the_first_has_it() {
        let both = ["clearance", "clearance_attained"];
        assert_eq!(
            resolved("clearance", &both, &both),
            ("clearance".into(), false)
        );
        // The second lost it, which is a loss and no reason to look elsewhere.
        assert_eq!(
            resolved("clearance", &both, &both[1..]),
            ("clearance".into(), false)
        );
    }

    #[test]
    fn otherwise_it_is_what_both_have_and_says_most() {
        let planned = [
            "clearance_posture",
            "clearance_planned",
            "clearance_planned_attained",
        ];
        assert_eq!(
            resolved("clearance", &planned, &planned),
            ("clearance_planned".into(), true)
        );
        assert_eq!(
            resolved("clearance", &planned, &planned[..1]),
            ("clearance_posture".into(), true)
        );
        assert_eq!(
            resolved("clearance", &["clearance_static"], &["clearance_static"]),
            ("clearance_static".into(), true)
        );
        assert_eq!(
            resolved(
                "joint_margin",
                &["joint_margin_static"],
                &["joint_margin_static"]
            ),
            ("joint_margin_static".into(), true)
        );
    }

    #[test]
    fn full_names_stand_for_nothing_else() {
        assert_eq!(
            resolved(
                "clearance_attained",
                &["clearance_static"],
                &["clearance_static"]
            ),
            ("clearance_attained".into(), false)
        );
        assert_eq!(
            resolved("tip_error_rapier", &["tip_error"], &["tip_error"]),
            ("tip_error_rapier".into(), false)
        );
    }
}

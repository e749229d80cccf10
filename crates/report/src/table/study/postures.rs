//! What a study of postures alone has to say of itself.

use needlebench_bench::study::{PreparedStudy, Replanned};
use needlebench_cell::study::StudyMode;
use needlebench_study::statistics::{ANY, Gap};

use crate::number::in_percent;
use crate::table::Block;

/// Which cases are of postures only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Postures {
    /// All.
    All,
    /// Those of some levels.
    Some,
    /// None: all have motions.
    None,
}

impl Postures {
    /// Of a study.
    pub(crate) fn of(prepared: &PreparedStudy) -> Self {
        let modes = prepared.modes();
        match (modes.contains(&StudyMode::Static), modes.len()) {
            (false, _) => Self::None,
            (true, 1) => Self::All,
            (true, _) => Self::Some,
        }
    }

    /// Name in `summary.json`.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Some => "some",
            Self::None => "none",
        }
    }
}

/// What the base scenario lets needles pass through, of bone, vessels and organs: it is no part of what works.
pub(crate) struct RouteLeftOut {
    /// What is switched off, as the scenario names it.
    off: Vec<String>,
    /// The margin that would hold, mm.
    pub least_mm: f64,
}

impl RouteLeftOut {
    /// Of a study; none where the needle's route is judged.
    pub(crate) fn of(prepared: &PreparedStudy) -> Option<Self> {
        let route = &prepared.study.family.base().scenario.planning.needle_route;
        (!route.off.is_empty()).then(|| Self {
            off: route.off.clone(),
            least_mm: route.bone_mm.max(route.vessel_mm).max(route.organ_mm),
        })
    }

    pub(crate) fn in_words(&self) -> String {
        format!(
            "needle route left out: needles may pass {} (`planning.needle_route.off`), and work all the same",
            self.off.join(", ")
        )
    }
}

/// The first sentence of a study of postures, wherever it is shown.
pub(crate) fn postures_headline(postures: Postures, found: Option<&Replanned>) -> Option<String> {
    let what = match postures {
        Postures::None => return None,
        Postures::All => "postures only",
        Postures::Some => "postures only in the static cases",
    };
    let any = found.and_then(|found| Some((found, found.gaps.iter().find(|gap| gap.of == ANY)?)));
    let Some((found, any)) = any else {
        return Some(format!(
            "{what}: whether a motion gets there is not known, and none was planned to see how often"
        ));
    };
    Some(format!(
        "{what}: whether a motion gets there is not known. Of {} cases planned too, {} % work by their posture, \
         {} % with a motion: {}",
        found.cases,
        share(any.by_postures, any),
        share(any.planned, any),
        points(any)
    ))
}

fn share(count: u64, gap: &Gap) -> String {
    in_percent(count as f64 / gap.cases.max(1) as f64)
}

/// `45 points less (27 to 60)`.
fn points(gap: &Gap) -> String {
    let (Some(difference), Some(interval)) = (gap.gap, gap.interval) else {
        return "-".to_owned();
    };
    format!(
        "{} points less (95 % interval {} to {})",
        in_percent(difference),
        in_percent(interval.low),
        in_percent(interval.high)
    )
}

/// The gap of each configuration.
pub(crate) fn postures_blocks(found: Option<&Replanned>) -> Vec<Block> {
    let Some(found) = found else {
        return Vec::new();
    };
    let rows = found.gaps.iter().map(|gap| {
        vec![
            gap.of.clone(),
            share(gap.by_postures, gap),
            share(gap.planned, gap),
            gap.gap.map_or("-".to_owned(), in_percent),
            gap.interval.map_or("-".to_owned(), |interval| {
                format!(
                    "{} .. {}",
                    in_percent(interval.low),
                    in_percent(interval.high)
                )
            }),
            gap.gained.to_string(),
        ]
    });
    let heading = Block::Heading(format!(
        "what postures alone overstate: {} cases, drawn from {}, planned too",
        found.cases, found.of
    ));
    let table = Block::table(
        [
            "configuration",
            "ok by\nposture (%)",
            "with a\nmotion (%)",
            "gap\n(points)",
            "95 %",
            "motion\nonly",
        ],
        rows.collect(),
    );
    let line = Block::Lines(vec![
        "motion only: cases that work with their motion and not by the posture that would be tried first"
            .to_owned(),
    ]);
    vec![heading, table, line]
}

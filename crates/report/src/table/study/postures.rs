//! The caveats of a study of postures only.

use needlebench_bench::study::{PreparedStudy, Replanned};
use needlebench_scenario::study::StudyMode;
use needlebench_show::Block;
use needlebench_show::number::in_percent;
use needlebench_study::statistics::{ANY, Gap};

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

/// The structures (bone, vessels, organs) whose clearance the base scenario does not check along the needle path.
pub(crate) struct RouteLeftOut {
    /// The checks that are off, as the scenario names them.
    off: Vec<String>,
    /// The margin that would be required, mm.
    pub least_mm: f64,
}

impl RouteLeftOut {
    /// Of a study; none where the whole needle path is checked.
    pub(crate) fn of(prepared: &PreparedStudy) -> Option<Self> {
        let route = &prepared.study.family.base().scenario.planning.needle_route;
        (!route.off.is_empty()).then(|| Self {
            off: route.off.clone(),
            least_mm: route.bone_mm.max(route.vessel_mm).max(route.organ_mm),
        })
    }

    pub(crate) fn in_words(&self) -> String {
        format!(
            "Needle path not checked against {} (`planning.needle_route.off`): feasibility does not include it",
            self.off.join(", ")
        )
    }
}

/// The first sentence of a study of postures, wherever it is shown.
pub(crate) fn postures_headline(postures: Postures, found: Option<&Replanned>) -> Option<String> {
    let what = match postures {
        Postures::None => return None,
        Postures::All => "Postures only",
        Postures::Some => "Static cases: postures only",
    };
    let any = found.and_then(|found| Some((found, found.gaps.iter().find(|gap| gap.of == ANY)?)));
    let Some((found, any)) = any else {
        return Some(format!(
            "{what}, motions not planned, not even in a sample of cases"
        ));
    };
    Some(format!(
        "{what}, motions not planned. Of {} cases also planned, {} % are feasible as postures and {} % with a \
         motion ({})",
        found.cases,
        share(any.by_postures, any),
        share(any.planned, any),
        points(any)
    ))
}

fn share(count: u64, gap: &Gap) -> String {
    in_percent(count as f64 / gap.cases.max(1) as f64)
}

/// `difference 45 percentage points, 95 % CI 27 to 60`.
fn points(gap: &Gap) -> String {
    let (Some(difference), Some(interval)) = (gap.gap, gap.interval) else {
        return "difference unknown".to_owned();
    };
    format!(
        "difference {} percentage points, 95 % CI {} to {}",
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
        "overestimate of postures only: {} cases, sampled from {}, also planned",
        found.cases, found.of
    ));
    let table = Block::table(
        [
            "configuration",
            "feasible as\nposture (%)",
            "with\nmotion (%)",
            "difference\n(pp)",
            "95 % CI",
            "motion\nonly",
        ],
        rows.collect(),
    );
    let line = Block::Lines(vec![
        "motion only: cases feasible with their motion, but not with the posture that is tried first"
            .to_owned(),
    ]);
    vec![heading, table, line]
}

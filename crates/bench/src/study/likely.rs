//! Which probabilities cases have beside those that a criterion requires.

use needlebench_input::Finding;
use needlebench_scenario::imperfections::Imperfections;
use needlebench_scenario::study::{FactorValues, ResolvedStudy};
use needlebench_uncertainty::Source;

use crate::probability::Extent;

/// Which probabilities a case has of each configuration.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Likely {
    /// Those that a criterion requires.
    #[default]
    AsJudged,
    /// Those of a run's report.
    AsReported,
    /// That of the lesion, by 10 000 needles: those of a search.
    Lesion,
}

impl Likely {
    /// Those that a study asks for.
    pub fn of(study: &ResolvedStudy) -> Self {
        if study.file.probabilities {
            Self::AsReported
        } else {
            Self::AsJudged
        }
    }

    pub(super) fn extent(self) -> Option<Extent> {
        match self {
            Self::AsJudged => None,
            Self::AsReported => Some(Extent::All),
            Self::Lesion => Some(Extent::Lesion),
        }
    }
}

/// Whether the scenario or a factor defines an arm and patient population.
pub(crate) fn has_imperfections(study: &ResolvedStudy) -> bool {
    study.family.base().expected.is_some() || sets(study, "imperfections")
}

/// The same, with something in it that spreads needles: a perfect arm has no probabilities.
pub(crate) fn has_spread(study: &ResolvedStudy) -> bool {
    let expected = study.family.base().expected.as_ref();
    let spreads = |all: &Imperfections| Source::ALL.into_iter().any(|source| source.is_in(all));
    expected.is_some_and(|each| spreads(&each.imperfections)) || sets(study, "imperfections")
}

/// Whether a level of a factor sets a key that begins so.
pub(crate) fn sets(study: &ResolvedStudy, start: &str) -> bool {
    study.factors.iter().any(|factor| match &factor.values {
        FactorValues::Continuum { .. } => false,
        FactorValues::Levels(levels) => levels
            .iter()
            .flat_map(|level| &level.changes)
            .any(|(key, _)| key.to_string().starts_with(start)),
    })
}

/// What keeps a study from having the probabilities that it asks for.
pub(super) fn check(study: &ResolvedStudy) -> Result<(), Vec<Finding>> {
    if !study.file.probabilities || has_spread(study) {
        return Ok(());
    }
    let message = "`probabilities` are over arms and patients, which this scenario does not define";
    let finding = Finding::new(&study.source.file, message).key("probabilities");
    Err(vec![finding.hint(
        "define them in [imperfections] of the scenario, or leave the key out",
    )])
}

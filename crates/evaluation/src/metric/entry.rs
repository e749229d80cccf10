//! What is declared of a metric.

use needlebench_scenario::scenario::CriteriaSection;
use needlebench_scenario::study::StudyMode;

use super::quantity::{Quantity, Unit};
use crate::report::{ConfigurationReport, EngineReport};

/// Which way is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    /// Larger values.
    More,
    /// Smaller values.
    Less,
}

/// How sure a value is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// Proven: the true value is not worse.
    Certified,
    /// The worst that was met with; the true value may be worse.
    Attained,
    /// The value itself.
    Value,
}

/// Of which arm and patient a value is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Draw {
    /// The nominal ones, whatever the imperfections.
    Nominal,
    /// The one draw from the scenario's imperfections that its seed gives.
    ThisDraw,
    /// All that the imperfections describe.
    OverBudget,
}

/// What a value is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// The posture at the end.
    FinalPosture,
    /// The planned motion.
    PlannedMotion,
    /// The motion in the engines.
    Simulated,
}

/// How a value is shown in tables and on pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Show {
    /// Millimetres, without the unit.
    Millimetres,
    /// A length from picometres to millimetres, with its unit.
    SmallLength,
    /// Seconds, without the unit.
    Seconds,
    /// Per cent, with the sign.
    Percent,
    /// Degrees, without the unit.
    Degrees,
    /// A plain number.
    Number,
}

/// Where a metric is shown besides lists of all metrics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Heading {
    /// Place among the columns of the printed table, and its heading there.
    pub table: Option<(u8, &'static str)>,
    /// The same in the printed table of what the engines make of the motion.
    pub engines: Option<(u8, &'static str)>,
    /// Place among the columns of the Markdown summary, and its heading there.
    pub summary: Option<(u8, &'static str)>,
    /// Place among the columns of a page's table of configurations, and its heading there.
    pub page: Option<(u8, &'static str)>,
    /// The same in the short table beside the page's picture.
    pub page_side: Option<(u8, &'static str)>,
    /// Place among the columns of the table of a study's case, and its heading there. Of several
    /// metrics in one place the last that a row has is shown.
    pub case: Option<(u8, &'static str)>,
}

/// What a criterion makes of a value that is missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Missing {
    /// It was to be measured: the criterion is not evaluated.
    Unjudged,
    /// It was looked for and never came, as the time of settling of what does not settle: the criterion fails.
    Never,
    /// There is nothing to measure: the criterion says nothing.
    Skips,
    /// Several engines were to be compared: the criterion is not evaluated. With one engine it says nothing, whatever
    /// the value.
    UnjudgedIfCompared,
}

/// The criterion on a metric: its limit.
#[derive(Debug, Clone, Copy)]
pub struct Criterion {
    /// Key of the scenario's `[criteria]`.
    pub key: &'static str,
    /// The limit in SI units; none where the scenario has none.
    pub limit: fn(&CriteriaSection) -> Option<f64>,
    /// Cases that are evaluated by this metric; a run is evaluated as a dynamic case.
    pub modes: &'static [StudyMode],
    /// What a missing value means.
    pub missing: Missing,
    /// What to say beside the value.
    pub detail: fn(&ConfigurationReport, Option<&EngineReport>, &CriteriaSection) -> String,
}

/// What the statistics of a study take a column for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The clearance by which the best configuration of a layout is chosen.
    Clearance,
    /// The error of the needle's tip.
    TipError,
}

/// How finely a study's page keeps a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// In 4096 steps.
    Fine,
    /// In 256 steps.
    Coarse,
}

/// What the statistics of a study do with a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Statistics {
    /// Quantiles, means and deviations; studies are compared by it.
    pub spread: bool,
    /// The worst cases are named, and studies of the same cases are compared case by case.
    pub by_case: bool,
    /// What it stands for; of several columns that a row has the last counts.
    pub role: Option<Role>,
    /// Key of a study's `[criteria]` that is evaluated by it.
    pub criterion: Option<&'static str>,
    /// Whether, and how finely, it is on the study's page.
    pub page: Option<Precision>,
}

impl Statistics {
    pub(super) const NONE: Self = Self {
        spread: false,
        by_case: false,
        role: None,
        criterion: None,
        page: None,
    };
    pub(super) const SPREAD: Self = Self {
        spread: true,
        ..Self::NONE
    };
    pub(super) const BY_CASE: Self = Self {
        by_case: true,
        ..Self::SPREAD
    };

    pub(super) const fn role(self, role: Role) -> Self {
        Self {
            role: Some(role),
            ..self
        }
    }

    pub(super) const fn criterion(self, key: &'static str) -> Self {
        Self {
            criterion: Some(key),
            ..self
        }
    }

    pub(super) const fn page(self, precision: Precision) -> Self {
        Self {
            page: Some(precision),
            ..self
        }
    }
}

/// Where in the report a metric stands.
#[derive(Debug, Clone, Copy)]
pub enum Source {
    /// One number of a configuration.
    Configuration(fn(&ConfigurationReport) -> Option<f64>),
    /// One number of each engine. The metric is the worst of them, and none if one engine has none.
    Engines(fn(&EngineReport) -> Option<f64>),
}

/// Studies that have columns of a metric.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// All.
    Always,
    /// Those with a goal's true target, which it is of alone.
    OfTrueTargets,
    /// Those that ask for probabilities, which are estimated by draws of needles.
    Probabilities,
}

/// One metric.
#[derive(Debug, Clone, Copy)]
pub struct Metric {
    /// Name in reports and on the command line.
    pub key: &'static str,
    /// The same in words.
    pub words: &'static str,
    /// What it is, without what [`Metric::bound`], [`Metric::draw`] and [`Metric::stage`] say.
    pub definition: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// Which way is better; none where neither is.
    pub better: Option<Better>,
    /// Differences up to this, in SI units, are none.
    pub resolution: f64,
    /// How sure it is.
    pub bound: Bound,
    /// Of which arm and patient it is.
    pub draw: Draw,
    /// What it is taken from.
    pub stage: Stage,
    /// Name that it shares with metrics of the same thing that are known otherwise.
    pub family: &'static str,
    /// Name of the same number of a static case's posture, which need not be that of a run: it is the one that a plan
    /// would try first, without 2π equivalents. The same as `key` where the posture does not matter; none if static
    /// cases do not measure it.
    pub static_key: Option<&'static str>,
    /// Studies that have columns of it, beside static ones; none for those of its stage.
    pub modes: Option<&'static [StudyMode]>,
    /// Whether it decides on the Pareto set. Effort, far from its limit, and taste do not.
    pub in_pareto_set: bool,
    /// Key of the scenario's `[ranking]`. Of several metrics with one key the last that was measured
    /// counts.
    pub ranking_key: Option<&'static str>,
    /// The criterion on it.
    pub criterion: Option<Criterion>,
    /// How it is shown.
    pub show: Show,
    /// Where it is shown.
    pub heading: Heading,
    /// Unit of its column in studies, and of its ranking key.
    pub unit: Unit,
    /// Which studies have columns of it.
    pub asked: Asked,
    /// Whether studies have columns of each engine's value too.
    pub each_engine: bool,
    /// What a study's statistics do with it.
    pub statistics: Statistics,
    /// The same in static cases.
    pub static_statistics: Statistics,
    /// Where in the report it stands.
    pub source: Source,
}

impl Metric {
    /// A metric without a direction, known of the final posture, that is in no table.
    pub(super) const fn new(
        key: &'static str,
        words: &'static str,
        definition: &'static str,
        quantity: Quantity,
        source: Source,
    ) -> Self {
        Self {
            key,
            words,
            definition,
            quantity,
            better: None,
            resolution: quantity.resolution(),
            bound: Bound::Value,
            draw: Draw::Nominal,
            stage: Stage::FinalPosture,
            family: key,
            static_key: None,
            modes: None,
            in_pareto_set: false,
            ranking_key: None,
            criterion: None,
            show: match quantity {
                Quantity::Length => Show::Millimetres,
                Quantity::Angle => Show::Degrees,
                Quantity::Time => Show::Seconds,
                _ => Show::Number,
            },
            heading: Heading {
                table: None,
                engines: None,
                summary: None,
                page: None,
                page_side: None,
                case: None,
            },
            unit: quantity.column_unit(),
            asked: Asked::Always,
            each_engine: false,
            statistics: Statistics::NONE,
            static_statistics: Statistics::NONE,
            source,
        }
    }

    pub(super) const fn better(self, better: Better, resolution: f64) -> Self {
        Self {
            better: Some(better),
            resolution,
            ..self
        }
    }

    pub(super) const fn known(self, bound: Bound, draw: Draw, stage: Stage) -> Self {
        Self {
            bound,
            draw,
            stage,
            ..self
        }
    }

    pub(super) const fn family(self, family: &'static str) -> Self {
        Self { family, ..self }
    }

    pub(super) const fn in_static_cases(self, key: &'static str) -> Self {
        Self {
            static_key: Some(key),
            ..self
        }
    }

    pub(super) const fn only_in(self, modes: &'static [StudyMode]) -> Self {
        Self {
            modes: Some(modes),
            ..self
        }
    }

    pub(super) const fn pareto(self) -> Self {
        Self {
            in_pareto_set: true,
            ..self
        }
    }

    pub(super) const fn ranked(self, key: &'static str) -> Self {
        Self {
            ranking_key: Some(key),
            ..self
        }
    }

    /// A criterion that a missing value misses, with nothing to say beside it.
    pub(super) const fn criterion(
        self,
        key: &'static str,
        modes: &'static [StudyMode],
        limit: fn(&CriteriaSection) -> Option<f64>,
    ) -> Self {
        Self {
            criterion: Some(Criterion {
                key,
                limit,
                modes,
                missing: Missing::Unjudged,
                detail: |_, _, _| String::new(),
            }),
            ..self
        }
    }

    pub(super) const fn missing(self, missing: Missing) -> Self {
        let Some(criterion) = self.criterion else {
            panic!("a metric without a criterion");
        };
        Self {
            criterion: Some(Criterion {
                missing,
                ..criterion
            }),
            ..self
        }
    }

    pub(super) const fn detail(
        self,
        detail: fn(&ConfigurationReport, Option<&EngineReport>, &CriteriaSection) -> String,
    ) -> Self {
        let Some(criterion) = self.criterion else {
            panic!("a metric without a criterion");
        };
        Self {
            criterion: Some(Criterion {
                detail,
                ..criterion
            }),
            ..self
        }
    }

    pub(super) const fn show(self, show: Show) -> Self {
        Self { show, ..self }
    }

    pub(super) const fn table(self, place: u8, heading: &'static str) -> Self {
        Self {
            heading: Heading {
                table: Some((place, heading)),
                ..self.heading
            },
            ..self
        }
    }

    pub(super) const fn engines(self, place: u8, heading: &'static str) -> Self {
        Self {
            heading: Heading {
                engines: Some((place, heading)),
                ..self.heading
            },
            ..self
        }
    }

    pub(super) const fn summary(self, place: u8, heading: &'static str) -> Self {
        Self {
            heading: Heading {
                summary: Some((place, heading)),
                ..self.heading
            },
            ..self
        }
    }

    pub(super) const fn page(self, place: u8, heading: &'static str) -> Self {
        Self {
            heading: Heading {
                page: Some((place, heading)),
                ..self.heading
            },
            ..self
        }
    }

    pub(super) const fn page_side(self, place: u8, heading: &'static str) -> Self {
        Self {
            heading: Heading {
                page_side: Some((place, heading)),
                ..self.heading
            },
            ..self
        }
    }

    pub(super) const fn case(self, place: u8, heading: &'static str) -> Self {
        Self {
            heading: Heading {
                case: Some((place, heading)),
                ..self.heading
            },
            ..self
        }
    }

    pub(super) const fn unit(self, unit: Unit) -> Self {
        Self { unit, ..self }
    }

    pub(super) const fn each_engine(self) -> Self {
        Self {
            each_engine: true,
            ..self
        }
    }

    pub(super) const fn of_true_target(self) -> Self {
        Self {
            asked: Asked::OfTrueTargets,
            ..self
        }
    }

    pub(super) const fn probability(self) -> Self {
        Self {
            asked: Asked::Probabilities,
            ..self
        }
    }

    /// The same statistics in static cases.
    pub(super) const fn statistics(self, statistics: Statistics) -> Self {
        Self {
            statistics,
            static_statistics: statistics,
            ..self
        }
    }

    pub(super) const fn static_statistics(self, static_statistics: Statistics) -> Self {
        Self {
            static_statistics,
            ..self
        }
    }

    /// The metric of a key.
    pub fn of_key(key: &str) -> Option<&'static Self> {
        super::metrics().find(|metric| metric.key == key)
    }

    /// Value of a configuration in SI units; none if it was not measured.
    pub fn read(&self, configuration: &ConfigurationReport) -> Option<f64> {
        let value = match self.source {
            Source::Configuration(read) => read(configuration),
            Source::Engines(read) => {
                let values = configuration.engines.values().map(read);
                let worst = values.reduce(|a, b| Some(self.worse_of(a?, b?)));
                worst.flatten()
            }
        };
        value.filter(|value| value.is_finite())
    }

    /// The worse of two values; of a metric without a direction the one that is farther from 0.
    fn worse_of(&self, a: f64, b: f64) -> f64 {
        match self.better {
            Some(Better::More) => a.min(b),
            Some(Better::Less) => a.max(b),
            None if b.abs() > a.abs() => b,
            None => a,
        }
    }

    /// By how much `b` is better than `a`; negative if it is worse. Of a metric without a direction
    /// every change is a loss.
    pub fn gain(&self, a: f64, b: f64) -> f64 {
        match self.better {
            Some(Better::More) => b - a,
            Some(Better::Less) => a - b,
            None => -(b - a).abs(),
        }
    }

    /// Better, worse (`Less`) or, within the resolution, the same.
    pub fn compare(&self, a: f64, b: f64) -> std::cmp::Ordering {
        let gain = self.gain(a, b);
        if gain.abs() <= self.resolution {
            std::cmp::Ordering::Equal
        } else {
            gain.total_cmp(&0.0)
        }
    }

    /// What exactly it is: how sure, of which arm and patient, of what motion.
    pub(super) fn basis(&self) -> String {
        let motion = match (self.bound, self.stage) {
            (Bound::Certified, Stage::PlannedMotion) => {
                "certified lower bound over the whole planned motion"
            }
            (Bound::Certified, _) => {
                "certified lower bound over the whole simulated motion, over all engines"
            }
            (Bound::Attained, Stage::PlannedMotion) => {
                "nearest approach found along the planned motion"
            }
            (Bound::Attained, Stage::Simulated) => {
                "nearest approach found along the simulated motion, over all engines"
            }
            (_, Stage::FinalPosture) => "of the final posture, without simulation",
            (_, Stage::PlannedMotion) => "of the planned motion",
            (_, Stage::Simulated) => match self.source {
                Source::Engines(_) => "simulated, worst engine",
                Source::Configuration(_) => "simulated",
            },
        };
        let draw = match self.draw {
            Draw::Nominal => "",
            Draw::ThisDraw => "; of the arm and patient sampled by the seed",
            Draw::OverBudget => "; over the arm and patient population",
        };
        format!("{motion}{draw}")
    }
}

//! From the text of a study file to factors that fit their scenario.

use std::collections::BTreeMap;
use std::path::Path;

use super::{
    Distribution, FILE, FactorSection, FactorValues, GridSection, MOST_PLANNED_BY_DEFAULT,
    NormalSection, ResolvedStudy, Role, StudyFactor, StudyFile, StudyLevel, StudyMode,
};
use crate::Overrides;
use crate::engine_name::{EngineName, check_engine_names};
use crate::family::{Change, KeyPath, ScenarioFamily, Setting};
use needlebench_input::{Finding, TomlText, nearest_name, source_of};

/// Standard deviations from the mean beyond which quantiles of a truncated distribution lose digits.
const FARTHEST_SD: f64 = 6.0;
/// Names of factors that are columns of the results already.
const TAKEN: [&str; 5] = ["case", "goal", "configuration", "outcome", "detail"];

pub(super) fn resolve(
    file: &str,
    text: &str,
    base: &Path,
    overrides: &Overrides,
) -> Result<ResolvedStudy, Vec<Finding>> {
    let one = |finding: Finding| vec![finding];
    let toml = TomlText::parse(file, text).map_err(one)?;
    let study: StudyFile = toml.read(&FILE)?;
    let mut findings = Vec::new();
    check_head(&toml, &study, &mut findings);
    check_engines(&toml, &study, &overrides.engines, &mut findings);
    check_search(&toml, &study, &mut findings);
    if !findings.is_empty() {
        return Err(findings);
    }
    let path = base.join(&study.scenario);
    if !path.is_file() {
        return Err(one(toml
            .finding("scenario", format!("there is no file {}", path.display()))
            .hint("the path is relative to the study's folder")));
    }
    let family = ScenarioFamily::load(&path, overrides)?;
    let goals = goals(&toml, &study, &family).map_err(one)?;
    let mut factors = Vec::new();
    for (index, section) in study.factors.iter().enumerate() {
        let context = FactorContext {
            toml: &toml,
            index,
            study: &study,
            family: &family,
        };
        match context.resolve(section) {
            Ok(factor) => factors.push(factor),
            Err(finding) => findings.push(finding),
        }
    }
    if findings.is_empty() {
        check_together(&toml, &study, &factors, &mut findings);
    }
    if !findings.is_empty() {
        return Err(findings);
    }
    Ok(ResolvedStudy {
        source: source_of(file.to_owned(), text.as_bytes()),
        mode: study
            .mode
            .unwrap_or_else(|| default_mode(&study, &goals, &factors)),
        family,
        goals,
        factors,
        file: study,
        notes: toml.former_names(&FILE),
    })
}

/// What is computed where the study does not say it: motions too, as far as that is affordable.
fn default_mode(study: &StudyFile, goals: &[String], factors: &[StudyFactor]) -> StudyMode {
    let crossed = factors.iter().filter(|factor| !factor.sampled);
    let levels = crossed.map(|factor| match &factor.values {
        FactorValues::Levels(levels) => levels.len() as u64,
        FactorValues::Continuum { .. } => 1,
    });
    let samples = study.sampling.samples;
    let samples = samples.filter(|_| factors.iter().any(|factor| factor.sampled));
    let cases = levels.fold(
        samples.unwrap_or(1).saturating_mul(goals.len() as u64),
        u64::saturating_mul,
    );
    if cases <= MOST_PLANNED_BY_DEFAULT {
        StudyMode::Planned
    } else {
        StudyMode::Static
    }
}

fn check_head(toml: &TomlText<'_>, study: &StudyFile, findings: &mut Vec<Finding>) {
    let mut names = BTreeMap::new();
    for (index, factor) in study.factors.iter().enumerate() {
        let key = format!("factors[{index}].name");
        if TAKEN.contains(&factor.name.as_str()) {
            findings.push(
                toml.finding(
                    &key,
                    format!("the results already have a column `{}`", factor.name),
                )
                .hint(if factor.name == "goal" {
                    "all goals are studied by default; `goals = [..]` selects some of them"
                } else {
                    "give the factor another name"
                }),
            );
        } else if let Some(first) = names.insert(factor.name.clone(), index) {
            findings.push(toml.finding(
                &key,
                format!(
                    "factors {} and {} are both named `{}`",
                    first + 1,
                    index + 1,
                    factor.name
                ),
            ));
        }
    }
}

/// What a search needs.
fn check_search(toml: &TomlText<'_>, study: &StudyFile, findings: &mut Vec<Finding>) {
    let Some(search) = &study.search else {
        return;
    };
    if !study
        .factors
        .iter()
        .any(|factor| factor.role == Role::Control)
    {
        findings.push(
            toml.finding(
                "search",
                "no factor has `role = \"control\"`: a search needs control factors",
            )
            .hint("set it for control factors, such as the base placement"),
        );
    }
    if search.second_objective == Some(search.objective) {
        findings.push(
            toml.finding(
                "search.second_objective",
                format!("is the first one, `{}`, again", search.objective.name()),
            )
            .hint("name another one, or omit it"),
        );
    }
    for (index, class) in search.classes.iter().flatten().enumerate() {
        if search
            .classes
            .iter()
            .flatten()
            .take(index)
            .any(|known| known == class)
        {
            let key = format!("search.classes[{index}]");
            let message = format!("the class `{}` is named twice", class.name());
            findings.push(toml.finding(&key, message));
        }
    }
}

/// Engines of the study and of its factors' levels.
fn check_engines(
    toml: &TomlText<'_>,
    study: &StudyFile,
    known: &[&'static str],
    findings: &mut Vec<Finding>,
) {
    let mut check = |key: &str, names: Option<&[EngineName]>| {
        findings.extend(check_engine_names(toml, key, names, known));
    };
    check("engines", study.engines.as_deref());
    for (index, factor) in study.factors.iter().enumerate() {
        for (at, level) in factor.levels.iter().flatten().enumerate() {
            let key = format!("factors[{index}].levels[{at}].engines");
            check(&key, level.engines.as_deref());
        }
    }
}

fn goals(
    toml: &TomlText<'_>,
    study: &StudyFile,
    family: &ScenarioFamily,
) -> Result<Vec<String>, Finding> {
    let known: Vec<String> = family.goals().map(str::to_owned).collect();
    let Some(wanted) = &study.goals else {
        if known.is_empty() {
            return Err(toml
                .finding("scenario", "the scenario has no goals to study")
                .hint("a scenario with [iso9283] or [excitation] has none; name another one"));
        }
        return Ok(known);
    };
    if wanted.is_empty() {
        return Err(toml
            .finding("goals", "no goals")
            .hint(format!("omit it, or name some of {}", known.join(", "))));
    }
    for (index, name) in wanted.iter().enumerate() {
        let key = format!("goals[{index}]");
        if !known.contains(name) {
            return Err(toml
                .finding(&key, format!("the scenario has no goal `{name}`"))
                .hint(match nearest_name(name, known.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("it has {}", known.join(", ")),
                }));
        }
        if wanted[..index].contains(name) {
            return Err(toml.finding(&key, format!("the goal `{name}` is named twice")));
        }
    }
    Ok(wanted.clone())
}

struct FactorContext<'a> {
    toml: &'a TomlText<'a>,
    index: usize,
    study: &'a StudyFile,
    family: &'a ScenarioFamily,
}

impl FactorContext<'_> {
    fn finding(&self, key: &str, message: impl Into<String>) -> Finding {
        let whole = if key.is_empty() {
            format!("factors[{}]", self.index)
        } else {
            format!("factors[{}].{key}", self.index)
        };
        self.toml.finding(&whole, message)
    }

    fn resolve(&self, section: &FactorSection) -> Result<StudyFactor, Finding> {
        let given: Vec<&str> = [
            ("values", section.values.is_some()),
            ("grid", section.grid.is_some()),
            ("range", section.range.is_some()),
            ("normal", section.normal.is_some()),
            ("levels", section.levels.is_some()),
        ]
        .into_iter()
        .filter_map(|(name, given)| given.then_some(name))
        .collect();
        match given.as_slice() {
            [] => {
                return Err(self
                    .finding(
                        "name",
                        format!("the factor `{}` has no values", section.name),
                    )
                    .hint("one of `values`, `grid`, `range`, `normal` and `levels`"));
            }
            [_] => {}
            [first, second, ..] => {
                return Err(self
                    .finding(second, format!("`{second}` contradicts `{first}`"))
                    .hint("a factor has one of `values`, `grid`, `range`, `normal` and `levels`"));
            }
        }
        let key = self.key(section)?;
        let sampled = section.sampled || section.range.is_some() || section.normal.is_some();
        if sampled && self.study.sampling.samples.is_none() {
            return Err(self
                .finding(
                    given[0],
                    format!(
                        "the factor `{}` is sampled, but the number of samples is missing",
                        section.name
                    ),
                )
                .hint("`samples = 256` under [sampling]"));
        }
        let values = match (&key, section) {
            (
                None,
                FactorSection {
                    levels: Some(levels),
                    ..
                },
            ) => FactorValues::Levels(self.levels(levels)?),
            (
                Some(key),
                FactorSection {
                    values: Some(values),
                    ..
                },
            ) => FactorValues::Levels(self.listed(key, section, values)?),
            (
                Some(key),
                FactorSection {
                    grid: Some(grid), ..
                },
            ) => FactorValues::Levels(self.grid(key, section, *grid)?),
            (
                Some(key),
                FactorSection {
                    range: Some(range), ..
                },
            ) => self.range(key, section, *range)?,
            (
                Some(key),
                FactorSection {
                    normal: Some(normal),
                    ..
                },
            ) => self.normal(key, section, *normal)?,
            _ => unreachable!("one of the five is given, and only levels have no key"),
        };
        Ok(StudyFactor {
            name: section.name.clone(),
            unit: key.as_ref().map_or("", KeyPath::unit).to_owned(),
            role: section.role,
            sampled,
            values,
        })
    }

    /// The key that a factor sets; none for named levels.
    fn key(&self, section: &FactorSection) -> Result<Option<KeyPath>, Finding> {
        if section.levels.is_some() {
            if section.key.is_some() {
                return Err(self
                    .finding("key", "`key` contradicts `levels`")
                    .hint("a level names its keys under `set`"));
            }
            if section.relative {
                return Err(self
                    .finding("relative", "levels set their keys and cannot add to them")
                    .hint("omit it"));
            }
            return Ok(None);
        }
        let Some(key) = &section.key else {
            return Err(self
                .finding(
                    "name",
                    format!("the factor `{}` has no `key`", section.name),
                )
                .hint("the key of the scenario that it sets, such as `phantom.position_mm[0]`"));
        };
        KeyPath::parse(key)
            .map(Some)
            .map_err(|message| self.finding("key", message))
    }

    fn listed(
        &self,
        key: &KeyPath,
        section: &FactorSection,
        values: &[Setting],
    ) -> Result<Vec<StudyLevel>, Finding> {
        if values.is_empty() {
            return Err(self
                .finding(
                    "values",
                    format!("the factor `{}` has no values", section.name),
                )
                .hint("an empty list has no cases"));
        }
        let mut levels: Vec<StudyLevel> = Vec::with_capacity(values.len());
        for (index, value) in values.iter().enumerate() {
            let here = format!("values[{index}]");
            let label = value.to_string();
            if levels.iter().any(|level| level.label == label) {
                return Err(self.finding(&here, format!("{label} is listed twice")));
            }
            let change =
                change_of(section, value).map_err(|message| self.finding(&here, message))?;
            self.check(key, &change, &here)?;
            levels.push(StudyLevel {
                label,
                number: value.number(),
                changes: vec![(key.clone(), change)],
                mode: None,
                engines: None,
            });
        }
        Ok(levels)
    }

    fn grid(
        &self,
        key: &KeyPath,
        section: &FactorSection,
        grid: GridSection,
    ) -> Result<Vec<StudyLevel>, Finding> {
        let GridSection { from, to, steps } = grid;
        if from == to {
            return Err(self
                .finding(
                    "grid.to",
                    format!("the grid ends where it begins, at {from}"),
                )
                .hint("give a single value under `values`"));
        }
        (0..steps)
            .map(|step| {
                // Exact at both ends, and in between wherever the steps are whole numbers.
                let number = if step + 1 == steps {
                    to
                } else {
                    from + (to - from) * f64::from(step) / f64::from(steps - 1)
                };
                let value = Setting::from(number);
                let change =
                    change_of(section, &value).map_err(|message| self.finding("grid", message))?;
                self.check(key, &change, "grid")?;
                Ok(StudyLevel {
                    label: value.to_string(),
                    number: Some(number),
                    changes: vec![(key.clone(), change)],
                    mode: None,
                    engines: None,
                })
            })
            .collect()
    }

    fn range(
        &self,
        key: &KeyPath,
        section: &FactorSection,
        [low, high]: [f64; 2],
    ) -> Result<FactorValues, Finding> {
        if low >= high {
            return Err(self
                .finding("range", format!("the range from {low} to {high} is empty"))
                .hint("the lower end first"));
        }
        self.continuum(
            key,
            section,
            "range",
            Distribution::Uniform { low, high },
            &[low, high],
        )
    }

    fn normal(
        &self,
        key: &KeyPath,
        section: &FactorSection,
        normal: NormalSection,
    ) -> Result<FactorValues, Finding> {
        if let Some([low, high]) = normal.within {
            if low >= high {
                return Err(self
                    .finding(
                        "normal.within",
                        format!("the range from {low} to {high} is empty"),
                    )
                    .hint("the lower end first"));
            }
            if low > normal.mean + FARTHEST_SD * normal.sd
                || high < normal.mean - FARTHEST_SD * normal.sd
            {
                return Err(self
                    .finding(
                        "normal.within",
                        format!("the range from {low} to {high} is more than {FARTHEST_SD} standard deviations from the mean"),
                    )
                    .hint("almost none of the distribution is there: use `range`"));
            }
        }
        self.continuum(
            key,
            section,
            "normal",
            Distribution::Normal(normal),
            &[normal.mean],
        )
    }

    fn continuum(
        &self,
        key: &KeyPath,
        section: &FactorSection,
        name: &str,
        distribution: Distribution,
        examples: &[f64],
    ) -> Result<FactorValues, Finding> {
        if section.sampled {
            return Err(self
                .finding(
                    "sampled",
                    format!("a factor with `{name}` is always sampled"),
                )
                .hint("omit `sampled`"));
        }
        for &example in examples {
            let change = if section.relative {
                Change::Add(example)
            } else {
                Change::Set(Setting::from(example))
            };
            self.check(key, &change, name)?;
        }
        Ok(FactorValues::Continuum {
            key: key.clone(),
            relative: section.relative,
            distribution,
        })
    }

    fn levels(&self, sections: &[super::LevelSection]) -> Result<Vec<StudyLevel>, Finding> {
        if sections.is_empty() {
            return Err(self
                .finding("levels", "no levels")
                .hint("an empty list has no cases"));
        }
        let mut levels: Vec<StudyLevel> = Vec::with_capacity(sections.len());
        for (index, section) in sections.iter().enumerate() {
            let here = |key: &str| format!("levels[{index}].{key}");
            if section.name.trim().is_empty() {
                return Err(self.finding(&here("name"), "a level needs a name"));
            }
            if levels.iter().any(|level| level.label == section.name) {
                return Err(self.finding(
                    &here("name"),
                    format!("two levels are named `{}`", section.name),
                ));
            }
            let is_bare = |each: &super::LevelSection| {
                each.set.is_empty() && each.mode.is_none() && each.engines.is_none()
            };
            if is_bare(section) && sections.iter().filter(|each| is_bare(each)).count() > 1 {
                return Err(self
                    .finding(
                        &here("name"),
                        format!(
                            "the level `{}` changes nothing, but is not the only one",
                            section.name
                        ),
                    )
                    .hint("only one level may be the unchanged scenario"));
            }
            let mut changes = Vec::new();
            for (key, value) in &section.set {
                let here = format!("levels[{index}].set.\"{key}\"");
                let path = KeyPath::parse(key).map_err(|message| self.finding(&here, message))?;
                let change = Change::Set(value.clone());
                self.check(&path, &change, &here)?;
                changes.push((path, change));
            }
            levels.push(StudyLevel {
                label: section.name.clone(),
                number: None,
                changes,
                mode: section.mode,
                engines: section.engines.clone(),
            });
        }
        Ok(levels)
    }

    /// Whether the scenario has the key and the value fits.
    fn check(&self, key: &KeyPath, change: &Change, at: &str) -> Result<(), Finding> {
        self.family
            .check(key, change)
            .map_err(|message| self.finding(at, message))
    }
}

/// What a value does to its key.
fn change_of(section: &FactorSection, value: &Setting) -> Result<Change, String> {
    if !section.relative {
        return Ok(Change::Set(value.clone()));
    }
    value
        .number()
        .map(Change::Add)
        .ok_or_else(|| format!("{value} cannot be added to a number"))
}

/// Two factors must not set the same key, and engines need dynamic cases.
fn check_together(
    toml: &TomlText<'_>,
    study: &StudyFile,
    factors: &[StudyFactor],
    findings: &mut Vec<Finding>,
) {
    let mut setters: BTreeMap<String, usize> = BTreeMap::new();
    for (index, factor) in factors.iter().enumerate() {
        let keys: Vec<(String, bool)> = match &factor.values {
            FactorValues::Continuum { key, relative, .. } => vec![(key.to_string(), *relative)],
            FactorValues::Levels(levels) => levels
                .iter()
                .flat_map(|level| &level.changes)
                .map(|(key, change)| (key.to_string(), matches!(change, Change::Add(_))))
                .collect(),
        };
        let mut own: Vec<&str> = Vec::new();
        for (key, relative) in &keys {
            // What is added to a key may come on top of another factor's value.
            if *relative || own.contains(&key.as_str()) {
                continue;
            }
            own.push(key);
            let overlap = setters
                .iter()
                .find(|(other, _)| overlaps(other, key))
                .map(|(other, first)| (other.clone(), *first));
            if let Some((other, first)) = overlap {
                findings.push(
                    toml.finding(
                        &format!("factors[{index}].name"),
                        format!(
                            "the factors `{}` and `{}` contradict each other: both set `{}`",
                            factors[first].name,
                            factor.name,
                            if other.len() > key.len() { key } else { &other },
                        ),
                    )
                    .hint("make one of them `relative`, or put both into `levels` of one factor"),
                );
            }
        }
        setters.extend(own.into_iter().map(|key| (key.to_owned(), index)));
    }
    let some_dynamic = study.mode == Some(StudyMode::Dynamic)
        || factors.iter().any(|factor| match &factor.values {
            FactorValues::Levels(levels) => levels
                .iter()
                .any(|level| level.mode == Some(StudyMode::Dynamic)),
            FactorValues::Continuum { .. } => false,
        });
    if study.engines.is_some() && !some_dynamic {
        findings.push(
            toml.finding("engines", "no case of the study is dynamic")
                .hint("set `mode = \"dynamic\"`, or omit the engines"),
        );
    }
}

/// Whether one key is the other or a part of it.
fn overlaps(a: &str, b: &str) -> bool {
    let (short, long) = if a.len() <= b.len() { (a, b) } else { (b, a) };
    long.strip_prefix(short)
        .is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

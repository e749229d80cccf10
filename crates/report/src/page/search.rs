//! The page of a search.

use needlebench_bench::search::{PreparedSearch, placement};
use needlebench_kinematics::Joints;
use needlebench_study::search::{ChoiceAxis, SearchLog};
use needlebench_study::{FactorKind, Role};
use serde_json::{Value, json};

use super::document::png_address;
use super::pack::Pack;
use super::viewer::Viewer;
use crate::picture::configuration::placement_picture;
use crate::table::search::shown;

const SCRIPT: &str = concat!(
    include_str!("assets/study_figure.js"),
    include_str!("assets/search.js")
);
const STYLE: &str = concat!(
    include_str!("assets/study.css"),
    include_str!("assets/search.css")
);

/// Placements that are rendered: the winner and candidates tied with it.
const MOST_PICTURES: usize = 3;

/// The page of a finished search: the best candidate, the sensitivity about it, equivalent candidates, the progress,
/// and images of the placements.
///
/// # Errors
/// Failures of rendering.
pub(crate) fn search_page(
    search: &PreparedSearch,
    log: &SearchLog,
    document: &Value,
) -> Result<String, needlebench_render::PictureError> {
    let axes = &search.space.choices().0;
    let factors: Vec<Value> = search
        .choices()
        .zip(axes)
        .zip(
            search
                .study
                .file
                .factors
                .iter()
                .filter(|each| each.role == Role::Control),
        )
        .map(|((factor, axis), section)| {
            let (levels, range) = match (axis, &factor.kind) {
                (ChoiceAxis::Range { low, high }, _) => (None, Some([*low, *high])),
                (ChoiceAxis::Levels(_), FactorKind::Levels(levels)) => {
                    let of = |level: &needlebench_study::Level| {
                        level
                            .number
                            .map_or_else(|| json!(level.label), |number| json!(number))
                    };
                    (Some(levels.iter().map(of).collect::<Vec<Value>>()), None)
                }
                _ => (None, None),
            };
            json!({
                "name": factor.name,
                "words": factor.name.replace('_', " "),
                "unit": factor.unit,
                "key": section.key,
                "levels": levels,
                "range": range,
            })
        })
        .collect();
    let objectives: Vec<Value> = log
        .objectives
        .iter()
        .map(|objective| {
            json!({
                "words": objective.words(),
                "unit": objective.unit(),
                "moreIsBetter": objective.more_is_better(),
            })
        })
        .collect();
    let mut pictures = Vec::new();
    if let Some(answer) = &log.answer {
        let on_the_front = answer.front.iter().filter(|member| member.by_estimate);
        let others = on_the_front
            .map(|member| member.id)
            .chain(answer.equals.iter().copied())
            .filter(|&id| id != answer.winner);
        for id in std::iter::once(answer.winner)
            .chain(others)
            .take(MOST_PICTURES)
        {
            let Some(placed) = placement(search, id, log) else {
                continue;
            };
            let q = Joints::from_column_slice(&placed.joints_rad);
            let image = placement_picture(&placed.resolved, &q).to_png()?;
            let what: Vec<String> = log.candidates[id]
                .choice
                .iter()
                .map(|(name, value)| format!("{} {}", name.replace('_', " "), shown(value)))
                .collect();
            pictures.push(json!({
                "id": id,
                "address": png_address(&image),
                "choice": what.join(", "),
                "configuration": placed.configuration,
                "goal": placed.resolved.goals[0].name,
                "marginMm": placed.margin_m * 1e3,
            }));
        }
    }
    let page = json!({
        "kind": "search",
        "name": search.study.file.name,
        "factors": factors,
        "objectives": objectives,
        "search": document,
        "pictures": pictures,
    });
    let viewer = Viewer {
        kind: "search",
        name: &search.study.file.name,
        description: &search.study.file.description,
        script: SCRIPT,
        style: STYLE,
    };
    Ok(viewer.html(Pack::default(), &page))
}

//! What the needle may pass through by name, and what it cannot be kept away from.

use std::collections::BTreeSet;

use super::phantom::PlacedPhantom;
use crate::scenario::NeedleRouteSection;
use needlebench_input::{Finding, TomlText, nearest_name};
use needlebench_phantom::{RouteObstacle, Tissue};

/// Rejects unknown names, and notes structures that the needle path is not checked against.
pub(super) fn check_needle_route(
    toml: &TomlText<'_>,
    section: &NeedleRouteSection,
    phantom: Option<&PlacedPhantom>,
    notes: &mut Vec<String>,
) -> Result<(), Finding> {
    let tissues = [Tissue::Bone, Tissue::Vessel, Tissue::Organ];
    let parts = phantom.map_or(&[][..], |placed| &placed.phantom.route_obstacles().parts);
    // Nothing keeps a needle out of a fissure, so none is to be left to pass.
    let parts = parts.iter().filter(|part| part.tissue != Tissue::Fissure);
    let parts: Vec<&RouteObstacle> = parts.collect();
    for (index, name) in section.off.iter().enumerate() {
        let is_tissue = tissues.iter().any(|tissue| tissue.to_string() == *name);
        let is_known = is_tissue || name == NeedleRouteSection::MEDIASTINUM;
        if is_known || parts.iter().any(|part| part.is_called(name)) {
            continue;
        }
        let words = tissues.map(|tissue| tissue.to_string());
        let structures: BTreeSet<&str> = parts
            .iter()
            .filter_map(|part| part.organ.as_deref())
            .collect();
        let known = words.iter().map(String::as_str);
        let known = known.chain([NeedleRouteSection::MEDIASTINUM]);
        let known: Vec<&str> = known.chain(structures).collect();
        let near = nearest_name(
            name,
            known
                .iter()
                .copied()
                .chain(parts.iter().map(|part| part.name.as_str())),
        );
        let finding = toml.finding(
            &format!("planning.needle_route.off[{index}]"),
            format!("the phantom has no `{name}`"),
        );
        return Err(finding.hint(match near {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("one of {}, or the name of a part", known.join(", ")),
        }));
    }
    if phantom.is_none() {
        return Ok(());
    }
    if !section.off.is_empty() {
        notes.push(format!(
            "needle path: no distance is required from {} (`planning.needle_route.off`)",
            section.off.join(", ")
        ));
    }
    let missing = tissues
        .into_iter()
        .filter(|tissue| parts.iter().all(|part| part.tissue != *tissue));
    let missing: Vec<String> = missing.map(|tissue| tissue.to_string()).collect();
    if !missing.is_empty() {
        notes.push(format!(
            "needle path: not checked against {}, which the phantom does not have",
            missing.join(", ")
        ));
    }
    Ok(())
}

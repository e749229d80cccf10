//! Parts that stick out of the skin or into each other.

use nalgebra::Point3;
use needlebench_geometry::mesh::{SurfaceIndex, extent_m};
use needlebench_input::{Finding, TomlText};
use needlebench_phantom::{PhantomPart, SkinSurface, Tissue};

use super::read::PartMesh;
use crate::scenario::{PartSection, PartTissue};

/// How far a part may stick out of the skin: segmentations are as rough as their voxels.
const OUT_OF_SKIN_M: f64 = 1e-3;

/// How far parts may reach into each other before it is noted.
const INTO_EACH_OTHER_M: f64 = 2e-3;

/// Fineness of curved surfaces when they are compared with the skin, m.
const CHORD_ERROR_M: f64 = 1e-3;

/// Refuses parts that stick out of the skin, the user's and the model's.
pub(super) fn check_inside_skin(
    toml: &TomlText<'_>,
    sections: &[PartSection],
    meshes: &[PartMesh],
    parts: &[PhantomPart],
    skin: &SkinSurface,
) -> Result<(), Finding> {
    let user_skin = sections
        .iter()
        .position(|section| section.tissue == PartTissue::Skin);
    for part in parts {
        if matches!(part.tissue, Tissue::Skin | Tissue::Marker) {
            continue;
        }
        let index = sections
            .iter()
            .position(|section| section.name == part.name);
        // The model's own parts are inside the model's own skin.
        if index.is_none() && user_skin.is_none() {
            continue;
        }
        let worst = if let Some(index) = index {
            outermost(meshes[index].surface.vertices_m.iter().copied(), skin)
        } else {
            let surface = part.solid.shape.surface(CHORD_ERROR_M);
            let pose = part.solid.parent_from_shape;
            outermost(surface.vertices_m.iter().map(|v| pose * v), skin)
        };
        let Some((out_m, at_m)) = worst.filter(|(out_m, _)| *out_m > OUT_OF_SKIN_M) else {
            continue;
        };
        let at = at_m * 1e3;
        let place = format!(
            "extends {:.1} mm out of the skin, at [{:.1}, {:.1}, {:.1}] mm in the phantom frame",
            out_m * 1e3,
            at.x,
            at.y,
            at.z
        );
        return Err(match (index, user_skin) {
            (Some(index), _) => toml
                .finding(
                    &format!("phantom.parts[{index}]"),
                    format!("{} `{}` {place}", part.tissue, part.name),
                )
                .hint(
                    "compare `position_mm`, `rpy_deg` and `unit` of the part with those of the \
                     skin: files of one scan share them",
                ),
            (None, user_skin) => toml
                .finding(
                    &format!("phantom.parts[{}]", user_skin.unwrap_or(0)),
                    format!("the model's {} `{}` {place}", part.tissue, part.name),
                )
                .hint(
                    "the model's parts do not fit into this skin: set `model = \"none\"`, or say \
                     which of them it `replaces`",
                ),
        });
    }
    Ok(())
}

/// The point that is furthest out of the skin, and by how much, m.
fn outermost(
    points: impl Iterator<Item = Point3<f64>>,
    skin: &SkinSurface,
) -> Option<(f64, Point3<f64>)> {
    points
        .filter(|point| !skin.contains(point))
        .map(|point| (-skin.depth_m(&point), point))
        .max_by(|a, b| a.0.total_cmp(&b.0))
}

/// Says which of the user's parts reach into each other; lesions do.
pub(super) fn note_overlaps(
    sections: &[PartSection],
    meshes: &[PartMesh],
    notes: &mut Vec<String>,
) {
    let solid: Vec<usize> = (0..sections.len())
        .filter(|&i| {
            let tissue = sections[i].tissue;
            !matches!(
                tissue,
                PartTissue::Skin | PartTissue::Lesion | PartTissue::Beside | PartTissue::Assumed
            )
        })
        .collect();
    for (at, &a) in solid.iter().enumerate() {
        for &b in &solid[at + 1..] {
            if apart(&meshes[a], &meshes[b]) {
                continue;
            }
            let depth_m = deepest_m(&meshes[a], &meshes[b]).max(deepest_m(&meshes[b], &meshes[a]));
            if depth_m > INTO_EACH_OTHER_M {
                notes.push(format!(
                    "parts `{}` and `{}` overlap: a vertex of one is {:.1} mm inside the other",
                    sections[a].name,
                    sections[b].name,
                    depth_m * 1e3
                ));
            }
        }
    }
}

/// Whether the boxes around two parts are apart.
fn apart(a: &PartMesh, b: &PartMesh) -> bool {
    let ([low_a, high_a], [low_b, high_b]) = (extent_m(&a.surface), extent_m(&b.surface));
    (0..3).any(|axis| low_a[axis] > high_b[axis] || low_b[axis] > high_a[axis])
}

/// Depth of the deepest corner of `a` inside `b`, m; 0 if none is.
fn deepest_m(a: &PartMesh, b: &PartMesh) -> f64 {
    let [low, high] = extent_m(&b.surface);
    let index = SurfaceIndex::new(b.surface.clone());
    a.surface
        .vertices_m
        .iter()
        .filter(|point| (0..3).all(|k| (low[k]..=high[k]).contains(&point[k])))
        .filter(|point| index.contains(point))
        .map(|point| index.distance_m(point))
        .fold(0.0, f64::max)
}

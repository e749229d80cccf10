//! Reading and checking one file.

use std::path::Path;

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use needlebench_geometry::TriangleMesh;
use needlebench_geometry::mesh::{MeshDefect, check_closed, read_stl, size_m};
use needlebench_kinematics::Pose;

use super::unit::wrong_unit;
use crate::Finding;
use crate::files::ModelSource;
use crate::files::source_of;
use crate::input::read_data;
use crate::scenario::{PartSection, PartTissue};
use crate::toml_text::TomlText;

/// A checked part.
pub(super) struct PartMesh {
    /// As users see it.
    pub file: String,
    /// Closed surface in the phantom frame.
    pub surface: TriangleMesh,
}

/// Largest coordinate of a part in the phantom frame, mm: where scanners may put their origin.
const FARTHEST_MM: f64 = 5000.0;

pub(super) fn read_part(
    toml: &TomlText<'_>,
    index: usize,
    section: &PartSection,
    base: &Path,
    notes: &mut Vec<String>,
) -> Result<(PartMesh, ModelSource), Finding> {
    let key = |name: &str| format!("phantom.parts[{index}].{name}");
    let path = base.join(&section.file);
    let file = path.display().to_string();
    let refused = |what: String| toml.finding(&key("file"), format!("{file}: {what}"));
    if let Some((at, value)) = (0..)
        .zip(section.position_mm)
        .find(|(_, value)| value.abs() > FARTHEST_MM)
    {
        return Err(toml
            .finding(
                &key(&format!("position_mm[{at}]")),
                format!("{value} mm is outside -{FARTHEST_MM} to {FARTHEST_MM} mm"),
            )
            .hint("the position is in millimetres, whatever the file's unit"));
    }
    let bytes = read_data(&path).map_err(|error| {
        let hint = error.hint("the path is relative to the scenario's folder");
        refused(error.to_string()).hint(hint)
    })?;
    let in_file = read_stl(&bytes, [1.0; 3])
        .map_err(|why| refused(why.to_string()).hint("parts are STL files, binary or text"))?;
    if let Some((message, hint)) = wrong_unit(section.tissue, section.unit, &size_m(&in_file)) {
        let mut finding = refused(message).hint(hint);
        if toml.span_of(&key("unit")).is_some() {
            finding = Finding {
                message: finding.message,
                hint: finding.hint,
                ..toml.finding(&key("unit"), "")
            };
        }
        return Err(finding);
    }
    let [roll, pitch, yaw] = section.rpy_deg.map(f64::to_radians);
    let phantom_from_file = Pose::from_parts(
        Translation3::from(Vector3::from(section.position_mm) * 1e-3),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    );
    let metres = section.unit.metres();
    let mut surface = TriangleMesh {
        vertices_m: in_file
            .vertices_m
            .iter()
            .map(|vertex| vertex * metres)
            .collect(),
        triangles: in_file.triangles,
    };
    if section.flip {
        for triangle in &mut surface.triangles {
            triangle.swap(1, 2);
        }
    }
    // In the file's own frame, where its author looks for the place.
    let facts = check_closed(&surface).map_err(|defect| {
        let hint = match &defect {
            MeshDefect::Inverted { .. } if section.flip => {
                "it was flipped: leave `flip` out".to_owned()
            }
            MeshDefect::Inverted { .. } => format!("{}, or set `flip = true`", defect.hint()),
            _ => defect.hint().to_owned(),
        };
        refused(format!("part `{}`: {defect}", section.name)).hint(hint)
    })?;
    if facts.shared_edges > 0 {
        notes.push(format!(
            "part `{}` touches itself along {} edges",
            section.name, facts.shared_edges
        ));
    }
    if section.tissue == PartTissue::Skin && facts.components > 1 {
        notes.push(format!(
            "part `{}`: the skin has {} closed parts that share no vertex; cavities within count \
             as outside",
            section.name, facts.components
        ));
    }
    for vertex in &mut surface.vertices_m {
        *vertex = phantom_from_file * *vertex;
    }
    let source = source_of(file.clone(), &bytes);
    Ok((PartMesh { file, surface }, source))
}

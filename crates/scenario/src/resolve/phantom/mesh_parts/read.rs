//! Reading and checking one file.

use std::path::Path;

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use needlebench_geometry::TriangleMesh;
use needlebench_input::{Finding, ModelSource, TomlText};
use needlebench_kinematics::Pose;

use crate::resolve::mesh_file::{FileFault, MeshFile};
use crate::resolve::unit::Kind;
use crate::scenario::{PartSection, PartTissue};

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
    let faulty = |fault: FileFault| toml.finding(&key("file"), fault.message).hint(fault.hint);
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
    let read = MeshFile::read(&section.file, base).map_err(faulty)?;
    let part = format!("phantom.parts[{index}]");
    read.check_unit(toml, &part, &Kind::part(section.tissue), section.unit)?;
    let [roll, pitch, yaw] = section.rpy_deg.map(f64::to_radians);
    let phantom_from_file = Pose::from_parts(
        Translation3::from(Vector3::from(section.position_mm) * 1e-3),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    );
    let mut surface = read.surface(section.unit, section.flip);
    let what = format!("part `{}`", section.name);
    let facts = read
        .check_closed(&surface, section.flip, &what)
        .map_err(faulty)?;
    if facts.shared_edges > 0 {
        notes.push(format!(
            "part `{}` has {} self-touching edges",
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
    let MeshFile { file, source, .. } = read;
    Ok((PartMesh { file, surface }, source))
}

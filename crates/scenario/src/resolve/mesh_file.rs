//! Surfaces from the user's mesh files, for parts of the phantom and for obstacles.

use std::path::Path;

use needlebench_geometry::TriangleMesh;
use needlebench_geometry::mesh::{MeshDefect, MeshFacts, check_closed, size_m};
use needlebench_input::{Finding, ModelSource, TomlText, read_data, source_of};
use needlebench_robot::{MeshFormat, read_mesh};

use crate::scenario::LengthUnit;

use super::unit::{Kind, wrong_unit};

/// What is wrong with a file, and how to fix it.
pub(super) struct FileFault {
    pub message: String,
    pub hint: String,
}

/// Of what states its unit itself the numbers are in millimetres, which is what `unit` says if nothing else is.
const PER_METRE: f64 = 1e3;

/// A file's triangles in its own numbers, those of COLLADA in millimetres.
pub(super) struct MeshFile {
    /// As users see it.
    pub file: String,
    pub in_file: TriangleMesh,
    /// Whether the file states its unit.
    pub has_unit: bool,
    pub source: ModelSource,
}

impl MeshFile {
    /// Reads a file that is named relative to the scenario's folder.
    pub fn read(name: &str, base: &Path) -> Result<Self, FileFault> {
        let path = base.join(name);
        let file = path.display().to_string();
        let bytes = read_data(&path).map_err(|error| FileFault {
            message: format!("{file}: {error}"),
            hint: error
                .hint("the path is relative to the scenario's folder")
                .to_owned(),
        })?;
        let wanted = "STL, OBJ and COLLADA (.dae) are read".to_owned();
        if let Some(other) = MeshFormat::other(name) {
            return Err(FileFault {
                message: format!("{file}: it is {other}"),
                hint: format!("{wanted}: convert it"),
            });
        }
        let format = MeshFormat::of_name(name).unwrap_or(MeshFormat::Stl);
        let scale = if format == MeshFormat::Collada {
            PER_METRE
        } else {
            1.0
        };
        let in_file = read_mesh(&bytes, format, [scale; 3]).map_err(|why| FileFault {
            message: format!("{file}: {why}"),
            hint: wanted,
        })?;
        let source = source_of(file.clone(), &bytes);
        Ok(Self {
            file,
            in_file,
            has_unit: format == MeshFormat::Collada,
            source,
        })
    }

    /// Refuses a file whose size cannot be right in its unit; `file` and `unit` are keys of the section `key`.
    pub fn check_unit(
        &self,
        toml: &TomlText<'_>,
        key: &str,
        kind: &Kind,
        unit: LengthUnit,
    ) -> Result<(), Finding> {
        let [at_file, at_unit] = ["file", "unit"].map(|name| format!("{key}.{name}"));
        let said = |message: &str| format!("{}: {message}", self.file);
        if self.has_unit && unit != LengthUnit::Mm {
            return Err(toml
                .finding(&at_unit, said("the file states its unit"))
                .hint("omit `unit`"));
        }
        let Some((message, hint)) = wrong_unit(kind, unit, &size_m(&self.in_file)) else {
            return Ok(());
        };
        let is_stated = toml.span_of(&at_unit).is_some();
        let at = if is_stated { at_unit } else { at_file };
        let hint = if self.has_unit {
            "the file states its unit: is it the right one?".to_owned()
        } else {
            hint
        };
        Err(toml.finding(&at, said(&message)).hint(hint))
    }

    /// Its surface in metres, in the file's own frame.
    pub fn surface(&self, unit: LengthUnit, flip: bool) -> TriangleMesh {
        let metres = unit.metres();
        let vertices = self.in_file.vertices_m.iter();
        let mut triangles = self.in_file.triangles.clone();
        if flip {
            for triangle in &mut triangles {
                triangle.swap(1, 2);
            }
        }
        TriangleMesh {
            vertices_m: vertices.map(|vertex| vertex * metres).collect(),
            triangles,
        }
    }

    /// Whether a surface of it encloses a solid; `what` names it in the message.
    ///
    /// The surface is in the file's own frame, where its author looks for the place.
    pub fn check_closed(
        &self,
        surface: &TriangleMesh,
        flip: bool,
        what: &str,
    ) -> Result<MeshFacts, FileFault> {
        check_closed(surface).map_err(|defect| {
            let hint = match &defect {
                MeshDefect::Inverted { .. } if flip => "it was flipped: omit `flip`".to_owned(),
                MeshDefect::Inverted { .. } => format!("{}, or set `flip = true`", defect.hint()),
                _ => defect.hint().to_owned(),
            };
            FileFault {
                message: format!("{}: {what}: {defect}", self.file),
                hint,
            }
        })
    }
}

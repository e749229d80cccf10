//! Surfaces from the user's STL files, for parts of the phantom and for obstacles.

use std::path::Path;

use needlebench_geometry::TriangleMesh;
use needlebench_geometry::mesh::{MeshDefect, MeshFacts, check_closed, read_stl};

use crate::files::{ModelSource, source_of};
use crate::input::read_data;
use crate::scenario::LengthUnit;

/// What is wrong with a file, and how to mend it.
pub(super) struct FileFault {
    pub message: String,
    pub hint: String,
}

/// A file's triangles in its own numbers.
pub(super) struct StlFile {
    /// As users see it.
    pub file: String,
    pub in_file: TriangleMesh,
    pub source: ModelSource,
}

impl StlFile {
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
        let in_file = read_stl(&bytes, [1.0; 3]).map_err(|why| FileFault {
            message: format!("{file}: {why}"),
            hint: "an STL file is wanted, binary or text".to_owned(),
        })?;
        let source = source_of(file.clone(), &bytes);
        Ok(Self {
            file,
            in_file,
            source,
        })
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
                MeshDefect::Inverted { .. } if flip => {
                    "it was flipped: leave `flip` out".to_owned()
                }
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

//! Files of meshes: STL, Wavefront OBJ and COLLADA.

mod collada;
mod obj;

use nalgebra::Point3;
use needlebench_geometry::TriangleMesh;
use needlebench_geometry::mesh::{MeshFileError, is_lfs_pointer, read_stl, surface_of_file};

/// Formats that are not read, by how the names of their files end.
const OTHERS: [(&[&str], &str); 12] = [
    (&["ply"], "a PLY file"),
    (&["glb", "gltf"], "a glTF file"),
    (&["step", "stp"], "a STEP file"),
    (&["iges", "igs"], "an IGES file"),
    (&["3mf"], "a 3MF file"),
    (&["off"], "an OFF file"),
    (&["fbx"], "an FBX file"),
    (&["3ds"], "a 3DS file"),
    (&["wrl", "x3d"], "a VRML or X3D file"),
    (&["blend"], "a Blender file"),
    (&["usd", "usda", "usdc", "usdz"], "a USD file"),
    (&["mesh", "msh", "vtk", "vtp"], "a file of a mesh program"),
];

/// Corners, in the file's numbers or m, and triangles.
type Surface = (Vec<Point3<f64>>, Vec<[u32; 3]>);

/// Format of a mesh file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFormat {
    /// Binary or text STL, in no unit.
    Stl,
    /// Wavefront OBJ, in no unit; faces of more than three corners are fans of triangles.
    Obj,
    /// COLLADA 1.4 or 1.5 in its own unit, read in metres; its up axis is not applied, as ROS does not.
    Collada,
}

impl MeshFormat {
    /// By how a file's name ends, in upper or lower case; `None` for what is not read.
    pub fn of_name(name: &str) -> Option<Self> {
        match ending(name)?.as_str() {
            "stl" | "stla" | "stlb" => Some(Self::Stl),
            "obj" => Some(Self::Obj),
            "dae" => Some(Self::Collada),
            _ => None,
        }
    }

    /// What a file is by its name if it is a mesh in a format that is not read: "a PLY file".
    pub fn other(name: &str) -> Option<&'static str> {
        let ending = ending(name)?;
        let other = OTHERS
            .iter()
            .find(|(endings, _)| endings.contains(&ending.as_str()))?;
        Some(other.1)
    }
}

fn ending(name: &str) -> Option<String> {
    let (_, ending) = name.rsplit_once('.')?;
    Some(ending.to_ascii_lowercase())
}

/// Reads a mesh file; `scale` multiplies the coordinates (URDF's `scale`), which are in metres for COLLADA and in the
/// file's numbers else.
///
/// # Errors
/// See [`MeshFileError`].
pub fn read_mesh(
    bytes: &[u8],
    format: MeshFormat,
    scale: [f64; 3],
) -> Result<TriangleMesh, MeshFileError> {
    let (vertices, triangles) = match format {
        MeshFormat::Stl => return read_stl(bytes, scale),
        _ if is_lfs_pointer(bytes) => return Err(MeshFileError::LfsPointer),
        MeshFormat::Obj => obj::read(bytes)?,
        MeshFormat::Collada => collada::read(bytes)?,
    };
    surface_of_file(vertices, triangles, scale)
}

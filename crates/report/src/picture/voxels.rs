//! Surfaces of sets of cubes.

use nalgebra::Vector3;
use needlebench_evaluation::room::VoxelGrid;
use needlebench_geometry::TriangleMesh;

/// The faces between voxels that are in the set and voxels that are not, counter-clockwise seen from
/// outside; by voxel of the grid, whether it is in the set.
pub fn voxel_surface(grid: &VoxelGrid, set: &[bool]) -> TriangleMesh {
    /// Corners of a face in the two other axes, counter-clockwise seen from its positive side.
    const CORNERS: [[usize; 2]; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];
    let [across, deep, high] = grid.cells;
    let is_in = |place: [Option<usize>; 3]| match place {
        [Some(x), Some(y), Some(z)] if x < across && y < deep && z < high => {
            set[grid.index([x, y, z])]
        }
        _ => false,
    };
    let mut mesh = TriangleMesh {
        vertices_m: Vec::new(),
        triangles: Vec::new(),
    };
    for index in (0..set.len()).filter(|index| set[*index]) {
        let place = grid.place(index);
        for axis in 0..3 {
            for outwards in [false, true] {
                let mut beside = place.map(Some);
                beside[axis] = if outwards {
                    Some(place[axis] + 1)
                } else {
                    place[axis].checked_sub(1)
                };
                if is_in(beside) {
                    continue;
                }
                let first = u32::try_from(mesh.vertices_m.len()).unwrap_or(u32::MAX);
                for corner in CORNERS {
                    let mut at = place;
                    at[axis] += usize::from(outwards);
                    at[(axis + 1) % 3] += corner[0];
                    at[(axis + 2) % 3] += corner[1];
                    let offset = Vector3::from(at.map(|each| each as f64 * grid.voxel_m));
                    mesh.vertices_m.push(grid.corner_m + offset);
                }
                mesh.triangles.extend(
                    if outwards {
                        [[0, 1, 2], [0, 2, 3]]
                    } else {
                        [[0, 2, 1], [0, 3, 2]]
                    }
                    .map(|triangle| triangle.map(|corner| first + corner)),
                );
            }
        }
    }
    mesh
}

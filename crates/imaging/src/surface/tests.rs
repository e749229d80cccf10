use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};
use needlebench_geometry::TriangleMesh;
use needlebench_geometry::mesh::{SurfaceIndex, check_closed, volume_m3};
use needlebench_numerics::random::SplitMix64;
use needlebench_volume::VoxelGrid;

use super::*;
use crate::mask::{IndexBox, Mask};

/// Every edge has two triangles, of opposite directions, and the triangles around every vertex are one ring.
fn assert_manifold(mesh: &TriangleMesh) {
    let mut edges = BTreeSet::new();
    for &[a, b, c] in &mesh.triangles {
        for edge in [(a, b), (b, c), (c, a)] {
            assert!(
                edges.insert(edge),
                "edge {edge:?} has two triangles on one side"
            );
        }
    }
    assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "open");
    let mut after: Vec<Vec<(u32, u32)>> = vec![Vec::new(); mesh.vertices_m.len()];
    for &[a, b, c] in &mesh.triangles {
        for [at, from, to] in [[a, b, c], [b, c, a], [c, a, b]] {
            after[at as usize].push((from, to));
        }
    }
    for ring in &after {
        let start = ring[0].0;
        let mut at = start;
        let mut steps = 0;
        loop {
            at = ring.iter().find(|(from, _)| *from == at).unwrap().1;
            steps += 1;
            if at == start {
                break;
            }
        }
        assert_eq!(steps, ring.len(), "a vertex has more than one ring");
    }
}

fn grid(size: [usize; 3]) -> VoxelGrid {
    VoxelGrid::aligned(size, [0.7e-3, 0.8e-3, 1e-3], Point3::new(0.1, -0.2, 0.3)).unwrap()
}

fn random_field(size: [usize; 3], seed: u64, density: u32) -> Vec<i16> {
    let mut random = SplitMix64::new(seed);
    (0..size.iter().product())
        .map(|_| {
            let above = random.below(10) < density;
            let by = i16::try_from(random.below(500)).unwrap();
            if above { by } else { -1 - by }
        })
        .collect()
}

fn with_field<T>(size: [usize; 3], hu: &[i16], then: impl FnOnce(&Field<'_>) -> T) -> T {
    let inside = Mask::of(size, hu, |value| value >= 0);
    then(&Field {
        bounds: IndexBox::whole(size),
        inside: &inside,
        values: Values::Hounsfield {
            hu,
            size,
            level: Level::Everywhere(-0.5),
            typical: [100.0, -100.0],
        },
    })
}

fn error_of(
    size: [usize; 3],
    hu: &[i16],
    grid: &VoxelGrid,
    mesh: TriangleMesh,
) -> Option<SurfaceError> {
    with_field(size, hu, |field| {
        surface_error(field, grid, &SurfaceIndex::new(mesh))
    })
}

fn net_of(size: [usize; 3], hu: &[i16], grid: &VoxelGrid, stride: [usize; 3]) -> TriangleMesh {
    with_field(size, hu, |field| surface_net(field, grid, stride))
}

#[test]
fn each_of_the_256_cells_gives_a_closed_manifold() {
    let size = [2; 3];
    for corners in 1..=255_u32 {
        let hu: Vec<i16> = (0..8)
            .map(|at| if corners >> at & 1 == 1 { 60 } else { -40 })
            .collect();
        let mesh = net_of(size, &hu, &grid(size), [1; 3]);
        assert_manifold(&mesh);
        assert!(volume_m3(&mesh) > 0.0);
    }
}

#[test]
fn random_fields_give_closed_manifolds_at_every_stride() {
    for seed in 0..30 {
        let size = [9, 8, 7];
        let hu = random_field(size, seed, 2 + u32::try_from(seed % 7).unwrap());
        for stride in [[1; 3], [2, 2, 1], [2; 3]] {
            let mesh = net_of(size, &hu, &grid(size), stride);
            if !mesh.triangles.is_empty() {
                assert_manifold(&mesh);
                assert!(volume_m3(&mesh) > 0.0);
            }
        }
    }
}

#[test]
fn left_handed_grids_give_outward_triangles_too() {
    let size = [12; 3];
    let mut steps = *grid(size).steps_m();
    steps.set_column(1, &-steps.column(1).into_owned());
    let mirrored = VoxelGrid::new(size, steps, Point3::origin()).unwrap();
    let mesh = net_of(size, &random_field(size, 4, 3), &mirrored, [1; 3]);
    assert_manifold(&mesh);
    assert!(volume_m3(&mesh) > 0.0);
}

/// A ball whose values fall linearly with the distance from its surface, HU.
fn ball(size: [usize; 3], grid: &VoxelGrid, middle: &Point3<f64>, radius_m: f64) -> Vec<i16> {
    let mut hu = Vec::new();
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 0..size[0] {
                let here = grid.ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
                let beyond_m = (here - middle).norm() - radius_m;
                #[expect(clippy::cast_possible_truncation, reason = "within a thousand")]
                hu.push((-300e3 * beyond_m).clamp(-900.0, 900.0).round() as i16);
            }
        }
    }
    hu
}

/// Of values rounded to whole Hounsfield units of a linear field of 300 HU per mm, and of a ball of 14 mm between voxels
/// of 0.7 x 0.8 x 1 mm: 1 / 600 mm and (0.7^2 + 0.8^2 + 1^2) / (8 x 14) mm.
const BALL_M: f64 = 21e-6;

#[test]
fn vertices_lie_on_the_analytic_surface_at_every_stride() {
    let size = [50, 46, 38];
    let grid = grid(size);
    let middle = grid.ct_from_index(&Point3::new(24.3, 22.1, 18.4));
    let hu = ball(size, &grid, &middle, 14e-3);
    for stride in [[1; 3], [2, 2, 1], [2; 3]] {
        let mesh = net_of(size, &hu, &grid, stride);
        assert_manifold(&mesh);
        for vertex in &mesh.vertices_m {
            let beside_m = (vertex - middle).norm() - 14e-3;
            assert!(beside_m.abs() < BALL_M, "{beside_m}");
        }
    }
}

#[test]
fn what_the_volume_cuts_is_closed_half_a_voxel_beyond() {
    let size = [6; 3];
    let mesh = net_of(size, &[100; 216], &grid(size), [1; 3]);
    assert!(check_closed(&mesh).is_ok());
    let [low, high] = needlebench_geometry::mesh::extent_m(&mesh);
    let extent = high - low;
    let wanted = Vector3::new(6.0 * 0.7e-3, 6.0 * 0.8e-3, 6.0 * 1e-3);
    assert!((extent - wanted).norm() < 1e-9, "{extent}");
}

#[test]
fn simplified_surface_is_a_manifold_near_the_fine_one() {
    let size = [50, 46, 38];
    let grid = grid(size);
    let middle = grid.ct_from_index(&Point3::new(24.3, 22.1, 18.4));
    let hu = ball(size, &grid, &middle, 14e-3);
    let fine = net_of(size, &hu, &grid, [1; 3]);
    for target in [2000, 400] {
        let coarse = simplify(&fine, target, 0.2e-3);
        assert_manifold(&coarse);
        let facts = check_closed(&coarse).unwrap();
        assert_eq!((facts.components, facts.shared_edges), (1, 0));
        assert!(
            coarse.triangles.len() <= target,
            "{}",
            coarse.triangles.len()
        );
        let error = error_of(size, &hu, &grid, coarse).unwrap();
        // Chords of a ball: the square of an edge over 8 radii, edges of sqrt(4 pi r^2 / n * 2.3).
        let edge_m = (4.0 * std::f64::consts::PI * 14e-3 * 14e-3 / target as f64 * 2.3).sqrt();
        assert!(
            error.p99_m < 2.0 * edge_m * edge_m / (8.0 * 14e-3),
            "{error:?} {edge_m}"
        );
    }
}

#[test]
fn simplification_keeps_the_topology_of_random_fields() {
    for seed in 0..10 {
        let size = [14; 3];
        let fine = net_of(size, &random_field(size, seed, 4), &grid(size), [1; 3]);
        let coarse = simplify(&fine, 50, 1e-3);
        assert_manifold(&coarse);
        let euler = |mesh: &TriangleMesh| {
            mesh.vertices_m.len().cast_signed() - (mesh.triangles.len() / 2).cast_signed()
        };
        assert_eq!(euler(&fine), euler(&coarse));
        assert!(coarse.triangles.len() < fine.triangles.len());
    }
}

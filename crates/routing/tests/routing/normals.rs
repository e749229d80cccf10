//! The normal of a body that voxels know alone, against balls whose normal is known.

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_numerics::random::SplitMix64;
use needlebench_routing::body_normal;
use needlebench_volume::{LabelMap, VoxelGrid};

const RADIUS_M: f64 = 0.12;
/// Of 100 places, in slices of 1, 2.5 and 5 mm, 95 are within this, deg: the accuracy that is stated, and a fifth.
const WITHIN_DEG: [f64; 3] = [0.6, 1.4, 1.6];

/// A piece of a ball about a place of its surface, whose normal is `outwards`.
fn piece(outwards: &UnitVector3<f64>, at: &Point3<f64>, slice_m: f64, slices: usize) -> LabelMap {
    let size = [59, 59, slices];
    let spacing_m = [0.7e-3, 0.7e-3, slice_m];
    let first = Point3::new(-20e-3, -20e-3, -20e-3);
    let grid = VoxelGrid::aligned(size, spacing_m, first).unwrap();
    let middle = at - outwards.into_inner() * RADIUS_M;
    let mut labels = Vec::with_capacity(grid.len());
    for k in 0..size[2] {
        for j in 0..size[1] {
            for i in 0..size[0] {
                let here = grid.ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
                labels.push(u16::from((here - middle).norm() < RADIUS_M));
            }
        }
    }
    LabelMap {
        grid,
        labels,
        names: vec![(1, "soft_tissue".to_owned())],
    }
}

#[test]
fn normals_of_balls_are_found_whatever_their_place_in_the_voxels() {
    let mut random = SplitMix64::new(7);
    let mut cube = |half: f64| Vector3::from_fn(|_, _| random.uniform(-half, half));
    // Pieces of 40 mm.
    let scans = [(1e-3, 41), (2.5e-3, 17), (5e-3, 9)];
    for ((slice_m, slices), within_deg) in scans.into_iter().zip(WITHIN_DEG) {
        let mut off_deg = Vec::new();
        while off_deg.len() < 400 {
            let Some(outwards) = UnitVector3::try_new(cube(1.0), 0.2) else {
                continue;
            };
            let at = Point3::from(cube(2e-3));
            let labels = piece(&outwards, &at, slice_m, slices);
            off_deg.push(body_normal(&labels, &at).angle(&outwards).to_degrees());
        }
        off_deg.sort_by(f64::total_cmp);
        assert!(off_deg[379] < within_deg, "{slice_m}: {}", off_deg[379]);
    }
}

//! Synthetic volumes against closed forms.

use std::f64::consts::PI;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use needlebench_geometry::mesh::SolidMesh;
use needlebench_geometry::{Shape, Solid, sample_solids};
use needlebench_kinematics::Pose;
use needlebench_numerics::normal::probability_below;
use needlebench_synthesis::{
    Kernel, Noise, Overshoot, ScanPreset, Scanner, Scene, SliceProfile, label, synthesise,
};
use needlebench_volume::{Volume, VolumeError, VoxelGrid};

const SEED: u64 = 7;
/// Of values stored as integers: half of one, and rounding.
const STORED_HU: f64 = 0.51;

fn solid(shape: Shape, parent_from_shape: Pose) -> Solid {
    Solid {
        name: String::new(),
        shape,
        parent_from_shape,
    }
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::translation(x, y, z)
}

fn ball(radius_m: f64, centre: Pose) -> Solid {
    solid(Shape::Sphere { radius_m }, centre)
}

/// Cube of voxels about the origin.
fn cube(voxels: usize, spacing_m: [f64; 3]) -> VoxelGrid {
    let first = spacing_m.map(|step_m| -0.5 * (voxels - 1) as f64 * step_m);
    VoxelGrid::aligned([voxels; 3], spacing_m, first.into()).unwrap()
}

fn scan(scene: &Scene, scanner: &Scanner, grid: &VoxelGrid) -> Volume {
    synthesise(scene, scanner, grid, SEED, 2, &AtomicBool::new(false)).unwrap()
}

fn with(solids: impl IntoIterator<Item = (Solid, f64)>) -> Scene {
    let mut scene = Scene::default();
    for (solid, hu) in solids {
        let label = scene.label(&format!("{}", scene.parts.len()));
        scene.push(solid, hu, label);
    }
    scene
}

/// Blurred and nothing else: no noise, no circle, nothing clipped.
fn blurred(slice_thickness_m: f64, psf_sigma_m: f64) -> Scanner {
    Scanner {
        psf_sigma_m,
        ..Scanner::ideal(slice_thickness_m)
    }
}

/// What is above air: its sum in HU m^3, its centre, and the second moments about that, m^2.
fn moments(volume: &Volume) -> (f64, Point3<f64>, Matrix3<f64>) {
    let grid = &volume.grid;
    let [columns, rows, slices] = grid.size();
    let mut sum = 0.0;
    let mut first = Vector3::zeros();
    let mut second = Matrix3::zeros();
    for k in 0..slices {
        for j in 0..rows {
            for i in 0..columns {
                let value = f64::from(volume.hu[grid.offset([i, j, k])]) + 1000.0;
                let place = grid
                    .ct_from_index(&Point3::new(i as f64, j as f64, k as f64))
                    .coords;
                sum += value;
                first += place * value;
                second += place * place.transpose() * value;
            }
        }
    }
    let centre = first / sum;
    let voxel_m3 = grid.steps_m().determinant().abs();
    (
        sum * voxel_m3,
        centre.into(),
        second / sum - centre * centre.transpose(),
    )
}

#[test]
fn a_ball_has_the_mass_centre_and_spread_of_the_closed_form_in_every_preset() {
    /// Of the mass: the fourth order of cell over radius (2e-5 of 5 mm balls), the Gaussian's tail (6e-5), integers.
    const MASS: f64 = 3e-4;
    /// Of the centre: the same, of a ball of 5 mm.
    const CENTRE_M: f64 = 1e-6;
    /// Of the variance along an axis, of 1 mm^2 and more.
    const VARIANCE: f64 = 2e-3;
    let radius_m = 2.5e-3;
    for preset in [
        ScanPreset::Thin,
        ScanPreset::Biopsy,
        ScanPreset::Thick,
        ScanPreset::ThickOverlap,
    ] {
        let [thickness_m, increment_m] = preset.thickness_and_increment_m();
        for (kernel, place) in [
            (Kernel::Smooth, [0.13e-3, -0.21e-3, 0.32e-3]),
            (Kernel::Sharp, [-0.35e-3, 0.29e-3, -0.11e-3]),
        ] {
            let scene = with([(ball(radius_m, at(place[0], place[1], place[2])), 1200.0)]);
            // Small enough pixels that sums over them are integrals.
            let sigma_m = kernel.psf_sigma_m();
            let pixel_m = 1.2 * sigma_m;
            let grid = cube(26, [pixel_m, pixel_m, increment_m]);
            let volume = scan(&scene, &blurred(thickness_m, sigma_m), &grid);
            let (mass, centre, spread) = moments(&volume);
            let exact = 2200.0 * 4.0 / 3.0 * PI * radius_m.powi(3);
            assert!(
                (mass / exact - 1.0).abs() < MASS,
                "{preset:?} {kernel:?}: {}",
                mass / exact
            );
            let of_ball = radius_m * radius_m / 5.0;
            for axis in 0..2 {
                assert!(
                    (centre[axis] - place[axis]).abs() < CENTRE_M,
                    "{preset:?} {centre}"
                );
                let exact = of_ball + sigma_m * sigma_m;
                let ratio = spread[(axis, axis)] / exact;
                assert!(
                    (ratio - 1.0).abs() < VARIANCE,
                    "{preset:?} {kernel:?} {axis}: {ratio}"
                );
            }
            // Along z the samples are too far apart to tell but of thin slices.
            if preset == ScanPreset::Thin {
                assert!((centre.z - place[2]).abs() < 10.0 * CENTRE_M, "{centre}");
                let exact = of_ball + thickness_m * thickness_m / 12.0;
                assert!((spread[(2, 2)] / exact - 1.0).abs() < 0.01);
            }
        }
    }
}

#[test]
fn the_middle_of_a_blurred_ball_is_the_integral_of_gaussian_and_profile() {
    let radius_m = 1.5e-3;
    let thickness_m = 2.5e-3;
    let sigma_m = 0.55e-3;
    let grid = cube(15, [0.7e-3; 3]);
    let scene = with([(ball(radius_m, Pose::identity()), 1200.0)]);
    let volume = scan(&scene, &blurred(thickness_m, sigma_m), &grid);
    let steps = 20_000;
    let mean: f64 = (0..steps)
        .map(|step| {
            let z_m = thickness_m * ((f64::from(step) + 0.5) / f64::from(steps) - 0.5);
            let disc = (radius_m * radius_m - z_m * z_m).max(0.0);
            1.0 - libm::exp(-disc / (2.0 * sigma_m * sigma_m))
        })
        .sum::<f64>()
        / f64::from(steps);
    let middle = f64::from(volume.hu[grid.offset([7, 7, 7])]);
    // 1 HU: the blur is a sum over cells.
    assert!(
        (middle - (2200.0 * mean - 1000.0)).abs() < STORED_HU + 1.0,
        "{middle}"
    );
}

#[test]
fn an_edge_has_the_profile_of_the_gaussian_wherever_it_is_and_however_it_lies() {
    /// Share of the edge's height: straight pieces from cell to cell, at least two of them per standard deviation.
    const OF_EDGE: f64 = 5e-3;
    let grid = cube(21, [0.7e-3, 0.7e-3, 1e-3]);
    // By itself in air, and against another part that touches there.
    for (sigma_m, beyond) in [
        (0.55e-3, None),
        (0.3e-3, None),
        (0.55e-3, Some(200.0)),
        (0.3e-3, Some(-1000.0)),
    ] {
        for (turn, shift_m) in [
            (0.0, 0.0),
            (0.0, 0.17e-3),
            (0.4, -0.1e-3),
            (PI / 2.0, 0.23e-3),
        ] {
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
            let half = 0.1;
            let shape = Shape::Cuboid {
                half_extents_m: Vector3::repeat(half),
            };
            let normal = rotation * Vector3::x();
            let pose = |along_m: f64| Pose::from_parts((normal * along_m).into(), rotation);
            let mut parts = vec![(solid(shape.clone(), pose(shift_m - half)), 1000.0)];
            parts.extend(beyond.map(|hu| (solid(shape, pose(shift_m + half)), hu)));
            let scene = with(parts);
            let beyond_hu = beyond.unwrap_or(-1000.0);
            let volume = scan(&scene, &blurred(1e-3, sigma_m), &grid);
            for j in 6..15 {
                for i in 0..21 {
                    let place = grid.ct_from_index(&Point3::new(i as f64, j as f64, 10.0));
                    let inside_m = shift_m - normal.dot(&place.coords);
                    let edge_hu = 1000.0 - beyond_hu;
                    let exact = edge_hu * probability_below(inside_m / sigma_m) + beyond_hu;
                    let stored = f64::from(volume.hu[grid.offset([i, j, 10])]);
                    assert!(
                        (stored - exact).abs() < STORED_HU + OF_EDGE * edge_hu,
                        "sigma {sigma_m}, beyond {beyond_hu}, turn {turn}, shift {shift_m}, {i} {j}: {stored} for {exact}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_slice_integrates_over_its_thickness_whatever_the_distance_of_slices() {
    // A plate of 1 mm that reaches across the image, off the slices' middles.
    let [low_m, high_m] = [0.3e-3, 1.3e-3];
    let half_extents_m = Vector3::new(0.1, 0.1, 0.5 * (high_m - low_m));
    let scene = with([(
        solid(
            Shape::Cuboid { half_extents_m },
            at(0.0, 0.0, 0.5 * (low_m + high_m)),
        ),
        1000.0,
    )]);
    for (profile, thickness_m, increment_m) in [
        (SliceProfile::Box, 5e-3, 2.5e-3),
        (SliceProfile::Box, 1e-3, 2.5e-3),
        (SliceProfile::Box, 2.3e-3, 0.7e-3),
        (SliceProfile::Bell, 2.5e-3, 0.9e-3),
    ] {
        let grid = cube(9, [1e-3, 1e-3, increment_m]);
        let scanner = Scanner {
            slice_profile: profile,
            ..Scanner::ideal(thickness_m)
        };
        let volume = scan(&scene, &scanner, &grid);
        for k in 0..9 {
            let z_m = grid.ct_from_index(&Point3::new(4.0, 4.0, k as f64)).z;
            let [from_m, to_m] = [low_m - z_m, high_m - z_m];
            let share = match profile {
                SliceProfile::Box => {
                    let half = 0.5 * thickness_m;
                    (to_m.min(half) - from_m.max(-half)).max(0.0) / thickness_m
                }
                SliceProfile::Bell => {
                    let sigma_m = thickness_m / (8.0 * libm::log(2.0_f64)).sqrt();
                    probability_below(to_m / sigma_m) - probability_below(from_m / sigma_m)
                }
            };
            let exact = 2000.0 * share - 1000.0;
            let stored = f64::from(volume.hu[grid.offset([4, 4, k])]);
            // The bell is cut off, and even within a layer of half a millimetre.
            let allowed = STORED_HU
                + if profile == SliceProfile::Bell {
                    12.0
                } else {
                    0.0
                };
            assert!(
                (stored - exact).abs() < allowed,
                "{profile:?} {k}: {stored} for {exact}"
            );
        }
    }
}

#[test]
fn thin_things_and_things_that_touch_keep_their_mass() {
    /// Of the mass of plates of 0.1 to 1 mm: where surfaces meet in a sixteenth of a cell.
    const MASS: f64 = 5e-3;
    let turned = UnitQuaternion::from_euler_angles(0.4, 1.1, 0.0);
    let grid = cube(40, [0.7e-3, 0.7e-3, 1e-3]);
    let pose = |along_m: f64| Pose::from_parts((turned * Vector3::z() * along_m).into(), turned);
    let disc = |half_length_m: f64| Shape::Cylinder {
        radius_m: 9e-3,
        half_length_m,
    };
    let volume_m3 = |height_m: f64| PI * 9e-3_f64.powi(2) * height_m;
    let [plate, film] = [(0.5e-3, 1e-3), (0.05e-3, 0.1e-3)].map(|(half_m, height_m)| {
        let scene = with([(solid(disc(half_m), pose(0.0)), 100.0)]);
        let (mass, ..) = moments(&scan(&scene, &blurred(1e-3, 0.55e-3), &grid));
        mass / (1100.0 * volume_m3(height_m))
    });
    assert!((plate - 1.0).abs() < MASS, "{plate}");
    assert!((film - 1.0).abs() < 4.0 * MASS, "{film}");
    // Two halves of a disc, one on top of the other, without a gap between them.
    let halves = with([
        (solid(disc(1e-3), pose(-1e-3)), 100.0),
        (solid(disc(1e-3), pose(1e-3)), 100.0),
    ]);
    let (mass, centre, _) = moments(&scan(&halves, &blurred(1e-3, 0.55e-3), &grid));
    let ratio = mass / (1100.0 * volume_m3(4e-3));
    assert!((ratio - 1.0).abs() < MASS, "{ratio}");
    assert!(centre.coords.norm() < 1e-5, "{centre}");
}

#[test]
fn every_shape_has_its_volume_and_a_mesh_is_as_the_same_convex_body() {
    const MASS: f64 = 2e-3;
    let pose = Pose::from_parts(
        Vector3::new(0.2e-3, -0.4e-3, 0.1e-3).into(),
        UnitQuaternion::from_euler_angles(0.3, 0.5, 0.7),
    );
    let grid = cube(34, [0.8e-3, 0.8e-3, 1e-3]);
    let (r, h) = (5e-3, 4e-3);
    let half_extents_m = Vector3::new(4e-3, 6e-3, 7e-3);
    let box_mesh = sample_solids::cuboid(half_extents_m.into());
    let cases = [
        (
            Shape::Cylinder {
                radius_m: r,
                half_length_m: h,
            },
            PI * r * r * 2.0 * h,
        ),
        (
            Shape::Capsule {
                radius_m: r,
                half_length_m: h,
            },
            PI * r * r * 2.0 * h + 4.0 / 3.0 * PI * r.powi(3),
        ),
        (
            Shape::Cuboid { half_extents_m },
            8.0 * half_extents_m.product(),
        ),
        (
            Shape::of_surface(box_mesh.clone()),
            8.0 * half_extents_m.product(),
        ),
        (
            Shape::Mesh(Arc::new(SolidMesh::new(box_mesh))),
            8.0 * half_extents_m.product(),
        ),
    ];
    let volumes = cases.map(|(shape, volume_m3)| {
        let volume = scan(
            &with([(solid(shape.clone(), pose), 500.0)]),
            &blurred(1e-3, 0.55e-3),
            &grid,
        );
        let (mass, centre, _) = moments(&volume);
        let ratio = mass / (1500.0 * volume_m3);
        assert!((ratio - 1.0).abs() < MASS, "{shape:?}: {ratio}");
        assert!(
            (centre.coords - pose.translation.vector).norm() < 2e-6,
            "{shape:?}: {centre}"
        );
        volume
    });
    let differ = |a: &Volume, b: &Volume| {
        let pairs = a.hu.iter().zip(&b.hu);
        pairs.map(|(a, b)| a.abs_diff(*b)).max().unwrap()
    };
    assert!(differ(&volumes[2], &volumes[3]) <= 1);
    let by_mesh = differ(&volumes[2], &volumes[4]);
    assert!(by_mesh <= 5, "{by_mesh} of 1500 HU, at edges");
}

#[test]
fn later_parts_are_on_top_and_labels_are_those_at_the_centres() {
    let scene = with([
        (ball(8e-3, Pose::identity()), 0.0),
        (ball(5e-3, at(3e-3, 0.0, 0.0)), 50.0),
        (ball(1e-3, at(4e-3, 0.1e-3, 0.2e-3)), 90.0),
    ]);
    let grid = cube(25, [0.8e-3; 3]);
    let map = label(&scene, &grid, 2, &AtomicBool::new(false)).unwrap();
    let volume = scan(&scene, &Scanner::ideal(0.8e-3), &grid);
    let mut plain = 0;
    for (offset, label) in map.labels.iter().enumerate() {
        let [i, j, k] = [offset % 25, offset / 25 % 25, offset / 625];
        let place = grid.ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
        let depth_m = |part: usize| {
            let solid = &scene.parts[part].solid;
            let Shape::Sphere { radius_m } = solid.shape else {
                panic!("balls alone")
            };
            radius_m - (place.coords - solid.parent_from_shape.translation.vector).norm()
        };
        let top = (0..3).rev().find(|part| depth_m(*part) > 0.0);
        assert_eq!(usize::from(*label), top.map_or(0, |part| part + 1));
        if (0..3).all(|part| depth_m(part).abs() > 1.5e-3) {
            plain += 1;
            let hu = top.map_or(-1000.0, |part| scene.parts[part].hu);
            assert_eq!(f64::from(volume.hu[offset]), hu);
        }
    }
    assert!(plain > 1000);
}

#[test]
fn a_tilted_gantry_leaves_a_ball_a_ball() {
    let tilt = 20.0_f64.to_radians();
    let spacing_m = 0.7e-3;
    // Rows lean against the table's motion, which stays along z.
    let steps = Matrix3::from_columns(&[
        Vector3::new(spacing_m, 0.0, 0.0),
        Vector3::new(0.0, libm::cos(tilt), -libm::sin(tilt)) * spacing_m,
        Vector3::new(0.0, 0.0, spacing_m),
    ]);
    let middle = steps * Vector3::repeat(14.5);
    let grid = VoxelGrid::new([30; 3], steps, Point3::from(-middle)).unwrap();
    let place = [0.2e-3, -0.3e-3, 0.15e-3];
    let scene = with([(ball(5e-3, at(place[0], place[1], place[2])), 100.0)]);
    let volume = scan(&scene, &Scanner::ideal(spacing_m * libm::cos(tilt)), &grid);
    let (mass, centre, spread) = moments(&volume);
    assert!((mass / (1100.0 * 4.0 / 3.0 * PI * 5e-3_f64.powi(3)) - 1.0).abs() < 1e-3);
    assert!(
        (centre.coords - Vector3::from(place)).norm() < 2e-6,
        "{centre}"
    );
    // A ball's moments and a voxel's, which are 1 % of them.
    let of_ball = 5e-3_f64.powi(2) / 5.0;
    let off = (spread / of_ball - Matrix3::identity()).amax();
    assert!(off < 0.015, "{spread}");
}

#[test]
fn noise_is_as_strong_as_it_says_and_has_the_spectrum_that_it_says() {
    let size = 160;
    let pixel_m = 0.7e-3;
    let grid = VoxelGrid::aligned(
        [size, size, 12],
        [pixel_m, pixel_m, 2.5e-3],
        Point3::origin(),
    )
    .unwrap();
    let scene = Scene {
        around_hu: 0.0,
        ..Scene::default()
    };
    let noise = Noise {
        rim_share: 1.0,
        dose: 0.5,
        ..Noise::of(Kernel::Smooth)
    };
    let scanner = Scanner {
        noise: Some(noise),
        has_circle: false,
        ..Scanner::new(5e-3, Kernel::Smooth)
    };
    let volume = scan(&scene, &scanner, &grid);
    let correlation = |[di, dj, dk]: [usize; 3]| {
        let mut sum = 0.0;
        let mut count = 0.0;
        for k in 0..12 - dk {
            for j in 0..size - dj {
                for i in 0..size - di {
                    let here = f64::from(volume.hu[grid.offset([i, j, k])]);
                    let there = f64::from(volume.hu[grid.offset([i + di, j + dj, k + dk])]);
                    sum += here * there;
                    count += 1.0;
                }
            }
        }
        sum / count
    };
    let variance = correlation([0, 0, 0]);
    let wanted = 20.0 / (5.0_f64 * 0.5).sqrt();
    assert!(
        (variance.sqrt() / wanted - 1.0).abs() < 0.015,
        "{}",
        variance.sqrt()
    );
    // The spectrum's amplitude is g(f) - 0.8 g(2 f): the correlation is that of the two Gaussians' convolutions.
    let sigma = noise.grain_sigma_m / pixel_m;
    let product = |variance: f64, r2: f64| libm::exp(-r2 / (2.0 * variance)) / variance;
    let closed = |r2: f64| {
        let s2 = sigma * sigma;
        product(2.0 * s2, r2) - 1.6 * product(5.0 * s2, r2) + 0.64 * product(8.0 * s2, r2)
    };
    for (lag, r2) in [
        ([1, 0, 0], 1.0),
        ([0, 1, 0], 1.0),
        ([1, 1, 0], 2.0),
        ([2, 0, 0], 4.0),
        ([0, 3, 0], 9.0),
        ([4, 4, 0], 32.0),
    ] {
        let measured = correlation(lag) / variance;
        let exact = closed(r2) / closed(0.0);
        assert!(
            (measured - exact).abs() < 0.02,
            "{lag:?}: {measured} for {exact}"
        );
    }
    // Slices of 5 mm every 2.5 mm share half of what they see, and nothing with the next but one.
    assert!((correlation([0, 0, 1]) / variance - 0.5).abs() < 0.02);
    assert!((correlation([0, 0, 2]) / variance).abs() < 0.02);
    let mean = volume.hu.iter().map(|hu| f64::from(*hu)).sum::<f64>() / volume.hu.len() as f64;
    assert!(mean.abs() < 0.1, "{mean}");
}

#[test]
fn noise_falls_towards_the_rim_and_what_is_outside_the_circle_is_air() {
    let size = 200;
    let grid =
        VoxelGrid::aligned([size, size, 4], [0.7e-3, 0.7e-3, 1e-3], Point3::origin()).unwrap();
    let scene = Scene {
        around_hu: 0.0,
        ..Scene::default()
    };
    let volume = scan(&scene, &Scanner::new(1e-3, Kernel::Smooth), &grid);
    let deviation = |columns: std::ops::Range<usize>| {
        let values: Vec<f64> = (0..4)
            .flat_map(|k| (80..120).map(move |j| (j, k)))
            .flat_map(|(j, k)| columns.clone().map(move |i| [i, j, k]))
            .map(|index| f64::from(volume.hu[grid.offset(index)]))
            .collect();
        (values.iter().map(|hu| hu * hu).sum::<f64>() / values.len() as f64).sqrt()
    };
    let (middle, rim) = (deviation(80..120), deviation(5..20));
    assert!((middle / 20.0 - 1.0).abs() < 0.06, "{middle}");
    assert!((rim / middle - 0.76).abs() < 0.05, "{}", rim / middle);
    assert_eq!(volume.hu[grid.offset([0, 0, 0])], -1000);
    assert_eq!(volume.hu[grid.offset([199, 3, 2])], -1000);
}

#[test]
fn the_same_seed_gives_the_same_volume_on_any_number_of_threads() {
    let scene = with([(ball(8e-3, Pose::identity()), 40.0)]);
    let grid = cube(24, [1e-3; 3]);
    let scanner = Scanner::new(1e-3, Kernel::Sharp);
    let go = AtomicBool::new(false);
    let one = synthesise(&scene, &scanner, &grid, 3, 1, &go).unwrap();
    assert_eq!(one, synthesise(&scene, &scanner, &grid, 3, 5, &go).unwrap());
    assert_ne!(one, synthesise(&scene, &scanner, &grid, 4, 5, &go).unwrap());
}

#[test]
fn metal_is_clipped_and_an_edge_overshoots_where_that_is_asked_for() {
    let steel = with([(ball(4e-3, Pose::identity()), 12_000.0)]);
    let grid = cube(17, [0.7e-3; 3]);
    let plain = scan(
        &steel,
        &Scanner {
            noise: None,
            ..Scanner::new(1e-3, Kernel::Smooth)
        },
        &grid,
    );
    assert_eq!(plain.hu[grid.offset([8, 8, 8])], 3071);
    let half = with([(
        solid(
            Shape::Cuboid {
                half_extents_m: Vector3::repeat(0.1),
            },
            at(-0.1, 0.0, 0.0),
        ),
        0.0,
    )]);
    let enhanced = scan(
        &half,
        &Scanner {
            overshoot: Some(Overshoot::USUAL),
            ..blurred(1e-3, 0.3e-3)
        },
        &grid,
    );
    let row: Vec<i16> = (0..17)
        .map(|i| enhanced.hu[grid.offset([i, 8, 8])])
        .collect();
    let highest = f64::from(*row.iter().max().unwrap());
    let lowest = f64::from(*row.iter().min().unwrap());
    assert!((20.0..200.0).contains(&highest), "{row:?}");
    assert!(
        (highest + lowest + 1000.0).abs() < 40.0,
        "as far above as below: {row:?}"
    );
}

#[test]
fn whoever_asks_to_stop_is_obeyed_and_settings_without_meaning_are_named() {
    let grid = cube(8, [1e-3; 3]);
    let scene = Scene::default();
    let stopped = synthesise(
        &scene,
        &Scanner::ideal(1e-3),
        &grid,
        0,
        1,
        &AtomicBool::new(true),
    );
    assert_eq!(stopped, Err(VolumeError::Interrupted));
    let refused = |scanner: &Scanner, grid: &VoxelGrid| match synthesise(
        &scene,
        scanner,
        grid,
        0,
        1,
        &AtomicBool::new(false),
    ) {
        Err(VolumeError::Refused { message, .. }) => message,
        other => panic!("{other:?}"),
    };
    assert!(refused(&Scanner::ideal(0.0), &grid).contains("slice thickness is 0 mm"));
    assert!(refused(&blurred(1e-3, f64::NAN), &grid).contains("blur"));
    let noise = Some(Noise {
        dose: -1.0,
        ..Noise::of(Kernel::Smooth)
    });
    let scanner = Scanner {
        noise,
        ..Scanner::ideal(1e-3)
    };
    assert!(refused(&scanner, &grid).contains("dose is -1"));
    let skewed = Rotation3::from_euler_angles(0.0, 0.0, 0.1).matrix()
        * Matrix3::new(1e-3, 2e-4, 0.0, 0.0, 1e-3, 0.0, 0.0, 0.0, 1e-3);
    let skewed = VoxelGrid::new([4; 3], skewed, Point3::origin()).unwrap();
    assert!(
        refused(&Scanner::ideal(1e-3), &skewed).contains("78.69"),
        "{}",
        refused(&Scanner::ideal(1e-3), &skewed)
    );
}

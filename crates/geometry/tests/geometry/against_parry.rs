//! Hulls, decompositions, volumes and mesh checks of parry beside ours: which of them this crate
//! uses, and why not the others. The crate's documentation has the figures that the ignored tests
//! print:
//!
//! ```text
//! cargo test --release -p needlebench-geometry -- --ignored --nocapture against_parry
//! ```
//!
//! `MESHES=FOLDER` adds the STL files of a folder, which are in metres.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::panic::catch_unwind;
use std::time::Instant;

use nalgebra::{Point3, Rotation3, Vector3};
use needlebench_geometry::mesh::{
    Fidelity, SurfaceIndex, centroid_m, check_closed, convex_hull, decompose, mend, read_stl,
    simplified_hull, volume_m3, weld,
};
use needlebench_geometry::sample_solids::{both, bowl, cuboid, ell, inverted, torus};
use needlebench_geometry::{ConvexMesh, TriangleMesh};
use needlebench_numerics::random::SplitMix64;
use parry3d_f64::math::Vector;
use parry3d_f64::shape::{TriMesh, TriMeshConnectedComponents, TriMeshFlags};
use parry3d_f64::transformation::try_convex_hull;
use parry3d_f64::transformation::vhacd::{VHACD, VHACDParameters};
use parry3d_f64::transformation::voxelization::FillMode;

/// How far a point may be outside a hull, and a face's neighbour above it, relative to the size.
const HULL_TOLERANCE: f64 = 1e-8;

/// Volumes of two sound hulls of the same points, relative.
const SAME_VOLUME: f64 = 1e-6;

/// parry's tolerances are absolute, and meant for numbers of order one.
const MM_PER_M: f64 = 1e3;

fn millimetres(points: &[Point3<f64>]) -> Vec<Vector> {
    let scaled = points.iter().map(|point| point * MM_PER_M);
    scaled.map(|p| Vector::new(p.x, p.y, p.z)).collect()
}

fn metres(points: &[Vector]) -> Vec<Point3<f64>> {
    let scaled = points.iter().map(|&point| point / MM_PER_M);
    scaled.map(|p| Point3::new(p.x, p.y, p.z)).collect()
}

/// parry's hull; none where it fails or panics.
fn parry_hull(points: &[Point3<f64>]) -> Option<TriangleMesh> {
    let points = millimetres(points);
    let (vertices, triangles) = catch_unwind(|| try_convex_hull(&points)).ok()?.ok()?;
    Some(TriangleMesh {
        vertices_m: metres(&vertices),
        triangles,
    })
}

/// What is wrong with a hull: nothing, if it is a closed convex surface that holds every point.
fn fault(points: &[Point3<f64>], hull: &TriangleMesh) -> Option<String> {
    let first = points[0];
    let size_m = points
        .iter()
        .map(|p| (p - first).norm())
        .fold(0.0, f64::max);
    let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for &[a, b, c] in &hull.triangles {
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    let has_twin =
        |(&(a, b), &count): (&(u32, u32), &u32)| count == 1 && edges.contains_key(&(b, a));
    if hull.triangles.is_empty() || !edges.iter().all(has_twin) {
        return Some("it is open".to_owned());
    }
    // Heights over slivers are noise; each of them is between faces that are none.
    let mut outside_m = f64::NEG_INFINITY;
    for triangle in &hull.triangles {
        let [a, b, c] = triangle.map(|i| hull.vertices_m[i as usize]);
        let normal = (b - a).cross(&(c - a));
        let longest = [b - a, c - b, a - c]
            .iter()
            .map(Vector3::norm)
            .fold(0.0, f64::max);
        if normal.norm() < 1e-6 * longest * longest {
            continue;
        }
        let normal = normal.normalize();
        let heights_m = points.iter().map(|point| normal.dot(&(point - a)));
        outside_m = heights_m.fold(outside_m, f64::max);
    }
    if outside_m > HULL_TOLERANCE * size_m {
        return Some(format!(
            "a point is outside by {:.1e} of its size",
            outside_m / size_m
        ));
    }
    let volume = volume_m3(hull);
    (volume <= 0.0).then(|| format!("its volume is {volume:.1e} m^3"))
}

fn single_precision(points: &[Point3<f64>]) -> Vec<Point3<f64>> {
    #[expect(clippy::cast_possible_truncation, reason = "as STL files do")]
    let single = |value: f64| f64::from((value * MM_PER_M) as f32) / MM_PER_M;
    points.iter().map(|point| point.map(single)).collect()
}

fn sphere(count: u32) -> Vec<Point3<f64>> {
    let spiral = (0..count).map(|i| {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
        let (sine, cosine) = libm::sincos(f64::from(i) * 2.399_963);
        let across = (1.0 - z * z).sqrt();
        Point3::new(across * cosine, across * sine, z) * 0.1
    });
    spiral.collect()
}

/// Rings about z, of a radius that depends on the height.
fn rings(count: u32, spokes: u32, radius_m: impl Fn(f64) -> f64) -> Vec<Point3<f64>> {
    let mut points = Vec::new();
    for ring in 0..count {
        let z_m = 0.1 * (2.0 * f64::from(ring) / f64::from(count - 1) - 1.0);
        for spoke in 0..spokes {
            let (sine, cosine) = libm::sincos(TAU * f64::from(spoke) / f64::from(spokes));
            points.push(Point3::new(
                radius_m(z_m) * cosine,
                radius_m(z_m) * sine,
                z_m,
            ));
        }
    }
    points
}

fn lattice() -> Vec<Point3<f64>> {
    let mut points = Vec::new();
    for x in -5..=5 {
        for y in -5..=5 {
            for z in -5..=5 {
                points.push(Point3::new(f64::from(x), f64::from(y), f64::from(z)) * 0.01);
            }
        }
    }
    points
}

/// The surface of a torus on one side of a plane, as a decomposition cuts it.
fn cut_torus(random: &mut SplitMix64) -> Vec<Point3<f64>> {
    let mesh = torus(48, 24);
    let normal = Vector3::from_fn(|_, _| random.uniform(-1.0, 1.0)).normalize();
    let offset_m = random.uniform(-0.03, 0.03);
    let mut points = Vec::new();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|i| mesh.vertices_m[i as usize]);
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let [over_a, over_b] = [a, b].map(|point| normal.dot(&point.coords) - offset_m);
            if over_a >= 0.0 {
                points.push(a);
            }
            if over_a * over_b < 0.0 {
                points.push(a + (b - a) * (over_a / (over_a - over_b)));
            }
        }
    }
    points
}

/// STL files of the folder that the environment names, with their seams closed.
fn meshes_of_the_environment() -> Vec<(String, TriangleMesh)> {
    let Some(folder) = std::env::var_os("MESHES") else {
        return Vec::new();
    };
    let mut paths: Vec<_> = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "stl"))
        .collect();
    paths.sort();
    paths
        .iter()
        .map(|path| {
            let mesh = read_stl(&std::fs::read(path).expect("a file"), [1.0; 3]).expect("a mesh");
            (
                path.file_stem()
                    .unwrap_or_default()
                    .to_string_lossy()
                    .into_owned(),
                mend(mesh).mesh,
            )
        })
        .collect()
}

/// Points that meshes are made of, friendly and not.
fn point_sets() -> Vec<(String, Vec<Point3<f64>>)> {
    let turn = Rotation3::from_euler_angles(0.3, 0.7, 1.1);
    let turned = |points: &[Point3<f64>]| -> Vec<_> { points.iter().map(|p| turn * p).collect() };
    let scaled = |points: &[Point3<f64>], by: [f64; 3]| -> Vec<Point3<f64>> {
        let by = Vector3::from(by);
        points
            .iter()
            .map(|p| p.coords.component_mul(&by).into())
            .collect()
    };
    let cylinder = rings(5, 128, |_| 0.03);
    let ellipsoid = rings(21, 40, |z_m| 0.03 * (1.0 - 99.0 * z_m * z_m).sqrt());
    let mut random = SplitMix64::new(1);
    let scattered: Vec<Point3<f64>> = (0..500)
        .map(|_| Vector3::from_fn(|_, _| random.uniform(-0.1, 0.1)).into())
        .collect();
    let mut sets = vec![
        ("sphere".to_owned(), sphere(1000)),
        (
            "sphere 20 times".to_owned(),
            (0..20).flat_map(|_| sphere(100)).collect(),
        ),
        ("lattice".to_owned(), lattice()),
        ("scattered".to_owned(), scattered.clone()),
        ("cylinder".to_owned(), cylinder.clone()),
        ("ellipsoid in rings".to_owned(), ellipsoid.clone()),
        ("torus".to_owned(), torus(48, 24).vertices_m),
    ];
    for (name, points) in [
        ("lattice", lattice()),
        ("cylinder", cylinder.clone()),
        ("ellipsoid", ellipsoid),
    ] {
        sets.push((format!("{name}, turned"), turned(&points)));
        sets.push((
            format!("{name}, turned, single precision"),
            single_precision(&turned(&points)),
        ));
    }
    for thin in [1e-2, 1e-3, 1e-4, 1e-5] {
        sets.push((
            format!("plate, {thin:.0e} thin"),
            scaled(&scattered, [1.0, 1.0, thin]),
        ));
        sets.push((
            format!("rod, {thin:.0e} thin"),
            scaled(&scattered, [thin, thin, 1.0]),
        ));
        sets.push((
            format!("disc, {thin:.0e} thin"),
            scaled(&cylinder, [1.0, 1.0, thin]),
        ));
    }
    for scale in [1e-6, 1e-3, 1e3, 1e6] {
        sets.push((
            format!("cylinder times {scale:.0e}"),
            scaled(&cylinder, [scale; 3]),
        ));
    }
    for far_m in [1.0, 1e3] {
        let moved = cylinder
            .iter()
            .map(|point| point + Vector3::new(far_m, far_m, -far_m));
        sets.push((format!("cylinder at {far_m:.0e} m"), moved.collect()));
    }
    for number in 0..40 {
        sets.push((format!("cut torus {number}"), cut_torus(&mut random)));
    }
    sets
}

#[test]
fn hulls_are_sound_and_those_of_parry_that_are_have_the_same_volume() {
    let mut sound = 0;
    let sets = point_sets();
    for (name, points) in &sets {
        let ours = convex_hull(points).unwrap().0;
        assert_eq!(fault(points, &ours), None, "{name}");
        let Some(parry) = parry_hull(points).filter(|hull| fault(points, hull).is_none()) else {
            continue;
        };
        sound += 1;
        let (ours_m3, parry_m3) = (volume_m3(&ours), volume_m3(&parry));
        assert!(
            (ours_m3 / parry_m3 - 1.0).abs() < SAME_VOLUME,
            "{name}: {ours_m3} {parry_m3}"
        );
    }
    println!("parry: {sound} of {} hulls are sound", sets.len());
    assert!(2 * sound > sets.len(), "they tell something");
}

#[test]
fn volumes_and_centroids_are_those_of_closed_forms() {
    /// Of parry's sums, for solids of decimetres at the distance of some metres.
    const ROUNDING: f64 = 1e-12;
    for far_m in [0.0, 10.0] {
        let offset = Vector3::new(far_m, -far_m, 0.5 * far_m);
        let moved = |mut mesh: TriangleMesh| {
            for vertex in &mut mesh.vertices_m {
                *vertex += offset;
            }
            mesh
        };
        let block = moved(cuboid([0.03, 0.02, 0.01]));
        assert!((volume_m3(&block) / 4.8e-5 - 1.0).abs() < ROUNDING);
        assert!((centroid_m(&block).coords - offset).norm() < ROUNDING);
        // Two arms of 0.1 m by 0.02 m share a square of 0.02 m; 0.03 m high.
        let iron = moved(ell());
        let area_m2 = 2.0 * 0.1 * 0.02 - 0.02 * 0.02;
        let moment_m3 = 0.1 * 0.02 * 0.05 + 0.08 * 0.02 * 0.01;
        let middle = Vector3::new(moment_m3 / area_m2, moment_m3 / area_m2, 0.015);
        assert!((volume_m3(&iron) / (0.03 * area_m2) - 1.0).abs() < ROUNDING);
        assert!((centroid_m(&iron).coords - offset - middle).norm() < ROUNDING);
        assert!(volume_m3(&inverted(iron)) < 0.0);
    }
    // A ring of n segments, each of m sides, is a polygon swept along chords.
    let ring = torus(64, 32);
    let section_m2 = 0.5 * 32.0 * 0.02 * 0.02 * libm::sin(TAU / 32.0);
    let chords = 64.0 * libm::sin(PI / 64.0) * libm::cos(PI / 64.0);
    let volume = volume_m3(&ring) / (section_m2 * 2.0 * 0.05 * chords);
    assert!((volume - 1.0).abs() < 1e-3, "{volume}");
    assert!(centroid_m(&ring).coords.norm() < ROUNDING);
}

#[test]
#[ignore = "prints figures"]
fn figures_of_hulls() {
    let sets = point_sets().into_iter().chain(
        meshes_of_the_environment()
            .into_iter()
            .map(|(name, mesh)| (name, mesh.vertices_m)),
    );
    for (name, points) in sets {
        let mut line = format!("{name:40} {:5} points", points.len());
        for (who, hull) in [
            (
                "ours",
                &(|points: &[Point3<f64>]| convex_hull(points).ok().map(|hull| hull.0))
                    as &dyn Fn(&[Point3<f64>]) -> Option<TriangleMesh>,
            ),
            ("parry", &parry_hull),
        ] {
            let start = Instant::now();
            let hull = hull(&points);
            let ms = start.elapsed().as_secs_f64() * 1e3;
            let verdict = hull.map_or_else(
                || "none".to_owned(),
                |hull| {
                    fault(&points, &hull)
                        .unwrap_or_else(|| format!("{} vertices", hull.vertices_m.len()))
                },
            );
            line = format!("{line} | {who} {ms:.1} ms, {verdict}");
        }
        println!("{line}");
    }
}

#[test]
#[ignore = "prints figures"]
fn figures_of_decompositions() {
    /// What our decomposition leaves out of a hull, m.
    const LEFT_OUT_M: f64 = 2e-5;
    let made_up = [("ell", ell()), ("bowl", bowl()), ("torus", torus(48, 24))];
    let made_up = made_up.map(|(name, mesh)| (name.to_owned(), mesh));
    for (name, surface) in made_up.into_iter().chain(meshes_of_the_environment()) {
        let solid = SurfaceIndex::new(surface);
        let show = |who: &str, start: Instant, pieces: &[ConvexMesh]| {
            let took_s = start.elapsed().as_secs_f64();
            let found = Fidelity::measure(&solid, pieces);
            println!(
                "{name:10} {who:30} {:2} pieces, overhang {:6.2} mm, mean {:.2} mm, uncovered {:6.2} mm, {took_s:.1} s",
                found.pieces,
                found.overhang_m * 1e3,
                found.mean_overhang_m * 1e3,
                found.uncovered_m * 1e3
            );
        };
        let start = Instant::now();
        show("ours", start, &decompose(&solid));
        let points = millimetres(&solid.mesh().vertices_m);
        let triangles = &solid.mesh().triangles;
        for (resolution, concavity) in [(64, 0.01), (128, 0.001)] {
            let parameters = VHACDParameters {
                resolution,
                concavity,
                max_convex_hulls: 16,
                fill_mode: FillMode::FloodFill {
                    detect_cavities: true,
                },
                ..VHACDParameters::default()
            };
            let start = Instant::now();
            let parts = VHACD::decompose(&parameters, &points, triangles, true);
            if let Ok(hulls) = catch_unwind(|| parts.compute_exact_convex_hulls(&points, triangles))
            {
                let pieces: Vec<_> = hulls
                    .into_iter()
                    .map(|(vertices, triangles)| {
                        ConvexMesh(TriangleMesh {
                            vertices_m: metres(&vertices),
                            triangles,
                        })
                    })
                    .collect();
                show(&format!("parry {resolution}"), start, &pieces);
            }
            let parts = parts.compute_primitive_intersections(&points, triangles);
            let pieces: Vec<_> = parts
                .iter()
                .filter_map(|part| simplified_hull(&metres(part), LEFT_OUT_M).ok())
                .collect();
            show(
                &format!("parry {resolution} with our hulls"),
                start,
                &pieces,
            );
        }
    }
}

#[test]
#[ignore = "prints figures"]
fn figures_of_mesh_checks() {
    let block = || cuboid([0.03, 0.02, 0.01]);
    let welded = |offset_m| {
        let mut mesh = both(&block(), &block(), offset_m);
        weld(&mut mesh);
        mesh
    };
    let changed = |change: fn(&mut TriangleMesh)| {
        let mut mesh = ell();
        change(&mut mesh);
        mesh
    };
    let cases = [
        ("box", block()),
        ("bowl", bowl()),
        ("two boxes", both(&block(), &block(), [0.1, 0.0, 0.0])),
        (
            "overlapping boxes",
            both(&block(), &block(), [0.01, 0.005, 0.0]),
        ),
        (
            "box with a cavity",
            both(&block(), &inverted(cuboid([0.01, 0.01, 0.005])), [0.0; 3]),
        ),
        ("boxes that share an edge", welded([0.06, 0.04, 0.0])),
        ("boxes that share a corner", welded([0.06, 0.04, 0.02])),
        ("inside out", inverted(ell())),
        (
            "one of two inside out",
            both(&block(), &inverted(block()), [0.1, 0.0, 0.0]),
        ),
        (
            "without a triangle",
            changed(|mesh| mesh.triangles.truncate(19)),
        ),
        (
            "one triangle turned",
            changed(|mesh| mesh.triangles[3].swap(0, 1)),
        ),
        (
            "one triangle twice",
            changed(|mesh| mesh.triangles.push(mesh.triangles[2])),
        ),
        (
            "flattened",
            changed(|mesh| mesh.vertices_m.iter_mut().for_each(|v| v.z = 0.0)),
        ),
    ];
    for (name, mesh) in cases {
        let ours = check_closed(&mesh).map_or_else(
            |defect| defect.to_string(),
            |facts| {
                format!(
                    "sound, {} parts, {} shared edges",
                    facts.components, facts.shared_edges
                )
            },
        );
        let flags = TriMeshFlags::HALF_EDGE_TOPOLOGY | TriMeshFlags::CONNECTED_COMPONENTS;
        let parry =
            TriMesh::with_flags(millimetres(&mesh.vertices_m), mesh.triangles, flags).unwrap();
        let open = parry.topology().map(|topology| {
            let twins = topology.half_edges.iter().map(|edge| edge.twin);
            twins.filter(|&twin| twin == u32::MAX).count()
        });
        let parts = parry
            .connected_components()
            .map_or(0, TriMeshConnectedComponents::num_connected_components);
        println!("{name:26} {ours} | parry: {parts} parts, open edges {open:?}");
    }
}

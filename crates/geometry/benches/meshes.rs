//! A convex piece and a segment against a surface, beside parry on the same geometry; and what a surface takes that is
//! met for the first time.
//!
//! `cargo bench -p needlebench-geometry --bench meshes`

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Point3, Vector3};
use needlebench_geometry::mesh::{Fidelity, SurfaceIndex, convex_hull, decompose};
use needlebench_geometry::sample_solids::torus;
use needlebench_geometry::{PreparedShape, Shape, TriangleMesh, separation};
use needlebench_kinematics::Pose;
use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::shape::{SharedShape, TriMesh};

mod common;

use common::{Variety, chest, piece, solid};

/// Poses per measurement.
const POSES: usize = 200;

/// Repetitions, of which the fastest counts: whatever else runs can only slow one down.
const REPETITIONS: usize = 7;

/// Largest distance of a pose's origin from the surface, m.
const NEARBY_M: f64 = 0.2;

fn nearby(surface: &TriangleMesh, count: usize, least_m: f64) -> Vec<Pose> {
    let mut variety = Variety(7);
    (0..count)
        .map(|_| {
            let pick = variety.between(0.0, surface.vertices_m.len() as f64);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "an index drawn from the list's own length"
            )]
            let at = surface.vertices_m[pick as usize].coords;
            let outwards = at
                .component_div(&Vector3::new(0.17, 0.11, 0.28))
                .normalize();
            let place = at + outwards * variety.between(least_m, NEARBY_M);
            Pose::new(place, variety.direction() * variety.between(0.0, 3.1))
        })
        .collect()
}

fn parry_pose(pose: &Pose) -> ParryPose {
    let (t, r) = (pose.translation.vector * 1e3, pose.rotation);
    ParryPose::from_parts(
        Vector::new(t.x, t.y, t.z),
        Rotation::from_xyzw(r.i, r.j, r.k, r.w),
    )
}

fn parry_vector(point: &Point3<f64>) -> Vector {
    Vector::new(point.x * 1e3, point.y * 1e3, point.z * 1e3)
}

/// Microseconds per pose, the least of some repetitions.
fn time_us(poses: &[Pose], mut run: impl FnMut(&Pose) -> f64) -> (f64, Vec<f64>) {
    let mut least = f64::INFINITY;
    let mut found = Vec::new();
    for _ in 0..REPETITIONS {
        let start = Instant::now();
        found = poses
            .iter()
            .map(|pose| black_box(run(black_box(pose))))
            .collect();
        least = least.min(start.elapsed().as_secs_f64() * 1e6 / poses.len() as f64);
    }
    (least, found)
}

fn beside_parry() {
    let surface = chest(32);
    let poses = nearby(&surface, POSES, 0.06);
    let ours_b = PreparedShape::new(&solid(surface.clone()));
    let vertices = surface.vertices_m.iter().map(parry_vector).collect();
    let theirs_b = TriMesh::new(vertices, surface.triangles.clone()).expect("a sound mesh");
    println!(
        "{} triangles, us per query, {POSES} nearby poses",
        surface.triangles.len()
    );
    println!(
        "{:24} {:>12} {:>12} {:>14}",
        "", "needlebench", "parry", "difference, m"
    );
    let hull = piece();
    let Shape::Convex(hull_mesh) = &hull else {
        unreachable!("the piece is convex")
    };
    let points: Vec<Vector> = hull_mesh.0.vertices_m.iter().map(parry_vector).collect();
    let segment = Shape::Capsule {
        radius_m: 0.0,
        half_length_m: 0.05,
    };
    let half = Vector::new(0.0, 0.0, 50.0);
    for (name, ours_a, theirs_a) in [
        (
            "convex piece, 92 vertices",
            &hull,
            SharedShape::convex_hull(&points).expect("the piece has a volume"),
        ),
        (
            "segment, 100 mm",
            &segment,
            SharedShape::segment(-half, half),
        ),
    ] {
        let ours_a = PreparedShape::new(ours_a);
        let (ours_us, ours) = time_us(&poses, |pose| {
            separation(&ours_a, pose, &ours_b, &Pose::identity()).distance_m
        });
        let (theirs_us, theirs) = time_us(&poses, |pose| {
            parry3d_f64::query::distance(
                &parry_pose(pose),
                theirs_a.as_ref(),
                &ParryPose::IDENTITY,
                &theirs_b,
            )
            .map_or(f64::NAN, |found| found.distance * 1e-3)
        });
        let worst = ours
            .iter()
            .zip(&theirs)
            .filter(|(ours, _)| **ours > 0.0)
            .map(|(ours, theirs)| (ours - theirs).abs())
            .fold(0.0, f64::max);
        println!("{name:24} {ours_us:12.2} {theirs_us:12.2} {worst:14.1e}");
    }
    let deep = nearby(&surface, POSES, -0.01);
    let ours_a = PreparedShape::new(&hull);
    let crossing: Vec<Pose> = deep
        .into_iter()
        .filter(|pose| separation(&ours_a, pose, &ours_b, &Pose::identity()).distance_m < 0.0)
        .collect();
    let (us, _) = time_us(&crossing, |pose| {
        separation(&ours_a, pose, &ours_b, &Pose::identity()).distance_m
    });
    println!("penetrating piece, {} poses: {us:.1} us", crossing.len());
}

/// Cuts of an icosahedron's edges: 980 to a million triangles.
const CUTS: [u32; 7] = [7, 13, 22, 40, 71, 126, 224];

/// Cost against the number of triangles, as a table and a plot in the target directory.
fn scaling() {
    println!(
        "\n{:>10} {:>12} {:>12} {:>12}",
        "triangles", "piece, us", "segment, us", "build, ms"
    );
    let segment = Shape::Capsule {
        radius_m: 0.0,
        half_length_m: 0.05,
    };
    let shapes = [piece(), segment].map(|shape| PreparedShape::new(&shape));
    let mut rows = Vec::new();
    for cuts in CUTS {
        let surface = chest(cuts);
        let count = surface.triangles.len();
        let poses = nearby(&surface, POSES, 0.06);
        let shape = solid(surface);
        let start = Instant::now();
        let mesh = PreparedShape::new(&shape);
        let build_ms = start.elapsed().as_secs_f64() * 1e3;
        let [piece_us, segment_us] = shapes.each_ref().map(|shape| {
            let run = |pose: &Pose| separation(shape, pose, &mesh, &Pose::identity()).distance_m;
            time_us(&poses, run).0
        });
        println!("{count:10} {piece_us:12.2} {segment_us:12.2} {build_ms:12.1}");
        rows.push((count as f64, [piece_us, segment_us]));
    }
    let target = std::env::current_exe()
        .ok()
        .and_then(|exe| Some(exe.ancestors().nth(3)?.to_path_buf()))
        .unwrap_or_default();
    let path = target.join("mesh_scaling.svg");
    match std::fs::write(&path, plot(&rows)) {
        Ok(()) => println!("plotted in {}", path.display()),
        Err(error) => eprintln!("{}: {error}", path.display()),
    }
}

/// Both axes logarithmic, with a dashed line for a cost in proportion to the triangles.
fn plot(rows: &[(f64, [f64; 2])]) -> String {
    let x = |count: f64| 70.0 + 140.0 * (libm::log10(count) - 2.9);
    let y = |us: f64| 330.0 - 100.0 * libm::log10(us);
    let line = |points: Vec<(f64, f64)>, style: &str| {
        let points: Vec<String> = points
            .into_iter()
            .map(|(count, us)| format!("{:.1},{:.1}", x(count), y(us)))
            .collect();
        format!(
            "<polyline fill='none' {style} points='{}'/>\n",
            points.join(" ")
        )
    };
    let mut svg = vec![String::from(
        "<svg xmlns='http://www.w3.org/2000/svg' width='560' height='400' \
         font-family='sans-serif' font-size='12'>\n<rect width='560' height='400' fill='white'/>\n",
    )];
    for (exponent, name) in [(3, "1e3"), (4, "1e4"), (5, "1e5"), (6, "1e6")] {
        let at = x(10.0_f64.powi(exponent));
        svg.push(format!("<path d='M{at:.1} 30V330' stroke='#ddd'/>"));
        svg.push(format!(
            "<text x='{at:.1}' y='348' text-anchor='middle'>{name}</text>\n"
        ));
    }
    for us in [1.0, 10.0, 100.0, 1000.0] {
        let at = y(us);
        svg.push(format!("<path d='M70 {at:.1}H510' stroke='#ddd'/>"));
        svg.push(format!(
            "<text x='62' y='{:.1}' text-anchor='end'>{us}</text>\n",
            at + 4.0
        ));
    }
    svg.push("<text x='290' y='375' text-anchor='middle'>triangles of the surface</text>\n".into());
    svg.push("<text x='20' y='20'>us per query, 200 nearby poses</text>\n".into());
    for (i, (name, color)) in [("convex piece", "#06c"), ("segment", "#c40")]
        .iter()
        .enumerate()
    {
        let points = rows.iter().map(|&(count, us)| (count, us[i])).collect();
        svg.push(line(points, &format!("stroke='{color}' stroke-width='2'")));
        let at = 50 + 18 * i;
        svg.push(format!(
            "<text x='90' y='{at}' fill='{color}'>{name}</text>\n"
        ));
    }
    let (first, us) = rows[0];
    let linear = [1.0, 100.0].map(|times| (first * times, us[0] * times));
    svg.push(line(
        linear.to_vec(),
        "stroke='#888' stroke-dasharray='4 4'",
    ));
    svg.push("<text x='90' y='86' fill='#888'>in proportion</text>\n</svg>\n".into());
    svg.concat()
}

/// What an obstacle takes that no cache knows: the hull, which tells whether it is convex, the pieces, and how far they
/// are from it.
fn cold() {
    println!(
        "\n{:8} {:>10} {:>10} {:>10} {:>13} {:>8} {:>15}",
        "", "triangles", "hull, s", "pieces, s", "fidelity, s", "pieces", "uncovered, um"
    );
    let seconds = |start: Instant| start.elapsed().as_secs_f64();
    let chests = [7, 32, 100].map(|cuts| ("chest", chest(cuts)));
    let rings =
        [[40, 12], [160, 62], [500, 200]].map(|[around, about]| ("ring", torus(around, about)));
    for (name, surface) in chests.into_iter().chain(rings) {
        let count = surface.triangles.len();
        let start = Instant::now();
        black_box(convex_hull(&surface.vertices_m).expect("a volume"));
        let hull_s = seconds(start);
        let solid = SurfaceIndex::new(surface);
        // Its tree is made at the first question.
        black_box(solid.contains(&Point3::origin()));
        let start = Instant::now();
        let pieces = decompose(&solid);
        let pieces_s = seconds(start);
        let start = Instant::now();
        let found = Fidelity::measure(&solid, &pieces);
        let fidelity_s = seconds(start);
        println!(
            "{name:8} {count:10} {hull_s:10.3} {pieces_s:10.3} {fidelity_s:13.3} {:8} {:15.1}",
            found.pieces,
            found.uncovered_m * 1e6
        );
    }
}

fn main() {
    beside_parry();
    scaling();
    cold();
}

//! The body behind the cuts of a scan, as it is assumed, against ellipses of which all is known.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
use needlebench_geometry::TriangleMesh;
use needlebench_geometry::mesh::check_closed;
use needlebench_imaging::{AssumedBody, FieldOfView, Outside};
use needlebench_volume::{AIR_HU, Volume, VoxelGrid};

const SPACING_MM: [f64; 3] = [3.0, 3.0, 4.0];
const SIZE: [usize; 3] = [90, 70, 50];

/// The first and the last slice are so far from the middle, mm, and the surface is closed half a slice farther.
const END_MM: f64 = 98.0;
const CLOSED_MM: f64 = 100.0;

/// Outside this circle there is padding.
const CIRCLE_MM: f64 = 118.0;

const OUTSIDE: Outside = Outside {
    reach_m: 0.2,
    wider_m: [0.03, 0.02],
};

/// Half axes of the body's cross-section, mm: behind the upper end it becomes wider, by less than is assumed.
fn axes_mm(z_mm: f64) -> [f64; 2] {
    let behind = ((z_mm - END_MM) / 100.0).clamp(0.0, 1.0);
    [150.0 + 25.0 * behind, 80.0 + 15.0 * behind]
}

/// How far out the body is in a direction across, mm.
fn radius_mm(angle: f64, z_mm: f64) -> f64 {
    let [a, b] = axes_mm(z_mm);
    1.0 / libm::hypot(libm::cos(angle) / a, libm::sin(angle) / b)
}

fn field_of_view() -> FieldOfView {
    let first = [0, 1, 2].map(|axis| -0.5e-3 * SPACING_MM[axis] * (SIZE[axis] - 1) as f64);
    let spacing_m = SPACING_MM.map(|mm| 1e-3 * mm);
    let grid = VoxelGrid::aligned(SIZE, spacing_m, Point3::from(first)).unwrap();
    let [nx, ny, nz] = SIZE;
    let all = (0..nz).flat_map(|k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])));
    let hu = all.map(|index| {
        let at = grid.ct_from_index(&Point3::from(index.map(|each| each as f64))) * 1e3;
        if libm::hypot(at.x, at.y) > CIRCLE_MM {
            return AIR_HU;
        }
        let noise = if index[0] % 2 == 0 { 4 } else { -4 };
        let is_body = libm::hypot(at.x / 150.0, at.y / 80.0) < 1.0;
        if is_body { 40 } else { AIR_HU + noise }
    });
    FieldOfView::of(&Volume {
        hu: hu.collect(),
        grid: grid.clone(),
        slice_thickness_m: None,
    })
}

/// The surface of what was seen of the body.
fn skin() -> TriangleMesh {
    const COUNT: u32 = 720;
    let mut vertices_m = Vec::new();
    for z_mm in [-CLOSED_MM, CLOSED_MM] {
        vertices_m.push(Point3::new(0.0, 0.0, 1e-3 * z_mm));
        for turn in 0..COUNT {
            let angle = TAU * f64::from(turn) / f64::from(COUNT);
            let out_m = 1e-3 * radius_mm(angle, 0.0).min(CIRCLE_MM);
            let [x, y] = [libm::cos(angle), libm::sin(angle)].map(|share| out_m * share);
            vertices_m.push(Point3::new(x, y, 1e-3 * z_mm));
        }
    }
    let top = COUNT + 1;
    let triangles = (0..COUNT).flat_map(|turn| {
        let [here, next] = [turn, (turn + 1) % COUNT].map(|turn| turn + 1);
        [
            [0, next, here],
            [here, next, top + next],
            [here, top + next, top + here],
            [top, top + here, top + next],
        ]
    });
    TriangleMesh {
        triangles: triangles.collect(),
        vertices_m,
    }
}

/// How deep a place is in what is assumed, m; negative outside.
fn depth_m(body: &AssumedBody, at: &Point3<f64>) -> f64 {
    let pieces = body.pieces.iter().map(|piece| {
        let mesh = &piece.hull.0;
        let faces = mesh.triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|corner| mesh.vertices_m[corner as usize]);
            (b - a).cross(&(c - a)).normalize().dot(&(a - at))
        });
        faces.fold(f64::INFINITY, f64::min)
    });
    pieces.fold(f64::NEG_INFINITY, f64::max)
}

#[test]
fn body_that_goes_on_as_assumed_is_within_what_is_assumed() {
    let seen = field_of_view();
    let body = AssumedBody::of(&skin(), &[], &seen, OUTSIDE);
    assert_eq!(body.cuts, seen.cuts(&skin()).len());
    assert!(body.cuts > 6, "{}", body.cuts);
    let (mut outside, mut in_sight) = (0, 0);
    for z in (-280..=280).step_by(20) {
        let z_mm = f64::from(z);
        for turn in 0..144 {
            let angle = TAU * f64::from(turn) / 144.0;
            let direction = Vector3::new(libm::cos(angle), libm::sin(angle), 0.0);
            let place = |out_mm: f64| {
                let across = direction * out_mm;
                Point3::new(across.x, across.y, z_mm) * 1e-3
            };
            for share in [0.9, 1.0] {
                let out_mm = share * radius_mm(angle, z_mm);
                let deep_m = depth_m(&body, &place(out_mm));
                if z_mm.abs() > END_MM || out_mm > CIRCLE_MM {
                    outside += 1;
                    // Hulls leave out 0.1 mm.
                    assert!(deep_m > -2e-4, "{turn} {z} {out_mm}: {deep_m}");
                } else if out_mm < CIRCLE_MM - SPACING_MM[0] {
                    in_sight += 1;
                    assert!(deep_m < 0.0, "{turn} {z} {out_mm}: {deep_m}");
                }
            }
            // Tangents where it is cut meet 70 mm beyond an ellipse of such axes; half of that is assumed, and 30 mm more.
            let beyond = place(radius_mm(angle, z_mm) + 80.0);
            assert!(depth_m(&body, &beyond) < 0.0, "{turn} {z}");
        }
    }
    assert!(outside > 4000 && in_sight > 1000, "{outside} {in_sight}");
    // Its ends are a little behind the planes that are said.
    let reach_m = 1e-3 * END_MM + OUTSIDE.reach_m;
    for sign in [-1.0, 1.0] {
        let at = |off_m: f64| Point3::new(0.0, 0.0, sign * (reach_m + off_m));
        assert!(depth_m(&body, &at(0.0)) > 0.0 && depth_m(&body, &at(2e-3)) < 0.0);
    }
}

#[test]
fn nothing_is_assumed_at_sides_that_cut_nothing() {
    let seen = field_of_view();
    let mut skin = skin();
    for vertex in &mut skin.vertices_m {
        vertex.x *= 0.5;
    }
    let straight = Outside {
        wider_m: [0.0; 2],
        ..OUTSIDE
    };
    let body = AssumedBody::of(&skin, &[], &seen, straight);
    let names: Vec<&str> = body.pieces.iter().map(|piece| &*piece.name).collect();
    assert_eq!(names, ["assumed_body_inferior", "assumed_body_superior"]);
    // As its files have it.
    for mut piece in body.pieces {
        for vertex in &mut piece.hull.0.vertices_m {
            #[expect(clippy::cast_possible_truncation, reason = "STL has single precision")]
            let in_file = |metres: f64| f64::from((1e3 * metres) as f32);
            *vertex = vertex.map(in_file);
        }
        check_closed(&piece.hull.0).unwrap();
    }
}

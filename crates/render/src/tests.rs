//! Pictures of scenes made of primitive shapes.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use nalgebra::{Point2, Point3, Translation3, UnitQuaternion, Vector3};
use needlebench_geometry::{Shape, TriangleMesh};
use needlebench_kinematics::Pose;

use crate::{
    Anchor, Camera, Floor, Image, Label, Line3, PictureError, Projection, Scene, Stage,
    SurfaceInstance, render, tile,
};

const RED: [f32; 4] = [0.8, 0.1, 0.1, 1.0];
const GREEN: [f32; 4] = [0.1, 0.7, 0.1, 1.0];
const GLASS: [f32; 4] = [0.2, 0.3, 0.9, 0.4];

const CHORD_ERROR_M: f64 = 2e-4;

fn at(x: f64, y: f64, z: f64) -> Pose {
    Translation3::new(x, y, z).into()
}

fn surface(shape: &Shape, world_from_surface: Pose, color_rgba: [f32; 4]) -> SurfaceInstance {
    SurfaceInstance {
        mesh: Arc::new(shape.surface(CHORD_ERROR_M)),
        world_from_surface,
        color_rgba,
    }
}

fn ball(radius_m: f64) -> Shape {
    Shape::Sphere { radius_m }
}

fn cuboid(x: f64, y: f64, z: f64) -> Shape {
    Shape::Cuboid {
        half_extents_m: Vector3::new(x, y, z),
    }
}

/// A camera 2 m in front of the origin that looks along y.
fn front() -> Camera {
    Camera {
        eye_m: Point3::new(0.0, -2.0, 0.0),
        target_m: Point3::origin(),
        up: Vector3::z(),
        projection: Projection::Perspective {
            vertical_fov_rad: 0.5,
        },
        width_px: 160,
        height_px: 120,
    }
}

fn scene(surfaces: Vec<SurfaceInstance>) -> Scene {
    Scene {
        surfaces,
        ..Scene::default()
    }
}

fn center(image: &Image) -> [u8; 3] {
    image
        .pixel(image.width_px() / 2, image.height_px() / 2)
        .expect("not empty")
}

fn look(surfaces: Vec<SurfaceInstance>) -> [u8; 3] {
    center(&render(&scene(surfaces), &front()))
}

/// Every vertex and line end, in the world, m.
fn points_m(scene: &Scene) -> Vec<Point3<f64>> {
    let vertices = scene.surfaces.iter().flat_map(|surface| {
        let place = |vertex_m: &Point3<f64>| surface.world_from_surface * vertex_m;
        surface.mesh.vertices_m.iter().map(place)
    });
    let ends = scene.lines.iter().flat_map(|line| [line.from_m, line.to_m]);
    vertices.chain(ends).collect()
}

/// A robot-like arm above a translucent body with a lesion, on a table.
fn bench() -> Scene {
    let (blue, grey) = ([0.36, 0.60, 0.80, 1.0], [0.74, 0.76, 0.79, 1.0]);
    let tube = |radius_m: f64, half_length_m: f64| Shape::Cylinder {
        radius_m,
        half_length_m,
    };
    let rod = |radius_m: f64, half_length_m: f64| Shape::Capsule {
        radius_m,
        half_length_m,
    };
    let turned = |x: f64, y: f64, z: f64, axis: Vector3<f64>, angle_rad: f64| {
        Pose::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::new(axis * angle_rad),
        )
    };
    let mut body = ball(1.0).surface(1e-4);
    for vertex in &mut body.vertices_m {
        vertex
            .coords
            .component_mul_assign(&Vector3::new(0.30, 0.17, 0.13));
    }
    let skin = SurfaceInstance {
        mesh: Arc::new(body),
        world_from_surface: at(0.0, 0.0, 0.23),
        color_rgba: [0.93, 0.72, 0.60, 0.22],
    };
    let mut surfaces = vec![
        skin,
        surface(
            &cuboid(0.55, 0.25, 0.02),
            at(0.0, 0.0, 0.08),
            [0.85, 0.87, 0.90, 1.0],
        ),
        surface(
            &cuboid(0.08, 0.16, 0.03),
            at(0.0, 0.0, 0.03),
            [0.55, 0.57, 0.60, 1.0],
        ),
        surface(&ball(0.012), at(0.06, -0.03, 0.26), [0.85, 0.15, 0.15, 1.0]),
        surface(&ball(0.05), at(-0.03, 0.03, 0.24), [0.70, 0.20, 0.25, 0.85]),
        surface(
            &rod(0.05, 0.09),
            turned(0.1, 0.07, 0.23, Vector3::y(), FRAC_PI_2),
            [0.80, 0.55, 0.60, 0.5],
        ),
        surface(
            &rod(0.05, 0.09),
            turned(0.1, -0.08, 0.23, Vector3::y(), FRAC_PI_2),
            [0.80, 0.55, 0.60, 0.5],
        ),
        surface(
            &rod(0.014, 0.24),
            turned(0.0, 0.0, 0.13, Vector3::y(), FRAC_PI_2),
            [0.93, 0.90, 0.82, 1.0],
        ),
        surface(&tube(0.064, 0.06), at(-0.15, 0.45, 0.06), grey),
        surface(
            &tube(0.06, 0.075),
            turned(-0.15, 0.42, 0.17, Vector3::x(), FRAC_PI_2),
            blue,
        ),
        surface(&rod(0.045, 0.13), at(-0.15, 0.33, 0.31), grey),
        surface(
            &tube(0.05, 0.065),
            turned(-0.15, 0.32, 0.46, Vector3::x(), FRAC_PI_2),
            blue,
        ),
        surface(
            &rod(0.036, 0.11),
            turned(-0.04, 0.24, 0.47, Vector3::y(), FRAC_PI_2),
            grey,
        ),
        surface(
            &tube(0.036, 0.05),
            turned(0.08, 0.22, 0.47, Vector3::x(), FRAC_PI_2),
            blue,
        ),
        surface(
            &tube(0.034, 0.12),
            turned(0.08, 0.08, 0.47, Vector3::x(), FRAC_PI_2),
            grey,
        ),
        surface(
            &cuboid(0.02, 0.05, 0.02),
            at(0.06, -0.02, 0.44),
            [0.30, 0.32, 0.36, 1.0],
        ),
        surface(
            &tube(0.008, 0.03),
            at(0.06, -0.03, 0.42),
            [0.95, 0.75, 0.20, 1.0],
        ),
    ];
    for rib in -3..=3 {
        let x = 0.055 * f64::from(rib);
        let breadth = (1.0 - (x / 0.30).powi(2)).sqrt();
        let around = |step: i32| {
            let (sine, cosine) = libm::sincos(0.45 + 0.24 * f64::from(step));
            Point3::new(x, 0.155 * breadth * sine, 0.23 + 0.115 * breadth * cosine)
        };
        for step in (0..10).chain(-14..-4) {
            let (from, to) = (around(step), around(step + 1));
            let middle = nalgebra::center(&from, &to);
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), &(to - from));
            let pose = Pose::from_parts(middle.into(), turn.expect("not opposite to z"));
            let half_length_m = (to - from).norm() / 2.0;
            surfaces.push(surface(
                &rod(0.006, half_length_m),
                pose,
                [0.95, 0.93, 0.86, 1.0],
            ));
        }
    }
    Scene {
        surfaces,
        lines: vec![Line3 {
            from_m: Point3::new(0.06, -0.03, 0.48),
            to_m: Point3::new(0.06, -0.03, 0.26),
            color_rgba: [0.05, 0.05, 0.08, 1.0],
            width_px: 2.5,
        }],
        labels: vec![
            Label {
                text: "RUN (right, up, near)\ntip error 12.4 µm\nclearance 8.1 mm".into(),
                anchor: Anchor::TopLeft,
            },
            Label {
                text: "lesion Ø 24 mm".into(),
                anchor: Anchor::World(Point3::new(0.06, -0.03, 0.26)),
            },
            Label {
                text: "needle guide".into(),
                anchor: Anchor::World(Point3::new(0.06, -0.03, 0.42)),
            },
        ],
        floor: Some(Floor {
            center_m: Point2::new(0.0, 0.1),
            z_m: 0.0,
            radius_m: 1.3,
            spacing_m: 0.1,
        }),
    }
}

fn bench_camera(size_px: [u32; 2]) -> Camera {
    Camera::framing(&points_m(&bench()), Vector3::new(-0.7, 1.0, -0.6), size_px)
}

#[test]
fn an_empty_scene_is_a_light_picture() {
    let image = render(&Scene::default(), &front());
    assert_eq!([image.width_px(), image.height_px()], [160, 120]);
    assert!(center(&image).iter().all(|&value| value > 200));
}

#[test]
fn a_ball_shows_its_colour_in_the_centre_and_the_background_around() {
    let image = render(
        &scene(vec![surface(&ball(0.2), at(0.0, 0.0, 0.0), RED)]),
        &front(),
    );
    let [red, green, blue] = center(&image);
    assert!(
        red > 120 && green < 110 && blue < 110,
        "{red} {green} {blue}"
    );
    let empty = render(&Scene::default(), &front());
    assert_eq!(image.pixel(2, 2), empty.pixel(2, 2));
    // Half the height of the picture is 2 m tan(0.25) = 0.51 m; the ball's outline (0.2 m at a
    // slightly smaller distance) therefore covers pi (60 px 0.2 / 0.51)^2 = 1740 px.
    let changed = (0..120)
        .flat_map(|y| (0..160).map(move |x| (x, y)))
        .filter(|&(x, y)| image.pixel(x, y) != empty.pixel(x, y))
        .count();
    assert!((1680..1900).contains(&changed), "{changed}");
}

#[test]
fn the_nearer_surface_hides_the_farther_in_any_order() {
    let near = surface(&ball(0.1), at(0.0, -0.5, 0.0), GREEN);
    let far = surface(&cuboid(0.3, 0.05, 0.3), at(0.0, 0.4, 0.0), RED);
    let seen = look(vec![near.clone(), far.clone()]);
    assert!(seen[1] > seen[0], "{seen:?}");
    assert_eq!(seen, look(vec![far, near]));
}

#[test]
fn a_translucent_surface_tints_what_is_behind_it_in_any_order() {
    let wall = surface(&cuboid(0.3, 0.05, 0.3), at(0.0, 0.4, 0.0), RED);
    let pane = surface(&cuboid(0.2, 0.01, 0.2), at(0.0, -0.2, 0.0), GLASS);
    let (bare, tinted) = (
        look(vec![wall.clone()]),
        look(vec![pane.clone(), wall.clone()]),
    );
    let full = look(vec![surface(
        &cuboid(0.2, 0.01, 0.2),
        at(0.0, -0.2, 0.0),
        [0.2, 0.3, 0.9, 1.0],
    )]);
    for channel in [0, 2] {
        let (low, high) = (
            bare[channel].min(full[channel]),
            bare[channel].max(full[channel]),
        );
        assert!(
            low < tinted[channel] && tinted[channel] < high,
            "{bare:?} {tinted:?} {full:?}"
        );
    }
    assert_eq!(tinted, look(vec![wall.clone(), pane.clone()]));
    let behind = surface(&cuboid(0.2, 0.01, 0.2), at(0.0, 0.8, 0.0), GLASS);
    assert_eq!(bare, look(vec![behind, wall]));
}

#[test]
fn translucent_layers_blend_by_depth_not_by_order() {
    let layer = |y: f64, color| surface(&cuboid(0.2, 0.01, 0.2), at(0.0, y, 0.0), color);
    let (front, back) = ([0.9, 0.1, 0.1, 0.6], [0.1, 0.1, 0.9, 0.6]);
    let seen = look(vec![layer(-0.3, front), layer(0.3, back)]);
    assert!(seen[0] > seen[2], "{seen:?}");
    assert_eq!(seen, look(vec![layer(0.3, back), layer(-0.3, front)]));
    let turned = look(vec![layer(0.3, front), layer(-0.3, back)]);
    assert!(turned[2] > turned[0], "{turned:?}");
}

#[test]
fn lines_are_hidden_by_what_is_in_front_of_them() {
    let line = |y: f64| Line3 {
        from_m: Point3::new(-0.4, y, 0.0),
        to_m: Point3::new(0.4, y, 0.0),
        color_rgba: [0.0, 0.0, 0.0, 1.0],
        width_px: 6.0,
    };
    let with = |y: f64| {
        let ball = surface(&ball(0.2), at(0.0, 0.0, 0.0), RED);
        let scene = Scene {
            surfaces: vec![ball],
            lines: vec![line(y)],
            ..Scene::default()
        };
        render(&scene, &front())
    };
    assert_eq!(center(&with(-0.5)), [0, 0, 0]);
    let behind = with(0.5);
    assert!(center(&behind)[0] > 120);
    assert_eq!(
        behind.pixel(45, 60),
        Some([0, 0, 0]),
        "beside the ball the line is seen"
    );
}

#[test]
fn what_passes_the_eye_is_clipped_and_what_is_behind_is_not_drawn() {
    // A corridor of which the eye is inside: its walls fill the picture.
    let corridor = surface(&cuboid(0.3, 50.0, 0.3), at(0.0, 0.0, 0.0), GREEN);
    let image = render(&scene(vec![corridor]), &front());
    assert!(
        image
            .pixel(5, 60)
            .is_some_and(|[red, green, _]| green > red)
    );
    let behind = surface(&ball(0.5), at(0.0, -3.0, 0.0), RED);
    assert_eq!(
        render(&scene(vec![behind]), &front()),
        render(&Scene::default(), &front())
    );
}

#[test]
fn defective_geometry_is_left_out() {
    let mut mesh: TriangleMesh = ball(0.2).surface(CHORD_ERROR_M);
    let whole = mesh.triangles.len();
    mesh.vertices_m.push(Point3::new(f64::NAN, 0.0, 0.0));
    let nan = u32::try_from(mesh.vertices_m.len() - 1).expect("small");
    mesh.triangles
        .extend([[0, 1, nan], [0, 1, u32::MAX], [3, 3, 4]]);
    let good = TriangleMesh {
        vertices_m: mesh.vertices_m.clone(),
        triangles: mesh.triangles[..whole].to_vec(),
    };
    let instance = |mesh: TriangleMesh, pose| SurfaceInstance {
        mesh: Arc::new(mesh),
        world_from_surface: pose,
        color_rgba: RED,
    };
    let expected = render(&scene(vec![instance(good, at(0.0, 0.0, 0.0))]), &front());
    let nowhere = instance(ball(0.2).surface(CHORD_ERROR_M), at(f64::NAN, 0.0, 0.0));
    let line = Line3 {
        from_m: Point3::new(f64::INFINITY, 0.0, 0.0),
        to_m: Point3::origin(),
        color_rgba: RED,
        width_px: 1.0,
    };
    let label = Label {
        text: "x".into(),
        anchor: Anchor::World(Point3::new(f64::NAN, 0.0, 0.0)),
    };
    let defective = Scene {
        surfaces: vec![instance(mesh, at(0.0, 0.0, 0.0)), nowhere],
        lines: vec![line],
        labels: vec![label],
        floor: Some(Floor {
            center_m: Point2::origin(),
            z_m: -1.0,
            radius_m: f64::NAN,
            spacing_m: 0.1,
        }),
    };
    assert!(render(&defective, &front()) == expected);
}

#[test]
fn things_shade_the_floor_beneath_them() {
    let floor = Floor {
        center_m: Point2::origin(),
        z_m: -0.4,
        radius_m: 2.0,
        spacing_m: 10.0,
    };
    let camera = Camera {
        eye_m: Point3::new(0.0, -2.0, 1.5),
        ..front()
    };
    let under = |surfaces| {
        let scene = Scene {
            floor: Some(floor),
            ..scene(surfaces)
        };
        render(&scene, &camera)
    };
    let (bare, shaded) = (
        under(Vec::new()),
        under(vec![surface(
            &cuboid(0.2, 0.2, 0.01),
            at(0.0, 0.0, -0.1),
            RED,
        )]),
    );
    let darkened = (0..120)
        .flat_map(|y| (0..160).map(move |x| (x, y)))
        .filter(|&(x, y)| {
            let (before, after) = (bare.pixel(x, y), shaded.pixel(x, y));
            before.zip(after).is_some_and(|(before, after)| {
                // Grey as before, but darker: the floor, not the thing.
                after[1] + 8 < before[1] && after[0].abs_diff(after[1]) < 8
            })
        });
    assert!(darkened.count() > 50);
}

#[test]
fn labels_stand_where_they_should_and_out_of_each_others_way() {
    let label = |anchor| Label {
        text: "MMMM".into(),
        anchor,
    };
    let changed = |labels: Vec<Label>| {
        let image = render(
            &Scene {
                labels,
                ..Scene::default()
            },
            &front(),
        );
        let empty = render(&Scene::default(), &front());
        (0..120)
            .flat_map(|y| (0..160).map(move |x| (x, y)))
            .filter(|&(x, y)| image.pixel(x, y) != empty.pixel(x, y))
            .collect::<Vec<_>>()
    };
    let top_left = changed(vec![label(Anchor::TopLeft)]);
    assert!(top_left.len() > 200 && top_left.iter().all(|&(x, y)| x < 80 && y < 60));
    let bottom_right = changed(vec![label(Anchor::BottomRight)]);
    assert!(bottom_right.len() > 200 && bottom_right.iter().all(|&(x, y)| x >= 80 && y >= 60));
    let two = changed(vec![label(Anchor::TopLeft), label(Anchor::TopLeft)]);
    assert_eq!(two.len(), 2 * top_left.len());
    let pointed = changed(vec![label(Anchor::World(Point3::origin()))]);
    assert!(
        pointed.contains(&(80, 60)),
        "the leader starts at the point"
    );
    assert!(changed(vec![label(Anchor::World(Point3::new(0.0, -3.0, 0.0)))]).is_empty());
}

#[test]
fn a_sheet_holds_all_pictures_and_captions() {
    let picture = |value: u8| {
        (
            Image::filled(40, 30, [value; 3]),
            format!("picture {value}"),
        )
    };
    let sheet = tile(&[picture(10), picture(20), picture(30)], 2);
    for value in [10, 20, 30] {
        let shown = (0..sheet.height_px())
            .flat_map(|y| (0..sheet.width_px()).map(move |x| (x, y)))
            .filter(|&(x, y)| sheet.pixel(x, y) == Some([value; 3]));
        assert!(shown.count() >= 40 * 30, "{value}");
    }
    assert!(sheet.width_px() > 80 && sheet.width_px() < 160);
    let empty = tile(&[], 4);
    assert!(empty.width_px() < 50);
}

#[test]
fn the_bench_renders_to_the_same_png_twice() {
    let (scene, camera) = (bench(), bench_camera([600, 450]));
    let image = render(&scene, &camera);
    let bytes = image.to_png().expect("has pixels");
    assert_eq!(bytes, render(&scene, &camera).to_png().expect("has pixels"));
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes))
        .read_info()
        .expect("a PNG");
    let mut pixels = vec![0; reader.output_buffer_size().expect("small")];
    let info = reader.next_frame(&mut pixels).expect("whole");
    assert_eq!((info.width, info.height), (600, 450));
    assert_eq!(
        pixels.chunks_exact(3).nth(225 * 600 + 300),
        Some(&center(&image)[..])
    );
}

#[test]
fn a_picture_on_a_stage_is_that_of_all_together() {
    let camera = bench_camera([300, 225]);
    let whole = render(&bench(), &camera);
    let mut seen = 0;
    for standing in [0, 1, 4, 9, bench().surfaces.len()] {
        let mut things = bench();
        let stage = Scene {
            surfaces: things.surfaces.drain(..standing).collect(),
            floor: things.floor.take(),
            ..Scene::default()
        };
        let stage = Stage::new(&stage, &camera);
        assert!(stage.picture(&things) == whole, "{standing} surfaces stand");
        // What was drawn on it does not stay.
        seen += usize::from(stage.picture(&Scene::default()) != whole);
    }
    assert_eq!(seen, 5);
}

#[test]
fn empty_pictures_are_errors() {
    let empty = Image::filled(0, 2, [0; 3]);
    assert!(matches!(empty.to_png(), Err(PictureError::Encode { .. })));
}

//! Room for people, against closed forms.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use nalgebra::{Point3, Vector3};
use needlebench_cell::{BodyKind, Cell, CollisionBody, Frame};
use needlebench_evaluation::room::{
    CONE_TOLERANCE_RAD, ENTRY_DISC_HEIGHT_M, Obstacles, OpenLines, RoomModel, Sector, SightTargets,
    hand_cone,
};
use needlebench_geometry::{Shape, Solid};
use needlebench_kinematics::ik::{Configuration, Elbow};
use needlebench_kinematics::{Joints, Pose};
use needlebench_scenario::{Overrides, ResolvedScenario};

fn table3() -> ResolvedScenario {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/table3.toml");
    needlebench_scenario::load_scenario(&path, &Overrides::default()).expect("a shipped scenario")
}

/// A cell with one fixed body in place of everything else; `kind` says whether it counts as robot.
fn cell_with(kind: BodyKind, shape: Shape, world_from_shape: Pose) -> Cell {
    let mut cell = table3().cell;
    cell.bodies = vec![CollisionBody {
        name: "obstacle".into(),
        kind,
        frame: Frame::World,
        solids: vec![Solid {
            name: "obstacle.0".into(),
            shape,
            parent_from_shape: world_from_shape,
        }],
    }];
    cell.pairs.clear();
    cell
}

/// Share of a half ball of 0.35 m about the origin that is farther than 0.05 m from the solid.
fn free_fraction(shape: Shape, world_from_shape: Pose, voxel_m: f64) -> f64 {
    let cell = cell_with(BodyKind::Base, shape, world_from_shape);
    let obstacles = Obstacles::new(&cell);
    let sector = Sector::new(
        Point3::origin(),
        Vector3::z(),
        0.35,
        voxel_m,
        &obstacles.surroundings(),
        None,
    );
    let taken = obstacles.robot(&Joints::zeros()).taken(&sector.grid, 0.05);
    sector.free_fraction(&taken)
}

const HALF_BALL_M3: f64 = 2.0 / 3.0 * PI * 0.35 * 0.35 * 0.35;

/// Largest error of free fractions at the voxel size in use: twice what these tests show.
const FREE_ERROR: f64 = 0.01;

#[test]
fn free_fraction_beside_a_ball_is_the_closed_form() {
    let radius_m: f64 = 0.06;
    let truth = 1.0 - 4.0 / 3.0 * PI * (radius_m + 0.05).powi(3) / HALF_BALL_M3;
    let at = Pose::translation(0.031, -0.043, 0.17);
    let error = |voxel_m| (free_fraction(Shape::Sphere { radius_m }, at, voxel_m) - truth).abs();
    let errors = [0.04, 0.02, 0.01, 0.005].map(error);
    assert!(errors[1] < FREE_ERROR, "{errors:?}");
    // Finer cubes converge to the truth.
    assert!(
        errors[2] < 0.5 * FREE_ERROR && errors[3] < 0.1 * FREE_ERROR,
        "{errors:?}"
    );
}

#[test]
fn free_fraction_beside_a_capsule_is_the_closed_form() {
    let (radius_m, half_length_m): (f64, f64) = (0.04, 0.1);
    let grown_m = radius_m + 0.05;
    let volume = PI * grown_m * grown_m * (2.0 * half_length_m + 4.0 / 3.0 * grown_m);
    let truth = 1.0 - volume / HALF_BALL_M3;
    let lying = Pose::new(
        Vector3::new(0.02, 0.01, 0.14),
        Vector3::new(FRAC_PI_2, 0.0, 0.0),
    );
    let shape = Shape::Capsule {
        radius_m,
        half_length_m,
    };
    let found = free_fraction(shape, lying, 0.02);
    assert!((found - truth).abs() < FREE_ERROR, "{found} {truth}");
}

#[test]
fn blocks_of_voxels_give_what_single_voxels_give() {
    let resolved = table3();
    let room = RoomModel::new(&resolved);
    let grid = &room.sector(0).grid;
    let q = Joints::new(-0.7, -2.2, -1.9, 0.1, 1.3, 0.1);
    let robot = room.obstacles().robot(&q);
    let taken = robot.taken(grid, 0.05);
    let mut count = 0;
    for index in (0..grid.len()).step_by(37) {
        let mut single = grid.clone();
        single.cells = [1; 3];
        single.corner_m = grid.center_m(index) - Vector3::repeat(0.5 * grid.voxel_m);
        assert_eq!(robot.taken(&single, 0.05), [taken[index]]);
        count += usize::from(taken[index]);
    }
    assert!(count > 10, "the arm is in the sector");
}

fn cone_beside(shape: Shape, world_from_shape: Pose) -> f64 {
    let cell = cell_with(BodyKind::Table, shape, world_from_shape);
    let obstacles = Obstacles::new(&cell);
    let found = hand_cone(
        &obstacles.all(&Joints::zeros()),
        &Point3::origin(),
        &Vector3::z(),
        0.2,
    );
    assert!(found.accuracy_rad <= CONE_TOLERANCE_RAD);
    found.half_angle_rad
}

/// Never larger than the truth, and by no more than the tolerance smaller.
fn assert_bounds(found_rad: f64, truth_rad: f64) {
    assert!(found_rad <= truth_rad + 1e-9, "{found_rad} {truth_rad}");
    assert!(
        truth_rad - found_rad <= CONE_TOLERANCE_RAD,
        "{found_rad} {truth_rad}"
    );
}

#[test]
fn hand_cone_beside_a_ball_touches_it() {
    for (x, y, z, radius_m) in [
        (0.1_f64, 0.0_f64, 0.1_f64, 0.03_f64),
        (-0.02, 0.07, 0.12, 0.02),
    ] {
        let distance: f64 = Vector3::new(x, y, z).norm();
        let to_center = Vector3::new(x, y, z).angle(&Vector3::z());
        let truth =
            to_center - libm::atan2(radius_m, (distance * distance - radius_m * radius_m).sqrt());
        let found = cone_beside(Shape::Sphere { radius_m }, Pose::translation(x, y, z));
        assert_bounds(found, truth);
    }
}

#[test]
fn hand_cone_beside_a_wall_ends_at_the_reach() {
    // A wall at x = 0.05: the cone of 0.2 m meets it at its rim, where sin = 0.05 / 0.2.
    let shape = Shape::Cuboid {
        half_extents_m: Vector3::new(0.5, 2.0, 2.0),
    };
    let truth = libm::atan2(0.05, (0.2_f64 * 0.2 - 0.05 * 0.05).sqrt());
    assert_bounds(cone_beside(shape, Pose::translation(0.55, 0.0, 0.0)), truth);
}

#[test]
fn hand_cone_is_a_half_space_where_nothing_stands_and_none_with_the_axis_blocked() {
    let ball = Shape::Sphere { radius_m: 0.05 };
    let far = cone_beside(ball.clone(), Pose::translation(0.0, 0.0, -0.3));
    assert!((far - FRAC_PI_2).abs() < CONE_TOLERANCE_RAD);
    let blocked = cone_beside(ball, Pose::translation(0.01, 0.0, 0.1));
    assert!(blocked.abs() < f64::EPSILON);
}

#[test]
fn true_hand_cone_lies_between_the_bound_and_what_it_may_be_larger_by() {
    /// Rounding of closed form and distances, rad.
    const ROUNDING_RAD: f64 = 1e-6;
    let mut wide = 0;
    for k in 0..32_u32 {
        // Balls at 20 to 115 mm from the guide's entry, about the axis at 14 to 80 degrees.
        let (part, turn) = (f64::from(k) / 31.0, f64::from(k) * 2.4);
        let distance_m = 0.02 + 0.095 * part;
        let tilt = 0.25 + 1.15 * (f64::from(k) * 0.618).fract();
        let radius_m = 0.6 * distance_m * libm::sin(tilt).min(0.8);
        let at = Vector3::new(
            libm::sin(tilt) * libm::cos(turn),
            libm::sin(tilt) * libm::sin(turn),
            libm::cos(tilt),
        ) * distance_m;
        let touches_m = (distance_m * distance_m - radius_m * radius_m).sqrt();
        assert!(touches_m > 0.01, "the hand's cone begins at 10 mm");
        let truth = tilt - libm::atan2(radius_m, touches_m);
        let cell = cell_with(
            BodyKind::Table,
            Shape::Sphere { radius_m },
            Pose::translation(at.x, at.y, at.z),
        );
        let obstacles = Obstacles::new(&cell);
        let all = obstacles.all(&Joints::zeros());
        let found = hand_cone(&all, &Point3::origin(), &Vector3::z(), 0.2);
        let [low, high] = [0.0, found.accuracy_rad].map(|more| found.half_angle_rad + more);
        assert!(low <= truth + ROUNDING_RAD, "{k}: {low} {truth}");
        assert!(truth <= high + ROUNDING_RAD, "{k}: {truth} {high}");
        wide += usize::from(found.accuracy_rad > 2.0 * CONE_TOLERANCE_RAD);
    }
    assert!(wide <= 3, "{wide} of 32 are hardly known");
}

/// Series of 512 segments of an even sequence.
const SIGHT_ERROR: f64 = 0.01;

#[test]
fn sight_past_a_half_plane_is_the_share_of_the_disc_beyond_it() {
    // Eyes that do not move, 1 m over the middle of the disc; half-way a plate covers x < edge.
    let disc_m = Point3::new(0.0, 0.0, -ENTRY_DISC_HEIGHT_M);
    let targets = SightTargets {
        entry_m: disc_m,
        outwards: Vector3::z(),
        needle_m: [Point3::new(-0.03, 0.0, 0.0), Point3::new(0.03, 0.0, 0.0)],
    };
    for edge_m in [-0.010, 0.0, 0.004] {
        let plate = Shape::Cuboid {
            half_extents_m: Vector3::new(0.5, 0.5, 1e-6),
        };
        let cell = cell_with(
            BodyKind::Base,
            plate,
            Pose::translation(edge_m - 0.5, 0.0, 0.5),
        );
        let obstacles = Obstacles::new(&cell);
        let eyes = Point3::new(0.0, 0.0, 1.0);
        let lines = OpenLines::new(&obstacles.surroundings(), &eyes, 0.0, &targets);
        let seen = lines.past(&obstacles.robot(&Joints::zeros()));
        // On the disc of 30 mm the shadow's edge is at twice the plate's.
        let ratio: f64 = 2.0 * edge_m / 0.03;
        let hidden = 0.5
            + (ratio * (1.0 - ratio * ratio).sqrt()
                + libm::atan2(ratio, (1.0 - ratio * ratio).sqrt()))
                / PI;
        assert!(
            (seen.entry_fraction - (1.0 - hidden)).abs() < SIGHT_ERROR,
            "{seen:?} {hidden}"
        );
        let needle = 0.5 - edge_m / 0.03;
        assert!(
            (seen.needle_fraction - needle).abs() < SIGHT_ERROR,
            "{seen:?}"
        );
        assert_eq!(seen.blocker.as_deref(), Some("obstacle.0"));
    }
}

#[test]
fn eyes_that_move_are_spread_over_a_ball() {
    // A plate that hides all targets from eyes with x < 0: half of the ball sees them.
    let target = Point3::new(0.0, 0.0, -1000.0);
    let targets = SightTargets {
        entry_m: target,
        outwards: Vector3::z(),
        needle_m: [target, target],
    };
    for (edge_m, free) in [(0.0, 0.5), (0.05, 0.15625)] {
        let plate = Shape::Cuboid {
            half_extents_m: Vector3::new(1.0, 1.0, 1e-3),
        };
        let at = Pose::translation(edge_m - 1.0, 0.0, -0.2);
        let cell = cell_with(BodyKind::Base, plate, at);
        let obstacles = Obstacles::new(&cell);
        let eyes = Point3::origin();
        let lines = OpenLines::new(&obstacles.surroundings(), &eyes, 0.1, &targets);
        let seen = lines.past(&obstacles.robot(&Joints::zeros()));
        assert!(
            (seen.needle_fraction - free).abs() < SIGHT_ERROR,
            "{seen:?}"
        );
    }
}

/// Joint positions of the paper's eight configurations at the exact pose, to six decimals.
const EIGHT: [[f64; 6]; 8] = [
    [-0.73508, 2.370465, 1.882823, -1.96721, 1.274286, 0.113862],
    [-0.73508, -2.212137, -1.882823, 0.097853, 1.274286, 0.113862],
    [-0.73508, 3.086748, 0.81324, 1.527683, -1.274286, -3.027731],
    [-0.73508, -2.440485, -0.81324, 2.39821, -1.274286, -3.027731],
    [
        1.75692, 0.776095, -1.872123, -1.227444, -1.423564, -0.365947,
    ],
    [1.75692, -0.915811, 1.872123, 3.003401, -1.423564, -0.365947],
    [1.75692, 0.054278, -0.827189, 1.591031, 1.423564, 2.775646],
    [1.75692, -0.714521, 0.827189, 0.705453, 1.423564, 2.775646],
];

#[test]
fn elbows_of_the_paper_are_up_where_its_labels_say_so() {
    let resolved = table3();
    let room = RoomModel::new(&resolved);
    for (joints, configuration) in EIGHT.iter().zip(Configuration::ALL) {
        let report = room.measure(0, &Joints::from_column_slice(joints));
        let up = configuration.elbow == Elbow::Up;
        assert_eq!(report.elbow_up, up, "{configuration}");
        assert_eq!(report.elbow_as_preferred, Some(up));
        assert_eq!(report.sight.len(), 6, "two doctors of three statures");
        let shares = [report.free_fraction, report.sight_fraction];
        assert!(shares.iter().all(|share| (0.0..=1.0).contains(share)));
    }
}

#[test]
fn an_unfolded_left_arm_stands_in_the_way_of_the_hand() {
    let resolved = table3();
    let room = RoomModel::new(&resolved);
    let report = room.measure(0, &Joints::from_column_slice(&EIGHT[7]));
    assert!(report.hand_cone_half_angle_rad < 0.02);
    assert!(
        report
            .hand_cone_blocker
            .is_some_and(|name| name.starts_with("forearm"))
    );
}

#[test]
fn what_the_surroundings_hide_is_not_taken_by_the_robot() {
    let targets = SightTargets {
        entry_m: Point3::new(0.0, 0.0, -ENTRY_DISC_HEIGHT_M),
        outwards: Vector3::z(),
        needle_m: [Point3::new(-0.03, 0.0, 0.0), Point3::new(0.03, 0.0, 0.0)],
    };
    let plate = |at_m: f64| {
        let half_extents_m = Vector3::new(0.5, 0.5, 1e-6);
        (
            Shape::Cuboid { half_extents_m },
            Pose::translation(at_m, 0.0, 0.5),
        )
    };
    let (shape, at) = plate(-0.5);
    let mut cell = cell_with(BodyKind::Table, shape, at);
    let eye = Point3::new(0.0, 0.0, 1.0);
    let seen = |cell: &Cell| {
        let obstacles = Obstacles::new(cell);
        let robot = obstacles.robot(&Joints::zeros());
        OpenLines::new(&obstacles.surroundings(), &eye, 0.0, &targets).past(&robot)
    };
    let alone = seen(&cell);
    assert!(
        (alone.without_robot_fraction - 0.5).abs() < SIGHT_ERROR,
        "{alone:?}"
    );
    assert_eq!([alone.entry_fraction, alone.needle_fraction], [1.0, 1.0]);
    assert_eq!(alone.blocker, None);
    // A robot behind the table takes nothing, one beside it half of what is left of the needle.
    for (at_m, needle) in [(-0.5, 1.0), (-0.4925, 0.5)] {
        let (shape, at) = plate(at_m);
        cell.bodies.truncate(1);
        cell.bodies.push(CollisionBody {
            name: "robot".into(),
            kind: BodyKind::Base,
            frame: Frame::World,
            solids: vec![Solid {
                name: "robot.0".into(),
                shape,
                parent_from_shape: Pose::translation(0.0, 0.0, -1e-3) * at,
            }],
        });
        let both = seen(&cell);
        assert!(
            (both.needle_fraction - needle).abs() < 2.0 * SIGHT_ERROR,
            "{both:?}"
        );
        assert!(
            (both.without_robot_fraction - 0.5).abs() < SIGHT_ERROR,
            "{both:?}"
        );
    }
}

#[test]
fn shares_of_sight_are_as_near_to_the_true_ones_as_they_say() {
    /// Rays of the independent estimate, and its standard error at the worst share.
    const RAYS: u32 = 4000;
    let resolved = table3();
    let room = RoomModel::new(&resolved);
    let (mut compared, mut beyond) = (0, 0);
    for joints in [&EIGHT[1], &EIGHT[7]] {
        let q = Joints::from_column_slice(joints);
        let report = room.measure(0, &q);
        let robot = room.obstacles().robot(&q);
        let surroundings = room.obstacles().surroundings();
        let targets = room.targets(0, &q);
        let people = &resolved.people.by_goal[0];
        let mut sights = report.sight.iter();
        for person in people {
            for &stature_m in &person.statures_m {
                let said = sights.next().unwrap();
                let eyes_m = person.eyes_m(stature_m);
                let mut state = 7_u64;
                let mut uniform = || {
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    (state >> 11) as f64 / (1_u64 << 53) as f64
                };
                let mut counts = [[0_u32; 2]; 2];
                for ray in 0..2 * RAYS {
                    // By rejection, not by the way of the series.
                    let eye = loop {
                        let at = Vector3::from_fn(|_, _| 2.0 * uniform() - 1.0);
                        if at.norm() <= 1.0 {
                            break eyes_m + at * person.head_movement_m;
                        }
                    };
                    let target = if ray % 2 == 0 {
                        let across = targets
                            .outwards
                            .cross(&Vector3::new(0.3, 0.5, 0.7))
                            .normalize();
                        let beside = targets.outwards.cross(&across);
                        loop {
                            let [a, b] = [2.0 * uniform() - 1.0, 2.0 * uniform() - 1.0];
                            if libm::hypot(a, b) <= 1.0 {
                                break targets.entry_m
                                    + targets.outwards * ENTRY_DISC_HEIGHT_M
                                    + (across * a + beside * b) * 0.03;
                            }
                        }
                    } else {
                        targets.needle_m[0]
                            + (targets.needle_m[1] - targets.needle_m[0]) * uniform()
                    };
                    if surroundings
                        .lines()
                        .first_on_the_way(&eye, &target)
                        .is_none()
                    {
                        let [open, free] = &mut counts[(ray % 2) as usize];
                        *open += 1;
                        *free += u32::from(robot.lines().first_on_the_way(&eye, &target).is_none());
                    }
                }
                let share = |[open, free]: [u32; 2]| f64::from(free) / f64::from(open.max(1));
                let truth = 0.5 * (share(counts[0]) + share(counts[1]));
                // Binomial, of the few lines that the surroundings leave.
                let error = 0.5
                    * counts
                        .map(|each| {
                            let (share, open) = (share(each), f64::from(each[0].max(1)));
                            share * (1.0 - share) / open
                        })
                        .iter()
                        .sum::<f64>()
                        .sqrt();
                compared += 1;
                let apart = (said.fraction - truth).abs();
                beyond += usize::from(apart > libm::hypot(said.accuracy, 2.0 * error));
                assert!(
                    apart < 2.5 * libm::hypot(said.accuracy, 2.0 * error),
                    "{said:?} {truth}"
                );
            }
        }
    }
    // 95 of 100 are within: of twelve hardly ever more than two are not.
    assert!(compared == 12 && beyond <= 2, "{beyond} of {compared}");
}

//! The shipped arms' primitives among themselves: links that share a joint overlap at it in every
//! posture, as the housings do, and an arm in a usual posture is free of itself.

use std::f64::consts::PI;

use crate::common::Variety;
use needlebench_cell::{BodyKind, BodyPair, Cell, ClearanceClass, place_in_chain};
use needlebench_clearance::ClearanceModel;
use needlebench_kinematics::Joints;
use needlebench_robot::Arm;
use needlebench_scenario::{Overrides, resolve_scenario};

/// The cell of an arm and a tool.
fn cell(arm: &str) -> Cell {
    let text = format!(
        "name = \"s\"\n[robot]\nurdf = \"{arm}\"\n[[goals]]\nname = \"g\"\ninsertion_length_mm = 100\n\
         [goals.flange_pose]\nposition_mm = [200, -300, 300]\nrotation_vector_rad = [3.1, 0, 0]\n"
    );
    let file = std::path::Path::new("");
    let resolved = resolve_scenario("s.toml", &text, file, &Overrides::default());
    resolved.unwrap().cell
}

fn arms() -> impl Iterator<Item = (&'static str, Cell)> {
    Arm::shipped_names().map(|arm| (arm, cell(arm)))
}

#[test]
fn links_that_share_a_joint_overlap_in_every_posture() {
    for (arm, mut cell) in arms() {
        let of_arm = |kind| matches!(kind, BodyKind::Base | BodyKind::Link);
        let place = |body: usize| place_in_chain(cell.bodies[body].frame);
        let bodies: Vec<usize> = (0..cell.bodies.len())
            .filter(|body| of_arm(cell.bodies[*body].kind))
            .collect();
        let neighbours: Vec<BodyPair> = bodies
            .iter()
            .flat_map(|a| bodies.iter().map(move |b| (*a, *b)))
            .filter(|(a, b)| place(*a) == place(*b) + 1)
            .map(|(a, b)| BodyPair {
                a,
                b,
                class: ClearanceClass::SelfCollision,
            })
            .collect();
        assert_eq!(neighbours.len(), 6, "{arm}");
        cell.pairs = neighbours;
        let model = ClearanceModel::new(&cell);
        let mut variety = Variety::new(7);
        for _ in 0..200 {
            let q = Joints::from_fn(|_, _| variety.between(-PI, PI));
            for pair in model.all_pairs(&q) {
                let distance_m = pair.separation.distance_m;
                assert!(distance_m < 0.0, "{arm} {:?}", pair.solid_names(&cell));
            }
        }
    }
}

#[test]
fn usual_postures_are_free_of_the_arm_itself() {
    for (arm, cell) in arms() {
        let model = ClearanceModel::new(&cell);
        for degrees in [
            [0.0; 6],
            [0.0, -90.0, 0.0, -90.0, 0.0, 0.0],
            [0.0, -90.0, -60.0, -90.0, 90.0, 0.0],
            [0.0, -90.0, -90.0, -90.0, 90.0, 0.0],
            [90.0, -120.0, 100.0, -70.0, -90.0, 45.0],
        ] {
            let q = Joints::from(degrees.map(f64::to_radians));
            let minima = model.minimum_per_class(&q);
            let nearest = minima.get(ClearanceClass::SelfCollision).unwrap();
            assert!(
                nearest.separation.distance_m > 0.0,
                "{arm} at {degrees:?}: {:?}",
                nearest.solid_names(&cell)
            );
        }
    }
}

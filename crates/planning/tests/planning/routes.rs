//! What the planned needle keeps away from.

use std::path::Path;

use nalgebra::Point3;
use needlebench_cell::Rule;
use needlebench_clearance::ClearanceModel;
use needlebench_geometry::{PreparedShape, Shape, separation};
use needlebench_kinematics::Pose;
use needlebench_phantom::Tissue;
use needlebench_planning::{Planner, crossed_fissures, judge_route, route_rejection};
use needlebench_scenario::{Overrides, ResolvedScenario, resolve_scenario};

/// A needle from a direction to the lesion at the right pleura, with more under `[planning]`.
fn from_direction(azimuth_deg: f64, elevation_deg: f64, needle_route: &str) -> ResolvedScenario {
    let text = format!(
        "name = \"directions\"\n[robot]\nbase_position_mm = [0, 0, 800]\nbase_rpy_deg = [0, 0, 180]\n\
         [tool]\nneedle_length_mm = 300\n\
         [phantom]\nposition_mm = [146, -597.5, 0]\n[table]\ncenter_mm = [300, -598]\n\
         top_height_mm = 739.5\n[planning.needle_route]\n{needle_route}\n[[goals]]\nname = \"lesion\"\n\
         lesion = \"pleural_based\"\nentry_direction_deg = [{azimuth_deg}, {elevation_deg}]\n"
    );
    resolve_scenario("test.toml", &text, Path::new(""), &Overrides::default())
        .unwrap_or_else(|findings| panic!("{findings:?}"))
}

/// Directions from which a needle could come: the front and the right side.
fn directions() -> impl Iterator<Item = (f64, f64)> {
    (0..8).flat_map(|k| [-20.0, 0.0, 20.0].map(|elevation| (-10.0 * f64::from(k), elevation)))
}

/// Parts that points on the needle's axis lie in, found point by point.
fn pierced(resolved: &ResolvedScenario) -> Vec<(String, Tissue)> {
    let placed = resolved.phantom.as_ref().unwrap();
    let goal = &resolved.goals[0];
    let to_phantom = placed.world_from_phantom.inverse();
    let entry = to_phantom * goal.entry_m.unwrap();
    let target = to_phantom * goal.target_m;
    let parts = placed.phantom.parts.iter().filter(|part| {
        matches!(part.tissue, Tissue::Bone | Tissue::Vessel | Tissue::Organ)
            && (goal.target_organ.is_none() || part.organ != goal.target_organ)
    });
    let hit = parts.filter(|part| {
        (0..=2000).any(|k| {
            let at = f64::from(k) / 2000.0;
            let point = Point3::from(entry.coords.lerp(&target.coords, at));
            part.solid.contains(&point)
        })
    });
    hit.map(|part| (part.name.clone(), part.tissue)).collect()
}

#[test]
fn needle_that_pierces_something_is_refused_from_every_direction() {
    let (mut refused, mut kept) = (0, 0);
    for (azimuth_deg, elevation_deg) in directions() {
        let resolved = from_direction(azimuth_deg, elevation_deg, "");
        let goal = &resolved.goals[0];
        let pierced = pierced(&resolved);
        let rejection = route_rejection(&resolved, goal);
        if let Some(rejection) = rejection {
            assert_eq!(rejection.rule, Rule::NeedleRoute);
            assert!(rejection.value < rejection.limit);
            refused += 1;
        } else {
            assert!(
                pierced.is_empty(),
                "{azimuth_deg} {elevation_deg}: {pierced:?}"
            );
            kept += 1;
        }
    }
    assert!(refused >= 5 && kept >= 5, "{refused} refused, {kept} kept");
}

/// Fissures that the needle's axis comes nearer to than its radius, found point by point.
fn reached_fissures(resolved: &ResolvedScenario) -> Vec<String> {
    let placed = resolved.phantom.as_ref().unwrap();
    let goal = &resolved.goals[0];
    let to_phantom = placed.world_from_phantom.inverse();
    let entry = to_phantom * goal.entry_m.unwrap();
    let target = to_phantom * goal.target_m;
    let radius_m = 0.5 * resolved.cell.tool.needle.outer_diameter_m;
    let ball = PreparedShape::new(&Shape::Sphere { radius_m });
    let fissures = placed.phantom.parts.iter();
    let fissures = fissures.filter(|part| part.tissue == Tissue::Fissure);
    let reached = fissures.filter(|part| {
        let plate = PreparedShape::new(&part.solid.shape);
        (0..=400).any(|k| {
            let point = entry.coords.lerp(&target.coords, f64::from(k) / 400.0);
            let at = Pose::translation(point.x, point.y, point.z);
            separation(&ball, &at, &plate, &part.solid.parent_from_shape).distance_m <= 0.0
        })
    });
    reached.map(|part| part.name.clone()).collect()
}

#[test]
fn crossed_fissures_are_those_that_the_needle_reaches() {
    let (mut crossing, mut clear) = (0, 0);
    for (azimuth_deg, elevation_deg) in directions() {
        let resolved = from_direction(azimuth_deg, elevation_deg, "");
        let crossed = crossed_fissures(&resolved, &resolved.goals[0]);
        assert_eq!(
            crossed,
            reached_fissures(&resolved),
            "{azimuth_deg} {elevation_deg}"
        );
        if crossed.is_empty() {
            clear += 1;
        } else {
            crossing += 1;
        }
        let judged = judge_route(&resolved, &resolved.goals[0]);
        assert!(judged.is_none_or(|judged| judged.nearest.part.tissue != Tissue::Fissure));
    }
    assert!(
        crossing >= 3 && clear >= 3,
        "{crossing} cross, {clear} do not"
    );
}

/// The first direction whose needle pierces a bone.
fn through_a_bone() -> (f64, f64, String) {
    directions()
        .find_map(|(azimuth_deg, elevation_deg)| {
            let found = pierced(&from_direction(azimuth_deg, elevation_deg, ""));
            let bone = found
                .into_iter()
                .find(|(_, tissue)| *tissue == Tissue::Bone);
            bone.map(|(name, _)| (azimuth_deg, elevation_deg, name))
        })
        .expect("some direction meets a rib")
}

#[test]
fn refused_route_rejects_every_configuration_first() {
    let (azimuth_deg, elevation_deg, _) = through_a_bone();
    let resolved = from_direction(azimuth_deg, elevation_deg, "");
    let model = ClearanceModel::new(&resolved.cell);
    let planner = Planner::new(&resolved, &model).unwrap();
    let goal = &resolved.goals[0];
    for plan in planner.plan(goal).configurations {
        assert_eq!(plan.rejections[0].rule, Rule::NeedleRoute);
        assert!(plan.retreat.is_none());
    }
    for member in planner.postures(goal) {
        assert_eq!(member.rejections[0].rule, Rule::NeedleRoute);
        assert!(member.surplus < 0.0);
    }
}

#[test]
fn route_is_switched_off_by_name_alone() {
    let (azimuth_deg, elevation_deg, part) = through_a_bone();
    let refused = |needle_route: &str| {
        let resolved = from_direction(azimuth_deg, elevation_deg, needle_route);
        route_rejection(&resolved, &resolved.goals[0]).is_some()
    };
    assert!(
        refused("bone_mm = 0"),
        "a margin of nothing is no leave to pierce"
    );
    assert!(refused("off = [\"vessel\", \"organ\"]"));
    assert!(!refused("off = [\"bone\", \"vessel\", \"organ\"]"));
    // By the name of what is pierced, or of all of its kind.
    for name in [part.as_str(), "bone"] {
        let resolved = from_direction(azimuth_deg, elevation_deg, &format!("off = [\"{name}\"]"));
        let nearest = judge_route(&resolved, &resolved.goals[0]);
        assert!(nearest.is_none_or(|judged| judged.nearest.part.name != part));
        assert!(
            resolved.notes.iter().any(|note| note.contains(name)),
            "{:?}",
            resolved.notes
        );
    }
}

#[test]
fn unknown_name_is_refused_with_the_likeliest() {
    let text = "name = \"a\"\n[phantom]\n[table]\n[planning.needle_route]\noff = [\"rib_rigt_5\"]\n\
                [[goals]]\nname = \"g\"\nlesion = \"pleural_based\"\nentry_direction_deg = [-90, 0]\n";
    let found = resolve_scenario("a.toml", text, Path::new(""), &Overrides::default());
    let findings = found.unwrap_err();
    assert_eq!(
        findings[0].key.as_deref(),
        Some("planning.needle_route.off[0]")
    );
    assert_eq!(findings[0].line, Some(5));
    assert!(
        findings[0].hint.as_ref().unwrap().contains("rib_right_5"),
        "{findings:?}"
    );
}

//! Routes among a phantom's solids, against its parts point by point.

use nalgebra::{Point3, Vector3};
use needlebench_phantom::{Phantom, PhantomPart, Tissue};
use needlebench_routing::{Obstacle, Ray, RouteRule, RouteRules, SolidAnatomy, search};
use needlebench_scenario::scenario::{NeedleRouteSection, OddsSection};

pub(crate) fn rules() -> RouteRules {
    RouteRules {
        margins_m: [2.7e-3; 3],
        constant_m: 1e-3,
        sigmas: 2.0,
        floors_m: [2.7e-3; 3],
        needle_radius_m: 0.6e-3,
        longest_m: 0.12,
        outside_m: 0.06,
        max_skin_angle_rad: 1.05,
        max_pleural_crossings: 1,
        cross_fissures: false,
        cross_bullae: false,
        throw_m: 0.01,
        odds: OddsSection::default(),
        needle: None,
    }
}

fn phantom() -> Phantom {
    Phantom::build(&Phantom::size_preset("male-p50-supine").unwrap()).unwrap()
}

pub(crate) fn counts(part: &PhantomPart, own: Option<&str>) -> Option<Obstacle> {
    if part.organ.as_deref() == own && own.is_some() {
        return None;
    }
    match part.tissue {
        Tissue::Bone => Some(Obstacle::Bone),
        Tissue::Vessel => Some(Obstacle::Vessel),
        Tissue::Organ => Some(Obstacle::Organ),
        _ => None,
    }
}

#[test]
fn free_routes_keep_their_margins_point_by_point_and_enter_one_lung_once() {
    let phantom = phantom();
    let rules = rules();
    for lesion in &phantom.lesions {
        let off = NeedleRouteSection::default();
        let anatomy = SolidAnatomy::new(&phantom, lesion.center_m, true, &off);
        let found = search(&anatomy, &rules, 250, 2, &|| false);
        for route in found.free() {
            let ray = Ray {
                target: lesion.center_m,
                outwards: route.outwards,
            };
            let entry = ray.at(route.depth_m);
            assert!(phantom.skin_signed_depth(&entry).abs() < 1e-9);
            let own = lesion.organ.as_deref();
            // As far from the axis as the margin and the needle's radius, none of it may be.
            for step in 0..60 {
                let along_m =
                    -rules.throw_m + (route.depth_m + rules.throw_m) * f64::from(step) / 59.0;
                for turn in 0..6 {
                    let (sin, cos) = libm::sincos(f64::from(turn) * std::f64::consts::FRAC_PI_3);
                    let aside = ray.outwards.cross(&Vector3::z()).normalize();
                    let other = ray.outwards.cross(&aside);
                    for part in &phantom.parts {
                        let Some(obstacle) = counts(part, own) else {
                            continue;
                        };
                        let margin_m = rules.margins_m[obstacle as usize] + rules.needle_radius_m;
                        let at = ray.at(along_m) + (aside * cos + other * sin) * margin_m * 0.999;
                        assert!(!part.solid.contains(&at), "{} at {along_m}", part.name);
                    }
                }
            }
            assert_eq!(
                route.lungs.entries,
                u32::from(own.is_some_and(|organ| organ.contains("lung")))
            );
            assert!(
                sampled_lung_m(&phantom, &ray, route.depth_m, own) - route.lungs.within_m < 2e-3
            );
        }
    }
}

/// How much of a ray is in an organ, by points 0.2 mm apart.
fn sampled_lung_m(phantom: &Phantom, ray: &Ray, depth_m: f64, own: Option<&str>) -> f64 {
    let mut inside_m = 0.0;
    let mut along_m = 1e-4;
    while along_m < depth_m {
        let at = ray.at(along_m);
        let is_own =
            |part: &&PhantomPart| part.tissue == Tissue::Organ && part.organ.as_deref() == own;
        if own.is_some()
            && phantom
                .parts
                .iter()
                .filter(is_own)
                .any(|part| part.solid.contains(&at))
        {
            inside_m += 2e-4;
        }
        along_m += 2e-4;
    }
    inside_m
}

#[test]
fn every_refusal_has_a_rule_with_a_value_beyond_its_limit() {
    let phantom = phantom();
    let rules = rules();
    let lesion = &phantom.lesions[0];
    let off = NeedleRouteSection::default();
    let anatomy = SolidAnatomy::new(&phantom, lesion.center_m, true, &off);
    let found = search(&anatomy, &rules, 600, 1, &|| false);
    let mut seen = Vec::new();
    for candidate in &found.candidates {
        let Err(refusal) = &candidate.outcome else {
            continue;
        };
        seen.push(refusal.rule);
        let is_beyond = match refusal.rule {
            RouteRule::Bone | RouteRule::Vessel | RouteRule::Organ | RouteRule::Throw => {
                refusal.value < refusal.limit
            }
            RouteRule::NoSkin | RouteRule::End | RouteRule::Outside => true,
            _ => refusal.value > refusal.limit,
        };
        assert!(is_beyond, "{refusal:?}");
    }
    assert_eq!(
        found
            .refused()
            .iter()
            .map(|(_, count)| count)
            .sum::<usize>(),
        seen.len()
    );
    assert!(seen.contains(&RouteRule::Bone) && seen.contains(&RouteRule::NeedleTooShort));
}

#[test]
fn a_target_outside_has_no_route() {
    let phantom = phantom();
    let off = NeedleRouteSection::default();
    let anatomy = SolidAnatomy::new(&phantom, Point3::new(1.0, 0.0, 0.0), false, &off);
    let found = search(&anatomy, &rules(), 50, 1, &|| false);
    assert_eq!(found.refused(), [(RouteRule::NoSkin, 50)]);
}

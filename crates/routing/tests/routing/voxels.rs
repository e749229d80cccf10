//! Routes in label maps, against every voxel of them.

use std::sync::atomic::AtomicBool;

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_routing::{
    Anatomy, Exit, Nearest, Obstacle, Ray, Route, RouteRule, RouteRules, VoxelAnatomy,
    VoxelOptions, apart, evenly, refined, search,
};
use needlebench_scenario::scenario::OddsSection;
use needlebench_volume::{LabelMap, VoxelGrid};

static GO: AtomicBool = AtomicBool::new(false);

const SPACING_M: [f64; 3] = [1.5e-3, 1.5e-3, 2e-3];
const SIZE: [usize; 3] = [110, 90, 70];

const SOFT: u16 = 1;
const LUNG: u16 = 2;
const OTHER_LUNG: u16 = 3;
const BONE: u16 = 6;
const VESSEL: u16 = 7;
const HEART: u16 = 20;
const NODULE: u16 = 100;
const UPPER: u16 = 30;

/// A chest of ellipsoids, with ribs, a heart, vessels, and a nodule; optionally with the lung in two lobes.
pub(crate) fn chest(with_lobes: bool) -> LabelMap {
    let grid = VoxelGrid::aligned(SIZE, SPACING_M, Point3::new(-0.09, -0.07, 0.02)).unwrap();
    let mut labels = vec![0_u16; grid.len()];
    for k in 0..SIZE[2] {
        for j in 0..SIZE[1] {
            for i in 0..SIZE[0] {
                let at = grid.ct_from_index(&Point3::new(i as f64, j as f64, k as f64));
                labels[grid.offset([i, j, k])] = label_at(&at, with_lobes);
            }
        }
    }
    let mut names = vec![
        (SOFT, "soft_tissue".to_owned()),
        (LUNG, "lung_left".to_owned()),
        (OTHER_LUNG, "lung_right".to_owned()),
        (BONE, "bone".to_owned()),
        (VESSEL, "contrast_vessels".to_owned()),
        (HEART, "heart".to_owned()),
        (NODULE, "nodule".to_owned()),
    ];
    if with_lobes {
        names.push((UPPER, "lung_upper_lobe_left".to_owned()));
    }
    LabelMap {
        grid,
        labels,
        names,
    }
}

fn is_in(at: &Point3<f64>, centre: [f64; 3], radii: [f64; 3]) -> bool {
    let way = at - Point3::from(centre);
    way.component_div(&Vector3::from(radii)).norm() <= 1.0
}

const CENTRE: [f64; 3] = [-0.008, -0.003, 0.09];
const TARGET: [f64; 3] = [0.03, 0.0, 0.09];

fn label_at(at: &Point3<f64>, with_lobes: bool) -> u16 {
    if !is_in(at, CENTRE, [0.07, 0.055, 0.4]) {
        return 0;
    }
    if is_in(at, TARGET, [0.006; 3]) {
        return NODULE;
    }
    if is_in(at, [-0.005, -0.015, 0.09], [0.012, 0.02, 0.03]) {
        return HEART;
    }
    let vessel = libm::hypot(at.y - 0.012, at.z - 0.1) < 0.002 && at.x > 0.0;
    if vessel {
        return VESSEL;
    }
    // Ribs: rings of bone in the wall, open in front.
    let wall = !is_in(at, CENTRE, [0.062, 0.047, 0.4]) && is_in(at, CENTRE, [0.067, 0.052, 0.4]);
    if wall && (at.z / 0.025).fract() < 0.35 && at.y > -0.035 {
        return BONE;
    }
    if is_in(at, [0.03, 0.0, 0.09], [0.025, 0.035, 0.06]) {
        return if with_lobes && at.y + 0.5 * at.x < 0.02 {
            UPPER
        } else {
            LUNG
        };
    }
    if is_in(at, [-0.042, 0.0, 0.09], [0.018, 0.035, 0.06]) {
        return OTHER_LUNG;
    }
    SOFT
}

pub(crate) fn rules() -> RouteRules {
    RouteRules {
        margins_m: [2e-3, 2.5e-3, 2.7e-3],
        constant_m: 1e-3,
        sigmas: 2.0,
        floors_m: [2e-3; 3],
        needle_radius_m: 0.6e-3,
        longest_m: 0.08,
        outside_m: 0.05,
        max_skin_angle_rad: 1.1,
        max_pleural_crossings: 1,
        cross_fissures: false,
        cross_bullae: false,
        throw_m: 0.008,
        odds: OddsSection::default(),
        needle: None,
    }
}

/// Options about a target without a lesion, with what is modelled beside bone.
pub(crate) fn usual() -> VoxelOptions<'static> {
    VoxelOptions {
        patient: None,
        lesions: &[],
        off: &[],
        needle_m: 0.15,
        markers: &[],
        outside_m: 0.05,
        lung_vessel_m: 0.0,
        below_rib_m: 3e-3,
        beside_sternum_m: 20e-3,
        hu: None,
        threads: 1,
        cancel: &GO,
    }
}

pub(crate) fn anatomy(labels: &LabelMap, threads: usize) -> VoxelAnatomy {
    VoxelAnatomy::new(
        labels,
        Vector3::zeros(),
        Point3::from(TARGET),
        &VoxelOptions {
            lesions: &["nodule".to_owned()],
            needle_m: rules().longest_m,
            outside_m: rules().outside_m,
            lung_vessel_m: 3e-3,
            below_rib_m: 0.0,
            beside_sternum_m: 0.0,
            threads,
            ..usual()
        },
    )
    .unwrap()
}

/// Middles of the voxels of an obstacle.
pub(crate) fn boxes_of(labels: &LabelMap, obstacle: Obstacle) -> Vec<Point3<f64>> {
    let mut boxes = Vec::new();
    for k in 0..SIZE[2] {
        for j in 0..SIZE[1] {
            for i in 0..SIZE[0] {
                if is_obstacle(labels, [i, j, k], obstacle) {
                    let index = Point3::new(i as f64, j as f64, k as f64);
                    boxes.push(labels.grid.ct_from_index(&index));
                }
            }
        }
    }
    boxes
}

/// Least distance of a stretch of a ray's axis from boxes of voxels: in steps of 0.2 mm, each with all of them.
pub(crate) fn brute_m(boxes: &[Point3<f64>], ray: &Ray, [from_m, to_m]: [f64; 2]) -> f64 {
    let half = Vector3::from(SPACING_M) * 0.5;
    let (count, mut least_m) = (((to_m - from_m) / 2e-4).ceil(), f64::INFINITY);
    let mut step = 0.0;
    while step <= count {
        let at = ray.at(from_m + (to_m - from_m) * step / count);
        for centre in boxes {
            let beyond = ((at - centre).abs() - half).sup(&Vector3::zeros());
            least_m = least_m.min(beyond.norm());
        }
        step += 1.0;
    }
    least_m
}

fn is_obstacle(labels: &LabelMap, [i, j, k]: [usize; 3], obstacle: Obstacle) -> bool {
    let label = |i: usize| labels.labels[labels.grid.offset([i, j, k])];
    match obstacle {
        Obstacle::Bone => label(i) == BONE,
        Obstacle::Vessel => label(i) == VESSEL,
        Obstacle::Organ if label(i) == SOFT => {
            let sides = |lung: u16| {
                let all = (0..SIZE[0]).filter(move |&other| label(other) == lung);
                all.fold([false; 2], |sides, other| {
                    [sides[0] || other < i, sides[1] || other > i]
                })
            };
            // Between the lungs: nothing in this chest lies behind its spine and between them.
            sides(OTHER_LUNG) == [true, false] && sides(LUNG) == [false, true]
        }
        Obstacle::Organ => [HEART, OTHER_LUNG].contains(&label(i)),
    }
}

/// By how much a bound of a distance may be too small, m: near one thing, and in the middle between two.
///
/// The field interpolates squares of distances at the eight voxels around and takes `s^2 = sum w_i r_i^2` off, with `r_i` the
/// way to them; `s` is half a voxel's diagonal at most. To one box, `s^2` off the square is the most that is lost. As no
/// distance changes by more than the way, `d_i >= d - r_i`, `d^2 - 2 d s` is left whatever there is: that much is lost where
/// the voxels on either side have different things nearest, as between two ribs. Half a step, the error of the mask, and
/// the brute force's own steps come with both.
fn slacks_m(exact_m: f64) -> [f64; 2] {
    let s = 0.5 * Vector3::from(SPACING_M).norm();
    [s * s, 2.0 * exact_m * s].map(|lost_m2| {
        let left_m = (exact_m * exact_m - lost_m2).max(0.0).sqrt();
        exact_m - left_m + 0.125e-3 + 0.75e-3 + 0.1e-3
    })
}

#[test]
fn no_free_route_comes_nearer_to_any_voxel_than_it_says_and_no_refusal_is_far_off() {
    let labels = chest(false);
    let (anatomy, rules) = (anatomy(&labels, 2), rules());
    assert_eq!(anatomy.target_lung(), Some("lung_left"));
    let found = search(&anatomy, &rules, 2000, 2, &|| false);
    let boxes = Obstacle::ALL.map(|obstacle| boxes_of(&labels, obstacle));
    let (mut free, mut refused) = (0, 0);
    let (mut told, mut between) = (0, 0);
    for candidate in found.candidates.iter().step_by(17) {
        let ray = Ray {
            target: anatomy.target(),
            outwards: candidate.outwards,
        };
        match &candidate.outcome {
            Ok(route) => {
                free += 1;
                for obstacle in Obstacle::ALL {
                    let span = [-rules.throw_m, route.depth_m];
                    let exact_m =
                        brute_m(&boxes[obstacle as usize], &ray, span) - rules.needle_radius_m;
                    let told_m = route.distances_m[obstacle as usize];
                    assert!(told_m >= rules.margins_m[obstacle as usize]);
                    assert!(told_m <= exact_m, "{obstacle:?}: {told_m} for {exact_m}");
                    // Distances are told up to 20 mm.
                    let near_m = exact_m.min(0.02 - rules.needle_radius_m);
                    let [one_m, between_m] = slacks_m(near_m + rules.needle_radius_m);
                    let short_m = near_m - told_m;
                    assert!(short_m <= between_m, "{obstacle:?}: {told_m} for {exact_m}");
                    told += 1;
                    between += usize::from(short_m > one_m);
                }
            }
            Err(refusal) => {
                let obstacle = Obstacle::ALL
                    .into_iter()
                    .find(|&obstacle| RouteRule::of(obstacle) == refusal.rule);
                if let (Some(obstacle), Some(depth_m)) = (obstacle, candidate.depth_m) {
                    refused += 1;
                    let exact_m = brute_m(&boxes[obstacle as usize], &ray, [0.0, depth_m]);
                    assert!(refusal.value <= exact_m - rules.needle_radius_m);
                    assert!(exact_m - rules.needle_radius_m < refusal.limit + slacks_m(exact_m)[0]);
                }
            }
        }
    }
    assert!(free > 5 && refused > 5, "{free} {refused}");
    // Few lie so even between two things that the second counts.
    assert!(10 * between <= told, "{between} of {told}");
}

#[test]
fn depth_and_lungs_are_those_of_the_shapes() {
    let labels = chest(false);
    let anatomy = anatomy(&labels, 1);
    assert_eq!(anatomy.touches_pleura(), Some(false));
    // Square to the wall, to the patient's left.
    let ray = Ray {
        target: anatomy.target(),
        outwards: Vector3::x_axis(),
    };
    let skin_m = CENTRE[0] + 0.07 - TARGET[0];
    let needlebench_routing::Exit::Skin(depth_m) = anatomy.exit(&ray) else {
        panic!("no skin");
    };
    assert!(
        (depth_m - skin_m).abs() < SPACING_M[0],
        "{depth_m} {skin_m}"
    );
    let lungs = anatomy.lungs(&ray, [0.0, depth_m]);
    assert_eq!(lungs.entries, 1);
    assert!((lungs.within_m - 0.025).abs() < SPACING_M[0], "{lungs:?}");
    assert!(lungs.pleura_angle_rad.unwrap() < 0.1);
    assert!(anatomy.skin_normal(&ray, depth_m).dot(&Vector3::x_axis()) > 0.98);
    // Behind the target, the lung ends after another 25 mm.
    let left_m = anatomy.leaves_lung_m(&ray, 0.05).unwrap();
    assert!((left_m - 0.025).abs() < SPACING_M[0]);
    assert_eq!(anatomy.leaves_lung_m(&ray, 0.02), None);
    assert!(!anatomy.is_body_between(&ray, [depth_m, depth_m + 0.05]));
}

#[test]
fn what_lies_beside_the_body_is_in_the_way_and_no_skin() {
    let ray = Ray {
        target: Point3::from(TARGET),
        outwards: Vector3::x_axis(),
    };
    let skin_m = CENTRE[0] + 0.07;
    let bare = chest(false);
    let needlebench_routing::Exit::Skin(depth_m) = anatomy(&bare, 1).exit(&ray) else {
        panic!("no skin");
    };
    // From how far off the skin on, and how thick, m: on the skin it is one voxel thin.
    for (off_m, thick_m, name) in [
        (0.01, 0.01, "arms"),
        (0.0, SPACING_M[0], "couch"),
        (0.004, 0.003, "objects"),
    ] {
        let mut labels = chest(false);
        let slab_m = skin_m + off_m..skin_m + off_m + thick_m;
        let [nx, ny, nz] = labels.grid.size();
        for (k, j) in (0..nz).flat_map(|k| (0..ny).map(move |j| (k, j))) {
            for i in 0..nx {
                let place = Point3::new(i as f64, j as f64, k as f64);
                let at = labels.grid.ct_from_index(&place);
                let offset = labels.grid.offset([i, j, k]);
                if slab_m.contains(&at.x) && labels.labels[offset] == 0 {
                    labels.labels[offset] = 77;
                }
            }
        }
        labels.names.push((77, name.to_owned()));
        let anatomy = anatomy(&labels, 1);
        assert_eq!(anatomy.exit(&ray), needlebench_routing::Exit::Skin(depth_m));
        assert!(
            anatomy.is_body_between(&ray, [depth_m, depth_m + 0.05]),
            "{name}"
        );
        assert!(anatomy.skin_normal(&ray, depth_m).dot(&Vector3::x_axis()) > 0.98);
        if off_m > 0.0 {
            assert!(!anatomy.is_body_between(&ray, [depth_m, depth_m + off_m - 2e-3]));
        }
    }
}

#[test]
fn nothing_goes_through_a_marker_on_the_skin() {
    let labels = chest(false);
    let direction = Vector3::x_axis();
    let skin_m = CENTRE[0] + 0.07 - TARGET[0];
    let middle = Point3::from(TARGET) + direction.into_inner() * (skin_m + 3e-3);
    let with = |markers: &[(Point3<f64>, f64)]| {
        let options = VoxelOptions {
            lesions: &["nodule".to_owned()],
            needle_m: rules().longest_m,
            markers,
            outside_m: rules().outside_m,
            lung_vessel_m: 3e-3,
            below_rib_m: 0.0,
            beside_sternum_m: 0.0,
            ..usual()
        };
        let anatomy = VoxelAnatomy::new(&labels, Vector3::zeros(), Point3::from(TARGET), &options);
        search(&anatomy.unwrap(), &rules(), 4000, 1, &|| false)
    };
    let (free, kept) = (with(&[]), with(&[(middle, 4e-3)]));
    let mut refused = 0;
    for (before, after) in free.candidates.iter().zip(&kept.candidates) {
        let at = Point3::from(TARGET) + before.outwards.into_inner() * skin_m;
        let beside_m = (at - middle).norm();
        match &after.outcome {
            Err(refusal) if refusal.rule == RouteRule::Outside => {
                refused += 1;
                assert!(beside_m < 0.015, "{beside_m}");
            }
            // Within the marker's own radius nothing is left.
            _ => assert!(beside_m > 4e-3),
        }
    }
    assert!(refused > 5, "{refused}");
}

/// Two lungs, a vertebra between their backs, and soft tissue, in voxels of 2 mm.
fn two_lungs(names: &[(u16, &str)]) -> LabelMap {
    lungs_from(10, names)
}

/// The same with lungs from some row on; the skin is before row 2.
fn lungs_from(row: usize, names: &[(u16, &str)]) -> LabelMap {
    let size = [90, 70, 10];
    let grid = VoxelGrid::aligned(size, [2e-3; 3], Point3::origin()).unwrap();
    let mut labels = vec![0_u16; grid.len()];
    for k in 0..size[2] {
        for j in 2..68_usize {
            for i in 2..88_usize {
                let label = match (i, j) {
                    (10..30, _) if (row..50).contains(&j) => OTHER_LUNG,
                    (60..80, _) if (row..50).contains(&j) => LUNG,
                    (37..53, 35..48) => BONE,
                    _ => SOFT,
                };
                labels[grid.offset([i, j, k])] = label;
            }
        }
    }
    LabelMap {
        grid,
        labels,
        names: names
            .iter()
            .map(|(label, name)| (*label, (*name).to_owned()))
            .collect(),
    }
}

#[test]
fn what_lies_between_the_lungs_is_an_organ_but_not_the_muscles_of_the_back() {
    let names = [
        (SOFT, "soft_tissue"),
        (LUNG, "lung_left"),
        (OTHER_LUNG, "lung_right"),
        (BONE, "bone"),
    ];
    let at = |labels: &LabelMap, target: [f64; 3], off: &[String]| {
        let options = VoxelOptions { off, ..usual() };
        VoxelAnatomy::new(labels, Vector3::zeros(), Point3::from(target), &options).unwrap()
    };
    // Along x through the middle slice at some row, from the left lung's first columns to the right one's last.
    let across = |anatomy: &VoxelAnatomy, row: f64| {
        let ray = Ray {
            target: Point3::new(65.0 * 2e-3, row * 2e-3, 0.01),
            outwards: -Vector3::x_axis(),
        };
        let nearest = anatomy.nearest(&ray, [12.0 * 2e-3, 15.0 * 2e-3], Obstacle::Organ);
        nearest.map(|nearest| nearest.name)
    };
    let labels = two_lungs(&names);
    let in_lung = [65.0 * 2e-3, 30.0 * 2e-3, 0.01];
    let anatomy = at(&labels, in_lung, &[]);
    // Vessels below ribs are modelled: nobody has seen any.
    assert!(anatomy.knows(Obstacle::Organ) && !anatomy.knows(Obstacle::Vessel));
    for row in [12.0, 30.0, 41.0] {
        assert_eq!(across(&anatomy, row).as_deref(), Some("mediastinum"));
    }
    // The vertebra begins at row 35, 69 mm deep; the space ends 15 mm behind that. Rows 55 are behind both lungs, too.
    assert_eq!(across(&anatomy, 55.0), None);
    let off = ["mediastinum".to_owned()];
    assert_ne!(
        across(&at(&labels, in_lung, &off), 30.0).as_deref(),
        Some("mediastinum")
    );
    // A target in it has to be reached through it.
    let between = at(&labels, [45.0 * 2e-3, 20.0 * 2e-3, 0.01], &[]);
    assert_ne!(across(&between, 30.0).as_deref(), Some("mediastinum"));
    let said = |anatomy: &VoxelAnatomy, word: &str| {
        let mut remarks = anatomy.remarks().iter();
        remarks.any(|remark| remark.message.contains(word))
    };
    assert!(said(&between, "target is in the mediastinum"));
    assert!(said(&anatomy, "no heart, aorta, liver"));
    assert!(!said(&anatomy, "no bone"));
    // What has no name that means anything is said, not passed over.
    let odd = [
        (SOFT, "soft_tissue"),
        (LUNG, "lung_left"),
        (OTHER_LUNG, "gizmo"),
        (BONE, "structure_7"),
    ];
    let labels = two_lungs(&odd);
    let anatomy = at(&labels, in_lung, &[]);
    for word in ["`gizmo`, `structure_7`", "no bone", "has one lung"] {
        assert!(said(&anatomy, word), "{word}");
    }
    assert!(!anatomy.knows(Obstacle::Bone));
}

/// What an anatomy about a target in the left lung comes nearest to across a stretch of a row, beside a place.
fn nearest_across(
    labels: &LabelMap,
    [from, to]: [f64; 2],
    row: f64,
    obstacle: Obstacle,
) -> Option<Nearest> {
    let options = VoxelOptions {
        below_rib_m: 0.0,
        ..usual()
    };
    let in_lung = Point3::new(65.0 * 2e-3, 30.0 * 2e-3, 0.01);
    let anatomy = VoxelAnatomy::new(labels, Vector3::zeros(), in_lung, &options).unwrap();
    let ray = Ray {
        target: Point3::new(65.0 * 2e-3, row * 2e-3, 0.01),
        outwards: -Vector3::x_axis(),
    };
    let stretch_m = [65.0 - from, 65.0 - to].map(|columns| columns * 2e-3);
    anatomy.nearest(&ray, stretch_m, obstacle)
}

#[test]
fn where_one_lung_is_absent_its_half_of_the_chest_is_no_way() {
    // Named, as in every map of `ct build`, and nowhere.
    let names = [
        (SOFT, "soft_tissue"),
        (LUNG, "lung_left"),
        (OTHER_LUNG, "other_tissue"),
        (BONE, "bone"),
        (VESSEL, "lung_right"),
    ];
    let labels = two_lungs(&names);
    for columns in [[50.0, 47.0], [25.0, 20.0]] {
        let found = nearest_across(&labels, columns, 30.0, Obstacle::Organ);
        let name = found.map(|nearest| nearest.name);
        assert_eq!(name.as_deref(), Some("mediastinum"), "{columns:?}");
    }
}

#[test]
fn beside_the_sternum_are_vessels_that_no_scan_shows() {
    let names = [
        (SOFT, "soft_tissue"),
        (LUNG, "lung_left"),
        (OTHER_LUNG, "lung_right"),
        (BONE, "bone"),
        (HEART, "costal_cartilages"),
    ];
    let mut labels = two_lungs(&names);
    let grid = labels.grid.clone();
    for (k, j) in (0..10).flat_map(|k| (4..8).map(move |j| (k, j))) {
        for i in 40..50 {
            labels.labels[grid.offset([i, j, k])] = BONE;
        }
        // Cartilage goes on from there, and is not the sternum's edge.
        for i in 50..58 {
            labels.labels[grid.offset([i, j, k])] = HEART;
        }
    }
    let distance_mm = |columns: [f64; 2]| {
        let found = nearest_across(&labels, columns, 8.5, Obstacle::Vessel).unwrap();
        assert_eq!(found.name, "internal mammary vessels (modelled)");
        1e3 * found.distance_m
    };
    // From 5 to 20 mm beside both edges, in the three rows in front of lungs and mediastinum, which begin at row 10.
    for columns in [[57.0, 55.0], [35.0, 33.0]] {
        assert!(distance_mm(columns) <= 0.0, "{columns:?}");
    }
    // 10 mm from the last of its columns, less what half a voxel may be wrong.
    let beyond_mm = distance_mm([67.0, 65.0]);
    assert!((6.0..=10.0).contains(&beyond_mm), "{beyond_mm}");
    let at_midline_mm = distance_mm([46.0, 44.0]);
    assert!((4.0..=12.0).contains(&at_midline_mm), "{at_midline_mm}");
    // Where it is narrow they run straight on.
    for (k, j) in (4..7).flat_map(|k| (4..8).map(move |j| (k, j))) {
        for i in (40..44).chain(46..58) {
            labels.labels[grid.offset([i, j, k])] = SOFT;
        }
    }
    for columns in [[60.0, 58.0], [32.0, 30.0]] {
        let found = nearest_across(&labels, columns, 8.5, Obstacle::Vessel).unwrap();
        assert!(found.distance_m <= 0.0, "{columns:?}");
    }
}

#[test]
fn what_lies_between_the_lungs_is_no_way_out_of_the_body() {
    // From row 4 on: in the same block of voxels as the air before row 2.
    let labels = lungs_from(
        4,
        &[
            (SOFT, "soft_tissue"),
            (LUNG, "lung_left"),
            (OTHER_LUNG, "lung_right"),
            (BONE, "bone"),
        ],
    );
    let options = usual();
    let in_lung = Point3::new(65.0 * 2e-3, 30.0 * 2e-3, 0.01);
    let anatomy = VoxelAnatomy::new(&labels, Vector3::zeros(), in_lung, &options).unwrap();
    let ray = Ray {
        target: Point3::new(45.0 * 2e-3, 20.0 * 2e-3, 0.01),
        outwards: -Vector3::y_axis(),
    };
    let organ = anatomy.nearest(&ray, [0.0, 0.03], Obstacle::Organ);
    assert_eq!(organ.unwrap().name, "mediastinum");
    let (Exit::Skin(skin_m) | Exit::End(skin_m)) = anatomy.exit(&ray) else {
        panic!("the ray leaves the body");
    };
    // Between the middles of rows 1 and 2.
    assert!((skin_m - 18.5 * 2e-3).abs() < 1e-9, "{skin_m}");
    assert!(anatomy.is_body_between(&ray, [0.0245, 0.030]));
}

#[test]
fn lobes_make_a_fissure() {
    let labels = chest(true);
    let anatomy = anatomy(&labels, 1);
    let found = search(&anatomy, &rules(), 3000, 1, &|| false);
    let refused: Vec<_> = found
        .candidates
        .iter()
        .filter(|each| {
            each.outcome
                .as_ref()
                .is_err_and(|refusal| refusal.rule == RouteRule::Fissure)
        })
        .collect();
    assert!(!refused.is_empty());
    let may = RouteRules {
        cross_fissures: true,
        ..rules()
    };
    for candidate in refused {
        if let Ok(route) = needlebench_routing::judge(&anatomy, &may, &candidate.outwards).outcome {
            let term = |name| {
                route
                    .risk
                    .terms
                    .iter()
                    .find(|term| term.term == name)
                    .unwrap()
            };
            assert!((term("fissure").log_odds - libm::log(3.75_f64)).abs() < 1e-12);
            assert!(!route.lungs.fissures.is_empty(), "{:?}", route.lungs);
        }
    }
}

#[test]
fn threads_change_nothing_and_stopping_leaves_out() {
    let labels = chest(false);
    let one = search(&anatomy(&labels, 1), &rules(), 500, 1, &|| false);
    let three = search(&anatomy(&labels, 3), &rules(), 500, 3, &|| false);
    assert_eq!(one, three);
    assert!(
        search(&anatomy(&labels, 1), &rules(), 500, 2, &|| true)
            .candidates
            .is_empty()
    );
}

#[test]
fn refinement_never_makes_a_route_worse() {
    let labels = chest(false);
    let (anatomy, rules) = (anatomy(&labels, 1), rules());
    let found = search(&anatomy, &rules, 1000, 1, &|| false);
    let free = found.free();
    let mut better = 0;
    for route in free.iter().step_by(5) {
        let refined = refined(&anatomy, &rules, route, [0.03, 0.004], Route::better_first);
        assert!(refined.better_first(route).is_le());
        better += usize::from(refined.better_first(route).is_lt());
    }
    assert!(better > 0);
}

#[test]
fn targets_outside_are_refused() {
    let labels = chest(false);
    let options = VoxelOptions {
        needle_m: 0.1,
        ..usual()
    };
    for (target, words) in [
        (Point3::new(-0.089, -0.069, 0.09), "outside the body"),
        (Point3::new(1.0, 0.0, 0.09), "outside the scan"),
        (Point3::new(f64::NAN, 0.0, 0.09), "outside the scan"),
    ] {
        let error = VoxelAnatomy::new(&labels, Vector3::zeros(), target, &options).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn directions_are_even_apart_and_turn_back() {
    let all: Vec<UnitVector3<f64>> = evenly(4000).collect();
    let mean: Vector3<f64> = all.iter().map(|each| each.into_inner()).sum();
    assert!(mean.norm() < 2.0, "{mean}");
    for each in all.iter().step_by(97) {
        let back = needlebench_routing::outwards(needlebench_routing::angles_rad(each));
        assert!((back.into_inner() - each.into_inner()).norm() < 1e-12);
    }
    let picked = apart(&all, |each| *each, 0.1, 300);
    assert!((100..=300).contains(&picked.len()));
    assert_eq!(picked[0], 0);
    for (n, &a) in picked.iter().enumerate() {
        for &b in &picked[..n] {
            assert!(all[a].angle(&all[b]) > 0.1);
        }
    }
}

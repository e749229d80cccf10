//! The solids of a phantom as anatomy.

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_geometry::mesh::SurfaceIndex;
use needlebench_kinematics::Pose;
use needlebench_phantom::{LayersError, PassedLayer, Phantom, PhantomPart, RouteObstacle, Tissue};
use needlebench_scenario::scenario::NeedleRouteSection;

use crate::anatomy::{
    Anatomy, Exit, LungPassage, Nearest, Obstacle, Ray, angle_rad, is_marker_near,
};

/// Part of the skin's normal along the body beyond which the skin is that of an end of the chest: neck, shoulders or
/// waist begin there, which a phantom does not have (assumed: 45 deg).
const END_Z: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Highest entry of a shipped chest, as a share of its half length: the second rib space is at 0.42 in front (README of
/// the phantoms), and above it clavicles and subclavian vessels, which they do not have, would be in the way (assumed).
const HIGHEST: f64 = 0.5;

/// Farthest that curved surfaces of lungs are from their triangles, m: well below a voxel of any scan.
const LUNG_SURFACE_M: f64 = 1e-4;

/// How near a lesion comes to the lung's surface to touch the pleura, m (assumed: what a scan would not part).
const TOUCHES_M: f64 = 1e-3;

/// A phantom's bones, vessels, organs, fissures and lungs as solids, with exact distances.
#[derive(Debug)]
pub struct SolidAnatomy<'a> {
    phantom: &'a Phantom,
    target: Point3<f64>,
    /// For each route obstacle what it counts as; none for what the needle may pass.
    counts: Vec<Option<Obstacle>>,
    lungs: Vec<Lung>,
    /// Bullae, which are organs by name.
    bullae: Vec<Hollow>,
    /// Radius of the lesion around the target, m.
    lesion_radius_m: f64,
    /// What lies beside the body.
    beside: Vec<Hollow>,
    highest_m: f64,
    /// Middle and radius, m.
    markers: Vec<(Point3<f64>, f64)>,
}

#[derive(Debug)]
struct Hollow {
    name: String,
    pose: Pose,
    surface: SurfaceIndex,
}

#[derive(Debug)]
struct Lung {
    inside: Hollow,
    /// The target is in it.
    is_targets: bool,
}

impl Hollow {
    fn of(part: &PhantomPart) -> Self {
        Self {
            name: part.name.clone(),
            pose: part.solid.parent_from_shape,
            surface: SurfaceIndex::new(part.solid.shape.surface(LUNG_SURFACE_M)),
        }
    }

    /// Stretches of a ray within it, from the target outwards, m.
    fn stretches_m(&self, ray: &Ray) -> Vec<(f64, f64)> {
        let local = self.pose.inverse();
        let direction = local.rotation * ray.outwards.into_inner();
        self.surface.clip_line(
            &(local * ray.target),
            &UnitVector3::new_normalize(direction),
        )
    }
}

fn is_called(part: &PhantomPart, word: &str) -> bool {
    part.name.contains(word)
        || part
            .organ
            .as_ref()
            .is_some_and(|organ| organ.contains(word))
}

impl<'a> SolidAnatomy<'a> {
    /// About a target (phantom frame) of a phantom, as a scenario's `[planning.needle_route]` has it. As in a run, the
    /// needle may enter the organ that holds the target, and the bone whose lesion it is aimed at.
    pub fn new(
        phantom: &'a Phantom,
        target: Point3<f64>,
        aims_at_lesion: bool,
        section: &NeedleRouteSection,
    ) -> Self {
        let organ = phantom.organ_at(&target);
        let mut entered: Vec<&str> = organ.as_deref().into_iter().collect();
        if aims_at_lesion {
            let bones = phantom.parts.iter();
            let bones = bones.filter(|part| part.tissue == Tissue::Bone);
            let holding = bones.filter(|part| part.solid.contains(&target));
            entered.extend(holding.map(|part| part.organ.as_deref().unwrap_or(&part.name)));
        }
        let counts = |part: &RouteObstacle| {
            let organ = part.organ.as_deref().unwrap_or(&part.name);
            let is_off = section.off.iter().any(|name| part.is_called(name));
            let obstacle = match part.tissue {
                Tissue::Bone => Obstacle::Bone,
                Tissue::Vessel => Obstacle::Vessel,
                Tissue::Organ if !part.name.contains("bulla") => Obstacle::Organ,
                _ => return None,
            };
            (!is_off && !entered.contains(&organ)).then_some(obstacle)
        };
        let organs = || {
            phantom
                .parts
                .iter()
                .filter(|part| part.tissue == Tissue::Organ)
        };
        let lungs = organs().filter(|part| is_called(part, "lung") && !is_called(part, "bulla"));
        let size = phantom.parameters.as_ref();
        let marker_radius_m = size.map_or(0.0, |size| 0.5e-3 * size.marker_diameter_mm);
        let lesion = phantom
            .lesions
            .iter()
            .find(|lesion| (target - lesion.center_m).norm() <= 0.5 * lesion.diameter_m);
        Self {
            phantom,
            target,
            counts: phantom.route_obstacles().parts.iter().map(counts).collect(),
            lungs: lungs
                .map(|part| Lung {
                    is_targets: organ.is_some() && part.organ == organ,
                    inside: Hollow::of(part),
                })
                .collect(),
            bullae: organs()
                .filter(|part| is_called(part, "bulla"))
                .map(Hollow::of)
                .collect(),
            lesion_radius_m: lesion.map_or(0.0, |lesion| 0.5 * lesion.diameter_m),
            beside: phantom.beside.iter().map(Hollow::of).collect(),
            highest_m: size.map_or(f64::INFINITY, |size| HIGHEST * 0.5e-3 * size.length_mm),
            markers: phantom
                .markers
                .iter()
                .map(|marker| (marker.center_m, marker_radius_m))
                .collect(),
        }
    }

    fn nearest_of(
        &self,
        ray: &Ray,
        [from_m, to_m]: [f64; 2],
        wanted: impl Fn(usize) -> bool,
    ) -> Option<(usize, f64)> {
        let (index, separation) = self.phantom.route_obstacles().solids.nearest_to_segment(
            &ray.at(to_m),
            &ray.at(from_m),
            0.0,
            &Pose::identity(),
            wanted,
        )?;
        Some((index, separation.distance_m - ROUNDING_M))
    }
}

/// What rounding may add to a distance, m: the same that runs take off.
const ROUNDING_M: f64 = 1e-9;

impl Anatomy for SolidAnatomy<'_> {
    fn kind(&self) -> &'static str {
        "solids"
    }

    fn target(&self) -> Point3<f64> {
        self.target
    }

    fn exit(&self, ray: &Ray) -> Exit {
        if !self.phantom.skin_contains(&ray.target) {
            return Exit::Nowhere;
        }
        let Some((_, depth_m)) = self.phantom.skin_intersection(&ray.target, &ray.outwards) else {
            return Exit::Nowhere;
        };
        let entry = ray.at(depth_m);
        let normal = self.phantom.skin_normal(&entry);
        let is_end = normal.z.abs() > END_Z
            || entry.z > self.highest_m
            || !self.phantom.is_skin_seen(&entry);
        if is_end {
            Exit::End(depth_m)
        } else {
            Exit::Skin(depth_m)
        }
    }

    fn knows(&self, obstacle: Obstacle) -> bool {
        self.counts.contains(&Some(obstacle))
    }

    fn is_body_between(&self, ray: &Ray, [from_m, to_m]: [f64; 2]) -> bool {
        if is_marker_near(&self.markers, ray, [from_m, to_m]) {
            return true;
        }
        // Half a micrometre off the skin that it leaves.
        let outside = ray.at(from_m + 5e-7);
        let again = self.phantom.skin_intersection(&outside, &ray.outwards);
        let again = again
            .into_iter()
            .map(|(enters, leaves)| (enters + from_m, leaves + from_m));
        let beside = self.beside.iter().flat_map(|it| it.stretches_m(ray));
        let mut in_the_way = again.chain(beside);
        in_the_way.any(|(enters_m, leaves_m)| leaves_m > from_m && enters_m < to_m)
    }

    fn distance_m(&self, ray: &Ray, from_to_m: [f64; 2], obstacle: Obstacle) -> f64 {
        self.nearest_of(ray, from_to_m, |index| self.counts[index] == Some(obstacle))
            .map_or(f64::INFINITY, |(_, distance_m)| distance_m)
    }

    fn nearest(&self, ray: &Ray, from_to_m: [f64; 2], obstacle: Obstacle) -> Option<Nearest> {
        let counts = |index: usize| self.counts[index] == Some(obstacle);
        let (index, distance_m) = self.nearest_of(ray, from_to_m, counts)?;
        Some(Nearest {
            name: self.phantom.route_obstacles().parts[index].name.clone(),
            distance_m,
        })
    }

    fn skin_normal(&self, ray: &Ray, depth_m: f64) -> UnitVector3<f64> {
        self.phantom.skin_normal(&ray.at(depth_m))
    }

    fn lungs(&self, ray: &Ray, [from_m, to_m]: [f64; 2]) -> LungPassage {
        let mut passage = LungPassage::default();
        let mut outermost_m = f64::NEG_INFINITY;
        for lung in &self.lungs {
            for (near_m, far_m) in lung.inside.stretches_m(ray) {
                if far_m <= from_m || near_m >= to_m {
                    continue;
                }
                passage.entries += 1;
                passage.within_m += far_m.min(to_m) - near_m.max(from_m);
                if far_m > outermost_m {
                    outermost_m = far_m;
                    let pleura = ray.at(far_m);
                    let normal = pleura_normal(&lung.inside, &pleura);
                    passage.pleura_angle_rad = Some(angle_rad(&ray.outwards, &normal));
                }
            }
        }
        let parts = &self.phantom.route_obstacles().parts;
        for (index, part) in parts.iter().enumerate() {
            let crossed = || self.nearest_of(ray, [from_m, to_m], |each| each == index);
            if part.tissue == Tissue::Fissure && crossed().is_some_and(|(_, m)| m <= 0.0) {
                passage.fissures.push(part.name.clone());
            }
        }
        for bulla in &self.bullae {
            let mut stretches = bulla.stretches_m(ray).into_iter();
            if stretches.any(|(near_m, far_m)| far_m > from_m && near_m < to_m) {
                passage.bullae.push(bulla.name.clone());
            }
        }
        passage
    }

    fn layers(&self, ray: &Ray, [from_m, to_m]: [f64; 2]) -> Result<Vec<PassedLayer>, LayersError> {
        self.phantom.layers(&ray.at(to_m), &ray.at(from_m))
    }

    fn leaves_lung_m(&self, ray: &Ray, within_m: f64) -> Option<f64> {
        let lung = self.lungs.iter().find(|lung| lung.is_targets)?;
        let mut stretches = lung.inside.stretches_m(ray).into_iter();
        // Of a lesion that touches the wall, the target itself may be outside.
        let (near_m, _) = stretches.find(|(near_m, far_m)| *near_m <= 0.0 && *far_m >= 0.0)?;
        (-near_m < within_m).then_some(-near_m)
    }

    fn touches_pleura(&self) -> Option<bool> {
        let lung = self.lungs.iter().find(|lung| lung.is_targets)?;
        let local = lung.inside.pose.inverse() * self.target;
        let from_wall_m = lung.inside.surface.distance_m(&local);
        Some(from_wall_m - self.lesion_radius_m <= TOUCHES_M)
    }
}

/// Normal of a lung's surface at a point of it: across the nearest points of two places beside it.
fn pleura_normal(lung: &Hollow, at: &Point3<f64>) -> Vector3<f64> {
    const ASIDE_M: f64 = 2e-3;
    let local = lung.pose.inverse() * at;
    // The gradient of the signed distance.
    let slope = |axis: usize| {
        let mut step = Vector3::zeros();
        step[axis] = ASIDE_M;
        lung.surface.signed_distance_m(&(local + step))
            - lung.surface.signed_distance_m(&(local - step))
    };
    let gradient = Vector3::new(slope(0), slope(1), slope(2));
    lung.pose * gradient
}

//! The anatomy along a needle path.

use nalgebra::{Point3, UnitVector3, Vector3};
use needlebench_phantom::{LayersError, PassedLayer};

/// An obstacle of a needle path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Obstacle {
    /// Bone, whatever it is of.
    Bone,
    /// Arteries and veins, seen or modelled.
    Vessel,
    /// Organs other than the target's, the airways, and gas that is neither lung nor airway.
    Organ,
}

impl Obstacle {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Bone, Self::Vessel, Self::Organ];

    /// Name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bone => "bone",
            Self::Vessel => "vessel",
            Self::Organ => "organ",
        }
    }
}

/// A needle's line: from its target out of the body. Frame `phantom`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where the needle is to end.
    pub target: Point3<f64>,
    /// From the target to the entry.
    pub outwards: UnitVector3<f64>,
}

impl Ray {
    /// The place so far from the target, m; those behind the target are negative.
    pub fn at(&self, along_m: f64) -> Point3<f64> {
        self.target + along_m * self.outwards.into_inner()
    }
}

/// Where a ray leaves the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Exit {
    /// Through the skin, so far from the target, m.
    Skin(f64),
    /// Through an end of what is known of the body, m: the skin is not known there.
    End(f64),
    /// The target is not in the body.
    Nowhere,
}

/// What of a kind of obstacle a needle comes nearest to.
#[derive(Debug, Clone, PartialEq)]
pub struct Nearest {
    /// What it is.
    pub name: String,
    /// Lower bound of the distance from the needle's axis, m; below 0 within it, as far as that is known.
    pub distance_m: f64,
}

/// The lungs along a needle path.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LungPassage {
    /// Number of pleural crossings into a lung, from the skin to the target.
    pub entries: u32,
    /// How much of it is in a lung, m.
    pub within_m: f64,
    /// Angle between the needle and the pleura's normal where it first enters, rad.
    pub pleura_angle_rad: Option<f64>,
    /// Fissures that it crosses, by name.
    pub fissures: Vec<String>,
    /// Bullae that it crosses, by name.
    pub bullae: Vec<String>,
}

/// The surroundings of a target.
pub trait Anatomy: Sync {
    /// What it is made of: `voxels` or `solids`.
    fn kind(&self) -> &'static str;

    /// The target.
    fn target(&self) -> Point3<f64>;

    /// Where a ray leaves the body for the first time.
    fn exit(&self, ray: &Ray) -> Exit;

    /// Whether body, a marker or what lies beside the body is in the way outside the skin, between two distances from
    /// the target, m: an arm, a fold, the couch.
    fn is_body_between(&self, ray: &Ray, from_to_m: [f64; 2]) -> bool;

    /// Whether the patient model has any structure of this kind: otherwise its distances are unknown.
    fn knows(&self, obstacle: Obstacle) -> bool;

    /// Lower bound of the distance of a stretch of a ray from an obstacle, m; infinite if there is none of it. Distances
    /// beyond what can matter are told as some that is less.
    fn distance_m(&self, ray: &Ray, from_to_m: [f64; 2], obstacle: Obstacle) -> f64;

    /// The same with its name; none if there is nothing of it near.
    fn nearest(&self, ray: &Ray, from_to_m: [f64; 2], obstacle: Obstacle) -> Option<Nearest>;

    /// Outward normal of the skin where a ray leaves it, so far from the target.
    fn skin_normal(&self, ray: &Ray, depth_m: f64) -> UnitVector3<f64>;

    /// The lungs on the way between two distances from the target, m.
    fn lungs(&self, ray: &Ray, from_to_m: [f64; 2]) -> LungPassage;

    /// The tissues of a needle on a ray between two distances from the target, m, the outermost first.
    ///
    /// # Errors
    /// [`LayersError::Bone`].
    fn layers(&self, ray: &Ray, from_to_m: [f64; 2]) -> Result<Vec<PassedLayer>, LayersError>;

    /// How far behind the target the lung that it is in is left, m, if that is nearer than `within_m`; none where the
    /// target is in no lung.
    fn leaves_lung_m(&self, ray: &Ray, within_m: f64) -> Option<f64>;

    /// Whether the target's lesion touches the pleura; none where it is in no lung.
    fn touches_pleura(&self) -> Option<bool>;
}

/// What needle and guide take beside their axis where a marker is, m (assumed: half of a slim guide).
const BESIDE_M: f64 = 5e-3;

/// Whether a ray passes over a marker on the skin.
pub(crate) fn is_marker_near(
    markers: &[(Point3<f64>, f64)],
    ray: &Ray,
    [from_m, to_m]: [f64; 2],
) -> bool {
    markers.iter().any(|(middle, radius_m)| {
        let reach_m = radius_m + BESIDE_M;
        let along_m = (middle - ray.target).dot(&ray.outwards);
        // Middles lie a little under or over the skin, by the marker's height.
        let along_m = along_m.clamp(from_m - reach_m, to_m);
        (middle - ray.at(along_m)).norm() < reach_m
    })
}

/// Angle between a direction and a normal, whatever its sign, rad.
pub(crate) fn angle_rad(direction: &UnitVector3<f64>, normal: &Vector3<f64>) -> f64 {
    let along = direction.dot(normal).abs();
    libm::atan2(direction.cross(normal).norm(), along)
}

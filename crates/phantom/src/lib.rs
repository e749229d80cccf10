//! A parametric chest phantom made of convex solids.
//!
//! Frame `phantom`: anatomical LPS. +x to the patient's left, +y posterior, +z towards the head;
//! origin in the mid-sagittal plane, at half depth and half length. Metres.
//!
//! The same parameters always give the same phantom, bit for bit. The sources of the numbers are
//! in `models/chest_phantom/README.md`.
#![cfg_attr(any(doc, doctest), doc = include_str!("../README.md"))]

mod envelope;
mod error;
mod half_spaces;
mod layers;
mod limbs;
mod loft;
mod markers;
mod organs;
mod parameters;
mod ribs;
mod route_obstacles;
mod scan_ends;
mod scapula;
mod skeleton;
mod skin;
mod solids;

#[cfg(test)]
mod tests;

use std::fmt;

use nalgebra::{Point3, UnitVector3};
use needlebench_geometry::Solid;
use serde::{Deserialize, Serialize};

pub use error::PhantomError;
pub use parameters::PARAMETERS;
pub use parameters::{
    Arms, ChestSize, LesionParameters, LimbSizes, MarkerKind, MarkerParameters, Measured,
    PhantomParameters,
};
pub use route_obstacles::{RouteObstacle, RouteObstacles};

use envelope::Envelope;
pub use half_spaces::HalfSpaces;
pub use layers::{LayersError, Passed, PassedLayer};
pub use limbs::{Support, limbs};
pub use scan_ends::ScanEnd;
use scan_ends::ScanEnds;
pub use skin::SkinSurface;

/// Colour of the skin.
pub const SKIN_RGBA: [f32; 4] = [0.90, 0.72, 0.60, 0.35];
/// Colour of lesions.
pub const LESION_RGBA: [f32; 4] = [0.95, 0.80, 0.10, 1.0];

/// Names of the shipped sizes.
pub const SIZE_PRESETS: [&str; parameters::PRESETS.len()] = {
    let mut names = [""; parameters::PRESETS.len()];
    let mut k = 0;
    while k < names.len() {
        names[k] = parameters::PRESETS[k].0;
        k += 1;
    }
    names
};

/// What a part of the phantom is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Tissue {
    /// The outer surface.
    Skin,
    /// Ribs with their cartilages, sternum, spine, shoulder blades.
    Bone,
    /// Arteries and veins.
    Vessel,
    /// Lungs, airways, heart, liver.
    Organ,
    /// A cleft between two lobes of a lung: no obstacle, but what is said of a needle that crosses it.
    Fissure,
    /// A target.
    Lesion,
    /// A registration marker on the skin.
    Marker,
    /// Beside the body in the scan that it is from: an arm, the couch.
    Beside,
    /// Body that no scan shows and that is assumed behind a cut.
    Assumed,
}

impl fmt::Display for Tissue {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(match self {
            Self::Skin => "skin",
            Self::Bone => "bone",
            Self::Vessel => "vessel",
            Self::Organ => "organ",
            Self::Fissure => "fissure",
            Self::Lesion => "lesion",
            Self::Marker => "marker",
            Self::Beside => "beside",
            Self::Assumed => "assumed",
        })
    }
}

/// One convex piece of the phantom.
#[derive(Debug, Clone, PartialEq)]
pub struct PhantomPart {
    /// Unique within the phantom; the same as the solid's name.
    pub name: String,
    /// What the piece is made of.
    pub tissue: Tissue,
    /// Groups the pieces of one structure, e.g. `rib_left_4`, `spine`, `lung_right`; for a lesion,
    /// the organ around it. `None` for the skin.
    pub organ: Option<String>,
    /// The solid, in the phantom frame.
    pub solid: Solid,
    /// Red, green, blue, opacity, each 0 to 1 (sRGB).
    pub color_rgba: [f32; 4],
}

/// A spherical target.
#[derive(Debug, Clone, PartialEq)]
pub struct Lesion {
    /// Unique among the lesions. The part is named `lesion_` and this.
    pub name: String,
    /// Centre, phantom frame.
    pub center_m: Point3<f64>,
    /// Diameter, m.
    pub diameter_m: f64,
    /// The organ that contains the whole lesion, if one does.
    pub organ: Option<String>,
}

/// A registration marker on the skin.
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// Unique among the markers; also the name of the white disc's part.
    pub name: String,
    /// Centre of the disc's outer face, where black and white quadrants meet; phantom frame.
    pub center_m: Point3<f64>,
    /// Outward normal of the disc and of the skin under it, phantom frame.
    pub normal: UnitVector3<f64>,
    /// What CT sees of it, if it does: the part `NAME.sphere`.
    pub sphere: Option<MarkerSphere>,
}

/// A dense ball in a marker, between its disc and the skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarkerSphere {
    /// Centre, phantom frame: on the disc's axis.
    pub center_m: Point3<f64>,
    /// Diameter, m.
    pub diameter_m: f64,
}

/// The chest phantom.
#[derive(Debug, Clone, PartialEq)]
pub struct Phantom {
    /// What the shipped part of it was built from; `None` if all parts are the user's.
    pub parameters: Option<PhantomParameters>,
    /// All pieces. The skin is the first; it encloses all others but the markers.
    pub parts: Vec<PhantomPart>,
    /// Targets, in the order of the parameters.
    pub lesions: Vec<Lesion>,
    /// Skin markers, in the order of the parameters.
    pub markers: Vec<Marker>,
    /// What lies beside the body in the scan that it is from, arms and the couch, and what is assumed of the body
    /// behind the scan's cuts. Carried along with it.
    pub beside: Vec<PhantomPart>,
    skin_surface: SkinSurface,
    /// Where a scan ends that the parts are from; none if it ends nowhere.
    scan_ends: Option<ScanEnds>,
    route_obstacles: route_obstacles::OnDemand,
}

impl Phantom {
    /// Parameters of a shipped size: one of [`SIZE_PRESETS`].
    pub fn size_preset(name: &str) -> Result<PhantomParameters, PhantomError> {
        PhantomParameters::preset(name)
    }

    /// Builds the phantom, and checks that every part but the markers is inside the skin.
    pub fn build(parameters: &PhantomParameters) -> Result<Self, PhantomError> {
        parameters.validate()?;
        let envelope = Envelope::new(parameters)?;
        let frame = envelope.frame();
        let skin = PhantomPart {
            name: "skin".to_owned(),
            tissue: Tissue::Skin,
            organ: None,
            solid: solids::convex(
                "skin".to_owned(),
                envelope.skin_mesh(),
                needlebench_kinematics::Pose::identity(),
            ),
            color_rgba: SKIN_RGBA,
        };
        let skin_faces = HalfSpaces::of(&skin.solid).expect("the skin is a convex mesh");

        let mut inner = skeleton::skeleton(parameters, &envelope, &frame);
        inner.extend(ribs::ribs(parameters, &envelope, &frame));
        inner.extend(scapula::scapulae(parameters, &envelope, &frame));
        inner.extend(organs::organs(parameters, &envelope, &frame));
        for part in &inner {
            let depth_m = skin_faces.depth_of_solid_m(&part.solid);
            if depth_m < 0.0 {
                return Err(PhantomError::PartOutsideSkin {
                    part: part.name.clone(),
                    by_mm: -1e3 * depth_m,
                });
            }
        }

        let mut lesions = Vec::with_capacity(parameters.lesions.len());
        for wanted in &parameters.lesions {
            let (lesion, part) = lesion(wanted, &skin_faces, &inner)?;
            lesions.push(lesion);
            inner.push(part);
        }
        let mut parts = vec![skin];
        parts.extend(inner);
        let mut markers = Vec::with_capacity(parameters.markers.len());
        for placement in &parameters.markers {
            let (marker, marker_parts) = markers::marker(placement, parameters, &skin_faces)?;
            markers.push(marker);
            parts.extend(marker_parts);
        }
        Ok(Self {
            parameters: Some(parameters.clone()),
            parts,
            lesions,
            markers,
            beside: Vec::new(),
            skin_surface: SkinSurface::Convex(skin_faces),
            scan_ends: None,
            route_obstacles: route_obstacles::OnDemand::default(),
        })
    }

    /// Of these parts, the first of which is the skin with this surface.
    pub fn of_parts(
        parameters: Option<PhantomParameters>,
        parts: Vec<PhantomPart>,
        lesions: Vec<Lesion>,
        markers: Vec<Marker>,
        skin_surface: SkinSurface,
    ) -> Self {
        Self {
            parameters,
            parts,
            lesions,
            markers,
            beside: Vec::new(),
            skin_surface,
            scan_ends: None,
            route_obstacles: route_obstacles::OnDemand::default(),
        }
    }

    /// The same, with these beside the body.
    #[must_use]
    pub fn with_beside(self, beside: Vec<PhantomPart>) -> Self {
        Self { beside, ..self }
    }

    /// The same, of a scan with these ends.
    #[must_use]
    pub fn with_scan_ends(self, ends: Vec<ScanEnd>) -> Self {
        Self {
            scan_ends: Some(ScanEnds::new(ends)),
            ..self
        }
    }

    /// Whether a point of the skin (phantom frame) is skin, and not where a scan cuts the body.
    pub fn is_skin_seen(&self, point: &Point3<f64>) -> bool {
        let ends = self.scan_ends.as_ref();
        ends.is_none_or(|ends| ends.is_seen(point))
    }

    /// Where the body may go on behind the cuts of a scan (phantom frame); empty where nothing is cut: of each cut and each
    /// connected piece of the skin beyond its plane, the convex hull of the piece and of what lies straight behind it,
    /// 3 m far. That the body is no wider there than the piece is assumed. A piece is known to go on as something else
    /// where its corners (phantom frame) are in what is modelled, such as the arms. Behind a cut where parts of
    /// [`Tissue::Assumed`] stand for the body, it goes on from these, and from as far behind the cut as they reach.
    pub fn unseen_body(&self, is_modelled: impl Fn(&Point3<f64>) -> bool) -> Vec<Solid> {
        let Some(ends) = &self.scan_ends else {
            return Vec::new();
        };
        let assumed = self.beside.iter();
        let assumed = assumed.filter(|part| part.tissue == Tissue::Assumed);
        let assumed: Vec<&Solid> = assumed.map(|part| &part.solid).collect();
        ends.unseen_body(self.skin(), &assumed, is_modelled)
    }

    /// Whether a scan that the parts are from ends at any plane.
    pub fn has_scan_ends(&self) -> bool {
        self.scan_ends.is_some()
    }

    /// Bones, vessels, organs and fissures, ready for distances; prepared once.
    pub fn route_obstacles(&self) -> &RouteObstacles {
        self.route_obstacles.of(&self.parts)
    }

    /// The bones that a place (phantom frame, m) is in, by the structures that they belong to, else by their own names.
    pub fn bones_at(&self, place: &Point3<f64>) -> impl Iterator<Item = &str> {
        let obstacles = self.route_obstacles();
        let parts = obstacles.parts.iter().enumerate();
        let around = parts.filter(move |(index, part)| {
            part.tissue == Tissue::Bone && obstacles.solids.contains(*index, place)
        });
        around.map(|(_, part)| part.organ.as_deref().unwrap_or(&part.name))
    }

    /// The organ that contains a point (phantom frame): that of the lesion around it, else the one whose solid holds it.
    pub fn organ_at(&self, point: &Point3<f64>) -> Option<String> {
        self.lesions
            .iter()
            .filter(|lesion| (point - lesion.center_m).norm() <= 0.5 * lesion.diameter_m)
            .find_map(|lesion| lesion.organ.clone())
            .or_else(|| {
                self.parts
                    .iter()
                    .filter(|part| part.tissue == Tissue::Organ)
                    .find(|part| part.solid.contains(point))
                    .and_then(|part| part.organ.clone())
            })
    }

    /// The outer surface: one closed mesh, phantom frame. The shipped ones are convex.
    pub fn skin(&self) -> &Solid {
        &self.parts[0].solid
    }

    /// Where a line pierces the skin: the distances `s` in m of `origin + s * direction` (phantom
    /// frame) at which it enters and leaves.
    ///
    /// Exact for the polyhedral skin. Negative distances lie behind the origin: an origin inside
    /// has `enter_m < 0 < leave_m`. `None` when the line misses the skin or only grazes it. Of a
    /// skin that is not convex and that the line pierces more than once, it is the first stretch
    /// inside that ends ahead of the origin, or the last where none does.
    pub fn skin_intersection(
        &self,
        origin: &Point3<f64>,
        direction: &UnitVector3<f64>,
    ) -> Option<(f64, f64)> {
        self.skin_surface.clip_line(origin, direction)
    }

    /// Outward normal of the skin at a point of it (phantom frame).
    pub fn skin_normal(&self, point: &Point3<f64>) -> UnitVector3<f64> {
        self.skin_surface.normal(point)
    }

    /// Whether a point (phantom frame) is inside the skin or on it.
    pub fn skin_contains(&self, point: &Point3<f64>) -> bool {
        self.skin_signed_depth(point) >= 0.0
    }

    /// Depth of a point (phantom frame) under the skin, m: positive inside, negative outside.
    ///
    /// Exact inside. Outside a convex skin, the magnitude is a lower bound of the distance, exact
    /// opposite a face: the distance to the furthest face plane that the point is in front of.
    pub fn skin_signed_depth(&self, point: &Point3<f64>) -> f64 {
        self.skin_surface.depth_m(point)
    }
}

/// Places a lesion and finds the organ that contains it.
fn lesion(
    wanted: &LesionParameters,
    skin: &HalfSpaces,
    anatomy: &[PhantomPart],
) -> Result<(Lesion, PhantomPart), PhantomError> {
    let center_m = Point3::from(wanted.center_mm.map(|mm| 1e-3 * mm));
    let radius_m = 0.5e-3 * wanted.diameter_mm;
    let beyond_m = radius_m - skin.depth_m(&center_m);
    if beyond_m > 0.0 {
        return Err(PhantomError::LesionOutsideSkin {
            lesion: wanted.name.clone(),
            center_mm: wanted.center_mm,
            by_mm: 1e3 * beyond_m,
        });
    }
    let organ = anatomy
        .iter()
        .filter(|part| part.tissue == Tissue::Organ)
        .find(|part| {
            HalfSpaces::of(&part.solid).is_some_and(|faces| faces.depth_m(&center_m) >= radius_m)
        })
        .and_then(|part| part.organ.clone());
    let name = format!("lesion_{}", wanted.name);
    let part = PhantomPart {
        name: name.clone(),
        tissue: Tissue::Lesion,
        organ: organ.clone(),
        solid: solids::ball(name, center_m, radius_m),
        color_rgba: LESION_RGBA,
    };
    let lesion = Lesion {
        name: wanted.name.clone(),
        center_m,
        diameter_m: 2.0 * radius_m,
        organ,
    };
    Ok((lesion, part))
}

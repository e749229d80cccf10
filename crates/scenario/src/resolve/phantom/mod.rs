//! The phantom of a scenario: a model, parts from meshes, or both, and where it lies.

mod build;
mod mesh_parts;
mod place;

use std::path::Path;
use std::sync::{Arc, OnceLock};

use nalgebra::{Point3, UnitQuaternion, UnitVector3, Vector3};
use needlebench_geometry::{Placement, PreparedShape, Shape, Solid, separation};
use needlebench_input::{Finding, Location, ModelSource, TomlText, nearest_name, source_of};
use needlebench_kinematics::Pose;
use needlebench_phantom::{
    PARAMETERS, Phantom, PhantomError, PhantomParameters, PhantomPart, ScanEnd, Tissue,
};

use super::cache::Cache;
use crate::scenario::{NO_MODEL, PhantomSection};
use build::Report;
use mesh_parts::with_mesh_parts;
pub use place::PlacedPhantom;
pub(super) use place::{off_the_table, place_phantom};

/// A phantom before it is placed, and the files that it is made of.
#[derive(Debug)]
pub(crate) struct UnplacedPhantom {
    pub phantom: Arc<Phantom>,
    /// Vertices of the skin, phantom frame, m.
    pub skin_m: Vec<Vector3<f64>>,
    /// Parameter file, unless the phantom is of the user's parts alone.
    pub model: Option<ModelSource>,
    /// Files of the user's parts.
    pub parts: Vec<ModelSource>,
    pub notes: Vec<String>,
    /// The skin, ready for distances: see [`UnplacedPhantom::skin`].
    prepared_skin: OnceLock<PreparedShape>,
    /// Lowest and highest coordinates of the skin, turned, about the phantom's origin.
    turned: Cache<UnitQuaternion<f64>, (Vector3<f64>, Vector3<f64>)>,
    /// Lowest coordinate along a direction.
    lowest_m: Cache<Vector3<f64>, f64>,
    /// A ball about the skin, phantom frame.
    ball: OnceLock<(Vector3<f64>, f64)>,
    /// Where the body may go on behind the cuts of its scan beside such limbs, phantom frame.
    behind_cuts: Cache<Vec<PhantomPart>, Vec<Solid>>,
}

/// A cut is that of a limb of the model within this, m (assumed: what limbs of people differ by).
const SAME_LIMB_M: f64 = 0.01;

/// Lowest and highest corner of a box.
pub(super) type Corners = (Point3<f64>, Point3<f64>);

impl UnplacedPhantom {
    /// The skin, ready for distances, in its own frame.
    pub fn skin(&self) -> &PreparedShape {
        self.prepared_skin
            .get_or_init(|| PreparedShape::new(&self.phantom.skin().shape))
    }

    /// Box about the skin, along the axes of another frame.
    pub fn extent(&self, frame_from_phantom: &Pose) -> Corners {
        let turn = frame_from_phantom.rotation;
        let turned = self.turned.get(
            |known| *known == turn,
            || {
                let rotation = turn.to_rotation_matrix();
                let start = (
                    Vector3::repeat(f64::INFINITY),
                    Vector3::repeat(f64::NEG_INFINITY),
                );
                let box_m = self.skin_m.iter().fold(start, |(low, high), point| {
                    let at = rotation * point;
                    (low.inf(&at), high.sup(&at))
                });
                Ok::<_, std::convert::Infallible>((turn, box_m))
            },
        );
        let turned = turned.unwrap_or_else(|never| match never {});
        let middle = frame_from_phantom.translation.vector;
        ((middle + turned.0).into(), (middle + turned.1).into())
    }

    /// Lowest coordinate of the skin along a direction of the phantom frame, m.
    fn lowest_m(&self, up: &Vector3<f64>) -> f64 {
        let lowest_m = self.lowest_m.get(
            |known| known == up,
            || {
                let heights_m = self.skin_m.iter().map(|vertex| up.dot(vertex));
                let lowest_m = heights_m.fold(f64::INFINITY, f64::min);
                Ok::<_, std::convert::Infallible>((*up, lowest_m))
            },
        );
        *lowest_m.unwrap_or_else(|never| match never {})
    }

    /// Where the body may go on behind the cuts of its scan, beside the limbs of a placed one; world.
    pub fn behind_cuts(&self, placed: &PlacedPhantom) -> Vec<Solid> {
        if !self.phantom.has_scan_ends() {
            return Vec::new();
        }
        let solids = self.behind_cuts.get(
            |limbs| *limbs == placed.limbs,
            || {
                let made = self.phantom.unseen_body(is_limb(&placed.limbs));
                Ok::<_, std::convert::Infallible>((placed.limbs.clone(), made))
            },
        );
        let solids = solids.unwrap_or_else(|never| match never {});
        needlebench_cell::placed(&solids, &placed.world_from_phantom)
    }

    /// Most that a point of the skin moves from one place of the phantom to another, m.
    pub fn travel_m(&self, from: &Placement, to: &Placement) -> f64 {
        let (centre, radius_m) = self.ball.get_or_init(|| {
            let (low, high) = self.extent(&Pose::identity());
            let centre = nalgebra::center(&low, &high).coords;
            let distances_m = self.skin_m.iter().map(|vertex| (vertex - centre).norm());
            (centre, distances_m.fold(0.0, f64::max))
        });
        from.travel_m(to, centre, *radius_m)
    }
}

/// Whether a point (phantom frame) is in a limb.
fn is_limb(limbs: &[PhantomPart]) -> impl Fn(&Point3<f64>) -> bool {
    let prepared = |limb: &PhantomPart| {
        let Solid {
            shape,
            parent_from_shape,
            ..
        } = &limb.solid;
        (PreparedShape::new(shape), *parent_from_shape)
    };
    // What is assumed behind a cut does not say what is behind it.
    let limbs = limbs.iter().filter(|limb| limb.tissue != Tissue::Assumed);
    let limbs: Vec<(PreparedShape, Pose)> = limbs.map(prepared).collect();
    let ball = PreparedShape::new(&Shape::Sphere {
        radius_m: SAME_LIMB_M,
    });
    move |at| {
        let at = Pose::from_parts((*at).into(), UnitQuaternion::identity());
        let mut limbs = limbs.iter();
        limbs.any(|(limb, place)| separation(&ball, &at, limb, place).distance_m <= 0.0)
    }
}

/// The scenario's phantom.
pub(super) fn scenario_phantom(
    toml: &TomlText<'_>,
    section: &PhantomSection,
    base: &Path,
) -> Result<UnplacedPhantom, Vec<Finding>> {
    let one = |finding: Finding| vec![finding];
    let mut notes = Vec::new();
    let (shipped, model) = if section.model == NO_MODEL {
        check_no_model(toml, section).map_err(one)?;
        (None, None)
    } else {
        let (phantom, source) = shipped_phantom(toml, section, base)?;
        (Some(phantom), Some(source))
    };
    let report = section.build.as_ref();
    let report = report.map(|build| Report::read(toml, build, base));
    let report = report.transpose().map_err(one)?;
    let (phantom, parts) = match shipped {
        Some(phantom) if section.parts.is_empty() => (phantom, Vec::new()),
        shipped => with_mesh_parts(toml, &section.parts, shipped, base, &mut notes).map_err(one)?,
    };
    if let Some(report) = &report {
        report
            .check_parts(toml, &section.parts, &parts, base)
            .map_err(one)?;
    }
    let phantom = cut_phantom(toml, section, phantom).map_err(one)?;
    notes.extend(assumed_body(section));
    let skin = phantom.skin();
    // A polyhedron is its own surface, whatever the fineness.
    let surface = skin.shape.surface(0.0);
    let skin_m = surface.vertices_m.iter();
    let skin_m = skin_m.map(|vertex| (skin.parent_from_shape * vertex).coords);
    Ok(UnplacedPhantom {
        skin_m: skin_m.collect(),
        phantom: Arc::new(phantom),
        model,
        parts,
        notes,
        prepared_skin: OnceLock::new(),
        turned: Cache::default(),
        lowest_m: Cache::default(),
        ball: OnceLock::new(),
        behind_cuts: Cache::default(),
    })
}

/// The phantom with the ends of its scan.
fn cut_phantom(
    toml: &TomlText<'_>,
    section: &PhantomSection,
    phantom: Phantom,
) -> Result<Phantom, Finding> {
    if section.cuts.is_empty() {
        return Ok(phantom);
    }
    let cuts = section.cuts.iter().enumerate().map(|(index, cut)| {
        let normal = UnitVector3::try_new(Vector3::from(cut.normal), 0.0).ok_or_else(|| {
            let key = format!("phantom.cuts[{index}].normal");
            toml.finding(&key, "the normal of a cut has no length")
                .hint("a direction away from what was scanned, e.g. [0, 0, 1] for the upper end")
        })?;
        let offset_m = 1e-3 * cut.offset_mm;
        Ok(ScanEnd {
            normal,
            offset_m,
            assumed_m: 1e-3 * cut.assumed_mm.unwrap_or(0.0),
        })
    });
    let ends = cuts.collect::<Result<_, Finding>>()?;
    Ok(phantom.with_scan_ends(ends))
}

/// What a note of an assumed body begins with: its clearances are no better than what is assumed.
pub const ASSUMED_BODY: &str = "the body behind ";

/// What is to be known of clearances from a body that is assumed.
fn assumed_body(section: &PhantomSection) -> Option<String> {
    let reaches = section.cuts.iter().filter_map(|cut| cut.assumed_mm);
    let count = reaches.clone().count();
    let least_mm = reaches.min_by(f64::total_cmp)?;
    Some(format!(
        "{ASSUMED_BODY}{count} of {} cuts of the scan is assumed, up to {least_mm} mm: clearances from it are no bounds \
         of those from the patient",
        section.cuts.len()
    ))
}

/// A phantom without a model is what its parts are.
fn check_no_model(toml: &TomlText<'_>, section: &PhantomSection) -> Result<(), Finding> {
    for (name, is_given) in [
        ("breadth_mm", section.breadth_mm.is_some()),
        ("depth_mm", section.depth_mm.is_some()),
        ("length_mm", section.length_mm.is_some()),
        ("markers", section.markers.is_some()),
    ] {
        if is_given {
            return Err(toml
                .finding(
                    &format!("phantom.{name}"),
                    format!("`{name}` contradicts `model = \"{NO_MODEL}\"`"),
                )
                .hint("the parts have the size of their files"));
        }
    }
    Ok(())
}

/// The phantom that a parameter file describes.
fn shipped_phantom(
    toml: &TomlText<'_>,
    section: &PhantomSection,
    base: &Path,
) -> Result<(Phantom, ModelSource), Vec<Finding>> {
    let one = |finding: Finding| vec![finding];
    let location = Location::of_model(&section.model, "chest_phantom", "toml", base);
    let bytes = location.read().map_err(|error| {
        let names = Location::builtin_names("chest_phantom", "toml");
        toml.finding("phantom.model", format!("{}: {error}", location.display()))
            .hint(
                match nearest_name(&section.model, names.iter().map(String::as_str)) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!(
                        "a path, `{NO_MODEL}` for [[phantom.parts]] only, or one of {}",
                        names.join(", ")
                    ),
                },
            )
    });
    let bytes = bytes.map_err(one)?;
    let file = location.display();
    let text = String::from_utf8(bytes)
        .map_err(|error| one(Finding::new(&file, format!("not UTF-8 text: {error}"))))?;
    let parameter_text = TomlText::parse(&file, &text).map_err(one)?;
    let mut parameters: PhantomParameters = parameter_text.read(&PARAMETERS)?;
    let sizes = [
        (&mut parameters.breadth_mm, section.breadth_mm),
        (&mut parameters.depth_mm, section.depth_mm),
        (&mut parameters.length_mm, section.length_mm),
    ];
    let mut resized = false;
    for (size, wanted) in sizes {
        if let Some(wanted) = wanted {
            *size = wanted;
            resized = true;
        }
    }
    parameters.marker_kind = section.markers.unwrap_or(parameters.marker_kind);
    let phantom = Phantom::build(&parameters).map_err(|error| {
        one(if resized {
            let key = match &error {
                PhantomError::Value { key, .. } => format!("phantom.{key}"),
                _ => "phantom".to_owned(),
            };
            toml.finding(&key, error.to_string())
                .hint("lengths are in millimetres; omit a size for the model's own")
        } else {
            Finding::new(&file, error.to_string())
        })
    })?;
    Ok((phantom, source_of(file, text.as_bytes())))
}

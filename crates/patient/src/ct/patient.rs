//! A scenario with the patient that was built from a scan.

use std::path::Path;

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use needlebench_geometry::mesh::extent_m;
use needlebench_imaging::Surface;
use needlebench_imaging::registration::ReferenceFrame;
use needlebench_kinematics::Pose;
use needlebench_phantom::Tissue;
use needlebench_scenario::ResolvedScenario;
use needlebench_scenario::scenario::{
    BuildSection, CovarianceMm2, CutSection, GoalSection, ImagingBlock, PartSection, PartTissue,
    PhantomSection, RegistrationBlock, Scenario,
};
use needlebench_volume::{BesideKind, Remark, SurfaceTissue};

use super::ScanBuild;
use super::build::part_tissue;

/// Folder of the surfaces, beside the scenario.
pub(super) const SURFACES: &str = "surfaces";

/// The file of a surface, relative to the scenario.
pub(super) fn surface_file(name: &str) -> String {
    format!("{SURFACES}/{name}.stl")
}

/// Step that places in the scenario are rounded to, mm: far below what anything here is known to.
const PLACE_STEP: f64 = 1e-6;

/// The patient that was built, about the middle of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatientFrame {
    /// Origin of the phantom's frame in `ct`, m: the middle of the skin's box, to a millimetre. Axes are those of `ct`.
    pub origin_in_ct_m: Vector3<f64>,
}

impl PatientFrame {
    /// Of what was built.
    pub fn of(build: &ScanBuild) -> Self {
        let origin = build.seen.made.skin().map_or_else(Vector3::zeros, |skin| {
            let [low, high] = extent_m(&skin.mesh);
            nalgebra::center(&low, &high).coords
        });
        Self {
            origin_in_ct_m: origin.map(|metres| (metres * 1e3).round() * 1e-3),
        }
    }

    /// A place of `ct` in the phantom's frame, mm.
    pub fn in_mm(&self, place_m: &Point3<f64>) -> [f64; 3] {
        (place_m.coords - self.origin_in_ct_m)
            .map(|metres| rounded(metres * 1e3, PLACE_STEP))
            .into()
    }

    /// From the phantom's frame to `ct`.
    pub fn ct_from_phantom(&self) -> Pose {
        Pose::from_parts(self.origin_in_ct_m.into(), UnitQuaternion::identity())
    }
}

fn rounded(value: f64, step: f64) -> f64 {
    // Not -0, which reads as if it meant something.
    let digits = (1.0 / step).round();
    (value * digits).round() / digits + 0.0
}

/// The room without its own patient.
#[derive(Debug, Clone)]
pub struct Room<'r> {
    /// Robot, tool, table and all else; its phantom gives the patient position.
    pub scenario: &'r Scenario,
    /// The same, resolved.
    pub resolved: &'r ResolvedScenario,
    /// The folder that its paths are relative to.
    pub folder: &'r Path,
}

/// The scenario of a patient that was built: surfaces as parts, the robot where the registration puts it, measured
/// covariances, and these goals. It is for a file in `folder`, with the surfaces in [`SURFACES`] and the report that
/// `section` names beside it. What [`couch_left_out`] says of the couch is told by `is_couch_left_out`.
pub(crate) fn patient_scenario(
    room: &Room<'_>,
    build: &ScanBuild,
    goals: Vec<GoalSection>,
    section: BuildSection,
    folder: &Path,
    is_couch_left_out: bool,
) -> Scenario {
    let frame = PatientFrame::of(build);
    let mut scenario = room.scenario.clone();
    scenario.moved_files(room.folder, folder);
    scenario.ct = None;
    scenario.goals = goals;
    let own = scenario.phantom.take().unwrap_or_default();
    let mut phantom = phantom(own, room, build, &frame, is_couch_left_out);
    phantom.build = Some(section);
    if let Some(registered) = &build.registered {
        let reference_from_phantom =
            registered.registration.reference_from_ct * frame.ct_from_phantom();
        if registered.registration.frame == ReferenceFrame::Robot {
            let world_from_robot = room.resolved.cell.robot.world_from_base_link;
            phantom.set_pose(&(world_from_robot * reference_from_phantom));
        }
        let measured = RegistrationBlock {
            markers_mm: registered
                .places_m
                .iter()
                .map(|place| frame.in_mm(place))
                .collect(),
            covariance_mm2: Some(registered.covariances_m2.iter().map(in_mm2).collect()),
            ..RegistrationBlock::default()
        };
        match &mut scenario.imperfections {
            Some(blocks) => {
                blocks.registration = Some(measured);
                if registered.registration.frame == ReferenceFrame::Robot {
                    // The markers' places are the robot's own: there is no other way from the scan to it.
                    blocks.hand_eye = None;
                }
            }
            None => scenario.expected.registration = Some(measured),
        }
    }
    let least_certain = build.targets.iter().max_by(|a, b| {
        let spread = |target: &super::BuiltTarget| {
            (0..3)
                .map(|axis| target.covariance_m2[axis][axis])
                .sum::<f64>()
        };
        spread(a).total_cmp(&spread(b))
    });
    if let Some(target) = least_certain {
        let rows = &target.covariance_m2;
        let measured = ImagingBlock {
            covariance_mm2: Some(in_mm2(&Matrix3::from_fn(|row, column| rows[row][column]))),
            ..ImagingBlock::default()
        };
        match &mut scenario.imperfections {
            Some(blocks) => blocks.imaging = Some(measured),
            None => scenario.expected.imaging = Some(measured),
        }
    }
    scenario.phantom = Some(phantom);
    scenario
}

fn phantom(
    own: PhantomSection,
    room: &Room<'_>,
    build: &ScanBuild,
    frame: &PatientFrame,
    is_couch_left_out: bool,
) -> PhantomSection {
    let has_limbs = own.head || own.arms != needlebench_scenario::scenario::Arms::None;
    let model = room
        .resolved
        .phantom
        .as_ref()
        .filter(|placed| has_limbs && placed.phantom.parameters.is_some());
    let mut replaces = Vec::new();
    if let Some(placed) = model {
        for tissue in [
            Tissue::Skin,
            Tissue::Bone,
            Tissue::Vessel,
            Tissue::Organ,
            Tissue::Fissure,
            Tissue::Lesion,
            Tissue::Marker,
        ] {
            if placed
                .phantom
                .parts
                .iter()
                .any(|part| part.tissue == tissue)
            {
                replaces.push(tissue.to_string());
            }
        }
    }
    let position_mm = frame.in_mm(&Point3::origin());
    let surfaces = build.seen.made.surfaces.iter();
    let surfaces =
        surfaces.filter(|surface| !(is_couch_left_out && is_under(surface.tissue, &surface.name)));
    let parts = surfaces.map(|surface| PartSection {
        name: surface.name.clone(),
        file: surface_file(&surface.name),
        tissue: part_tissue(surface.tissue),
        unit: needlebench_scenario::scenario::LengthUnit::Mm,
        position_mm,
        rpy_deg: [0.0; 3],
        flip: false,
        replaces: if surface.tissue == SurfaceTissue::Skin {
            replaces.clone()
        } else {
            Vec::new()
        },
    });
    let pieces = build.assumed.iter().flat_map(|assumed| &assumed.pieces);
    let pieces = pieces.map(|piece| PartSection {
        name: piece.name.clone(),
        file: surface_file(&piece.name),
        tissue: PartTissue::Assumed,
        unit: needlebench_scenario::scenario::LengthUnit::Mm,
        position_mm,
        rpy_deg: [0.0; 3],
        flip: false,
        replaces: Vec::new(),
    });
    let parts = parts.chain(pieces).collect();
    let cuts = cuts(build, frame);
    let mut own = own;
    let arms = BesideKind::Arms.name();
    if build
        .seen
        .made
        .surfaces
        .iter()
        .any(|each| each.name == arms)
    {
        // The patient's own.
        own.arms = needlebench_scenario::scenario::Arms::None;
    }
    match model {
        Some(_) => PhantomSection {
            markers: None,
            parts,
            cuts,
            ..own
        },
        None => PhantomSection {
            model: "none".to_owned(),
            breadth_mm: None,
            depth_mm: None,
            length_mm: None,
            markers: None,
            arms: needlebench_scenario::scenario::Arms::None,
            head: false,
            parts,
            cuts,
            ..own
        },
    }
}

/// Whether a surface is of something beside the patient that stays where it is when the patient is turned.
pub(super) fn is_under(tissue: SurfaceTissue, name: &str) -> bool {
    tissue == SurfaceTissue::Beside && name != BesideKind::Arms.name()
}

/// Says that the patient of the room lies otherwise than on the couch of the scan, which is left out then.
pub(crate) fn couch_left_out(room: &Room<'_>, build: &ScanBuild) -> Option<Remark> {
    /// How far the room may have the patient turned about what they lie on in the scan: cos 30 deg.
    const LIES_ALIKE: f64 = 0.866;
    let robot = ReferenceFrame::Robot;
    if build
        .registered
        .as_ref()
        .is_some_and(|it| it.registration.frame == robot)
    {
        // The markers say how the patient lies, whatever the room does.
        return None;
    }
    let made = &build.seen.made;
    let couch = BesideKind::Couch.name();
    let couch = made.surfaces.iter().find(|each| each.name == couch)?;
    let middle = |surface: &Surface| {
        let [low, high] = extent_m(&surface.mesh);
        nalgebra::center(&low, &high)
    };
    // As the patient was laid, by the scan or by `--patient-position`: the room was resolved before.
    let laid = room.scenario.phantom.as_ref();
    let laid = laid.map_or_else(
        || PhantomSection::default().orientation(),
        PhantomSection::orientation,
    );
    let down = laid.inverse() * -Vector3::z();
    // The couch is as long as the scan: along the patient its middle says nothing.
    let mut to_couch = middle(couch) - middle(made.skin()?);
    to_couch.z = 0.0;
    (to_couch.normalize().dot(&down) < LIES_ALIKE).then(|| {
        Remark::new(
            "the couch of the scan is not under the patient as the room has them lie: couch and objects are left out",
        )
    })
}

/// Where the scan ends, as the patient has it.
fn cuts(build: &ScanBuild, frame: &PatientFrame) -> Vec<CutSection> {
    let skin = build.seen.made.skin();
    let cuts = skin.map_or_else(Vec::new, |skin| build.seen.field_of_view.cuts(&skin.mesh));
    let assumed = build.assumed.as_ref();
    let assumed_mm = assumed.map(|assumed| rounded(1e3 * assumed.outside.reach_m, PLACE_STEP));
    let cuts = cuts.iter().map(|cut| {
        let offset_m = cut.offset_m - cut.normal.dot(&frame.origin_in_ct_m);
        CutSection {
            normal: cut.normal.map(|value| rounded(value, PLACE_STEP)).into(),
            offset_mm: rounded(offset_m * 1e3, PLACE_STEP),
            assumed_mm,
        }
    });
    cuts.collect()
}

fn in_mm2(covariance_m2: &Matrix3<f64>) -> CovarianceMm2 {
    let at = |row: usize, column: usize| covariance_m2[(row, column)] * 1e6;
    // Digits that a person reads, and more than are known: eight of the largest.
    let most = (0..3).map(|axis| at(axis, axis)).fold(0.0, f64::max);
    let step = libm::pow(10_f64, libm::log10(most.max(1e-12)).floor() - 8.0);
    [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
        .map(|(row, column)| rounded(at(row, column), step))
}

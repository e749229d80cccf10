//! From a volume to surfaces, markers, registration and targets.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use nalgebra::{Matrix3, Point3};
use needlebench_geometry::TriangleMesh;
use needlebench_geometry::mesh::extent_m;
use needlebench_imaging::markers::{DetectedMarker, Found, MarkerModel, Options, find_markers};
use needlebench_imaging::registration::{
    MarkerMatch, MatchOptions, ReferenceFrame, ReferenceMarker, Registration, TargetError,
    match_markers, register_weighted,
};
use needlebench_imaging::{
    AssumedBody, FieldOfView, LabelFacts, LesionSeed, Outside, ReconstructOptions, Reconstruction,
    Surface, SurfaceSizes, reconstruct,
};
use needlebench_parallel::Control;
use needlebench_scenario::scenario::PartTissue;
use needlebench_volume::read::{Description, ReadOptions, ReadVolume, read_labels};
use needlebench_volume::{
    BesideKind, LabelMap, Remark, SurfaceTissue, Volume, VolumeError, VoxelGrid, in_order,
    resample, resample_labels, structure_of,
};
use serde::Serialize;

use super::digest::voxels_sha256;

/// Markers whose places are known apart from the scan.
#[derive(Debug, Clone, PartialEq)]
pub struct KnownMarkers {
    /// Whose frame the places are in.
    pub frame: ReferenceFrame,
    /// What they look like.
    pub model: MarkerModel,
    /// Standard deviation of how each marker was put on along each axis, where people followed a drawing: for the match
    /// alone. A usual one if left out.
    pub placement_sigma_m: Option<f64>,
    /// The markers.
    pub markers: Vec<ReferenceMarker>,
}

/// A label map from elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenLabels {
    /// A label map or segmentation in any format that is read, or a folder with a mask in each file, on the voxels of the
    /// volume.
    pub file: PathBuf,
    /// Which label is called what, where the file does not say it.
    pub names: Vec<(u16, String)>,
}

/// What is to be built.
#[derive(Debug, Clone, Default)]
pub struct BuildOptions {
    /// A point in each lesion.
    pub lesions: Vec<LesionSeed>,
    /// Structures from elsewhere.
    pub labels: Option<GivenLabels>,
    /// Markers to be found; none are looked for if left out.
    pub markers: Option<KnownMarkers>,
    /// Triangles of surfaces.
    pub sizes: SurfaceSizes,
    /// How the body is assumed to go on behind the cuts of the scan; nothing is assumed if left out.
    pub outside: Option<Outside>,
    /// Most bytes that a volume may take.
    pub max_bytes: u64,
}

/// Markers of a scan, and the registration by them.
#[derive(Debug, Clone)]
pub struct Registered {
    /// Which is which.
    pub matched: MarkerMatch,
    /// Where the patient is.
    pub registration: Registration,
    /// Covariance of each registered marker, both sides together, in the axes of `ct`, m^2; in the order of the
    /// registration's markers.
    pub covariances_m2: Vec<Matrix3<f64>>,
    /// Where each of them is in `ct`, m.
    pub places_m: Vec<Point3<f64>>,
}

/// A lesion as a target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BuiltTarget {
    /// Name of the lesion.
    pub name: String,
    /// Its centroid in `ct`, m.
    pub center_m: [f64; 3],
    /// Covariance of how well the centroid is localised in the scan, rows, m^2.
    pub covariance_m2: [[f64; 3]; 3],
    /// The registration's error there, with its covariance; none without a registration.
    pub registration: Option<TargetError>,
}

/// What a scan shows by itself, whatever is known of its markers.
#[derive(Debug)]
pub struct SeenScan {
    /// The volume, along the patient's axes.
    pub volume: Volume,
    /// Where it came from.
    pub source: Description,
    /// Surfaces, labels and lesions.
    pub made: Reconstruction,
    /// Where it ends.
    pub field_of_view: FieldOfView,
    /// Markers; none if none were looked for.
    pub markers: Option<Found>,
    /// What is worth knowing: of reading, of markers, of tissues.
    pub remarks: Vec<Remark>,
    /// Structures of which a label map from elsewhere has voxels.
    pub(super) mapped: Vec<String>,
    voxels_sha256: OnceLock<String>,
    labels_sha256: OnceLock<String>,
}

impl SeenScan {
    /// Digest of the Hounsfield units, made once.
    pub(super) fn voxels_sha256(&self) -> &str {
        let of = || voxels_sha256(&self.volume.hu, i16::to_le_bytes);
        self.voxels_sha256.get_or_init(of)
    }

    /// Digest of the labels, made once.
    pub(super) fn labels_sha256(&self) -> &str {
        let of = || voxels_sha256(&self.made.labels.labels, u16::to_le_bytes);
        self.labels_sha256.get_or_init(of)
    }
}

/// What was made of a scan.
#[derive(Debug, Clone)]
pub struct ScanBuild {
    /// What it shows.
    pub seen: Arc<SeenScan>,
    /// Markers and registration; none if none were asked for.
    pub registered: Option<Registered>,
    /// The lesions that have a surface.
    pub targets: Vec<BuiltTarget>,
    /// The body behind the cuts of the scan; none if none is assumed.
    pub assumed: Option<AssumedBody>,
    /// What is worth knowing: of the scan, and of the registration.
    pub remarks: Vec<Remark>,
}

/// Builds a patient from a scan.
///
/// The result does not depend on the number of threads.
///
/// # Errors
/// What keeps it from being built, with what to do; interrupted.
pub fn build(
    read: ReadVolume,
    options: &BuildOptions,
    control: &Control<'_>,
) -> Result<ScanBuild, VolumeError> {
    let seen = Arc::new(see(read, options, control)?);
    register(seen, options)
}

/// What a scan shows.
pub(super) fn see(
    read: ReadVolume,
    options: &BuildOptions,
    control: &Control<'_>,
) -> Result<SeenScan, VolumeError> {
    let Control {
        threads,
        cancel,
        progress,
    } = *control;
    let _stage = tracing::info_span!("see").entered();
    let mut remarks = read.remarks;
    // From here on axes are the patient's, whichever way the file has them.
    let stated_m = read.volume.slice_thickness_m;
    let volume = in_order(read.volume, threads, cancel)?;
    if let (Some(stated_m), None) = (stated_m, volume.slice_thickness_m) {
        remarks.push(Remark::new(format!(
            "the slices are not axial: their thickness of {:.2} mm is not used; the stated accuracy of markers and of \
             lesions does not know of it",
            1e3 * stated_m
        )));
    }
    let field_of_view = FieldOfView::of(&volume);
    let of_file = volume.grid.clone();
    let resampled = resample(volume, options.max_bytes, threads, cancel)?;
    let is_interpolated = resampled.remark.is_some();
    tracing::info!(is_interpolated, "volume on a straight grid");
    remarks.extend(resampled.remark);
    let volume = resampled.volume;
    let labels = options.labels.as_ref();
    let labels = labels.map(|given| {
        let reading = ReadOptions {
            max_bytes: options.max_bytes,
            scan: read.description.identity.clone(),
            ..ReadOptions::default()
        };
        let mut on = |grid: &VoxelGrid| labels_of(given, grid, &reading, control, &mut remarks);
        if !is_interpolated {
            return on(&volume.grid);
        }
        // Other programs see the file's voxels; ours are in `volume.nii.gz`.
        match on(&of_file) {
            Ok(map) => resample_labels(&map, &volume.grid, threads, cancel),
            Err(VolumeError::Interrupted) => Err(VolumeError::Interrupted),
            Err(refused) => on(&volume.grid).map_err(|error| match error {
                VolumeError::Interrupted => error,
                VolumeError::Refused { .. } => refused,
            }),
        }
    });
    let labels = labels.transpose()?;
    let markers = options.markers.as_ref().map(|known| {
        progress.message("markers");
        find_markers(&volume, &known.model, &Options::default(), threads, cancel)
    });
    let mut markers = markers.transpose()?;
    if is_interpolated {
        markers = markers.map(|found| found.of_interpolated(&volume));
    }
    remarks.extend(
        markers
            .iter()
            .flat_map(|found| found.remarks.iter().cloned()),
    );
    let given_names = labels
        .as_ref()
        .map_or_else(Vec::new, |map| map.names.clone());
    let wanted = ReconstructOptions {
        lesions: options.lesions.clone(),
        labels,
        sizes: options.sizes,
        field_of_view: Some(field_of_view.clone()),
        lying: read
            .description
            .patient_position
            .map(|position| position.lying),
        ..ReconstructOptions::default()
    };
    let step = |what: &str, share: f64| {
        const STEPS: f64 = 1000.0;
        progress.message(what);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of a thousand"
        )]
        progress.at((share.clamp(0.0, 1.0) * STEPS) as u64, STEPS as u64);
    };
    let mut made = reconstruct(&volume, &wanted, threads, cancel, &step)?;
    let small = without_scraps(&mut made.surfaces);
    remarks.extend(made.remarks.iter().cloned());
    remarks.extend(small);
    let mapped = mapped_structures(&given_names, &made);
    Ok(SeenScan {
        volume,
        mapped,
        source: read.description,
        made,
        field_of_view,
        markers,
        remarks,
        voxels_sha256: OnceLock::new(),
        labels_sha256: OnceLock::new(),
    })
}

/// Structures of a label map with these names that have voxels.
fn mapped_structures(given: &[(u16, String)], made: &Reconstruction) -> Vec<String> {
    let is_given = |fact: &&LabelFacts| {
        let mut given = given.iter();
        given.any(|(label, name)| *label == fact.label && *name == fact.name)
    };
    let with_voxels = made.facts.iter().filter(|fact| fact.voxels > 0);
    let structures = with_voxels
        .filter(is_given)
        .filter_map(|fact| structure_of(&fact.name));
    structures.map(|structure| structure.name).collect()
}

/// Leaves out surfaces that are smaller than their tissue is anywhere: a scenario would take them for parts in a wrong
/// unit. What stays to be said of each.
fn without_scraps(surfaces: &mut Vec<Surface>) -> Vec<Remark> {
    let mut remarks = Vec::new();
    surfaces.retain(|surface| {
        let [low, high] = extent_m(&surface.mesh);
        let size_mm = (high - low) * 1e3;
        let [least_mm, ..] = part_tissue(surface.tissue).sizes_mm();
        let is_part = surface.tissue == SurfaceTissue::Skin || size_mm.max() >= least_mm;
        if !is_part {
            remarks.push(
                Remark::new(format!(
                    "{:.1} x {:.1} x {:.1} mm, less than {least_mm} mm along every axis: omitted",
                    size_mm.x, size_mm.y, size_mm.z
                ))
                .at(format!("surface `{}`", surface.name)),
            );
        }
        is_part
    });
    remarks
}

/// What a scenario calls a surface of this tissue.
pub(super) fn part_tissue(tissue: SurfaceTissue) -> PartTissue {
    match tissue {
        SurfaceTissue::Skin => PartTissue::Skin,
        SurfaceTissue::Bone => PartTissue::Bone,
        SurfaceTissue::Vessel => PartTissue::Vessel,
        SurfaceTissue::Organ => PartTissue::Organ,
        SurfaceTissue::Lung => PartTissue::Lung,
        SurfaceTissue::Lesion => PartTissue::Lesion,
        SurfaceTissue::Beside => PartTissue::Beside,
    }
}

/// With what is known of the markers.
pub(super) fn register(
    seen: Arc<SeenScan>,
    options: &BuildOptions,
) -> Result<ScanBuild, VolumeError> {
    let mut remarks = seen.remarks.clone();
    let registered = match (&seen.markers, &options.markers) {
        (Some(found), Some(known)) => Some(registered(found, known, &mut remarks)?),
        _ => None,
    };
    let targets = targets(&seen.made, registered.as_ref());
    let assumed = options
        .outside
        .and_then(|outside| assumed_body(&seen, outside));
    remarks.extend(assumed.as_ref().map(in_words));
    Ok(ScanBuild {
        seen,
        registered,
        targets,
        assumed,
        remarks,
    })
}

/// The body behind the cuts of a scan; none of a scan without skin.
fn assumed_body(seen: &SeenScan, outside: Outside) -> Option<AssumedBody> {
    let arms = seen.made.surfaces.iter();
    let arms = arms.filter(|surface| surface.name == BesideKind::Arms.name());
    let arms: Vec<&TriangleMesh> = arms.map(|surface| &surface.mesh).collect();
    let skin = &seen.made.skin()?.mesh;
    Some(AssumedBody::of(skin, &arms, &seen.field_of_view, outside))
}

/// By what a body is assumed.
fn in_words(assumed: &AssumedBody) -> Remark {
    let Outside { reach_m, wider_m } = assumed.outside;
    let [left_mm, back_mm] = wider_m.map(|metres| 1e3 * metres);
    Remark::new(format!(
        "the body behind {} cuts is assumed, up to {:.0} mm: at the sides half as far as the tangents of the skin \
         that was seen enclose; behind the first and the last slice as near them, but up to {left_mm:.0} mm wider to left and right \
         and {back_mm:.0} mm to front and back; clearances from it are no bounds of those from the patient",
        assumed.cuts,
        1e3 * reach_m
    ))
}

/// The label map, with its names.
fn labels_of(
    given: &GivenLabels,
    grid: &VoxelGrid,
    options: &ReadOptions,
    control: &Control<'_>,
    remarks: &mut Vec<Remark>,
) -> Result<LabelMap, VolumeError> {
    let place = given.file.display().to_string();
    let within = |error: VolumeError| match &error {
        // A file of a folder, or an element of the file.
        VolumeError::Refused {
            place: Some(inner), ..
        } => {
            let place = format!("{place}: {inner}");
            error.at(place)
        }
        _ => error.at(place.clone()),
    };
    let mut read = read_labels(&given.file, grid, options, control.cancel).map_err(within)?;
    read.rename(&given.names).map_err(within)?;
    remarks.extend(
        read.remarks
            .into_iter()
            .map(|remark| remark.at("label map")),
    );
    let hint = if read.is_numbered_here {
        "rename the files of the masks, or the structures; names of TotalSegmentator and 3D Slicer are known"
    } else {
        "give their names with --label-names; names of TotalSegmentator and 3D Slicer are known"
    };
    let map = read.labels;
    if map
        .names
        .iter()
        .all(|(_, name)| structure_of(name).is_none())
    {
        let names = map
            .names
            .iter()
            .map(|(label, name)| format!("{label} `{name}`"));
        return Err(VolumeError::refused(format!(
            "none of its labels has a name with a known meaning: {}",
            names.take(8).collect::<Vec<_>>().join(", ")
        ))
        .at(place)
        .hint(hint));
    }
    Ok(map)
}

fn registered(
    found: &Found,
    known: &KnownMarkers,
    remarks: &mut Vec<Remark>,
) -> Result<Registered, VolumeError> {
    let detected: Vec<_> = found
        .markers
        .iter()
        .map(DetectedMarker::localised)
        .collect();
    let usual = MatchOptions::default();
    let options = MatchOptions {
        placement_sigma_m: known.placement_sigma_m.unwrap_or(usual.placement_sigma_m),
        ..usual
    };
    let matched = match_markers(&detected, &known.markers, &options)
        .map_err(|error| with_found(error, found))?;
    remarks.extend(matched.remarks.iter().cloned());
    let registration = register_weighted(&matched, &detected, &known.markers, known.frame)?;
    remarks.extend(registration.remarks.iter().cloned());
    for pair in &matched.pairs {
        let name = &known.markers[pair.reference].name;
        let of_it = found.markers[pair.detected].remarks.iter();
        remarks.extend(of_it.map(|remark| remark.clone().at(format!("marker `{name}`"))));
    }
    let ct_from_reference = registration.reference_from_ct.rotation.inverse();
    let turn = ct_from_reference.to_rotation_matrix();
    let covariances_m2 = matched.pairs.iter().map(|pair| {
        let of_reference = known.markers[pair.reference].covariance_m2;
        let both = detected[pair.detected].covariance_m2 + turn * of_reference * turn.transpose();
        0.5 * (both + both.transpose())
    });
    let covariances_m2 = covariances_m2.collect();
    let places_m = matched.pairs.iter();
    let places_m = places_m.map(|pair| detected[pair.detected].at_m).collect();
    Ok(Registered {
        matched,
        registration,
        covariances_m2,
        places_m,
    })
}

/// How many were found belongs to what is said of a match that there is not.
fn with_found(error: VolumeError, found: &Found) -> VolumeError {
    match error {
        VolumeError::Refused {
            place,
            message,
            hint,
        } => VolumeError::Refused {
            place: place.or_else(|| Some("markers".to_owned())),
            message: format!("{message}; {} were found in the scan", found.markers.len()),
            hint: hint.or_else(|| {
                Some(
                    "check diameter and kind of the markers, and that the list belongs to this \
                     patient"
                        .to_owned(),
                )
            }),
        },
        other @ VolumeError::Interrupted => other,
    }
}

fn targets(made: &Reconstruction, registered: Option<&Registered>) -> Vec<BuiltTarget> {
    let lesions = made.lesions.iter();
    lesions
        .filter_map(|measured| {
            let size = measured.size.as_ref()?;
            let covariance = size.centroid_covariance_m2;
            Some(BuiltTarget {
                name: measured.lesion.name.clone(),
                center_m: size.centroid_m.coords.into(),
                covariance_m2: std::array::from_fn(|row| {
                    std::array::from_fn(|column| covariance[(row, column)])
                }),
                registration: registered.map(|it| it.registration.tre(&size.centroid_m)),
            })
        })
        .collect()
}

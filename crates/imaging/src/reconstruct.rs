//! From a volume to surfaces, in one call.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use nalgebra::{Matrix3, Point3};
use needlebench_geometry::TriangleMesh;
use needlebench_geometry::mesh::{
    MeshDefect, SurfaceIndex, check_closed, volume_m3, without_inverted_parts,
};
use needlebench_parallel::in_parallel;
use needlebench_volume::{
    BesideKind, LabelMap, Lying, Remark, SurfaceTissue, Volume, VolumeError, VoxelGrid,
};
use serde::Serialize;

use crate::field_of_view::FieldOfView;
use crate::label_map::{
    Given, complete, completed_labels, fill_outside, given_structures, is_solid, seen_labels,
};
use crate::mapped_lesions::mapped_lesions;
use crate::mask::{IndexBox, Mask};
use crate::segment::{
    Label, LabelFacts, Lesion, LesionSeed, Levels, SOFT_FROM_HU, Segmentation,
    centre_covariance_m2, check_complete, grow_lesion, label_map, segment,
};
use crate::spacing::{orthogonal, whole};
use crate::surface::{
    Field, Level, SurfaceError, Values, at_middles, local_level, refine, simplify, sound,
    surface_error, surface_net,
};

/// What is to be made of a volume.
#[derive(Debug, Clone, Default)]
pub struct ReconstructOptions {
    /// Where lesions are.
    pub lesions: Vec<LesionSeed>,
    /// Structures from elsewhere, on the same grid: their surfaces come from it instead of from the Hounsfield units.
    pub labels: Option<LabelMap>,
    /// Triangles of surfaces.
    pub sizes: SurfaceSizes,
    /// Where surfaces run.
    pub levels: Levels,
    /// What the scan has seen; what the volume shows of it if left out.
    pub field_of_view: Option<FieldOfView>,
    /// On what the patient lies; on the back if left out.
    pub lying: Option<Lying>,
}

/// Triangles that surfaces are reduced to, as long as they stay near the voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SurfaceSizes {
    /// Skin.
    pub skin: usize,
    /// Each lung.
    pub lung: usize,
    /// All bone that is one surface.
    pub bone: usize,
    /// Any other surface.
    pub other: usize,
}

impl Default for SurfaceSizes {
    fn default() -> Self {
        Self {
            skin: 20_000,
            lung: 20_000,
            bone: 30_000,
            other: 8_000,
        }
    }
}

/// How far a vertex may leave the planes of the surface that it stands for, root mean square: 99 % of the surface keep
/// to twice that.
const MEAN_ERROR_M: f64 = 0.12e-3;

/// Distance from the voxels' surface that 99 % of it keep to.
pub(crate) const SURFACE_ERROR_M: f64 = 0.25e-3;

/// Cells of skin and lungs: several voxels where these are finer. Vertices lie on the voxels' surface all the same.
const LARGE_CELL_M: f64 = 2.05e-3;

/// Cells of bone, which has plates of 2 mm.
const BONE_CELL_M: f64 = 1.45e-3;

/// Cells of what is small: voxels.
const SMALL_CELL_M: f64 = 0.0;

/// Typical of air, lung, soft tissue and bone, HU: stand in where the mask knows better than the voxel.
const AIR: f32 = -1000.0;
const LUNG: f32 = -850.0;
const SOFT: f32 = 40.0;
const DENSE: f32 = 800.0;
const CARTILAGE: f32 = 110.0;

/// A closed surface.
#[derive(Debug, Clone)]
pub struct Surface {
    /// What it is called: `skin`, `lung_left`, `bone`, ..., and a lesion's own name.
    pub name: String,
    /// What it is of.
    pub tissue: SurfaceTissue,
    /// The organ that it is in, where it is a lesion.
    pub organ: Option<String>,
    /// In `ct`, m; closed, oriented, every edge with two triangles.
    pub mesh: TriangleMesh,
    /// Where it runs, HU; none where it runs between voxels of a mask.
    pub level_hu: Option<f64>,
    /// From the surface of the voxels to this one.
    pub error: SurfaceError,
    /// Volume within, m^3.
    pub volume_m3: f64,
    /// Triangles before simplification.
    pub triangles_before: usize,
}

/// Sizes of a lesion, measured on its surface before simplification.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LesionSize {
    /// Volume, m^3.
    pub volume_m3: f64,
    /// Diameter of the ball of this volume, m.
    pub equivalent_diameter_m: f64,
    /// Longest distance within, m.
    pub longest_m: f64,
    /// Longest distance in one slice, m.
    pub axial_longest_m: f64,
    /// Width perpendicular to that, in the same slice, m.
    pub axial_width_m: f64,
    /// Centroid, in `ct`, m.
    #[serde(skip)]
    pub centroid_m: Point3<f64>,
    /// Covariance of its error in the axes of `ct`, m^2: the centroid of the solid on the lung's side of its wall, without
    /// its vessels, is in the ellipsoid of 95 % in 95 +- 3 % of 300 simulated nodules.
    #[serde(skip)]
    pub centroid_covariance_m2: Matrix3<f64>,
}

/// A lesion with its size.
#[derive(Debug, Clone)]
pub struct MeasuredLesion {
    /// Its voxels and how it was bounded.
    pub lesion: Lesion,
    /// How large it is; none if it has no surface.
    pub size: Option<LesionSize>,
}

/// A lesion that could not be grown.
#[derive(Debug, Clone)]
pub struct NotGrown {
    /// What it is called.
    pub name: String,
    /// Why.
    pub error: VolumeError,
}

/// What was made of a volume.
#[derive(Debug, Clone)]
pub struct Reconstruction {
    /// Every voxel's label.
    pub labels: LabelMap,
    /// What is known of each label.
    pub facts: Vec<LabelFacts>,
    /// Masks of body, lungs, airways, vessels and bone.
    pub segmentation: Segmentation,
    /// Surfaces: the skin first, what lies beside the body last.
    pub surfaces: Vec<Surface>,
    /// Lesions of the label map, then those that could be grown, in the order in which they were asked for.
    pub lesions: Vec<MeasuredLesion>,
    /// The others; a remark says the same.
    pub not_grown: Vec<NotGrown>,
    /// What a user has to know.
    pub remarks: Vec<Remark>,
}

impl Reconstruction {
    /// The surface of the body; none where there is none.
    pub fn skin(&self) -> Option<&Surface> {
        skin_of(&self.surfaces)
    }
}

fn skin_of(surfaces: &[Surface]) -> Option<&Surface> {
    let mut all = surfaces.iter();
    all.find(|surface| surface.tissue == SurfaceTissue::Skin)
}

/// Told of each step: what it is, and the share of all steps that is done.
pub type Progress<'a> = &'a (dyn Fn(&str, f64) + Sync);

/// Segments a volume and makes closed surfaces of what it finds.
///
/// What comes out does not depend on the number of threads.
///
/// # Errors
/// If slices do not run along the patient, there is no body, a label map is of another grid, or it was told to stop.
pub fn reconstruct(
    volume: &Volume,
    options: &ReconstructOptions,
    threads: usize,
    cancel: &AtomicBool,
    progress: Progress<'_>,
) -> Result<Reconstruction, VolumeError> {
    orthogonal(&volume.grid)?;
    check_complete(volume)?;
    progress("tissues", 0.0);
    let seen = options.field_of_view.clone();
    let seen = seen.unwrap_or_else(|| FieldOfView::of(volume));
    let lying = options.lying.unwrap_or(Lying::Supine);
    let mut found = segment(volume, &seen, lying, &options.levels, cancel)?;
    let mut remarks = std::mem::take(&mut found.remarks);
    let map = options.labels.as_ref();
    let map = map
        .map(|map| seen_labels(map, &volume.grid, &seen, &mut remarks))
        .transpose()?;
    let mut given = match &map {
        Some(map) => given_structures(map, &volume.grid, &mut remarks)?,
        None => Vec::new(),
    };
    given.retain(|each| is_solid(each, &found, &volume.grid, &mut remarks));
    given.iter_mut().for_each(fill_outside);
    let other_bone = complete(&mut found, &given, &volume.grid, &mut remarks)?;
    let is_given = |name: &str| given.iter().any(|each| each.structure.name == name);
    found.note_absent(volume, &is_given, &mut remarks);
    progress("lesions", 0.3);
    let mut seeds = options.lesions.clone();
    let mut lesions = mapped_lesions(&mut given, volume, &found, &mut seeds, cancel, &mut remarks)?;
    let mut not_grown = Vec::new();
    for seed in &seeds {
        match grow_lesion(volume, &found, seed, cancel, &mut remarks) {
            Ok(lesion) => lesions.push(lesion),
            Err(VolumeError::Interrupted) => return Err(VolumeError::Interrupted),
            Err(error) => {
                remarks.extend(error.remark());
                let name = seed.name.clone();
                not_grown.push(NotGrown { name, error });
            }
        }
    }
    progress("surfaces", 0.4);
    let jobs = jobs(&found, &given, other_bone.as_ref(), &lesions, options);
    let made = make_all(volume, &jobs, threads, cancel, progress)?;
    let (mut surfaces, sizes) = sort(made, &jobs, lesions.len(), &mut remarks);
    keep_within_skin(&mut surfaces, &mut remarks);
    progress("label map", 0.95);
    let (labels, facts) = match &map {
        Some(given) => completed_labels(volume, &found, &lesions, given),
        None => label_map(volume, &found, &lesions),
    };
    let lesions = lesions.into_iter().zip(sizes);
    Ok(Reconstruction {
        labels,
        facts,
        segmentation: found,
        surfaces,
        lesions: lesions
            .map(|(lesion, size)| MeasuredLesion { lesion, size })
            .collect(),
        not_grown,
        remarks,
    })
}

/// Bone of the volume that a label map with bones lacks.
const OTHER_BONE: &str = "other_bone";

/// Where a surface runs.
enum Runs {
    At {
        level_hu: f64,
        typical: [f32; 2],
    },
    /// At the middle between bone and what is around it, place by place.
    BoneMiddle,
    Mask,
}

/// A surface to be made.
struct Job<'a> {
    name: String,
    tissue: SurfaceTissue,
    organ: Option<String>,
    bounds: IndexBox,
    mask: &'a Mask,
    runs: Runs,
    target: usize,
    cell_m: f64,
    /// The lesion that it is, with its number.
    lesion: Option<(usize, &'a Lesion)>,
    /// What it is made in, where that is not the volume.
    fine: Option<&'a Volume>,
}

fn jobs<'a>(
    found: &'a Segmentation,
    given: &'a [Given],
    other_bone: Option<&'a Mask>,
    lesions: &'a [Lesion],
    options: &ReconstructOptions,
) -> Vec<Job<'a>> {
    let sizes = options.sizes;
    let levels = options.levels;
    let mut jobs = Vec::new();
    let whole = IndexBox::whole(found.body.mask.size());
    let mut add = |name: &str, tissue, bounds, mask: &'a Mask, runs, target, cell_m| {
        // What a label map has comes from it.
        let is_given = given.iter().any(|each| {
            each.structure.name == name
                || name == Label::Bone.name() && each.structure.tissue == SurfaceTissue::Bone
        });
        if !is_given && !mask.is_empty() {
            jobs.push(Job {
                name: name.to_owned(),
                tissue,
                organ: None,
                bounds,
                mask,
                runs,
                target,
                cell_m,
                lesion: None,
                fine: None,
            });
        }
    };
    let skin = Runs::At {
        level_hu: levels.skin_hu,
        typical: [SOFT, AIR],
    };
    add(
        "skin",
        SurfaceTissue::Skin,
        whole,
        &found.body.mask,
        skin,
        sizes.skin,
        LARGE_CELL_M,
    );
    let lungs = &found.lungs;
    for lung in &lungs.lungs {
        let name = lung.side.structure();
        let runs = Runs::At {
            level_hu: levels.lung_hu,
            typical: [LUNG, SOFT],
        };
        add(
            name,
            SurfaceTissue::Lung,
            lungs.bounds,
            &lung.mask,
            runs,
            sizes.lung,
            LARGE_CELL_M,
        );
    }
    let airways = Runs::At {
        level_hu: levels.lung_hu,
        typical: [AIR, SOFT],
    };
    add(
        "trachea",
        SurfaceTissue::Organ,
        lungs.bounds,
        &lungs.airways,
        airways,
        sizes.other,
        SMALL_CELL_M,
    );
    let bone = &found.bone;
    add(
        "bone",
        SurfaceTissue::Bone,
        bone.bounds,
        &bone.blurred,
        Runs::BoneMiddle,
        sizes.bone,
        BONE_CELL_M,
    );
    let contrast = Runs::At {
        level_hu: levels.bone_hu,
        typical: [DENSE, SOFT],
    };
    add(
        "contrast_vessels",
        SurfaceTissue::Vessel,
        bone.bounds,
        &bone.contrast,
        contrast,
        sizes.other,
        SMALL_CELL_M,
    );
    add(
        "costal_cartilages",
        SurfaceTissue::Bone,
        bone.bounds,
        &bone.cartilage,
        Runs::At {
            level_hu: bone.cartilage_level_hu,
            typical: [CARTILAGE, SOFT],
        },
        sizes.other,
        SMALL_CELL_M,
    );
    for each in &found.beside {
        let runs = match each.kind {
            BesideKind::AssumedCouch => Runs::Mask,
            _ => Runs::At {
                level_hu: levels.skin_hu,
                typical: [SOFT, AIR],
            },
        };
        add(
            each.kind.name(),
            SurfaceTissue::Beside,
            each.bounds,
            &each.mask,
            runs,
            sizes.other,
            LARGE_CELL_M,
        );
    }
    if let Some(mask) = other_bone {
        jobs.push(Job {
            name: OTHER_BONE.to_owned(),
            tissue: SurfaceTissue::Bone,
            organ: None,
            bounds: bone.bounds,
            mask,
            runs: Runs::BoneMiddle,
            target: sizes.bone,
            cell_m: BONE_CELL_M,
            lesion: None,
            fine: None,
        });
    }
    for each in given {
        // A lung of the map with what else of it was found.
        let found_lung = lungs
            .lungs
            .iter()
            .find(|lung| each.structure.name == lung.side.structure());
        let (bounds, mask) = match found_lung {
            Some(lung) => (lungs.bounds, &lung.mask),
            None => (each.bounds, &each.mask),
        };
        let target = match each.structure.tissue {
            SurfaceTissue::Skin => sizes.skin,
            SurfaceTissue::Lung => sizes.lung,
            SurfaceTissue::Bone => sizes.bone,
            _ => sizes.other,
        };
        jobs.push(Job {
            name: each.structure.name.clone(),
            tissue: each.structure.tissue,
            organ: None,
            bounds,
            mask,
            runs: Runs::Mask,
            target,
            cell_m: SMALL_CELL_M,
            lesion: None,
            fine: None,
        });
    }
    for (number, lesion) in lesions.iter().enumerate() {
        jobs.push(Job {
            name: lesion.name.clone(),
            tissue: SurfaceTissue::Lesion,
            organ: organ_of(found, lesion),
            bounds: IndexBox::whole(lesion.fine.grid.size()),
            mask: &lesion.fine_mask,
            runs: lesion.level_hu.map_or(Runs::Mask, |level_hu| {
                let inside = f32::from(lesion.median_hu);
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "half-integers of HU are exact"
                )]
                let outside = 2.0 * level_hu as f32 - inside;
                Runs::At {
                    level_hu,
                    typical: [inside, outside],
                }
            }),
            target: sizes.other,
            cell_m: SMALL_CELL_M,
            lesion: Some((number, lesion)),
            fine: Some(&lesion.fine),
        });
    }
    jobs.sort_by_key(|job| match job.tissue {
        SurfaceTissue::Skin => 0,
        SurfaceTissue::Beside => 2,
        _ => 1,
    });
    jobs
}

fn organ_of(found: &Segmentation, lesion: &Lesion) -> Option<String> {
    let shares = found.lungs.lungs.iter().map(|lung| {
        let mut whole = Mask::empty(found.body.mask.size());
        whole.unite_within(&found.lungs.bounds, &lung.mask);
        let mut part = whole.cropped(&lesion.bounds);
        part.intersect(&lesion.mask);
        (part.count(), lung.side)
    });
    let (count, side) = shares.max_by_key(|(count, _)| *count)?;
    (2 * count > lesion.mask.count()).then(|| side.structure().to_owned())
}

/// A surface and what was measured on the fine one.
struct Made {
    surface: Surface,
    size: Option<LesionSize>,
}

/// All surfaces, on so many threads; the largest first.
fn make_all(
    volume: &Volume,
    jobs: &[Job<'_>],
    threads: usize,
    cancel: &AtomicBool,
    progress: Progress<'_>,
) -> Result<Vec<Option<Made>>, VolumeError> {
    let begun = AtomicUsize::new(0);
    let made = in_parallel(threads, jobs, |job| {
        begun.fetch_add(1, Ordering::Relaxed);
        let made = make(volume, job, cancel);
        let share = begun.load(Ordering::Relaxed) as f64 / jobs.len() as f64;
        progress(&format!("surface of {}", job.name), 0.4 + 0.5 * share);
        made
    });
    made.into_iter().collect()
}

fn make(scan: &Volume, job: &Job<'_>, cancel: &AtomicBool) -> Result<Option<Made>, VolumeError> {
    if cancel.load(Ordering::Relaxed) {
        return Err(VolumeError::Interrupted);
    }
    let volume = job.fine.unwrap_or(scan);
    let grid = &volume.grid;
    let sharp = match job.runs {
        Runs::BoneMiddle => at_middles(volume, &job.bounds),
        _ => None,
    };
    let hu = sharp.as_deref().unwrap_or(&volume.hu);
    let levels = match job.runs {
        Runs::BoneMiddle => local_level(hu, grid, job.mask, &job.bounds, |hu| hu > SOFT_FROM_HU),
        _ => None,
    };
    let refined = levels
        .as_ref()
        .map(|levels| refine(hu, grid, job.mask, &job.bounds, levels));
    let hounsfield = |level, typical| Values::Hounsfield {
        hu,
        size: grid.size(),
        level,
        typical,
    };
    #[expect(
        clippy::cast_possible_truncation,
        reason = "half-integers of HU are exact"
    )]
    let (values, level_hu) = match (&job.runs, &levels) {
        (Runs::At { level_hu, typical }, _) => (
            hounsfield(Level::Everywhere(*level_hu as f32), *typical),
            Some(*level_hu),
        ),
        (Runs::BoneMiddle, Some(levels)) => (
            hounsfield(Level::Local(levels), [DENSE, SOFT]),
            levels.median(),
        ),
        (Runs::BoneMiddle | Runs::Mask, _) => (Values::MaskOnly, None),
    };
    let field = Field {
        bounds: job.bounds,
        inside: refined.as_ref().unwrap_or(job.mask),
        values,
    };
    let stride = grid
        .spacing_m()
        .map(|step| whole(job.cell_m / step).clamp(1, 4));
    let fine = surface_net(&field, grid, stride);
    if fine.triangles.is_empty() {
        return Ok(None);
    }
    let mut coarse = sound(simplify(&fine, job.target, MEAN_ERROR_M));
    if cancel.load(Ordering::Relaxed) {
        return Err(VolumeError::Interrupted);
    }
    let mut checked = check_closed(&coarse);
    if matches!(checked, Err(MeshDefect::Inverted { .. })) {
        coarse = without_inverted_parts(&coarse);
        checked = check_closed(&coarse);
    }
    let facts = checked.map_err(|defect| {
        VolumeError::refused(format!("its surface does not enclose a solid: {defect}"))
            .at(job.name.clone())
    })?;
    let index = SurfaceIndex::new(coarse);
    let Some(error) = surface_error(&field, grid, &index) else {
        return Ok(None);
    };
    let size = job
        .lesion
        .map(|(_, lesion)| size_of(&fine, grid, centre_covariance_m2(scan, lesion)));
    Ok(Some(Made {
        surface: Surface {
            name: job.name.clone(),
            tissue: job.tissue,
            organ: job.organ.clone(),
            mesh: index.mesh().clone(),
            level_hu,
            error,
            volume_m3: facts.volume_m3,
            triangles_before: fine.triangles.len(),
        },
        size,
    }))
}

/// Farthest that a corner may be outside the reduced skin, m: within what `[[phantom.parts]]` takes for roughness.
const OUTSIDE_SKIN_M: f64 = 0.8e-3;

/// Farthest that a corner is moved, m: what the skin's and its own reduction may be apart. More is not theirs.
const FARTHEST_BACK_M: f64 = 3e-3;

/// Moves corners of other surfaces that the reduced skin leaves far outside back towards it. A surface that would not stay
/// sound is left as it is.
fn keep_within_skin(surfaces: &mut [Surface], remarks: &mut Vec<Remark>) {
    let Some(skin) = skin_of(surfaces).map(|surface| SurfaceIndex::new(surface.mesh.clone()))
    else {
        return;
    };
    for surface in surfaces {
        if matches!(surface.tissue, SurfaceTissue::Skin | SurfaceTissue::Beside) {
            continue;
        }
        let mut mesh = surface.mesh.clone();
        let (mut moved, mut farthest_m) = (0_usize, 0.0_f64);
        for corner in &mut mesh.vertices_m {
            if skin.contains(corner) {
                continue;
            }
            let way = skin.nearest(corner) - *corner;
            let outside_m = way.norm();
            if outside_m > OUTSIDE_SKIN_M && outside_m <= FARTHEST_BACK_M {
                *corner += way * (1.0 - OUTSIDE_SKIN_M / outside_m);
                moved += 1;
                farthest_m = farthest_m.max(outside_m);
            }
        }
        if moved > 0 && check_closed(&mesh).is_ok() {
            surface.mesh = mesh;
            remarks.push(
                Remark::new(format!(
                    "{moved} vertices of its surface, up to {:.2} mm outside the reduced skin, \
                     were moved back towards it",
                    1e3 * farthest_m
                ))
                .at(surface.name.clone()),
            );
        }
    }
}

/// Surfaces, and the sizes of lesions in their order.
fn sort(
    made: Vec<Option<Made>>,
    jobs: &[Job<'_>],
    lesions: usize,
    remarks: &mut Vec<Remark>,
) -> (Vec<Surface>, Vec<Option<LesionSize>>) {
    let mut surfaces = Vec::new();
    let mut sizes = vec![None; lesions];
    let (mut coarse, mut stepped) = (Vec::new(), Vec::new());
    for (made, job) in made.into_iter().zip(jobs) {
        let Some(Made { surface, size }) = made else {
            remarks.push(
                Remark::new("it has no surface: it is thinner than the voxels")
                    .at(job.name.clone()),
            );
            continue;
        };
        if surface.error.p99_m > SURFACE_ERROR_M {
            coarse.push(format!(
                "{} {:.2} mm with {} triangles",
                job.name,
                1e3 * surface.error.p99_m,
                surface.mesh.triangles.len()
            ));
        }
        if surface.level_hu.is_none() {
            stepped.push(job.name.as_str());
        }
        if let (Some((number, _)), Some(size)) = (job.lesion, size) {
            sizes[number] = Some(size);
        }
        surfaces.push(surface);
    }
    if !coarse.is_empty() {
        remarks.push(Remark::new(format!(
            "P99 distance from the voxel surface above the goal of {:.2} mm: {}",
            1e3 * SURFACE_ERROR_M,
            coarse.join(", ")
        )));
    }
    if !stepped.is_empty() {
        remarks.push(Remark::new(format!(
            "surfaces from a voxel mask, accurate to half a voxel: {}",
            stepped.join(", ")
        )));
    }
    (surfaces, sizes)
}

/// Points that are compared in pairs, at most.
const PAIRED: usize = 2000;

/// Longest distance between points, and the two.
fn longest(points: &[Point3<f64>]) -> (f64, [Point3<f64>; 2]) {
    let some: Vec<Point3<f64>> = points
        .iter()
        .step_by(points.len().div_ceil(PAIRED).max(1))
        .copied()
        .collect();
    let mut best = (0.0, [Point3::origin(); 2]);
    for (at, a) in some.iter().enumerate() {
        for b in &some[at + 1..] {
            let squared = (a - b).norm_squared();
            if squared > best.0 {
                best = (squared, [*a, *b]);
            }
        }
    }
    (best.0.sqrt(), best.1)
}

fn size_of(mesh: &TriangleMesh, grid: &VoxelGrid, covariance_m2: Matrix3<f64>) -> LesionSize {
    let volume_m3 = volume_m3(mesh);
    let mut slices: BTreeMap<i64, Vec<Point3<f64>>> = BTreeMap::new();
    for vertex in &mesh.vertices_m {
        #[expect(clippy::cast_possible_truncation, reason = "a slice's number")]
        let slice = grid.index_from_ct(vertex).z.round() as i64;
        slices.entry(slice).or_default().push(*vertex);
    }
    let normal = grid.steps_m().column(2).normalize();
    let in_slices = slices.values().map(|points| {
        // In the plane of the slice.
        let flat: Vec<Point3<f64>> = points
            .iter()
            .map(|p| p - normal * normal.dot(&p.coords))
            .collect();
        (longest(&flat), flat)
    });
    let longest_in_slice = in_slices.max_by(|(a, _), (b, _)| a.0.total_cmp(&b.0));
    let (axial_longest_m, axial_width_m) =
        longest_in_slice.map_or((0.0, 0.0), |((length_m, [a, b]), flat)| {
            let across = normal.cross(&(b - a)).normalize();
            let places = flat.iter().map(|p| across.dot(&p.coords));
            let (low, high) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
                (low.min(at), high.max(at))
            });
            (length_m, high - low)
        });
    LesionSize {
        volume_m3,
        equivalent_diameter_m: libm::cbrt(6.0 * volume_m3.max(0.0) / std::f64::consts::PI),
        longest_m: longest(&mesh.vertices_m).0,
        axial_longest_m,
        axial_width_m,
        centroid_m: needlebench_geometry::mesh::centroid_m(mesh),
        centroid_covariance_m2: covariance_m2,
    }
}

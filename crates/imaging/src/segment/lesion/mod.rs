//! Lesions grown from a point inside.

mod accuracy;
mod grower;
mod local;
mod outlined;
mod spread;

use std::sync::atomic::AtomicBool;

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_volume::{NotAGrid, Remark, Volume, VolumeError};

use crate::mask::{IndexBox, Mask};
use crate::spacing::{orthogonal, whole};

use super::{Scan, Segmentation};
pub(crate) use accuracy::centre_covariance_m2;
use grower::{Grower, Grown, USUAL};
use local::Local;

/// How far from its seed a lesion may reach, m: the least that holds it is taken, for the time that a large one takes.
const REACHES_M: [f64; 3] = [35e-3, 70e-3, 120e-3];

/// The wall of the lung is carried on across a lesion by a ball of this radius: a lesion of 20 mm that touches the
/// wall loses a cap of 2 mm at most.
/// A larger one is taken for a seed beyond that.
const WALL_RADII_M: [f64; 3] = [25e-3, 50e-3, 90e-3];

/// That ball is at least so many times as large as the one in the lesion,
const WALL_SHARE: f64 = 2.5;

/// and at most so large, m: the chest is not flatter.
const MOST_WALL_M: f64 = 90e-3;

/// Voxels around a lesion that its surface is made in.
const MARGIN: usize = 3;

/// Where a lesion is, pointed at by a person.
#[derive(Debug, Clone, PartialEq)]
pub struct LesionSeed {
    /// What it is called.
    pub name: String,
    /// A point inside, in `ct`, m.
    pub point_m: Point3<f64>,
}

/// A lesion.
#[derive(Debug, Clone)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "facts that do not depend on each other"
)]
pub struct Lesion {
    /// What it is called.
    pub name: String,
    /// The box that the mask covers.
    pub bounds: IndexBox,
    /// Its voxels.
    pub mask: Mask,
    /// Whether it is in the lung.
    pub in_lung: bool,
    /// Its median, HU.
    pub median_hu: i16,
    /// Where its surface is: the middle between it and what is around it. Half-integer; none where a label map has its
    /// outline.
    pub level_hu: Option<f64>,
    /// Radius of the largest ball inside it, to half a voxel, m; of the ball of its volume where a label map has its
    /// outline.
    pub inscribed_radius_m: f64,
    /// Whether it was cut where it meets the wall of the lung.
    pub cut_at_wall: bool,
    /// Whether it was cut where vessels leave it.
    pub cut_at_vessels: bool,
    /// Whether it ran into what is around it and was bounded by a ball: its size is not known then.
    pub leaked: bool,
    /// What is around it, with slices in between: thick slices do not show where a vessel leaves it.
    pub(crate) fine: Volume,
    /// Its voxels there.
    pub(crate) fine_mask: Mask,
    /// How far its centroid moves from one way to bound it to another, as a covariance in `ct`, m^2.
    pub(crate) spread_m2: Matrix3<f64>,
}

/// Grows a lesion from a point inside.
///
/// # Errors
/// If the point is outside the body or in air, or nothing sets the lesion apart from what is around it.
pub(crate) fn grow_lesion(
    volume: &Volume,
    found: &Segmentation,
    seed: &LesionSeed,
    cancel: &AtomicBool,
    remarks: &mut Vec<Remark>,
) -> Result<Lesion, VolumeError> {
    let scan = Scan {
        volume,
        spacing_m: orthogonal(&volume.grid)?,
        levels: super::Levels::default(),
        cancel,
    };
    grow(&scan, found, seed, remarks).map_err(|error| error.at(place(seed)))
}

fn place(seed: &LesionSeed) -> String {
    let mm = seed.point_m * 1e3;
    format!(
        "lesion `{}` at [{:.1}, {:.1}, {:.1}] mm",
        seed.name, mm.x, mm.y, mm.z
    )
}

/// The voxel of a seed.
fn voxel_of(
    scan: &Scan<'_>,
    found: &Segmentation,
    seed: &LesionSeed,
) -> Result<[usize; 3], VolumeError> {
    let hint = "points are in millimetres, in the patient's LPS frame";
    let index = scan.volume.grid.index_from_ct(&seed.point_m);
    let size = scan.size();
    let inside = |axis: usize| (-0.5..size[axis] as f64 - 0.5).contains(&index[axis]);
    if !(0..3).all(inside) {
        return Err(VolumeError::refused("the point is outside the volume").hint(hint));
    }
    let voxel = [0, 1, 2].map(|axis| whole(index[axis].round()).min(size[axis] - 1));
    if !found.body.mask.get(voxel) {
        return Err(VolumeError::refused("the point is outside the body").hint(hint));
    }
    Ok(voxel)
}

fn not_a_grid(error: &NotAGrid) -> VolumeError {
    VolumeError::refused(error.to_string())
}

fn grow(
    scan: &Scan<'_>,
    found: &Segmentation,
    seed: &LesionSeed,
    remarks: &mut Vec<Remark>,
) -> Result<Lesion, VolumeError> {
    let voxel = voxel_of(scan, found, seed)?;
    let mut reaches = REACHES_M.into_iter().peekable();
    let mut refused = None;
    loop {
        let reach_m = reaches.next().unwrap_or(REACHES_M[0]);
        let (lesion, goes_on) = match within(scan, found, seed, voxel, reach_m) {
            Ok(lesion) => lesion,
            Err(VolumeError::Interrupted) => return Err(VolumeError::Interrupted),
            Err(error) => {
                // A mass that fills the box has nothing around it there.
                let first = refused.get_or_insert(error);
                if reaches.peek().is_some() {
                    continue;
                }
                return Err(first.clone());
            }
        };
        if let Some(error) = refused.take_if(|_| lesion.leaked || !lesion.in_lung) {
            return Err(error);
        }
        if !goes_on || reaches.peek().is_none() {
            check_at_seed(scan, &lesion, seed)?;
            if lesion.leaked {
                remarks.push(
                    Remark::new(format!(
                        "it merges with its surroundings at {} HU: limited to a sphere of \
                         {:.0} mm; its size is unknown",
                        lesion.level_hu.unwrap_or_default(),
                        4e3 * lesion.inscribed_radius_m
                    ))
                    .at(place(seed)),
                );
            }
            return Ok(lesion);
        }
    }
}

/// Farthest that a lesion may begin from the point that a person set in it, m (assumed): where a wall or vessels are cut off,
/// what is left may be something else along the wall.
const FARTHEST_FROM_SEED_M: f64 = 5e-3;

/// Refuses a lesion that is not where the point is.
fn check_at_seed(scan: &Scan<'_>, lesion: &Lesion, seed: &LesionSeed) -> Result<(), VolumeError> {
    let at = scan.volume.grid.index_from_ct(&seed.point_m);
    // To the voxel's nearer side.
    let from_seed_m = lesion.mask.voxels().map(|voxel| {
        let apart_m = [0, 1, 2].map(|axis| {
            let apart = (voxel[axis] + lesion.bounds.first[axis]) as f64 - at[axis];
            (apart.abs() - 0.5).max(0.0) * scan.spacing_m[axis]
        });
        Vector3::from(apart_m).norm()
    });
    let nearest_m = from_seed_m.fold(f64::INFINITY, f64::min);
    if nearest_m <= FARTHEST_FROM_SEED_M {
        return Ok(());
    }
    Err(VolumeError::refused(format!(
        "what is left of it without wall and vessels begins {:.1} mm from the point",
        1e3 * nearest_m
    ))
    .hint("set the point at the centre of the lesion, or use a label map for its outline"))
}

/// A lesion of a box within the smallest hull of a lung that has its seed, and the radius of the ball that made the hull.
/// One that no hull holds, or that leaks in all but the usual one, is in no lung.
fn bounded<'a>(
    scan: &Scan<'a>,
    found: &Segmentation,
    local: &'a Local,
    at: [usize; 3],
) -> Result<(Grower<'a>, Grown, Option<Mask>, f64), VolumeError> {
    for wall_m in WALL_RADII_M {
        let hull = local.lung_hull(scan, found, at, wall_m);
        let Some(lung_hu) = found.lungs.air_hu.filter(|_| hull.is_some()) else {
            continue;
        };
        let is_usual = wall_m <= WALL_RADII_M[0];
        let grower = match Grower::new(scan, local, at, Some(lung_hu)) {
            Ok(grower) => grower,
            Err(error) if is_usual => return Err(error),
            Err(_) => continue,
        };
        let grown = grower.grow(hull.as_ref(), USUAL)?;
        if is_usual || !grown.leaked {
            return Ok((grower, grown, hull, wall_m));
        }
    }
    let grower = Grower::new(scan, local, at, None)?;
    let grown = grower.grow(None, USUAL)?;
    Ok((grower, grown, None, WALL_RADII_M[0]))
}

/// The lesion as far as a reach, and whether it goes on there.
fn within(
    scan: &Scan<'_>,
    found: &Segmentation,
    seed: &LesionSeed,
    voxel: [usize; 3],
    reach_m: f64,
) -> Result<(Lesion, bool), VolumeError> {
    let reach = [0, 1, 2].map(|axis| scan.voxels_across(reach_m, axis) + 1);
    let bounds = IndexBox {
        first: voxel,
        last: voxel,
    }
    .widened(reach, scan.size());
    let local = Local::new(scan, found, bounds).map_err(|error| not_a_grid(&error))?;
    let mut at = [0, 1, 2].map(|axis| voxel[axis] - bounds.first[axis]);
    at[2] *= local.parts;
    let (grower, mut grown, mut hull, mut wall_m) = bounded(scan, found, &local, at)?;
    while grown.cut_at_wall && wall_m < (WALL_SHARE * grown.radius_m).min(MOST_WALL_M) {
        // A cap of a large lesion would be taken for wall.
        wall_m = (WALL_SHARE * grown.radius_m).min(MOST_WALL_M);
        hull = local.lung_hull(scan, found, at, wall_m);
        grown = grower.grow(hull.as_ref(), USUAL)?;
    }
    let wider = if grown.cut_at_wall {
        local.lung_hull(scan, found, at, 1.5 * wall_m)
    } else {
        None
    };
    let spread_m2 = spread::of(&grower, &local, &grown, hull.as_ref(), wider.as_ref())?;
    let (fine, fine_mask) = local
        .cropped(&grown.mask, MARGIN)
        .map_err(|error| not_a_grid(&error))?;
    let lesion = Lesion {
        name: seed.name.clone(),
        bounds,
        mask: local.in_scan(&grown.mask),
        in_lung: grower.in_lung,
        median_hu: grower.median_hu,
        level_hu: Some(grown.level_hu),
        inscribed_radius_m: grown.radius_m,
        cut_at_wall: grown.cut_at_wall,
        cut_at_vessels: grown.cut_at_vessels,
        leaked: grown.leaked,
        fine,
        fine_mask,
        spread_m2,
    };
    Ok((lesion, grown.goes_on))
}

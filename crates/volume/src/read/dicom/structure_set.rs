//! RT structure sets as label maps: closed planar contours of structures, in patient coordinates.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::Point3;

use super::dataset::DataSet;
use super::file::OpenedFile;
use super::{DEPTH, collect, name_in, tag};
use crate::read::contours::{ContourFacts, rasterise};
use crate::read::painted::{Painted, listed, painting_order};
use crate::read::segments::{is_lesion, name_of};
use crate::read::{ReadOptions, unreadable};
use crate::{LabelMap, Remark, VolumeError, VoxelGrid};

/// The kind of object.
const SOP_CLASS: &str = "1.2.840.10008.5.1.4.1.1.481.3";
const MODALITY: &str = "RTSTRUCT";

/// Types of what is no tissue, but a margin around it, or a region of a plan.
const OF_A_PLAN: [&str; 10] = [
    "AVOIDANCE",
    "BOLUS",
    "CONTROL",
    "CTV",
    "DOSE_REGION",
    "IRRAD_VOLUME",
    "ISOCENTER",
    "PTV",
    "REGISTRATION",
    "TREATED_VOLUME",
];

/// Words of their names, where their type does not say it; numbers may follow.
const WORDS_OF_A_PLAN: [&str; 7] = ["avoid", "avoidance", "ctv", "itv", "prv", "ptv", "ring"];

/// Whether a name is that of a margin or of a region of a plan: `PTV_60`, `PRV05 cord`, `Lung-PTV`.
fn is_named_as_of_a_plan(name: &str) -> bool {
    let lower = name.to_lowercase();
    let mut words = lower.split(|c: char| !c.is_alphabetic());
    words.any(|word| WORDS_OF_A_PLAN.contains(&word))
}

/// Most structures of a set.
const MOST_STRUCTURES: usize = 4096;

/// A structure.
#[derive(Debug, Default)]
struct Roi {
    /// As the file has it.
    written: String,
    /// By which its meaning is known.
    name: String,
    frame: Option<String>,
    contours: Vec<Vec<Point3<f64>>>,
    /// Points and open lines.
    others: usize,
}

/// The structure set at a path; none where there is none.
pub(super) fn open(
    path: &Path,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<Option<OpenedFile>, VolumeError> {
    let mut files = Vec::new();
    if path.is_dir() {
        collect(path, DEPTH, &mut files)?;
        files.sort();
    } else {
        files.push(path.to_owned());
    }
    let mut found = None;
    let (mut structures, mut segmentations) = (Vec::new(), Vec::new());
    for file in files {
        if cancel.load(Ordering::Relaxed) {
            return Err(VolumeError::Interrupted);
        }
        // What cannot be read is answered where images are looked for.
        let Ok(Some(opened)) = OpenedFile::open(&file, options.max_bytes) else {
            continue;
        };
        let says = |tag, kind: &str| opened.data.text(tag).as_deref() == Some(kind);
        let name = name_in(path, &file);
        if !says(tag::MODALITY, MODALITY) && !says(tag::SOP_CLASS, SOP_CLASS) {
            if opened.data.text(tag::SEGMENTATION_TYPE).is_some() {
                segmentations.push(name);
            }
            continue;
        }
        structures.push(name);
        if found.replace(opened).is_some() {
            return Err(
                VolumeError::refused("the folder has several RT structure sets")
                    .hint("name one of them by its file"),
            );
        }
        let bytes = file.metadata().map_err(unreadable)?.len();
        if bytes > options.max_bytes {
            return Err(
                VolumeError::refused(format!("it has {bytes} bytes, more than allowed"))
                    .hint("raise the limit with --max-memory"),
            );
        }
    }
    if let ([first, ..], [other, ..]) = (&*structures, &*segmentations) {
        return Err(VolumeError::refused(format!(
            "the folder has an RT structure set and a segmentation: {first} and {other}"
        ))
        .hint("name one of them by its file"));
    }
    Ok(found)
}

/// Reads it onto the voxels of the CT.
pub(super) fn read(
    opened: &OpenedFile,
    grid: &VoxelGrid,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<(LabelMap, Vec<Remark>), VolumeError> {
    let (rois, of_plan) = rois(&opened.data)?;
    let mut remarks = Vec::new();
    let contours: usize = rois.iter().map(|roi| roi.contours.len()).sum();
    remarks.push(Remark::new(format!(
        "an RT structure set: {} structures, {contours} contours; a voxel is in a structure if its centre is",
        rois.len()
    )));
    if !of_plan.is_empty() {
        remarks.push(Remark::new(format!(
            "margins and regions of a treatment plan are no tissue and are ignored: {}",
            listed(&of_plan)
        )));
    }
    remarks.extend(of_another_scan(&opened.data, &rois, options));
    let names: Vec<String> = rois.iter().map(|roi| roi.name.clone()).collect();
    let mut painted = Painted::new(grid, rois.len(), options)?;
    let mut facts = vec![ContourFacts::default(); rois.len()];
    for at in painting_order(&names) {
        if cancel.load(Ordering::Relaxed) {
            return Err(VolumeError::Interrupted);
        }
        let roi = &rois[at];
        facts[at] = rasterise(&roi.contours, grid, |offset| painted.paint(offset, at))
            .map_err(|error| error.at(format!("structure `{}`", roi.written)))?;
    }
    remarks.extend(of_contours(&rois, &facts));
    let (map, of_map) = painted.finish(grid, names)?;
    remarks.extend(of_map);
    Ok((map, remarks))
}

/// Structures with their numbers, by which contours and types belong to them: each has one of its own.
fn numbered(items: &[DataSet]) -> Result<Vec<(i64, &DataSet)>, VolumeError> {
    let refused = |what: String| {
        VolumeError::refused(what)
            .at(tag::written(tag::STRUCTURES))
            .hint("export it again")
    };
    if items.len() > MOST_STRUCTURES {
        return Err(refused(format!(
            "it has {} structures, at most {MOST_STRUCTURES} are read",
            items.len()
        )));
    }
    let mut seen = BTreeMap::new();
    let mut numbered = Vec::with_capacity(items.len());
    for (at, item) in (1..).zip(items) {
        let number = item
            .integer(tag::ROI_NUMBER)
            .ok_or_else(|| refused(format!("structure {at} has no ROI Number")))?;
        if let Some(other) = seen.insert(number, at) {
            return Err(refused(format!(
                "structures {other} and {at} have the same ROI Number {number}"
            )));
        }
        numbered.push((number, item));
    }
    Ok(numbered)
}

/// Structures, and the names of those that are of a plan.
fn rois(data: &DataSet) -> Result<(Vec<Roi>, Vec<String>), VolumeError> {
    let (mut rois, mut of_plan) = (Vec::new(), Vec::new());
    for (at, (number, item)) in (1..).zip(numbered(data.items(tag::STRUCTURES))?) {
        let is_it = |item: &&DataSet| item.integer(tag::REFERENCED_ROI) == Some(number);
        let seen = data.items(tag::OBSERVATIONS).iter().find(is_it);
        let kind = seen
            .and_then(|seen| seen.text(tag::ROI_TYPE))
            .unwrap_or_default();
        let coded =
            seen.and_then(|seen| seen.items(tag::ROI_CODE).first()?.text(tag::CODE_MEANING));
        let coded = match kind.as_str() {
            // Named, and perhaps coded, by where it is: `GTV_Lung_L`.
            "GTV" => coded
                .filter(|coded| is_lesion(coded))
                .or_else(|| Some("Tumor".to_owned())),
            "EXTERNAL" => coded.or_else(|| Some("External".to_owned())),
            _ => coded,
        };
        let label = item.text(tag::ROI_NAME);
        let written = label.clone().unwrap_or_else(|| format!("structure {at}"));
        if OF_A_PLAN.contains(&kind.as_str()) || is_named_as_of_a_plan(&written) {
            of_plan.push(written);
            continue;
        }
        let mut roi = Roi {
            name: name_of(label.as_ref(), coded, None, at),
            written,
            frame: item.text(tag::REFERENCED_FRAME),
            ..Roi::default()
        };
        for contour in data.items(tag::ROI_CONTOURS).iter().filter(is_it) {
            for item in contour.items(tag::CONTOURS) {
                take(item, &mut roi)?;
            }
        }
        rois.push(roi);
    }
    if rois.is_empty() && of_plan.is_empty() {
        return Err(
            VolumeError::refused("the RT structure set has no structures")
                .at("(3006,0020)")
                .hint("export it again, with its structures"),
        );
    }
    Ok((rois, of_plan))
}

/// Takes a contour over.
fn take(item: &DataSet, roi: &mut Roi) -> Result<(), VolumeError> {
    let at = |error: VolumeError| error.at(format!("structure `{}`", roi.written));
    let kind = item.text(tag::CONTOUR_TYPE).unwrap_or_default();
    if !matches!(kind.as_str(), "CLOSED_PLANAR" | "CLOSEDPLANAR_XOR") {
        roi.others += 1;
        return Ok(());
    }
    let numbers = item
        .reals(tag::CONTOUR_DATA)
        .map_err(at)?
        .unwrap_or_default();
    let count = i64::try_from(numbers.len() / 3).unwrap_or(i64::MAX);
    let stated = item.integer(tag::CONTOUR_POINTS).unwrap_or(count);
    if numbers.len() % 3 != 0 || stated != count {
        return Err(at(VolumeError::refused(format!(
            "a contour states {stated} points and has {} numbers",
            numbers.len()
        ))
        .hint("export it again")));
    }
    if count < 3 {
        roi.others += 1;
        return Ok(());
    }
    let points = numbers.chunks_exact(3);
    let points = points.map(|mm| Point3::new(mm[0], mm[1], mm[2]) / 1e3);
    roi.contours.push(points.collect());
    Ok(())
}

/// That the structures were drawn on another scan, as far as both say it.
fn of_another_scan(data: &DataSet, rois: &[Roi], options: &ReadOptions) -> Option<Remark> {
    let scan = &options.scan;
    let frames = data.items(tag::REFERENCED_FRAMES);
    if let Some(wanted) = &scan.frame_of_reference {
        let of_set: Vec<String> = frames
            .iter()
            .filter_map(|it| it.text(tag::FRAME_OF_REFERENCE))
            .collect();
        let of_rois = rois.iter().filter_map(|roi| roi.frame.clone());
        let mut all = of_set.into_iter().chain(of_rois).peekable();
        if all.peek().is_some() && all.any(|frame| frame != *wanted) {
            return Some(Remark::new(
                "structures are in another frame of reference than the scan: their places are right only if both are \
                 registered to each other",
            ));
        }
    }
    let wanted = scan.series_uid.as_ref()?;
    let studies = frames
        .iter()
        .flat_map(|it| it.items(tag::REFERENCED_STUDIES));
    let series = studies.flat_map(|it| it.items(tag::REFERENCED_SERIES));
    let mut series = series.filter_map(|it| it.text(tag::SERIES_UID)).peekable();
    (series.peek().is_some() && series.all(|uid| uid != *wanted)).then(|| {
        Remark::new("structures were drawn on another series of the scan's frame of reference")
    })
}

/// What is worth knowing of the contours.
fn of_contours(rois: &[Roi], facts: &[ContourFacts]) -> Vec<Remark> {
    let mut remarks = Vec::new();
    let mut say = |counts: &dyn Fn(&Roi, &ContourFacts) -> usize,
                   words: &dyn Fn(String) -> String| {
        let with = rois
            .iter()
            .zip(facts)
            .map(|(roi, facts)| (counts(roi, facts), roi));
        let names: Vec<String> = with
            .filter(|(count, _)| *count > 0)
            .map(|(count, roi)| format!("{} ({count})", roi.written))
            .collect();
        if !names.is_empty() {
            remarks.push(Remark::new(words(listed(&names))));
        }
    };
    say(&|roi, _| roi.others, &|names| {
        format!("points and open lines are no areas and are ignored: {names}")
    });
    say(&|_, facts| facts.outside, &|names| {
        format!("contours outside of the volume are ignored: {names}")
    });
    say(&|_, facts| facts.filled, &|names| {
        format!(
            "contours are farther apart than slices: slices without one, within half of that distance, have the \
             nearest one: {names}"
        )
    });
    say(&|_, facts| facts.gaps, &|names| {
        format!("slices without a contour between others are gaps: {names}")
    });
    say(&|_, facts| facts.repeated, &|names| {
        format!("contours that were there before are ignored: {names}")
    });
    let farthest_m = facts
        .iter()
        .map(|each| each.off_slice_m)
        .fold(0.0, f64::max);
    if farthest_m > 0.0 {
        let is_off = |(_, facts): &(&Roi, &ContourFacts)| facts.off_slice_m > 0.0;
        let names = rois.iter().zip(facts).filter(is_off);
        let names: Vec<String> = names.map(|(roi, _)| roi.written.clone()).collect();
        remarks.push(Remark::new(format!(
            "contours lie between slices, up to {:.2} mm from the nearest one, which has them: {}",
            1e3 * farthest_m,
            listed(&names)
        )));
    }
    remarks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_of_a_plan_are_known_by_words_of_their_names() {
        for name in [
            "PTV_60",
            "ptv2",
            "CTV Lung_L",
            "ITV",
            "PRV05",
            "SpinalCord_PRV05",
            "Ring 3 liver",
            "Lung_L-PTV",
            "Avoid heart",
            "avoidance1",
        ] {
            assert!(is_named_as_of_a_plan(name), "{name}");
        }
        for name in ["Lung_L", "GTV_1", "Heart", "String", "Cricoid", "Tumor"] {
            assert!(!is_named_as_of_a_plan(name), "{name}");
        }
    }
}

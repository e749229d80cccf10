//! DICOM: one file, all files of a folder and its folders, or those that a DICOMDIR names.
//!
//! The elements that are needed are read by a reader of our own, which skips all others unread and holds each length
//! against the file; pixels are decoded by dicom-rs.

mod caught;
mod dataset;
mod directory;
mod file;
mod image;
mod jpeg_ls;
mod pixels;
mod segmentation;
mod series;
mod stack;
mod structure_set;
mod syntax;
mod tag;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use self::directory::Directory;
use self::file::OpenedFile;
use self::image::{Slice, named, slices};
use self::stack::Stack;
use super::labelled::ReadLabels;
use super::placing::within_reason;
use super::{Description, ReadOptions, ReadVolume, ScanIdentity, plausibility};
use crate::{Remark, Volume, VolumeError, VoxelGrid};

pub(super) use file::{FIRST_BYTES, has_mark, is_dicom};

/// Folders within folders, as exports have them: patient, study, series.
const DEPTH: usize = 8;

/// Files that a folder may hold.
const FILES: usize = 200_000;

/// Difference in degrees between the tilt that the positions have and that of the header, which is worth a remark.
const TILT_DEG: f64 = 0.5;

/// Slices of a scan overlap by half, or by two thirds: with more they are slabs made of thinner ones.
const OVERLAP: f64 = 3.01;

/// Reads a segmentation or an RT structure set of the CT on `grid`.
pub(super) fn read_labels(
    path: &Path,
    grid: &VoxelGrid,
    options: &ReadOptions,
    cancel: &AtomicBool,
) -> Result<ReadLabels, VolumeError> {
    let structures = structure_set::open(path, options, cancel)?;
    let is_numbered_here = structures.is_some();
    let (labels, remarks) = match structures {
        Some(opened) => structure_set::read(&opened, grid, options, cancel),
        None => segmentation::read(path, grid, options, cancel),
    }?;
    Ok(ReadLabels {
        labels,
        remarks,
        is_numbered_here,
    })
}

/// What was found at a path.
struct Found {
    slices: Vec<Slice>,
    /// Files that are DICOM, and could not be read, with why.
    broken: Vec<VolumeError>,
    others: usize,
    /// Of the others, those without a byte.
    empty: Vec<String>,
    remarks: Vec<Remark>,
}

pub(super) fn read(
    path: &Path,
    options: &ReadOptions,
    threads: usize,
    cancel: &AtomicBool,
) -> Result<ReadVolume, VolumeError> {
    let Found {
        slices,
        mut broken,
        others,
        empty,
        remarks: mut found_remarks,
    } = find(path, options, cancel)?;
    if slices.is_empty() {
        return Err(if broken.is_empty() {
            without_images(path, others, empty.len())
        } else {
            broken.swap_remove(0)
        });
    }
    let (series, mut remarks) = series::choose(series::all(slices), options.series.as_deref())?;
    remarks.append(&mut found_remarks);
    if let Some(problem) = broken.first() {
        // Which series it was of is not known: it may be the missing slice.
        return Err(VolumeError::refused(format!(
            "{} of the files cannot be read; {}",
            broken.len(),
            problem
        ))
        .at(place_of(problem))
        .hint("copy or export it again, or remove it from the folder"));
    }
    remarks.extend(check_empty(&empty, &series.slices)?);
    let label = series.label.clone();
    let stack = stack::stack(series.slices, options.fill_gaps)?;
    remarks.extend(header_remarks(&stack));
    within_reason(&stack.grid, None, &mut remarks)?;
    let measured = stack.slices.len().max(stack.sources.len()) as u64;
    let plane = (stack.grid.size()[0] * stack.grid.size()[1]) as u64;
    let copies = if stack.sources.len() == stack.slices.len() {
        1
    } else {
        2
    };
    options.check_memory(
        &stack.grid,
        plane * measured * size_of::<i16>() as u64 * copies,
    )?;
    pixels::check(&stack.slices)?;
    let (hu, tally) = pixels::hu(&stack.slices, &stack.sources, options, threads, cancel)?;
    remarks.extend(loss_remarks(&stack.slices));
    let description = description(&stack, label, tally.padding);
    let volume = Volume {
        grid: stack.grid,
        hu,
        slice_thickness_m: stack.slices[0].thickness_mm.map(|mm| mm / 1e3),
    };
    remarks.extend(stack.remarks);
    remarks.extend(plausibility::remarks(&volume, &tally));
    Ok(ReadVolume {
        volume,
        remarks,
        description,
    })
}

fn without_images(path: &Path, files: usize, empty: usize) -> VolumeError {
    if empty > 0 && empty == files {
        return VolumeError::refused(format!("all {files} files are empty (0 bytes)"))
            .hint("copy or export them again");
    }
    let what = match (path.is_dir(), files) {
        (false, _) => "it is DICOM, but not an image".to_owned(),
        (true, 0) => "the folder is empty".to_owned(),
        (true, files) => format!("none of its {files} files is a DICOM image"),
    };
    VolumeError::refused(what)
        .hint("name a folder with the DICOM files of a scan, or a .nii or .nii.gz file")
}

/// Refuses files without a byte that are called as the slices in the same folder are; else remarks on them.
fn check_empty(empty: &[String], slices: &[Slice]) -> Result<Option<Remark>, VolumeError> {
    let Some(first) = empty.first() else {
        return Ok(None);
    };
    let in_folder = |name: &str| {
        let path = Path::new(name);
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        (path.parent().map(Path::to_owned), without_digits(&file))
    };
    let named: BTreeSet<_> = slices
        .iter()
        .map(|slice| in_folder(&slice.file.name))
        .collect();
    let mut like_slices = empty.iter().filter(|name| named.contains(&in_folder(name)));
    if let Some(first) = like_slices.next() {
        return Err(VolumeError::refused(format!(
            "{} of the files are empty (0 bytes) and named like the slices: slices are missing",
            1 + like_slices.count()
        ))
        .at(first.clone())
        .hint("copy or export the series again"));
    }
    let message = format!("{} files are empty (0 bytes): ignored", empty.len());
    Ok(Some(Remark::new(message).at(first.clone())))
}

/// A name with one mark for each of its numbers.
fn without_digits(name: &str) -> String {
    let mut plain = String::new();
    for letter in name.chars() {
        if !letter.is_ascii_digit() {
            plain.push(letter);
        } else if !plain.ends_with('#') {
            plain.push('#');
        }
    }
    plain
}

fn place_of(problem: &VolumeError) -> String {
    match problem {
        VolumeError::Refused {
            place: Some(place), ..
        } => place.clone(),
        _ => String::new(),
    }
}

/// All slices of the files at a path.
fn find(path: &Path, options: &ReadOptions, cancel: &AtomicBool) -> Result<Found, VolumeError> {
    let mut found = Found {
        slices: Vec::new(),
        broken: Vec::new(),
        others: 0,
        empty: Vec::new(),
        remarks: Vec::new(),
    };
    let mut files = Vec::new();
    let mut folder = path;
    if path.is_dir() {
        collect(path, DEPTH, &mut files)?;
        files.sort();
    } else if let Some(directory) = directory_at(path, options) {
        directory.check()?;
        found.remarks.extend(directory.remark(&name_in(path, path)));
        files = directory.files;
        folder = path.parent().unwrap_or(path);
    } else {
        files.push(path.to_owned());
    }
    for file in files {
        if cancel.load(Ordering::Relaxed) {
            return Err(VolumeError::Interrupted);
        }
        let name = name_in(folder, &file);
        let opened = OpenedFile::open(&file, options.max_bytes);
        if let Ok(Some(opened)) = &opened
            && let Some(directory) = Directory::of(opened, &file)
        {
            found.remarks.extend(directory.remark(&name));
        }
        match opened.map(|opened| opened.map(|opened| slices(opened, &file, &name))) {
            Ok(None) => {
                found.others += 1;
                if file.metadata().is_ok_and(|file| file.len() == 0) {
                    found.empty.push(name);
                }
            }
            Ok(Some(Ok(slices))) if slices.is_empty() => found.others += 1,
            Ok(Some(Ok(slices))) => found.slices.extend(slices),
            Ok(Some(Err(problem))) => found.broken.push(problem),
            Err(problem) => found.broken.push(named(problem, &name)),
        }
    }
    Ok(found)
}

/// The index of a disc that a file is; none of any other.
fn directory_at(path: &Path, options: &ReadOptions) -> Option<Directory> {
    // What is wrong with another file says itself when it is read.
    let opened = OpenedFile::open(path, options.max_bytes).ok()??;
    Directory::of(&opened, path)
}

/// A file for people: by the folders that lead to it.
fn name_in(folder: &Path, file: &Path) -> String {
    match file.strip_prefix(folder) {
        Ok(inner) if inner.components().next().is_some() => inner.display().to_string(),
        _ => file
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
    }
}

/// Files of a folder and its folders. Links to folders are not followed: they may lead in circles.
fn collect(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<(), VolumeError> {
    let unreadable =
        |error: std::io::Error| super::unreadable(error).at(folder.display().to_string());
    for entry in folder.read_dir().map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let kind = entry.file_type().map_err(unreadable)?;
        let path = entry.path();
        if kind.is_dir() && depth > 0 {
            collect(&path, depth - 1, files)?;
        } else if kind.is_file() || kind.is_symlink() && path.is_file() {
            files.push(path);
        }
        if files.len() > FILES {
            return Err(
                VolumeError::refused(format!("it holds more than {FILES} files"))
                    .hint("name the folder of one study or series"),
            );
        }
    }
    Ok(())
}

/// The first slice of some, and how many they are.
fn first_with<'s>(
    slices: &'s [Slice],
    is_odd: &dyn Fn(&Slice) -> bool,
) -> Option<(&'s Slice, usize)> {
    let odd = slices.iter().filter(|slice| is_odd(slice));
    let count = odd.clone().count();
    odd.into_iter().next().map(|slice| (slice, count))
}

/// Whether pixels were compressed with loss, as headers and the streams of decoded pixels say it.
fn loss_remarks(slices: &[Slice]) -> Vec<Remark> {
    let mut remarks = Vec::new();
    let is_lossy =
        |slice: &Slice| slice.file.is_lossy || slice.file.has_lossy_stream.load(Ordering::Relaxed);
    if let Some((slice, count)) = first_with(slices, &is_lossy) {
        let message =
            format!("{count} slices were compressed with loss: HU differ from the measured ones");
        remarks.push(Remark::new(message).at(&*slice.file.name));
    }
    if let Some((slice, count)) = first_with(slices, &|slice| slice.file.may_be_lossy) {
        let message = format!(
            "{count} slices may have been compressed with loss: their compression allows it, and \
             the file does not state it"
        );
        remarks.push(Remark::new(message).at(&*slice.file.name));
    }
    remarks
}

/// What is odd in the headers of slices.
fn header_remarks(stack: &Stack) -> Vec<Remark> {
    let mut remarks = Vec::new();
    let first_with = |is_odd: &dyn Fn(&Slice) -> bool| first_with(&stack.slices, is_odd);
    if let Some((slice, _)) = first_with(&|slice| slice.file.assumed.is_some()) {
        remarks.push(Remark::new(slice.file.assumed.unwrap_or_default()).at(&*slice.file.name));
    }
    if let Some((slice, count)) = first_with(&|slice| !slice.has_rescale) {
        let message = format!(
            "{count} slices have no slope and intercept: their stored values are used as HU"
        );
        remarks.push(Remark::new(message).at(&*slice.file.name));
    }
    if let Some((slice, _)) = first_with(&|slice| slice.rescale_type.is_some()) {
        let kind = slice.rescale_type.as_deref().unwrap_or_default();
        remarks
            .push(Remark::new(format!("the stated unit is {kind}, not HU")).at(&*slice.file.name));
    }
    let has_wrong_padding =
        |slice: &Slice| slice.file.padding.is_some() && pixels::applicable_padding(slice).is_none();
    if let Some((slice, _)) = first_with(&has_wrong_padding) {
        let [least, _] = slice.file.padding.unwrap_or_default();
        remarks.push(
            Remark::new(format!(
                "the stated padding value {least} may be tissue by slope and intercept: not \
                 applied"
            ))
            .at(&*slice.file.name),
        );
    }
    if let Some((slice, _)) = first_with(&|slice| slice.is_cone_beam) {
        let message = "cone beam CT: its values are not calibrated Hounsfield units";
        remarks.push(Remark::new(message).at(&*slice.file.name));
    }
    remarks.extend(overlapping(stack));
    remarks.extend(varying_rescale(&stack.slices));
    remarks.extend(tilt(stack));
    remarks
}

/// That slices are slabs, of which each has much of the next.
fn overlapping(stack: &Stack) -> Option<Remark> {
    let [.., step_m] = stack.grid.spacing_m();
    let (step_mm, thickness_mm) = (step_m * 1e3, stack.slices[0].thickness_mm?);
    (stack.slices.len() > 1 && thickness_mm > OVERLAP * step_mm).then(|| {
        Remark::new(format!(
            "slices are {thickness_mm} mm thick, but {step_mm:.3} mm apart: overlapping slabs, in which small \
             structures are longer than they are"
        ))
    })
}

fn varying_rescale(slices: &[Slice]) -> Option<Remark> {
    let pairs: BTreeSet<[u64; 2]> = slices
        .iter()
        .filter_map(|slice| slice.rescale.as_ref().ok())
        .map(|rescale| [rescale.slope.to_bits(), rescale.intercept.to_bits()])
        .collect();
    (pairs.len() > 1).then(|| {
        Remark::new(format!(
            "slope and intercept differ between slices ({} pairs): each slice has its own",
            pairs.len()
        ))
    })
}

fn tilt(stack: &Stack) -> Option<Remark> {
    let by_positions_deg = stack.grid.tilt_rad().to_degrees();
    // Tilted slices of a table that moves along its own axis are sheared; the header's angle is not to be
    // computed with (PS3.3, C.8.2.1.1.5).
    let stated_deg = stack.slices[0].file.gantry_tilt.unwrap_or(0.0).abs();
    let differs = (by_positions_deg - stated_deg).abs() > TILT_DEG && stack.slices.len() > 1;
    if by_positions_deg > TILT_DEG {
        let by_header = if differs {
            format!("; the header states {stated_deg} deg, which is ignored")
        } else {
            String::new()
        };
        return Some(Remark::new(format!(
            "tilted gantry: {by_positions_deg:.2} deg by the slice positions{by_header}"
        )));
    }
    None
}

fn description(stack: &Stack, label: String, padding_voxels: u64) -> Description {
    let first = &stack.slices[0];
    let stored = first.file.stored.as_ref();
    let kind = stored.map_or("", |stored| stored.kind.name());
    let bits = stored
        .ok()
        .and_then(|stored| stored.bits)
        .map_or(String::new(), |(bits, _)| format!(" ({bits} used)"));
    let frames = if first.file.frames > 1 {
        ", multi-frame"
    } else {
        ""
    };
    let files: BTreeSet<&Path> = stack
        .slices
        .iter()
        .map(|slice| slice.file.path.as_path())
        .collect();
    Description {
        format: format!("DICOM, {kind}{bits}{frames}, {}", first.file.syntax.name()),
        modality: first.key.modality.clone(),
        series: Some(label),
        kernel: first.key.kernel.clone(),
        tube_voltage_v: first.tube_voltage_kv.map(|kilovolts| kilovolts * 1e3),
        patient_position: first.patient_position,
        files: files.len(),
        padding_voxels,
        identity: ScanIdentity {
            frame_of_reference: first.key.frame_of_reference.clone(),
            series_uid: Some(first.key.uid.clone()).filter(|uid| !uid.is_empty()),
        },
    }
}

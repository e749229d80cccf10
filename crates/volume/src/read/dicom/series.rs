//! The series of a folder: which slices belong together, and which series is meant.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use super::image::{PERCENTAGE, Plane, SeriesKey, Slice, TIMES};
use super::stack::{are_even, are_interleaved, duplicates, in_order};
use crate::{Orientation, Remark, VolumeError, VoxelGrid};

/// Difference of direction cosines up to which slices are parallel: 0.006 degrees, 0.05 mm over half a metre.
const PARALLEL: f64 = 1e-4;

/// Modalities of volumes: cone beam CT of angiography systems is XA.
const MODALITIES: [&str; 2] = ["CT", "XA"];

/// Series of a folder that are listed.
const LISTED: usize = 40;

/// Difference of pixel spacings up to which they are the same: what it makes from one edge of a slice to the other.
const SAME_EXTENT_MM: f64 = 0.05;

/// Slices at one place that are a series of their own, and no slices that are there twice.
const AT_ONE_PLACE: usize = 3;

/// Slices of one volume, it may be.
#[derive(Debug)]
pub(super) struct Series {
    /// By which it is chosen.
    pub(super) label: String,
    pub(super) slices: Vec<Slice>,
    /// Copies of files that were left out.
    copies: usize,
    part: Option<Part>,
}

/// One of several stacks that a series is taken apart into.
#[derive(Debug)]
struct Part {
    number: usize,
    of: usize,
    /// By which it was told from the others.
    told_by: String,
    /// Whether all are at the same places.
    is_phase: bool,
}

/// The series that slices make, in order of number and UID.
pub(super) fn all(slices: Vec<Slice>) -> Vec<Series> {
    let mut by_key: BTreeMap<SeriesKey, Vec<Vec<Slice>>> = BTreeMap::new();
    for slice in slices {
        let groups = by_key.entry(slice.key.clone()).or_default();
        let group = groups
            .iter_mut()
            .find(|group| are_parallel(&group[0], &slice));
        match group {
            Some(group) => group.push(slice),
            None => groups.push(vec![slice]),
        }
    }
    for groups in by_key.values_mut() {
        groups.sort_by(|a, b| by_direction(&a[0], &b[0]));
    }
    let mut all: Vec<Series> = by_key.into_values().flatten().flat_map(phases).collect();
    let mut with_number: BTreeMap<Option<i64>, usize> = BTreeMap::new();
    for series in &all {
        *with_number.entry(series.key().number).or_default() += 1;
    }
    let mut labelled: BTreeMap<Option<i64>, usize> = BTreeMap::new();
    for series in &mut all {
        let number = series.key().number;
        let name = number.map_or("none".to_owned(), |number| number.to_string());
        let nth = labelled.entry(number).or_default();
        *nth += 1;
        series.label = if with_number[&number] == 1 {
            name
        } else {
            format!("{name}.{nth}")
        };
    }
    all
}

/// Order of groups of a series, whatever their files are called: axial, coronal, sagittal, and what has no place.
fn by_direction(a: &Slice, b: &Slice) -> Ordering {
    let numbers = |slice: &Slice| -> Vec<f64> {
        let Ok(plane) = &slice.plane else {
            return Vec::new();
        };
        let cosines = plane.along_row.iter().chain(plane.down_column.iter());
        cosines.chain(&plane.spacing_mm).copied().collect()
    };
    let (a, b) = (numbers(a), numbers(b));
    let differing = a.iter().zip(&b).map(|(a, b)| b.total_cmp(a));
    differing
        .chain([b.len().cmp(&a.len())])
        .find(|order| order.is_ne())
        .unwrap_or(Ordering::Equal)
}

/// Whether two slices may lie in one stack; what has no place is together with its like.
fn are_parallel(a: &Slice, b: &Slice) -> bool {
    let [rows, columns] = [a.key.rows, a.key.columns].map(f64::from);
    let (Ok(a), Ok(b)) = (&a.plane, &b.plane) else {
        return a.plane.is_err() && b.plane.is_err();
    };
    let [a0, a1] = a.spacing_mm;
    let [b0, b1] = b.spacing_mm;
    (a.along_row - b.along_row).amax() < PARALLEL
        && (a.down_column - b.down_column).amax() < PARALLEL
        && (a0 - b0).abs() * rows < SAME_EXTENT_MM
        && (a1 - b1).abs() * columns < SAME_EXTENT_MM
}

/// One group of slices, taken apart where it holds a place several times, or is uneven because even stacks lie among
/// each other, and something tells the stacks apart.
fn phases(slices: Vec<Slice>) -> Vec<Series> {
    let series = |slices, copies, part| Series {
        label: String::new(),
        slices,
        copies,
        part,
    };
    let unordered = slices.clone();
    let Ok(slices) = in_order(slices) else {
        return vec![series(unordered, 0, None)];
    };
    let (slices, copies) = without_copies(slices);
    let is_doubled = !duplicates(&slices).is_empty();
    if !is_doubled && are_even(&slices) {
        return vec![series(slices, copies, None)];
    }
    let ways = slices.first().map_or(0, |slice| slice.phase.len());
    for way in 0..ways {
        let mut parts: BTreeMap<Option<String>, Vec<Slice>> = BTreeMap::new();
        for slice in &slices {
            parts
                .entry(slice.phase[way].clone())
                .or_default()
                .push(slice.clone());
        }
        let are_whole = parts
            .values()
            .all(|part| part.len() > 1 && duplicates(part).is_empty());
        if parts.len() < 2 || !are_whole {
            continue;
        }
        // Parts that overlap alone, such as of two acquisitions, are no phases.
        let is_phase = is_doubled && are_at_the_same_places(&parts);
        if way >= TIMES && !are_at_the_same_places(&parts) {
            continue;
        }
        let mut parts: Vec<_> = parts.into_iter().collect();
        parts.sort_by_key(|(name, _)| {
            name.as_ref()
                .and_then(|name| name.parse::<f64>().ok())
                .map_or(i64::MIN, |number| {
                    #[expect(clippy::cast_possible_truncation, reason = "an order is wanted")]
                    let thousandths = (number * 1e3) as i64;
                    thousandths
                })
        });
        let parts: Vec<Vec<Slice>> = parts.into_iter().map(|(_, part)| part).collect();
        if is_doubled || parts.iter().all(|part| are_even(part)) && are_interleaved(&parts) {
            let of = parts.len();
            let part = |(at, slices): (usize, Vec<Slice>)| {
                let part = Part {
                    number: at + 1,
                    of,
                    told_by: told_by(way, slices[0].phase[way].as_deref()),
                    is_phase,
                };
                series(slices, copies, Some(part))
            };
            return parts.into_iter().enumerate().map(part).collect();
        }
    }
    vec![series(slices, copies, None)]
}

/// By what phases are told apart, for people: times of day are not said.
fn told_by(way: usize, value: Option<&str>) -> String {
    let value = value.unwrap_or("none");
    match way {
        0 => format!("acquisition {value}"),
        1 | 2 => format!("temporal position {value}"),
        3 => format!("trigger time {value} ms"),
        4 => format!("{value} % of the cardiac cycle"),
        5 => format!("{value} % of the breathing cycle"),
        PERCENTAGE => format!("{value} %"),
        _ => "by time".to_owned(),
    }
}

fn are_at_the_same_places(parts: &BTreeMap<Option<String>, Vec<Slice>>) -> bool {
    let places = |part: &[Slice]| -> Vec<_> {
        let planes = part.iter().map(|slice| slice.plane.as_ref().ok());
        planes
            .map(|plane| plane.map(|plane| plane.position_mm))
            .collect()
    };
    let mut all = parts.values().map(|part| places(part));
    let first = all.next();
    all.all(|places| Some(places) == first)
}

/// Without files that are there twice, of slices in order.
fn without_copies(slices: Vec<Slice>) -> (Vec<Slice>, usize) {
    let before = slices.len();
    let mut kept: Vec<Slice> = Vec::with_capacity(before);
    for slice in slices {
        let is_copy = |other: &Slice| {
            slice.instance.is_some()
                && other.instance == slice.instance
                && other.frame == slice.frame
                && other.plane == slice.plane
        };
        // Copies are at the same place, and so among the last.
        if !kept.iter().rev().take(8).any(is_copy) {
            kept.push(slice);
        }
    }
    let copies = before - kept.len();
    (kept, copies)
}

impl Series {
    fn key(&self) -> &SeriesKey {
        &self.slices[0].key
    }

    /// Whether it can be a volume, as far as one sees from outside.
    fn is_volume(&self) -> bool {
        let key = self.key();
        let is_ct = key
            .modality
            .as_deref()
            .is_none_or(|modality| MODALITIES.contains(&modality));
        is_ct
            && !key.is_scout
            && key.made.is_none()
            && self.slices[0].plane.is_ok()
            && !self.is_at_one_place()
    }

    /// Whether both are phases of one series.
    fn is_phase_of(&self, other: &Self) -> bool {
        let is_phase = |series: &Self| series.part.as_ref().is_some_and(|part| part.is_phase);
        is_phase(self) && is_phase(other) && self.key() == other.key()
    }

    /// Whether it is one place over time, as bolus tracking is.
    fn is_at_one_place(&self) -> bool {
        let slices = &self.slices;
        slices.len() >= AT_ONE_PLACE
            && slices[0].file.frames == 1
            && duplicates(slices).len() + 1 == slices.len()
    }

    /// Whether it is pictures of an angiography system, from one side each.
    fn is_angiography(&self) -> bool {
        self.key().modality.as_deref() == Some("XA") && self.slices[0].plane.is_err()
    }

    /// The percentage in its description, where it is that of a phase: beside a word of gating, or another one in that
    /// of a series of as many slices.
    fn percentage_of_phase(&self, all: &[Self]) -> Option<&str> {
        let percentage = |series: &Self| series.slices[0].phase[PERCENTAGE].clone();
        let own = percentage(self)?;
        let differs = |other: &Self| {
            other.slices.len() == self.slices.len()
                && percentage(other).is_some_and(|other| other != own)
        };
        let is_phase = self.slices[0].is_gated || all.iter().any(differs);
        self.slices[0].phase[PERCENTAGE]
            .as_deref()
            .filter(|_| is_phase)
    }

    /// For the list of what a folder holds: no more than what tells series apart.
    fn in_words(&self, all: &[Self]) -> String {
        let key = self.key();
        let count = self.slices.len();
        let mut words = vec![format!(
            "{count} {} of {} x {}",
            if count == 1 { "slice" } else { "slices" },
            key.columns,
            key.rows
        )];
        words.extend(self.slices[0].plane.as_ref().ok().and_then(view));
        if let Some(thickness_mm) = self.slices[0].thickness_mm {
            words.push(format!("{thickness_mm} mm thick"));
        }
        if let Some(kernel) = &key.kernel {
            words.push(format!("kernel {kernel}"));
        }
        match &key.modality {
            Some(modality) if modality == "XA" => words.push("modality XA".to_owned()),
            Some(modality) if modality != "CT" => {
                words.push(format!("modality {modality}, not CT"));
            }
            _ => {}
        }
        if let Some(part) = &self.part {
            let Part {
                number,
                of,
                told_by,
                is_phase,
            } = part;
            let kind = if *is_phase { "phase" } else { "part" };
            words.push(format!("{kind} {number} of {of} ({told_by})"));
        } else if let Some(percent) = self.percentage_of_phase(all) {
            words.push(format!("phase {percent} %"));
        }
        if let Some(made) = key.made {
            words.push(made.in_words().to_owned());
        } else if self.is_angiography() {
            words.push("X-ray projections".to_owned());
        } else if self.is_at_one_place() {
            words.push("at one place (bolus tracking)".to_owned());
        } else if key.is_scout {
            words.push("a scout".to_owned());
        } else if self.slices[0].plane.is_err() {
            words.push("without a position".to_owned());
        }
        format!("{}: {}", self.label, words.join(", "))
    }

    /// Refuses what is no volume of a CT, by what it is.
    fn check(&self) -> Result<(), VolumeError> {
        let key = self.key();
        let count = self.slices.len();
        if key.is_scout {
            return Err(
                VolumeError::refused("it is a scout (LOCALIZER), not a volume")
                    .hint("name the folder or file of the scan"),
            );
        }
        if self.is_angiography() {
            return Err(VolumeError::refused(format!(
                "{count} X-ray projections of an angiography system (XA) are not a volume"
            ))
            .hint("export its 3D reconstruction (cone beam CT) as CT or X-Ray 3D images, and name that"));
        }
        match &key.modality {
            Some(modality) if !MODALITIES.contains(&modality.as_str()) => {
                return Err(
                    VolumeError::refused(format!("the modality is {modality}, not CT"))
                        .hint("name the folder or file of a CT"),
                );
            }
            _ => {}
        }
        if let Some(made) = key.made {
            return Err(VolumeError::refused(format!(
                "the slices are {}, which are not Hounsfield units of one place",
                made.in_words()
            ))
            .hint("name the series of the thin slices that they were made from"));
        }
        if self.is_at_one_place() {
            return Err(VolumeError::refused(format!(
                "all {count} slices are at one place, one after the other: bolus tracking, or a test bolus, is not a \
                 volume"
            ))
            .hint("name the series of the scan itself"));
        }
        Ok(())
    }

    /// What was left out of it.
    pub(super) fn remarks(&self) -> Vec<Remark> {
        if self.copies == 0 {
            return Vec::new();
        }
        vec![Remark::new(format!(
            "{} files are duplicates: one of each was read",
            self.copies
        ))]
    }
}

/// In which plane slices lie.
fn view(plane: &Plane) -> Option<String> {
    let steps = nalgebra::Matrix3::from_columns(&[
        plane.along_row,
        plane.down_column,
        plane.along_row.cross(&plane.down_column),
    ]);
    let grid = VoxelGrid::new([1; 3], steps, nalgebra::Point3::origin()).ok()?;
    let (normal, _) = Orientation::of(&grid).axes()[2];
    Some(["sagittal", "coronal", "axial"][normal].to_owned())
}

/// All series in a list.
fn list(all: &[Series]) -> String {
    let mut lines: Vec<String> = all
        .iter()
        .take(LISTED)
        .map(|series| series.in_words(all))
        .collect();
    if all.len() > LISTED {
        lines.push(format!("and {} more", all.len() - LISTED));
    }
    lines.join("; ")
}

/// The series that is asked for; where none is, the only volume that there is.
pub(super) fn choose(
    mut all: Vec<Series>,
    wanted: Option<&str>,
) -> Result<(Series, Vec<Remark>), VolumeError> {
    let at = match wanted {
        Some(wanted) => asked_for(&all, wanted)?,
        None => only_volume(&all)?,
    };
    let chosen = all.remove(at);
    let mut remarks = chosen.remarks();
    if !all.is_empty() && wanted.is_none() {
        remarks.push(Remark::new(format!(
            "series {} is the only volume; ignored: {}",
            chosen.label,
            list(&all)
        )));
    }
    chosen
        .check()
        .map_err(|problem| problem.at(format!("series {}", chosen.label)))?;
    if chosen.key().modality.is_none() {
        remarks.push(Remark::new("the modality is not stated: CT assumed"));
    }
    if let Some(part) = chosen.part.as_ref().filter(|part| part.is_phase) {
        remarks.push(Remark::new(format!(
            "phase {} of {} ({}): the others are not read",
            part.number, part.of, part.told_by
        )));
    }
    Ok((chosen, remarks))
}

fn asked_for(all: &[Series], wanted: &str) -> Result<usize, VolumeError> {
    let matching: Vec<usize> = (0..all.len())
        .filter(|at| all[*at].label == wanted || all[*at].key().uid == wanted)
        .collect();
    let what = match matching.as_slice() {
        [at] => return Ok(*at),
        [] => format!("there is no series {wanted}"),
        several => format!("{} series are {wanted}", several.len()),
    };
    Err(VolumeError::refused(what).hint(format!("the series are {}", list(all))))
}

fn only_volume(all: &[Series]) -> Result<usize, VolumeError> {
    let volumes: Vec<usize> = (0..all.len()).filter(|at| all[*at].is_volume()).collect();
    let stacks: Vec<usize> = volumes
        .iter()
        .copied()
        .filter(|at| all[*at].slices.len() > 1)
        .collect();
    match (stacks.as_slice(), volumes.as_slice(), all) {
        ([at], _, _) | ([], [at], _) => Ok(*at),
        // What is wrong with the only one says itself when it is read.
        ([], [], [_]) => Ok(0),
        ([], [], _) => Err(VolumeError::refused("no series is a CT volume")
            .hint(format!("the series are {}", list(all)))),
        _ => {
            let several = if stacks.is_empty() { &volumes } else { &stacks };
            let what = if several
                .iter()
                .all(|at| all[*at].is_phase_of(&all[several[0]]))
            {
                format!(
                    "the series has {} phases (4D): the same places at several times",
                    several.len()
                )
            } else {
                format!("{} series are possible", several.len())
            };
            Err(VolumeError::refused(what).hint(format!("choose one with --series: {}", list(all))))
        }
    }
}

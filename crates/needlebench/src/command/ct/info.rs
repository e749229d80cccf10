//! `needlebench ct info`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::Result;
use clap::Args;
use needlebench_input::Finding;
use needlebench_patient::Stop;
use needlebench_show::layout;
use needlebench_volume::read::{Description, ReadOptions, ReadVolume, read_volume};
use needlebench_volume::{HuHistogram, Orientation, Remark, VolumeError};
use serde::Serialize;

use crate::command::{print_json, print_text};
use crate::exit::ExitStatus;
use crate::failure::{Failure, status_of};
use crate::interrupts::{threads, watch_interrupts};
use crate::output::shown;

/// Shares of the voxels whose Hounsfield units are printed.
const QUANTILES: [f64; 7] = [0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99];

/// Shear below which slices count as orthogonal in the printed text.
const STRAIGHT_DEG: f64 = 0.01;

/// How a CT is read, for all commands that read one.
#[derive(Debug, Args)]
pub(crate) struct ReadArguments {
    /// Series of a DICOM folder, by its UID or by its number in the list that an ambiguous folder gives.
    #[arg(long, value_name = "SERIES")]
    series: Option<String>,
    /// Interpolate single missing slices instead of rejecting the volume.
    #[arg(long)]
    fill_gaps: bool,
    /// Voxel axis orientation (e.g. LPS) for files that do not state it.
    #[arg(long, value_name = "LPS")]
    assume_orientation: Option<Orientation>,
    /// Memory limit for the voxels, in MiB.
    #[arg(long, value_name = "MIB", default_value_t = 4096)]
    max_memory: u32,
    /// Number of threads [default: all cores]; does not affect results.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
}

impl ReadArguments {
    /// Reads a CT.
    pub(crate) fn read(&self, path: &Path, cancel: &AtomicBool) -> Result<ReadVolume, VolumeError> {
        let options = ReadOptions {
            series: self.series.clone(),
            fill_gaps: self.fill_gaps,
            assume_orientation: self.assume_orientation,
            max_bytes: self.max_bytes(),
            ..ReadOptions::default()
        };
        read_volume(path, &options, self.threads(), cancel)
    }

    /// Memory limit for the voxels, in bytes.
    pub(crate) fn max_bytes(&self) -> u64 {
        u64::from(self.max_memory) << 20
    }

    /// Number of threads.
    pub(crate) fn threads(&self) -> usize {
        threads(self.jobs)
    }
}

#[derive(Debug, Args)]
pub(crate) struct InfoArguments {
    /// A DICOM file or folder, NIfTI, NRRD, MetaImage, MGH, or a ZIP of one.
    #[arg(value_name = "PATH")]
    path: PathBuf,
    #[command(flatten)]
    reading: ReadArguments,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct InfoAnswer {
    schema_version: u32,
    ok: bool,
    findings: Vec<Finding>,
    remarks: Vec<Remark>,
    volume: Option<VolumeAnswer>,
}

#[derive(Serialize)]
struct VolumeAnswer {
    source: Description,
    size: [usize; 3],
    spacing_m: [f64; 3],
    extent_m: [f64; 3],
    /// Letters of the patient sides towards which i, j and k increase.
    orientation: String,
    /// Centre of the first voxel, in LPS.
    first_voxel_m: [f64; 3],
    /// Steps along i, j and k, in LPS.
    steps_m: [[f64; 3]; 3],
    is_aligned: bool,
    tilt_rad: f64,
    slice_thickness_m: Option<f64>,
    memory_bytes: usize,
    hu: HuAnswer,
}

#[derive(Serialize)]
struct HuAnswer {
    minimum: Option<i16>,
    maximum: Option<i16>,
    mean: Option<f64>,
    quantiles: Vec<Quantile>,
    air_peak: Option<i16>,
    has_air_peak: bool,
}

#[derive(Serialize)]
struct Quantile {
    share: f64,
    hu: i16,
}

/// Reads and describes a CT.
pub(crate) fn info(arguments: &InfoArguments) -> Result<ExitStatus, Failure> {
    let cancel = watch_interrupts()?;
    let read = arguments.reading.read(&arguments.path, &cancel);
    let read = match read.map_err(|error| Stop::of_scan(&arguments.path, error)) {
        Ok(read) => read,
        Err(Stop::Refused(findings)) if arguments.json => {
            let answer = InfoAnswer {
                schema_version: 1,
                ok: false,
                findings,
                remarks: Vec::new(),
                volume: None,
            };
            return Err(Failure::answered(status_of(&answer.findings), &answer));
        }
        Err(stop) => return Err(Failure::of_stop(stop, "interrupted")),
    };
    let volume = answer(&read);
    if arguments.json {
        print_json(&InfoAnswer {
            schema_version: 1,
            ok: true,
            findings: Vec::new(),
            remarks: read.remarks,
            volume: Some(volume),
        })?;
    } else {
        let text = in_words(&arguments.path, &volume, &read.remarks)?;
        print_text(&layout::wrapped(&text))?;
    }
    Ok(ExitStatus::Success)
}

fn answer(read: &ReadVolume) -> VolumeAnswer {
    let volume = &read.volume;
    let grid = &volume.grid;
    let histogram = HuHistogram::of(&volume.hu, read.description.padding_voxels);
    let range_hu = histogram.range_hu();
    let size = grid.size();
    let spacing_m = grid.spacing_m();
    let steps = grid.steps_m();
    let first = grid.first_m();
    let quantile = |share: f64| {
        let hu = histogram.quantile_hu(share)?;
        Some(Quantile { share, hu })
    };
    VolumeAnswer {
        source: read.description.clone(),
        size,
        spacing_m,
        extent_m: [0, 1, 2].map(|axis| spacing_m[axis] * size[axis] as f64),
        orientation: Orientation::of(grid).to_string(),
        first_voxel_m: [first.x, first.y, first.z],
        steps_m: [0, 1, 2].map(|axis| [0, 1, 2].map(|row| steps[(row, axis)])),
        is_aligned: grid.is_aligned(),
        tilt_rad: grid.tilt_rad(),
        slice_thickness_m: volume.slice_thickness_m,
        memory_bytes: size_of_val(volume.hu.as_slice()),
        hu: HuAnswer {
            minimum: range_hu.map(|range| range[0]),
            maximum: range_hu.map(|range| range[1]),
            mean: histogram.mean_hu(),
            quantiles: QUANTILES.into_iter().filter_map(quantile).collect(),
            air_peak: histogram.air_peak_hu(),
            has_air_peak: histogram.has_air_peak(),
        },
    }
}

fn in_words(path: &Path, volume: &VolumeAnswer, remarks: &[Remark]) -> Result<String> {
    let mut text = String::new();
    let [columns, rows, slices] = volume.size;
    let [x, y, z] = volume.spacing_m.map(|each| each * 1e3);
    let [across, down, along] = volume.extent_m.map(|each| each * 1e3);
    let source = &volume.source;
    write!(text, "{}: {}", shown(path), source.format)?;
    let mut line = |name: &str, value: String| write!(text, "\n  {name:<12} {value}");
    let mut scan = Vec::new();
    scan.extend(source.modality.clone());
    scan.extend(
        source
            .series
            .as_ref()
            .map(|label| format!("series {label}")),
    );
    scan.extend(
        source
            .kernel
            .as_ref()
            .map(|kernel| format!("kernel {kernel}")),
    );
    scan.extend(
        source
            .tube_voltage_v
            .map(|volts| format!("{} kV", volts / 1e3)),
    );
    if source.files > 1 {
        scan.push(format!("{} files", source.files));
    }
    if !scan.is_empty() {
        line("scan", scan.join(", "))?;
    }
    line(
        "size",
        format!(
            "{columns} x {rows} x {slices} voxels, {:.0} MiB in memory",
            (volume.memory_bytes as f64 / f64::from(1 << 20)).ceil()
        ),
    )?;
    line("spacing", format!("{x:.4} x {y:.4} x {z:.4} mm"))?;
    line("extent", format!("{across:.1} x {down:.1} x {along:.1} mm"))?;
    line("thickness", thickness(volume))?;
    line("orientation", orientation(volume))?;
    if let Some(position) = source.patient_position {
        line("position", position.to_string())?;
    }
    let [px, py, pz] = volume.first_voxel_m.map(|each| each * 1e3);
    line(
        "first voxel",
        format!("({px:.3}, {py:.3}, {pz:.3}) mm in LPS"),
    )?;
    let hu = &volume.hu;
    if let (Some(least), Some(greatest), Some(mean)) = (hu.minimum, hu.maximum, hu.mean) {
        line("HU", format!("{least} to {greatest}, mean {mean:.1}"))?;
        let quantiles: Vec<String> = hu
            .quantiles
            .iter()
            .map(|each| format!("{:.0} % {}", each.share * 100.0, each.hu))
            .collect();
        line("quantiles", quantiles.join(", "))?;
        line(
            "air",
            match hu.air_peak {
                Some(peak) if hu.has_air_peak => format!("peak at {peak} HU"),
                Some(peak) => format!("peak at {peak} HU, not that of air"),
                None => "none".to_owned(),
            },
        )?;
    }
    for remark in remarks {
        match &remark.place {
            Some(place) => write!(text, "\n  note: {place}: {}", remark.message)?,
            None => write!(text, "\n  note: {}", remark.message)?,
        }
    }
    Ok(text)
}

/// Slice thickness, compared with the slice spacing.
fn thickness(volume: &VolumeAnswer) -> String {
    let Some(thickness_m) = volume.slice_thickness_m else {
        return "unknown".to_owned();
    };
    let between_m = volume.spacing_m[2] * libm::cos(volume.tilt_rad);
    let thickness_mm = thickness_m * 1e3;
    let difference_mm = thickness_mm - between_m * 1e3;
    // A hundredth of a millimetre is rounding.
    if volume.size[2] == 1 || difference_mm.abs() < 0.01 {
        format!("{thickness_mm:.3} mm")
    } else if difference_mm > 0.0 {
        format!("{thickness_mm:.3} mm: slices overlap by {difference_mm:.3} mm")
    } else {
        format!(
            "{thickness_mm:.3} mm: gaps of {:.3} mm between slices",
            -difference_mm
        )
    }
}

fn orientation(volume: &VolumeAnswer) -> String {
    let tilt_deg = volume.tilt_rad.to_degrees();
    let mut words = format!(
        "{} (columns, rows, slices increase towards {})",
        volume.orientation,
        sides(&volume.orientation)
    );
    if tilt_deg > STRAIGHT_DEG {
        let _ = write!(words, "; sheared by {tilt_deg:.2} deg");
    } else if !is_along_axes(volume) {
        words.push_str("; oblique");
    }
    words
}

/// Whether each step runs along one axis of the patient.
fn is_along_axes(volume: &VolumeAnswer) -> bool {
    volume
        .steps_m
        .iter()
        .zip(volume.spacing_m)
        .all(|(step, spacing_m)| {
            step.iter()
                .any(|part| (part.abs() - spacing_m).abs() <= 1e-6 * spacing_m)
        })
}

fn sides(letters: &str) -> String {
    let sides: Vec<&str> = letters
        .chars()
        .map(|letter| match letter {
            'L' => "left",
            'R' => "right",
            'P' => "back",
            'A' => "front",
            'S' => "head",
            _ => "feet",
        })
        .collect();
    sides.join(", ")
}

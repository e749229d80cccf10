//! The images of a file: one slice, or the frames of an enhanced one.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;

use super::dataset::{DataSet, Pixels};
use super::file::OpenedFile;
use super::syntax::TransferSyntax;
use super::tag::{self, Tag};
use crate::VolumeError;
use crate::patient_position::PatientPosition;
use crate::read::scalar::{Kind, Rescale, Stored};
use crate::read::segments::name_of;

/// Kinds of objects that are images of CT: of one slice, of many, and made of many.
const CT_IMAGES: [&str; 3] = [
    "1.2.840.10008.5.1.4.1.1.2",
    "1.2.840.10008.5.1.4.1.1.2.1",
    "1.2.840.10008.5.1.4.1.1.2.2",
];

/// Frames that a file may have.
const FRAMES: i64 = 1 << 16;

/// Deviation of direction cosines from unit length and right angle that is rounding.
const COSINES: f64 = 2e-3;

/// What all frames of a file share.
#[derive(Debug)]
pub(super) struct ImageFile {
    /// Within the folder, for people.
    pub(super) name: String,
    pub(super) path: PathBuf,
    pub(super) syntax: TransferSyntax,
    pub(super) pixels: Option<Pixels>,
    pub(super) rows: u16,
    pub(super) columns: u16,
    pub(super) frames: usize,
    pub(super) stored: Result<Stored, VolumeError>,
    /// Range of stored numbers that were not measured.
    pub(super) padding: Option<[f64; 2]>,
    pub(super) assumed: Option<&'static str>,
    pub(super) is_lossy: bool,
    /// Whether the stream of a frame that was decoded says that its numbers differ from the measured ones.
    pub(super) has_lossy_stream: AtomicBool,
    /// Whether the compression leaves it open, and the file says nothing.
    pub(super) may_be_lossy: bool,
    /// Text of (0018,1120): for information only, its sign differs between manufacturers.
    pub(super) gantry_tilt: Option<f64>,
    pub(super) segmentation: Option<Segmentation>,
    bits_allocated: i64,
    /// Whether frames have elements of their own.
    pub(super) has_frame_groups: bool,
}

impl ImageFile {
    /// Whether pixels are single bits, eight to a byte.
    pub(super) fn is_bits(&self) -> bool {
        self.bits_allocated == 1
    }
}

/// What a segmentation says of its frames.
#[derive(Debug)]
pub(super) struct Segmentation {
    /// `BINARY`, `FRACTIONAL`, `LABELMAP`.
    pub(super) kind: String,
    pub(super) greatest_fraction: u32,
    /// Numbers and labels.
    pub(super) segments: Vec<(u16, String)>,
}

/// Where a slice is, in mm as the file has it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plane {
    pub(super) position_mm: Vector3<f64>,
    /// Along which columns follow one another (along a row), and rows (down a column).
    pub(super) along_row: Vector3<f64>,
    pub(super) down_column: Vector3<f64>,
    /// Between rows, between columns.
    pub(super) spacing_mm: [f64; 2],
}

/// What slices of one series have in common, and those of another one do not.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct SeriesKey {
    pub(super) number: Option<i64>,
    pub(super) uid: String,
    pub(super) is_scout: bool,
    /// What its values are made of, where they are not those of a thin slice.
    pub(super) made: Option<Made>,
    pub(super) modality: Option<String>,
    pub(super) columns: u16,
    pub(super) rows: u16,
    pub(super) kernel: Option<String>,
    pub(super) stack: Option<String>,
    pub(super) frame_of_reference: Option<String>,
}

/// What values are made of, rather than one measurement each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Made {
    Maxima,
    Minima,
    Rendering,
    Projection,
    CurvedReformat,
}

impl Made {
    /// By the words of an image type, and of how an image was computed.
    fn of(types: &[String]) -> Option<Self> {
        let values: Vec<String> = types
            .iter()
            .flat_map(|text| text.split('\\'))
            .map(|value| value.trim().to_ascii_uppercase().replace(['_', '-'], " "))
            .collect();
        let has = |words: &[&str]| {
            let is_said = |value: &String| {
                let value = format!(" {value} ");
                words
                    .iter()
                    .any(|word| value.contains(&format!(" {word} ")))
            };
            values.iter().any(is_said)
        };
        if has(&["MIP", "MAX IP", "MAXIP", "MAXIMUM INTENSITY"]) {
            Some(Self::Maxima)
        } else if has(&["MINIP", "MIN IP", "MINIMUM INTENSITY"]) {
            Some(Self::Minima)
        } else if has(&["VRT", "VOLUME RENDER", "SURFACE RENDER", "SSD"]) {
            Some(Self::Rendering)
        } else if has(&["CURVED MPR", "CPR"]) {
            Some(Self::CurvedReformat)
        } else if has(&["PROJECTION IMAGE"]) {
            Some(Self::Projection)
        } else {
            None
        }
    }

    /// For people.
    pub(super) fn in_words(self) -> &'static str {
        match self {
            Self::Maxima => {
                "maximum intensity projections (MIP): each value is the greatest of a slab"
            }
            Self::Minima => {
                "minimum intensity projections (MinIP): each value is the least of a slab"
            }
            Self::Rendering => "pictures of a rendering",
            Self::Projection => "projections of a volume",
            Self::CurvedReformat => "curved reformats",
        }
    }
}

/// Image types of cone beam CT, where its modality is CT.
const CONE_BEAM: [&str; 4] = ["CBCT", "CONE BEAM", "CONEBEAM", "DYNACT"];

/// Ways to tell phases: acquisition, temporal position, its index, trigger time, percentage of the cardiac and of the
/// breathing cycle, one in a description; and times that all slices of a phase share.
pub(super) const WAYS: usize = 10;

/// The first of the ways that is a time: it may also differ from one turn of the tube to the next.
pub(super) const TIMES: usize = 7;

/// Where the percentage of a description is among the ways.
pub(super) const PERCENTAGE: usize = 6;

/// The percentage that a description has, as in `Gated, 30.0%`: nothing else of it is kept.
fn percentage(text: &str) -> Option<String> {
    let (before, _) = text.split_once('%')?;
    let number = before
        .trim_end()
        .rsplit(|letter: char| !letter.is_ascii_digit() && letter != '.')
        .next()?;
    let percent = number.parse::<f64>().ok()?;
    (0.0..=100.0)
        .contains(&percent)
        .then(|| percent.to_string())
}

/// Parts of words by which a description says that its percentage is one of a cycle.
const GATING: [&str; 10] = [
    "gated", "gating", "phase", "resp", "breath", "insp", "expi", "cardiac", "ecg", "t=",
];

/// Whether a description is of a phase of breathing or of the heart.
fn is_gated(text: &str) -> bool {
    let lower = text.to_lowercase();
    GATING.iter().any(|part| lower.contains(part))
}

/// One slice.
#[derive(Debug, Clone)]
pub(super) struct Slice {
    pub(super) file: Arc<ImageFile>,
    pub(super) frame: usize,
    pub(super) key: SeriesKey,
    pub(super) instance: Option<String>,
    pub(super) plane: Result<Plane, VolumeError>,
    pub(super) rescale: Result<Rescale, VolumeError>,
    /// Whether slope and intercept are there.
    pub(super) has_rescale: bool,
    /// Where it is not `HU`.
    pub(super) rescale_type: Option<String>,
    pub(super) thickness_mm: Option<f64>,
    pub(super) tube_voltage_kv: Option<f64>,
    pub(super) patient_position: Option<PatientPosition>,
    /// Whether the description with a percentage says that it is of a phase.
    pub(super) is_gated: bool,
    /// What may tell phases of one series, by [`WAYS`].
    pub(super) phase: [Option<String>; WAYS],
    pub(super) is_cone_beam: bool,
    /// Of a segmentation.
    pub(super) segment: Option<i64>,
}

/// Elements of a frame, else of all frames, else of the file.
struct Layers<'a>([Option<&'a DataSet>; 3]);

impl Layers<'_> {
    fn first<T>(&self, get: impl Fn(&DataSet) -> Option<T>) -> Option<T> {
        self.0.iter().flatten().find_map(|data| get(data))
    }

    fn text(&self, tag: Tag) -> Option<String> {
        self.first(|data| data.text(tag))
    }

    fn array<const N: usize>(&self, tag: Tag) -> Result<Option<[f64; N]>, VolumeError> {
        self.first(|data| data.array(tag).transpose()).transpose()
    }

    fn real(&self, tag: Tag) -> Result<Option<f64>, VolumeError> {
        self.first(|data| data.real(tag).transpose()).transpose()
    }
}

/// The slices of a file; none where it holds no image.
pub(super) fn slices(
    opened: OpenedFile,
    path: &Path,
    name: &str,
) -> Result<Vec<Slice>, VolumeError> {
    let OpenedFile {
        mut data,
        pixels,
        syntax,
        sop_class,
        assumed,
    } = opened;
    let (Some(rows), Some(columns)) = (short(&data, tag::ROWS), short(&data, tag::COLUMNS)) else {
        let sop_class = data.text(tag::SOP_CLASS).or(sop_class).unwrap_or_default();
        if CT_IMAGES.contains(&sop_class.as_str()) {
            return Err(VolumeError::refused(
                "the file is truncated: it is a CT image without pixels",
            )
            .at(name)
            .hint("copy or export it again"));
        }
        return Ok(Vec::new());
    };
    let mut shared = data.take_items(tag::SHARED_GROUPS).into_iter().next();
    if let Some(shared) = &mut shared {
        shared.flatten();
    }
    let mut of_frames = data.take_items(tag::FRAME_GROUPS);
    for frame in &mut of_frames {
        frame.flatten();
    }
    let stated = data.integer(tag::FRAMES).unwrap_or(1);
    let frames = usize::try_from(stated)
        .ok()
        .filter(|_| (1..=FRAMES).contains(&stated))
        .ok_or_else(|| {
            VolumeError::refused(format!("it states {stated} frames"))
                .at(name)
                .hint("copy or export it again")
        })?;
    if frames > 1 && !of_frames.is_empty() && of_frames.len() != frames {
        return Err(VolumeError::refused(format!(
            "it states {frames} frames, but describes {}",
            of_frames.len()
        ))
        .at(name)
        .hint("copy or export it again"));
    }
    check_frames(&data, [rows, columns], frames, pixels.as_ref())
        .map_err(|problem| problem.at(name))?;
    let stored = stored(&data, &syntax);
    let lossy = data.text(tag::LOSSY);
    let is_signed = data.integer(tag::PIXEL_REPRESENTATION) == Some(1);
    let file = Arc::new(ImageFile {
        name: name.to_owned(),
        path: path.to_owned(),
        pixels,
        rows,
        columns,
        frames,
        stored,
        padding: padding(&data, is_signed),
        assumed,
        has_lossy_stream: AtomicBool::new(false),
        is_lossy: syntax.is_lossy() || lossy.as_deref() == Some("01"),
        may_be_lossy: syntax.may_be_lossy() && lossy.is_none(),
        gantry_tilt: data.real(tag::GANTRY_TILT).ok().flatten(),
        segmentation: segmentation(&data),
        bits_allocated: data.integer(tag::BITS_ALLOCATED).unwrap_or(0),
        has_frame_groups: !of_frames.is_empty(),
        syntax,
    });
    let slice = |frame: usize| {
        let layers = Layers([of_frames.get(frame), shared.as_ref(), Some(&data)]);
        slice_of(&file, frame, &layers)
    };
    Ok((0..frames).map(slice).collect())
}

fn slice_of(file: &Arc<ImageFile>, frame: usize, layers: &Layers) -> Slice {
    let types = [tag::FRAME_TYPE, tag::IMAGE_TYPE, tag::VOLUME_TECHNIQUE]
        .map(|tag| layers.text(tag).unwrap_or_default());
    let modality = layers.text(tag::MODALITY);
    let is_cone_beam = modality.as_deref() == Some("XA")
        || types.iter().any(|text| {
            let text = text.to_ascii_uppercase().replace('_', " ");
            CONE_BEAM.iter().any(|word| text.contains(word))
        });
    let is_scout = types
        .iter()
        .any(|text| text.split('\\').any(|word| word.trim() == "LOCALIZER"));
    let integer = |tag| layers.first(|data| data.integer(tag));
    let has = |tag| layers.text(tag).is_some();
    let percent = |tag| {
        let percent = layers.real(tag).ok().flatten();
        percent.map(|percent| percent.to_string())
    };
    let described = [tag::SERIES_DESCRIPTION, tag::IMAGE_COMMENTS]
        .into_iter()
        .filter_map(|tag| layers.text(tag))
        .find(|text| percentage(text).is_some());
    Slice {
        file: Arc::clone(file),
        frame,
        key: SeriesKey {
            number: integer(tag::SERIES_NUMBER),
            uid: layers.text(tag::SERIES_UID).unwrap_or_default(),
            is_scout,
            made: Made::of(&types),
            modality,
            columns: file.columns,
            rows: file.rows,
            kernel: layers.text(tag::KERNEL),
            stack: layers.text(tag::STACK_ID),
            frame_of_reference: layers.text(tag::FRAME_OF_REFERENCE),
        },
        instance: layers.text(tag::SOP_INSTANCE_UID),
        plane: plane(layers).map_err(|problem| named(problem, &file.name)),
        rescale: rescale(layers).map_err(|problem| named(problem, &file.name)),
        has_rescale: has(tag::SLOPE) || has(tag::INTERCEPT),
        rescale_type: layers.text(tag::RESCALE_TYPE).filter(|name| name != "HU"),
        thickness_mm: positive(layers, tag::SLICE_THICKNESS),
        tube_voltage_kv: positive(layers, tag::KVP),
        patient_position: layers
            .text(tag::PATIENT_POSITION)
            .and_then(|term| PatientPosition::of_term(&term)),
        is_cone_beam,
        is_gated: described.as_deref().is_some_and(is_gated),
        phase: [
            integer(tag::ACQUISITION_NUMBER).map(|number| number.to_string()),
            layers.text(tag::TEMPORAL_POSITION),
            integer(tag::TEMPORAL_POSITION_INDEX).map(|number| number.to_string()),
            layers.text(tag::TRIGGER_TIME),
            percent(tag::NOMINAL_CARDIAC_PERCENTAGE),
            percent(tag::NOMINAL_RESPIRATORY_PERCENTAGE),
            described.as_deref().and_then(percentage),
            layers.text(tag::ACQUISITION_DATE_TIME),
            layers.text(tag::ACQUISITION_TIME),
            layers.text(tag::CONTENT_TIME),
        ],
        segment: integer(tag::REFERENCED_SEGMENT),
    }
}

/// Refuses frames that the pixels cannot be, before anything is kept of each of them.
fn check_frames(
    data: &DataSet,
    [rows, columns]: [u16; 2],
    frames: usize,
    pixels: Option<&Pixels>,
) -> Result<(), VolumeError> {
    let bits = data.integer(tag::BITS_ALLOCATED).unwrap_or(0).max(1);
    let most = match pixels {
        None => 0,
        Some(Pixels::Plain { bytes, .. }) => {
            let bits = u64::from(rows) * u64::from(columns) * bits.unsigned_abs();
            bytes.saturating_mul(8) / bits
        }
        // Each begins with a piece of its own.
        Some(Pixels::Fragments { pieces, .. }) => pieces.len() as u64,
    };
    // A single one says by itself what is missing.
    if frames > 1 && frames as u64 > most {
        return Err(VolumeError::refused(format!(
            "the file is truncated: it states {frames} frames, but has pixels of {most}"
        ))
        .hint("copy or export it again"));
    }
    Ok(())
}

/// A problem with an element of a file.
pub(super) fn named(problem: VolumeError, file: &str) -> VolumeError {
    let place = match &problem {
        VolumeError::Refused {
            place: Some(place), ..
        } => format!("{file}, {place}"),
        _ => file.to_owned(),
    };
    problem.at(place)
}

fn short(data: &DataSet, tag: Tag) -> Option<u16> {
    u16::try_from(data.integer(tag)?)
        .ok()
        .filter(|count| *count > 0)
}

fn positive(layers: &Layers, tag: Tag) -> Option<f64> {
    layers
        .real(tag)
        .ok()
        .flatten()
        .filter(|number| *number > 0.0)
}

fn plane(layers: &Layers) -> Result<Plane, VolumeError> {
    let missing = |what: &str, tag| {
        VolumeError::refused(format!("there is no {what}: the slice position is unknown"))
            .at(tag::written(tag))
            .hint("export the original images of the scanner, not secondary captures")
    };
    let position = layers
        .array::<3>(tag::POSITION)?
        .ok_or_else(|| missing("ImagePositionPatient", tag::POSITION))?;
    let [a, b, c, d, e, f] = layers
        .array::<6>(tag::ORIENTATION)?
        .ok_or_else(|| missing("ImageOrientationPatient", tag::ORIENTATION))?;
    let spacing_mm = layers
        .array::<2>(tag::PIXEL_SPACING)?
        .ok_or_else(|| missing("PixelSpacing", tag::PIXEL_SPACING))?;
    let (along_row, down_column) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
    let is_frame = (along_row.norm() - 1.0).abs() < COSINES
        && (down_column.norm() - 1.0).abs() < COSINES
        && along_row.dot(&down_column).abs() < COSINES;
    if !is_frame {
        return Err(VolumeError::refused(format!(
            "[{a}, {b}, {c}] and [{d}, {e}, {f}] are not perpendicular directions"
        ))
        .at(tag::written(tag::ORIENTATION))
        .hint("export the series again"));
    }
    if !spacing_mm.iter().all(|spacing| *spacing > 0.0) {
        return Err(VolumeError::refused(format!(
            "pixels are {} x {} mm apart",
            spacing_mm[0], spacing_mm[1]
        ))
        .at(tag::written(tag::PIXEL_SPACING))
        .hint("export the series again"));
    }
    // Written with few digits they are a little short or long, and not quite square to each other.
    let along_row = along_row / along_row.norm();
    let down_column = down_column - along_row * along_row.dot(&down_column);
    Ok(Plane {
        position_mm: Vector3::from(position),
        along_row,
        down_column: down_column / down_column.norm(),
        spacing_mm,
    })
}

fn rescale(layers: &Layers) -> Result<Rescale, VolumeError> {
    let has_table = layers.first(|data| data.items(tag::MODALITY_LUT).first().map(|_| ()));
    if has_table.is_some() {
        return Err(VolumeError::refused(
            "HU are given by a table (Modality LUT) instead of slope and intercept, which is not \
             supported",
        )
        .at(tag::written(tag::MODALITY_LUT))
        .hint("export it as CT Image Storage with RescaleSlope and RescaleIntercept"));
    }
    let slope = layers.real(tag::SLOPE)?.unwrap_or(1.0);
    let intercept = layers.real(tag::INTERCEPT)?.unwrap_or(0.0);
    if slope == 0.0 {
        return Err(
            VolumeError::refused("the slope is 0: all voxels would be equal")
                .at(tag::written(tag::SLOPE))
                .hint("export the series again; stored values are HU if there is no slope"),
        );
    }
    Ok(Rescale { slope, intercept })
}

fn stored(data: &DataSet, syntax: &TransferSyntax) -> Result<Stored, VolumeError> {
    let samples = data.integer(tag::SAMPLES_PER_PIXEL).unwrap_or(1);
    let photometric = data.text(tag::PHOTOMETRIC).unwrap_or_default();
    if samples != 1 || !["MONOCHROME1", "MONOCHROME2", ""].contains(&photometric.as_str()) {
        return Err(VolumeError::refused(format!(
            "the pixels are colours ({photometric}, {samples} samples each), not numbers"
        ))
        .at(tag::written(tag::PHOTOMETRIC))
        .hint("remove screenshots and reports from the folder"));
    }
    let missing = |tag| {
        VolumeError::refused("the pixel format is not stated")
            .at(tag::written(tag))
            .hint("export the series again")
    };
    let allocated = data
        .integer(tag::BITS_ALLOCATED)
        .ok_or_else(|| missing(tag::BITS_ALLOCATED))?;
    let bits = data.integer(tag::BITS_STORED).unwrap_or(allocated);
    let high = data.integer(tag::HIGH_BIT).unwrap_or(bits - 1);
    let is_signed = data.integer(tag::PIXEL_REPRESENTATION) == Some(1);
    let kind = match (allocated, is_signed) {
        // Masks of a segmentation, of which nothing but whether they are 0 counts.
        (1 | 8, false) => Kind::U8,
        (8, true) => Kind::I8,
        (16, false) => Kind::U16,
        (16, true) => Kind::I16,
        (32, false) => Kind::U32,
        (32, true) => Kind::I32,
        _ => {
            return Err(VolumeError::refused(format!(
                "pixels of {allocated} bits are not supported"
            ))
            .at(tag::written(tag::BITS_ALLOCATED))
            .hint("convert them to 16 bits with gdcmconv --raw IN OUT (GDCM)"));
        }
    };
    if bits < 1 || bits > allocated || high >= allocated || high + 1 < bits {
        return Err(VolumeError::refused(format!(
            "{bits} bits up to bit {high} do not fit into {allocated}"
        ))
        .at(tag::written(tag::BITS_STORED))
        .hint("export the series again"));
    }
    let bits = u32::try_from(bits).unwrap_or(0);
    let high = u32::try_from(high).unwrap_or(0);
    Ok(Stored {
        kind,
        is_big_endian: syntax.encoding().is_big_endian,
        bits: (i64::from(bits) != allocated).then_some((bits, high)),
    })
}

/// Padding is written with the sign of the pixels, whatever its VR says.
fn padding(data: &DataSet, is_signed: bool) -> Option<[f64; 2]> {
    let number = |tag| {
        let bits = u16::try_from(data.integer(tag)? & 0xFFFF).ok()?;
        Some(if is_signed {
            f64::from(bits.cast_signed())
        } else {
            f64::from(bits)
        })
    };
    let one = number(tag::PADDING)?;
    let other = number(tag::PADDING_LIMIT).unwrap_or(one);
    Some([one.min(other), one.max(other)])
}

fn segment_name(item: &DataSet, number: u16) -> String {
    let meaning = |items: &[DataSet]| items.first()?.text(tag::CODE_MEANING);
    let types = item.items(tag::SEGMENT_TYPE);
    let modifiers = types
        .first()
        .map(|each| each.items(tag::SEGMENT_TYPE_MODIFIER));
    name_of(
        item.text(tag::SEGMENT_LABEL).as_ref(),
        meaning(types),
        modifiers.and_then(meaning),
        number.into(),
    )
}

fn segmentation(data: &DataSet) -> Option<Segmentation> {
    let kind = data.text(tag::SEGMENTATION_TYPE)?;
    let segments = data.items(tag::SEGMENTS).iter().filter_map(|item| {
        let number = u16::try_from(item.integer(tag::SEGMENT_NUMBER)?).ok()?;
        Some((number, segment_name(item, number)))
    });
    Some(Segmentation {
        kind,
        greatest_fraction: data
            .integer(tag::GREATEST_FRACTION)
            .and_then(|greatest| u32::try_from(greatest).ok())
            .filter(|greatest| *greatest > 0)
            .unwrap_or(255),
        segments: segments.collect(),
    })
}

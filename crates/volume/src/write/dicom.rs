//! A series of CT images: explicit little endian, one file a slice.
//!
//! Only what the standard requires of CT images, and the slice geometry. The patient is anonymous; no date or time.
//! The same volume has the same identifiers.

use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::AtomicBool;

use sha2::{Digest, Sha256};

use super::file::{go_on, write_whole};
use crate::{ImageCircle, Volume, VolumeError};

const EXPLICIT_LITTLE_ENDIAN: &str = "1.2.840.10008.1.2.1";
const CT_IMAGE_STORAGE: &str = "1.2.840.10008.5.1.4.1.1.2";
/// Stored values are Hounsfield units less this, as of most scanners.
const INTERCEPT_HU: i16 = -1024;
/// Stored outside the field of view: a value that is never measured, as manufacturers usually choose it.
const PADDING: i16 = -2000;

/// What a series says of itself besides its voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct DicomSeries {
    /// Identifier of the patient.
    pub patient_id: String,
    /// What the series is, in words.
    pub description: String,
    /// Name of the kernel.
    pub kernel: String,
    /// Tilt of the gantry, rad: for information, geometry is in the positions.
    pub gantry_tilt_rad: f64,
    /// `HFS` on the back, `HFP` prone, `HFDL` and `HFDR` on the left and on the right side.
    pub patient_position: String,
    /// Whether what is outside the circle within the image is stored as padding.
    pub has_padding: bool,
}

/// Writes a volume as `IM00001.dcm` and so on into a folder, which is there whole or not at all. A folder of such files is
/// replaced, any other one refused.
pub fn write_dicom(
    folder: &Path,
    volume: &Volume,
    series: &DicomSeries,
    cancel: &AtomicBool,
) -> Result<(), VolumeError> {
    let refuse = |error: io::Error| {
        VolumeError::refused(format!("cannot be written: {error}")).at(folder.display().to_string())
    };
    let parent = match folder.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    check_replaceable(folder)?;
    let made = tempfile::Builder::new()
        .prefix(".")
        .tempdir_in(parent)
        .map_err(refuse)?;
    let images = made.path().join("images");
    std::fs::create_dir(&images).map_err(refuse)?;
    let image = Image::new(volume, series)?;
    let mut bytes = Vec::new();
    for slice in 0..volume.grid.size()[2] {
        go_on(cancel).map_err(|_| VolumeError::Interrupted)?;
        image.encode(slice, &mut bytes);
        let path = images.join(format!("IM{:05}.dcm", slice + 1));
        write_whole(&path, |file| file.write_all(&bytes))?;
    }
    if folder.exists() {
        std::fs::rename(folder, made.path().join("before")).map_err(refuse)?;
    }
    std::fs::rename(&images, folder).map_err(refuse)
}

fn check_replaceable(folder: &Path) -> Result<(), VolumeError> {
    let place = || folder.display().to_string();
    if !folder.exists() {
        return Ok(());
    }
    let entries = std::fs::read_dir(folder).map_err(|error| {
        VolumeError::refused(format!("cannot use the folder for the series: {error}")).at(place())
    })?;
    for entry in entries.flatten() {
        let path = entry.path();
        let is_ours = path.extension() == Some(OsStr::new("dcm"))
            && path
                .file_name()
                .is_some_and(|name| name.to_string_lossy().starts_with("IM"));
        if !is_ours {
            let message = format!(
                "it contains `{}`, which is not an image of a series",
                entry.file_name().display()
            );
            return Err(VolumeError::refused(message)
                .at(place())
                .hint("choose another folder"));
        }
    }
    Ok(())
}

/// What all images of a series have in common.
struct Image<'v> {
    volume: &'v Volume,
    series: &'v DicomSeries,
    intercept_hu: i16,
    identity: [u8; 32],
}

impl<'v> Image<'v> {
    fn new(volume: &'v Volume, series: &'v DicomSeries) -> Result<Self, VolumeError> {
        let [columns, rows, _] = volume.grid.size();
        if columns > usize::from(u16::MAX) || rows > usize::from(u16::MAX) {
            let message =
                format!("{columns} x {rows} pixels; a DICOM image has 65535 x 65535 at most");
            return Err(VolumeError::refused(message));
        }
        // Of values that no scanner has, up to the ends of 16 bits.
        let fits = volume
            .hu
            .iter()
            .all(|hu| hu.checked_sub(INTERCEPT_HU).is_some());
        let mut hash = Sha256::new();
        for hu in &volume.hu {
            hash.update(hu.to_le_bytes());
        }
        hash.update(format!("{:?} {series:?}", volume.grid));
        Ok(Self {
            volume,
            series,
            intercept_hu: if fits { INTERCEPT_HU } else { 0 },
            identity: hash.finalize().into(),
        })
    }

    /// An identifier of what it names, of this volume.
    fn uid(&self, what: &str) -> String {
        let hash = Sha256::new()
            .chain_update(self.identity)
            .chain_update(what)
            .finalize();
        let mut number = [0; 16];
        number.copy_from_slice(&hash[..16]);
        format!("2.25.{}", u128::from_be_bytes(number))
    }

    fn encode(&self, slice: usize, bytes: &mut Vec<u8>) {
        bytes.clear();
        let instance = self.uid(&format!("image {slice}"));
        let mut meta = Elements(Vec::new());
        meta.put(0x0002_0001, *b"OB", &[0, 1]);
        meta.text(0x0002_0002, *b"UI", CT_IMAGE_STORAGE);
        meta.text(0x0002_0003, *b"UI", &instance);
        meta.text(0x0002_0010, *b"UI", EXPLICIT_LITTLE_ENDIAN);
        meta.text(
            0x0002_0012,
            *b"UI",
            &format!("2.25.{}", u128::from_be_bytes(*b"needlebench CT w")),
        );
        let mut length = Elements(Vec::new());
        length.put(
            0x0002_0000,
            *b"UL",
            &u32::try_from(meta.0.len()).unwrap_or(0).to_le_bytes(),
        );
        bytes.extend([0; 128]);
        bytes.extend(b"DICM");
        bytes.extend(length.0);
        bytes.extend(meta.0);
        bytes.extend(self.elements(slice, &instance).0);
    }

    /// In the order of their tags.
    fn elements(&self, slice: usize, instance: &str) -> Elements {
        let grid = &self.volume.grid;
        let [columns, rows, _] = grid.size();
        let [width_m, height_m, _] = grid.spacing_m();
        let steps = grid.steps_m();
        let first = grid.ct_from_index(&nalgebra::Point3::new(0.0, 0.0, slice as f64));
        let direction: Vec<f64> = steps
            .column(0)
            .unscale(width_m)
            .iter()
            .chain(steps.column(1).unscale(height_m).iter())
            .copied()
            .collect();
        let circle_mm = 1e3 * (columns as f64 * width_m).min(rows as f64 * height_m);
        let number = (slice + 1).to_string();

        let mut all = Elements(Vec::new());
        all.text(0x0008_0005, *b"CS", "ISO_IR 100");
        all.text(0x0008_0008, *b"CS", "ORIGINAL\\PRIMARY\\AXIAL");
        all.text(0x0008_0016, *b"UI", CT_IMAGE_STORAGE);
        all.text(0x0008_0018, *b"UI", instance);
        all.text(0x0008_0020, *b"DA", "");
        all.text(0x0008_0030, *b"TM", "");
        all.text(0x0008_0050, *b"SH", "");
        all.text(0x0008_0060, *b"CS", "CT");
        all.text(0x0008_0070, *b"LO", "needlebench");
        all.text(0x0008_0090, *b"PN", "");
        all.text(0x0008_103E, *b"LO", &self.series.description);
        all.text(0x0008_1090, *b"LO", "synthetic CT");
        all.text(0x0010_0010, *b"PN", "SYNTHETIC^PHANTOM");
        all.text(0x0010_0020, *b"LO", &self.series.patient_id);
        all.text(0x0010_0030, *b"DA", "");
        all.text(0x0010_0040, *b"CS", "");
        all.text(0x0018_0015, *b"CS", "CHEST");
        if let Some(thickness_m) = self.volume.slice_thickness_m {
            all.decimals(0x0018_0050, &[1e3 * thickness_m]);
        } else {
            all.text(0x0018_0050, *b"DS", "");
        }
        all.text(0x0018_0060, *b"DS", "120");
        all.decimals(0x0018_1100, &[circle_mm]);
        all.decimals(0x0018_1120, &[self.series.gantry_tilt_rad.to_degrees()]);
        all.text(0x0018_1210, *b"SH", &self.series.kernel);
        all.text(0x0018_5100, *b"CS", &self.series.patient_position);
        all.text(0x0020_000D, *b"UI", &self.uid("study"));
        all.text(0x0020_000E, *b"UI", &self.uid("series"));
        all.text(0x0020_0010, *b"SH", "1");
        all.text(0x0020_0011, *b"IS", "1");
        all.text(0x0020_0012, *b"IS", "1");
        all.text(0x0020_0013, *b"IS", &number);
        all.decimals(0x0020_0032, &first.coords.map(|m| 1e3 * m).data.0[0]);
        all.decimals(0x0020_0037, &direction);
        all.text(0x0020_0052, *b"UI", &self.uid("frame of reference"));
        all.text(0x0020_1040, *b"LO", "");
        all.decimals(0x0020_1041, &[1e3 * first.z]);
        all.short(0x0028_0002, 1);
        all.text(0x0028_0004, *b"CS", "MONOCHROME2");
        all.short(0x0028_0010, rows);
        all.short(0x0028_0011, columns);
        all.decimals(0x0028_0030, &[1e3 * height_m, 1e3 * width_m]);
        all.short(0x0028_0100, 16);
        all.short(0x0028_0101, 16);
        all.short(0x0028_0102, 15);
        all.short(0x0028_0103, 1);
        if self.series.has_padding {
            all.put(0x0028_0120, *b"SS", &PADDING.to_le_bytes());
        }
        all.text(0x0028_1050, *b"DS", "40");
        all.text(0x0028_1051, *b"DS", "400");
        all.text(0x0028_1052, *b"DS", &self.intercept_hu.to_string());
        all.text(0x0028_1053, *b"DS", "1");
        all.text(0x0028_1054, *b"LO", "HU");
        all.put(0x7FE0_0010, *b"OW", &self.pixels(slice));
        all
    }

    fn pixels(&self, slice: usize) -> Vec<u8> {
        let [columns, rows, _] = self.volume.grid.size();
        let start = self.volume.grid.offset([0, 0, slice]);
        let values = &self.volume.hu[start..start + columns * rows];
        let mut bytes = Vec::with_capacity(2 * values.len());
        let circle = ImageCircle::new([columns, rows]);
        for (j, row) in values.chunks_exact(columns).enumerate() {
            for (i, hu) in row.iter().enumerate() {
                let is_padding = self.series.has_padding && circle.share(i, j) > 1.0;
                let stored = if is_padding {
                    PADDING
                } else {
                    hu.saturating_sub(self.intercept_hu)
                };
                bytes.extend(stored.to_le_bytes());
            }
        }
        bytes
    }
}

/// Elements of a data set, one after the other.
struct Elements(Vec<u8>);

impl Elements {
    fn put(&mut self, tag: u32, vr: [u8; 2], value: &[u8]) {
        let [group, element] = [tag >> 16, tag & 0xFFFF].map(u32::to_le_bytes);
        self.0.extend([group[0], group[1], element[0], element[1]]);
        self.0.extend(vr);
        let is_odd = value.len() % 2 == 1;
        let length = value.len() + usize::from(is_odd);
        if matches!(&vr, b"OB" | b"OW") {
            self.0.extend([0, 0]);
            self.0
                .extend(u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
        } else {
            self.0
                .extend(u16::try_from(length).unwrap_or(u16::MAX).to_le_bytes());
        }
        self.0.extend(value);
        if is_odd {
            // Identifiers are filled up with a zero, texts with a space.
            self.0.push(if &vr == b"UI" { 0 } else { b' ' });
        }
    }

    /// Of a text that is longer than the standard allows, what it allows; what is not ASCII is a question mark.
    fn text(&mut self, tag: u32, vr: [u8; 2], text: &str) {
        let most = match &vr {
            b"CS" if !text.contains('\\') => 16,
            b"SH" => 16,
            _ => 64,
        };
        let plain = |each: char| {
            if each.is_ascii() && !each.is_ascii_control() {
                each as u8
            } else {
                b'?'
            }
        };
        let bytes: Vec<u8> = text.chars().map(plain).take(most).collect();
        self.put(tag, vr, &bytes);
    }

    fn short(&mut self, tag: u32, value: usize) {
        self.put(
            tag,
            *b"US",
            &u16::try_from(value).unwrap_or(u16::MAX).to_le_bytes(),
        );
    }

    fn decimals(&mut self, tag: u32, values: &[f64]) {
        let texts: Vec<String> = values.iter().map(|value| decimal(*value)).collect();
        let text = texts.join("\\");
        self.put(tag, *b"DS", text.as_bytes());
    }
}

/// As exact as 16 characters allow.
fn decimal(value: f64) -> String {
    const MOST: usize = 16;
    let exact = value.to_string();
    if exact.len() <= MOST {
        return exact;
    }
    let fixed = (0..MOST)
        .rev()
        .map(|digits| format!("{value:.digits$}"))
        .find(|text| text.len() <= MOST);
    match fixed {
        Some(text) if text.parse::<f64>() == Ok(0.0) => "0".to_owned(),
        Some(text) => text,
        None => format!("{value:.8e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_keep_to_sixteen_characters_and_to_what_these_can_say() {
        for (value, text) in [
            (0.0, "0"),
            (-0.5, "-0.5"),
            (-178.85, "-178.85"),
            (1.0 / 3.0, "0.33333333333333"),
            (-2.0 / 3.0, "-0.6666666666667"),
            (1e-17, "0"),
        ] {
            assert_eq!(decimal(value), text);
        }
        for value in [
            1e300,
            -1e-5 / 3.0,
            -123_456.789_012_345_6,
            f64::from(u32::MAX) / 7.0,
        ] {
            let text = decimal(value);
            assert!(text.len() <= 16, "{text}");
            let read: f64 = text.parse().unwrap();
            assert!(
                (read - value).abs() <= 1e-8 * value.abs().max(1e-3),
                "{text} for {value}"
            );
        }
    }

    #[test]
    fn odd_lengths_are_filled_up_as_the_type_wants_it() {
        let mut elements = Elements(Vec::new());
        elements.text(0x0002_0010, *b"UI", "1.2");
        elements.text(0x0008_0060, *b"CS", "CTX");
        elements.put(0x7FE0_0010, *b"OW", &[1, 2]);
        assert_eq!(
            elements.0,
            b"\x02\0\x10\0UI\x04\x001.2\0\x08\0\x60\0CS\x04\0CTX \xe0\x7f\x10\0OW\0\0\x02\0\0\0\x01\x02"
        );
    }

    #[test]
    fn a_series_replaces_a_series_and_nothing_else() {
        let grid =
            crate::VoxelGrid::aligned([4, 4, 3], [1e-3; 3], nalgebra::Point3::origin()).unwrap();
        let volume = Volume {
            hu: vec![40; grid.len()],
            grid,
            slice_thickness_m: Some(1e-3),
        };
        let series = DicomSeries {
            patient_id: "phantom".to_owned(),
            description: "test".to_owned(),
            kernel: "smooth".to_owned(),
            gantry_tilt_rad: 0.0,
            patient_position: "HFS".to_owned(),
            has_padding: false,
        };
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("dicom");
        let go = AtomicBool::new(false);
        write_dicom(&place, &volume, &series, &go).unwrap();
        let first = std::fs::read(place.join("IM00003.dcm")).unwrap();
        write_dicom(&place, &volume, &series, &go).unwrap();
        assert_eq!(std::fs::read(place.join("IM00003.dcm")).unwrap(), first);
        assert_eq!(place.read_dir().unwrap().count(), 3);
        assert_eq!(
            write_dicom(&place, &volume, &series, &AtomicBool::new(true)),
            Err(VolumeError::Interrupted)
        );
        assert_eq!(place.read_dir().unwrap().count(), 3);
        std::fs::write(place.join("notes.txt"), "mine").unwrap();
        let refused = write_dicom(&place, &volume, &series, &go).unwrap_err();
        assert!(
            matches!(refused, VolumeError::Refused { message, .. } if message.contains("notes.txt"))
        );
        assert_eq!(
            folder.path().read_dir().unwrap().count(),
            1,
            "nothing temporary is left"
        );
    }
}

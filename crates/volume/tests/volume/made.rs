//! Small files, byte by byte.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use needlebench_volume::VolumeError;
use needlebench_volume::read::{ReadOptions, ReadVolume, read_volume};

/// Of the volumes made here.
pub const SIZE: [usize; 3] = [5, 4, 3];

/// Bytes of a number in little or big endian.
pub type BytesOf = fn(i16) -> Vec<u8>;

/// Reads with one thread.
pub fn read(path: &Path, options: &ReadOptions) -> Result<ReadVolume, VolumeError> {
    read_volume(path, options, 1, &AtomicBool::new(false))
}

/// Reads bytes as the file `name`.
pub fn read_as(name: &str, bytes: &[u8]) -> Result<ReadVolume, VolumeError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path, &ReadOptions::default())
}

/// Message, place and hint of a refusal.
pub fn refusal<T: std::fmt::Debug>(result: Result<T, VolumeError>) -> String {
    match result {
        Err(VolumeError::Refused {
            place,
            message,
            hint,
        }) => {
            format!(
                "{} {message} {}",
                place.unwrap_or_default(),
                hint.unwrap_or_default()
            )
        }
        other => panic!("it was not refused: {other:?}"),
    }
}

/// All remarks in one text.
pub fn remarks(read: &ReadVolume) -> String {
    let texts: Vec<String> = read
        .remarks
        .iter()
        .map(|remark| {
            format!(
                "{} {}",
                remark.place.as_deref().unwrap_or_default(),
                remark.message
            )
        })
        .collect();
    texts.join("; ")
}

/// HU of voxel (i, j, k) of the volumes made here: half of it is air.
pub fn hu_at(index: usize) -> i16 {
    if index % SIZE[0] < 2 {
        -1000
    } else {
        i16::try_from(index).unwrap() - 20
    }
}

/// A NIfTI-1 file of 16-bit numbers, or a NIfTI-2 file, in either byte order: sform with steps of -0.5, 0.75 and 2 mm.
pub fn nifti(version: u8, is_big_endian: bool) -> Vec<u8> {
    let ordered = |mut bytes: Vec<u8>| {
        if is_big_endian {
            bytes.reverse();
        }
        bytes
    };
    let length = if version == 1 { 352 } else { 544 };
    let mut header = vec![0; length];
    let mut put = |at: usize, bytes: Vec<u8>| {
        let bytes = ordered(bytes);
        header[at..at + bytes.len()].copy_from_slice(&bytes);
    };
    let short = |number: i16| number.to_le_bytes().to_vec();
    let rows: [[f64; 4]; 3] = [
        [-0.5, 0.0, 0.0, 10.0],
        [0.0, 0.75, 0.0, -20.0],
        [0.0, 0.0, 2.0, 30.0],
    ];
    if version == 1 {
        put(0, 348_i32.to_le_bytes().to_vec());
        for (at, length) in [3, 5, 4, 3, 1, 1, 1, 1].into_iter().enumerate() {
            put(40 + 2 * at, short(length));
        }
        put(70, short(4));
        put(72, short(16));
        for (at, spacing) in [1.0_f32, 0.5, 0.75, 2.0].into_iter().enumerate() {
            put(76 + 4 * at, spacing.to_le_bytes().to_vec());
        }
        put(108, 352_f32.to_le_bytes().to_vec());
        put(123, vec![2]);
        put(254, short(1));
        for (at, number) in rows.concat().into_iter().enumerate() {
            #[expect(clippy::cast_possible_truncation, reason = "few digits")]
            put(280 + 4 * at, (number as f32).to_le_bytes().to_vec());
        }
        header[344..348].copy_from_slice(b"n+1\0");
    } else {
        put(0, 540_i32.to_le_bytes().to_vec());
        put(12, short(4));
        put(14, short(16));
        for (at, length) in [3_i64, 5, 4, 3, 1, 1, 1, 1].into_iter().enumerate() {
            put(16 + 8 * at, length.to_le_bytes().to_vec());
        }
        for (at, spacing) in [1.0_f64, 0.5, 0.75, 2.0].into_iter().enumerate() {
            put(104 + 8 * at, spacing.to_le_bytes().to_vec());
        }
        put(168, 544_i64.to_le_bytes().to_vec());
        put(348, 1_i32.to_le_bytes().to_vec());
        for (at, number) in rows.concat().into_iter().enumerate() {
            put(400 + 8 * at, number.to_le_bytes().to_vec());
        }
        put(500, 2_i32.to_le_bytes().to_vec());
        header[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
    }
    for index in 0..SIZE.iter().product() {
        header.extend(ordered(hu_at(index).to_le_bytes().to_vec()));
    }
    header
}

/// An MGH file of 16-bit numbers: steps of -0.5, 0.75 and 2 mm in RAS, (1, 2, 3) mm in the middle.
pub fn mgh() -> Vec<u8> {
    let mut bytes = Vec::new();
    for number in [1_i32, 5, 4, 3, 1, 4, 0] {
        bytes.extend(number.to_be_bytes());
    }
    bytes.extend(1_i16.to_be_bytes());
    let numbers: [f32; 15] = [
        0.5, 0.75, 2.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0,
    ];
    bytes.extend(numbers.into_iter().flat_map(f32::to_be_bytes));
    bytes.resize(284, 0);
    for index in 0..SIZE.iter().product() {
        bytes.extend(hu_at(index).to_be_bytes());
    }
    // Times of the scan, and a tag with a name.
    bytes.extend([0; 20]);
    bytes.extend(b"Zyxwvut");
    bytes
}

/// A NRRD file of 8-bit numbers in two layers, with a segment in each.
pub fn layered_nrrd() -> Vec<u8> {
    let mut bytes = b"NRRD0004\ntype: uchar\ndimension: 4\nspace: right-anterior-superior\nsizes: 2 5 4 3\n\
         space directions: none (-0.5,0,0) (0,0.75,0) (0,0,2)\nkinds: list domain domain domain\nencoding: raw\n\
         space origin: (10,-20,30)\nSegment0_Name:=lung left\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n\
         Segment1_Name:=rib\nSegment1_LabelValue:=1\nSegment1_Layer:=1\n\n"
        .to_vec();
    bytes.extend((0..120).map(|at| u8::from(at % 3 == 0)));
    bytes
}

/// A MetaImage file of 16-bit numbers.
pub fn metaimage() -> Vec<u8> {
    let mut bytes = b"ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
         CompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -10 20 30\nElementSpacing = 0.5 0.75 2\n\
         DimSize = 5 4 3\nElementType = MET_SHORT\nElementDataFile = LOCAL\n"
        .to_vec();
    bytes.extend((0..SIZE.iter().product()).flat_map(|index| hu_at(index).to_le_bytes()));
    bytes
}

/// Of a slice: what tests change.
#[derive(Debug, Clone)]
pub struct Slice {
    pub position: String,
    pub orientation: String,
    pub series: u32,
    pub instance: String,
    pub extra: Vec<(u32, [u8; 2], Vec<u8>)>,
    pub without: Vec<u32>,
    pub pixels: Vec<u8>,
    pub syntax: &'static str,
}

impl Slice {
    /// At a height in mm.
    pub fn at(height_mm: f64) -> Self {
        let pixels = (0..SIZE[0] * SIZE[1])
            .flat_map(|index| (hu_at(index) + 1024).to_le_bytes())
            .collect();
        Self {
            position: format!("-10\\20\\{height_mm}"),
            orientation: "1\\0\\0\\0\\1\\0".to_owned(),
            series: 4,
            instance: format!("1.2.{}", (height_mm * 1e3).abs()),
            extra: Vec::new(),
            without: Vec::new(),
            pixels,
            syntax: "1.2.840.10008.1.2.1",
        }
    }

    /// With another element, or another value of one.
    pub fn with(mut self, tag: u32, vr: [u8; 2], value: impl Into<Vec<u8>>) -> Self {
        self.extra.push((tag, vr, value.into()));
        self
    }

    /// Without an element.
    pub fn without(mut self, tag: u32) -> Self {
        self.without.push(tag);
        self
    }

    /// The file.
    pub fn bytes(&self) -> Vec<u8> {
        let text = |tag: u32, vr: &[u8; 2], text: &str| (tag, *vr, text.as_bytes().to_vec());
        let short = |tag: u32, number: usize| {
            (
                tag,
                *b"US",
                u16::try_from(number).unwrap().to_le_bytes().to_vec(),
            )
        };
        let mut elements = vec![
            text(0x0008_0016, b"UI", "1.2.840.10008.5.1.4.1.1.2"),
            text(0x0008_0018, b"UI", &self.instance),
            text(0x0008_0060, b"CS", "CT"),
            text(0x0010_0010, b"PN", "Zyxwvut^Abcdefg"),
            text(0x0010_0020, b"LO", "ID-7318264"),
            text(0x0010_0030, b"DA", "19431127"),
            text(0x0018_0050, b"DS", "2"),
            text(0x0020_000E, b"UI", &format!("1.2.{}", self.series)),
            text(0x0020_0011, b"IS", &self.series.to_string()),
            text(0x0020_0032, b"DS", &self.position),
            text(0x0020_0037, b"DS", &self.orientation),
            short(0x0028_0002, 1),
            text(0x0028_0004, b"CS", "MONOCHROME2"),
            short(0x0028_0010, SIZE[1]),
            short(0x0028_0011, SIZE[0]),
            text(0x0028_0030, b"DS", "0.75\\0.5"),
            short(0x0028_0100, 16),
            short(0x0028_0101, 16),
            short(0x0028_0102, 15),
            short(0x0028_0103, 0),
            text(0x0028_1052, b"DS", "-1024"),
            text(0x0028_1053, b"DS", "1"),
        ];
        for (tag, vr, value) in &self.extra {
            elements.retain(|(other, ..)| other != tag);
            elements.push((*tag, *vr, value.clone()));
        }
        elements.retain(|(tag, ..)| !self.without.contains(tag));
        elements.sort_by_key(|(tag, ..)| *tag);
        elements.push((0x7FE0_0010, *b"OW", self.pixels.clone()));
        let mut bytes = vec![0; 128];
        bytes.extend(b"DICM");
        write(&mut bytes, 0x0002_0010, *b"UI", self.syntax.as_bytes());
        for (tag, vr, value) in elements {
            write(&mut bytes, tag, vr, &value);
        }
        bytes
    }
}

/// An element with explicit VR, padded to even length.
pub fn write(bytes: &mut Vec<u8>, tag: u32, vr: [u8; 2], value: &[u8]) {
    let length = value.len().next_multiple_of(2);
    for half in [tag >> 16, tag & 0xFFFF] {
        bytes.extend(u16::try_from(half).unwrap().to_le_bytes());
    }
    bytes.extend(vr);
    if matches!(&vr, b"OW" | b"OB" | b"UN" | b"SQ") {
        bytes.extend([0, 0]);
        bytes.extend(u32::try_from(length).unwrap().to_le_bytes());
    } else {
        bytes.extend(u16::try_from(length).unwrap().to_le_bytes());
    }
    bytes.extend(value);
    let pad = if matches!(&vr, b"UI" | b"OB" | b"OW") {
        0
    } else {
        b' '
    };
    bytes.resize(bytes.len() + length - value.len(), pad);
}

/// A folder of slices, and where it is.
pub fn folder(slices: &[Slice]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    for (at, slice) in slices.iter().enumerate() {
        // Names in another order than places.
        let name = format!("IM{:04}", 7 * (at + 3) % 101);
        std::fs::write(folder.path().join(name), slice.bytes()).unwrap();
    }
    let path = folder.path().to_owned();
    (folder, path)
}

/// Reads slices as a folder.
pub fn read_slices(slices: &[Slice], options: &ReadOptions) -> Result<ReadVolume, VolumeError> {
    let (_folder, path) = folder(slices);
    read(&path, options)
}

/// So many slices, 2 mm apart.
pub fn stack(count: u32) -> Vec<Slice> {
    (0..count)
        .map(|at| Slice::at(f64::from(at) * 2.0))
        .collect()
}

/// An item of a sequence.
pub fn item(elements: &[(u32, [u8; 2], Vec<u8>)]) -> Vec<u8> {
    let mut inner = Vec::new();
    for (tag, vr, value) in elements {
        write(&mut inner, *tag, *vr, value);
    }
    let mut bytes = vec![0xFE, 0xFF, 0x00, 0xE0];
    bytes.extend(u32::try_from(inner.len()).unwrap().to_le_bytes());
    bytes.extend(inner);
    bytes
}

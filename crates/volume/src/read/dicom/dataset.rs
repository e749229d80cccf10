//! Elements of a DICOM file: those that are wanted, and where the pixels are.
//!
//! Values are taken as the bytes that they are, and understood by what the element is, not by the VR that a file
//! gives it: where a slope has VR UN, its text is still a text. A length is held against what is left of the file
//! before anything is read.

use std::collections::BTreeMap;
use std::io::{Read, Seek, SeekFrom};

use super::tag::{self, Tag};
use crate::VolumeError;
use crate::read::unreadable;

/// Sequences in sequences: more are no image.
const DEPTH: usize = 12;

/// Bytes that a wanted value may have: image types and texts are short.
const VALUE_BYTES: u64 = 1 << 14;

/// Bytes that the points of a contour may have.
const CONTOUR_BYTES: u64 = 1 << 26;

/// Items of all sequences together: an image has at most a handful for each of its frames.
const ITEMS: usize = 1 << 20;

const UNDEFINED: u64 = 0xFFFF_FFFF;

/// What a file holds.
#[derive(Debug, Default)]
pub(super) struct DataSet {
    values: BTreeMap<Tag, Value>,
    sequences: BTreeMap<Tag, Vec<DataSet>>,
    is_big_endian: bool,
}

#[derive(Debug)]
struct Value {
    vr: [u8; 2],
    bytes: Vec<u8>,
}

/// Where pixels are in a file, as offsets and lengths in bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Pixels {
    /// As they are.
    Plain { offset: u64, bytes: u64 },
    /// Compressed, in pieces; and where frames begin, counted from the first piece's item.
    Fragments {
        pieces: Vec<(u64, u64)>,
        starts: Vec<u32>,
    },
}

/// How elements are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Encoding {
    pub(super) is_explicit: bool,
    pub(super) is_big_endian: bool,
}

impl Encoding {
    pub(super) const IMPLICIT: Self = Self {
        is_explicit: false,
        is_big_endian: false,
    };
    pub(super) const EXPLICIT: Self = Self {
        is_explicit: true,
        is_big_endian: false,
    };
    pub(super) const BIG_ENDIAN: Self = Self {
        is_explicit: true,
        is_big_endian: true,
    };
}

impl DataSet {
    /// A text without its padding, and without what terminals would take for a command.
    pub(super) fn text(&self, tag: Tag) -> Option<String> {
        let bytes = &self.values.get(&tag)?.bytes;
        let text = String::from_utf8_lossy(bytes);
        let text: String = text.chars().filter(|letter| !letter.is_control()).collect();
        let text = text.trim();
        (!text.is_empty()).then(|| text.to_owned())
    }

    /// Numbers: decimal or integer strings, or binary floats where the VR says that they are.
    pub(super) fn reals(&self, tag: Tag) -> Result<Option<Vec<f64>>, VolumeError> {
        let Some(value) = self.values.get(&tag) else {
            return Ok(None);
        };
        let binary = match &value.vr {
            b"FD" => Some(8),
            b"FL" => Some(4),
            _ => None,
        };
        if let Some(size) = binary {
            let numbers = value.bytes.chunks_exact(size).map(|chunk| {
                let mut bytes = chunk.to_vec();
                if self.is_big_endian {
                    bytes.reverse();
                }
                match <[u8; 8]>::try_from(bytes.as_slice()) {
                    Ok(eight) => f64::from_le_bytes(eight),
                    Err(_) => <[u8; 4]>::try_from(bytes.as_slice())
                        .map_or(f64::NAN, |four| f64::from(f32::from_le_bytes(four))),
                }
            });
            let numbers: Vec<f64> = numbers.collect();
            if !numbers.iter().all(|number| number.is_finite()) {
                return Err(no_number(tag));
            }
            return Ok((!numbers.is_empty()).then_some(numbers));
        }
        let Some(text) = self.text(tag) else {
            return Ok(None);
        };
        let clean = |word: &str| {
            let number = word.trim().parse::<f64>().ok();
            number.filter(|number| number.is_finite())
        };
        match text.split('\\').map(clean).collect() {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(no_number(tag)),
        }
    }

    /// The first of the numbers.
    pub(super) fn real(&self, tag: Tag) -> Result<Option<f64>, VolumeError> {
        Ok(self
            .reals(tag)?
            .and_then(|numbers| numbers.first().copied()))
    }

    /// Just so many numbers.
    pub(super) fn array<const N: usize>(&self, tag: Tag) -> Result<Option<[f64; N]>, VolumeError> {
        let Some(numbers) = self.reals(tag)? else {
            return Ok(None);
        };
        let count = numbers.len();
        numbers.try_into().map(Some).map_err(|_| {
            VolumeError::refused(format!("has {count} numbers instead of {N}"))
                .at(tag::written(tag))
                .hint("correct the element, e.g. with dcmodify (DCMTK), or export the series again")
        })
    }

    /// An integer string, an unsigned long or an unsigned short, as the element has it.
    pub(super) fn integer(&self, tag: Tag) -> Option<i64> {
        if tag::INTEGER_STRINGS.contains(&tag) {
            return self.text(tag)?.parse().ok();
        }
        let size = if tag::LONGS.contains(&tag) { 4 } else { 2 };
        let mut bytes = self.values.get(&tag)?.bytes.get(..size)?.to_vec();
        if self.is_big_endian {
            bytes.reverse();
        }
        bytes.resize(8, 0);
        bytes.try_into().ok().map(i64::from_le_bytes)
    }

    /// Items of a sequence; none where there is no such sequence.
    pub(super) fn items(&self, tag: Tag) -> &[Self] {
        self.sequences.get(&tag).map_or(&[], Vec::as_slice)
    }

    /// The same, taken out.
    pub(super) fn take_items(&mut self, tag: Tag) -> Vec<Self> {
        self.sequences.remove(&tag).unwrap_or_default()
    }

    /// Takes over what stands in the sequences of one item that belong to a frame.
    pub(super) fn flatten(&mut self) {
        for tag in tag::OF_FRAME {
            for item in self.sequences.remove(&tag).unwrap_or_default() {
                self.values.extend(item.values);
            }
        }
    }
}

/// Reads elements one after the other.
#[derive(Debug)]
pub(super) struct Elements<R> {
    input: R,
    at: u64,
    end: u64,
    encoding: Encoding,
    items: usize,
    pixels: Option<Pixels>,
}

/// Tag, VR and length.
struct Head {
    tag: Tag,
    vr: [u8; 2],
    length: u64,
}

fn no_number(tag: Tag) -> VolumeError {
    VolumeError::refused("is not a number")
        .at(tag::written(tag))
        .hint("correct the element, e.g. with dcmodify (DCMTK), or export the series again")
}

/// Why elements cannot be read.
fn damaged(what: impl Into<String>, at: u64) -> VolumeError {
    let what = what.into();
    VolumeError::refused(format!("the file is damaged at byte {at}: {what}"))
        .hint("copy or export it again")
}

impl<R: Read + Seek> Elements<R> {
    /// From byte `at` on, of a file of `end` bytes.
    pub(super) fn new(
        mut input: R,
        at: u64,
        end: u64,
        encoding: Encoding,
    ) -> Result<Self, VolumeError> {
        input.seek(SeekFrom::Start(at)).map_err(unreadable)?;
        Ok(Self {
            input,
            at,
            end,
            encoding,
            items: 0,
            pixels: None,
        })
    }

    /// Of the group with the transfer syntax, and where it ends.
    pub(super) fn meta(mut self) -> Result<(DataSet, u64), VolumeError> {
        let mut found = self.empty();
        while self.end - self.at >= 8 {
            let start = self.at;
            let tag = self.tag()?;
            // What follows may be written in another way.
            if tag >> 16 != 2 {
                return Ok((found, start));
            }
            let head = self.head_of(tag)?;
            self.value(&head, self.end, &mut found, 0)?;
        }
        Ok((found, self.at))
    }

    /// Of the data set, up to its pixels.
    pub(super) fn data(mut self) -> Result<(DataSet, Option<Pixels>), VolumeError> {
        let mut found = self.empty();
        while self.pixels.is_none() && self.end - self.at >= 8 {
            let head = self.head()?;
            if matches!(head.tag, tag::END_OF_ITEM | tag::END_OF_SEQUENCE) {
                return Err(damaged("an item delimiter without an item", self.at));
            }
            self.value(&head, self.end, &mut found, 0)?;
        }
        if self.pixels.is_none() && self.at < self.end {
            return Err(damaged("the file is truncated", self.at));
        }
        Ok((found, self.pixels))
    }

    fn empty(&self) -> DataSet {
        DataSet {
            is_big_endian: self.encoding.is_big_endian,
            ..DataSet::default()
        }
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], VolumeError> {
        let mut bytes = [0; N];
        self.fill(&mut bytes)?;
        Ok(bytes)
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), VolumeError> {
        self.input
            .read_exact(bytes)
            .map_err(|_| damaged("the file is truncated", self.at))?;
        self.at += bytes.len() as u64;
        Ok(())
    }

    fn short(&mut self) -> Result<u16, VolumeError> {
        let bytes = self.bytes()?;
        Ok(if self.encoding.is_big_endian {
            u16::from_be_bytes(bytes)
        } else {
            u16::from_le_bytes(bytes)
        })
    }

    fn long(&mut self) -> Result<u32, VolumeError> {
        let bytes = self.bytes()?;
        Ok(if self.encoding.is_big_endian {
            u32::from_be_bytes(bytes)
        } else {
            u32::from_le_bytes(bytes)
        })
    }

    fn skip(&mut self, bytes: u64) -> Result<(), VolumeError> {
        let forward = i64::try_from(bytes).map_err(|_| damaged("a length of 2^63", self.at))?;
        self.input.seek_relative(forward).map_err(unreadable)?;
        self.at += bytes;
        Ok(())
    }

    fn tag(&mut self) -> Result<Tag, VolumeError> {
        Ok(u32::from(self.short()?) << 16 | u32::from(self.short()?))
    }

    fn head(&mut self) -> Result<Head, VolumeError> {
        let tag = self.tag()?;
        self.head_of(tag)
    }

    /// What follows a tag.
    fn head_of(&mut self, tag: Tag) -> Result<Head, VolumeError> {
        if tag >> 16 == 0xFFFE || !self.encoding.is_explicit {
            let length = self.long()?.into();
            return Ok(Head {
                tag,
                vr: *b"  ",
                length,
            });
        }
        let vr: [u8; 2] = self.bytes()?;
        if !vr.iter().all(u8::is_ascii_uppercase) {
            return Err(damaged(
                format!("element {} has no VR", tag::written(tag)),
                self.at,
            ));
        }
        let is_long = matches!(
            &vr,
            b"OB"
                | b"OD"
                | b"OF"
                | b"OL"
                | b"OV"
                | b"OW"
                | b"SQ"
                | b"SV"
                | b"UC"
                | b"UN"
                | b"UR"
                | b"UT"
                | b"UV"
        );
        let length = if is_long {
            self.short()?;
            self.long()?.into()
        } else {
            self.short()?.into()
        };
        Ok(Head { tag, vr, length })
    }

    /// Takes or skips what follows a head; `end` is that of what it lies in.
    fn value(
        &mut self,
        head: &Head,
        end: u64,
        found: &mut DataSet,
        depth: usize,
    ) -> Result<(), VolumeError> {
        let Head { tag, vr, length } = *head;
        if tag == tag::PIXELS && depth == 0 {
            self.pixels = Some(self.pixels(length)?);
            return Ok(());
        }
        let is_undefined = length == UNDEFINED;
        if !is_undefined && length > end.saturating_sub(self.at) {
            return Err(damaged(
                format!(
                    "element {} has {length} bytes, but {} are left",
                    tag::written(tag),
                    end.saturating_sub(self.at)
                ),
                self.at,
            ));
        }
        if tag == tag::PIXELS && is_undefined {
            self.pixels(length)?;
            return Ok(());
        }
        if is_undefined || tag::is_sequence(tag) {
            // The standard: what has VR UN and is a sequence is written with implicit VR.
            let before = self.encoding;
            if &vr == b"UN" {
                self.encoding = Encoding::IMPLICIT;
            }
            let stop = if is_undefined {
                None
            } else {
                Some(self.at + length)
            };
            let items = self.sequence(stop, end, depth + 1, tag::is_sequence(tag))?;
            self.encoding = before;
            if tag::is_sequence(tag) {
                found.sequences.insert(tag, items);
            }
            return Ok(());
        }
        let most = if tag == tag::CONTOUR_DATA {
            CONTOUR_BYTES
        } else {
            VALUE_BYTES
        };
        if tag::is_value(tag) && length <= most {
            let mut bytes = vec![0; usize::try_from(length).unwrap_or(0)];
            self.fill(&mut bytes)?;
            found.values.insert(tag, Value { vr, bytes });
            return Ok(());
        }
        self.skip(length)
    }

    /// Items up to `stop`, or up to the sequence's end mark.
    fn sequence(
        &mut self,
        stop: Option<u64>,
        end: u64,
        depth: usize,
        is_wanted: bool,
    ) -> Result<Vec<DataSet>, VolumeError> {
        if depth > DEPTH {
            return Err(damaged("sequences are nested too deeply", self.at));
        }
        let mut items = Vec::new();
        let last = stop.unwrap_or(end);
        while stop.is_none_or(|stop| self.at < stop) {
            let head = self.head_within(last)?;
            match head.tag {
                tag::END_OF_SEQUENCE => break,
                tag::ITEM => {}
                other => {
                    return Err(damaged(
                        format!("element {} where an item is expected", tag::written(other)),
                        self.at,
                    ));
                }
            }
            self.items += 1;
            if self.items > ITEMS {
                return Err(damaged(format!("more than {ITEMS} items"), self.at));
            }
            let item = self.item(head.length, last, depth)?;
            if is_wanted {
                items.push(item);
            }
        }
        Ok(items)
    }

    fn head_within(&mut self, end: u64) -> Result<Head, VolumeError> {
        if end.saturating_sub(self.at) < 8 {
            return Err(damaged("a sequence has no end", self.at));
        }
        self.head()
    }

    fn item(&mut self, length: u64, end: u64, depth: usize) -> Result<DataSet, VolumeError> {
        let is_undefined = length == UNDEFINED;
        if !is_undefined && length > end.saturating_sub(self.at) {
            return Err(damaged(
                format!("an item of {length} bytes is longer than its sequence"),
                self.at,
            ));
        }
        let stop = if is_undefined { end } else { self.at + length };
        let mut found = self.empty();
        while is_undefined || self.at < stop {
            let head = self.head_within(stop)?;
            if head.tag == tag::END_OF_ITEM {
                break;
            }
            self.value(&head, stop, &mut found, depth)?;
        }
        Ok(found)
    }

    fn pixels(&mut self, length: u64) -> Result<Pixels, VolumeError> {
        if length != UNDEFINED {
            let pixels = Pixels::Plain {
                offset: self.at,
                // What is there: who needs more says what is missing.
                bytes: length.min(self.end - self.at),
            };
            self.skip(length.min(self.end - self.at))?;
            return Ok(pixels);
        }
        let mut pieces = Vec::new();
        let mut starts = Vec::new();
        let mut is_first = true;
        // A file that ends without the end mark has all its pieces.
        while self.end - self.at >= 8 {
            let head = self.head()?;
            if head.tag == tag::END_OF_SEQUENCE {
                break;
            }
            let left = self.end - self.at;
            if head.tag != tag::ITEM || head.length == UNDEFINED || head.length > left {
                return Err(damaged(
                    "the compressed pixels are truncated or not items",
                    self.at,
                ));
            }
            if is_first {
                starts = self.starts(head.length)?;
            } else {
                pieces.push((self.at, head.length));
                self.skip(head.length)?;
            }
            is_first = false;
        }
        Ok(Pixels::Fragments { pieces, starts })
    }

    /// The table of where frames begin, which may be empty.
    fn starts(&mut self, length: u64) -> Result<Vec<u32>, VolumeError> {
        let mut starts = Vec::new();
        for _ in 0..length / 4 {
            starts.push(self.long()?);
        }
        self.skip(length % 4)?;
        Ok(starts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn read(bytes: &[u8], encoding: Encoding) -> Result<(DataSet, Option<Pixels>), VolumeError> {
        Elements::new(Cursor::new(bytes), 0, bytes.len() as u64, encoding)?.data()
    }

    /// An element with a short length.
    fn element(tag: Tag, vr: [u8; 2], value: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        bytes.extend(u16::try_from(tag >> 16).unwrap().to_le_bytes());
        bytes.extend(u16::try_from(tag & 0xFFFF).unwrap().to_le_bytes());
        bytes.extend(vr);
        if vr == *b"UN" {
            bytes.extend([0, 0]);
            bytes.extend(u32::try_from(value.len()).unwrap().to_le_bytes());
        } else {
            bytes.extend(u16::try_from(value.len()).unwrap().to_le_bytes());
        }
        bytes.extend(value);
        bytes
    }

    #[test]
    fn a_number_of_unknown_vr_is_its_text() {
        let bytes = element(tag::SLOPE, *b"UN", b"1 ");
        let (found, _) = read(&bytes, Encoding::EXPLICIT).unwrap();
        assert_eq!(found.real(tag::SLOPE), Ok(Some(1.0)));
    }

    #[test]
    fn names_and_birth_dates_are_skipped_unread() {
        let mut bytes = element(0x0010_0010, *b"PN", b"DOE^JANE");
        bytes.extend(element(0x0010_0030, *b"DA", b"19700101"));
        bytes.extend(element(tag::MODALITY, *b"CS", b"CT"));
        let (found, _) = read(&bytes, Encoding::EXPLICIT).unwrap();
        assert_eq!(found.text(tag::MODALITY).as_deref(), Some("CT"));
        assert!(!format!("{found:?}").contains("68, 79, 69"));
        assert_eq!(found.values.len(), 1);
    }

    #[test]
    fn what_is_no_number_names_its_element() {
        let bytes = element(tag::PIXEL_SPACING, *b"DS", b"0,7\\0,7 ");
        let (found, _) = read(&bytes, Encoding::EXPLICIT).unwrap();
        let problem = found.array::<2>(tag::PIXEL_SPACING).unwrap_err();
        assert!(
            format!("{problem:?}").contains("(0028,0030)"),
            "{problem:?}"
        );
    }

    #[test]
    fn a_length_beyond_the_end_is_refused_before_it_is_read() {
        let mut bytes = element(tag::MODALITY, *b"UN", b"CT");
        bytes[8..12].copy_from_slice(&0x7FFF_FFFF_u32.to_le_bytes());
        assert!(read(&bytes, Encoding::EXPLICIT).is_err());
    }

    #[test]
    fn nested_sequences_without_end_are_refused() {
        let mut bytes = Vec::new();
        for _ in 0..1000 {
            bytes.extend([
                0x00, 0x52, 0x30, 0x92, b'S', b'Q', 0, 0, 0xFF, 0xFF, 0xFF, 0xFF,
            ]);
            bytes.extend([0xFE, 0xFF, 0x00, 0xE0, 0xFF, 0xFF, 0xFF, 0xFF]);
        }
        let problem = read(&bytes, Encoding::EXPLICIT).unwrap_err();
        assert!(
            problem.to_string().contains("nested too deeply"),
            "{problem}"
        );
    }
}

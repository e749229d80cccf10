//! Bytes of a block of cases in the journal.
//!
//! All little-endian, then compressed as one zstd frame:
//!
//! | Part | Bytes |
//! |---|---|
//! | per factor | one `u32` (index of a level) or `f64` per case |
//! | outcomes | one `u8` per row |
//! | texts | `u32` count; per text `u32` length and UTF-8 |
//! | details | one `u32` per row, an index into the texts |
//! | metrics | most significant bytes of all metrics (metric by metric, row by row), then the next byte, and so on |
//!
//! Bytes of equal significance stand together because the first are much alike and compress well,
//! while the last are noise, which costs no time where nothing else is between it.

use crate::{Factor, FactorKind, Outcome};

use super::columns::{Columns, FactorColumn, ROWS};

/// Of zstd: the fastest regular one. The journal lives as long as the run.
const LEVEL: i32 = 1;

/// A block, packed.
#[derive(Debug)]
pub(crate) struct Packed {
    /// Compressed.
    pub(crate) bytes: Vec<u8>,
    /// Bytes before compression.
    pub(crate) raw_length: usize,
}

/// Packs blocks, one after the other, in the same memory.
pub(crate) struct Packer {
    raw: Vec<u8>,
    zstd: zstd::bulk::Compressor<'static>,
}

impl Packer {
    pub(crate) fn new() -> std::io::Result<Self> {
        Ok(Self {
            raw: Vec::new(),
            zstd: zstd::bulk::Compressor::new(LEVEL)?,
        })
    }

    pub(crate) fn pack(&mut self, columns: &Columns) -> std::io::Result<Packed> {
        self.raw.clear();
        encode(columns, &mut self.raw);
        Ok(Packed {
            bytes: self.zstd.compress(&self.raw)?,
            raw_length: self.raw.len(),
        })
    }
}

/// Unpacks a block of so many cases. `None` if the bytes are not such a block.
pub(crate) fn unpack(
    bytes: &[u8],
    raw_length: usize,
    cases: usize,
    factors: &[Factor],
    metrics: usize,
) -> Option<Columns> {
    let raw = zstd::bulk::decompress(bytes, raw_length).ok()?;
    decode(&raw, cases, factors, metrics)
}

fn encode(columns: &Columns, raw: &mut Vec<u8>) {
    let length = |count: usize| u32::try_from(count).expect("a block has fewer than 2^32 bytes");
    for factor in &columns.factors {
        match factor {
            FactorColumn::Levels(levels) => {
                raw.extend(levels.iter().flat_map(|level| level.to_le_bytes()));
            }
            FactorColumn::Numbers(numbers) => {
                raw.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
            }
        }
    }
    raw.extend_from_slice(&columns.outcomes);
    raw.extend(length(columns.texts.len()).to_le_bytes());
    for text in &columns.texts {
        raw.extend(length(text.len()).to_le_bytes());
        raw.extend_from_slice(text.as_bytes());
    }
    raw.extend(columns.details.iter().flat_map(|text| text.to_le_bytes()));
    for shift in [24, 16, 8, 0] {
        for column in &columns.metrics {
            #[expect(clippy::cast_possible_truncation, reason = "the byte that is meant")]
            raw.extend(column.iter().map(|value| (bits(*value) >> shift) as u8));
        }
    }
}

/// Every NaN is the same one: there is only one way to have no value.
fn bits(value: f32) -> u32 {
    if value.is_nan() {
        f32::NAN.to_bits()
    } else {
        value.to_bits()
    }
}

fn decode(raw: &[u8], cases: usize, factors: &[Factor], metrics: usize) -> Option<Columns> {
    let rows = cases * ROWS;
    let mut rest = Rest(raw);
    let mut columns = Columns::new(factors, metrics);
    columns.cases = cases;
    for (column, factor) in columns.factors.iter_mut().zip(factors) {
        match (column, &factor.kind) {
            (FactorColumn::Levels(column), FactorKind::Levels(levels)) => {
                for _ in 0..cases {
                    let level = rest.u32()?;
                    column.push(Some(level).filter(|level| (*level as usize) < levels.len())?);
                }
            }
            (FactorColumn::Numbers(column), _) => {
                for _ in 0..cases {
                    column.push(f64::from_le_bytes(*rest.array()?));
                }
            }
            (FactorColumn::Levels(_), _) => return None,
        }
    }
    columns.outcomes = rest.take(rows)?.to_vec();
    if columns
        .outcomes
        .iter()
        .any(|outcome| usize::from(*outcome) >= Outcome::ALL.len())
    {
        return None;
    }
    for _ in 0..rest.u32()? {
        let length = rest.u32()? as usize;
        let text = std::str::from_utf8(rest.take(length)?).ok()?;
        columns.texts.push(text.to_owned());
    }
    for _ in 0..rows {
        let text = rest.u32()?;
        columns
            .details
            .push(Some(text).filter(|text| (*text as usize) < columns.texts.len())?);
    }
    let plane = metrics * rows;
    let planes = rest.take(4 * plane)?;
    for (metric, column) in columns.metrics.iter_mut().enumerate() {
        column.extend((metric * rows..(metric + 1) * rows).map(|at| {
            f32::from_be_bytes([0, 1, 2, 3].map(|significance| planes[significance * plane + at]))
        }));
    }
    rest.0.is_empty().then_some(columns)
}

/// What is not yet read.
struct Rest<'a>(&'a [u8]);

impl<'a> Rest<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<&'a [u8; N]> {
        self.take(N)?.try_into().ok()
    }

    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(*self.array()?))
    }
}

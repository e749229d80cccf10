//! Stored numbers of any type and byte order, turned into Hounsfield units as they stream by.

use std::ops::RangeInclusive;

use crate::AIR_HU;

/// What no scanner measures: whatever is stored there was not seen (-2000 and -3024 are usual) and is air.
pub(crate) const UNSEEN_BELOW_HU: f64 = -1500.0;

/// What `f32` slopes leave of values that are whole: not counted as rounded.
const ROUNDING_HU: f64 = 1e-3;

/// Values that are converted at a time where they need no more than an offset: a piece stays in the first cache.
const PIECE: usize = 4096;

/// Numbers for which a table is worth its making.
const A_TABLE: usize = 1 << 16;

/// Type of a stored number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Kind {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl Kind {
    /// In the file.
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// For people.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::U8 => "unsigned 8-bit",
            Self::I8 => "signed 8-bit",
            Self::U16 => "unsigned 16-bit",
            Self::I16 => "signed 16-bit",
            Self::U32 => "unsigned 32-bit",
            Self::I32 => "signed 32-bit",
            Self::U64 => "unsigned 64-bit",
            Self::I64 => "signed 64-bit",
            Self::F32 => "32-bit float",
            Self::F64 => "64-bit float",
        }
    }
}

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Stored {
    pub(crate) kind: Kind,
    pub(crate) is_big_endian: bool,
    /// Bits that count and the highest of them, where a sample does not fill its integer (DICOM).
    pub(crate) bits: Option<(u32, u32)>,
}

impl Stored {
    /// Calls `take` with each number.
    pub(crate) fn each(&self, bytes: &[u8], mut take: impl FnMut(f64)) {
        macro_rules! numbers {
            ($type:ty) => {{
                for chunk in bytes.chunks_exact(size_of::<$type>()) {
                    let mut array = [0; size_of::<$type>()];
                    array.copy_from_slice(chunk);
                    if self.is_big_endian {
                        array.reverse();
                    }
                    take(self.number(<$type>::from_le_bytes(array)));
                }
            }};
        }
        match self.kind {
            Kind::U8 => numbers!(u8),
            Kind::I8 => numbers!(i8),
            Kind::U16 => numbers!(u16),
            Kind::I16 => numbers!(i16),
            Kind::U32 => numbers!(u32),
            Kind::I32 => numbers!(i32),
            Kind::U64 => numbers!(u64),
            Kind::I64 => numbers!(i64),
            Kind::F32 => numbers!(f32),
            Kind::F64 => numbers!(f64),
        }
    }

    fn number<T: Number>(&self, number: T) -> f64 {
        let Some((stored, high)) = self.bits else {
            return number.real();
        };
        let low = (high + 1).saturating_sub(stored);
        let shifted = number.whole() >> low;
        let mask = (1_i64 << stored.min(62)) - 1;
        let value = shifted & mask;
        let is_negative = T::SIGNED && value >> (stored.max(1) - 1) & 1 == 1;
        (if is_negative { value - mask - 1 } else { value }) as f64
    }
}

trait Number: Copy {
    const SIGNED: bool;
    fn real(self) -> f64;
    /// Bits, for those that DICOM stores.
    fn whole(self) -> i64;
}

macro_rules! number {
    ($($type:ty: $signed:literal),*) => {$(
        impl Number for $type {
            const SIGNED: bool = $signed;
            #[expect(
                clippy::allow_attributes,
                reason = "some of these casts lose nothing, depending on the type"
            )]
            #[allow(clippy::cast_lossless, trivial_numeric_casts)]
            fn real(self) -> f64 {
                self as f64
            }
            #[expect(
                clippy::allow_attributes,
                reason = "some of these casts lose nothing, depending on the type"
            )]
            #[allow(clippy::cast_lossless, clippy::cast_possible_wrap, clippy::cast_possible_truncation)]
            fn whole(self) -> i64 {
                self as i64
            }
        }
    )*};
}

number!(u8: false, i8: true, u16: false, i16: true, u32: false, i32: true, u64: false, i64: true, f32: true, f64: true);

/// `HU = stored x slope + intercept`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rescale {
    pub(crate) slope: f64,
    pub(crate) intercept: f64,
}

impl Rescale {
    /// Stored numbers are HU.
    pub(crate) const NONE: Self = Self {
        slope: 1.0,
        intercept: 0.0,
    };
}

/// What the numbers were, and what had to be changed to make them HU of 16 bits.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tally {
    /// Set to air because the scanner did not see there.
    pub(crate) padding: u64,
    /// Not whole.
    pub(crate) rounded: u64,
    /// Beyond what 16 bits hold.
    pub(crate) clipped: u64,
    /// Not a number: set to air.
    pub(crate) not_numbers: u64,
    /// Least and greatest HU before clipping; padding does not count.
    pub(crate) range_hu: [f64; 2],
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            padding: 0,
            rounded: 0,
            clipped: 0,
            not_numbers: 0,
            range_hu: [f64::INFINITY, f64::NEG_INFINITY],
        }
    }
}

impl Tally {
    /// Of both.
    pub(crate) fn add(&mut self, other: &Self) {
        self.padding += other.padding;
        self.rounded += other.rounded;
        self.clipped += other.clipped;
        self.not_numbers += other.not_numbers;
        self.include(other.range_hu[0]);
        self.include(other.range_hu[1]);
    }

    fn include(&mut self, hu: f64) {
        // What was added of an empty tally is infinite the wrong way round, and changes nothing.
        if hu.is_finite() {
            self.range_hu = [self.range_hu[0].min(hu), self.range_hu[1].max(hu)];
        }
    }
}

/// Turns stored numbers into HU.
#[derive(Debug, Clone)]
pub(crate) struct Converter {
    stored: Stored,
    rescale: Rescale,
    padding: Option<[f64; 2]>,
    table: Option<Table>,
}

/// Of all 65 536 values that 16 bits have, in the order of their bits.
#[derive(Debug, Clone)]
struct Table {
    hu: Vec<i16>,
    /// Whether there is anything to count.
    special: Vec<bool>,
    /// Stored numbers for which HU is no more than an offset away, and the offset.
    plain: Option<(RangeInclusive<i32>, i32)>,
}

impl Converter {
    /// For `count` numbers; `padding` is the range of stored ones that were not measured.
    pub(crate) fn new(
        stored: Stored,
        rescale: Rescale,
        padding: Option<[f64; 2]>,
        count: usize,
    ) -> Self {
        let mut converter = Self {
            stored,
            rescale,
            padding,
            table: None,
        };
        if count >= A_TABLE && matches!(stored.kind, Kind::I16 | Kind::U16) {
            converter.table = Some(converter.table());
        }
        converter
    }

    fn table(&self) -> Table {
        let mut hu = Vec::with_capacity(1 << 16);
        let mut special = Vec::with_capacity(1 << 16);
        let little = Stored {
            is_big_endian: false,
            ..self.stored
        };
        for bits in 0..=u16::MAX {
            let mut tally = Tally::default();
            little.each(&bits.to_le_bytes(), |number| {
                hu.push(self.hu(number, &mut tally));
            });
            special.push(tally.padding + tally.rounded + tally.clipped + tally.not_numbers > 0);
        }
        let plain = self.plain(&hu, &special);
        Table { hu, special, plain }
    }

    /// The longest run of stored numbers for which HU is no more than an offset away.
    fn plain(&self, hu: &[i16], special: &[bool]) -> Option<(RangeInclusive<i32>, i32)> {
        let Rescale { slope, intercept } = self.rescale;
        if slope != 1.0 || intercept.fract() != 0.0 || intercept.abs() > 65536.0 {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "within 65536")]
        let offset = intercept as i32;
        let numbers = if self.stored.kind == Kind::I16 {
            i32::from(i16::MIN)..=i32::from(i16::MAX)
        } else {
            0..=i32::from(u16::MAX)
        };
        let is_plain = |number: i32| {
            let at = usize::from(bits_of(number));
            !special[at] && i32::from(hu[at]) == number + offset
        };
        let mut best: Option<RangeInclusive<i32>> = None;
        let mut first = *numbers.start();
        for number in numbers.clone() {
            if !is_plain(number) {
                first = number + 1;
            } else if best
                .as_ref()
                .is_none_or(|best| number - first > best.end() - best.start())
            {
                best = Some(first..=number);
            }
        }
        best.map(|range| (range, offset))
    }

    /// Of one stored number.
    fn hu(&self, number: f64, tally: &mut Tally) -> i16 {
        let hu = number * self.rescale.slope + self.rescale.intercept;
        let is_padding = self
            .padding
            .is_some_and(|[least, greatest]| (least..=greatest).contains(&number));
        if is_padding || hu <= UNSEEN_BELOW_HU {
            tally.padding += 1;
            return AIR_HU;
        }
        if hu.is_nan() {
            tally.not_numbers += 1;
            return AIR_HU;
        }
        tally.include(hu);
        let whole = hu.round_ties_even();
        if whole > f64::from(i16::MAX) {
            tally.clipped += 1;
        } else if (whole - hu).abs() > ROUNDING_HU {
            tally.rounded += 1;
        }
        #[expect(
            clippy::cast_possible_truncation,
            reason = "saturates, which is counted"
        )]
        let short = whole as i16;
        short
    }

    /// Converts as many numbers as `out` has room for; `bytes` has just those.
    pub(crate) fn convert(&self, bytes: &[u8], out: &mut [i16], tally: &mut Tally) {
        let Some(table) = &self.table else {
            let mut out = out.iter_mut();
            self.stored.each(bytes, |number| {
                if let Some(out) = out.next() {
                    *out = self.hu(number, tally);
                }
            });
            return;
        };
        for (bytes, out) in bytes.chunks(2 * PIECE).zip(out.chunks_mut(PIECE)) {
            self.convert_piece(table, bytes, out, tally);
        }
    }

    fn convert_piece(&self, table: &Table, bytes: &[u8], out: &mut [i16], tally: &mut Tally) {
        // The bits go into `out` first, then become what they stand for.
        if self.stored.is_big_endian {
            for (out, pair) in out.iter_mut().zip(bytes.chunks_exact(2)) {
                *out = i16::from_be_bytes([pair[0], pair[1]]);
            }
        } else {
            for (out, pair) in out.iter_mut().zip(bytes.chunks_exact(2)) {
                *out = i16::from_le_bytes([pair[0], pair[1]]);
            }
        }
        let (least, greatest) = if self.stored.kind == Kind::I16 {
            let least = out.iter().fold(i16::MAX, |least, each| least.min(*each));
            let greatest = out.iter().fold(i16::MIN, |most, each| most.max(*each));
            (i32::from(least), i32::from(greatest))
        } else {
            let numbers = out.iter().map(|each| each.cast_unsigned());
            let least = numbers.clone().fold(u16::MAX, u16::min);
            let greatest = numbers.fold(0, u16::max);
            (i32::from(least), i32::from(greatest))
        };
        if let Some((range, offset)) = &table.plain
            && range.contains(&least)
            && range.contains(&greatest)
        {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "wraps, as the sum does: it is in range"
            )]
            let offset_bits = *offset as i16;
            for out in out.iter_mut() {
                *out = out.wrapping_add(offset_bits);
            }
            tally.include(f64::from(least + offset));
            tally.include(f64::from(greatest + offset));
            return;
        }
        for out in out.iter_mut() {
            let at = usize::from(out.cast_unsigned());
            *out = table.hu[at];
            if table.special[at] {
                let bits = u16::try_from(at).unwrap_or(0).to_le_bytes();
                let little = Stored {
                    is_big_endian: false,
                    ..self.stored
                };
                little.each(&bits, |number| {
                    self.hu(number, tally);
                });
            } else {
                tally.include(f64::from(*out));
            }
        }
    }
}

/// Of a number that 16 bits hold, signed or not.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the low 16 bits are meant"
)]
fn bits_of(number: i32) -> u16 {
    number as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGNED: Stored = Stored {
        kind: Kind::I16,
        is_big_endian: false,
        bits: None,
    };

    fn converted(converter: &Converter, bytes: &[u8]) -> (Vec<i16>, Tally) {
        let mut tally = Tally::default();
        let mut out = vec![0; bytes.len() / converter.stored.kind.bytes()];
        converter.convert(bytes, &mut out, &mut tally);
        (out, tally)
    }

    /// The table and its shortcut against the plain formula, for every value that 16 bits have.
    #[test]
    fn sixteen_bits_are_converted_as_the_formula_says() {
        let all: Vec<u8> = (0..=u16::MAX).flat_map(u16::to_le_bytes).collect();
        for kind in [Kind::I16, Kind::U16] {
            for bits in [None, Some((12, 11)), Some((12, 15)), Some((16, 15))] {
                for (slope, intercept) in [(1.0, -1024.0), (1.0, 0.0), (0.5, 3.25), (-1.0, 7.0)] {
                    let stored = Stored {
                        kind,
                        bits,
                        ..SIGNED
                    };
                    let rescale = Rescale { slope, intercept };
                    let converter = Converter::new(stored, rescale, Some([17.0, 17.0]), A_TABLE);
                    let plain = Converter {
                        table: None,
                        ..converter.clone()
                    };
                    assert_eq!(converted(&converter, &all), converted(&plain, &all));
                }
            }
        }
    }

    #[test]
    fn byte_order_is_kept() {
        let big = Stored {
            is_big_endian: true,
            ..SIGNED
        };
        let (hu, _) = converted(
            &Converter::new(big, Rescale::NONE, None, A_TABLE),
            &[0xff, 0x38, 0, 7],
        );
        assert_eq!(hu, [-200, 7]);
    }

    #[test]
    fn what_is_changed_is_counted() {
        let floats = Stored {
            kind: Kind::F32,
            ..SIGNED
        };
        let bytes: Vec<u8> = [0.5_f32, 1.5, 7.0, 1e6, f32::NAN, -3024.0, f32::NEG_INFINITY]
            .into_iter()
            .flat_map(f32::to_le_bytes)
            .collect();
        let (hu, tally) = converted(
            &Converter::new(floats, Rescale::NONE, None, A_TABLE),
            &bytes,
        );
        assert_eq!(hu, [0, 2, 7, i16::MAX, AIR_HU, AIR_HU, AIR_HU]);
        assert_eq!(
            (
                tally.rounded,
                tally.clipped,
                tally.not_numbers,
                tally.padding
            ),
            (2, 1, 1, 2)
        );
        assert_eq!(tally.range_hu, [0.5, 1e6]);
    }

    #[test]
    fn twelve_bits_of_sixteen_have_their_own_sign() {
        let stored = Stored {
            bits: Some((12, 11)),
            ..SIGNED
        };
        // 0xf830 has garbage above bit 11; its 12 bits are 0x830, which is -2000 + ... of 12 bits.
        let (hu, _) = converted(
            &Converter::new(stored, Rescale::NONE, None, A_TABLE),
            &[0x18, 0xfc, 0xff, 0x07],
        );
        assert_eq!(hu, [-1000, 2047]);
    }
}

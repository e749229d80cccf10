//! JPEG-LS (ITU-T T.87): grey pictures of 2 to 16 bits, lossless and nearly so, in one scan.
//!
//! Names are those of the standard, where they are short: A, B, C and N of a context, J of runs, k of Golomb codes.

const START: u8 = 0xD8;
/// Of the frame header.
pub(super) const FRAME: u8 = 0xF7;
const PARAMETERS: u8 = 0xF8;
const SCAN: u8 = 0xDA;
const RESTART_INTERVAL: u8 = 0xDD;
const END: u8 = 0xD9;

/// Contexts of gradients, of which half are the others' mirror images.
const CONTEXTS: usize = 365;

/// Lengths of runs, as powers of two (A.2.1, table).
const J: [u32; 32] = [
    0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 9, 10, 11, 12, 13,
    14, 15,
];

/// Bounds of the correction C.
const MOST_CORRECTION: i64 = 127;
const LEAST_CORRECTION: i64 = -128;

/// Codes of more bits than this are no stream's.
const MOST_K: u32 = 24;

const MOST_ZEROS: u32 = 1 << 10;

/// Thresholds of gradients and the number after which statistics are halved, of 8 bits (C.2.4.1.1).
const BASIC_THRESHOLDS: [i64; 3] = [3, 7, 21];
const BASIC_RESET: i64 = 64;

const CUT_OFF: &str = "they are truncated";
const TOO_LONG: &str = "they go on behind the last pixel";

/// What is decoded by.
#[derive(Debug, Clone, Copy)]
struct Parameters {
    greatest: i64,
    near: i64,
    thresholds: [i64; 3],
    reset: i64,
    /// Different errors that there are, and their bits.
    range: i64,
    error_bits: u32,
    /// Bits of a code at most.
    limit: u32,
}

impl Parameters {
    /// Of `bits` to a value; what `stated` leaves at 0 has its default.
    fn new(bits: u8, near: i64, stated: Stated) -> Result<Self, &'static str> {
        let full = (1 << bits) - 1;
        let greatest = if stated.greatest == 0 {
            full
        } else {
            stated.greatest
        };
        if greatest > full || near > (greatest / 2).min(255) {
            return Err("their parameters do not fit their bits");
        }
        let defaults = default_thresholds(greatest, near);
        let mut thresholds = stated.thresholds;
        for (threshold, default) in thresholds.iter_mut().zip(defaults) {
            if *threshold == 0 {
                *threshold = default;
            }
        }
        let reset = if stated.reset == 0 {
            BASIC_RESET
        } else {
            stated.reset
        };
        let [t1, t2, t3] = thresholds;
        if t1 <= near || t2 < t1 || t3 < t2 || t3 > greatest || reset < 3 {
            return Err("their thresholds are not in order");
        }
        let range = (greatest + 2 * near) / (2 * near + 1) + 1;
        let value_bits = bits_of(greatest + 1).max(2);
        Ok(Self {
            greatest,
            near,
            thresholds,
            reset,
            range,
            error_bits: bits_of(range),
            limit: 2 * (value_bits + value_bits.max(8)),
        })
    }

    /// The class of a gradient, -4 to 4.
    fn class(&self, gradient: i64) -> i64 {
        let [t1, t2, t3] = self.thresholds;
        let size = gradient.abs();
        let class = if size <= self.near {
            0
        } else if size < t1 {
            1
        } else if size < t2 {
            2
        } else if size < t3 {
            3
        } else {
            4
        };
        class * gradient.signum()
    }

    /// A predicted value with its error.
    fn value(&self, predicted: i64, error: i64) -> i64 {
        let step = 2 * self.near + 1;
        let mut value = predicted + error * step;
        if value < -self.near {
            value += self.range * step;
        } else if value > self.greatest + self.near {
            value -= self.range * step;
        }
        value.clamp(0, self.greatest)
    }
}

/// Bits in which `count` different numbers fit.
fn bits_of(count: i64) -> u32 {
    i64::BITS - (count - 1).leading_zeros()
}

fn default_thresholds(greatest: i64, near: i64) -> [i64; 3] {
    let mut least = near + 1;
    let [b1, b2, b3] = BASIC_THRESHOLDS;
    let wanted = if greatest >= 128 {
        let factor = (greatest.min(4095) + 128) / 256;
        [
            factor * (b1 - 2) + 2 + 3 * near,
            factor * (b2 - 3) + 3 + 5 * near,
            factor * (b3 - 4) + 4 + 7 * near,
        ]
    } else {
        let factor = 256 / (greatest + 1);
        [
            (b1 / factor + 3 * near).max(2),
            (b2 / factor + 5 * near).max(3),
            (b3 / factor + 7 * near).max(4),
        ]
    };
    wanted.map(|threshold| {
        if threshold > greatest || threshold < least {
            return least;
        }
        least = threshold;
        threshold
    })
}

/// What an LSE segment states; 0 where it leaves the default.
#[derive(Debug, Clone, Copy, Default)]
struct Stated {
    greatest: i64,
    thresholds: [i64; 3],
    reset: i64,
}

/// Statistics of a context.
#[derive(Debug, Clone, Copy)]
struct Context {
    a: i64,
    b: i64,
    c: i64,
    n: i64,
}

impl Context {
    fn new(range: i64) -> Self {
        Self {
            a: ((range + 32) / 64).max(2),
            b: 0,
            c: 0,
            n: 1,
        }
    }

    /// Bits of a Golomb code's rest.
    fn k(self, sum: i64) -> Result<u32, &'static str> {
        (0..=MOST_K)
            .find(|k| self.n << k >= sum)
            .ok_or("an error is beyond their range")
    }

    /// After an error of the prediction.
    fn learn(&mut self, error: i64, parameters: &Parameters) {
        self.a += error.abs();
        self.b += error * (2 * parameters.near + 1);
        if self.n == parameters.reset {
            self.a >>= 1;
            self.b >>= 1;
            self.n >>= 1;
        }
        self.n += 1;
        if self.b <= -self.n {
            self.b = (self.b + self.n).max(1 - self.n);
            self.c = (self.c - 1).max(LEAST_CORRECTION);
        } else if self.b > 0 {
            self.b = (self.b - self.n).min(0);
            self.c = (self.c + 1).min(MOST_CORRECTION);
        }
    }
}

/// Bits of a scan. After a byte of ones there is a bit 0, lest it look like a marker.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The highest are next.
    window: u64,
    held: u32,
    was_ones: bool,
}

impl<'a> Bits<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            at: 0,
            window: 0,
            held: 0,
            was_ones: false,
        }
    }

    /// Takes what there is, up to the next marker.
    fn fill(&mut self) {
        while self.held <= 56 {
            let Some(byte) = self.bytes.get(self.at).copied() else {
                return;
            };
            let bits = if self.was_ones { 7 } else { 8 };
            if self.was_ones && byte >= 0x80 {
                return;
            }
            self.at += 1;
            self.was_ones = byte == 0xFF;
            self.window |= u64::from(byte) << (64 - bits - self.held);
            self.held += bits;
        }
    }

    fn skip(&mut self, count: u32) {
        self.window = self.window.checked_shl(count).unwrap_or(0);
        self.held -= count;
    }

    /// Refuses a scan that does not end here: fewer bits than a byte, the marker of the end, and what fills up.
    fn end(mut self) -> Result<(), &'static str> {
        self.fill();
        let is_marker = |byte: &u8| *byte >= 0x80;
        if !self.was_ones || !self.bytes.get(self.at).is_some_and(is_marker) {
            // All bytes are taken, or there are more than a window has.
            return Err(if self.at < self.bytes.len() {
                TOO_LONG
            } else {
                CUT_OFF
            });
        }
        // The byte of ones before the marker is in the window, too.
        let left = self.held.checked_sub(8).ok_or(CUT_OFF)?;
        // Behind a last byte of ones is one more, lest they look like a marker.
        let before = self.at.checked_sub(3).map(|at| self.bytes[at]);
        let most = if before == Some(0xFF) { 7 + 7 } else { 7 };
        if left > most {
            return Err(TOO_LONG);
        }
        let rest = self.bytes[self.at..].iter();
        let mut rest = rest.skip_while(|byte| **byte == 0xFF);
        if rest.next() != Some(&END) {
            return Err("their end is not where the last pixel is");
        }
        if rest.any(|byte| ![0, 0xFF].contains(byte)) {
            return Err("there is more behind their end");
        }
        Ok(())
    }

    /// A number of `count` bits, 32 at most.
    fn number(&mut self, count: u32) -> Result<i64, &'static str> {
        if self.held < count {
            self.fill();
            if self.held < count {
                return Err(CUT_OFF);
            }
        }
        if count == 0 {
            return Ok(0);
        }
        let number = self.window >> (64 - count);
        self.skip(count);
        number.try_into().map_err(|_| CUT_OFF)
    }

    /// Zeros before the next 1, which is taken too.
    fn zeros(&mut self) -> Result<u32, &'static str> {
        let mut zeros = 0;
        loop {
            let here = self.window.leading_zeros();
            if here < self.held {
                self.skip(here + 1);
                return Ok(zeros + here);
            }
            zeros += self.held;
            (self.window, self.held) = (0, 0);
            self.fill();
            if self.held == 0 || zeros > MOST_ZEROS {
                return Err(CUT_OFF);
            }
        }
    }

    /// A Golomb code of `limit` bits at most.
    fn golomb(&mut self, k: u32, limit: u32, parameters: &Parameters) -> Result<i64, &'static str> {
        let bits = parameters.error_bits;
        let zeros = self.zeros()?;
        let mapped = if zeros + 1 + bits < limit {
            (i64::from(zeros) << k) + self.number(k)?
        } else {
            self.number(bits)? + 1
        };
        if mapped > 2 * parameters.range {
            return Err("an error is beyond their range");
        }
        Ok(mapped)
    }
}

/// What is in front of the bits of a stream.
struct Head<'a> {
    /// Bits of a value; columns and rows.
    frame: Option<(u8, [usize; 2])>,
    stated: Stated,
    /// The header of the scan.
    scan: &'a [u8],
    /// What follows it.
    rest: &'a [u8],
}

fn head_of(bytes: &[u8]) -> Result<Head<'_>, &'static str> {
    let mut rest = bytes
        .strip_prefix(&[0xFF, START])
        .ok_or("they have an invalid beginning")?;
    let mut frame = None;
    let mut stated = Stated::default();
    loop {
        let [0xFF, marker, high, low, ..] = *rest else {
            return Err(CUT_OFF);
        };
        let length = usize::from(u16::from_be_bytes([high, low]));
        let segment = rest.get(4..2 + length).ok_or(CUT_OFF)?;
        rest = &rest[2 + length..];
        match marker {
            FRAME => frame = Some(frame_of(segment)?),
            PARAMETERS => stated = stated_by(segment)?,
            RESTART_INTERVAL if segment.iter().any(|byte| *byte != 0) => {
                return Err("they have restart intervals, which are not supported");
            }
            SCAN => {
                return Ok(Head {
                    frame,
                    stated,
                    scan: segment,
                    rest,
                });
            }
            END => return Err("they have no scan"),
            _ => {}
        }
    }
}

/// Values of a stream, row by row.
pub(super) fn decode(bytes: &[u8], [columns, rows]: [usize; 2]) -> Result<Vec<u16>, &'static str> {
    let head = head_of(bytes)?;
    let (bits, size) = head.frame.ok_or("they have no frame header")?;
    if size != [columns, rows] {
        return Err("they have another size than the file states");
    }
    let parameters = Parameters::new(bits, near_of(head.scan)?, head.stated)?;
    Scan::new(parameters, head.rest).all(columns, rows)
}

/// Whether the values of a stream may differ from those that were compressed: its NEAR is not 0. A stream that says
/// nothing of it is none that can be decoded.
pub(super) fn is_lossy(bytes: &[u8]) -> bool {
    head_of(bytes).is_ok_and(|head| near_of(head.scan).is_ok_and(|near| near != 0))
}

/// Bits of a value; columns and rows.
fn frame_of(segment: &[u8]) -> Result<(u8, [usize; 2]), &'static str> {
    let [bits, a, b, c, d, components, ..] = *segment else {
        return Err(CUT_OFF);
    };
    let (rows, columns) = (u16::from_be_bytes([a, b]), u16::from_be_bytes([c, d]));
    if !(2..=16).contains(&bits) || components != 1 {
        return Err("they are not one component of 2 to 16 bits");
    }
    Ok((bits, [columns.into(), rows.into()]))
}

fn stated_by(segment: &[u8]) -> Result<Stated, &'static str> {
    let [1, ref numbers @ ..] = *segment else {
        return Err("they have a palette, or a size of its own, which are not supported");
    };
    let number = |at: usize| -> Result<i64, &'static str> {
        let [high, low] = *numbers.get(2 * at..2 * at + 2).ok_or(CUT_OFF)? else {
            return Err(CUT_OFF);
        };
        Ok(u16::from_be_bytes([high, low]).into())
    };
    Ok(Stated {
        greatest: number(0)?,
        thresholds: [number(1)?, number(2)?, number(3)?],
        reset: number(4)?,
    })
}

/// By how much values may differ.
fn near_of(segment: &[u8]) -> Result<i64, &'static str> {
    match *segment {
        // One component, without a palette; its interleaving does not matter.
        [1, _, 0, near, _, 0] => Ok(near.into()),
        [1, ..] => Err("they have a palette or shifted values, which are not supported"),
        _ => Err("they have several components in a scan"),
    }
}

/// What changes while a scan is decoded.
struct Scan<'a> {
    parameters: Parameters,
    bits: Bits<'a>,
    contexts: Vec<Context>,
    /// Of the ends of runs: between values that differ, and between those that do not. Their `b` counts negative
    /// errors.
    run_ends: [Context; 2],
    run_index: usize,
}

impl<'a> Scan<'a> {
    fn new(parameters: Parameters, bytes: &'a [u8]) -> Self {
        let context = Context::new(parameters.range);
        Self {
            parameters,
            bits: Bits::new(bytes),
            contexts: vec![context; CONTEXTS],
            run_ends: [context; 2],
            run_index: 0,
        }
    }

    fn all(mut self, columns: usize, rows: usize) -> Result<Vec<u16>, &'static str> {
        // One more at each end than a row has: the neighbours of its first and last value.
        let (mut above, mut row) = (vec![0; columns + 2], vec![0; columns + 2]);
        let mut values = Vec::with_capacity(columns * rows);
        for _ in 0..rows {
            above[columns + 1] = above[columns];
            row[0] = above[1];
            self.row(&above, &mut row)?;
            for value in &row[1..=columns] {
                values.push(u16::try_from(*value).map_err(|_| "a value is beyond their range")?);
            }
            std::mem::swap(&mut above, &mut row);
        }
        self.bits.end()?;
        Ok(values)
    }

    fn row(&mut self, above: &[i64], row: &mut [i64]) -> Result<(), &'static str> {
        let mut at = 1;
        while at + 1 < row.len() {
            let (left, over, before, behind) =
                (row[at - 1], above[at], above[at - 1], above[at + 1]);
            let classes =
                [behind - over, over - before, before - left].map(|d| self.parameters.class(d));
            let context = 81 * classes[0] + 9 * classes[1] + classes[2];
            if context == 0 {
                at = self.run(above, row, at)?;
            } else {
                row[at] = self.regular(context, [left, over, before])?;
                at += 1;
            }
        }
        Ok(())
    }

    /// A value by its neighbours.
    fn regular(
        &mut self,
        context: i64,
        [left, over, before]: [i64; 3],
    ) -> Result<i64, &'static str> {
        let parameters = self.parameters;
        let sign = context.signum();
        let at = usize::try_from(context.abs()).unwrap_or(0);
        let known = &mut self.contexts[at];
        let predicted = if before >= left.max(over) {
            left.min(over)
        } else if before <= left.min(over) {
            left.max(over)
        } else {
            left + over - before
        };
        let predicted = (predicted + sign * known.c).clamp(0, parameters.greatest);
        let k = known.k(known.a)?;
        let mapped = self.bits.golomb(k, parameters.limit, &parameters)?;
        let mut error = if mapped % 2 == 0 {
            mapped / 2
        } else {
            -(mapped + 1) / 2
        };
        if parameters.near == 0 && k == 0 && 2 * known.b <= -known.n {
            error = -1 - error;
        }
        known.learn(error, &parameters);
        Ok(parameters.value(predicted, sign * error))
    }

    /// A run of the value before it, and the value at its end; where the next one is.
    fn run(&mut self, above: &[i64], row: &mut [i64], start: usize) -> Result<usize, &'static str> {
        let end = row.len() - 1;
        let left = row[start - 1];
        let mut at = start;
        while at < end && self.bits.number(1)? == 1 {
            let whole = 1 << J[self.run_index];
            if end - at >= whole {
                self.run_index = (self.run_index + 1).min(J.len() - 1);
            }
            at += whole.min(end - at);
            if at == end {
                row[start..end].fill(left);
                return Ok(end);
            }
        }
        let rest = self.bits.number(J[self.run_index])?;
        at += usize::try_from(rest).unwrap_or(usize::MAX).min(end - at);
        if at == end {
            return Err("a run leads out of its row");
        }
        row[start..at].fill(left);
        row[at] = self.run_end(left, above[at])?;
        self.run_index = self.run_index.saturating_sub(1);
        Ok(at + 1)
    }

    fn run_end(&mut self, left: i64, over: i64) -> Result<i64, &'static str> {
        let parameters = self.parameters;
        let is_same = (left - over).abs() <= parameters.near;
        let kind = i64::from(is_same);
        let known = &mut self.run_ends[usize::from(is_same)];
        let k = known.k(if is_same {
            known.a + (known.n >> 1)
        } else {
            known.a
        })?;
        let limit = parameters.limit.saturating_sub(J[self.run_index] + 1);
        let mapped = self.bits.golomb(k, limit, &parameters)?;
        let size = mapped + kind;
        let is_odd = size % 2;
        let is_negative = (k != 0 || 2 * known.b >= known.n) == (is_odd == 1);
        let size = (size >> 1) + is_odd;
        let error = if is_negative { -size } else { size };
        if error < 0 {
            known.b += 1;
        }
        known.a += (mapped + 1 - kind) >> 1;
        if known.n == parameters.reset {
            known.a >>= 1;
            known.b >>= 1;
            known.n >>= 1;
        }
        known.n += 1;
        Ok(if is_same {
            parameters.value(left, error)
        } else {
            parameters.value(over, if left > over { -error } else { error })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the standard, H.3: 4 x 4 values of 8 bits.
    const EXAMPLE: &[u8] = b"\xFF\xD8\xFF\xF7\x00\x0B\x08\x00\x04\x00\x04\x01\x01\x11\x00\xFF\xDA\
        \x00\x08\x01\x01\x00\
        \x00\x00\x00\xC0\x00\x00\x6C\x80\x20\x8E\x01\xC0\x00\x00\x57\x40\x00\x00\x6E\xE6\x00\x00\x01\xBC\x18\x00\x00\
        \x05\xD8\x00\x00\x91\x60\xFF\xD9";
    const VALUES: [u16; 16] = [
        0, 0, 90, 74, 68, 50, 43, 205, 64, 145, 145, 145, 100, 145, 145, 145,
    ];

    /// By CharLS: 16 x 12 values of 16 bits, lossless and with errors of 2 at most, with runs and edges.
    const LOSSLESS: &str = "\
        ffd8fff7000b10000c001001011100fff8000d01ffff0012004301140040ffda00080101000000004058010040100804\
        0201010df801a00000000000e2e3c498920000000000038a6d07070840018383c02534929253aac49000000000001c63\
        69280000000000038b49002014038058a51c2e24e069c137b8640280200c028064440cd855c32858712a24ee30000000\
        00001c96b000000000001c68780d00a009e17b76e59e1006e19e623cbe80040018383b37b24cedda2339174d62c65bcb\
        6004070030b07fcc55fd7cf21d07000000000001c51280101c00806b28ae312af3250b35b8e1724010240500c77902a7\
        340000000000038c7b93a02c6100061c3dc030380e010040600d4070280c0e008080ffd9";
    const NEARLY: &str = "\
        ffd8fff7000b10000c001001011100fff8000d01ffff0018004d01220040ffda00080101000200004060101010204082\
        08bf00d0000000000019e3e1f0d00000000017360062900381ee51e8f6ae1e00000000034d1e00000000018780ea799b\
        86da2ba599c800300304143cdb1d4a9e2361d0dc980000000005280000000000019ed6030854de565602d1917d8d9340\
        04801b59757ed8ef8fc35c1430a2e91b68b75a3861b6a000000000000ced900200610c5e64c7717b54b2712900818431\
        b5021a0000000000000cf4f768192801dc04040a03a818ffd9";

    fn encoded(hex: &str) -> Vec<u8> {
        let digits: Vec<u8> = hex
            .chars()
            .filter_map(|digit| digit.to_digit(16))
            .filter_map(|digit| u8::try_from(digit).ok())
            .collect();
        digits
            .chunks(2)
            .map(|pair| pair[0] << 4 | pair[1])
            .collect()
    }

    fn value_at(x: i32, y: i32) -> i32 {
        if (x - 7).pow(2) + (y - 5).pow(2) < 20 {
            40000 + 37 * x * y % 501
        } else if x < 9 {
            3
        } else {
            x * y % 4
        }
    }

    #[test]
    fn the_example_of_the_standard_is_decoded() {
        assert_eq!(decode(EXAMPLE, [4, 4]).unwrap(), VALUES);
    }

    #[test]
    fn values_of_16_bits_are_as_near_as_the_stream_says() {
        let expected: Vec<i32> = (0..12)
            .flat_map(|y| (0..16).map(move |x| value_at(x, y)))
            .collect();
        for (hex, near) in [(LOSSLESS, 0), (NEARLY, 2)] {
            let decoded = decode(&encoded(hex), [16, 12]).unwrap();
            let errors = decoded
                .iter()
                .zip(&expected)
                .map(|(a, b)| (i32::from(*a) - b).abs());
            assert_eq!(errors.max(), Some(near));
            assert_eq!(is_lossy(&encoded(hex)), near > 0);
        }
    }

    #[test]
    fn a_stream_cut_off_or_changed_never_panics() {
        let whole = encoded(NEARLY);
        for length in 0..whole.len() {
            assert!(decode(&whole[..length], [16, 12]).is_err(), "{length}");
        }
        let mut refused = 0;
        for at in 0..whole.len() {
            for change in [0x01, 0x80, 0xFF] {
                let mut changed = whole.clone();
                changed[at] ^= change;
                refused += u32::from(decode(&changed, [16, 12]).is_err());
            }
        }
        assert!(refused > 100, "{refused}");
    }

    #[test]
    fn a_stream_ends_with_its_last_pixel() {
        for whole in [EXAMPLE.to_vec(), encoded(LOSSLESS), encoded(NEARLY)] {
            let size = if whole == EXAMPLE { [4, 4] } else { [16, 12] };
            let (scan, end) = whole.split_at(whole.len() - 2);
            let with = |parts: &[&[u8]]| decode(&parts.concat(), size);
            // Bytes that fill up to an even length, and before a marker.
            let good: [&[&[u8]]; 3] = [&[end, &[0]], &[&[0xFF], end], &[end, &[0xFF, 0]]];
            for end in good {
                with(&[&[scan][..], end].concat()).unwrap();
            }
            let mut other = end.to_vec();
            other[1] = 0xDA;
            let bad: [&[&[u8]]; 7] = [
                &[&[0], end],
                &[&[0; 40], end],
                &[&[0x55; 3], end],
                &[&other],
                &[end, &[1]],
                &[&end[..1]],
                &[],
            ];
            for end in bad {
                with(&[&[scan][..], end].concat()).unwrap_err();
            }
        }
    }

    #[test]
    fn what_is_not_one_grey_picture_in_a_scan_is_refused() {
        let refused = |at: usize, byte: u8, size: [usize; 2]| {
            let mut changed = EXAMPLE.to_vec();
            changed[at] = byte;
            decode(&changed, size).unwrap_err()
        };
        assert!(refused(6, 17, [4, 4]).contains("16 bits"));
        assert!(refused(11, 3, [4, 4]).contains("one component"));
        assert!(refused(21, 1, [4, 4]).contains("palette"));
        assert!(refused(22, 200, [4, 4]).contains("parameters"));
        assert!(refused(6, 8, [5, 4]).contains("another size"));
    }
}

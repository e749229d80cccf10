//! A JSON document with large arrays beside it, in few bytes.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde_json::{Value, json};

use super::document::base64;

/// Code of "none" in a quantised column.
const NONE: u16 = u16::MAX;

/// Arrays of numbers, and how the document refers to them.
///
/// An array is referred to as `{"at": byte, "n": count, "t": "u8" | "u16" | "u32" | "f32" | "f64"}`, a
/// quantised column also has `"low"` and `"step"`: value = low + step * code, and code 65535 stands
/// for none. What deflates better: arrays with `"d": k` hold the differences of each code from that `k` places
/// before, those with `"h": 1` how far each code lies below the least that is above all before it, both
/// modulo 2^16; those with `"p": 1` hold all low bytes first, then all high ones. Everything is
/// little-endian and starts at a multiple of four bytes.
#[derive(Debug, Default)]
pub(super) struct Pack {
    bytes: Vec<u8>,
}

impl Pack {
    /// Bytes so far.
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    fn place(&mut self, kind: &str, count: usize) -> Value {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        json!({"at": self.bytes.len(), "n": count, "t": kind})
    }

    /// Bytes.
    pub(crate) fn u8s(&mut self, values: &[u8]) -> Value {
        let reference = self.place("u8", values.len());
        self.bytes.extend_from_slice(values);
        reference
    }

    /// Indices: those below 2^16 - 1 in two bytes each, few once deflated where new ones come in
    /// ascending order; others in four.
    pub fn indices(&mut self, values: &[u32]) -> Value {
        // The largest is left out: one more than it is a code, too.
        let below_all = |&index: &u32| u16::try_from(index).ok().filter(|&code| code < u16::MAX);
        let narrow: Option<Vec<u16>> = values.iter().map(below_all).collect();
        if let Some(narrow) = narrow {
            let mut next = 0_u16;
            let below: Vec<u16> = narrow
                .iter()
                .map(|&index| {
                    let below = next.wrapping_sub(index);
                    next = next.max(index + 1);
                    below
                })
                .collect();
            let mut reference = self.place("u16", below.len());
            self.low_then_high_bytes(&below);
            reference["h"] = json!(1);
            reference["p"] = json!(1);
            return reference;
        }
        let reference = self.place("u32", values.len());
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        self.bytes.extend(bytes);
        reference
    }

    fn low_then_high_bytes(&mut self, codes: &[u16]) {
        let [low, high] = [0, 1].map(|byte| codes.iter().map(move |code| code.to_le_bytes()[byte]));
        self.bytes.extend(low.chain(high));
    }

    /// Codes of points, three each, as differences from one point to the next.
    pub fn points(&mut self, values: &[u16]) -> Value {
        let before = [0; 3].iter().chain(values);
        let steps: Vec<u16> = values
            .iter()
            .zip(before)
            .map(|(&here, &last)| here.wrapping_sub(last))
            .collect();
        let mut reference = self.u16s(&steps);
        reference["d"] = json!(3);
        reference
    }

    /// Whole numbers below 2^53, in ascending order, as differences in double precision; the script
    /// adds them up.
    pub fn numbers(&mut self, ascending: &[u64]) -> Value {
        let reference = self.place("f64", ascending.len());
        let mut last = 0;
        for &number in ascending {
            let step = (number - last) as f64;
            self.bytes.extend_from_slice(&step.to_le_bytes());
            last = number;
        }
        reference
    }

    /// Codes.
    pub(crate) fn u16s(&mut self, values: &[u16]) -> Value {
        let reference = self.place("u16", values.len());
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        self.bytes.extend(bytes);
        reference
    }

    /// Single precision.
    #[expect(clippy::cast_possible_truncation, reason = "places for a screen")]
    pub(crate) fn f32s(&mut self, values: impl IntoIterator<Item = f64>) -> Value {
        let values: Vec<f32> = values.into_iter().map(|value| value as f32).collect();
        let reference = self.place("f32", values.len());
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        self.bytes.extend(bytes);
        reference
    }

    /// A column of numbers in no order, in at most 65534 `steps` of its range: values are off by half a
    /// step at most, and what is not finite is none. All low bytes come first, then all high ones
    /// (`"p": 1`), which deflates better; fewer than 255 steps take one byte, and 255 is none.
    pub(crate) fn coarse_column(&mut self, values: &[f32], steps: u16) -> Value {
        let wide: Vec<f64> = values.iter().map(|&value| f64::from(value)).collect();
        let (low, step, codes) = quantised(&wide, steps);
        let narrow = steps < 255;
        let mut reference = self.place(if narrow { "u8" } else { "u16" }, codes.len());
        if narrow {
            // None is the largest code of either width: its low byte is 255 too.
            let low_bytes = codes.iter().map(|code| code.to_le_bytes()[0]);
            self.bytes.extend(low_bytes);
        } else {
            self.low_then_high_bytes(&codes);
            reference["p"] = json!(1);
        }
        reference["low"] = json!(low);
        reference["step"] = json!(step);
        reference
    }

    /// A column in steps of 1 / 65534 of its range: values are off by half a step at most. What is
    /// not finite is none. `smooth` columns are stored as differences.
    pub fn column(&mut self, values: &[f64], smooth: bool) -> Value {
        let (low, step, mut codes) = quantised(values, NONE - 1);
        if smooth {
            let mut last = 0_u16;
            for code in &mut codes {
                let here = *code;
                *code = here.wrapping_sub(last);
                last = here;
            }
        }
        let mut reference = self.u16s(&codes);
        reference["low"] = json!(low);
        reference["step"] = json!(step);
        if smooth {
            reference["d"] = json!(1);
        }
        reference
    }

    /// The document and its arrays: base64 of zlib of the document's length (four bytes,
    /// little-endian), the document, zeros up to a multiple of four bytes, the arrays.
    pub fn payload(self, document: &Value) -> String {
        deflated(&self.bytes(document))
    }

    /// The same without zlib and base64.
    pub fn bytes(self, document: &Value) -> Vec<u8> {
        let text = document.to_string();
        let mut raw = u32::try_from(text.len())
            .expect("documents are far below 4 GiB")
            .to_le_bytes()
            .to_vec();
        raw.extend_from_slice(text.as_bytes());
        raw.resize(raw.len().next_multiple_of(4), 0);
        raw.extend_from_slice(&self.bytes);
        raw
    }
}

/// Base64 of zlib.
pub(super) fn deflated(bytes: &[u8]) -> String {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    let compressed = encoder.write_all(bytes).and_then(|()| encoder.finish());
    base64(&compressed.expect("writing to memory does not fail"))
}

/// Lowest value, step and codes. Where values of both signs are, 0 is a step, and none gets the other sign; the code of what is not finite is [`NONE`].
fn quantised(values: &[f64], steps: u16) -> (f64, f64, Vec<u16>) {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let high = finite().fold(f64::NEG_INFINITY, f64::max);
    let (low, step) = if low < 0.0 && 0.0 < high && steps > 1 {
        // 0 is one of the steps: nothing changes its sign.
        let step = (high - low) / f64::from(steps - 1);
        (-(-low / step).ceil() * step, step)
    } else if low < high {
        (low, (high - low) / f64::from(steps))
    } else {
        (if low.is_finite() { low } else { 0.0 }, 1.0)
    };
    let code = |value: &f64| code_of((value - low) / step);
    (low, step, values.iter().map(code).collect())
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within 0 and 65534"
)]
fn code_of(steps: f64) -> u16 {
    if steps.is_finite() {
        steps.round().clamp(0.0, f64::from(NONE - 1)) as u16
    } else {
        NONE
    }
}

/// Reads payloads as the scripts do.
#[cfg(test)]
pub(super) mod unpack {
    use std::io::Read;

    use flate2::read::ZlibDecoder;

    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;

    use super::{NONE, Value};

    pub struct Unpacked {
        pub document: Value,
        pub arrays: Vec<u8>,
    }

    /// From the text of a page.
    pub(crate) fn of_page(html: &str) -> Unpacked {
        const START: &str = "<script type=\"application/octet-stream\" id=\"payload\">";
        let (_, rest) = html.split_once(START).unwrap();
        of_payload(rest.split_once("</script>").unwrap().0)
    }

    pub fn of_payload(payload: &str) -> Unpacked {
        let compressed = STANDARD.decode(payload).unwrap();
        let mut raw = Vec::new();
        ZlibDecoder::new(&*compressed)
            .read_to_end(&mut raw)
            .unwrap();
        let length = u32::from_le_bytes(raw[..4].try_into().unwrap()) as usize;
        Unpacked {
            document: serde_json::from_slice(&raw[4..4 + length]).unwrap(),
            arrays: raw[(4 + length).next_multiple_of(4)..].to_vec(),
        }
    }

    impl Unpacked {
        /// Values of a reference; NaN for none.
        pub fn column(&self, reference: &Value) -> Vec<f64> {
            let at = usize::try_from(reference["at"].as_u64().unwrap()).unwrap();
            let count = usize::try_from(reference["n"].as_u64().unwrap()).unwrap();
            let bytes = &self.arrays[at..];
            let (low, step) = (&reference["low"], &reference["step"]);
            let back = usize::try_from(reference["d"].as_u64().unwrap_or(0)).unwrap();
            let mut codes: Vec<u16> = Vec::new();
            let mut next = 0_u16;
            (0..count)
                .map(|k| match reference["t"].as_str().unwrap() {
                    "u8" => match step.as_f64() {
                        Some(_) if bytes[k] == u8::MAX => f64::NAN,
                        Some(step) => low.as_f64().unwrap() + step * f64::from(bytes[k]),
                        None => f64::from(bytes[k]),
                    },
                    "u32" => f64::from(u32::from_le_bytes(
                        bytes[4 * k..4 * k + 4].try_into().unwrap(),
                    )),
                    "f64" => f64::from_le_bytes(bytes[8 * k..8 * k + 8].try_into().unwrap()),
                    "f32" => f64::from(f32::from_le_bytes(
                        bytes[4 * k..4 * k + 4].try_into().unwrap(),
                    )),
                    _ => {
                        let mut code = if reference["p"] == 1 {
                            u16::from_le_bytes([bytes[k], bytes[count + k]])
                        } else {
                            u16::from_le_bytes(bytes[2 * k..2 * k + 2].try_into().unwrap())
                        };
                        if reference["h"] == 1 {
                            code = next.wrapping_sub(code);
                            next = next.max(code.wrapping_add(1));
                        }
                        if back > 0 && k >= back {
                            code = code.wrapping_add(codes[k - back]);
                        }
                        codes.push(code);
                        match step.as_f64() {
                            Some(_) if code == NONE => f64::NAN,
                            Some(step) => low.as_f64().unwrap() + step * f64::from(code),
                            None => f64::from(code),
                        }
                    }
                })
                .collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "columns of single precision"
    )]
    fn arrays_come_back_within_half_a_step() {
        let mut pack = Pack::default();
        let wave: Vec<f64> = (0..1000).map(|k| libm::sin(f64::from(k) * 0.01)).collect();
        let mut gaps = wave.clone();
        gaps[3] = f64::NAN;
        gaps[999] = f64::INFINITY;
        let single = |values: &[f64]| {
            values
                .iter()
                .map(|&value| value as f32)
                .collect::<Vec<f32>>()
        };
        let document = json!({
            "bytes": pack.u8s(&[1, 2, 3]),
            "smooth": pack.column(&wave, true),
            "gaps": pack.column(&gaps, true),
            "rough": pack.column(&wave, false),
            "planes": pack.coarse_column(&single(&gaps), 4094),
            "bytes_of_values": pack.coarse_column(&single(&gaps), 254),
            "one": pack.column(&[5.25; 4], false),
            "none": pack.column(&[f64::NAN; 2], false),
            "narrow": pack.indices(&[0, 1, 2, 2, 1, 3, 7, 0, 65_534, 4]),
            "wide": pack.indices(&[7, 65_535]),
            "points": pack.points(&[1, 2, 65_535, 0, 2, 7]),
            "single": pack.f32s([0.5, -3.0]),
        });
        let back = unpack::of_payload(&pack.payload(&document));
        assert_eq!(back.document, document);
        let column = |name: &str| back.column(&document[name]);
        // Half a step, and the rounding of the sum.
        // One step goes to zero's having a place of its own.
        let half_step = 2.0 / 65533.0 * 0.5 * (1.0 + 1e-6);
        for name in ["smooth", "rough"] {
            let worst = column(name)
                .iter()
                .zip(&wave)
                .fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
            assert!(worst <= half_step, "{name}: {worst}");
        }
        let read = column("gaps");
        assert!(read[3].is_nan() && read[999].is_nan());
        assert!((read[500] - wave[500]).abs() <= half_step);
        assert_eq!(column("bytes"), [1.0, 2.0, 3.0]);
        for (name, steps) in [("planes", 4093.0), ("bytes_of_values", 253.0)] {
            let read = column(name);
            assert!(read[3].is_nan() && read[999].is_nan(), "{name}");
            for (a, b) in read.iter().zip(&gaps).filter(|(_, b)| b.is_finite()) {
                // Single precision, too.
                assert!(
                    (a - b).abs() <= 1.0 / steps * (1.0 + 1e-4),
                    "{name}: {a} for {b}"
                );
                assert!(a * b >= 0.0, "{name}: {a} for {b} has another sign");
            }
        }
        assert_eq!(column("one"), [5.25; 4]);
        assert!(column("none").iter().all(|value| value.is_nan()));
        let narrow = [0.0, 1.0, 2.0, 2.0, 1.0, 3.0, 7.0, 0.0, 65_534.0, 4.0];
        assert_eq!(column("narrow"), narrow);
        assert_eq!(column("wide"), [7.0, 65_535.0]);
        assert_eq!(column("points"), [1.0, 2.0, 65_535.0, 0.0, 2.0, 7.0]);
        assert_eq!(column("single"), [0.5, -3.0]);
    }
}

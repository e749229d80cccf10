//! Frames of the harness protocol; the table is in `harness/README.md`.

use nalgebra::{Matrix3, Vector3};

/// Version of the protocol that this client speaks.
pub(super) const PROTOCOL_VERSION: u32 = 3;

/// Kind and payload length, u32 each.
pub(super) const HEADER_BYTES: usize = 8;

/// More than any model needs; a longer frame is a broken length field.
pub(super) const MAX_PAYLOAD_BYTES: usize = 1 << 28;

/// What the client asks, and what it is called in errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Request {
    Hello = 1,
    Load = 2,
    Reset = 3,
    Step = 4,
    Inverse = 5,
    Distance = 6,
    Quit = 7,
    Copy = 8,
    StepGroup = 9,
    Replay = 10,
    Clear = 11,
}

impl Request {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Hello => "HELLO",
            Self::Load => "LOAD",
            Self::Reset => "RESET",
            Self::Step => "STEP",
            Self::Inverse => "INVERSE",
            Self::Distance => "DISTANCE",
            Self::Quit => "QUIT",
            Self::Copy => "COPY",
            Self::StepGroup => "STEP_GROUP",
            Self::Replay => "REPLAY",
            Self::Clear => "CLEAR",
        }
    }

    /// The kind of frame that answers this request.
    pub(super) fn answer_kind(self) -> u32 {
        match self {
            Self::Hello => 0x81,
            Self::Load => 0x82,
            Self::Reset | Self::Step => 0x83,
            Self::Inverse => 0x84,
            Self::Distance => 0x85,
            Self::Quit => ERROR_KIND,
            Self::Copy => 0x86,
            Self::StepGroup => 0x87,
            Self::Replay => 0x88,
            Self::Clear => 0x89,
        }
    }
}

/// The answer that carries an error message.
pub(super) const ERROR_KIND: u32 = 0xFF;

/// A request under construction in a reused buffer.
#[derive(Debug)]
pub(super) struct Frame<'a>(&'a mut Vec<u8>);

impl<'a> Frame<'a> {
    pub(super) fn begin(buffer: &'a mut Vec<u8>, request: Request) -> Self {
        buffer.clear();
        buffer.extend((request as u32).to_le_bytes());
        buffer.extend([0; 4]);
        Self(buffer)
    }

    /// A request about one plant: its index, then padding that aligns the numbers.
    pub(super) fn begin_for_plant(buffer: &'a mut Vec<u8>, request: Request, plant: u32) -> Self {
        Self::begin(buffer, request).plant(plant, 0)
    }

    /// Index of a plant, and what a step of it is to look for.
    pub(super) fn plant(self, plant: u32, look: u32) -> Self {
        self.u32(plant).u32(look)
    }

    pub(super) fn u32(self, value: u32) -> Self {
        self.0.extend(value.to_le_bytes());
        self
    }

    pub(super) fn f64s(self, values: &[f64]) -> Self {
        for value in values {
            self.0.extend(value.to_le_bytes());
        }
        self
    }

    pub(super) fn bytes(self, bytes: &[u8]) -> Self {
        self.0.extend(bytes);
        self
    }

    /// Writes the payload's length into the header; an oversized length is returned as the error.
    pub(super) fn finish(self) -> Result<(), usize> {
        let length = self.0.len() - HEADER_BYTES;
        if length > MAX_PAYLOAD_BYTES {
            return Err(length);
        }
        let length = u32::try_from(length).expect("the limit is below 2^32");
        self.0[4..HEADER_BYTES].copy_from_slice(&length.to_le_bytes());
        Ok(())
    }
}

/// The payload is shorter or longer than its own counts say, or a text in it is not UTF-8.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Malformed;

/// Reads an answer's payload from the front.
#[derive(Debug)]
pub(super) struct Payload<'a>(pub(super) &'a [u8]);

impl Payload<'_> {
    fn array<const N: usize>(&mut self) -> Result<[u8; N], Malformed> {
        let (head, rest) = self.0.split_first_chunk::<N>().ok_or(Malformed)?;
        self.0 = rest;
        Ok(*head)
    }

    pub(super) fn u32(&mut self) -> Result<u32, Malformed> {
        self.array().map(u32::from_le_bytes)
    }

    /// A number of things, each of which takes at least `each_bytes` of what follows.
    pub(super) fn count(&mut self, each_bytes: usize) -> Result<usize, Malformed> {
        let count = self.u32()? as usize;
        // Before anything is allocated for a length that garbage claims.
        match count.checked_mul(each_bytes) {
            Some(bytes) if bytes <= self.0.len() => Ok(count),
            _ => Err(Malformed),
        }
    }

    /// An index, or `None` for -1.
    pub(super) fn optional_index(&mut self) -> Result<Option<u32>, Malformed> {
        let index = self.array().map(i32::from_le_bytes)?;
        if index == -1 {
            return Ok(None);
        }
        u32::try_from(index).map(Some).map_err(|_| Malformed)
    }

    pub(super) fn f64(&mut self) -> Result<f64, Malformed> {
        self.array().map(f64::from_le_bytes)
    }

    pub(super) fn f64s(&mut self, count: usize) -> Result<Vec<f64>, Malformed> {
        (0..count).map(|_| self.f64()).collect()
    }

    /// The same into a vector that keeps its memory.
    pub(super) fn f64s_into(
        &mut self,
        count: usize,
        values: &mut Vec<f64>,
    ) -> Result<(), Malformed> {
        values.clear();
        for _ in 0..count {
            values.push(self.f64()?);
        }
        Ok(())
    }

    pub(super) fn vector(&mut self) -> Result<Vector3<f64>, Malformed> {
        Ok(Vector3::new(self.f64()?, self.f64()?, self.f64()?))
    }

    /// Nine numbers, row by row, as MuJoCo keeps its matrices.
    pub(super) fn rotation(&mut self) -> Result<Matrix3<f64>, Malformed> {
        let mut rows = [0.0; 9];
        for value in &mut rows {
            *value = self.f64()?;
        }
        Ok(Matrix3::from_row_slice(&rows))
    }

    pub(super) fn string(&mut self) -> Result<String, Malformed> {
        let length = self.count(1)?;
        let (head, rest) = self.0.split_at(length);
        self.0 = rest;
        String::from_utf8(head.to_vec()).map_err(|_| Malformed)
    }

    pub(super) fn strings(&mut self) -> Result<Vec<String>, Malformed> {
        let count = self.count(4)?;
        (0..count).map(|_| self.string()).collect()
    }

    pub(super) fn finish(self) -> Result<(), Malformed> {
        if self.0.is_empty() {
            Ok(())
        } else {
            Err(Malformed)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_carries_its_kind_and_payload_length() {
        let mut buffer = vec![7; 3];
        let frame = Frame::begin_for_plant(&mut buffer, Request::Step, 2).f64s(&[1.5]);
        assert_eq!(frame.finish(), Ok(()));
        assert_eq!(buffer[..12], [4, 0, 0, 0, 16, 0, 0, 0, 2, 0, 0, 0]);
        assert_eq!(buffer[16..], 1.5_f64.to_le_bytes());
    }

    #[test]
    fn claimed_length_beyond_the_payload_is_malformed() {
        // One string that claims 2^32 - 1 bytes.
        let bytes = [1, 0, 0, 0, 255, 255, 255, 255, b'a'];
        assert_eq!(Payload(&bytes).strings(), Err(Malformed));
        assert_eq!(Payload(&[255; 4]).strings(), Err(Malformed));
    }

    #[test]
    fn trailing_bytes_are_malformed() {
        let mut payload = Payload(&[1, 0, 0, 0, 9]);
        assert_eq!(payload.u32(), Ok(1));
        assert_eq!(payload.finish(), Err(Malformed));
    }

    #[test]
    fn minus_one_is_no_index() {
        assert_eq!(Payload(&[255; 4]).optional_index(), Ok(None));
        assert_eq!(Payload(&[3, 0, 0, 0]).optional_index(), Ok(Some(3)));
        assert_eq!(
            Payload(&[254, 255, 255, 255]).optional_index(),
            Err(Malformed)
        );
    }
}

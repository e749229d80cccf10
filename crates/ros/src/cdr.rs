//! OMG's common data representation, plain and of version 1 (XCDR1), as ROS 2 has it on the wire: a head of four bytes,
//! then fields in order, each aligned to its own size from the end of the head on.

/// Elements of one sequence that are read; what says that it has more is refused before memory is taken for it.
const MOST_ELEMENTS: usize = 1000;

/// Writes one message, little endian.
#[derive(Debug, Clone)]
pub struct Encoder {
    body: Vec<u8>,
}

impl Default for Encoder {
    fn default() -> Self {
        Self {
            body: vec![0, 1, 0, 0],
        }
    }
}

/// Bytes before the fields: how they are represented.
const HEAD: usize = 4;

impl Encoder {
    fn put(&mut self, bytes: &[u8]) {
        let at = self.body.len() - HEAD;
        let start = at.next_multiple_of(bytes.len());
        self.body.resize(start + HEAD, 0);
        self.body.extend_from_slice(bytes);
    }

    /// `bool`.
    pub fn bool(&mut self, value: bool) {
        self.put(&[u8::from(value)]);
    }

    /// `int32`.
    pub fn i32(&mut self, value: i32) {
        self.put(&value.to_le_bytes());
    }

    /// `uint32`.
    pub fn u32(&mut self, value: u32) {
        self.put(&value.to_le_bytes());
    }

    /// `float32`.
    pub fn f32(&mut self, value: f32) {
        self.put(&value.to_le_bytes());
    }

    /// `float64`.
    pub fn f64(&mut self, value: f64) {
        self.put(&value.to_le_bytes());
    }

    /// Length of a sequence, before its elements.
    ///
    /// # Panics
    /// At 2^32 elements, which no message of ours has.
    pub fn count(&mut self, count: usize) {
        self.u32(u32::try_from(count).expect("fewer than 2^32 elements"));
    }

    /// `string`.
    pub fn string(&mut self, text: &str) {
        self.count(text.len() + 1);
        self.body.extend_from_slice(text.as_bytes());
        self.body.push(0);
    }

    /// `float64[]`.
    pub fn doubles(&mut self, values: &[f64]) {
        self.count(values.len());
        for value in values {
            self.f64(*value);
        }
    }

    /// `string[]`.
    pub fn strings<'t>(&mut self, texts: impl ExactSizeIterator<Item = &'t str>) {
        self.count(texts.len());
        for text in texts {
            self.string(text);
        }
    }

    /// The message.
    pub fn finish(self) -> Vec<u8> {
        self.body
    }
}

/// Reads one message, of either endianness. Everything is `None` where the bytes end before it does.
#[derive(Debug, Clone)]
pub struct Decoder<'a> {
    body: &'a [u8],
    at: usize,
    little: bool,
}

impl<'a> Decoder<'a> {
    /// Of a message with its head.
    pub fn new(data: &'a [u8]) -> Option<Self> {
        let (head, body) = data.split_at_checked(HEAD)?;
        Some(Self {
            body,
            at: 0,
            little: head[1] & 1 == 1,
        })
    }

    fn take(&mut self, count: usize, alignment: usize) -> Option<&'a [u8]> {
        let start = self.at.next_multiple_of(alignment);
        let bytes = self.body.get(start..start.checked_add(count)?)?;
        self.at = start + count;
        Some(bytes)
    }

    /// `uint32`.
    pub fn u32(&mut self) -> Option<u32> {
        let bytes = self.take(4, 4)?.try_into().ok()?;
        Some(if self.little {
            u32::from_le_bytes(bytes)
        } else {
            u32::from_be_bytes(bytes)
        })
    }

    /// `int32`.
    pub fn i32(&mut self) -> Option<i32> {
        Some(self.u32()?.cast_signed())
    }

    /// Length of a sequence.
    fn count(&mut self) -> Option<usize> {
        let count = usize::try_from(self.u32()?).ok()?;
        (count <= MOST_ELEMENTS).then_some(count)
    }

    /// `string`.
    pub fn string(&mut self) -> Option<String> {
        let count = usize::try_from(self.u32()?).ok()?;
        let bytes = self.take(count, 1)?;
        let text = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        String::from_utf8(text.to_vec()).ok()
    }

    /// `string[]`.
    pub fn strings(&mut self) -> Option<Vec<String>> {
        let count = self.count()?;
        (0..count).map(|_| self.string()).collect()
    }

    /// `float64[]`.
    pub fn doubles(&mut self) -> Option<Vec<f64>> {
        let count = self.count()?;
        let mut found = Vec::with_capacity(count);
        for _ in 0..count {
            let bytes = self.take(8, 8)?.try_into().ok()?;
            found.push(if self.little {
                f64::from_le_bytes(bytes)
            } else {
                f64::from_be_bytes(bytes)
            });
        }
        Some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_aligned_to_their_own_size_from_the_end_of_the_head() {
        let mut cdr = Encoder::default();
        cdr.bool(true);
        cdr.u32(2);
        cdr.string("ab");
        cdr.f64(1.0);
        cdr.f32(0.5);
        let expected = [
            &[0, 1, 0, 0][..],
            &[1, 0, 0, 0],
            &[2, 0, 0, 0],
            &[3, 0, 0, 0, b'a', b'b', 0, 0],
            &1.0_f64.to_le_bytes(),
            &0.5_f32.to_le_bytes(),
        ];
        assert_eq!(cdr.finish(), expected.concat());
    }

    #[test]
    fn a_sequence_without_elements_has_its_length_alone() {
        let mut cdr = Encoder::default();
        cdr.doubles(&[]);
        cdr.u32(7);
        assert_eq!(cdr.finish(), [0, 1, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0]);
    }

    #[test]
    fn a_length_beyond_the_message_takes_no_memory() {
        let data = [0, 1, 0, 0, 255, 255, 255, 255];
        assert!(Decoder::new(&data).unwrap().doubles().is_none());
        assert!(Decoder::new(&data).unwrap().string().is_none());
    }
}

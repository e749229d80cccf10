//! Numbers at their places in a header, in its byte order.

/// The bytes of a header.
#[derive(Debug)]
pub(crate) struct Fields<'a> {
    pub(crate) bytes: &'a [u8],
    pub(crate) is_big_endian: bool,
}

impl Fields<'_> {
    fn at<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut array = [0; N];
        if let Some(bytes) = self.bytes.get(at..at + N) {
            array.copy_from_slice(bytes);
        }
        if self.is_big_endian {
            array.reverse();
        }
        array
    }

    pub(crate) fn byte(&self, at: usize) -> u8 {
        u8::from_le_bytes(self.at(at))
    }

    pub(crate) fn i16(&self, at: usize) -> i64 {
        i16::from_le_bytes(self.at(at)).into()
    }

    pub(crate) fn i32(&self, at: usize) -> i64 {
        i32::from_le_bytes(self.at(at)).into()
    }

    pub(crate) fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.at(at))
    }

    pub(crate) fn f32(&self, at: usize) -> f64 {
        f32::from_le_bytes(self.at(at)).into()
    }

    pub(crate) fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.at(at))
    }
}

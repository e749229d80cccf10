//! OMG's common data representation, plain and of version 1 (XCDR1), as ROS 2 has it on the wire: a head of four bytes,
//! then fields in order, each aligned to its own size from the end of the head on.

use byteorder::{BigEndian, LittleEndian};
use cdr_encoding::{from_bytes, to_writer};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Bytes before the fields: plain, little endian, no options.
const HEAD: [u8; 4] = [0, 1, 0, 0];

/// The bytes of a message.
pub(crate) fn encode(message: &impl Serialize) -> Vec<u8> {
    let mut bytes = HEAD.to_vec();
    to_writer::<_, LittleEndian, _>(&mut bytes, message).expect("memory takes all");
    bytes
}

/// The message of bytes, of either endianness; `None` where they end before it does.
pub(crate) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    let ([_, representation, _, _], body) = bytes.split_first_chunk()?;
    let read = match representation & 1 {
        1 => from_bytes::<T, LittleEndian>(body),
        _ => from_bytes::<T, BigEndian>(body),
    };
    read.ok().map(|(message, _)| message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_aligned_to_their_own_size_from_the_end_of_the_head() {
        let expected = [
            &[0, 1, 0, 0][..],
            &[1, 0, 0, 0],
            &[2, 0, 0, 0],
            &[3, 0, 0, 0, b'a', b'b', 0, 0],
            &1.0_f64.to_le_bytes(),
            &0.5_f32.to_le_bytes(),
        ];
        let fields = (true, 2_u32, "ab", 1.0_f64, 0.5_f32);
        assert_eq!(encode(&fields), expected.concat());
    }

    #[test]
    fn a_sequence_without_elements_has_its_length_alone() {
        let fields: (&[f64], u32) = (&[], 7);
        assert_eq!(encode(&fields), [0, 1, 0, 0, 0, 0, 0, 0, 7, 0, 0, 0]);
    }

    #[test]
    fn the_head_says_which_byte_comes_first() {
        let little = [0, 1, 0, 0, 3, 0, 0, 0, 2, 1, 0, 0];
        let big = [0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 1, 2];
        assert_eq!(decode(&little), Some((3_i32, 258_u32)));
        assert_eq!(decode(&big), Some((3_i32, 258_u32)));
    }

    #[test]
    fn a_length_beyond_the_message_takes_no_memory() {
        let bytes = [0, 1, 0, 0, 255, 255, 255, 255];
        assert_eq!(decode::<Vec<f64>>(&bytes), None);
        assert_eq!(decode::<Vec<String>>(&bytes), None);
        assert_eq!(decode::<String>(&bytes), None);
    }
}

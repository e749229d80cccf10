//! The SHA-256 of a whole table, written into the table itself.
//!
//! It stands in the footer's metadata as 64 hexadecimal digits, and is that of the file with 64 zeros in
//! their place. So no bit of a table can change unnoticed, wherever the file is taken: of the row groups,
//! of the footer that says how they are read, and of the sum.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

use sha2::{Digest, Sha256};

use super::schema::SUM_KEY;

/// What stands in place of the sum while it is made.
pub(crate) const BLANK: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// Bytes behind the footer: its length and the end mark.
const END: u64 = 8;

/// Bytes that are hashed at a time.
const CHUNK: usize = 1 << 20;

/// Writes the sum into a table that has [`BLANK`] there.
pub(crate) fn seal(mut file: &File) -> io::Result<()> {
    let place = place(file, BLANK)?;
    let place = place.ok_or_else(|| io::Error::other("the footer has no place for the sum"))?;
    let sum = sum(file, place)?;
    file.seek(SeekFrom::Start(place))?;
    file.write_all(sum.as_bytes())
}

/// Whether a table is as it was when this sum was written into it.
pub(crate) fn is_whole(file: &File, stored: &str) -> io::Result<bool> {
    if stored.len() != BLANK.len() {
        return Ok(false);
    }
    match place(file, stored)? {
        Some(place) => Ok(sum(file, place)? == stored),
        None => Ok(false),
    }
}

/// Offset of the sum, by its key: the last in the footer, where nothing else is written behind it.
fn place(mut file: &File, stored: &str) -> io::Result<Option<u64>> {
    let length = file.metadata()?.len();
    let Some(end) = length.checked_sub(END) else {
        return Ok(None);
    };
    file.seek(SeekFrom::Start(end))?;
    let mut footer_length = [0; 4];
    file.read_exact(&mut footer_length)?;
    let Some(start) = end.checked_sub(u64::from(u32::from_le_bytes(footer_length))) else {
        return Ok(None);
    };
    file.seek(SeekFrom::Start(start))?;
    let mut footer = Vec::new();
    file.take(end - start).read_to_end(&mut footer)?;
    // Thrift's compact protocol: the next field, a text, of 64 bytes.
    let pattern = [SUM_KEY.as_bytes(), &[0x18, 0x40], stored.as_bytes()].concat();
    let found = footer
        .windows(pattern.len())
        .rposition(|bytes| bytes == pattern);
    Ok(found.map(|at| start + (at + pattern.len() - stored.len()) as u64))
}

/// The sum of the file with [`BLANK`] at an offset.
fn sum(mut file: &File, place: u64) -> io::Result<String> {
    file.seek(SeekFrom::Start(0))?;
    let mut hash = Sha256::new();
    let mut chunk = vec![0; CHUNK];
    let mut at = 0;
    loop {
        let read = match file.read(&mut chunk) {
            Ok(0) => break,
            Ok(read) => read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        for (offset, byte) in (at..).zip(&mut chunk[..read]) {
            if (place..place + BLANK.len() as u64).contains(&offset) {
                *byte = b'0';
            }
        }
        hash.update(&chunk[..read]);
        at += read as u64;
    }
    Ok(hash
        .finalize()
        .iter()
        .fold(String::new(), |mut text, byte| {
            // Writing to a String cannot fail.
            let _ = write!(text, "{byte:02x}");
            text
        }))
}

//! The bytes of a file, whether it is compressed or not.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use flate2::bufread::GzDecoder;

use crate::ImagingError;
use crate::read::unreadable;

/// What deflate can make of a byte at most (RFC 1951: 258 bytes from two bits, less the codes' tables).
const MOST_INFLATION: u64 = 1032;

/// Bytes read from the disk at a time.
const BUFFER: usize = 1 << 17;

/// First bytes of a gzip member.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// A file's bytes from first to last, inflated where it is compressed.
#[derive(Debug)]
pub(in crate::read) struct ByteStream {
    source: Source,
    is_compressed: bool,
    file_bytes: u64,
    at: u64,
}

#[derive(Debug)]
enum Source {
    Plain(BufReader<File>),
    Gzip(Box<GzDecoder<BufReader<File>>>),
    /// Nothing more; what was left over, if anything.
    End(Option<&'static str>),
}

impl ByteStream {
    pub(in crate::read) fn open(path: &Path) -> Result<Self, ImagingError> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let unreadable = |error: std::io::Error| unreadable(error).at(name.clone());
        let file = File::open(path).map_err(unreadable)?;
        let file_bytes = file.metadata().map_err(unreadable)?.len();
        let mut reader = BufReader::with_capacity(BUFFER, file);
        let is_compressed = reader.fill_buf().map_err(unreadable)?.starts_with(&GZIP);
        let source = if is_compressed {
            Source::Gzip(Box::new(GzDecoder::new(reader)))
        } else {
            Source::Plain(reader)
        };
        Ok(Self {
            source,
            is_compressed,
            file_bytes,
            at: 0,
        })
    }

    /// How it is compressed, for people.
    pub(in crate::read) fn compression(&self) -> Option<&'static str> {
        self.is_compressed.then_some("gzip")
    }

    /// What comes next of a file that is not compressed: nothing at its end.
    pub(in crate::read) fn first_as_they_are(&mut self) -> Result<Option<&[u8]>, ImagingError> {
        match &mut self.source {
            Source::Plain(reader) => reader.fill_buf().map(Some).map_err(unreadable),
            _ => Ok(None),
        }
    }

    /// More than this the file cannot hold, whatever is in it.
    pub(in crate::read) fn most_bytes(&self) -> u64 {
        if self.is_compressed {
            self.file_bytes.saturating_mul(MOST_INFLATION)
        } else {
            self.file_bytes
        }
    }

    /// Fills a piece, and says how far it came: less than all only at the end of the file.
    pub(in crate::read) fn fill(&mut self, piece: &mut [u8]) -> Result<usize, ImagingError> {
        let mut filled = 0;
        while filled < piece.len() {
            let got = self.read(&mut piece[filled..])?;
            if got == 0 {
                break;
            }
            filled += got;
        }
        self.at += filled as u64;
        Ok(filled)
    }

    /// Once, through the end of a gzip member into the next one; 0 at the end of the file.
    fn read(&mut self, piece: &mut [u8]) -> Result<usize, ImagingError> {
        loop {
            let got = match &mut self.source {
                Source::End(_) => return Ok(0),
                Source::Plain(reader) => reader.read(piece),
                Source::Gzip(decoder) => decoder.read(piece),
            };
            match got {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                    self.source = Source::End(Some("the file ends before its checksum"));
                }
                Err(error) => {
                    return Err(ImagingError::refused(format!(
                        "the file is damaged after {} bytes: {error}",
                        self.at
                    ))
                    .hint("copy or export it again"));
                }
                Ok(0) => self.next_member()?,
                Ok(got) => return Ok(got),
            }
        }
    }

    /// Goes on to the member that follows at the end of one.
    fn next_member(&mut self) -> Result<(), ImagingError> {
        let Source::Gzip(decoder) = std::mem::replace(&mut self.source, Source::End(None)) else {
            return Ok(());
        };
        let mut reader = decoder.into_inner();
        let first = two_bytes(&mut reader).map_err(unreadable)?;
        if first.starts_with(&GZIP) {
            self.source = Source::Gzip(Box::new(GzDecoder::new(reader)));
        } else if first.iter().any(|byte| *byte != 0) {
            // Zeros are the padding of tapes and blocks.
            self.source = Source::End(Some(
                "data after the compressed data are not gzip and are ignored",
            ));
        }
        Ok(())
    }

    pub(in crate::read) fn skip_to(&mut self, offset: u64) -> Result<(), ImagingError> {
        let mut piece = [0; 4096];
        while self.at < offset {
            let length =
                usize::try_from(offset - self.at).map_or(piece.len(), |rest| rest.min(piece.len()));
            if self.fill(&mut piece[..length])? == 0 {
                break;
            }
        }
        Ok(())
    }

    /// After the last voxel: reads on to the sum at the end of the gzip member, and says what is odd there.
    pub(in crate::read) fn finish(
        &mut self,
        piece: &mut [u8],
    ) -> Result<Option<&'static str>, ImagingError> {
        if self.fill(piece)? > 0 {
            return Ok(Some("data after the last voxel are ignored"));
        }
        Ok(match self.source {
            Source::End(odd) => odd,
            _ => None,
        })
    }
}

/// What comes next, at least two bytes of it where the file has them: the buffer may end between them.
fn two_bytes(reader: &mut BufReader<File>) -> std::io::Result<&[u8]> {
    if reader.buffer().len() < GZIP.len() {
        let at = reader.stream_position()?;
        // Empties the buffer.
        reader.seek(SeekFrom::Start(at))?;
    }
    reader.fill_buf()
}

//! The bytes of a file, whether it is compressed or not.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use flate2::bufread::{GzDecoder, ZlibDecoder};

use crate::VolumeError;
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
    compression: Option<Compression>,
    /// That are not yet read where the stream began.
    file_bytes: u64,
    at: u64,
}

/// How bytes are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::read) enum Compression {
    Gzip,
    Zlib,
}

#[derive(Debug)]
enum Source {
    Plain(BufReader<File>),
    Gzip(Box<GzDecoder<BufReader<File>>>),
    Zlib(Box<ZlibDecoder<BufReader<File>>>),
    /// Nothing more; what was left over, if anything.
    End(Option<&'static str>),
}

impl ByteStream {
    pub(in crate::read) fn open(path: &Path) -> Result<Self, VolumeError> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let unreadable = |error: std::io::Error| unreadable(error).at(name.clone());
        let file = File::open(path).map_err(unreadable)?;
        let file_bytes = file.metadata().map_err(unreadable)?.len();
        let mut reader = BufReader::with_capacity(BUFFER, file);
        let is_gzip = reader.fill_buf().map_err(unreadable)?.starts_with(&GZIP);
        let source = if is_gzip {
            Source::Gzip(Box::new(GzDecoder::new(reader)))
        } else {
            Source::Plain(reader)
        };
        Ok(Self {
            source,
            compression: is_gzip.then_some(Compression::Gzip),
            file_bytes,
            at: 0,
        })
    }

    /// The rest of a file from here on, which is compressed; places are counted anew.
    pub(in crate::read) fn inflated(self, compression: Compression) -> Result<Self, VolumeError> {
        let Source::Plain(reader) = self.source else {
            return Err(VolumeError::refused(
                "the voxels are compressed twice, with the file around them",
            )
            .hint("decompress the file with gunzip first"));
        };
        Ok(Self {
            source: match compression {
                Compression::Gzip => Source::Gzip(Box::new(GzDecoder::new(reader))),
                Compression::Zlib => Source::Zlib(Box::new(ZlibDecoder::new(reader))),
            },
            compression: Some(compression),
            file_bytes: self.file_bytes.saturating_sub(self.at),
            at: 0,
        })
    }

    /// Bytes from the beginning of the stream.
    pub(in crate::read) fn at(&self) -> u64 {
        self.at
    }

    /// Bytes that a file has which is not compressed.
    pub(in crate::read) fn plain_bytes(&self) -> Option<u64> {
        self.compression.is_none().then_some(self.file_bytes)
    }

    /// The next line without its end; none at the end of the file, an error for one of more than `most` bytes.
    pub(in crate::read) fn line(&mut self, most: usize) -> Result<Option<Vec<u8>>, VolumeError> {
        let (mut line, mut byte) = (Vec::new(), [0]);
        loop {
            if self.fill(&mut byte)? == 0 {
                return Ok(Some(line).filter(|line| !line.is_empty()));
            }
            if byte == *b"\n" {
                if line.last() == Some(&b'\r') {
                    line.pop();
                }
                return Ok(Some(line));
            }
            if line.len() == most {
                return Err(VolumeError::refused(format!(
                    "a line of the header has more than {most} bytes: the header is damaged"
                ))
                .hint("copy or export it again"));
            }
            line.push(byte[0]);
        }
    }

    /// How it is compressed, for people.
    pub(in crate::read) fn compression(&self) -> Option<&'static str> {
        self.compression.map(|compression| match compression {
            Compression::Gzip => "gzip",
            Compression::Zlib => "zlib",
        })
    }

    /// What comes next of a file that is not compressed: nothing at its end.
    pub(in crate::read) fn first_as_they_are(&mut self) -> Result<Option<&[u8]>, VolumeError> {
        match &mut self.source {
            Source::Plain(reader) => reader.fill_buf().map(Some).map_err(unreadable),
            _ => Ok(None),
        }
    }

    /// More than this the file cannot hold, whatever is in it.
    pub(in crate::read) fn most_bytes(&self) -> u64 {
        if self.compression.is_some() {
            self.file_bytes.saturating_mul(MOST_INFLATION)
        } else {
            self.file_bytes
        }
    }

    /// Fills a piece, and says how far it came: less than all only at the end of the file.
    pub(in crate::read) fn fill(&mut self, piece: &mut [u8]) -> Result<usize, VolumeError> {
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
    fn read(&mut self, piece: &mut [u8]) -> Result<usize, VolumeError> {
        loop {
            let got = match &mut self.source {
                Source::End(_) => return Ok(0),
                Source::Plain(reader) => reader.read(piece),
                Source::Gzip(decoder) => decoder.read(piece),
                Source::Zlib(decoder) => decoder.read(piece),
            };
            match got {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                    self.source = Source::End(Some("the file ends before its checksum"));
                }
                Err(error) => {
                    return Err(VolumeError::refused(format!(
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
    fn next_member(&mut self) -> Result<(), VolumeError> {
        let source = std::mem::replace(&mut self.source, Source::End(None));
        let mut reader = match source {
            Source::Gzip(decoder) => decoder.into_inner(),
            Source::Zlib(decoder) => decoder.into_inner(),
            Source::Plain(_) | Source::End(_) => return Ok(()),
        };
        let is_gzip = self.compression == Some(Compression::Gzip);
        let first = two_bytes(&mut reader).map_err(unreadable)?;
        if is_gzip && first.starts_with(&GZIP) {
            self.source = Source::Gzip(Box::new(GzDecoder::new(reader)));
        } else if first.iter().any(|byte| *byte != 0) {
            // Zeros are the padding of tapes and blocks.
            self.source = Source::End(Some(if is_gzip {
                "data after the compressed data are not gzip and are ignored"
            } else {
                "data after the compressed data are ignored"
            }));
        }
        Ok(())
    }

    pub(in crate::read) fn skip_to(&mut self, offset: u64) -> Result<(), VolumeError> {
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

    /// After the last voxel: reads on to the sum at the end of the compressed data, and says what is odd there.
    pub(in crate::read) fn finish(
        &mut self,
        piece: &mut [u8],
        has_trailer: bool,
    ) -> Result<Option<&'static str>, VolumeError> {
        if has_trailer {
            // A few hundred bytes; not all of a file that goes on.
            self.fill(piece)?;
        } else if self.fill(piece)? > 0 {
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

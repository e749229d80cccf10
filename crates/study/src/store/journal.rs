//! `journal.nbj`: finished blocks of cases, appended in any order by one process.
//!
//! All numbers are little-endian. The file begins with a header
//!
//! | Bytes | Content |
//! |---|---|
//! | 8 | `NBJRNL` and two zero bytes |
//! | 4 | schema version |
//! | 4 | length `n` of the key |
//! | n | key: study id, cases, cases of a block, shard, as text, one per line |
//! | 4 | CRC32 of all this |
//!
//! and goes on with one record per block:
//!
//! | Bytes | Content |
//! |---|---|
//! | 4 | `NBJB` |
//! | 8 | index of the block |
//! | 4 | number of its cases |
//! | 4 | length of the payload before compression |
//! | 4 | length of the payload |
//! | 4 | CRC32 of the payload |
//! | 4 | CRC32 of the key and the fields above |
//! | ... | payload (see [`codec`](super::codec)) |
//!
//! A record is one `write` at the end of the file: killed at any moment, a process leaves whole
//! records and at most one that is cut off, which its CRC gives away. The key is part of a record's
//! CRC, so no record of another study is ever taken for one of this.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufReader, Read, Write};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};

use crc32fast::Hasher;
use needlebench_input::{InputError, open_input};

use super::codec::{self, Packed};
use super::columns::Columns;
use super::error::{LOCK, StudyError};
use super::manifest::{Manifest, SCHEMA_VERSION, Shard, owns};

/// Name of the journal in a study's folder.
pub const JOURNAL_FILE: &str = "journal.nbj";

const MAGIC: [u8; 8] = *b"NBJRNL\0\0";
const MARK: [u8; 4] = *b"NBJB";
const RECORD_HEADER: usize = 32;

/// Who asks how far a study is holds a lock for a moment: so often, and so long after each other, a
/// process that wants to write tries.
const LOOKS: u32 = 10;
const LOOK: std::time::Duration = std::time::Duration::from_millis(50);

/// Where blocks are in a journal: offsets of their records, by index.
pub(crate) type Places = Vec<Option<NonZeroU64>>;

/// Bytes of a journal that are no records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Damage {
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
}

/// What a journal holds.
#[derive(Debug)]
pub(crate) struct Scan {
    pub(crate) places: Places,
    pub(crate) extent: Extent,
}

/// What a journal is beside its blocks.
#[derive(Debug)]
pub(crate) struct Extent {
    /// Between records.
    pub(crate) damages: Vec<Damage>,
    /// End of the last record.
    pub(crate) end: u64,
    /// Behind it.
    pub(crate) tail_bytes: u64,
    /// Of the header.
    header: HeaderState,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum HeaderState {
    Whole,
    /// The file ends within it: it never had a record.
    CutOff,
    Damaged,
}

/// What ties records to a study.
#[derive(Debug, Clone)]
pub(crate) struct Key {
    text: String,
    crc: Hasher,
}

impl Key {
    pub(crate) fn new(manifest: &Manifest) -> Self {
        Self::of(manifest, manifest.shard)
    }

    /// That of a shard of the manifest's study.
    pub(crate) fn of(manifest: &Manifest, shard: Option<Shard>) -> Self {
        let shard = shard.map_or("all".to_owned(), String::from);
        let text = format!(
            "{}\n{}\n{}\n{shard}\n",
            manifest.study_id, manifest.cases, manifest.block_cases
        );
        let mut crc = Hasher::new();
        crc.update(text.as_bytes());
        Self { text, crc }
    }

    fn header(&self) -> Vec<u8> {
        let length = u32::try_from(self.text.len()).expect("a key is short");
        let mut bytes = MAGIC.to_vec();
        bytes.extend(SCHEMA_VERSION.to_le_bytes());
        bytes.extend(length.to_le_bytes());
        bytes.extend_from_slice(self.text.as_bytes());
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        bytes
    }

    /// A block as a record.
    pub(crate) fn record(&self, block: u64, cases: usize, packed: &Packed) -> Vec<u8> {
        let length =
            |count: usize| u32::try_from(count).expect("a block has fewer than 2^32 bytes");
        let mut bytes = Vec::with_capacity(RECORD_HEADER + packed.bytes.len());
        bytes.extend(MARK);
        bytes.extend(block.to_le_bytes());
        bytes.extend(length(cases).to_le_bytes());
        bytes.extend(length(packed.raw_length).to_le_bytes());
        bytes.extend(length(packed.bytes.len()).to_le_bytes());
        bytes.extend(crc32fast::hash(&packed.bytes).to_le_bytes());
        bytes.extend(self.crc(&bytes).to_le_bytes());
        bytes.extend_from_slice(&packed.bytes);
        bytes
    }

    fn crc(&self, fields: &[u8]) -> u32 {
        let mut crc = self.crc.clone();
        crc.update(fields);
        crc.finalize()
    }
}

/// Fields of a record.
#[derive(Debug, Clone, Copy)]
struct Record {
    block: u64,
    cases: u32,
    raw_length: u32,
    length: u32,
    crc: u32,
}

impl Record {
    fn parse(bytes: &[u8; RECORD_HEADER], key: &Key) -> Option<Self> {
        let (fields, crc) = bytes.split_at(RECORD_HEADER - 4);
        let u32_at =
            |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
        (fields[..4] == MARK && key.crc(fields).to_le_bytes() == crc).then(|| Self {
            block: u64::from_le_bytes(bytes[4..12].try_into().expect("eight bytes")),
            cases: u32_at(12),
            raw_length: u32_at(16),
            length: u32_at(20),
            crc: u32_at(24),
        })
    }
}

/// A journal of this process alone.
#[derive(Debug)]
pub(crate) struct Journal {
    file: File,
    end: u64,
}

impl Journal {
    /// Opens or creates the journal of a folder and keeps other processes out.
    pub(crate) fn lock(folder: &Path) -> Result<Self, StudyError> {
        let path = folder.join(JOURNAL_FILE);
        let mut options = OpenOptions::new();
        let file = options.read(true).append(true).create(true).open(&path);
        let file = file.map_err(StudyError::io("open", &path))?;
        for _ in 0..LOOKS {
            match file.try_lock() {
                Ok(()) => return Ok(Self { file, end: 0 }),
                Err(TryLockError::WouldBlock) => std::thread::sleep(LOOK),
                Err(TryLockError::Error(error)) => return Err(StudyError::io(LOCK, &path)(error)),
            }
        }
        Err(StudyError::Locked {
            folder: folder.to_owned(),
        })
    }

    /// Makes the journal ready to go on: writes a header where none is and cuts off what is behind
    /// the last record. Returns what was found before.
    pub(crate) fn prepare(&mut self, path: &Path, manifest: &Manifest) -> Result<Scan, StudyError> {
        let scan = scan(path, manifest)?;
        let key = Key::new(manifest);
        let header = key.header();
        let repair = || -> io::Result<u64> {
            match scan.extent.header {
                HeaderState::Whole => {}
                HeaderState::CutOff => {
                    self.file.set_len(0)?;
                    (&self.file).write_all(&header)?;
                    return Ok(header.len() as u64);
                }
                HeaderState::Damaged => {
                    // Records say themselves whose they are; the file in append mode cannot be
                    // written at its beginning.
                    let mut file = OpenOptions::new().write(true).open(path)?;
                    file.write_all(&header)?;
                }
            }
            self.file.set_len(scan.extent.end)?;
            Ok(scan.extent.end)
        };
        self.end = repair().map_err(|source| StudyError::Write {
            path: path.to_owned(),
            source,
            kept: kept(manifest, &scan.places),
            total: manifest.own_cases(),
            folder: path.parent().unwrap_or(path).to_owned(),
        })?;
        Ok(scan)
    }

    /// Adds a record, or nothing. Returns its offset.
    pub(crate) fn append(&mut self, record: &[u8]) -> io::Result<u64> {
        let at = self.end;
        (&self.file).write_all(record).inspect_err(|_| {
            // What a full disk took of it. If this fails too, the next scan finds it.
            let _ = self.file.set_len(at);
        })?;
        self.end += record.len() as u64;
        Ok(at)
    }

    /// Waits until all of it is on the disk.
    pub(crate) fn sync(&self) -> io::Result<()> {
        self.file.sync_data()
    }
}

/// Number of cases in the blocks that are there.
pub(crate) fn kept(manifest: &Manifest, places: &Places) -> u64 {
    (0..manifest.blocks())
        .zip(places)
        .filter(|(_, place)| place.is_some())
        .map(|(block, _)| manifest.block_len(block) as u64)
        .sum()
}

/// Opens a journal to read it.
pub(crate) fn open(path: &Path) -> Result<File, StudyError> {
    open_input(path).map_err(|error| match error {
        InputError::Io(error) => StudyError::io("read", path)(error),
        error => StudyError::file(path, format!("is not a journal: {error}")),
    })
}

/// Finds all blocks of a journal, checking each.
///
/// # Errors
/// [`StudyError::File`] if it is the journal of another study, or none.
pub(crate) fn scan(path: &Path, manifest: &Manifest) -> Result<Scan, StudyError> {
    let blocks = usize::try_from(manifest.blocks()).expect("blocks are indexed in memory");
    let mut places = vec![None; blocks];
    let file = open(path)?;
    let extent = scan_blocks(file, path, manifest, manifest.shard, |found| {
        let block = usize::try_from(found.block).expect("blocks are indexed in memory");
        places[block] = places[block].or(Some(found.place));
    })?;
    Ok(Scan { places, extent })
}

/// A block that is in a journal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct FoundBlock {
    /// Index of the block.
    pub(crate) block: u64,
    /// Offset of its record.
    pub(crate) place: NonZeroU64,
    /// Length of the record.
    pub(crate) bytes: u64,
}

/// Checks all of a shard's journal and hands over every block, in the order of the file.
///
/// # Errors
/// As [`scan`].
pub(crate) fn scan_blocks(
    file: File,
    path: &Path,
    manifest: &Manifest,
    shard: Option<Shard>,
    mut found: impl FnMut(FoundBlock),
) -> Result<Extent, StudyError> {
    let failed = || StudyError::io("read", path);
    let length = file.metadata().map_err(failed())?.len();
    let key = Key::of(manifest, shard);
    let mut source = Source::new(file, length);
    let header = check_header(&mut source, &key, path)?;
    let mut extent = Extent {
        damages: Vec::new(),
        end: 0,
        tail_bytes: 0,
        header,
    };
    if header == HeaderState::CutOff {
        extent.tail_bytes = length;
        return Ok(extent);
    }
    let mut at = key.header().len() as u64;
    if header == HeaderState::Damaged {
        extent.damages.push(Damage {
            offset: 0,
            bytes: at,
        });
    }
    extent.end = at;
    loop {
        let mut record = source.record(at, &key).map_err(failed())?;
        if record.is_none()
            && let Some((next, later)) = source.search(at + 1, &key).map_err(failed())?
        {
            extent.damages.push(Damage {
                offset: at,
                bytes: next - at,
            });
            at = next;
            record = Some(later);
        }
        let Some(record) = record else {
            extent.tail_bytes = length.saturating_sub(extent.end);
            return Ok(extent);
        };
        let place = NonZeroU64::new(at)
            .filter(|_| record.block < manifest.blocks() && owns(shard, record.block))
            .filter(|_| manifest.block_len(record.block) == record.cases as usize);
        let Some(place) = place else {
            // Its CRC is right: another version of this program wrote it.
            let message = format!("has a record at byte {at} that is not of this study");
            return Err(StudyError::file(path, message));
        };
        let bytes = RECORD_HEADER as u64 + u64::from(record.length);
        found(FoundBlock {
            block: record.block,
            place,
            bytes,
        });
        at += bytes;
        extent.end = at;
    }
}

fn check_header(source: &mut Source, key: &Key, path: &Path) -> Result<HeaderState, StudyError> {
    let expected = key.header();
    let mut bytes = vec![
        0;
        expected
            .len()
            .min(usize::try_from(source.length).unwrap_or(usize::MAX))
    ];
    source
        .read(0, &mut bytes)
        .map_err(StudyError::io("read", path))?;
    if bytes == expected {
        return Ok(HeaderState::Whole);
    }
    let fixed = MAGIC.len() + 8;
    if expected.starts_with(&bytes) {
        return Ok(HeaderState::CutOff);
    }
    // Another whole header is another study's; anything else is damage.
    if bytes.starts_with(&MAGIC) && bytes.len() >= fixed {
        let u32_at =
            |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
        let (version, length) = (u32_at(MAGIC.len()), u64::from(u32_at(MAGIC.len() + 4)));
        let whole = fixed as u64 + length + 4;
        if whole <= source.length.min(1 << 16) {
            let mut bytes = vec![0; usize::try_from(whole).expect("less than 2^16")];
            source
                .read(0, &mut bytes)
                .map_err(StudyError::io("read", path))?;
            let (content, crc) = bytes.split_at(bytes.len() - 4);
            if crc32fast::hash(content).to_le_bytes() == crc {
                let message = if version == SCHEMA_VERSION {
                    let key = String::from_utf8_lossy(&content[fixed..]);
                    let id = key.lines().next().unwrap_or_default();
                    format!("is the journal of another study ({id}) or shard")
                } else {
                    format!("has schema version {version}; this program reads {SCHEMA_VERSION}")
                };
                return Err(StudyError::file(path, message));
            }
        }
    }
    Ok(HeaderState::Damaged)
}

/// A journal being read.
#[derive(Debug)]
struct Source {
    file: BufReader<File>,
    length: u64,
    position: u64,
    payload: Vec<u8>,
}

impl Source {
    fn new(file: File, length: u64) -> Self {
        Self {
            file: BufReader::with_capacity(1 << 16, file),
            length,
            position: 0,
            payload: Vec::new(),
        }
    }

    /// Reads bytes that are there.
    fn read(&mut self, at: u64, bytes: &mut [u8]) -> io::Result<()> {
        let step = i64::try_from(at).and_then(|at| Ok(at - i64::try_from(self.position)?));
        self.file.seek_relative(step.map_err(io::Error::other)?)?;
        self.file.read_exact(bytes)?;
        self.position = at + bytes.len() as u64;
        Ok(())
    }

    /// The record at an offset, if there is a whole and sound one; its payload is kept until the next is read.
    fn record(&mut self, at: u64, key: &Key) -> io::Result<Option<Record>> {
        let mut header = [0; RECORD_HEADER];
        let Some(left) = self.length.checked_sub(at + RECORD_HEADER as u64) else {
            return Ok(None);
        };
        self.read(at, &mut header)?;
        let Some(record) = Record::parse(&header, key) else {
            return Ok(None);
        };
        if u64::from(record.length) > left {
            return Ok(None);
        }
        let mut payload = std::mem::take(&mut self.payload);
        payload.resize(record.length as usize, 0);
        self.read(at + RECORD_HEADER as u64, &mut payload)?;
        let sound = crc32fast::hash(&payload) == record.crc;
        self.payload = payload;
        Ok(sound.then_some(record))
    }

    /// The next sound record from an offset on.
    fn search(&mut self, from: u64, key: &Key) -> io::Result<Option<(u64, Record)>> {
        const CHUNK: usize = 1 << 16;
        let mut chunk = vec![0; CHUNK];
        let mut at = from;
        while at + (RECORD_HEADER as u64) <= self.length {
            let left = usize::try_from(self.length - at).unwrap_or(usize::MAX);
            let chunk = &mut chunk[..left.min(CHUNK)];
            self.read(at, chunk)?;
            for start in 0..=chunk.len() - MARK.len() {
                if chunk[start..].starts_with(&MARK) {
                    let candidate = at + start as u64;
                    if let Some(record) = self.record(candidate, key)? {
                        return Ok(Some((candidate, record)));
                    }
                }
            }
            // A mark may lie across the end of the chunk.
            at += (chunk.len() - MARK.len() + 1) as u64;
        }
        Ok(None)
    }
}

/// A journal that was looked through.
#[derive(Debug)]
pub(crate) struct CheckedJournal {
    pub(crate) folder: PathBuf,
    /// Which part of the study it is of.
    pub(crate) shard: Option<Shard>,
    /// Its length then. `None`: this process holds the lock, and no other can have changed it.
    pub(crate) length: Option<u64>,
}

/// Reads blocks at known places.
#[derive(Debug)]
pub(crate) struct BlockReader {
    path: PathBuf,
    source: Source,
    key: Key,
}

impl BlockReader {
    /// # Errors
    /// [`StudyError::Locked`], [`StudyError::Changed`] if somebody writes to it, or has since it was looked
    /// through.
    pub(crate) fn open(journal: &CheckedJournal, manifest: &Manifest) -> Result<Self, StudyError> {
        let path = journal.folder.join(JOURNAL_FILE);
        let file = File::open(&path).map_err(StudyError::io("open", &path))?;
        if journal.length.is_some() {
            lock_to_read(&file, &journal.folder)?;
        }
        let now = file.metadata().map_err(StudyError::io("read", &path))?;
        let now = now.len();
        if let Some(length) = journal.length.filter(|length| *length != now) {
            let change = format!("has grown from {length} to {now} bytes");
            return Err(StudyError::Changed { path, change });
        }
        Ok(Self {
            source: Source::new(file, now),
            path,
            key: Key::of(manifest, journal.shard),
        })
    }

    /// The block whose record is at an offset that a scan has found.
    pub(crate) fn read(
        &mut self,
        place: NonZeroU64,
        manifest: &Manifest,
    ) -> Result<Columns, StudyError> {
        let record = self.source.record(place.get(), &self.key);
        record
            .map_err(StudyError::io("read", &self.path))?
            .and_then(|record| {
                codec::unpack(
                    &self.source.payload,
                    record.raw_length as usize,
                    record.cases as usize,
                    &manifest.factors,
                    manifest.columns.len(),
                )
            })
            .ok_or_else(|| StudyError::Changed {
                path: self.path.clone(),
                change: format!("has changed at byte {place}"),
            })
    }
}

/// Keeps writers out of a folder for as long as its journal is open.
///
/// # Errors
/// [`StudyError::Locked`] if one is in it.
pub(crate) fn lock_to_read(journal: &File, folder: &Path) -> Result<(), StudyError> {
    match journal.try_lock_shared() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(StudyError::Locked {
            folder: folder.to_owned(),
        }),
        Err(TryLockError::Error(error)) => {
            Err(StudyError::io(LOCK, &folder.join(JOURNAL_FILE))(error))
        }
    }
}

/// Most journals that are open at a time: a process may well have 256 files.
const OPEN_JOURNALS: usize = 96;

/// Reads blocks of many journals, of which the last used ones stay open.
pub(crate) struct Readers<'a> {
    journals: &'a [CheckedJournal],
    manifest: &'a Manifest,
    /// The last used one at the end.
    open: Vec<(usize, BlockReader)>,
    most: usize,
}

impl<'a> Readers<'a> {
    /// One of so many that read at the same time.
    pub(crate) fn new(
        journals: &'a [CheckedJournal],
        manifest: &'a Manifest,
        threads: usize,
    ) -> Self {
        Self {
            journals,
            manifest,
            open: Vec::new(),
            most: (OPEN_JOURNALS / threads.max(1)).max(1),
        }
    }

    /// A block whose journal and place a scan has found.
    pub(crate) fn read(
        &mut self,
        journal: usize,
        place: NonZeroU64,
    ) -> Result<Columns, StudyError> {
        let known = self.open.iter().position(|(index, _)| *index == journal);
        let reader = if let Some(at) = known {
            self.open.remove(at)
        } else {
            if self.open.len() == self.most {
                self.open.remove(0);
            }
            let reader = BlockReader::open(&self.journals[journal], self.manifest)?;
            (journal, reader)
        };
        self.open.push(reader);
        let (_, reader) = self.open.last_mut().expect("it was just put there");
        reader.read(place, self.manifest)
    }
}

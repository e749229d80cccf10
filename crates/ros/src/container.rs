//! MCAP files.

use std::collections::BTreeMap;
use std::io::{self, Cursor, Read, Seek, SeekFrom, Take};

use mcap::io::MessageReader;
use mcap::records::{MessageHeader, Metadata};
use mcap::sans_io::LinearReaderOptions;
use mcap::{Compression, WriteOptions, Writer};

use crate::message::Message;

/// First bytes of an MCAP file.
const MAGIC: &[u8] = &[0x89, b'M', b'C', b'A', b'P'];

/// Whether bytes begin as an MCAP file does.
pub fn is_mcap(mut input: impl Read) -> bool {
    let mut first = [0; MAGIC.len()];
    input.read_exact(&mut first).is_ok() && first == MAGIC
}

/// A message as it stands in a file.
#[derive(Debug, Clone)]
pub struct Logged(mcap::Message<'static>);

impl Logged {
    /// Topic, e.g. `/joint_states`.
    pub fn topic(&self) -> &str {
        &self.0.channel.topic
    }

    /// Type, e.g. `sensor_msgs/msg/JointState`; none where the file does not say.
    pub fn message_type(&self) -> Option<&str> {
        self.0
            .channel
            .schema
            .as_ref()
            .map(|each| each.name.as_str())
    }

    /// `cdr`, `json` or another one.
    pub fn encoding(&self) -> &str {
        &self.0.channel.message_encoding
    }

    /// When it was logged, ns.
    pub fn log_time_ns(&self) -> u64 {
        self.0.log_time
    }

    /// Its bytes.
    pub fn data(&self) -> &[u8] {
        &self.0.data
    }
}

/// Why reading a file fails.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It does not follow the format, or a checksum does not fit.
    #[error(transparent)]
    Mcap(#[from] mcap::McapError),
    /// It does not hold as many bytes as it says.
    #[error(
        "the {what} at byte {at} states a length of {stated} bytes; at most {most} are possible"
    )]
    Length {
        /// What it is of.
        what: &'static str,
        /// Where it begins.
        at: u64,
        /// What its head says.
        stated: u64,
        /// What the file has, or what that many compressed bytes can hold.
        most: u64,
    },
    /// The file itself.
    #[error(transparent)]
    File(#[from] io::Error),
}

/// Messages of a file in its order, until it breaks off. No more is held in memory than the file's largest record or
/// what its largest chunk unpacks to, 1 GiB at most.
///
/// # Errors
/// What cannot be read or sought in `input`.
pub fn messages(
    mut input: impl Read + Seek,
) -> io::Result<impl Iterator<Item = Result<Logged, ReadError>>> {
    let good = Lengths::of(&mut input)?;
    input.seek(SeekFrom::Start(0))?;
    let most = good.largest.try_into().unwrap_or(usize::MAX);
    // A record's own head comes on top.
    let options = LinearReaderOptions::default().with_record_length_limit(most);
    Ok(Messages {
        reader: MessageReader::new_with_options(input.take(good.until), options),
        broken: good.broken,
    })
}

struct Messages<R> {
    reader: MessageReader<Take<R>>,
    broken: Option<ReadError>,
}

impl<R: Read> Iterator for Messages<R> {
    type Item = Result<Logged, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        match (self.reader.next()?, self.broken.take()) {
            (Ok(message), broken) => {
                self.broken = broken;
                Some(Ok(Logged(message)))
            }
            // Where it ends for the reader is where it was cut.
            (Err(mcap::McapError::UnexpectedEof), Some(broken)) => Some(Err(broken)),
            (Err(error), _) => Some(Err(error.into())),
        }
    }
}

/// Bytes that a chunk may unpack to: a thousand times what writers put into one.
pub const MOST_UNPACKED: u64 = 1 << 30;

/// What a byte can unpack to: a block of zstd is 128 KiB at most, and four bytes at least.
const MOST_PER_BYTE: u64 = 1 << 15;

/// First byte of a chunk's record.
const CHUNK: u8 = 0x06;

/// First byte of the last record.
const FOOTER: u8 = 0x02;

/// A record's first byte and its length.
const HEAD: u64 = 9;

/// How far the lengths that stand in a file fit it: the format's reader makes room for whatever it is told.
struct Lengths {
    /// All records before this byte are whole.
    until: u64,
    /// Bytes of the largest record, or of what the largest chunk unpacks to.
    largest: u64,
    /// What is wrong there.
    broken: Option<ReadError>,
}

impl Lengths {
    /// Of a file; <https://mcap.dev/spec> has the layout.
    fn of(input: &mut (impl Read + Seek)) -> io::Result<Self> {
        let end = input.seek(SeekFrom::End(0))?;
        let mut found = Self {
            until: end,
            largest: 0,
            broken: None,
        };
        // The magic bytes, which the reader looks at.
        let mut at: u64 = 8;
        while at.saturating_add(HEAD) <= end {
            input.seek(SeekFrom::Start(at))?;
            let (kind, stated) = record(input)?;
            let there = stated.min(end - at - HEAD);
            found.largest = found.largest.max(there);
            if kind == CHUNK && !found.chunk(input, at, stated, there)? {
                break;
            }
            if stated > there {
                // Of a chunk, what is there is read.
                let until = if kind == CHUNK { end } else { at };
                found.breaks_off(until, at, "record", stated, there);
                break;
            }
            at += HEAD + stated;
            if kind == FOOTER {
                break;
            }
        }
        Ok(found)
    }

    fn breaks_off(&mut self, until: u64, at: u64, what: &'static str, stated: u64, most: u64) {
        self.until = until;
        self.broken = Some(ReadError::Length {
            what,
            at,
            stated,
            most,
        });
    }

    /// Looks into a chunk, and at its records where they are not compressed; false where they do not fit it. Of its
    /// `length` `there` bytes are in the file.
    fn chunk(
        &mut self,
        input: &mut (impl Read + Seek),
        at: u64,
        length: u64,
        there: u64,
    ) -> io::Result<bool> {
        // Two times, size, checksum, name of the compression, compressed size.
        const LEAST: u64 = 40;
        if there < LEAST {
            self.breaks_off(at, at, "chunk", LEAST, there);
            return Ok(false);
        }
        let mut head = [0; 32];
        input.read_exact(&mut head)?;
        let unpacked = u64::from_le_bytes(head[16..24].try_into().expect("eight bytes"));
        let name = u32::from_le_bytes(head[28..].try_into().expect("four bytes"));
        let name = u64::from(name);
        if name > there - LEAST {
            self.breaks_off(at, at, "compression's name", name, there - LEAST);
            return Ok(false);
        }
        input.seek(SeekFrom::Start(at + HEAD + 32 + name))?;
        let mut size = [0; 8];
        input.read_exact(&mut size)?;
        let packed = u64::from_le_bytes(size);
        if packed > length - LEAST - name {
            self.breaks_off(
                at,
                at,
                "content of the chunk",
                packed,
                length - LEAST - name,
            );
            return Ok(false);
        }
        let compressed = name > 0;
        let packed_there = packed.min(there - LEAST - name);
        let can_be = |bytes: u64| {
            if compressed {
                bytes.saturating_mul(MOST_PER_BYTE).min(MOST_UNPACKED)
            } else {
                bytes
            }
        };
        if unpacked > can_be(packed) {
            self.breaks_off(at, at, "unpacked chunk", unpacked, can_be(packed));
            return Ok(false);
        }
        self.largest = self.largest.max(unpacked.min(can_be(packed_there)));
        if compressed {
            return Ok(true);
        }
        let mut inner = at + HEAD + LEAST + name;
        let (end, end_there) = (inner + packed, inner + packed_there);
        while inner + HEAD <= end_there {
            input.seek(SeekFrom::Start(inner))?;
            let (_, stated) = record(input)?;
            if stated > end - inner - HEAD {
                self.breaks_off(inner, inner, "record", stated, end - inner - HEAD);
                return Ok(false);
            }
            inner += HEAD + stated;
        }
        if inner < end && end == end_there {
            self.breaks_off(inner, inner, "record", HEAD, end - inner);
            return Ok(false);
        }
        Ok(true)
    }
}

/// A record's kind and length.
fn record(input: &mut impl Read) -> io::Result<(u8, u64)> {
    let mut head = [0; 9];
    input.read_exact(&mut head)?;
    let [kind, length @ ..] = head;
    Ok((kind, u64::from_le_bytes(length)))
}

/// Why a file cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("cannot create the MCAP file: {0}")]
pub struct WriteError(#[from] mcap::McapError);

/// Quality of service of topics whose last message is for whoever comes later, as `rosbag2` keeps it with a channel:
/// reliable, transient local, one message. `RViz` asks for it.
const LATCHED: &str = "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n  liveliness: 1\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  avoid_ros_namespace_conventions: false\n";

/// Makes an MCAP file of ROS 2 messages (profile `ros2`): the same bytes of the same messages.
pub struct McapWriter {
    writer: Writer<Cursor<Vec<u8>>>,
    /// Channels and how many messages each has, by topic.
    channels: BTreeMap<String, (u16, u32)>,
}

impl std::fmt::Debug for McapWriter {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let topics = self.channels.keys();
        out.debug_list().entries(topics).finish()
    }
}

impl McapWriter {
    /// An empty file; `library` names the program that makes it.
    ///
    /// # Errors
    /// [`WriteError`]: memory has none.
    pub fn new(library: &str) -> Result<Self, WriteError> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(library)
            // At a fixed level in this thread, so that bytes depend on no machine.
            .compression(Some(Compression::Zstd))
            .compression_level(3)
            .compression_threads(0);
        Ok(Self {
            writer: options.create(Cursor::new(Vec::new()))?,
            channels: BTreeMap::new(),
        })
    }

    /// Adds a record of names and values.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn metadata(
        &mut self,
        name: &str,
        values: BTreeMap<String, String>,
    ) -> Result<(), WriteError> {
        let record = Metadata {
            name: name.to_owned(),
            metadata: values,
        };
        Ok(self.writer.write_metadata(&record)?)
    }

    /// Adds a message; logged and published at the same time. All of a topic are of one type.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write<M: Message>(
        &mut self,
        topic: &str,
        time_ns: u64,
        message: &M,
    ) -> Result<(), WriteError> {
        self.put(topic, time_ns, message, false)
    }

    /// Adds a message that whoever subscribes later is given too: what is fixed.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write_latched<M: Message>(
        &mut self,
        topic: &str,
        time_ns: u64,
        message: &M,
    ) -> Result<(), WriteError> {
        self.put(topic, time_ns, message, true)
    }

    fn put<M: Message>(
        &mut self,
        topic: &str,
        time_ns: u64,
        message: &M,
        latched: bool,
    ) -> Result<(), WriteError> {
        let (channel_id, sequence) = if let Some((id, count)) = self.channels.get_mut(topic) {
            *count += 1;
            (*id, *count)
        } else {
            let definition = M::definition();
            let schema = self
                .writer
                .add_schema(M::TYPE, "ros2msg", definition.as_bytes())?;
            let mut metadata = BTreeMap::new();
            if latched {
                metadata.insert("offered_qos_profiles".to_owned(), LATCHED.to_owned());
            }
            let id = self.writer.add_channel(schema, topic, "cdr", &metadata)?;
            self.channels.insert(topic.to_owned(), (id, 0));
            (id, 0)
        };
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        Ok(self
            .writer
            .write_to_known_channel(&header, &message.to_cdr())?)
    }

    /// The file.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn finish(mut self) -> Result<Vec<u8>, WriteError> {
        self.writer.finish()?;
        Ok(self.writer.into_inner().into_inner())
    }
}

//! Logs: MCAP files, whatever wrote them, to the nouns of `tilefold_schemas::log`.
//!
//! [`LogIndex::open`] says what is in a file from its summary alone. [`LogReader::read`] hands out
//! the messages of the wanted topics and times, one chunk in memory at a time. Everything here is
//! untrusted: lengths are held against the file and the limits before memory is taken, a chunk is
//! held against its checksum before a message leaves it, and a number that cannot be true never
//! becomes a noun. What was lost comes back as a list of set-asides, not as a log line.
//!
//! The siblings, in the way of the data: `file` reads ranges, `record` splits bytes into records,
//! `summary` and `scan` find the sections of a log (by its index; by walking it), `index` joins
//! them, `chunk` opens a section, `reader` joins the rest, `decode` chooses between the dialects
//! (`ros2` on the cursor of `cdr`; `protobuf`, `scene` and `annotations` within the bounds of
//! `wire`), and `sound` keeps out what cannot be true.

mod annotations;
mod cdr;
mod chunk;
mod decode;
mod detection;
mod digest;
mod error;
mod file;
mod index;
mod losses;
mod protobuf;
mod reader;
mod record;
mod ros2;
mod scan;
mod scene;
mod section;
mod sound;
mod summary;
mod topic;
mod vehicles;
mod wire;

pub use cdr::Cdr;
pub use error::{DecodeError, LogError};
pub use index::{IndexOrigin, LogIndex, MetadataRecord};
pub use reader::{ALL_TIME, LogReader, ReadReport};
pub use topic::{Topic, TopicKind};

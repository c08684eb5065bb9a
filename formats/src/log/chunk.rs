//! One chunk: read, held against its header, its limits and its checksum, then handed out.
//!
//! The record is given to `LinearReader` alone and cut to its stated size, so that no length in it
//! can reach past it; the reader computes the CRC-32 of all records before it hands out the first.
//! The index's reader would not check it at all.

use mcap::McapError;
use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use tilefold_schemas::limits::{MAX_CHUNK_EXPANSION, MAX_LOG_RECORD_BYTES};

use super::error::LogError;
use super::file::RangedFile;
use super::record::{RECORD_HEAD, split_head};

/// Bytes of a chunk record before the name of its compression.
const HEADER_TO_COMPRESSION: usize = RECORD_HEAD + 32;

/// A chunk's outcome: everything handed out, or why not.
pub(crate) type ChunkOutcome = Result<(), String>;

/// Hands opcode and body of every record in the chunk at `offset` to `on_record`.
///
/// `length` is that of the whole chunk record. Nothing is handed out of a chunk whose checksum is
/// wrong; of one without a checksum, what comes before the damage.
pub(crate) fn for_each_record(
    file: &mut RangedFile,
    offset: u64,
    length: u64,
    on_record: impl FnMut(u8, &[u8]),
) -> Result<ChunkOutcome, LogError> {
    if length > MAX_LOG_RECORD_BYTES as u64 {
        return Ok(Err(format!(
            "chunk of {length} bytes, the limit is {MAX_LOG_RECORD_BYTES}"
        )));
    }
    let Some(mut bytes) = file.read_range(offset, length)? else {
        let left = file.left(offset);
        return Ok(Err(format!(
            "chunk of {length} bytes, the file has {left} left"
        )));
    };
    Ok(cut_to_size(&mut bytes).and_then(|uncompressed| walk(&bytes, uncompressed, on_record)))
}

/// Checks the chunk's header, drops padding after its data, and gives its uncompressed size.
fn cut_to_size(bytes: &mut Vec<u8>) -> Result<usize, String> {
    let short = || "chunk is shorter than its header".to_owned();
    let (head, _) = bytes.split_first_chunk::<RECORD_HEAD>().ok_or_else(short)?;
    let (opcode, body) = split_head(head);
    if opcode != op::CHUNK || body != (bytes.len() - RECORD_HEAD) as u64 {
        return Err(format!(
            "expected a chunk of {} bytes, got opcode {opcode:#04x} and {body} bytes",
            bytes.len() - RECORD_HEAD
        ));
    }
    let uncompressed = u64_at(bytes, RECORD_HEAD + 16).ok_or_else(short)?;
    let name_length = u32_at(bytes, HEADER_TO_COMPRESSION - 4).ok_or_else(short)? as usize;
    let size_at = HEADER_TO_COMPRESSION.saturating_add(name_length);
    let compressed = u64_at(bytes, size_at).ok_or_else(short)?;
    let data_at = size_at + 8;
    if compressed > (bytes.len() - data_at) as u64 {
        return Err(format!(
            "chunk says {compressed} compressed bytes, it has {}",
            bytes.len() - data_at
        ));
    }
    let expanded = check_expansion(name_length == 0, compressed, uncompressed)?;
    bytes.truncate(data_at + compressed as usize);
    let body = (bytes.len() - RECORD_HEAD) as u64;
    bytes[1..RECORD_HEAD].copy_from_slice(&body.to_le_bytes());
    Ok(expanded)
}

/// Whether `uncompressed` bytes can honestly come out of `compressed` ones.
fn check_expansion(is_stored: bool, compressed: u64, uncompressed: u64) -> Result<usize, String> {
    if is_stored && compressed != uncompressed {
        return Err(format!(
            "uncompressed chunk of {compressed} bytes says {uncompressed}"
        ));
    }
    let possible = compressed
        .saturating_mul(MAX_CHUNK_EXPANSION)
        .min(MAX_LOG_RECORD_BYTES as u64);
    if uncompressed > possible {
        return Err(format!(
            "chunk of {compressed} bytes says that it expands to {uncompressed}, the limit is {possible}"
        ));
    }
    usize::try_from(uncompressed).map_err(|error| error.to_string())
}

/// Hands out the records of one whole chunk record.
fn walk(bytes: &[u8], uncompressed: usize, mut on_record: impl FnMut(u8, &[u8])) -> ChunkOutcome {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(uncompressed.max(bytes.len()));
    let mut reader = LinearReader::new_with_options(options);
    let mut rest = bytes;
    while let Some(event) = reader.next_event() {
        match event.map_err(explain)? {
            LinearReadEvent::Record { opcode, data } => on_record(opcode, data),
            LinearReadEvent::ReadRequest(_) => {
                reader.insert(rest.len()).copy_from_slice(rest);
                reader.notify_read(rest.len());
                rest = &[];
            }
        }
    }
    Ok(())
}

/// The library's error in the words of a set-aside.
fn explain(error: McapError) -> String {
    match error {
        McapError::BadChunkCrc { saved, calculated } => {
            format!("chunk checksum is {calculated:08x}, the file says {saved:08x}")
        }
        McapError::UnexpectedEof | McapError::UnexpectedEoc => {
            "chunk ends in the middle of a record".to_owned()
        }
        other => format!("chunk cannot be read: {other}"),
    }
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    let bytes = bytes.get(at..)?.first_chunk::<8>()?;
    Some(u64::from_le_bytes(*bytes))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let bytes = bytes.get(at..)?.first_chunk::<4>()?;
    Some(u32::from_le_bytes(*bytes))
}

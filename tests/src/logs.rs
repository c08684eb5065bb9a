//! Logs in other clothes: the same messages in other chunks and compressions, or some of them.
//!
//! They are read and written by the `mcap` library alone, not by our reader.

#![allow(clippy::unwrap_used)] // A fixture that cannot be made ends its test.

use std::fs;
use std::io::Cursor;
use std::ops::Range;
use std::path::{Path, PathBuf};

use mcap::{Compression, Message, MessageStream, Summary, WriteOptions, Writer};

/// The chunks of a sound log: where they lie in the file, in order.
///
/// # Panics
/// The log is not sound.
#[must_use]
pub fn chunk_places(log: &[u8]) -> Vec<Range<usize>> {
    let mut places: Vec<Range<usize>> = summary(log)
        .chunk_indexes
        .iter()
        .map(|chunk| {
            let from = chunk.chunk_start_offset as usize;
            from..from + chunk.chunk_length as usize
        })
        .collect();
    places.sort_by_key(|place| place.start);
    places
}

/// The messages of a sound log that `keep` accepts, with all metadata, written anew.
///
/// # Panics
/// The log is not sound.
#[must_use]
pub fn rewrite(
    log: &[u8],
    options: WriteOptions,
    mut keep: impl FnMut(&Message<'_>) -> bool,
) -> Vec<u8> {
    let messages = MessageStream::new(log).unwrap().map(Result::unwrap);
    write(log, options, messages.filter(|message| keep(message)))
}

/// The messages of the chunks (by number) that `keep` accepts, with all metadata, written anew.
///
/// # Panics
/// The log is not sound.
#[must_use]
pub fn only_chunks(log: &[u8], mut keep: impl FnMut(usize) -> bool) -> Vec<u8> {
    let summary = summary(log);
    let mut chunks: Vec<_> = summary.chunk_indexes.iter().collect();
    chunks.sort_by_key(|chunk| chunk.chunk_start_offset);
    let mut messages = Vec::new();
    for (number, chunk) in chunks.into_iter().enumerate() {
        if keep(number) {
            messages.extend(
                summary
                    .stream_chunk(log, chunk)
                    .unwrap()
                    .map(Result::unwrap),
            );
        }
    }
    write(log, small_chunks(), messages)
}

/// Options for chunks of a few seconds of a drive.
#[must_use]
pub fn small_chunks() -> WriteOptions {
    WriteOptions::new()
        .chunk_size(Some(20_000))
        .compression(Some(Compression::Zstd))
}

/// Copies of `logs` in the folder `into`: `change` makes the bytes of each, `name` its file name.
///
/// # Panics
/// A log cannot be read or written.
#[must_use]
pub fn copies(
    logs: &[PathBuf],
    into: &Path,
    name: impl Fn(usize) -> String,
    mut change: impl FnMut(Vec<u8>) -> Vec<u8>,
) -> Vec<PathBuf> {
    fs::create_dir_all(into).unwrap();
    let copy = |(index, log): (usize, &PathBuf)| {
        let path = into.join(name(index));
        fs::write(&path, change(fs::read(log).unwrap())).unwrap();
        path
    };
    logs.iter().enumerate().map(copy).collect()
}

fn summary(log: &[u8]) -> Summary {
    Summary::read(log).unwrap().unwrap()
}

fn write<'a>(
    log: &[u8],
    options: WriteOptions,
    messages: impl IntoIterator<Item = Message<'a>>,
) -> Vec<u8> {
    let mut writer: Writer<Cursor<Vec<u8>>> = options.create(Cursor::default()).unwrap();
    for place in &summary(log).metadata_indexes {
        let metadata = mcap::read::metadata(log, place).unwrap();
        writer.write_metadata(&metadata).unwrap();
    }
    for message in messages {
        writer.write(&message).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

//! A buffered reader that knows its line and column, and that ends a piece of XML which would take
//! more memory than a piece may take: the XML reader itself would collect a tag of gigabytes.

use std::io::{self, BufRead, Read};

use tilefold_schemas::limits::{MAX_MAP_BYTES, MAX_TAG_BYTES, MAX_XML_ATTRIBUTES};

/// Most bytes between `<` and `>`, or between two tags.
pub(super) const MAX_PIECE_BYTES: usize = MAX_XML_ATTRIBUTES * MAX_TAG_BYTES;
const BUFFER_BYTES: usize = 64 << 10;

/// A place in a text file, counted from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) line: u64,
    /// In characters.
    pub(super) column: u64,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

/// Which bound ended the reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Bound {
    Piece,
    File,
}

pub(super) struct Fence<R> {
    inner: R,
    buffer: Vec<u8>,
    /// The part of the buffer that was not consumed yet.
    start: usize,
    end: usize,
    place: Place,
    left_in_piece: usize,
    left_in_file: u64,
    hit: Option<Bound>,
}

impl<R: Read> Fence<R> {
    pub(super) fn new(inner: R) -> Self {
        Self {
            inner,
            buffer: vec![0; BUFFER_BYTES],
            start: 0,
            end: 0,
            place: Place { line: 1, column: 1 },
            left_in_piece: MAX_PIECE_BYTES,
            left_in_file: MAX_MAP_BYTES,
            hit: None,
        }
    }

    /// Begins the next piece and says where it stands.
    pub(super) fn next_piece(&mut self) -> Place {
        self.left_in_piece = MAX_PIECE_BYTES;
        self.place
    }

    /// Where reading has come to.
    pub(super) fn place(&self) -> Place {
        self.place
    }

    /// Which bound was hit, if one was.
    pub(super) fn hit(&self) -> Option<Bound> {
        self.hit
    }

    fn refill(&mut self) -> io::Result<()> {
        let wanted = usize::try_from(self.left_in_file).unwrap_or(usize::MAX);
        if wanted == 0 && self.inner.read(&mut [0])? > 0 {
            self.hit = Some(Bound::File);
            return Err(io::Error::other("the file is over its limit"));
        }
        let room = self.buffer.len().min(wanted);
        let read = loop {
            match self.inner.read(&mut self.buffer[..room]) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                other => break other?,
            }
        };
        self.left_in_file -= read as u64;
        (self.start, self.end) = (0, read);
        Ok(())
    }

    fn count(&mut self, from: usize, to: usize) {
        for byte in &self.buffer[from..to] {
            match byte {
                b'\n' => {
                    self.place.line += 1;
                    self.place.column = 1;
                }
                // The later bytes of a character.
                0x80..=0xbf => {}
                _ => self.place.column += 1,
            }
        }
    }
}

impl<R: Read> Read for Fence<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let ready = self.fill_buf()?;
        let taken = ready.len().min(into.len());
        into[..taken].copy_from_slice(&ready[..taken]);
        self.consume(taken);
        Ok(taken)
    }
}

impl<R: Read> BufRead for Fence<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.start == self.end {
            self.refill()?;
        }
        if self.start < self.end && self.left_in_piece == 0 {
            self.hit = Some(Bound::Piece);
            return Err(io::Error::other("a piece of XML is over its limit"));
        }
        let ready = (self.end - self.start).min(self.left_in_piece);
        Ok(&self.buffer[self.start..self.start + ready])
    }

    fn consume(&mut self, amount: usize) {
        let to = self.start.saturating_add(amount).min(self.end);
        self.count(self.start, to);
        self.left_in_piece = self.left_in_piece.saturating_sub(to - self.start);
        self.start = to;
    }
}

//! Ranged reads of one file that count what they read and never ask for more than there is.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::error::LogError;

/// An open file, its size and how much of it was read.
#[derive(Debug)]
pub(crate) struct RangedFile {
    file: File,
    path: PathBuf,
    size: u64,
    bytes_read: u64,
}

impl RangedFile {
    /// Opens `path`.
    pub(crate) fn open(path: &Path) -> Result<Self, LogError> {
        let failed = |source| LogError::Open {
            path: path.to_owned(),
            source,
        };
        let file = File::open(path).map_err(failed)?;
        let metadata = file.metadata().map_err(failed)?;
        if metadata.is_dir() {
            return Err(failed(std::io::ErrorKind::IsADirectory.into()));
        }
        Ok(Self {
            file,
            path: path.to_owned(),
            size: metadata.len(),
            bytes_read: 0,
        })
    }

    /// The file's path.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The file's path as text, for set-asides.
    pub(crate) fn name(&self) -> String {
        self.path.display().to_string()
    }

    /// The file's size when it was opened, in bytes.
    pub(crate) fn size(&self) -> u64 {
        self.size
    }

    /// Bytes read so far.
    pub(crate) fn bytes_read(&self) -> u64 {
        self.bytes_read
    }

    /// Bytes from `offset` to the end.
    pub(crate) fn left(&self, offset: u64) -> u64 {
        self.size.saturating_sub(offset)
    }

    /// Reads into `buffer` from `offset`; fewer bytes than it holds only at the file's end.
    pub(crate) fn read_some(&mut self, offset: u64, buffer: &mut [u8]) -> Result<usize, LogError> {
        let mut filled = 0;
        let read = self.file.seek(SeekFrom::Start(offset)).and_then(|_| {
            while filled < buffer.len() {
                match self.file.read(&mut buffer[filled..]) {
                    Ok(0) => break,
                    Ok(count) => filled += count,
                    Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                    Err(error) => return Err(error),
                }
            }
            Ok(())
        });
        self.bytes_read += filled as u64;
        read.map_err(|source| LogError::Read {
            path: self.path.clone(),
            offset,
            source,
        })?;
        Ok(filled)
    }

    /// Reads `length` bytes from `offset`; `None` if the file ends before.
    pub(crate) fn read_range(
        &mut self,
        offset: u64,
        length: u64,
    ) -> Result<Option<Vec<u8>>, LogError> {
        let Ok(wanted) = usize::try_from(length) else {
            return Ok(None);
        };
        if length > self.left(offset) {
            return Ok(None);
        }
        let mut buffer = vec![0; wanted];
        let filled = self.read_some(offset, &mut buffer)?;
        Ok((filled == wanted).then_some(buffer))
    }
}

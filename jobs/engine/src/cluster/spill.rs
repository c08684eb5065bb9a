//! Where parts wait for the reduce stage: in memory as long as there is room, on disk after that.
//!
//! Every group of tiles has one file, to which parts are added; what is spilled where is kept in
//! memory. Parts come back by task, whenever and wherever they were put.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use tempfile::TempDir;

use super::Part;
use crate::error::EngineError;

/// A group of tiles, and a task.
type Key = (u32, usize);

/// Parts of a job.
#[derive(Debug)]
pub(crate) struct Spill {
    room_bytes: u64,
    folder: TempDir,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    held: BTreeMap<Key, Part>,
    held_bytes: u64,
    files: BTreeMap<u32, File>,
    spilled: BTreeMap<Key, Place>,
    spilled_bytes: u64,
}

/// Where a part lies in its group's file, and how long its three streams are.
#[derive(Debug, Clone, Copy)]
struct Place {
    offset: u64,
    lengths: [usize; 3],
}

impl Spill {
    /// Room for this many bytes of parts in memory; the rest goes into a folder of its own in `folder`,
    /// which is deleted in the end.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub(crate) fn new(room_bytes: u64, folder: &Path) -> Result<Self, EngineError> {
        let made = tempfile::Builder::new()
            .prefix("tilefold-")
            .tempdir_in(folder);
        Ok(Self {
            room_bytes,
            folder: made.map_err(|source| refused(folder, source))?,
            state: Mutex::default(),
        })
    }

    /// Keeps the parts of a task, one for each group.
    ///
    /// # Errors
    /// The disk is full, or refuses.
    pub(crate) fn put(&self, task: usize, parts: Vec<Part>) -> Result<(), EngineError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        for (group, part) in (0..).zip(parts) {
            state.held_bytes += part.lengths().iter().sum::<usize>() as u64;
            state.held.insert((group, task), part);
        }
        if state.held_bytes > self.room_bytes {
            let written = state.write(self.folder.path());
            return written.map_err(|source| refused(self.folder.path(), source));
        }
        Ok(())
    }

    /// The parts of some tasks for a group.
    ///
    /// # Errors
    /// What was written cannot be read back.
    pub(crate) fn parts(
        &self,
        group: u32,
        tasks: &[usize],
    ) -> Result<Vec<(usize, Part)>, EngineError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let mut part = |&task: &usize| {
            let part = state.part((group, task));
            part.map(|part| (task, part))
        };
        let parts: std::io::Result<Vec<_>> = tasks.iter().map(&mut part).collect();
        parts.map_err(|source| refused(self.folder.path(), source))
    }

    /// How many bytes went to disk.
    pub(crate) fn spilled_bytes(&self) -> u64 {
        let state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.spilled_bytes
    }
}

impl State {
    fn write(&mut self, folder: &Path) -> std::io::Result<()> {
        for ((group, task), part) in std::mem::take(&mut self.held) {
            let file = match self.files.entry(group) {
                std::collections::btree_map::Entry::Occupied(entry) => entry.into_mut(),
                std::collections::btree_map::Entry::Vacant(entry) => {
                    let path = folder.join(format!("group-{group}"));
                    let mut options = File::options();
                    entry.insert(
                        options
                            .read(true)
                            .append(true)
                            .create_new(true)
                            .open(path)?,
                    )
                }
            };
            let offset = file.seek(SeekFrom::End(0))?;
            for stream in [&part.evidence, &part.sightings, &part.footprints] {
                file.write_all(stream)?;
            }
            let lengths = part.lengths();
            self.spilled
                .insert((group, task), Place { offset, lengths });
        }
        self.spilled_bytes += std::mem::take(&mut self.held_bytes);
        Ok(())
    }

    fn part(&mut self, key: Key) -> std::io::Result<Part> {
        if let Some(part) = self.held.get(&key) {
            return Ok(part.clone());
        }
        let (Some(place), Some(file)) = (self.spilled.get(&key), self.files.get_mut(&key.0)) else {
            return Ok(Part::default());
        };
        file.seek(SeekFrom::Start(place.offset))?;
        let mut stream = |length: usize| {
            let mut bytes = vec![0; length];
            file.read_exact(&mut bytes).map(|()| bytes)
        };
        let [evidence, sightings, footprints] = place.lengths;
        Ok(Part {
            evidence: stream(evidence)?,
            sightings: stream(sightings)?,
            footprints: stream(footprints)?,
        })
    }
}

impl Part {
    fn lengths(&self) -> [usize; 3] {
        [&self.evidence, &self.sightings, &self.footprints].map(Vec::len)
    }
}

fn refused(folder: &Path, source: std::io::Error) -> EngineError {
    EngineError::Spill {
        folder: folder.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(task: u8) -> Part {
        Part {
            evidence: vec![task; 100],
            sightings: vec![task; 10],
            footprints: vec![task; usize::from(task)],
        }
    }

    #[test]
    fn parts_come_back_as_they_were_put_wherever_they_waited() {
        for room_bytes in [0, 250, 100_000] {
            let spill = Spill::new(room_bytes, &std::env::temp_dir()).unwrap();
            for task in [2, 0, 1] {
                spill.put(task, vec![part(task as u8), part(7)]).unwrap();
            }
            let expected: Vec<_> = (0..3).map(|task| (task, part(task as u8))).collect();
            assert_eq!(spill.parts(0, &[0, 1, 2]).unwrap(), expected);
            assert_eq!(spill.parts(1, &[1]).unwrap(), [(1, part(7))]);
            assert_eq!(spill.spilled_bytes() > 0, room_bytes < 100_000);
        }
    }

    #[test]
    fn the_folder_is_gone_in_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let spill = Spill::new(0, folder.path()).unwrap();
        spill.put(0, vec![part(3)]).unwrap();
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
        drop(spill);
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    }
}

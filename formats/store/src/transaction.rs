//! A change of the store from one version to the next.
//!
//! Each call writes its data files at once and remembers which files the table is to have; nothing
//! of that is visible. [`Transaction::commit`] then moves the tables, `layers` last:
//!
//! ```text
//! data files -> tables (each relative to its latest version) -> layers = version + 1, with pins
//!   kill here: stray files          kill here: versions that nobody pins
//! ```
//! Two transactions with the same base meet at `layers`: its next version can be written once.

use std::collections::{BTreeMap, BTreeSet};

use arrow_array::{RecordBatch, UInt32Array};
use arrow_select::take::take_record_batch;
use rayon::prelude::*;
use tilefold_schemas::TileId;

use crate::commit_info::{self, JobInfo};
use crate::data_file::{self, DataFile};
use crate::delta::{Files, TableLog, files_digest};
use crate::error::StoreError;
use crate::layout::{Layout, StoredTable};
use crate::order;
use crate::properties::Parameters;
use crate::snapshot::{Snapshot, keep_tiles};
use crate::store::LAYERS;
use crate::version::Pin;

/// How often a commit to a table is tried when other writers move it meanwhile.
const ATTEMPTS: usize = 16;

/// A change under way. Dropping it changes nothing that a reader could see.
#[derive(Debug)]
pub struct Transaction {
    base: Snapshot,
    pub(crate) staged: BTreeMap<&'static str, Staged>,
}

/// A table that was touched: the files that it is to have.
#[derive(Debug, Clone)]
pub(crate) struct Staged {
    pub(crate) layout: Layout,
    pub(crate) files: Files,
}

/// What happens to the file of one coarse tile (or to one file of an untiled table).
struct Rewrite {
    old: Vec<DataFile>,
    new_rows: RecordBatch,
}

impl Transaction {
    pub(crate) fn new(base: Snapshot) -> Self {
        Self {
            base,
            staged: BTreeMap::new(),
        }
    }

    /// The version that this transaction is based on.
    #[must_use]
    pub fn base(&self) -> &Snapshot {
        &self.base
    }

    /// Replaces all rows of these tiles; a tile without new rows becomes empty.
    ///
    /// # Errors
    /// The table is not tiled, a row lies in another tile, an old file is damaged, or the storage
    /// refuses. The transaction is then as before.
    pub fn replace_tiles<R: StoredTable>(
        &mut self,
        tiles: &BTreeSet<TileId>,
        rows: Vec<R>,
    ) -> Result<(), StoreError> {
        let layout = Layout::of::<R>();
        let rows = R::to_batch(rows);
        let mut parts = split(&layout, &rows)?;
        let stray = parts
            .values()
            .flat_map(|part| &part.tiles)
            .find(|tile| !tiles.contains(tile));
        if let Some(stray) = stray {
            return Err(StoreError::StrayRow {
                table: layout.name.to_owned(),
                tile: stray.0,
                tiles: tiles.len(),
            });
        }
        for &tile in tiles {
            parts
                .entry(data_file::coarse(tile))
                .or_insert_with(|| Part::empty(&layout));
        }
        self.rewrite(&layout, parts, |tile| !tiles.contains(&tile))
    }

    /// Adds rows to a table. Rows that are there already are there twice then.
    ///
    /// # Errors
    /// An old file is damaged, or the storage refuses. The transaction is then as before.
    pub fn append<R: StoredTable>(&mut self, rows: Vec<R>) -> Result<(), StoreError> {
        if rows.is_empty() {
            return Ok(());
        }
        let layout = Layout::of::<R>();
        let rows = R::to_batch(rows);
        if layout.tiled {
            let parts = split(&layout, &rows)?;
            return self.rewrite(&layout, parts, |_| true);
        }
        self.append_file(&layout, rows)
    }

    /// Replaces all rows of a table.
    ///
    /// # Errors
    /// The storage refuses. The transaction is then as before.
    pub fn overwrite<R: StoredTable>(&mut self, rows: Vec<R>) -> Result<(), StoreError> {
        let before = self.stage(&Layout::of::<R>())?.clone();
        self.stage(&before.layout)?.files.clear();
        let done = self.append(rows);
        if done.is_err() {
            self.staged.insert(R::NAME, before);
        }
        done
    }

    /// The files that the table is to have, at first those of the base.
    pub(crate) fn stage(&mut self, layout: &Layout) -> Result<&mut Staged, StoreError> {
        if !self.staged.contains_key(layout.name) {
            let files = match self.base.table(layout.name)? {
                Some(table) => {
                    self.check_schema(layout, &table.schema())?;
                    table.files.clone()
                }
                None => Files::new(),
            };
            let layout = layout.clone();
            self.staged.insert(layout.name, Staged { layout, files });
        }
        Ok(self.staged.entry(layout.name).or_insert_with(|| Staged {
            layout: layout.clone(),
            files: Files::new(),
        }))
    }

    fn check_schema(
        &self,
        layout: &Layout,
        found: &arrow_schema::Schema,
    ) -> Result<(), StoreError> {
        let columns = |schema: &arrow_schema::Schema| -> Vec<String> {
            let describe = |field: &arrow_schema::FieldRef| {
                let null = if field.is_nullable() { " or null" } else { "" };
                format!("{}: {}{null}", field.name(), field.data_type())
            };
            schema.fields().iter().map(describe).collect()
        };
        let (found, wanted) = (columns(found), columns(&layout.stored_schema()));
        let reason = match wanted
            .iter()
            .zip(&found)
            .find(|(wanted, found)| wanted != found)
        {
            Some((wanted, found)) => format!("`{found}` instead of `{wanted}`"),
            None if wanted.len() == found.len() => return Ok(()),
            None => format!("{} columns instead of {}", found.len(), wanted.len()),
        };
        Err(StoreError::Schema {
            location: self.base.store().location(),
            table: layout.name.to_owned(),
            reason,
        })
    }

    /// Rewrites the files of the parts' coarse tiles: the old rows that pass `keep` and the new.
    fn rewrite(
        &mut self,
        layout: &Layout,
        parts: BTreeMap<TileId, Part>,
        keep: impl Fn(TileId) -> bool + Sync,
    ) -> Result<(), StoreError> {
        let staged = self.stage(layout)?;
        let mut by_coarse: BTreeMap<TileId, Vec<DataFile>> = BTreeMap::new();
        for file in staged.files.values() {
            if let Some(coarse) = file.coarse() {
                by_coarse.entry(coarse).or_default().push(file.clone());
            }
        }
        let rewrites: Vec<Rewrite> = parts
            .into_iter()
            .map(|(coarse, part)| Rewrite {
                old: by_coarse.remove(&coarse).unwrap_or_default(),
                new_rows: part.rows,
            })
            .collect();
        self.run(layout, rewrites, keep)
    }

    fn append_file(&mut self, layout: &Layout, rows: RecordBatch) -> Result<(), StoreError> {
        let new = self.encode(layout, &[], rows.clone(), |_| true)?;
        // Equal content has an equal name: the same rows once more go into one file with the first.
        let twin = new.and_then(|file| self.staged.get(layout.name)?.files.get(&file.name));
        let old = twin.cloned().into_iter().collect();
        let rewrite = Rewrite {
            old,
            new_rows: rows,
        };
        self.run(layout, vec![rewrite], |_| true)
    }

    fn run(
        &mut self,
        layout: &Layout,
        rewrites: Vec<Rewrite>,
        keep: impl Fn(TileId) -> bool + Sync,
    ) -> Result<(), StoreError> {
        self.stage(layout)?;
        let done = rewrites
            .into_par_iter()
            .map(|rewrite| {
                let new = self.encode(layout, &rewrite.old, rewrite.new_rows, &keep)?;
                Ok((rewrite.old, new))
            })
            .collect::<Result<Vec<_>, StoreError>>()?;
        let files = &mut self.stage(layout)?.files;
        for (old, new) in done {
            for file in old {
                files.remove(&file.name);
            }
            files.extend(new.map(|file| (file.name.clone(), file)));
        }
        Ok(())
    }

    /// Merges old files and new rows into one file and writes it; no rows, no file.
    fn encode(
        &self,
        layout: &Layout,
        old: &[DataFile],
        new_rows: RecordBatch,
        keep: impl Fn(TileId) -> bool,
    ) -> Result<Option<DataFile>, StoreError> {
        let mut batches = Vec::with_capacity(old.len() + 1);
        for file in old {
            let rows = self.base.read_data(layout, file)?;
            batches.push(match data_file::tiles(&rows) {
                Some(tiles) if layout.tiled => keep_tiles(&rows, tiles.values(), layout, &keep)?,
                _ => rows,
            });
        }
        batches.push(new_rows);
        let rows = order::sorted(layout, &batches)?;
        if rows.num_rows() == 0 {
            return Ok(None);
        }
        let (file, bytes) = data_file::encode(layout, &rows)?;
        if !old.contains(&file) {
            let path = format!("{}/{}", layout.name, file.name);
            self.base.store().place().write_file(&path, bytes)?;
        }
        Ok(Some(file))
    }

    /// Makes the changes the next version of the store and returns its number.
    ///
    /// A transaction that changes nothing commits nothing and returns the version it is based on.
    ///
    /// # Errors
    /// [`StoreError::Conflict`] where the store moved since this transaction began, and whatever
    /// the storage refuses. Readers then see the old version; the same job may be run again.
    pub fn commit(self, operation: &str, parameters: Parameters) -> Result<i64, StoreError> {
        if self.changed()?.is_empty() {
            return Ok(self.base.version());
        }
        self.refuse_if_moved()?;
        let pins = self.commit_tables()?;
        self.commit_layers(pins, operation, parameters)
    }

    /// The touched tables whose files differ from the base's.
    fn changed(&self) -> Result<Vec<&Staged>, StoreError> {
        let mut changed = Vec::new();
        for staged in self.staged.values() {
            let same = match self.base.table(staged.layout.name)? {
                Some(table) => table.files == staged.files,
                None => staged.files.is_empty(),
            };
            if !same {
                changed.push(staged);
            }
        }
        Ok(changed)
    }

    fn refuse_if_moved(&self) -> Result<(), StoreError> {
        let latest = self.base.store().latest_version()?;
        if latest == self.base.version() {
            Ok(())
        } else {
            Err(self.conflict(latest))
        }
    }

    fn conflict(&self, latest: i64) -> StoreError {
        StoreError::Conflict {
            location: self.base.store().location(),
            base: self.base.version(),
            latest,
        }
    }

    /// Commits all changed tables but `layers`; the pins of the version to come.
    pub(crate) fn commit_tables(&self) -> Result<BTreeMap<String, Pin>, StoreError> {
        let mut pins = self.base.info().pins.clone();
        for staged in self.changed()? {
            if staged.layout.name != LAYERS {
                let pin = self.commit_table(staged)?;
                pins.insert(staged.layout.name.to_owned(), pin);
            }
        }
        Ok(pins)
    }

    fn commit_table(&self, staged: &Staged) -> Result<Pin, StoreError> {
        let place = self.base.store().place();
        let name = staged.layout.name;
        let log = TableLog::open(place, name)?;
        if !self.base.info().pins.contains_key(name) && !log.exists()? {
            log.create(&staged.layout, Vec::new())?;
        }
        for _ in 0..ATTEMPTS {
            let latest = log.load(None)?;
            if latest.files == staged.files {
                // A killed job came as far as this with the same files.
                return Ok(latest.pin());
            }
            if let Some(version) = log.commit(&latest, &staged.files, Vec::new())? {
                return Ok(Pin {
                    version,
                    files: files_digest(&staged.files),
                });
            }
        }
        Err(StoreError::Busy {
            location: self.base.store().location(),
            table: name.to_owned(),
            attempts: ATTEMPTS,
        })
    }

    /// Commits `layers` as the version after the base: the point where the store moves.
    pub(crate) fn commit_layers(
        &self,
        mut pins: BTreeMap<String, Pin>,
        operation: &str,
        parameters: Parameters,
    ) -> Result<i64, StoreError> {
        let version = self.base.version() + 1;
        let base = self.base.table(LAYERS)?.ok_or_else(|| {
            StoreError::damaged(
                self.base.store().place().describe(LAYERS),
                "no version pins it",
            )
        })?;
        let wanted = self
            .staged
            .get(LAYERS)
            .map_or(&base.files, |staged| &staged.files);
        let pin = Pin {
            version,
            files: files_digest(wanted),
        };
        pins.insert(LAYERS.to_owned(), pin);
        let job = JobInfo {
            operation: operation.to_owned(),
            parameters,
            pins,
        };
        let metadata = vec![(
            commit_info::KEY.to_owned(),
            commit_info::seal(&job, version)?,
        )];
        let log = TableLog::open(self.base.store().place(), LAYERS)?;
        match log.commit(&base, wanted, metadata)? {
            Some(version) => Ok(version),
            None => Err(self.conflict(log.latest(self.base.version())?)),
        }
    }
}

/// New rows of one coarse tile.
struct Part {
    tiles: BTreeSet<TileId>,
    rows: RecordBatch,
}

impl Part {
    fn empty(layout: &Layout) -> Self {
        Self {
            tiles: BTreeSet::new(),
            rows: RecordBatch::new_empty(layout.schema.clone()),
        }
    }
}

/// The rows by coarse tile.
fn split(layout: &Layout, rows: &RecordBatch) -> Result<BTreeMap<TileId, Part>, StoreError> {
    let not_tiled = || StoreError::NotTiled {
        table: layout.name.to_owned(),
    };
    if !layout.tiled {
        return Err(not_tiled());
    }
    order::refuse_too_many(layout, rows)?;
    let tiles = data_file::tiles(rows).ok_or_else(not_tiled)?.values();
    let mut indices: BTreeMap<TileId, Vec<u32>> = BTreeMap::new();
    for (&tile, row) in tiles.iter().zip(0u32..) {
        indices
            .entry(data_file::coarse(TileId(tile)))
            .or_default()
            .push(row);
    }
    indices
        .into_iter()
        .map(|(coarse, indices)| {
            let indices = UInt32Array::from(indices);
            let tiles = indices
                .values()
                .iter()
                .map(|&row| TileId(tiles[row as usize]));
            let part = Part {
                tiles: tiles.collect(),
                rows: take_record_batch(rows, &indices)
                    .map_err(|error| StoreError::encode("split", layout.name, error))?,
            };
            Ok((coarse, part))
        })
        .collect()
}

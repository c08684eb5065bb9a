//! One version of the store, as a reader sees it.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use arrow_array::{BooleanArray, RecordBatch};
use arrow_select::filter::filter_record_batch;
use bytes::Bytes;
use rayon::prelude::*;
use tilefold_schemas::TileId;

use crate::data_file::{self, DataFile};
use crate::delta::{TableLog, TableState};
use crate::digest;
use crate::error::StoreError;
use crate::layout::{Layout, StoredTable};
use crate::order;
use crate::store::Store;
use crate::version::VersionInfo;

/// Which rows of a tiled table to read.
#[derive(Debug, Clone, Copy)]
pub enum TileFilter<'a> {
    /// All rows.
    All,
    /// The rows of these tiles.
    Tiles(&'a BTreeSet<TileId>),
}

impl TileFilter<'_> {
    fn may_match(self, file: &DataFile) -> bool {
        match (self, file.tiles) {
            (Self::Tiles(tiles), Some((first, last))) => tiles.range(first..=last).next().is_some(),
            _ => true,
        }
    }
}

/// One version of the store. Cheap to clone; clones share what they have read of the tables' logs.
#[derive(Clone)]
pub struct Snapshot {
    store: Store,
    info: Arc<VersionInfo>,
    tables: Arc<Mutex<BTreeMap<String, Arc<TableState>>>>,
}

impl fmt::Debug for Snapshot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "Snapshot({} of {})",
            self.version(),
            self.store.location()
        )
    }
}

impl Snapshot {
    pub(crate) fn new(store: Store, info: VersionInfo) -> Self {
        Self {
            store,
            info: Arc::new(info),
            tables: Arc::default(),
        }
    }

    /// Number of the version.
    #[must_use]
    pub fn version(&self) -> i64 {
        self.info.version
    }

    /// Who committed it, when, and what belongs to it.
    #[must_use]
    pub fn info(&self) -> &VersionInfo {
        &self.info
    }

    /// The store that this is a version of.
    #[must_use]
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// The rows of a table, in the order of its sort key.
    ///
    /// Only data files whose tiles intersect the filter are read.
    ///
    /// # Errors
    /// A file is damaged or missing, or a tile is asked of a table without tiles.
    pub fn read<R: StoredTable>(&self, filter: TileFilter<'_>) -> Result<Vec<R>, StoreError> {
        self.read_filtered(self.files::<R>(filter)?, filter)
    }

    /// The rows of some data files of a table ([`Snapshot::files`]), in the order of its sort key.
    ///
    /// # Errors
    /// A file is damaged or missing.
    pub fn read_files<R: StoredTable>(&self, files: Vec<DataFile>) -> Result<Vec<R>, StoreError> {
        self.read_filtered(files, TileFilter::All)
    }

    fn read_filtered<R: StoredTable>(
        &self,
        files: Vec<DataFile>,
        filter: TileFilter<'_>,
    ) -> Result<Vec<R>, StoreError> {
        let layout = Layout::of::<R>();
        let rows = groups(files)
            .par_iter()
            .map(|group| {
                let batch = filtered(&self.read_group(&layout, group)?, filter, &layout)?;
                R::from_batch(&batch).map_err(|source| self.wrong_column(&layout, group, source))
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(rows.into_iter().flatten().collect())
    }

    /// Arrow batches of a table, one a data file, read as they are asked for.
    ///
    /// Rows are in order within a batch; batches are in the order of their first tiles.
    ///
    /// # Errors
    /// As for [`Snapshot::read`]; damage shows when the file's turn comes.
    pub fn batches<R: StoredTable>(&self, filter: TileFilter<'_>) -> Result<Batches, StoreError> {
        let tiles = match filter {
            TileFilter::All => None,
            TileFilter::Tiles(tiles) => Some(tiles.clone()),
        };
        Ok(Batches {
            snapshot: self.clone(),
            layout: Layout::of::<R>(),
            files: self.files::<R>(filter)?.into_iter(),
            tiles,
        })
    }

    /// Hands over rows as [`Snapshot::read`] does, but some at a time: of a file that alone holds its
    /// tiles no more than a row group is decoded at once.
    ///
    /// # Errors
    /// As for [`Snapshot::read`]. Rows that came before the damage were handed over.
    pub fn each<R: StoredTable>(
        &self,
        filter: TileFilter<'_>,
        mut take: impl FnMut(Vec<R>),
    ) -> Result<(), StoreError> {
        let layout = Layout::of::<R>();
        for group in groups(self.files::<R>(filter)?) {
            let mut hand_over = |batch: &RecordBatch| {
                let batch = filtered(batch, filter, &layout)?;
                let rows = R::from_batch(&batch);
                take(rows.map_err(|source| self.wrong_column(&layout, &group, source))?);
                Ok(())
            };
            match group.as_slice() {
                [file] => {
                    let (place, bytes) = self.bytes(&layout, file)?;
                    data_file::decode_in_parts(&layout, file, &place, bytes, |rows| {
                        hand_over(&order::normal_form(&layout, &rows)?)
                    })?;
                }
                several => hand_over(&self.read_group(&layout, several)?)?,
            }
        }
        Ok(())
    }

    /// The data files of a table that may hold rows for the filter, in the order of their tiles.
    ///
    /// # Errors
    /// The table's log is damaged, or a tile is asked of a table without tiles.
    pub fn files<R: StoredTable>(
        &self,
        filter: TileFilter<'_>,
    ) -> Result<Vec<DataFile>, StoreError> {
        if let (TileFilter::Tiles(_), false) = (filter, R::tiled()) {
            return Err(StoreError::NotTiled {
                table: R::NAME.to_owned(),
            });
        }
        let Some(table) = self.table(R::NAME)? else {
            return Ok(Vec::new());
        };
        let mut files: Vec<DataFile> = table.files.values().cloned().collect();
        files.retain(|file| filter.may_match(file));
        files.sort_by(|a, b| (a.tiles, &a.name).cmp(&(b.tiles, &b.name)));
        Ok(files)
    }

    /// The rows of one data file, checked and decoded.
    ///
    /// # Errors
    /// The file is damaged or missing.
    pub fn read_file<R: StoredTable>(&self, file: &DataFile) -> Result<RecordBatch, StoreError> {
        self.read_data(&Layout::of::<R>(), file)
    }

    /// Number of rows in a table.
    ///
    /// # Errors
    /// The table's log is damaged.
    pub fn row_count<R: StoredTable>(&self) -> Result<i64, StoreError> {
        let files = self.files::<R>(TileFilter::All)?;
        Ok(files.iter().map(|file| file.rows).sum())
    }

    /// Digest of a table's rows: the same for the same rows, whatever files they lie in and
    /// however they got there. All data files are read and checked on the way.
    ///
    /// # Errors
    /// A file is damaged or missing.
    pub fn digest<R: StoredTable>(&self) -> Result<String, StoreError> {
        let layout = Layout::of::<R>();
        let mut digest = digest::empty(&layout);
        let groups = groups(self.files::<R>(TileFilter::All)?);
        // A few groups at a time are decoded beside each other; the hash needs them in order.
        for some in groups.chunks(2 * rayon::current_num_threads()) {
            let batches = some
                .par_iter()
                .map(|group| self.read_group(&layout, group))
                .collect::<Result<Vec<_>, _>>()?;
            for batch in batches {
                digest::add(&mut digest, &batch, &layout)?;
            }
        }
        Ok(digest.finish())
    }

    /// The state of a table at this version; nothing where the version does not know the table.
    pub(crate) fn table(&self, name: &str) -> Result<Option<Arc<TableState>>, StoreError> {
        let Some(pin) = self.info.pins.get(name) else {
            return Ok(None);
        };
        let mut tables = self.tables.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(table) = tables.get(name) {
            return Ok(Some(table.clone()));
        }
        let table = TableLog::open(self.store.place(), name)?.load(Some(pin.version))?;
        if &table.pin() != pin {
            let log = self.store.place().describe(&format!("{name}/_delta_log"));
            let reason = format!(
                "at version {} it does not name the data files that version {} of the store has",
                pin.version,
                self.version()
            );
            return Err(StoreError::damaged(log, reason));
        }
        let table = Arc::new(table);
        tables.insert(name.to_owned(), table.clone());
        Ok(Some(table))
    }

    /// Reads, checks and decodes one data file.
    pub(crate) fn read_data(
        &self,
        layout: &Layout,
        file: &DataFile,
    ) -> Result<RecordBatch, StoreError> {
        let (place, bytes) = self.bytes(layout, file)?;
        let rows = data_file::decode(layout, file, &place, bytes)?;
        order::normal_form(layout, &rows)
    }

    /// What a data file is called in errors, and its bytes.
    fn bytes(&self, layout: &Layout, file: &DataFile) -> Result<(String, Bytes), StoreError> {
        let path = format!("{}/{}", layout.name, file.name);
        let place = self.store.place();
        let described = place.describe(&path);
        match place.read_file(&path)? {
            Some(bytes) => Ok((described, bytes)),
            None => Err(StoreError::damaged(&described, "it is missing")),
        }
    }

    fn read_group(&self, layout: &Layout, group: &[DataFile]) -> Result<RecordBatch, StoreError> {
        let batches = group
            .iter()
            .map(|file| self.read_data(layout, file))
            .collect::<Result<Vec<_>, _>>()?;
        order::sorted(layout, &batches)
    }

    fn wrong_column(
        &self,
        layout: &Layout,
        group: &[DataFile],
        source: tilefold_schemas::column::ColumnError,
    ) -> StoreError {
        let name = group.first().map_or("", |file| file.name.as_str());
        StoreError::Column {
            file: self
                .store
                .place()
                .describe(&format!("{}/{name}", layout.name)),
            table: layout.name.to_owned(),
            source,
        }
    }
}

/// Files whose tiles do not overlap are in order one after the other; others must be merged.
fn groups(files: Vec<DataFile>) -> Vec<Vec<DataFile>> {
    let mut groups: Vec<Vec<DataFile>> = Vec::new();
    let mut reached: Option<TileId> = None;
    for file in files {
        let apart = match (file.tiles, reached) {
            (Some((first, _)), Some(reached)) => first > reached,
            (Some(_), None) => true,
            (None, _) => false,
        };
        reached = reached.max(file.tiles.map(|(_, last)| last));
        match groups.last_mut() {
            Some(group) if !apart => group.push(file),
            _ => groups.push(vec![file]),
        }
    }
    groups
}

/// The rows of a batch that lie in the wanted tiles.
fn filtered(
    rows: &RecordBatch,
    filter: TileFilter<'_>,
    layout: &Layout,
) -> Result<RecordBatch, StoreError> {
    let (TileFilter::Tiles(wanted), Some(tiles)) = (filter, data_file::tiles(rows)) else {
        return Ok(rows.clone());
    };
    keep_tiles(rows, tiles.values(), layout, |tile| wanted.contains(&tile))
}

/// The rows whose tiles pass `keep`.
pub(crate) fn keep_tiles(
    rows: &RecordBatch,
    tiles: &[i32],
    layout: &Layout,
    keep: impl Fn(TileId) -> bool,
) -> Result<RecordBatch, StoreError> {
    let mask: BooleanArray = tiles.iter().map(|&tile| Some(keep(TileId(tile)))).collect();
    filter_record_batch(rows, &mask).map_err(|e| StoreError::encode("filter", layout.name, e))
}

/// Batches of a table, one a data file; see [`Snapshot::batches`].
#[derive(Debug)]
pub struct Batches {
    snapshot: Snapshot,
    layout: Layout,
    files: std::vec::IntoIter<DataFile>,
    tiles: Option<BTreeSet<TileId>>,
}

impl Iterator for Batches {
    type Item = Result<RecordBatch, StoreError>;

    fn next(&mut self) -> Option<Self::Item> {
        let file = self.files.next()?;
        let filter = self
            .tiles
            .as_ref()
            .map_or(TileFilter::All, TileFilter::Tiles);
        let rows = self.snapshot.read_data(&self.layout, &file);
        Some(rows.and_then(|rows| filtered(&rows, filter, &self.layout)))
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        self.files.size_hint()
    }
}

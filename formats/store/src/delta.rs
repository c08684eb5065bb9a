//! One Delta Lake table: its state at a version, its creation, its commits.
//!
//! ```text
//! state at the latest version --(wanted files - live files)--> Add
//!                             --(live files - wanted files)--> Remove --> put-if-absent of N + 1
//! ```
//! A commit states the wanted set of files as a difference from the *latest* version. What a killed
//! job left there beyond the last pin is thereby taken back by the next commit.

use std::collections::{BTreeMap, HashMap};
use std::time::{SystemTime, UNIX_EPOCH};

use arrow_schema::Schema;
use bytes::Bytes;
use deltalake::DeltaTableError;
use deltalake::kernel::engine::arrow_conversion::TryIntoKernel;
use deltalake::kernel::transaction::{
    CommitBuilder, CommitConflictError, CommitProperties, TransactionError,
};
use deltalake::kernel::{Action, Add, Remove, StructType};
use deltalake::logstore::LogStoreRef;
use deltalake::operations::create::CreateBuilder;
use deltalake::protocol::{DeltaOperation, SaveMode};
use deltalake::table::state::DeltaTableState;
use serde_json::Value;

use crate::bbox::{BBOX, CORNERS};
use crate::data_file::{DataFile, STATISTICS};
use crate::error::StoreError;
use crate::layout::Layout;
use crate::location::Place;
use crate::version::Pin;

/// Old versions stay readable: only Tilefold itself may clean up.
const KEEP: &str = "interval 3650 days";

/// Commits between two checkpoints of a table's log.
const CHECKPOINT_INTERVAL: i64 = 100;

/// Data files by name.
pub(crate) type Files = BTreeMap<String, DataFile>;

/// What is written into `commitInfo` beside what Delta Lake says there.
pub(crate) type CommitMetadata = Vec<(String, Value)>;

/// A table at one version.
#[derive(Debug, Clone)]
pub(crate) struct TableState {
    pub(crate) files: Files,
    delta: DeltaTableState,
}

impl TableState {
    /// Delta version of the table.
    pub(crate) fn version(&self) -> i64 {
        to_i64(self.delta.version())
    }

    /// The table's columns, as its metadata names them.
    pub(crate) fn schema(&self) -> Schema {
        self.delta.snapshot().arrow_schema().as_ref().clone()
    }

    /// What a version of the store must remember of this state.
    pub(crate) fn pin(&self) -> Pin {
        Pin {
            version: self.version(),
            files: files_digest(&self.files),
        }
    }
}

/// Digest of a list of files: of what matters to a reader in a table's log.
pub(crate) fn files_digest(files: &Files) -> String {
    let mut hasher = blake3::Hasher::new();
    for file in files.values() {
        let (first, last) = file.tiles.unzip();
        let (first, last) = (first.map(|tile| tile.0), last.map(|tile| tile.0));
        let line = format!(
            "{} {} {} {first:?} {last:?}\n",
            file.name, file.size, file.rows
        );
        hasher.update(line.as_bytes());
    }
    hasher.finalize().to_hex().to_string()
}

/// A table's log, wherever it stands.
pub(crate) struct TableLog<'a> {
    place: &'a Place,
    name: &'a str,
    log: LogStoreRef,
}

impl<'a> TableLog<'a> {
    pub(crate) fn open(place: &'a Place, name: &'a str) -> Result<Self, StoreError> {
        let log = place.table(name)?;
        Ok(Self { place, name, log })
    }

    /// Whether there is a table.
    pub(crate) fn exists(&self) -> Result<bool, StoreError> {
        self.place.wait(async {
            let found = self.log.is_delta_table_location().await;
            found.map_err(|error| self.refused("look for", error))
        })
    }

    /// The latest Delta version, where at least `known` exists.
    pub(crate) fn latest(&self, known: i64) -> Result<i64, StoreError> {
        self.place.wait(async {
            let found = self.log.get_latest_version(to_u64(known)).await;
            found
                .map(to_i64)
                .map_err(|error| self.refused("find the latest version of", error))
        })
    }

    /// The bytes of one commit, where it exists.
    pub(crate) fn commit_entry(&self, version: i64) -> Result<Option<Bytes>, StoreError> {
        self.place.wait(async {
            let entry = self.log.read_commit_entry(to_u64(version)).await;
            entry.map_err(|error| self.refused("read a commit of", error))
        })
    }

    /// The table at `version`, or at its latest one.
    pub(crate) fn load(&self, version: Option<i64>) -> Result<TableState, StoreError> {
        let delta = self.place.wait(async {
            DeltaTableState::try_new(&self.log, version.map(to_u64))
                .await
                .map_err(|error| self.refused("open", error))
        })?;
        let files = self.live_files(&delta)?;
        Ok(TableState { files, delta })
    }

    fn live_files(&self, delta: &DeltaTableState) -> Result<Files, StoreError> {
        let mut files = Files::new();
        for view in delta.log_data().iter() {
            let name = view.path().into_owned();
            let statistics = view.stats().unwrap_or_default();
            let file =
                DataFile::from_log(name.clone(), view.size(), statistics).ok_or_else(|| {
                    StoreError::damaged(
                        self.place.describe(&format!("{}/_delta_log", self.name)),
                        format!("the entry of {name} was not written by Tilefold"),
                    )
                })?;
            files.insert(name, file);
        }
        Ok(files)
    }

    /// Creates the table without rows; leaves one that is there alone.
    pub(crate) fn create(
        &self,
        layout: &Layout,
        metadata: CommitMetadata,
    ) -> Result<(), StoreError> {
        let schema: StructType = layout
            .stored_schema()
            .as_ref()
            .try_into_kernel()
            .map_err(|error| StoreError::encode("describe", layout.name, error))?;
        let create = CreateBuilder::new()
            .with_log_store(self.log.clone())
            .with_table_name(layout.name)
            .with_columns(schema.fields().cloned())
            .with_configuration(configuration(layout))
            .with_save_mode(SaveMode::Ignore)
            .with_commit_properties(
                CommitProperties::default()
                    .with_metadata(metadata)
                    .with_max_retries(0),
            );
        self.place.wait(async {
            match create.await {
                Err(error) if !lost_the_race(&error) => Err(self.refused("create", error)),
                _ => Ok(()),
            }
        })
    }

    /// Commits the step from `from` to the wanted files as the version after `from`.
    ///
    /// Returns nothing where another writer was faster.
    pub(crate) fn commit(
        &self,
        from: &TableState,
        wanted: &Files,
        metadata: CommitMetadata,
    ) -> Result<Option<i64>, StoreError> {
        let properties = CommitProperties::default()
            .with_metadata(metadata)
            .with_max_retries(0)
            .with_cleanup_expired_logs(Some(false));
        let operation = DeltaOperation::Write {
            mode: SaveMode::Overwrite,
            partition_by: None,
            predicate: None,
        };
        let commit = CommitBuilder::from(properties)
            .with_actions(actions(&from.files, wanted))
            .build(Some(&from.delta), self.log.clone(), operation);
        self.place.wait(async {
            let prepared = commit
                .into_prepared_commit_future()
                .await
                .map_err(|error| self.refused("prepare a commit to", error))?;
            let done = match prepared.await {
                Ok(done) => done,
                Err(error) if lost_the_race(&error) => return Ok(None),
                Err(error) => return Err(self.refused("commit to", error)),
            };
            let version = to_i64(done.version);
            if (version + 1) % CHECKPOINT_INTERVAL == 0 {
                // The commit stands. A checkpoint only makes opening faster, and the next one
                // makes up for it.
                if let Err(error) = done.await {
                    tracing::warn!(table = self.name, version, %error, "no checkpoint was written");
                }
            }
            Ok(Some(version))
        })
    }

    fn refused(&self, action: &'static str, source: DeltaTableError) -> StoreError {
        StoreError::Delta {
            action,
            location: self.place.to_string(),
            table: self.name.to_owned(),
            source: Box::new(source),
        }
    }
}

fn lost_the_race(error: &DeltaTableError) -> bool {
    matches!(
        error,
        DeltaTableError::VersionAlreadyExists(_)
            | DeltaTableError::Transaction {
                source: TransactionError::MaxCommitAttempts(_)
                    | TransactionError::CommitConflict(
                        CommitConflictError::ConcurrentAppend
                            | CommitConflictError::ConcurrentDeleteRead
                            | CommitConflictError::ConcurrentDeleteDelete
                    )
            }
    )
}

fn configuration(layout: &Layout) -> Vec<(String, Option<String>)> {
    let plain = STATISTICS.iter().copied();
    let plain = plain.filter(|name| layout.schema.index_of(name).is_ok());
    let mut indexed: Vec<String> = plain.map(str::to_owned).collect();
    if !layout.geometry.is_empty() {
        indexed.extend(CORNERS.map(|corner| format!("{BBOX}.{corner}")));
    }
    let mut properties = vec![
        ("delta.deletedFileRetentionDuration", KEEP.to_owned()),
        ("delta.logRetentionDuration", KEEP.to_owned()),
        ("delta.enableExpiredLogCleanup", "false".to_owned()),
        ("delta.checkpointInterval", CHECKPOINT_INTERVAL.to_string()),
    ];
    if indexed.is_empty() {
        properties.push(("delta.dataSkippingNumIndexedCols", "0".to_owned()));
    } else {
        properties.push(("delta.dataSkippingStatsColumns", indexed.join(",")));
    }
    properties
        .into_iter()
        .map(|(key, value)| (key.to_owned(), Some(value)))
        .collect()
}

/// The difference between two sets of files, in the order of their names.
fn actions(live: &Files, wanted: &Files) -> Vec<Action> {
    let now = now_ms();
    let gone = live
        .values()
        .filter(|file| !wanted.contains_key(&file.name));
    let come = wanted
        .values()
        .filter(|file| !live.contains_key(&file.name));
    gone.map(|file| Action::Remove(remove(file, now)))
        .chain(come.map(|file| Action::Add(add(file, now))))
        .collect()
}

fn add(file: &DataFile, now: i64) -> Add {
    Add {
        path: file.name.clone(),
        partition_values: HashMap::new(),
        size: file.size,
        modification_time: now,
        data_change: true,
        stats: Some(file.statistics.clone()),
        tags: None,
        deletion_vector: None,
        base_row_id: None,
        default_row_commit_version: None,
        clustering_provider: None,
    }
}

fn remove(file: &DataFile, now: i64) -> Remove {
    Remove {
        path: file.name.clone(),
        data_change: true,
        deletion_timestamp: Some(now),
        extended_file_metadata: Some(true),
        partition_values: Some(HashMap::new()),
        size: Some(file.size),
        ..Remove::default()
    }
}

/// The clock, for the log alone: no row and no digest knows it.
fn now_ms() -> i64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .ok()
        .and_then(|age| i64::try_from(age.as_millis()).ok())
        .unwrap_or(0)
}

fn to_i64(version: u64) -> i64 {
    i64::try_from(version).unwrap_or(i64::MAX)
}

fn to_u64(version: i64) -> u64 {
    u64::try_from(version).unwrap_or(0)
}

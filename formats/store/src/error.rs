//! What can go wrong with a store: what, where, why, and how to mend it.

use deltalake::DeltaTableError;
use deltalake::logstore::object_store;
use tilefold_schemas::column::ColumnError;

/// Why a store could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// There is no store at the location.
    #[error("{location} is not a Tilefold store: {reason}; create one with `tilefold init`")]
    NotAStore {
        /// Where a store was expected.
        location: String,
        /// What is missing.
        reason: String,
    },
    /// A store cannot be created where one is.
    #[error("{location} is a Tilefold store already; open it, or choose another folder")]
    Exists {
        /// The store that is there.
        location: String,
    },
    /// The location is neither a usable path nor a known URL.
    #[error("`{location}` cannot hold a store: {reason}; give a folder or a URL")]
    Location {
        /// The location as it was given.
        location: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The bucket is not there, or does not let us in.
    #[error("cannot reach {location}: {reason}")]
    Unreachable {
        /// The location as it was given.
        location: String,
        /// What is wrong, what mends it, and what the storage said.
        reason: String,
    },
    /// The store was written by a later Tilefold.
    #[error(
        "{location} has the store format {found}, but this Tilefold knows formats up to {known}; \
         use a newer Tilefold"
    )]
    FutureFormat {
        /// The store.
        location: String,
        /// Its format version.
        found: i64,
        /// The newest format version known here.
        known: i64,
    },
    /// The store was written by a Tilefold that is too old.
    #[error(
        "{location} has the store format {found}, but this Tilefold reads formats from {oldest}; \
         earlier ones were never published: make the store anew with `init` and `run`"
    )]
    AncientFormat {
        /// The store.
        location: String,
        /// Its format version.
        found: i64,
        /// The oldest format version that is still read.
        oldest: i64,
    },
    /// A store of the format before this one can be read but not written.
    #[error(
        "{location} has the store format {found}, which is only read; this Tilefold writes format \
         {current}: create a new store and run the logs again"
    )]
    ReadOnlyFormat {
        /// The store.
        location: String,
        /// Its format version.
        found: i64,
        /// The format version that is written here.
        current: i64,
    },
    /// A version that the store does not have.
    #[error("{location} has no version {version}; its versions are 0 to {latest}")]
    NoSuchVersion {
        /// The store.
        location: String,
        /// The version asked for.
        version: i64,
        /// The latest version there is.
        latest: i64,
    },
    /// A version whose files were removed.
    #[error(
        "version {version} of {location} was removed by `tilefold vacuum`; the oldest one that can be read is {oldest}"
    )]
    Vacuumed {
        /// The store.
        location: String,
        /// The version asked for.
        version: i64,
        /// The oldest version there is.
        oldest: i64,
    },
    /// An instant before the store's first version.
    #[error(
        "{location} has no version as old as {as_of_ms} ms after 1970; the first one is of \
         {first_ms} ms"
    )]
    BeforeFirstVersion {
        /// The store.
        location: String,
        /// The instant asked for, milliseconds since the Unix epoch.
        as_of_ms: i64,
        /// The instant of version 0.
        first_ms: i64,
    },
    /// Another writer committed first.
    #[error(
        "{location} moved from version {base} to version {latest} while this job was based on \
         version {base}; nothing was committed: run the same command again"
    )]
    Conflict {
        /// The store.
        location: String,
        /// The version the transaction was based on.
        base: i64,
        /// The latest version now.
        latest: i64,
    },
    /// Another writer kept committing to a table.
    #[error(
        "table `{table}` of {location} was moved by other writers {attempts} times in a row; \
         nothing was committed: run the same command again when they are done"
    )]
    Busy {
        /// The store.
        location: String,
        /// The table.
        table: String,
        /// How often the commit was tried.
        attempts: usize,
    },
    /// Data files that were written elsewhere do not belong to this transaction.
    #[error(
        "data files of table `{table}` that were written for {location} elsewhere do not fit: \
         {reason}; nothing was committed: run the same command again"
    )]
    Elsewhere {
        /// The store.
        location: String,
        /// The table.
        table: String,
        /// What does not fit.
        reason: String,
    },
    /// A file of the store is not what was written.
    #[error("{file} is damaged: {reason}; restore it from a copy, or use another version")]
    Damaged {
        /// The file.
        file: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A data file lacks a column of the row type, or holds another type.
    #[error("{file} does not hold rows of table `{table}`: {source}")]
    Column {
        /// The file.
        file: String,
        /// The table.
        table: String,
        /// What is wrong with which column.
        source: ColumnError,
    },
    /// The table in the store has other columns than the row type.
    #[error(
        "table `{table}` of {location} has other columns than this Tilefold writes ({reason}); \
         create a new store and run the logs again"
    )]
    Schema {
        /// The store.
        location: String,
        /// The table.
        table: String,
        /// The first column that differs.
        reason: String,
    },
    /// A tile was named for a table that has none.
    #[error("table `{table}` has no column `tile`; read it whole, append to it or overwrite it")]
    NotTiled {
        /// The table.
        table: String,
    },
    /// A row lies in a tile that the call does not replace.
    #[error(
        "a row for table `{table}` lies in tile {tile}, which is not among the {tiles} tiles to be \
         replaced; nothing was written"
    )]
    StrayRow {
        /// The table.
        table: String,
        /// The row's tile.
        tile: i32,
        /// How many tiles were to be replaced.
        tiles: usize,
    },
    /// Disk or object storage refused.
    #[error("could not {action} {place}: {source}")]
    Storage {
        /// What was tried.
        action: &'static str,
        /// The file or folder.
        place: String,
        /// The storage's reason.
        source: object_store::Error,
    },
    /// Delta Lake refused.
    #[error("could not {action} table `{table}` of {location}: {source}")]
    Delta {
        /// What was tried.
        action: &'static str,
        /// The store.
        location: String,
        /// The table.
        table: String,
        /// Delta Lake's reason.
        source: Box<DeltaTableError>,
    },
    /// Rows could not be brought into columns or into Parquet.
    #[error("could not {action} rows of table `{table}`: {reason}")]
    Encode {
        /// What was tried.
        action: &'static str,
        /// The table.
        table: String,
        /// The encoder's reason.
        reason: String,
    },
    /// The store's runtime could not be started, or the caller is inside another one.
    #[error("the store cannot be used here: {reason}; call it from a thread without a runtime")]
    Runtime {
        /// Why.
        reason: String,
    },
}

impl StoreError {
    pub(crate) fn damaged(file: impl Into<String>, reason: impl ToString) -> Self {
        Self::Damaged {
            file: file.into(),
            reason: reason.to_string(),
        }
    }

    pub(crate) fn encode(action: &'static str, table: &str, reason: impl ToString) -> Self {
        Self::Encode {
            action,
            table: table.to_owned(),
            reason: reason.to_string(),
        }
    }
}

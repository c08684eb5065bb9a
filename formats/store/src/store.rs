//! A store: created once, opened often; the door to its versions.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::commit_info::{self, JobInfo};
use crate::delta::{Files, TableLog, files_digest};
use crate::error::StoreError;
use crate::layout::Layout;
use crate::location::{Location, Place};
use crate::properties::{self, FORMAT_VERSION, Parameters, ReadProperties, StoreProperties};
use crate::snapshot::Snapshot;
use crate::transaction::Transaction;
use crate::vacuum;
use crate::version::{Pin, VersionInfo};

/// The table whose Delta version is the store's version.
pub(crate) const LAYERS: &str = "layers";

/// Operation of version 0.
const CREATE: &str = "create";

/// A store that is open. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Store {
    place: Arc<Place>,
    properties: Arc<ReadProperties>,
}

impl Store {
    /// Creates a store without rows, as version 0. Where an earlier attempt was killed, finishes it.
    ///
    /// # Errors
    /// There is a store already, or the storage refuses.
    pub fn create(
        location: impl Into<Location>,
        properties: StoreProperties,
    ) -> Result<Self, StoreError> {
        Self::create_at(Place::prepare(location.into())?, &properties)
    }

    pub(crate) fn create_at(
        place: Place,
        properties: &StoreProperties,
    ) -> Result<Self, StoreError> {
        if place.read_file(properties::FILE)?.is_some() {
            return Err(StoreError::Exists {
                location: place.to_string(),
            });
        }
        create_tables(&place)?;
        // Last, because it makes the folder a store.
        properties::create(&place, properties)?;
        place.refuse_lost_commits(properties::FILE)?;
        Self::open_at(place)
    }

    /// Opens a store.
    ///
    /// # Errors
    /// There is none, its format is not understood, or `tilefold.json` is damaged.
    pub fn open(location: impl Into<Location>) -> Result<Self, StoreError> {
        Self::open_at(Place::open(location.into())?)
    }

    pub(crate) fn open_at(place: Place) -> Result<Self, StoreError> {
        let properties = properties::read(&place)?;
        Ok(Self {
            place: Arc::new(place),
            properties: Arc::new(properties),
        })
    }

    /// What the store was created with.
    #[must_use]
    pub fn properties(&self) -> &StoreProperties {
        &self.properties.properties
    }

    /// Where the store is.
    #[must_use]
    pub fn location(&self) -> String {
        self.place.to_string()
    }

    /// The number of the latest version.
    ///
    /// # Errors
    /// The storage refuses.
    pub fn latest_version(&self) -> Result<i64, StoreError> {
        TableLog::open(&self.place, LAYERS)?.latest(0)
    }

    /// All versions, oldest first.
    ///
    /// # Errors
    /// A commit is damaged or cannot be read.
    pub fn versions(&self) -> Result<Vec<VersionInfo>, StoreError> {
        let mut versions: Vec<VersionInfo> = Vec::new();
        for version in 0..=self.latest_version()? {
            let mut info = self.version_info(version)?;
            if let Some(before) = versions.last() {
                info.timestamp_ms = info.timestamp_ms.max(before.timestamp_ms);
            }
            versions.push(info);
        }
        Ok(versions)
    }

    fn version_info(&self, version: i64) -> Result<VersionInfo, StoreError> {
        let file = format!("{LAYERS}/_delta_log/{version:020}.json");
        let entry = TableLog::open(&self.place, LAYERS)?.commit_entry(version)?;
        let file = self.place.describe(&file);
        match entry {
            Some(bytes) => commit_info::read(version, &file, &bytes),
            None => Err(StoreError::damaged(file, "it is missing")),
        }
    }

    /// The store at a version, or at its latest one.
    ///
    /// # Errors
    /// There is no such version, or its commit is damaged.
    pub fn snapshot(&self, version: Option<i64>) -> Result<Snapshot, StoreError> {
        let latest = self.latest_version()?;
        let version = version.unwrap_or(latest);
        if !(0..=latest).contains(&version) {
            return Err(StoreError::NoSuchVersion {
                location: self.location(),
                version,
                latest,
            });
        }
        self.refuse_vacuumed(version)?;
        let info = self.version_info(version)?;
        Ok(Snapshot::new(self.clone(), info))
    }

    fn refuse_vacuumed(&self, version: i64) -> Result<(), StoreError> {
        let oldest = vacuum::oldest_version(&self.place)?;
        if version >= oldest {
            return Ok(());
        }
        Err(StoreError::Vacuumed {
            location: self.location(),
            version,
            oldest,
        })
    }

    /// The store as it was at an instant, milliseconds since the Unix epoch.
    ///
    /// # Errors
    /// The store is younger than that, or a commit is damaged.
    pub fn snapshot_as_of(&self, as_of_ms: i64) -> Result<Snapshot, StoreError> {
        let mut versions = self.versions()?;
        let first_ms = versions.first().map_or(0, |info| info.timestamp_ms);
        versions.retain(|info| info.timestamp_ms <= as_of_ms);
        let info = versions
            .pop()
            .ok_or_else(|| StoreError::BeforeFirstVersion {
                location: self.location(),
                as_of_ms,
                first_ms,
            })?;
        self.refuse_vacuumed(info.version)?;
        Ok(Snapshot::new(self.clone(), info))
    }

    /// Begins a transaction that is based on the latest version.
    ///
    /// # Errors
    /// The store's format is only read, or its latest version is damaged.
    pub fn begin(&self) -> Result<Transaction, StoreError> {
        self.begin_from(self.snapshot(None)?)
    }

    /// Begins a transaction based on `base`: it conflicts with whatever was committed since then.
    ///
    /// # Errors
    /// The store's format is only read.
    pub fn begin_from(&self, base: Snapshot) -> Result<Transaction, StoreError> {
        let found = self.properties.format_version;
        if found != FORMAT_VERSION {
            return Err(StoreError::ReadOnlyFormat {
                location: self.location(),
                found,
                current: FORMAT_VERSION,
            });
        }
        Ok(Transaction::new(base))
    }

    pub(crate) fn place(&self) -> &Place {
        &self.place
    }
}

/// All known tables at their version 0; `layers`, whose first commit pins them, comes last.
fn create_tables(place: &Place) -> Result<(), StoreError> {
    let empty = Pin {
        version: 0,
        files: files_digest(&Files::new()),
    };
    let mut pins = BTreeMap::new();
    for layout in Layout::known() {
        pins.insert(layout.name.to_owned(), empty.clone());
        let mut metadata = Vec::new();
        if layout.name == LAYERS {
            let job = JobInfo {
                operation: CREATE.to_owned(),
                parameters: Parameters::new(),
                pins: pins.clone(),
            };
            metadata.push((commit_info::KEY.to_owned(), commit_info::seal(&job, 0)?));
        }
        TableLog::open(place, layout.name)?.create(&layout, metadata)?;
    }
    Ok(())
}

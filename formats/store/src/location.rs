//! Where a store is: a folder or a URL, the object store behind it, and the runtime that waits.

use std::fmt;
use std::future::Future;
use std::path::{Path, PathBuf};

use bytes::Bytes;
use deltalake::logstore::object_store::{
    self, Error as ObjectError, ObjectStoreExt, PutMode, path::Path as ObjectPath,
};
use deltalake::logstore::{LogStoreRef, ObjectStoreRef, StorageConfig, logstore_with};
use deltalake::logstore::{object_store::ObjectStore, object_store_factories};
use tokio::runtime::{Builder, Handle, Runtime};
use url::Url;

use crate::error::StoreError;

/// Threads of the private runtime. They only wait for storage.
const WAITING_THREADS: usize = 2;

/// A folder on this machine, or a URL of an object store.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
    /// A folder on this machine.
    Folder(PathBuf),
    /// A URL such as `s3://bucket/store`; which schemes work depends on how this was built.
    Url(String),
}

impl From<&str> for Location {
    fn from(text: &str) -> Self {
        if text.contains("://") {
            Self::Url(text.to_owned())
        } else {
            Self::Folder(PathBuf::from(text))
        }
    }
}

impl From<String> for Location {
    fn from(text: String) -> Self {
        Self::from(text.as_str())
    }
}

impl From<&Path> for Location {
    fn from(path: &Path) -> Self {
        path.to_str()
            .map_or_else(|| Self::Folder(path.to_owned()), Self::from)
    }
}

impl From<PathBuf> for Location {
    fn from(path: PathBuf) -> Self {
        Self::from(path.as_path())
    }
}

impl From<&PathBuf> for Location {
    fn from(path: &PathBuf) -> Self {
        Self::from(path.as_path())
    }
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Folder(path) => path.display().fmt(f),
            Self::Url(url) => url.fmt(f),
        }
    }
}

impl Location {
    fn url(&self) -> Result<Url, StoreError> {
        let refuse = |reason: String| StoreError::Location {
            location: self.to_string(),
            reason,
        };
        match self {
            Self::Folder(path) => {
                let path = std::path::absolute(path).map_err(|error| refuse(error.to_string()))?;
                Url::from_directory_path(path)
                    .map_err(|()| refuse("it is no path that a URL can express".to_owned()))
            }
            Self::Url(text) => {
                let slash = if text.ends_with('/') { "" } else { "/" };
                Url::parse(&format!("{text}{slash}")).map_err(|error| refuse(error.to_string()))
            }
        }
    }
}

/// An opened location.
pub(crate) struct Place {
    location: Location,
    url: Url,
    /// Storage from its root on: all reads and writes of a store go through it.
    storage: ObjectStoreRef,
    /// The same storage, seen from the store's folder.
    folder: ObjectStoreRef,
    runtime: Runtime,
}

impl fmt::Debug for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Place({})", self.url)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.location.fmt(f)
    }
}

impl Place {
    pub(crate) fn open(location: Location) -> Result<Self, StoreError> {
        let url = location.url()?;
        let storage = storage_for(&location, &url)?;
        Self::with_storage(location, storage)
    }

    /// A location on the given storage, which may be one that fails on purpose.
    pub(crate) fn with_storage(
        location: Location,
        storage: ObjectStoreRef,
    ) -> Result<Self, StoreError> {
        let url = location.url()?;
        let refuse = |error: deltalake::DeltaTableError| refuse(&location, error);
        let folder = logstore_with(storage.clone(), &url, StorageConfig::default())
            .map_err(refuse)?
            .object_store(None);
        Ok(Self {
            url,
            storage,
            folder,
            runtime: runtime()?,
            location,
        })
    }

    /// The log of one table.
    pub(crate) fn table(&self, name: &str) -> Result<LogStoreRef, StoreError> {
        let url = self
            .url
            .join(&format!("{name}/"))
            .map_err(|error| refuse(&self.location, error))?;
        logstore_with(self.storage.clone(), &url, StorageConfig::default())
            .map_err(|error| refuse(&self.location, error))
    }

    /// Waits for `future` on the private runtime.
    pub(crate) fn wait<T>(
        &self,
        future: impl Future<Output = Result<T, StoreError>>,
    ) -> Result<T, StoreError> {
        if Handle::try_current().is_ok() {
            return Err(StoreError::Runtime {
                reason: "this thread runs async code already".to_owned(),
            });
        }
        self.runtime.block_on(future)
    }

    /// A file of the store, as a person would find it.
    pub(crate) fn describe(&self, file: &str) -> String {
        match &self.location {
            Location::Folder(path) => path.join(file).display().to_string(),
            Location::Url(url) => format!("{}/{file}", url.trim_end_matches('/')),
        }
    }

    /// The bytes of a file, or nothing where there is none.
    pub(crate) fn read_file(&self, file: &str) -> Result<Option<Bytes>, StoreError> {
        let path = ObjectPath::from(file);
        let read = async {
            match self.folder.get(&path).await {
                Ok(found) => found.bytes().await.map(Some),
                Err(ObjectError::NotFound { .. }) => Ok(None),
                Err(error) => Err(error),
            }
        };
        self.wait(async { read.await.map_err(|e| self.storage_error("read", file, e)) })
    }

    /// Writes a file whole, in one step; readers of an older file with this name are not disturbed.
    pub(crate) fn write_file(&self, file: &str, bytes: Bytes) -> Result<(), StoreError> {
        self.put(file, bytes, PutMode::Overwrite)
    }

    /// Writes a file that must not exist yet.
    pub(crate) fn create_file(&self, file: &str, bytes: Bytes) -> Result<(), StoreError> {
        match self.put(file, bytes, PutMode::Create) {
            Err(StoreError::Storage {
                source: ObjectError::AlreadyExists { .. },
                ..
            }) => Err(StoreError::Exists {
                location: self.to_string(),
            }),
            other => other,
        }
    }

    fn put(&self, file: &str, bytes: Bytes, mode: PutMode) -> Result<(), StoreError> {
        let path = ObjectPath::from(file);
        self.wait(async {
            self.folder
                .put_opts(&path, bytes.into(), mode.into())
                .await
                .map_err(|error| self.storage_error("write", file, error))
        })?;
        Ok(())
    }

    fn storage_error(
        &self,
        action: &'static str,
        file: &str,
        source: object_store::Error,
    ) -> StoreError {
        StoreError::Storage {
            action,
            place: self.describe(file),
            source,
        }
    }
}

fn refuse(location: &Location, error: impl fmt::Display) -> StoreError {
    StoreError::Location {
        location: location.to_string(),
        reason: error.to_string(),
    }
}

fn storage_for(location: &Location, url: &Url) -> Result<ObjectStoreRef, StoreError> {
    let scheme =
        Url::parse(&format!("{}://", url.scheme())).map_err(|error| refuse(location, error))?;
    let factories = object_store_factories();
    let factory = factories.get(&scheme).ok_or_else(|| {
        refuse(
            location,
            format!("storage of the kind `{}` is not built in", url.scheme()),
        )
    })?;
    let (storage, _) = factory
        .parse_url_opts(url, &StorageConfig::default())
        .map_err(|error| refuse(location, error))?;
    Ok(storage)
}

fn runtime() -> Result<Runtime, StoreError> {
    Builder::new_multi_thread()
        .worker_threads(WAITING_THREADS)
        .thread_name("tilefold-store")
        .enable_all()
        .build()
        .map_err(|error| StoreError::Runtime {
            reason: error.to_string(),
        })
}

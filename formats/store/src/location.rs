//! Where a store is: a folder or a URL, the object store behind it, and the runtime that waits.

use std::fmt;
use std::future::Future;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bytes::Bytes;
use deltalake::logstore::object_store::{
    self, Error as ObjectError, ObjectStore, ObjectStoreExt, PutMode, local::LocalFileSystem,
    path::Path as ObjectPath, prefix::PrefixStore,
};
use deltalake::logstore::{
    LogStoreRef, ObjectStoreRef, StorageConfig, default_logstore, logstore_with,
    object_store_factories,
};
use deltalake::{DeltaResult, DeltaTableError};
use futures::TryStreamExt;
use tokio::runtime::{Builder, Handle, Runtime};
use url::Url;

use crate::error::StoreError;
use crate::folder::Folder;
use crate::s3;

/// Threads of the private runtime. They only wait for storage.
const WAITING_THREADS: usize = 2;

/// Scheme of the URLs of tables in storage that has the store at its root.
const WHOLE: &str = "tilefold";

/// A folder on this machine, or a URL of an object store.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
    /// A folder on this machine.
    Folder(PathBuf),
    /// A URL: `s3://bucket/store`, or a scheme that is registered with Delta Lake.
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
    /// Whether it is in a bucket of S3.
    fn is_bucket(&self) -> bool {
        matches!(self, Self::Url(url) if url.starts_with("s3://"))
    }

    /// A `file:` URL is a folder like any other.
    fn folder(&self) -> Option<PathBuf> {
        match self {
            Self::Folder(path) => Some(path.clone()),
            Self::Url(text) => {
                let url = Url::parse(text).ok().filter(|url| url.scheme() == "file");
                url?.to_file_path().ok()
            }
        }
    }

    fn refuse(&self, reason: impl fmt::Display) -> StoreError {
        StoreError::Location {
            location: self.to_string(),
            reason: reason.to_string(),
        }
    }
}

/// Storage, and the store's place in it.
pub(crate) struct Root {
    storage: ObjectStoreRef,
    url: Url,
}

impl Root {
    /// Storage that has the store at its root. Logs then hold no path of this machine, a store can
    /// be moved, and no character of a folder's name means anything to a URL. (Delta Lake's own
    /// `file:` URLs fail on a folder whose name has a `%` in it.)
    pub(crate) fn whole(storage: ObjectStoreRef, location: &Location) -> Result<Self, StoreError> {
        let url = Url::parse(&format!("{WHOLE}:///")).map_err(|error| location.refuse(error))?;
        Ok(Self { storage, url })
    }

    /// The log of the table called `name`.
    fn table(&self, name: &str) -> DeltaResult<LogStoreRef> {
        let url = self.url.join(&format!("{name}/"));
        let url = url.map_err(|error| DeltaTableError::generic(error.to_string()))?;
        let options = StorageConfig::default();
        if url.scheme() == WHOLE {
            let table = Arc::new(PrefixStore::new(self.storage.clone(), name));
            return Ok(default_logstore(
                table,
                self.storage.clone(),
                &url,
                &options,
            ));
        }
        logstore_with(self.storage.clone(), &url, options)
    }

    /// The storage, seen from the store's folder.
    fn seen_from_store(&self) -> DeltaResult<ObjectStoreRef> {
        if self.url.scheme() == WHOLE {
            return Ok(self.storage.clone());
        }
        let options = StorageConfig::default();
        Ok(logstore_with(self.storage.clone(), &self.url, options)?.object_store(None))
    }

    fn folder(folder: &Path, location: &Location) -> Result<Self, StoreError> {
        if !folder.is_dir() {
            let reason = match folder.exists() {
                true => {
                    "it is a file, and a store is a folder (`tilefold inspect` says what it is)"
                }
                false => "there is no such folder",
            };
            return Err(StoreError::NotAStore {
                location: location.to_string(),
                reason: reason.to_owned(),
            });
        }
        let storage =
            LocalFileSystem::new_with_prefix(folder).map_err(|error| location.refuse(error))?;
        Self::whole(Arc::new(Folder::new(storage)), location)
    }

    fn url(text: &str, location: &Location) -> Result<Self, StoreError> {
        let slash = if text.ends_with('/') { "" } else { "/" };
        let url = Url::parse(&format!("{text}{slash}")).map_err(|e| location.refuse(e))?;
        if url.scheme() == s3::SCHEME {
            let storage = s3::storage(&url).map_err(|reason| location.refuse(reason))?;
            return Self::whole(storage, location);
        }
        let scheme = Url::parse(&format!("{}://", url.scheme())).map_err(|e| location.refuse(e))?;
        let factories = object_store_factories();
        let factory = factories.get(&scheme).ok_or_else(|| {
            location.refuse(format!(
                "storage of the kind `{}` is not known, `s3://BUCKET/PREFIX` is",
                url.scheme()
            ))
        })?;
        let (storage, _) = factory
            .parse_url_opts(&url, &StorageConfig::default())
            .map_err(|error| location.refuse(error))?;
        Ok(Self { storage, url })
    }
}

/// An opened location.
pub(crate) struct Place {
    location: Location,
    /// All reads and writes of a store go through it.
    root: Root,
    /// The same storage, seen from the store's folder.
    folder: ObjectStoreRef,
    runtime: Runtime,
}

impl fmt::Debug for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Place({})", self.location)
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.location.fmt(f)
    }
}

impl Place {
    /// The place of a store that should be there.
    pub(crate) fn open(location: Location) -> Result<Self, StoreError> {
        let root = match (location.folder(), &location) {
            (Some(folder), _) => Root::folder(&folder, &location)?,
            (None, Location::Url(url)) => Root::url(url, &location)?,
            (None, Location::Folder(_)) => return Err(location.refuse("it is no folder")),
        };
        Self::at(root, location)
    }

    /// The place of a store that is to be made.
    pub(crate) fn prepare(location: Location) -> Result<Self, StoreError> {
        if let Some(folder) = location.folder() {
            std::fs::create_dir_all(folder).map_err(|error| location.refuse(error))?;
        }
        Self::open(location)
    }

    /// A place on the given storage, which may be one that fails on purpose.
    pub(crate) fn at(root: Root, location: Location) -> Result<Self, StoreError> {
        let folder = root
            .seen_from_store()
            .map_err(|error| location.refuse(error))?;
        Ok(Self {
            root,
            folder,
            runtime: runtime()?,
            location,
        })
    }

    /// The log of one table.
    pub(crate) fn table(&self, name: &str) -> Result<LogStoreRef, StoreError> {
        self.root
            .table(name)
            .map_err(|error| self.location.refuse(error))
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
                Err(error) if is_absent(&error) => Ok(None),
                Err(error) => Err(error),
            }
        };
        self.wait(async { read.await.map_err(|error| self.unread(file, error)) })
    }

    /// Opening and creating a store begin with reading a file: what is wrong with a bucket is said
    /// there, in words, and not by the first table that happens to be touched.
    fn unread(&self, file: &str, error: ObjectError) -> StoreError {
        if !self.location.is_bucket() {
            return self.storage_error("read", file, error);
        }
        StoreError::Unreachable {
            location: self.to_string(),
            reason: s3::in_words(&error),
        }
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

    /// Refuses a bucket in which a file that is there can be created once more: two writers would
    /// both make the same version, and the first one's would be gone. `file` is one that is there.
    pub(crate) fn refuse_lost_commits(&self, file: &str) -> Result<(), StoreError> {
        if !self.location.is_bucket() {
            return Ok(());
        }
        let bytes = self.read_file(file)?.unwrap_or_default();
        match self.create_file(file, bytes) {
            Err(StoreError::Exists { .. }) => Ok(()),
            Err(error) => Err(error),
            Ok(()) => {
                self.delete([file.to_owned()])?;
                Err(self.location.refuse(
                    "this storage does not heed `If-None-Match: *`, so that two writers could \
                     undo each other's commits unseen",
                ))
            }
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

    /// All data files of all tables, by path.
    pub(crate) fn data_files(&self) -> Result<Vec<StoredFile>, StoreError> {
        let is_data = |file: &StoredFile| {
            file.path.ends_with(".parquet") && !file.path.contains("_delta_log")
        };
        self.wait(async {
            let found: Result<Vec<_>, _> = self.folder.list(None).try_collect().await;
            let found = found.map_err(|error| self.storage_error("list", "", error))?;
            let mut files: Vec<StoredFile> = found.into_iter().map(StoredFile::from).collect();
            files.retain(is_data);
            files.sort_by(|a, b| a.path.cmp(&b.path));
            Ok(files)
        })
    }

    /// Deletes files; those that are gone already do not matter.
    pub(crate) fn delete(&self, files: impl IntoIterator<Item = String>) -> Result<(), StoreError> {
        self.wait(async {
            for file in files {
                match self.folder.delete(&ObjectPath::from(file.as_str())).await {
                    Ok(()) | Err(ObjectError::NotFound { .. }) => {}
                    Err(error) => return Err(self.storage_error("delete", &file, error)),
                }
            }
            Ok(())
        })
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

/// A file in storage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct StoredFile {
    /// Path from the store's folder.
    pub(crate) path: String,
    /// When it was written, milliseconds since the Unix epoch.
    pub(crate) written_ms: i64,
    /// Its size.
    pub(crate) size_bytes: u64,
}

impl From<object_store::ObjectMeta> for StoredFile {
    fn from(found: object_store::ObjectMeta) -> Self {
        Self {
            path: found.location.to_string(),
            written_ms: found.last_modified.timestamp_millis(),
            size_bytes: found.size,
        }
    }
}

/// A file that is not there, in a bucket that is.
fn is_absent(error: &ObjectError) -> bool {
    matches!(error, ObjectError::NotFound { .. }) && !s3::lacks_bucket(error)
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

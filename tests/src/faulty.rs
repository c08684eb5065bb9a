//! Storage that fails, tears or stops at a chosen operation: folders under the scheme `faulty`.
//!
//! `faulty:///tmp/store` is the folder `/tmp/store`, seen through the fuse that was last set for it.
//! Without one, nothing fails. Puts are atomic, as object stores promise: what a torn one leaves is
//! half a data file, or nothing of a log entry.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::path::{Path as FilePath, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

use async_trait::async_trait;
use bytes::Bytes;
use deltalake::logstore::object_store::local::LocalFileSystem;
use deltalake::logstore::object_store::path::Path;
use deltalake::logstore::object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta,
    ObjectStore, ObjectStoreExt, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};
use deltalake::logstore::{
    LogStore, LogStoreFactory, ObjectStoreFactory, ObjectStoreRef, StorageConfig, default_logstore,
    logstore_factories, object_store_factories,
};
use deltalake::{DeltaResult, DeltaTableError};
use futures::stream::BoxStream;
use futures::{StreamExt, TryStreamExt, stream};
use url::Url;

/// What happens at the chosen operation, and after it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// It is refused; everything after it works again.
    Fail,
    /// It is refused, and so is all that follows.
    Stop,
    /// It is carried out, but its reply is lost, and all that follows is refused.
    LostReply,
    /// Half of what it would write is written, and all that follows is refused.
    Tear,
}

impl Fault {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Fail, Self::Stop, Self::LostReply, Self::Tear];
}

/// A file that was read, in whole or in part, or written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Access {
    /// Its path.
    pub path: String,
    /// Whether it was written.
    pub is_write: bool,
    /// How many of its bytes.
    pub bytes: u64,
}

/// When what happens, and what happened until then.
#[derive(Debug)]
pub struct Fuse {
    fault: Fault,
    at: usize,
    seen: AtomicUsize,
    accesses: Mutex<Vec<Access>>,
}

/// What an operation is to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    Works,
    Refused,
    Tears,
    LosesReply,
}

impl Fuse {
    /// Operations that were asked for.
    #[must_use]
    pub fn operations(&self) -> usize {
        self.seen.load(Ordering::SeqCst)
    }

    /// Whether the chosen operation was reached.
    #[must_use]
    pub fn has_fired(&self) -> bool {
        self.operations() > self.at
    }

    /// The files that were asked for, in the order of asking.
    #[must_use]
    pub fn accesses(&self) -> Vec<Access> {
        self.lock().clone()
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Access>> {
        self.accesses.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn burn(&self) -> Fate {
        let number = self.seen.fetch_add(1, Ordering::SeqCst);
        match (number.cmp(&self.at), self.fault) {
            (std::cmp::Ordering::Less, _) | (std::cmp::Ordering::Greater, Fault::Fail) => {
                Fate::Works
            }
            (std::cmp::Ordering::Equal, Fault::LostReply) => Fate::LosesReply,
            (std::cmp::Ordering::Equal, Fault::Tear) => Fate::Tears,
            _ => Fate::Refused,
        }
    }
}

type Fuses = Mutex<BTreeMap<PathBuf, Arc<Fuse>>>;

static FUSES: LazyLock<Fuses> = LazyLock::new(|| {
    if let Ok(scheme) = Url::parse("faulty://") {
        object_store_factories().insert(scheme.clone(), Arc::new(Factory));
        logstore_factories().insert(scheme, Arc::new(Factory));
    }
    Mutex::default()
});

/// Sets a fuse for a folder: operation number `at` (from 0) meets `fault`.
pub fn arm(folder: &FilePath, fault: Fault, at: usize) -> Arc<Fuse> {
    let fuse = Arc::new(Fuse {
        fault,
        at,
        seen: AtomicUsize::new(0),
        accesses: Mutex::default(),
    });
    let mut fuses = FUSES.lock().unwrap_or_else(PoisonError::into_inner);
    fuses.insert(folder.to_owned(), fuse.clone());
    fuse
}

/// The folder, seen through its fuse.
#[must_use]
pub fn through_fuse(folder: &FilePath) -> PathBuf {
    PathBuf::from(format!("faulty://{}", folder.display()))
}

#[derive(Debug)]
struct Factory;

impl ObjectStoreFactory for Factory {
    fn parse_url_opts(&self, url: &Url, _: &StorageConfig) -> DeltaResult<(ObjectStoreRef, Path)> {
        let folder = PathBuf::from(url.path().trim_end_matches('/'));
        let fuses = FUSES.lock().unwrap_or_else(PoisonError::into_inner);
        let faulty = Faulty {
            inner: LocalFileSystem::new(),
            fuse: fuses.get(&folder).cloned(),
        };
        let path = Path::parse(url.path()).map_err(|e| DeltaTableError::generic(e.to_string()))?;
        Ok((Arc::new(faulty), path))
    }
}

impl LogStoreFactory for Factory {
    fn with_options(
        &self,
        prefixed: ObjectStoreRef,
        root: ObjectStoreRef,
        location: &Url,
        options: &StorageConfig,
    ) -> DeltaResult<Arc<dyn LogStore>> {
        Ok(default_logstore(prefixed, root, location, options))
    }
}

/// Local files behind a fuse.
#[derive(Debug)]
struct Faulty {
    inner: LocalFileSystem,
    fuse: Option<Arc<Fuse>>,
}

impl Faulty {
    fn burn(&self) -> Fate {
        self.fuse.as_ref().map_or(Fate::Works, |fuse| fuse.burn())
    }

    fn note(&self, at: &Path, is_write: bool, bytes: u64) {
        if let Some(fuse) = &self.fuse {
            fuse.lock().push(Access {
                path: at.to_string(),
                is_write,
                bytes,
            });
        }
    }

    /// For what writes nothing, a lost reply is a refusal.
    fn works(&self) -> Result<()> {
        match self.burn() {
            Fate::Works => Ok(()),
            _ => Err(dead()),
        }
    }
}

impl fmt::Display for Faulty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Faulty({})", self.inner)
    }
}

fn dead() -> Error {
    Error::Generic {
        store: "Faulty",
        source: "the fuse has blown".into(),
    }
}

fn refused<T: Send + 'static>() -> BoxStream<'static, Result<T>> {
    stream::once(async { Err(dead()) }).boxed()
}

/// Delta Lake trusts storage to list by name.
fn in_order(
    listing: BoxStream<'static, Result<ObjectMeta>>,
) -> BoxStream<'static, Result<ObjectMeta>> {
    let sorted = async move {
        let mut found: Vec<ObjectMeta> = listing.try_collect().await?;
        found.sort_by(|a, b| a.location.cmp(&b.location));
        Ok::<_, Error>(stream::iter(found.into_iter().map(Ok)))
    };
    stream::once(sorted).try_flatten().boxed()
}

#[async_trait]
impl ObjectStore for Faulty {
    async fn put_opts(&self, at: &Path, payload: PutPayload, how: PutOptions) -> Result<PutResult> {
        self.note(at, true, payload.content_length() as u64);
        match self.burn() {
            Fate::Works => self.inner.put_opts(at, payload, how).await,
            Fate::Refused => Err(dead()),
            Fate::LosesReply => {
                self.inner.put_opts(at, payload, how).await?;
                Err(dead())
            }
            Fate::Tears => {
                if !at.as_ref().contains("_delta_log") && !at.as_ref().ends_with(".json") {
                    let whole = Bytes::from(payload);
                    self.inner
                        .put(at, whole.slice(..whole.len() / 2).into())
                        .await?;
                }
                Err(dead())
            }
        }
    }

    async fn put_multipart_opts(
        &self,
        at: &Path,
        how: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.works()?;
        self.inner.put_multipart_opts(at, how).await
    }

    async fn get_opts(&self, at: &Path, how: GetOptions) -> Result<GetResult> {
        self.works()?;
        let got = self.inner.get_opts(at, how).await?;
        self.note(at, false, got.range.end - got.range.start);
        Ok(got)
    }

    async fn get_ranges(&self, at: &Path, ranges: &[Range<u64>]) -> Result<Vec<Bytes>> {
        self.works()?;
        let bytes = ranges.iter().map(|range| range.end - range.start).sum();
        self.note(at, false, bytes);
        self.inner.get_ranges(at, ranges).await
    }

    fn delete_stream(
        &self,
        paths: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        match self.works() {
            Ok(()) => self.inner.delete_stream(paths),
            Err(_) => refused(),
        }
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        match self.works() {
            Ok(()) => in_order(self.inner.list(prefix)),
            Err(_) => refused(),
        }
    }

    fn list_with_offset(
        &self,
        prefix: Option<&Path>,
        offset: &Path,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        match self.works() {
            Ok(()) => in_order(self.inner.list_with_offset(prefix, offset)),
            Err(_) => refused(),
        }
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.works()?;
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, how: CopyOptions) -> Result<()> {
        self.works()?;
        self.inner.copy_opts(from, to, how).await
    }
}

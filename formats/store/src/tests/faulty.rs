//! Storage that dies: from the n-th operation on, nothing works any more.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use async_trait::async_trait;
use bytes::Bytes;
use deltalake::logstore::object_store::{
    CopyOptions, Error, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta,
    ObjectStore, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result, path::Path,
};
use futures::StreamExt;
use futures::stream::BoxStream;

/// When to die.
#[derive(Debug)]
pub(super) struct Fuse {
    left: AtomicUsize,
    /// Operations that were refused.
    pub(super) refused: AtomicUsize,
    /// Whether the operation that dies is carried out all the same (a reply that got lost).
    lost_reply: bool,
}

impl Fuse {
    pub(super) fn new(operations: usize, lost_reply: bool) -> Arc<Self> {
        Arc::new(Self {
            left: AtomicUsize::new(operations),
            refused: AtomicUsize::new(0),
            lost_reply,
        })
    }

    /// Whether the operation works, and whether it is carried out.
    fn burn(&self) -> (bool, bool) {
        let left = self
            .left
            .fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| n.checked_sub(1));
        match left {
            Ok(_) => (true, true),
            Err(_) => {
                let before = self.refused.fetch_add(1, Ordering::SeqCst);
                (false, self.lost_reply && before == 0)
            }
        }
    }
}

/// Storage behind a fuse.
#[derive(Debug)]
pub(super) struct Faulty {
    pub(super) inner: Arc<dyn ObjectStore>,
    pub(super) fuse: Arc<Fuse>,
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

#[async_trait]
impl ObjectStore for Faulty {
    async fn put_opts(
        &self,
        at: &Path,
        payload: PutPayload,
        opts: PutOptions,
    ) -> Result<PutResult> {
        let (works, happens) = self.fuse.burn();
        let done = if happens {
            self.inner.put_opts(at, payload, opts).await
        } else {
            Err(dead())
        };
        if works { done } else { Err(dead()) }
    }

    async fn put_multipart_opts(
        &self,
        at: &Path,
        opts: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        match self.fuse.burn() {
            (true, _) => self.inner.put_multipart_opts(at, opts).await,
            _ => Err(dead()),
        }
    }

    async fn get_opts(&self, at: &Path, options: GetOptions) -> Result<GetResult> {
        match self.fuse.burn() {
            (true, _) => self.inner.get_opts(at, options).await,
            _ => Err(dead()),
        }
    }

    async fn get_ranges(&self, at: &Path, ranges: &[Range<u64>]) -> Result<Vec<Bytes>> {
        match self.fuse.burn() {
            (true, _) => self.inner.get_ranges(at, ranges).await,
            _ => Err(dead()),
        }
    }

    fn delete_stream(
        &self,
        locations: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        match self.fuse.burn() {
            (true, _) => self.inner.delete_stream(locations),
            _ => futures::stream::once(async { Err(dead()) }).boxed(),
        }
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        match self.fuse.burn() {
            (true, _) => self.inner.list(prefix),
            _ => futures::stream::once(async { Err(dead()) }).boxed(),
        }
    }

    fn list_with_offset(
        &self,
        prefix: Option<&Path>,
        offset: &Path,
    ) -> BoxStream<'static, Result<ObjectMeta>> {
        match self.fuse.burn() {
            (true, _) => self.inner.list_with_offset(prefix, offset),
            _ => futures::stream::once(async { Err(dead()) }).boxed(),
        }
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        match self.fuse.burn() {
            (true, _) => self.inner.list_with_delimiter(prefix).await,
            _ => Err(dead()),
        }
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        match self.fuse.burn() {
            (true, _) => self.inner.copy_opts(from, to, options).await,
            _ => Err(dead()),
        }
    }
}

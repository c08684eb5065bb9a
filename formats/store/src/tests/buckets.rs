//! A bucket whose storage does not heed `If-None-Match: *`: no store may be made there.

use std::fmt;
use std::sync::Arc;

use async_trait::async_trait;
use futures::stream::BoxStream;
use object_store::memory::InMemory;
use object_store::path::Path;
use object_store::{
    CopyOptions, GetOptions, GetResult, ListResult, MultipartUpload, ObjectMeta, ObjectStore,
    PutMode, PutMultipartOptions, PutOptions, PutPayload, PutResult, Result,
};

use super::rows::properties;
use crate::location::{Location, Place, Root};
use crate::{Store, StoreError};

/// Storage in memory that overwrites whatever it is told to create.
#[derive(Debug, Default)]
struct Careless {
    inner: InMemory,
}

impl fmt::Display for Careless {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Careless")
    }
}

#[async_trait]
impl ObjectStore for Careless {
    async fn put_opts(&self, at: &Path, payload: PutPayload, _: PutOptions) -> Result<PutResult> {
        let opts = PutMode::Overwrite.into();
        self.inner.put_opts(at, payload, opts).await
    }

    async fn put_multipart_opts(
        &self,
        at: &Path,
        opts: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(at, opts).await
    }

    async fn get_opts(&self, at: &Path, options: GetOptions) -> Result<GetResult> {
        self.inner.get_opts(at, options).await
    }

    fn delete_stream(
        &self,
        locations: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(locations)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.inner.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, options: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, options).await
    }
}

fn bucket(storage: Arc<dyn ObjectStore>) -> Place {
    let location = Location::from("s3://maps/city");
    Place::at(Root::whole(storage, &location).unwrap(), location).unwrap()
}

#[test]
fn storage_that_would_lose_commits_is_refused() {
    Store::create_at(bucket(Arc::new(InMemory::new())), &properties()).unwrap();

    let careless: Arc<dyn ObjectStore> = Arc::new(Careless::default());
    let refused = Store::create_at(bucket(careless.clone()), &properties()).unwrap_err();
    assert!(refused.to_string().contains("If-None-Match"), "{refused}");
    let opened = Store::open_at(bucket(careless));
    assert!(matches!(opened, Err(StoreError::NotAStore { .. })));
}

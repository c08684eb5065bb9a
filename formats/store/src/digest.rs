//! Digests of rows as the store orders them; their form is that of [`tilefold_schemas::digest`].

use arrow_array::RecordBatch;
use tilefold_schemas::digest::TableDigest;

use crate::error::StoreError;
use crate::layout::{Layout, StoredTable};
use crate::order;

/// Digest of rows in any order, as [`Snapshot::digest`](crate::Snapshot::digest) gives it for a
/// table that holds just these.
///
/// # Errors
/// The rows cannot be sorted or encoded, which is a defect.
pub fn digest_rows<R: StoredTable>(rows: Vec<R>) -> Result<String, StoreError> {
    let layout = Layout::of::<R>();
    let mut digest = empty(&layout);
    add(
        &mut digest,
        &order::sorted(&layout, &[R::to_batch(rows)])?,
        &layout,
    )?;
    Ok(digest.finish())
}

/// That of a table without rows yet.
pub(crate) fn empty(layout: &Layout) -> TableDigest {
    TableDigest::new(&layout.schema, layout.not_digested)
}

/// Adds rows; batches must come in the table's order and in the layout's normal form.
pub(crate) fn add(
    digest: &mut TableDigest,
    rows: &RecordBatch,
    layout: &Layout,
) -> Result<(), StoreError> {
    digest
        .update(rows)
        .map_err(|reason| StoreError::encode("digest", layout.name, reason))
}

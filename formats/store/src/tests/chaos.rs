//! The storage dies at every single operation of a job: readers see the old version or the new
//! one, and the same job, run again, ends in the same digests.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use deltalake::logstore::object_store::local::LocalFileSystem;
use tempfile::TempDir;
use tilefold_schemas::{ChunkRow, EvidenceRow, LayerHeader};

use super::faulty::{Faulty, Fuse};
use super::rows::{parameters, properties, rows, tile, tiles};
use crate::folder::Folder;
use crate::location::{Location, Place, Root};
use crate::{Store, StoreError};

fn place(folder: &Path, fuse: &Arc<Fuse>) -> Result<Place, StoreError> {
    let location = Location::from(folder);
    let faulty = Faulty {
        inner: Arc::new(Folder::new(
            LocalFileSystem::new_with_prefix(folder).unwrap(),
        )),
        fuse: fuse.clone(),
    };
    Place::at(Root::whole(Arc::new(faulty), &location)?, location)
}

fn first_job(store: &Store) -> Result<i64, StoreError> {
    let mut tx = store.begin()?;
    tx.append::<EvidenceRow>(rows(1, tile(1), 5))?;
    tx.append::<EvidenceRow>(rows(2, tile(700), 5))?;
    tx.append::<ChunkRow>(rows(1, tile(0), 2))?;
    tx.replace_tiles::<LayerHeader>(&tiles([1]), rows(1, tile(1), 1))?;
    tx.commit("run", parameters())
}

/// As the engine does it: chunks that are there already are not mapped again.
fn second_job(store: &Store) -> Result<i64, StoreError> {
    let mut tx = store.begin()?;
    if tx.base().row_count::<ChunkRow>()? > 2 {
        return Ok(tx.base().version());
    }
    tx.replace_tiles::<EvidenceRow>(&tiles([1, 2]), rows(3, tile(2), 4))?;
    tx.append::<ChunkRow>(rows(2, tile(0), 2))?;
    tx.replace_tiles::<LayerHeader>(&tiles([1, 2]), rows(2, tile(2), 1))?;
    tx.commit("run", parameters())
}

fn digests(store: &Store) -> Result<(i64, [String; 3]), StoreError> {
    let snapshot = store.snapshot(None)?;
    let digests = [
        snapshot.digest::<EvidenceRow>()?,
        snapshot.digest::<ChunkRow>()?,
        snapshot.digest::<LayerHeader>()?,
    ];
    Ok((snapshot.version(), digests))
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

fn kill_at_every_operation(lost_reply: bool) {
    let scratch = TempDir::new().unwrap();
    let old = Store::create(scratch.path().join("old"), properties()).unwrap();
    first_job(&old).unwrap();
    let before = digests(&old).unwrap();
    let new = scratch.path().join("new");
    copy(Path::new(&old.location()), &new);
    let new = Store::open(new).unwrap();
    assert_eq!(second_job(&new).unwrap(), 2);
    let after = digests(&new).unwrap();

    for operations in 0.. {
        let folder = scratch.path().join(format!("killed at {operations}"));
        copy(Path::new(&old.location()), &folder);
        let fuse = Fuse::new(operations, lost_reply);
        let done = place(&folder, &fuse)
            .and_then(Store::open_at)
            .and_then(|store| second_job(&store));
        let fired = fuse.refused.load(Ordering::SeqCst) > 0;
        assert!(
            done.is_ok() || fired,
            "operation {operations}: {:?}",
            done.err()
        );

        let store = Store::open(&folder).unwrap();
        let found = digests(&store).unwrap();
        assert!(
            found == before || found == after,
            "between versions after operation {operations}"
        );
        assert!(
            done.is_err() || found == after,
            "operation {operations} was lost"
        );
        assert_eq!(second_job(&store).unwrap(), 2);
        assert_eq!(digests(&store).unwrap(), after, "operation {operations}");
        std::fs::remove_dir_all(&folder).unwrap();
        if !fired {
            assert!(operations > 20, "the job took {operations} operations only");
            return;
        }
    }
}

#[test]
fn a_job_killed_at_any_operation_leaves_the_old_version_or_the_new_one() {
    kill_at_every_operation(false);
}

#[test]
fn a_job_whose_last_reply_was_lost_leaves_the_old_version_or_the_new_one() {
    kill_at_every_operation(true);
}

#[test]
fn a_creation_killed_at_any_operation_can_be_finished() {
    let scratch = TempDir::new().unwrap();
    for operations in 0.. {
        let folder = scratch.path().join(format!("killed at {operations}"));
        std::fs::create_dir(&folder).unwrap();
        let fuse = Fuse::new(operations, false);
        let done = place(&folder, &fuse).and_then(|place| Store::create_at(place, &properties()));
        let fired = fuse.refused.load(Ordering::SeqCst) > 0;
        match Store::open(&folder) {
            Ok(_) => {}
            Err(StoreError::NotAStore { .. }) => {
                assert!(done.is_err());
                Store::create(&folder, properties()).unwrap();
            }
            Err(error) => panic!("operation {operations}: {error}"),
        }
        assert_eq!(first_job(&Store::open(&folder).unwrap()).unwrap(), 1);
        if !fired {
            return;
        }
    }
}

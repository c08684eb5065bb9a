//! Flipped bytes, missing files, other formats: an error that names the file, or the right rows.

use std::fs;
use std::path::{Path, PathBuf};

use tilefold_schemas::{EvidenceRow, LayerHeader};

use super::rows::{parameters, rows, store, tile, tiles};
use crate::properties::FORMAT_VERSION;
use crate::{Store, StoreError, TileFilter};

fn filled() -> (tempfile::TempDir, Store) {
    let (folder, store) = store();
    let mut tx = store.begin().unwrap();
    tx.append::<EvidenceRow>(rows(1, tile(1), 20)).unwrap();
    tx.append::<EvidenceRow>(rows(2, tile(600), 20)).unwrap();
    tx.replace_tiles::<LayerHeader>(&tiles([1]), rows(1, tile(1), 1))
        .unwrap();
    tx.commit("run", parameters()).unwrap();
    (folder, store)
}

type Content = (Vec<EvidenceRow>, Vec<EvidenceRow>, Vec<LayerHeader>, String);

fn content(location: &str) -> Result<Content, StoreError> {
    let store = Store::open(location)?;
    let snapshot = store.snapshot(None)?;
    Ok((
        snapshot.read(TileFilter::All)?,
        snapshot.read(TileFilter::Tiles(&tiles([600])))?,
        snapshot.read(TileFilter::All)?,
        format!("{:?}", store.properties()),
    ))
}

fn file_in(folder: &str, ending: &str) -> PathBuf {
    let mut found: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.to_str().unwrap().ends_with(ending))
        .collect();
    found.sort();
    found.pop().unwrap()
}

/// Flips bits of every `stride`-th byte, one at a time; counts the flips that were noticed.
fn flip(location: &str, file: &Path, stride: usize) -> (usize, usize) {
    let sound = content(location).unwrap();
    let bytes = fs::read(file).unwrap();
    let (mut noticed, mut harmless) = (0, 0);
    for at in (0..bytes.len()).step_by(stride) {
        let mut flipped = bytes.clone();
        flipped[at] ^= 1 << (at % 8);
        fs::write(file, &flipped).unwrap();
        match content(location) {
            Ok(read) => {
                assert_eq!(
                    read,
                    sound,
                    "byte {at} of {} gave wrong rows",
                    file.display()
                );
                harmless += 1;
            }
            Err(_) => noticed += 1,
        }
    }
    fs::write(file, &bytes).unwrap();
    assert_eq!(content(location).unwrap(), sound);
    (noticed, harmless)
}

#[test]
fn a_flipped_byte_in_a_data_file_is_always_noticed() {
    let (_folder, store) = filled();
    let file = file_in(&format!("{}/evidence", store.location()), ".parquet");
    let (noticed, harmless) = flip(&store.location(), &file, 97);
    assert!(noticed > 50, "{noticed}");
    assert_eq!(harmless, 0);
}

#[test]
fn a_damaged_data_file_is_named() {
    let (_folder, store) = filled();
    let file = file_in(&format!("{}/evidence", store.location()), ".parquet");
    let mut bytes = fs::read(&file).unwrap();
    bytes[100] ^= 1;
    fs::write(&file, &bytes).unwrap();
    let error = content(&store.location()).unwrap_err().to_string();
    assert!(error.contains(file.to_str().unwrap()), "{error}");
    assert!(error.contains("damaged"), "{error}");
    fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    assert!(matches!(
        content(&store.location()),
        Err(StoreError::Damaged { .. })
    ));
    fs::remove_file(&file).unwrap();
    assert!(matches!(
        content(&store.location()),
        Err(StoreError::Damaged { .. })
    ));
}

#[test]
fn writing_the_same_rows_again_mends_a_damaged_file() {
    let (_folder, store) = filled();
    let before = content(&store.location()).unwrap();
    let file = file_in(&format!("{}/layers", store.location()), ".parquet");
    fs::write(&file, b"torn").unwrap();
    assert!(content(&store.location()).is_err());
    let mut tx = store.begin().unwrap();
    tx.overwrite::<LayerHeader>(rows(1, tile(1), 1)).unwrap();
    tx.commit("run", parameters()).unwrap();
    assert_eq!(content(&store.location()).unwrap(), before);
}

#[test]
fn a_flipped_byte_in_a_log_is_noticed_or_harmless() {
    let (_folder, store) = filled();
    for table in ["evidence", "layers"] {
        let file = file_in(
            &format!("{}/{table}/_delta_log", store.location()),
            "1.json",
        );
        let (noticed, _) = flip(&store.location(), &file, 11);
        assert!(noticed > 20, "{table}: {noticed}");
    }
}

#[test]
fn a_flipped_byte_in_the_properties_is_noticed() {
    let (_folder, store) = filled();
    let file = Path::new(&store.location()).join("tilefold.json");
    let (noticed, harmless) = flip(&store.location(), &file, 1);
    assert!(noticed > 100);
    assert_eq!(harmless, 0);
}

#[test]
fn formats_of_the_future_are_refused_in_a_sentence() {
    let (_folder, store) = filled();
    let file = Path::new(&store.location()).join("tilefold.json");
    let text = fs::read_to_string(&file).unwrap();
    for (version, word) in [(FORMAT_VERSION + 1, "newer"), (1, "anew")] {
        let other = text.replace(
            &format!("\"format_version\": {FORMAT_VERSION}"),
            &format!("\"format_version\": {version}"),
        );
        fs::write(&file, other).unwrap();
        let error = Store::open(store.location()).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn a_folder_without_a_store_is_refused() {
    let folder = tempfile::TempDir::new().unwrap();
    for path in [folder.path().to_owned(), folder.path().join("nowhere")] {
        let refused = Store::open(path);
        assert!(matches!(refused, Err(StoreError::NotAStore { .. })));
    }
    assert!(matches!(
        Store::open("gopher://x/y"),
        Err(StoreError::Location { .. })
    ));
}

//! The page as a folder that opens without a server.
//!
//! A page that was opened from a file may not read other files, but it may run scripts that lie
//! beside it: every document is a script that hands its value to the page. Explanations lie
//! together by tile, and are there for the version that the page opens with.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::assets::{self, Mode};
use crate::decision::Decisions;
use crate::documents::{Review, Version};
use crate::error::ReviewError;

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FolderReport {
    /// The page to open.
    pub page: PathBuf,
    /// Versions in it.
    pub versions: usize,
    /// Records of the version that it opens with.
    pub records: usize,
    /// Claims whose explanations are in it.
    pub explained: usize,
    /// Tiles of the map.
    pub map_tiles: usize,
}

/// Writes the page and its data into `folder`, which is made if need be.
///
/// # Errors
/// The store cannot be read, a file not be written, or the program has no map library.
pub fn write_folder(
    review: &Review,
    decisions: &Decisions,
    folder: &Path,
) -> Result<FolderReport, ReviewError> {
    let library = assets::library()?;
    let out = Out { folder };
    out.write("index.html", assets::page(Mode::Folder).as_bytes())?;
    for asset in assets::OURS.iter().chain(library) {
        if asset.path == assets::WORKER {
            let text = String::from_utf8_lossy(asset.bytes);
            out.give("maplibre/worker-text.js", "worker", &text)?;
        } else {
            out.write(asset.path, asset.bytes)?;
        }
    }
    let index = review.index()?;
    let index_json = serde_json::to_value(&index)?;
    let first = index_json["version"].as_i64().unwrap_or_default();
    out.give("data/index.js", "index", &index)?;
    let said: Vec<_> = decisions.all().collect();
    out.give("data/decisions.js", "decisions", &said)?;
    for shown in &index.versions {
        let version = review.version(shown.version)?;
        let number = shown.version;
        for (name, json) in [
            ("versions", version.layer()?),
            ("coverage", version.coverage()?),
        ] {
            let key = format!("{name}/{number}");
            out.give_json(&format!("data/{key}.js"), &key, &json)?;
        }
    }
    let version = review.version(first)?;
    let (explained, records) = write_explanations(&out, &version, first)?;
    Ok(FolderReport {
        page: folder.join("index.html"),
        versions: index.versions.len(),
        records,
        explained,
        map_tiles: write_maps(&out, review, index.versions.iter().map(|shown| &shown.map))?,
    })
}

fn write_explanations(
    out: &Out<'_>,
    version: &Version,
    number: i64,
) -> Result<(usize, usize), ReviewError> {
    let (claims, records) = version.claims()?;
    let mut count = 0;
    for (tile, changes) in &claims {
        let mut by_change = BTreeMap::new();
        for change in changes {
            if let Some(told) = version.explain(change)? {
                by_change.insert(change, told);
            }
        }
        count += by_change.len();
        let key = format!("explain/{number}/{}", tile.0);
        out.give(&format!("data/{key}.js"), &key, &by_change)?;
    }
    Ok((count, records))
}

fn write_maps<'a>(
    out: &Out<'_>,
    review: &Review,
    keys: impl Iterator<Item = &'a String>,
) -> Result<usize, ReviewError> {
    let mut count = 0;
    for key in keys.collect::<BTreeSet<_>>() {
        let Some(tiles) = review.map(key)? else {
            continue;
        };
        for (zoom, column, row) in tiles.addresses() {
            if let Some(tile) = tiles.tile(zoom, column, row) {
                let name = format!("map/{key}/{zoom}/{column}/{row}");
                out.give(&format!("data/{name}.js"), &name, &base64(&tile))?;
                count += 1;
            }
        }
    }
    Ok(count)
}

/// The folder that is written.
struct Out<'a> {
    folder: &'a Path,
}

impl Out<'_> {
    fn write(&self, path: &str, bytes: &[u8]) -> Result<(), ReviewError> {
        let path = self.folder.join(path);
        let unwritten = |source| ReviewError::File {
            path: path.clone(),
            source,
        };
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(unwritten)?;
        }
        fs::write(&path, bytes).map_err(unwritten)
    }

    /// A script that hands a value to the page.
    fn give(
        &self,
        path: &str,
        key: &str,
        value: &(impl Serialize + ?Sized),
    ) -> Result<(), ReviewError> {
        self.give_json(path, key, &serde_json::to_vec(value)?)
    }

    fn give_json(&self, path: &str, key: &str, json: &[u8]) -> Result<(), ReviewError> {
        let key = serde_json::to_string(key)?;
        let mut script = format!("tilefold.give({key},").into_bytes();
        script.extend(json);
        script.extend(b");\n");
        self.write(path, &script)
    }
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let byte = |index: usize| u32::from(three.get(index).copied().unwrap_or(0));
        let all = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            let is_there = digit <= three.len();
            let value = (all >> (18 - 6 * digit)) & 63;
            text.push(if is_there {
                char::from(DIGITS[value as usize])
            } else {
                '='
            });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        // RFC 4648, section 10.
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }
}

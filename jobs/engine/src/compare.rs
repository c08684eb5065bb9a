//! `compare`: what differs between two maps, or between two versions of a store.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use serde::Serialize;
use tilefold_formats::map::{self, LocalFrames, MapFormat};
use tilefold_formats::map_compare::{Class, Comparable, Difference, How};
use tilefold_formats::map_patch::OsmText;
use tilefold_schemas::{ChangeRecord, LayerHeader, SetAside, TileId, Verdict};
use tilefold_store::{Snapshot, TileFilter};

use crate::error::EngineError;

/// What differs between two maps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MapComparison {
    /// How often each kind of thing differs, and how: `way retyped`.
    pub counts: BTreeMap<String, usize>,
    /// The longest way that something moved, metres; null where nothing did.
    pub farthest_m: Option<f64>,
    /// Every difference, in the order of kind and id.
    pub differences: Vec<MapDifference>,
    /// What of either map could not be read.
    pub set_aside: Vec<SetAside>,
}

/// One difference between two maps.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MapDifference {
    /// `node`, `way`, `relation` or `element`.
    pub class: &'static str,
    /// Its id; that in the second map if it is only there.
    pub id: i64,
    /// Its type and subtype.
    pub kind: String,
    /// `added`, `removed`, `moved`, `retyped`, `retagged`, `renumbered` or `rewired`.
    pub how: &'static str,
    /// How far it moved, metres.
    pub moved_m: Option<f64>,
    /// Its id in the second map, where that is another.
    pub new_id: Option<i64>,
    /// Which tags or members differ.
    pub detail: Option<String>,
}

/// Compares two map files; what lies within `tolerance_m` is in the same place.
///
/// # Errors
/// One of them is no map.
pub fn compare_maps(a: &Path, b: &Path, tolerance_m: f64) -> Result<MapComparison, EngineError> {
    let [(a, is_a_osm), (b, is_b_osm)] = [read(a)?, read(b)?];
    let sides = match is_a_osm.zip(is_b_osm) {
        Some((a, b)) => [Comparable::osm(&a), Comparable::osm(&b)],
        None => [Comparable::elements(&a), Comparable::elements(&b)],
    };
    let differences = sides[0].differences(&sides[1], tolerance_m);
    let mut counts = BTreeMap::new();
    for difference in &differences {
        let name = format!("{} {}", difference.class.name(), difference.how.name());
        *counts.entry(name).or_default() += 1;
    }
    let moved = differences.iter().filter_map(moved_m);
    Ok(MapComparison {
        counts,
        farthest_m: moved.reduce(f64::max),
        differences: differences.into_iter().map(told).collect(),
        set_aside: [a.set_aside, b.set_aside].concat(),
    })
}

/// A map, and its text if it is OSM.
fn read(path: &Path) -> Result<(map::MapFile, Option<OsmText>), EngineError> {
    let read = map::read(path)?;
    if read.format != MapFormat::Lanelet2 {
        return Ok((read, None));
    }
    let name = path.display().to_string();
    let bytes = std::fs::read(path).map_err(|source| map::MapError::Io {
        file: name.clone(),
        source,
    })?;
    let text = OsmText::read(bytes, &name)?;
    Ok((read, Some(text.located(&mut LocalFrames::beside(path)))))
}

fn moved_m(difference: &Difference) -> Option<f64> {
    match difference.how {
        How::Moved(metres) if metres.is_finite() => Some(metres),
        _ => None,
    }
}

fn told(difference: Difference) -> MapDifference {
    MapDifference {
        class: Class::name(difference.class),
        id: difference.id,
        kind: difference.kind.clone(),
        how: difference.how.name(),
        moved_m: moved_m(&difference),
        new_id: match difference.how {
            How::Renumbered(id) => Some(id),
            _ => None,
        },
        detail: match difference.how {
            How::Retyped(tags) | How::Retagged(tags) => Some(tags),
            How::Rewired(lost, gained) => Some(format!("{lost} members less, {gained} more")),
            _ => None,
        },
    }
}

/// What differs between two versions of a store.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VersionComparison {
    /// The first version.
    pub from: i64,
    /// The second.
    pub to: i64,
    /// Tiles whose layers are the same, by their digests.
    pub same_tiles: usize,
    /// Tiles whose layers differ, in the order of their ids.
    pub tiles: Vec<TileComparison>,
}

/// What differs in one tile.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TileComparison {
    /// The tile.
    pub tile: i32,
    /// Digest in the first version; null where it has no layer.
    pub from_digest: Option<String>,
    /// Digest in the second.
    pub to_digest: Option<String>,
    /// Records that say something else, in the order of their ids.
    pub records: Vec<RecordComparison>,
    /// Records with the same verdict of which some number differs.
    pub renumbered: usize,
}

/// A record with another verdict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordComparison {
    /// The change.
    pub change: String,
    /// Its element.
    pub element_id: Option<i64>,
    /// What the first version says; null where it has no such record.
    pub from: Option<&'static str>,
    /// What the second says.
    pub to: Option<&'static str>,
    /// Posterior of change in the second version, or in the first where the second has none.
    pub p_change: f64,
}

/// Compares the layers of two versions.
///
/// # Errors
/// The store cannot be read.
pub fn compare_versions(from: &Snapshot, to: &Snapshot) -> Result<VersionComparison, EngineError> {
    let [old, new] = [digests(from)?, digests(to)?];
    let tiles: BTreeSet<i32> = old.keys().chain(new.keys()).copied().collect();
    let differing: BTreeSet<TileId> = tiles
        .iter()
        .filter(|tile| old.get(tile) != new.get(tile))
        .map(|tile| TileId(*tile))
        .collect();
    let [before, after] = [records(from, &differing)?, records(to, &differing)?];
    let compared = differing.iter().map(|&TileId(tile)| {
        let none = BTreeMap::new();
        let [before, after] = [&before, &after].map(|side| side.get(&tile).unwrap_or(&none));
        let (records, renumbered) = compare_records(before, after);
        TileComparison {
            tile,
            from_digest: old.get(&tile).cloned(),
            to_digest: new.get(&tile).cloned(),
            records,
            renumbered,
        }
    });
    Ok(VersionComparison {
        from: from.version(),
        to: to.version(),
        same_tiles: tiles.len() - differing.len(),
        tiles: compared.collect(),
    })
}

fn digests(snapshot: &Snapshot) -> Result<BTreeMap<i32, String>, EngineError> {
    let headers: Vec<LayerHeader> = snapshot.read(TileFilter::All)?;
    let pairs = headers.into_iter();
    Ok(pairs.map(|header| (header.tile, header.digest)).collect())
}

type ByChange = BTreeMap<i64, ChangeRecord>;

fn records(
    snapshot: &Snapshot,
    tiles: &BTreeSet<TileId>,
) -> Result<BTreeMap<i32, ByChange>, EngineError> {
    let rows: Vec<ChangeRecord> = snapshot.read(TileFilter::Tiles(tiles))?;
    let mut by_tile: BTreeMap<i32, ByChange> = BTreeMap::new();
    for row in rows {
        by_tile.entry(row.tile).or_default().insert(row.change, row);
    }
    Ok(by_tile)
}

fn compare_records(before: &ByChange, after: &ByChange) -> (Vec<RecordComparison>, usize) {
    let ids: BTreeSet<i64> = before.keys().chain(after.keys()).copied().collect();
    let mut renumbered = 0;
    let mut found = Vec::new();
    for id in ids {
        let [old, new] = [before.get(&id), after.get(&id)];
        let verdict = |record: Option<&ChangeRecord>| {
            let code = record.map(|record| record.verdict)?;
            Some(Verdict::from_code(code).map_or("unknown", Verdict::name))
        };
        let Some(record) = new.or(old) else { continue };
        let (from, to) = (verdict(old), verdict(new));
        if from == to {
            renumbered += usize::from(old != new);
            continue;
        }
        found.push(RecordComparison {
            change: format!("{id:016x}"),
            element_id: record.element,
            from,
            to,
            p_change: 1.0 - record.p_no_change,
        });
    }
    (found, renumbered)
}

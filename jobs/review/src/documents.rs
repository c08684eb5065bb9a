//! What the page asks for, made from a store: the list of versions, a version's layer, its
//! coverage, why a change is claimed, the map's tiles.
//!
//! A version never changes, so its documents are made once and kept; of the versions, the few that
//! were asked for last.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

use serde::Serialize;
use tilefold_engine::{Explainer, Explanation};
use tilefold_formats::export::{FIRST_ZOOM, MAX_ZOOM, MapTiles};
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{LayerHeader, TileId};
use tilefold_store::{Snapshot, Store, StoreError, TileFilter};

use crate::coverage::Coverage;
use crate::error::ReviewError;
use crate::layer::{Layer, Names, Subject};
use crate::once::Once;

/// Versions that are kept in memory.
const KEPT: usize = 4;
/// Versions that the page offers: the latest.
const OFFERED: usize = 200;

/// A store as the page sees it.
#[derive(Debug)]
pub struct Review {
    store: Store,
    /// The version that the page opens with; the latest if not given.
    first: Option<i64>,
    versions: Mutex<VecDeque<(i64, Arc<Version>)>>,
    tiles: Mutex<BTreeMap<String, Arc<Once<MapTiles>>>>,
}

/// A version, and what was made of it so far.
#[derive(Debug)]
pub(crate) struct Version {
    pub(crate) snapshot: Snapshot,
    layer: Once<ReadLayer>,
    coverage: Once<Coverage>,
    explainer: Once<Explainer>,
}

/// A layer, and what there is to decide on in it, by id.
#[derive(Debug)]
struct ReadLayer {
    layer: Layer,
    subjects: BTreeMap<String, Subject>,
}

/// The first document: what there is.
#[derive(Debug, Serialize)]
pub(crate) struct Index {
    title: String,
    /// The version to begin with.
    version: i64,
    pub(crate) versions: Vec<VersionShown>,
    names: Names,
    /// First and last zoom of the map's tiles.
    zooms: [u8; 2],
    /// West, south, east, north of the map, degrees.
    bounds: [f64; 4],
}

/// A version as the slider offers it.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct VersionShown {
    pub(crate) version: i64,
    timestamp_ms: i64,
    operation: String,
    /// Key of the map that the version is about.
    pub(crate) map: String,
}

impl Review {
    /// Looks at a store; the page opens with `version`, or with the latest one.
    ///
    /// # Errors
    /// The version does not exist, or has no layer.
    pub fn open(store: Store, version: Option<i64>) -> Result<Self, ReviewError> {
        let snapshot = store.snapshot(version)?;
        let headers: Vec<LayerHeader> = snapshot.read(TileFilter::All)?;
        if headers.is_empty() {
            return Err(ReviewError::NoLayers {
                location: store.location(),
                version: snapshot.version(),
            });
        }
        Ok(Self {
            store,
            first: version,
            versions: Mutex::default(),
            tiles: Mutex::default(),
        })
    }

    /// Where the store is.
    #[must_use]
    pub fn location(&self) -> String {
        self.store.location()
    }

    /// The versions with layers that can still be read, oldest first.
    fn offered(&self) -> Result<Vec<VersionShown>, ReviewError> {
        let mut versions = self.store.versions()?;
        versions.retain(|info| !matches!(info.operation.as_str(), "create" | "init"));
        let first = versions.len().saturating_sub(OFFERED);
        let oldest = self.oldest()?;
        let shown = versions
            .drain(first..)
            .filter(|info| info.version >= oldest);
        Ok(shown
            .map(|info| VersionShown {
                map: map_key(&info.pins),
                version: info.version,
                timestamp_ms: info.timestamp_ms,
                operation: info.operation,
            })
            .collect())
    }

    /// The first version that was not vacuumed.
    fn oldest(&self) -> Result<i64, ReviewError> {
        match self.store.snapshot(Some(0)) {
            Ok(_) => Ok(0),
            Err(StoreError::Vacuumed { oldest, .. }) => Ok(oldest),
            Err(error) => Err(error.into()),
        }
    }

    pub(crate) fn index(&self) -> Result<Index, ReviewError> {
        let versions = self.offered()?;
        let latest = versions.last().map_or(0, |shown| shown.version);
        let version = self.first.unwrap_or(latest);
        let location = self.store.location();
        Ok(Index {
            title: title(&location).to_owned(),
            version,
            versions,
            names: Names::all(),
            zooms: [FIRST_ZOOM, MAX_ZOOM],
            bounds: bounds(&self.version(version)?.snapshot)?,
        })
    }

    /// A version, opened if it is not.
    pub(crate) fn version(&self, version: i64) -> Result<Arc<Version>, ReviewError> {
        let mut kept = self.versions.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = kept.iter().position(|(number, _)| *number == version)
            && let Some(found) = kept.remove(at)
        {
            kept.push_front(found.clone());
            return Ok(found.1);
        }
        let opened = Arc::new(Version {
            snapshot: self.store.snapshot(Some(version))?,
            layer: Once::default(),
            coverage: Once::default(),
            explainer: Once::default(),
        });
        kept.push_front((version, Arc::clone(&opened)));
        kept.truncate(KEPT);
        Ok(opened)
    }

    /// The map of a key, cut into tiles; none where no version that is kept has it.
    pub(crate) fn map(&self, key: &str) -> Result<Option<Arc<MapTiles>>, ReviewError> {
        let Some(version) = self.with_map(key)? else {
            return Ok(None);
        };
        let once = {
            let mut kept = self.tiles.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(kept.entry(key.to_owned()).or_default())
        };
        let tiles = once.get(|| -> Result<MapTiles, ReviewError> {
            let elements: Vec<ElementRow> = version.snapshot.read(TileFilter::All)?;
            Ok(MapTiles::of(&elements)?)
        })?;
        Ok(Some(tiles))
    }

    /// A version whose map has that key.
    fn with_map(&self, key: &str) -> Result<Option<Arc<Version>>, ReviewError> {
        let has = |version: &Version| map_key(&version.snapshot.info().pins) == key;
        {
            let kept = self.versions.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((_, version)) = kept.iter().find(|(_, version)| has(version)) {
                return Ok(Some(Arc::clone(version)));
            }
        }
        let offered = self.offered()?;
        let shown = offered.iter().rev().find(|shown| shown.map == key);
        shown.map(|shown| self.version(shown.version)).transpose()
    }
}

impl Version {
    fn read_layer(&self) -> Result<Arc<ReadLayer>, ReviewError> {
        self.layer.get(|| {
            let layer = Layer::read(&self.snapshot)?;
            let subjects = layer.subjects();
            Ok(ReadLayer { layer, subjects })
        })
    }

    /// The layer, as JSON.
    pub(crate) fn layer(&self) -> Result<Vec<u8>, ReviewError> {
        Ok(serde_json::to_vec(&self.read_layer()?.layer)?)
    }

    /// What a change of the layer is.
    pub(crate) fn subject(&self, change: &str) -> Result<Option<Subject>, ReviewError> {
        Ok(self.read_layer()?.subjects.get(change).copied())
    }

    /// Ids of claims by tile, and the number of records in the layer.
    pub(crate) fn claims(&self) -> Result<(BTreeMap<TileId, Vec<String>>, usize), ReviewError> {
        let read = self.read_layer()?;
        let claims = read.layer.claims().into_iter();
        let owned = claims.map(|(tile, ids)| {
            let ids = ids.into_iter().map(str::to_owned).collect();
            (TileId(tile), ids)
        });
        Ok((owned.collect(), read.layer.len()))
    }

    /// Where vehicles looked, as JSON.
    pub(crate) fn coverage(&self) -> Result<Vec<u8>, ReviewError> {
        let coverage = self.coverage.get(|| Coverage::read(&self.snapshot))?;
        Ok(serde_json::to_vec(&*coverage)?)
    }

    /// Why a change is claimed.
    pub(crate) fn explain(&self, change: &str) -> Result<Option<Explanation>, ReviewError> {
        if self.subject(change)?.is_none() {
            return Ok(None);
        }
        let explainer = self.explainer.get(|| Explainer::read(&self.snapshot))?;
        let explained = explainer.explain(change)?;
        Ok(explained.into_iter().find(|told| told.change == change))
    }
}

/// The last two names of a location: the last alone often is `store`.
fn title(location: &str) -> &str {
    let location = location.trim_end_matches('/');
    let place = location.rmatch_indices('/').nth(1);
    place.map_or(location, |(at, _)| &location[at + 1..])
}

/// Names a map by the files that it lies in.
fn map_key(pins: &BTreeMap<String, tilefold_store::Pin>) -> String {
    let files = pins.get("elements").map_or("", |pin| pin.files.as_str());
    files
        .chars()
        .filter(char::is_ascii_hexdigit)
        .take(12)
        .collect()
}

fn bounds(snapshot: &Snapshot) -> Result<[f64; 4], ReviewError> {
    let elements: Vec<ElementRow> = snapshot.read(TileFilter::All)?;
    let corners = elements
        .iter()
        .map(|row| [row.xmin, row.ymin, row.xmax, row.ymax]);
    let all = corners.reduce(|a, b| {
        [
            a[0].min(b[0]),
            a[1].min(b[1]),
            a[2].max(b[2]),
            a[3].max(b[3]),
        ]
    });
    Ok(all.unwrap_or_default())
}

//! A Lanelet2 map in tiles, as Autoware divides it: `lanelet2_map_metadata.yaml` names the tiles, which
//! lie beside it or in the folder `lanelet2_map.osm` beside it.
//!
//! Tiles overlap: what crosses a border stands in both, whole. It counts once, and must be the same in
//! both. A tile that is not there refuses the map, because all of its paint would be "added".

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use tilefold_schemas::Element;

use super::plain_yaml::{self, Value};
use super::{MapError, MapFile, MapFormat, read_one};

/// The name that Autoware gives to the file.
pub const METADATA_FILE: &str = "lanelet2_map_metadata.yaml";

/// The folder of the tiles, which has the name of the map that it replaces.
const TILE_FOLDER: &str = "lanelet2_map.osm";

/// Keys that name no tile.
const RESOLUTIONS: [&str; 2] = ["x_resolution", "y_resolution"];

/// The metadata file that `path` is, or that lies in the folder `path` or beside it.
pub(super) fn metadata(path: &Path) -> Option<PathBuf> {
    if path.extension().is_some_and(|ending| ending == "yaml") {
        return Some(path.to_owned());
    }
    if !path.is_dir() {
        return None;
    }
    let beside = path.parent().map(|folder| folder.join(METADATA_FILE));
    let places = [Some(path.join(METADATA_FILE)), beside];
    places.into_iter().flatten().find(|file| file.is_file())
}

/// The files of all tiles.
pub(super) fn files(metadata: &Path) -> Result<Vec<PathBuf>, MapError> {
    let wrong = |what: String| MapError::Tiles {
        file: metadata.display().to_string(),
        what,
    };
    let names = names(metadata).map_err(wrong)?;
    let files = names.iter().map(|name| file(metadata, name).map_err(wrong));
    files.collect()
}

/// Reads all tiles as one map.
pub(super) fn read(metadata: &Path) -> Result<MapFile, MapError> {
    let wrong = |what: String| MapError::Tiles {
        file: metadata.display().to_string(),
        what,
    };
    let mut whole: Option<MapFile> = None;
    let mut elements: BTreeMap<i64, (Element, String)> = BTreeMap::new();
    for name in names(metadata).map_err(wrong)? {
        let mut tile = read_one(&file(metadata, &name).map_err(wrong)?)?;
        if tile.format != MapFormat::Lanelet2 {
            return Err(wrong(format!("its tile {name} is no Lanelet2 map")));
        }
        for element in std::mem::take(&mut tile.elements) {
            let id = element.id.0;
            match elements.get(&id) {
                Some((known, _)) if *known == element => {}
                Some((_, first)) => {
                    let what = format!("element {id} of tile {first} is another one in {name}");
                    return Err(wrong(what));
                }
                None => {
                    elements.insert(id, (element, name.clone()));
                }
            }
        }
        whole = Some(match whole {
            Some(whole) => joined(whole, tile),
            None => tile,
        });
    }
    let mut whole = whole.ok_or_else(|| wrong("it names no tile".to_owned()))?;
    whole.elements = elements.into_values().map(|(element, _)| element).collect();
    Ok(whole)
}

/// The tiles' names, in their order as texts.
fn names(metadata: &Path) -> Result<Vec<String>, String> {
    let yaml = plain_yaml::read(metadata)?;
    let tiles = yaml
        .into_iter()
        .filter(|(key, _)| !RESOLUTIONS.contains(&key.as_str()));
    tiles
        .map(|(name, corner)| match corner {
            Value::List(corner) if corner.len() == 2 => Ok(name),
            _ => Err(format!("{name:?} is no tile: NAME: [x, y] is meant")),
        })
        .collect()
}

/// Where a tile is. A name with a path in it could lead anywhere.
fn file(metadata: &Path, name: &str) -> Result<PathBuf, String> {
    if name.contains(['/', '\\']) || name == ".." {
        return Err(format!("the tile {name:?} has a path for a name"));
    }
    let folder = metadata.parent().unwrap_or(Path::new(""));
    let places = [folder.join(TILE_FOLDER).join(name), folder.join(name)];
    places
        .into_iter()
        .find(|file| file.is_file())
        .ok_or_else(|| format!("its tile {name} is neither in {TILE_FOLDER} nor beside it"))
}

/// Counts add up: what stands in two tiles is counted in both.
fn joined(mut whole: MapFile, tile: MapFile) -> MapFile {
    let (sum, more) = (&mut whole.counts, tile.counts);
    sum.nodes += more.nodes;
    sum.ways += more.ways;
    sum.relations += more.relations;
    sum.lanelets += more.lanelets;
    sum.areas += more.areas;
    sum.regulatory_elements += more.regulatory_elements;
    sum.deleted += more.deleted;
    for (kind, count) in tile.not_paint {
        *whole.not_paint.entry(kind).or_default() += count;
    }
    whole.set_aside.extend(tile.set_aside);
    whole
}

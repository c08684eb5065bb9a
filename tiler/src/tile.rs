//! Tiles: the NDS quadtree on WGS 84 (packed tile ids, `ndslive-math`).
//!
//! At level `L` (0 to 15) the earth is cut into `2^(L+1)` columns and `2^L` rows of equal degrees.
//! A tile owns its south and west border, not its north and east ones, so every point has exactly
//! one tile on every level, and the tile of a coarser level contains that of a finer one:
//! * longitudes are taken modulo 360, so 180 degrees is -180 degrees (the westernmost column);
//! * the north pole, which would be the border of a row that does not exist, belongs to the row
//!   below it.
//!
//! Borders are multiples of `360 / 2^(L+1)` degrees, which `f64` holds exactly for all levels.

use ndslive_math::PackedTileId;
use tilefold_schemas::TileId;

/// The finest level.
pub const MAX_LEVEL: u32 = 15;
/// The level that owns elements unless a job says otherwise.
pub const DEFAULT_LEVEL: u32 = 15;
/// Most tiles that [`tiles_in_bbox`] lists.
pub const MAX_TILES_IN_BBOX: u64 = 1 << 22;

/// A request that no tile answers.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TileError {
    /// A level that does not exist.
    #[error("tile level {level} does not exist: use 0 to {MAX_LEVEL}")]
    Level {
        /// The level.
        level: u32,
    },
    /// A longitude or latitude that is not a number, or a latitude beyond a pole.
    #[error(
        "position ({longitude_deg}, {latitude_deg}) is in no tile: a longitude is finite and a latitude lies in -90..=90; check the order (longitude first)"
    )]
    Position {
        /// Longitude, degrees.
        longitude_deg: f64,
        /// Latitude, degrees.
        latitude_deg: f64,
    },
    /// A number that is no packed tile id.
    #[error(
        "{id} is no packed tile id: ids of levels 0 to 14 are at least 65536, ids of level 15 are negative"
    )]
    Id {
        /// The number.
        id: i32,
    },
    /// A parent finer than its child.
    #[error(
        "tile {id} of level {level} has no parent at level {parent}: a parent is coarser (at most level {level})"
    )]
    NotCoarser {
        /// The tile.
        id: i32,
        /// Its level.
        level: u32,
        /// The level asked for.
        parent: u32,
    },
    /// South above north.
    #[error(
        "bounding box has its south ({south_deg}) above its north ({north_deg}): give west, south, east, north"
    )]
    UpsideDown {
        /// Southern border, degrees.
        south_deg: f64,
        /// Northern border, degrees.
        north_deg: f64,
    },
    /// A box of too many tiles.
    #[error(
        "bounding box covers {tiles} tiles of level {level}, at most {MAX_TILES_IN_BBOX} are listed: use a smaller box or a coarser level"
    )]
    TooMany {
        /// How many there are.
        tiles: u64,
        /// Of which level.
        level: u32,
    },
}

/// A rectangle in degrees; of a tile: south and west borders belong to it, north and east do not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Western border, degrees.
    pub west_deg: f64,
    /// Southern border, degrees.
    pub south_deg: f64,
    /// Eastern border, degrees; greater than the western one, so up to 180.
    pub east_deg: f64,
    /// Northern border, degrees.
    pub north_deg: f64,
}

impl Bounds {
    /// Whether the point lies inside, by the rule of ownership in the module's head.
    #[must_use]
    pub fn contains(&self, longitude_deg: f64, latitude_deg: f64) -> bool {
        let longitude_deg = wrap_longitude(longitude_deg);
        let top = latitude_deg == 90.0 && self.north_deg == 90.0;
        (self.west_deg..self.east_deg).contains(&longitude_deg)
            && ((self.south_deg..self.north_deg).contains(&latitude_deg) || top)
    }
}

/// The tile of `level` that owns the point.
///
/// # Errors
/// If there is no such level or the point is not on the earth.
///
/// ```
/// use tilefold_tiler::tile::{bounds, tile_of};
/// let tile = tile_of(8.4243, 49.0035, 15)?;
/// assert!(bounds(tile)?.contains(8.4243, 49.0035));
/// # Ok::<(), tilefold_tiler::tile::TileError>(())
/// ```
pub fn tile_of(longitude_deg: f64, latitude_deg: f64, level: u32) -> Result<TileId, TileError> {
    check_level(level)?;
    check_position(longitude_deg, latitude_deg)?;
    let column = index_of(wrap_longitude(longitude_deg), level);
    from_grid(column, row_of(latitude_deg, level), level)
}

/// The level of a tile.
///
/// # Errors
/// If the number is no packed tile id.
pub fn level_of(tile: TileId) -> Result<u32, TileError> {
    Ok(unpack(tile)?.level())
}

/// The borders of a tile, exact.
///
/// # Errors
/// If the number is no packed tile id.
pub fn bounds(tile: TileId) -> Result<Bounds, TileError> {
    let (column, row, level) = grid(tile)?;
    let side_deg = side_deg(level);
    // The one row of level 0 spans both hemispheres; its number is 0, not -1/2.
    let (south_deg, north_deg) = match level {
        0 => (-90.0, 90.0),
        _ => (row as f64 * side_deg, (row + 1) as f64 * side_deg),
    };
    Ok(Bounds {
        west_deg: column as f64 * side_deg,
        south_deg,
        east_deg: (column + 1) as f64 * side_deg,
        north_deg,
    })
}

/// The middle of a tile: `[longitude_deg, latitude_deg]`.
///
/// # Errors
/// If the number is no packed tile id.
pub fn centre(tile: TileId) -> Result<[f64; 2], TileError> {
    let bounds = bounds(tile)?;
    Ok([
        (bounds.west_deg + bounds.east_deg) / 2.0,
        (bounds.south_deg + bounds.north_deg) / 2.0,
    ])
}

/// The tile of the coarser (or same) `level` that contains this one.
///
/// # Errors
/// If the number is no packed tile id or `level` is finer than the tile's.
pub fn parent(tile: TileId, level: u32) -> Result<TileId, TileError> {
    let (column, row, own) = grid(tile)?;
    if level > own {
        return Err(TileError::NotCoarser {
            id: tile.0,
            level: own,
            parent: level,
        });
    }
    from_grid(column >> (own - level), row >> (own - level), level)
}

/// The tiles of the same level that share a border or a corner, in ascending order: eight, fewer
/// at the poles and on the coarsest levels. They wrap at the antimeridian, not over the poles.
///
/// # Errors
/// If the number is no packed tile id.
pub fn neighbours(tile: TileId) -> Result<Vec<TileId>, TileError> {
    let (column, row, level) = grid(tile)?;
    let mut around = Vec::with_capacity(8);
    for row in (row - 1).max(lowest_row(level))..=(row + 1).min(highest_row(level)) {
        for column in column - 1..=column + 1 {
            let other = from_grid(column, row, level)?;
            if other != tile {
                around.push(other);
            }
        }
    }
    around.sort_unstable();
    around.dedup();
    Ok(around)
}

/// All tiles of `level` that own a point of the closed box, in ascending order. A western border
/// east of the eastern one means a box across the antimeridian.
///
/// # Errors
/// If the level or a border does not exist, or there are more than [`MAX_TILES_IN_BBOX`].
pub fn tiles_in_bbox(bbox: &Bounds, level: u32) -> Result<Vec<TileId>, TileError> {
    check_level(level)?;
    check_position(bbox.west_deg, bbox.south_deg)?;
    check_position(bbox.east_deg, bbox.north_deg)?;
    if bbox.south_deg > bbox.north_deg {
        return Err(TileError::UpsideDown {
            south_deg: bbox.south_deg,
            north_deg: bbox.north_deg,
        });
    }
    let (first_column, columns) = columns_of(bbox, level);
    let first_row = row_of(bbox.south_deg, level);
    let last_row = row_of(bbox.north_deg, level);
    let tiles = columns.unsigned_abs() * (last_row - first_row + 1).unsigned_abs();
    if tiles > MAX_TILES_IN_BBOX {
        return Err(TileError::TooMany { tiles, level });
    }
    let mut inside = Vec::with_capacity(usize::try_from(tiles).unwrap_or(0));
    for row in first_row..=last_row {
        for column in first_column..first_column + columns {
            inside.push(from_grid(column, row, level)?);
        }
    }
    inside.sort_unstable();
    Ok(inside)
}

/// First column and number of columns of a box.
fn columns_of(bbox: &Bounds, level: u32) -> (i64, i64) {
    let all = 1_i64 << (level + 1);
    if bbox.east_deg - bbox.west_deg >= 360.0 {
        return (-all / 2, all);
    }
    let first = index_of(wrap_longitude(bbox.west_deg), level);
    let last = index_of(wrap_longitude(bbox.east_deg), level);
    let behind = wrap_longitude(bbox.east_deg) < wrap_longitude(bbox.west_deg);
    let last = if behind { last + all } else { last };
    (first, (last - first + 1).min(all))
}

fn check_level(level: u32) -> Result<(), TileError> {
    if level > MAX_LEVEL {
        return Err(TileError::Level { level });
    }
    Ok(())
}

fn check_position(longitude_deg: f64, latitude_deg: f64) -> Result<(), TileError> {
    if !longitude_deg.is_finite() || !(-90.0..=90.0).contains(&latitude_deg) {
        return Err(TileError::Position {
            longitude_deg,
            latitude_deg,
        });
    }
    Ok(())
}

/// A longitude in `-180..180`; what already is there stays untouched.
fn wrap_longitude(longitude_deg: f64) -> f64 {
    if (-180.0..180.0).contains(&longitude_deg) {
        return longitude_deg;
    }
    let wrapped_deg = (longitude_deg + 180.0).rem_euclid(360.0) - 180.0;
    if wrapped_deg >= 180.0 {
        -180.0
    } else {
        wrapped_deg
    }
}

/// Degrees along one side of a tile; exact.
fn side_deg(level: u32) -> f64 {
    180.0 / f64::from(1_u32 << level)
}

/// The signed column or row that owns an angle, counted from the prime meridian or the equator.
fn index_of(angle_deg: f64, level: u32) -> i64 {
    let side_deg = side_deg(level);
    let index = (angle_deg / side_deg).floor();
    // The division rounds; the borders do not.
    if angle_deg < index * side_deg {
        index as i64 - 1
    } else if angle_deg >= (index + 1.0) * side_deg {
        index as i64 + 1
    } else {
        index as i64
    }
}

fn row_of(latitude_deg: f64, level: u32) -> i64 {
    index_of(latitude_deg, level).clamp(lowest_row(level), highest_row(level))
}

fn highest_row(level: u32) -> i64 {
    ((1_i64 << level) / 2 - 1).max(0)
}

fn lowest_row(level: u32) -> i64 {
    -((1_i64 << level) / 2)
}

fn unpack(tile: TileId) -> Result<PackedTileId, TileError> {
    PackedTileId::new(tile.0).map_err(|_| TileError::Id { id: tile.0 })
}

/// Signed column, signed row and level.
fn grid(tile: TileId) -> Result<(i64, i64, u32), TileError> {
    let tile = unpack(tile)?;
    let level = tile.level();
    Ok((signed(tile.x(), level + 1), signed(tile.y(), level), level))
}

/// The tile at a signed column (wrapped around the earth) and a signed row.
fn from_grid(column: i64, row: i64, level: u32) -> Result<TileId, TileError> {
    let tile = PackedTileId::from_tile_xy(unsigned(column, level + 1), unsigned(row, level), level);
    tile.map(|tile| TileId(tile.value()))
        .map_err(|_| TileError::Level { level })
}

/// The `bits` lowest bits, as NDS numbers its grid (two's complement).
fn unsigned(index: i64, bits: u32) -> u32 {
    (index & ((1 << bits) - 1)) as u32
}

/// The inverse of [`unsigned`].
fn signed(index: u32, bits: u32) -> i64 {
    let index = i64::from(index);
    let half = (1_i64 << bits) / 2;
    if bits > 0 && index >= half {
        index - 2 * half
    } else {
        index
    }
}

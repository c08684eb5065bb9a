//! Tiles against the NDS.Live reference in Python (tests/oracles/geodesy.py), the ids that the NDS
//! documents print, and their properties.

use proptest::prelude::*;
use serde_json::Value;
use tilefold_schemas::TileId;
use tilefold_tiler::tile::{
    Bounds, TileError, bounds, centre, level_of, neighbours, parent, tile_of, tiles_in_bbox,
};

#[test]
fn ids_agree_with_the_reference() {
    let figures: Value =
        serde_json::from_str(include_str!("../../tests/oracles/geodesy.json")).unwrap();
    for row in figures["tiles"].as_array().unwrap() {
        let [lon, lat] = [0, 1].map(|i| row["at"][i].as_f64().unwrap());
        let level = row["level"].as_u64().unwrap() as u32;
        let tile = tile_of(lon, lat, level).unwrap();
        assert_eq!(i64::from(tile.0), row["id"].as_i64().unwrap(), "{row}");
        assert_eq!(level_of(tile).unwrap(), level);
        let bounds = bounds(tile).unwrap();
        if let Some(corner) = row["south_west"].as_array() {
            assert_eq!(bounds.west_deg, corner[0].as_f64().unwrap(), "{row}");
            assert_eq!(bounds.south_deg, corner[1].as_f64().unwrap(), "{row}");
        }
    }
}

/// From the NDS.Live developer documentation: the origin's tile on the levels that bound the id.
#[test]
fn ids_of_the_documents() {
    for (level, id) in [
        (0, 65_536),
        (1, 131_072),
        (13, 536_870_912),
        (14, 1_073_741_824),
    ] {
        assert_eq!(tile_of(0.0, 0.0, level).unwrap(), TileId(id));
    }
    assert_eq!(tile_of(0.0, 0.0, 15).unwrap(), TileId(i32::MIN));
    assert_eq!(tile_of(-1e-9, -1e-9, 15).unwrap(), TileId(-1));
}

#[test]
fn borders_and_poles_have_one_owner() {
    for level in 0..=15 {
        let east = tile_of(180.0, 10.0, level).unwrap();
        assert_eq!(east, tile_of(-180.0, 10.0, level).unwrap());
        assert_eq!(bounds(east).unwrap().west_deg, -180.0);
        let north = tile_of(10.0, 90.0, level).unwrap();
        assert_eq!(bounds(north).unwrap().north_deg, 90.0);
        let south = tile_of(10.0, -90.0, level).unwrap();
        assert_eq!(bounds(south).unwrap().south_deg, -90.0);
        assert_eq!(tile_of(370.0, 0.0, level), tile_of(10.0, 0.0, level));
        assert_eq!(tile_of(-1e-20, 5.0, level), tile_of(-1e-9, 5.0, level));
    }
    let tile = tile_of(8.4243, 49.0035, 15).unwrap();
    let b = bounds(tile).unwrap();
    assert_eq!(tile_of(b.west_deg, b.south_deg, 15).unwrap(), tile);
    assert_ne!(tile_of(b.east_deg, b.south_deg, 15).unwrap(), tile);
    assert_eq!(
        tile_of(b.east_deg.next_down(), b.north_deg.next_down(), 15),
        Ok(tile)
    );
}

#[test]
fn neighbours_wrap_around_the_earth_but_not_over_the_poles() {
    let west = tile_of(-180.0, 10.0, 15).unwrap();
    let east = tile_of(179.9999, 10.0, 15).unwrap();
    assert!(neighbours(west).unwrap().contains(&east));
    assert_eq!(neighbours(west).unwrap().len(), 8);
    assert_eq!(
        neighbours(tile_of(0.0, 90.0, 15).unwrap()).unwrap().len(),
        5
    );
    assert_eq!(neighbours(tile_of(0.0, 0.0, 0).unwrap()).unwrap().len(), 1);
}

#[test]
fn boxes_are_closed_and_cross_the_antimeridian() {
    let b = bounds(tile_of(8.4243, 49.0035, 15).unwrap()).unwrap();
    let inside = Bounds {
        east_deg: b.east_deg.next_down(),
        north_deg: b.north_deg.next_down(),
        ..b
    };
    assert_eq!(tiles_in_bbox(&inside, 15).unwrap().len(), 1);
    assert_eq!(tiles_in_bbox(&b, 15).unwrap().len(), 4);
    let across = Bounds {
        west_deg: 179.9999,
        south_deg: 1.0,
        east_deg: -179.9999,
        north_deg: 1.0,
    };
    assert_eq!(tiles_in_bbox(&across, 15).unwrap().len(), 2);
    let earth = Bounds {
        west_deg: -180.0,
        south_deg: -90.0,
        east_deg: 180.0,
        north_deg: 90.0,
    };
    assert_eq!(tiles_in_bbox(&earth, 0).unwrap().len(), 2);
    assert_eq!(tiles_in_bbox(&earth, 5).unwrap().len(), 64 * 32);
    assert!(matches!(
        tiles_in_bbox(&earth, 15),
        Err(TileError::TooMany {
            tiles: 0x8000_0000,
            level: 15
        })
    ));
}

#[test]
fn what_is_no_tile_is_an_error() {
    assert!(tile_of(f64::NAN, 0.0, 15).is_err());
    assert!(tile_of(0.0, f64::NAN, 15).is_err());
    assert!(tile_of(49.0, 120.0, 15).is_err());
    assert!(tile_of(f64::INFINITY, 0.0, 15).is_err());
    assert_eq!(tile_of(0.0, 0.0, 16), Err(TileError::Level { level: 16 }));
    for id in [0, 1, 65_535] {
        assert_eq!(level_of(TileId(id)), Err(TileError::Id { id }));
    }
    let coarse = tile_of(0.0, 0.0, 3).unwrap();
    assert!(matches!(
        parent(coarse, 4),
        Err(TileError::NotCoarser { .. })
    ));
}

fn point() -> impl Strategy<Value = (f64, f64)> {
    let border = (-32_768..=32_768_i32, -16_384..=16_384_i32)
        .prop_map(|(x, y)| (f64::from(x) * 45.0 / 8192.0, f64::from(y) * 45.0 / 8192.0));
    prop_oneof![(-180.0..=180.0_f64, -90.0..=90.0_f64), border]
}

proptest! {
    #[test]
    fn a_point_lies_in_its_tile_and_in_its_parents((lon, lat) in point(), level in 0..=15_u32, up in 0..=15_u32) {
        let tile = tile_of(lon, lat, level).unwrap();
        prop_assert!(bounds(tile).unwrap().contains(lon, lat));
        prop_assert_eq!(level_of(tile).unwrap(), level);
        let coarser = level.saturating_sub(up);
        let above = parent(tile, coarser).unwrap();
        prop_assert_eq!(above, tile_of(lon, lat, coarser).unwrap());
        let [inner, outer] = [bounds(tile).unwrap(), bounds(above).unwrap()];
        prop_assert!(outer.west_deg <= inner.west_deg && inner.east_deg <= outer.east_deg);
        prop_assert!(outer.south_deg <= inner.south_deg && inner.north_deg <= outer.north_deg);
        let [mid_lon, mid_lat] = centre(tile).unwrap();
        prop_assert_eq!(tile_of(mid_lon, mid_lat, level).unwrap(), tile);
    }

    #[test]
    fn neighbours_are_neighbours_of_each_other((lon, lat) in point(), level in 0..=15_u32) {
        let tile = tile_of(lon, lat, level).unwrap();
        for other in neighbours(tile).unwrap() {
            prop_assert_ne!(other, tile);
            prop_assert!(neighbours(other).unwrap().contains(&tile));
        }
    }

    #[test]
    fn a_box_lists_every_point_s_tile((lon, lat) in point(), width in 0.0..0.05_f64, height in 0.0..0.05_f64, x in 0.0..=1.0_f64, y in 0.0..=1.0_f64) {
        let north_deg = (lat + height).min(90.0);
        let bbox = Bounds { west_deg: lon, south_deg: lat, east_deg: lon + width, north_deg };
        let tiles = tiles_in_bbox(&bbox, 15).unwrap();
        let inside = tile_of(lon + x * width, lat + y * (north_deg - lat), 15).unwrap();
        prop_assert!(tiles.binary_search(&inside).is_ok());
    }

    #[test]
    fn no_number_panics(id in any::<i32>()) {
        let tile = TileId(id);
        if let Ok(bounds) = bounds(tile) {
            let back = tile_of(bounds.west_deg, bounds.south_deg.max(-90.0), level_of(tile).unwrap());
            prop_assert_eq!(back, Ok(tile));
        }
        let _ = neighbours(tile);
        let _ = parent(tile, 3);
    }
}

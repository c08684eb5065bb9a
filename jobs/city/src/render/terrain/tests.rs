use super::*;
use crate::random::Random;
use crate::world::Lane;
use tilefold_tiler::geodesy::LocalFrame;

fn lane(centre: Vec<Point>, is_junction: bool) -> Lane {
    Lane {
        centre,
        width_m: 3.0,
        speed_m_s: 10.0,
        next: Vec::new(),
        left: None,
        right: None,
        is_junction,
    }
}

/// A lane to the east, one that turns off to the north, and a kerb 2.5 m to the right of the first.
fn world() -> World {
    World {
        frame: LocalFrame::new([10.0, 50.0, 0.0]),
        relief: Arc::new(Relief::draw(&mut Random::new(4, "relief", 0))),
        paint: Vec::new(),
        lanes: vec![
            lane(vec![[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]], false),
            lane(vec![[50.0, 0.0, 0.0], [50.0, 40.0, 0.0]], true),
        ],
        kerbs: vec![vec![[0.0, -2.5, 0.0], [100.0, -2.5, 0.0]]],
        buildings: Vec::new(),
    }
}

#[test]
fn the_road_ends_at_kerbs_or_else_with_the_lanes() {
    let road = RoadTest::new(&world());
    let off_road_m = |east_m: f64, north_m: f64| road.off_road_m([east_m, north_m, 0.0]);
    assert!((off_road_m(20.0, -2.0) + 0.5).abs() < 1e-9);
    assert!((off_road_m(20.0, -3.0) - 0.5).abs() < 1e-9);
    assert!(off_road_m(20.0, 1.7) < 0.0 && off_road_m(20.0, 2.5) > 0.0);
    // Junction lanes are road; beside them it is not.
    assert!(off_road_m(50.0, 20.0) < 0.0 && off_road_m(56.0, 20.0) > 3.0);
    assert!(off_road_m(5_000.0, 0.0) > 30.0);
}

#[test]
fn tables_say_what_they_were_made_from() {
    let world = world();
    let terrain = Terrain::new(&world, Vec::new());
    let tiles = terrain.tiles(&[(0, 0, -1), (1, 0, -1)]);
    for (tile, side_m, tolerance_m) in [(&tiles[0], 32.0, 0.02), (&tiles[1], 128.0, 0.25)] {
        for step in 0..200_u32 {
            let share = [step % 14, step / 14].map(|part| f64::from(part) / 14.0);
            let place = [share[0] * side_m, (share[1] - 1.0) * side_m];
            let ground = tile.at(share[0] as f32, share[1] as f32);
            let height_m = world.relief.height_m(place);
            assert!((f64::from(ground.height_m) - height_m).abs() < 2e-3);
            let off_m = RoadTest::new(&world).off_road_m([place[0], place[1], 0.0]);
            let is_near = off_m.abs() < 2.0 && place[1] < -2.0;
            assert!(!is_near || (f64::from(ground.off_road_m) - off_m).abs() < tolerance_m);
        }
    }
}

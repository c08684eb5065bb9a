use super::*;
use crate::random::Random;
use crate::relief::Relief;
use crate::render::camera::Camera;
use crate::render::conditions::Conditions;
use crate::render::eye::Rays;
use crate::render::{Shot, Stage};
use crate::world::World;
use nalgebra::Isometry3;
use tilefold_tiler::geodesy::LocalFrame;

/// Where a ray first meets the hills, by small steps.
fn stepped(relief: &Relief, from: [f64; 3], to: [f64; 3]) -> Option<f64> {
    let above = |depth_m: f64| {
        let [x, y, z] = [0, 1, 2].map(|axis| from[axis] + to[axis] * depth_m);
        z - relief.height_m([x, y])
    };
    let step = (0..60_000).find(|&step| above(0.005 * f64::from(step)) < 0.0)?;
    Some(0.005 * f64::from(step))
}

#[test]
fn rays_meet_the_hills_where_small_steps_do() {
    let relief = Arc::new(Relief::draw(&mut Random::new(8, "relief", 0)));
    let world = World {
        frame: LocalFrame::new([10.0, 50.0, 0.0]),
        relief: Arc::clone(&relief),
        paint: Vec::new(),
        lanes: Vec::new(),
        kerbs: Vec::new(),
        buildings: Vec::new(),
    };
    let place = [1_234.0, -777.0];
    let pose = Isometry3::translation(place[0], place[1], relief.height_m(place));
    let shot = Shot {
        time_ns: 0,
        map_from_vehicle: [pose, pose],
        conditions: Conditions::plain(),
        traffic: &[],
    };
    let camera = Camera::ahead(160, 90, 1.2);
    let (stage, rays) = (Stage::new(&camera, &shot), Rays::new(&camera));
    let eye = stage.way.pose(0.0, 0.5);
    let terrain = Terrain::new(&world, Vec::new());
    let field = Field::new(&terrain, stage.origin, &eye, rays.widest_cos());
    let from = stage.eye(&eye);
    let (mut flat, mut steep) = (0, 0);
    for index in 0..160 * 90 / 7 {
        let to = eye.turn(rays.at(index * 7 % 160, index * 7 / 160));
        let direction = [to.x, to.y, to.z].map(f64::from);
        let Some(expected_m) = stepped(&relief, from, direction) else {
            continue;
        };
        let depth_m = field.cast(eye.at, to).map_or(f64::INFINITY, f64::from);
        let tolerance_m = 0.01 + 0.004 / f64::from(-to.z).max(0.003);
        assert!(
            (depth_m - expected_m).abs() < tolerance_m,
            "{depth_m} {expected_m} {to:?}"
        );
        *(if to.z > -0.05 { &mut flat } else { &mut steep }) += 1;
    }
    assert!(flat > 50 && steep > 500, "{flat} {steep}");
}

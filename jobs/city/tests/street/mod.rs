//! A bent street of four lanes and 400 m, with paint of every kind: the scene of the renderer's tests
//! and of the contact sheet. Its middle begins at the plane's origin, heading east.

#![allow(dead_code)] // Not every user needs all of it.

use std::sync::Arc;

use nalgebra::{Isometry3, UnitQuaternion};
use tilefold_city::render::TrafficVehicle;
use tilefold_city::{Building, Lane, Paint, Point, Relief, World};
use tilefold_schemas::element::{Color, ElementKind, Marking, SignClass};
use tilefold_tiler::geodesy::LocalFrame;

pub(crate) const LENGTH_M: f64 = 400.0;
const LANE_M: f64 = 3.4;
/// Between the outer lanes' borders and the kerbs, in metres.
const GUTTER_M: f64 = 0.45;
const CURVATURE: f64 = 1.0 / 650.0;
/// When the ghosts went.
pub(crate) const REPAINTED_NS: i64 = 1_000;
pub(crate) const NOW_NS: i64 = 2_000;

/// The point at a station, so far to the left of the middle.
pub(crate) fn point(station_m: f64, left_m: f64) -> Point {
    let turn = CURVATURE * station_m;
    let radius_m = 1.0 / CURVATURE - left_m;
    [
        radius_m * turn.sin(),
        1.0 / CURVATURE - radius_m * turn.cos(),
        0.0,
    ]
}

pub(crate) fn yaw_rad(station_m: f64) -> f64 {
    CURVATURE * station_m
}

/// The pose of something on the ground: roll, pitch (down) and the yaw of the street.
pub(crate) fn pose(station_m: f64, left_m: f64, roll: f64, pitch: f64) -> Isometry3<f64> {
    let at = point(station_m, left_m);
    let turned = UnitQuaternion::from_euler_angles(roll, pitch, yaw_rad(station_m));
    Isometry3::from_parts(nalgebra::Point3::from(at).into(), turned)
}

fn polyline(from_m: f64, to_m: f64, left_m: f64) -> Vec<Point> {
    let steps = ((to_m - from_m) / 4.0).ceil() as u32;
    let station = |step: u32| from_m + (to_m - from_m) * f64::from(step) / f64::from(steps);
    (0..=steps)
        .map(|step| point(station(step), left_m))
        .collect()
}

fn paint(id: i64, kind: ElementKind, points: Vec<Point>) -> Paint {
    Paint {
        id,
        kind,
        marking: Marking::Unknown,
        color: Color::White,
        sign: SignClass::Unknown,
        points,
        phase_m: 0.0,
        wear: 0.0,
        since_ns: i64::MIN,
        until_ns: i64::MAX,
    }
}

fn line(id: i64, marking: Marking, color: Color, from_m: f64, to_m: f64, left_m: f64) -> Paint {
    Paint {
        marking,
        color,
        ..paint(id, ElementKind::LaneMarking, polyline(from_m, to_m, left_m))
    }
}

/// Corners counter-clockwise from the rear right one; `is_back` for those who drive the other way.
fn corners(station_m: f64, left_m: f64, width_m: f64, length_m: f64, is_back: bool) -> Vec<Point> {
    let side = if is_back { -1.0 } else { 1.0 };
    let corner = |along: f64, left: f64| {
        point(
            station_m + side * along * length_m / 2.0,
            left_m + side * left * width_m / 2.0,
        )
    };
    vec![
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ]
}

fn sign(id: i64, class: SignClass, station_m: f64, left_m: f64, size_m: [f64; 2]) -> Paint {
    let [width_m, length_m] = size_m;
    Paint {
        sign: class,
        ..paint(
            id,
            ElementKind::GroundSign,
            corners(station_m, left_m, width_m, length_m, left_m > 0.0),
        )
    }
}

/// Lines alone, over the whole street: what is easy to measure. 2 and 4 are single and far from the
/// kerbs.
pub(crate) fn lines() -> Vec<Paint> {
    use Marking::{Dashed, Solid, SolidSolid};
    vec![
        line(1, Solid, Color::White, 0.0, LENGTH_M, 2.0 * LANE_M),
        line(2, Dashed, Color::White, 0.0, LENGTH_M, LANE_M),
        line(3, SolidSolid, Color::Yellow, 0.0, LENGTH_M, 0.0),
        line(4, Solid, Color::White, 0.0, LENGTH_M, -LANE_M),
        line(5, Solid, Color::White, 0.0, LENGTH_M, -2.0 * LANE_M),
    ]
}

/// Everything else.
fn rest() -> Vec<Paint> {
    use SignClass as S;
    let (inner, outer) = (-0.5 * LANE_M, -1.5 * LANE_M);
    let arrow = [0.9, 4.5];
    let mut all = vec![
        sign(20, S::StraightArrow, 30.0, inner, arrow),
        sign(21, S::StraightRightArrow, 30.0, outer, [1.3, 4.5]),
        sign(22, S::LeftArrow, 18.0, inner, [1.2, 4.0]),
        sign(23, S::RightArrow, 18.0, outer, [1.2, 4.0]),
        sign(24, S::StraightLeftArrow, 90.0, inner, [1.3, 4.5]),
        sign(25, S::SpeedLimit, 100.0, outer, [1.8, 3.2]),
        sign(26, S::BusLane, 120.0, outer, [2.4, 3.2]),
        sign(27, S::Slow, 112.0, inner, [2.4, 3.0]),
        sign(28, S::CycleLane, 135.0, outer, [1.2, 2.2]),
        sign(29, S::Diamond, 140.0, inner, [1.2, 3.6]),
        sign(30, S::BoxJunction, 56.0, 0.0, [13.0, 9.0]),
        sign(31, S::StraightArrow, 34.0, 0.5 * LANE_M, arrow),
        paint(
            40,
            ElementKind::Crosswalk,
            corners(46.0, 0.0, 13.4, 4.0, false),
        ),
        paint(
            41,
            ElementKind::StopLine,
            vec![point(42.0, -0.25), point(42.0, -2.0 * LANE_M + 0.1)],
        ),
    ];
    all[10].color = Color::Yellow;
    for (index, paint) in all.iter_mut().enumerate() {
        paint.wear = 0.06 * (index % 7) as f64;
    }
    all.push(Paint {
        until_ns: REPAINTED_NS,
        ..line(50, Marking::Solid, Color::White, 0.0, 80.0, -1.3 * LANE_M)
    });
    all.push(Paint {
        since_ns: 10 * NOW_NS,
        ..line(51, Marking::Solid, Color::White, 0.0, 80.0, -1.7 * LANE_M)
    });
    all
}

/// Lines in stretches with the other markings, worn here and there, and everything else.
pub(crate) fn all_paint() -> Vec<Paint> {
    use Marking::{Dashed, DashedDashed, DashedSolid, Solid, SolidDashed, SolidSolid};
    let mut all = Vec::new();
    // The crosswalk and the box are left out.
    let stretches = [
        (0.0, 42.0),
        (62.0, 150.0),
        (150.0, 250.0),
        (250.0, LENGTH_M),
    ];
    let middles = [SolidSolid, SolidDashed, DashedSolid, DashedDashed];
    for (index, ((from_m, to_m), middle)) in stretches.into_iter().zip(middles).enumerate() {
        let lines = [
            line(1, Solid, Color::White, from_m, to_m, 2.0 * LANE_M),
            line(2, Dashed, Color::White, from_m, to_m, LANE_M),
            line(3, middle, Color::Yellow, from_m, to_m, 0.0),
            line(4, Dashed, Color::White, from_m, to_m, -LANE_M),
            line(5, Solid, Color::White, from_m, to_m, -2.0 * LANE_M),
        ];
        all.extend(lines.into_iter().map(|line| Paint {
            id: line.id + 100 * index as i64,
            wear: 0.05 + 0.12 * ((line.id + index as i64) % 4) as f64,
            phase_m: from_m,
            ..line
        }));
    }
    all.extend(rest());
    all
}

fn lanes() -> Vec<Lane> {
    let offsets = [1.5, 0.5, -0.5, -1.5];
    let lanes = offsets.into_iter().map(|offset| {
        let mut centre = polyline(0.0, LENGTH_M, offset * LANE_M);
        if offset > 0.0 {
            centre.reverse();
        }
        Lane {
            centre,
            width_m: LANE_M,
            speed_m_s: 14.0,
            next: Vec::new(),
            left: None,
            right: None,
            is_junction: false,
        }
    });
    lanes.collect()
}

fn buildings() -> Vec<Building> {
    let mut buildings = Vec::new();
    let mut station_m = 5.0;
    for index in 0..26 {
        let length_m = 14.0 + 11.0 * f64::from(index * 7 % 5) / 4.0;
        station_m += length_m / 2.0;
        for side in [-1.0, 1.0] {
            let height_m = 7.0 + 3.1 * f64::from((index * 5 + if side > 0.0 { 3 } else { 0 }) % 6);
            let is_gap = (index + if side > 0.0 { 1 } else { 0 }) % 5 == 4;
            if !is_gap {
                buildings.push(Building {
                    at: point(station_m, side * (2.0 * LANE_M + 13.0)),
                    yaw_rad: yaw_rad(station_m),
                    size_m: [length_m - 0.3, 12.0, height_m],
                });
            }
        }
        station_m += length_m / 2.0 + if index % 3 == 2 { 6.0 } else { 0.0 };
    }
    buildings
}

/// The street with this paint.
pub(crate) fn world(paint: Vec<Paint>) -> World {
    let kerb_m = 2.0 * LANE_M + GUTTER_M;
    World {
        frame: LocalFrame::new([10.0, 50.0, 300.0]),
        relief: Arc::new(Relief::flat()),
        paint,
        lanes: lanes(),
        kerbs: [kerb_m, -kerb_m]
            .map(|left_m| polyline(0.0, LENGTH_M, left_m))
            .to_vec(),
        buildings: buildings(),
    }
}

/// Without what stands beside it: nothing hides the paint.
pub(crate) fn open_world(paint: Vec<Paint>) -> World {
    World {
        buildings: Vec::new(),
        ..world(paint)
    }
}

/// Vehicles on the street: every `every_m` of each lane one, but none within 7 m of the camera.
pub(crate) fn traffic(every_m: f64, camera_m: f64) -> Vec<TrafficVehicle> {
    let colors = [
        [0.55, 0.55, 0.56],
        [0.03, 0.03, 0.035],
        [0.35, 0.02, 0.02],
        [0.62, 0.62, 0.6],
        [0.03, 0.07, 0.22],
        [0.2, 0.21, 0.22],
        [0.7, 0.7, 0.68],
        [0.08, 0.14, 0.1],
    ];
    let sizes = [
        [4.5, 1.8, 1.46],
        [4.1, 1.75, 1.5],
        [4.8, 1.88, 1.68],
        [11.8, 2.5, 3.1],
        [4.4, 1.8, 1.45],
        [5.6, 2.0, 2.4],
        [4.7, 1.85, 1.44],
        [8.5, 2.4, 3.3],
    ];
    let mut traffic = Vec::new();
    for lane in 0..4_usize {
        let left_m = [1.5, 0.5, -0.5, -1.5][lane] * LANE_M;
        let mut station_m = 3.0 + 7.0 * lane as f64;
        let mut index = lane * 3;
        while station_m < LENGTH_M {
            let size_m = sizes[index % 8];
            let is_clear = lane != 2 || (station_m - camera_m).abs() > 9.0 + size_m[0] / 2.0;
            if is_clear {
                let turned = if left_m > 0.0 {
                    std::f64::consts::PI
                } else {
                    0.0
                };
                let pose = pose(station_m, left_m + 0.2 * (index as f64).sin(), 0.0, 0.0);
                traffic.push(TrafficVehicle {
                    map_from_vehicle: pose * UnitQuaternion::from_euler_angles(0.0, 0.0, turned),
                    size_m,
                    color: colors[(index * 5) % 8],
                    speed_m_s: 11.0,
                });
            }
            station_m += every_m * (0.7 + 0.15 * (index % 5) as f64);
            index += 1;
        }
    }
    traffic
}

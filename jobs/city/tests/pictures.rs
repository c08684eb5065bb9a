//! Pictures of the test street: the truth lies on the paint, and the same shot gives the same bytes.

#![allow(clippy::unwrap_used, clippy::panic)] // In a test, a panic is the report.

use tilefold_city::World;
use tilefold_city::render::{
    Camera, Category, Conditions, Frame, FrameTruth, Lens, PaintTruth, Renderer, Shot,
    TrafficVehicle, mounting,
};
use tilefold_schemas::element::{ElementKind, Marking};

mod street;

const STATION_M: f64 = 8.0;
const LEFT_M: f64 = -1.6;

fn camera(lens: Lens, k: [f64; 4]) -> Camera {
    Camera {
        lens,
        k,
        vehicle_from_camera: mounting([1.6, 0.1, 1.4], [0.02, 0.1, -0.03]),
        ..Camera::ahead(960, 540, 1.2)
    }
}

/// One camera of every lens model.
fn cameras() -> [Camera; 4] {
    let k = [690.0, 680.0, 483.0, 262.0];
    [
        camera(Lens::Pinhole, k),
        camera(Lens::PlumbBob([-0.31, 0.11, 0.0011, 0.0005, -0.018]), k),
        camera(
            Lens::RationalPolynomial([0.31, -0.12, 0.0011, -0.0007, 0.013, 0.68, -0.03, 0.02]),
            k,
        ),
        camera(
            Lens::KannalaBrandt([-0.021, 0.0043, -0.0017, 0.0002]),
            [330.0, 330.0, 479.5, 262.0],
        ),
    ]
}

fn shot<'a>(conditions: Conditions, traffic: &'a [TrafficVehicle]) -> Shot<'a> {
    let pose = street::pose(STATION_M, LEFT_M, 0.01, 0.008);
    Shot {
        time_ns: street::NOW_NS,
        map_from_vehicle: [pose, pose],
        conditions,
        traffic,
    }
}

fn plain(world: &World, camera: &Camera) -> Frame {
    Renderer::new(world).render(camera, &shot(Conditions::plain(), &[]), 1)
}

/// Brightness between pixels, 0 to 1, of the frame's green.
fn brightness(frame: &Frame, [x, y]: [f64; 2]) -> Option<f64> {
    let (x0, y0) = (x.floor(), y.floor());
    let inside = x0 >= 0.0
        && y0 >= 0.0
        && x0 + 1.0 < f64::from(frame.width_px)
        && y0 + 1.0 < f64::from(frame.height_px);
    if !inside {
        return None;
    }
    let at = |dx: usize, dy: usize| {
        let pixel = (y0 as usize + dy) * frame.width_px as usize + x0 as usize + dx;
        (f64::from(frame.rgb[pixel * 3 + 1]) / 255.0).powf(2.2)
    };
    let (sx, sy) = (x - x0, y - y0);
    let low = at(0, 0) * (1.0 - sx) + at(1, 0) * sx;
    let high = at(0, 1) * (1.0 - sx) + at(1, 1) * sx;
    Some(low * (1.0 - sy) + high * sy)
}

/// Points along a line, with the unit normals there.
fn along(line: &[[f64; 2]]) -> Vec<([f64; 2], [f64; 2])> {
    let mut points = Vec::new();
    for pair in line.windows(2) {
        let (dx, dy) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let length_px = dx.hypot(dy);
        for step in 0..(length_px / 2.0) as u32 {
            let share = 2.0 * f64::from(step) / length_px;
            let at = [pair[0][0] + dx * share, pair[0][1] + dy * share];
            points.push((at, [-dy / length_px, dx / length_px]));
        }
    }
    points
}

/// How far the middle of the bright stripe that crosses the normal lies from the point, in pixels;
/// none if there is no stripe, or it has no end.
fn stripe_px(frame: &Frame, at: [f64; 2], normal: [f64; 2]) -> Option<f64> {
    const STEP_PX: f64 = 0.05;
    let look = |step: i32| {
        let away = STEP_PX * f64::from(step);
        brightness(frame, [at[0] + normal[0] * away, at[1] + normal[1] * away])
    };
    let profile: Vec<f64> = (-500..=500).filter_map(look).collect();
    if profile.len() < 1_001 {
        return None;
    }
    let near = profile[480..=520].iter().copied().fold(0.0, f64::max);
    let road = profile.iter().copied().fold(f64::INFINITY, f64::min);
    if near < road + 0.03 {
        return None;
    }
    let level = (near + road) / 2.0;
    let middle = (480..=520).find(|&index| profile[index] >= level)?;
    let left = (0..middle).rev().find(|&index| profile[index] < level)?;
    let right = (middle..1_001).find(|&index| profile[index] < level)?;
    Some(((left + right) as f64 / 2.0 - 500.0) * STEP_PX)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Distances between the truth of single lines and the stripes in the picture. Lines beside a kerb
/// are left out: far away, the picture does not tell them from its stone.
fn misses_px(frame: &Frame) -> Vec<f64> {
    let singles = frame
        .truth
        .paint
        .iter()
        .filter(|paint| matches!(paint.id, 2 | 4));
    let lines = singles.flat_map(|paint| &paint.lines_px);
    let points = lines.flat_map(|line| along(line));
    points
        .filter_map(|(at, normal)| stripe_px(frame, at, normal))
        .map(f64::abs)
        .collect()
}

#[test]
fn the_truth_lies_on_the_paint_through_every_lens() {
    let world = street::open_world(street::lines());
    for camera in cameras() {
        let frame = plain(&world, &camera);
        let misses = misses_px(&frame);
        assert!(misses.len() > 200, "{:?}: {}", camera.lens, misses.len());
        let median_px = median(misses.clone());
        let far = misses.iter().filter(|&&miss| miss > 1.0).count() as f64 / misses.len() as f64;
        println!(
            "{:?}: median {median_px:.3} px of {}, {far:.3} beyond 1 px",
            camera.lens,
            misses.len()
        );
        assert!(median_px < 0.25, "{:?}: {median_px}", camera.lens);
        assert!(far < 0.03, "{:?}: {far}", camera.lens);
    }
}

#[test]
fn the_truth_of_a_rolling_shutter_lies_on_the_paint() {
    let world = street::open_world(street::lines());
    let camera = Camera {
        readout_s: 0.04,
        ..cameras()[1].clone()
    };
    // A pothole: pitching and rolling while the rows are read.
    let begin = street::pose(STATION_M, LEFT_M, 0.01, 0.0);
    let end = street::pose(STATION_M + 0.6, LEFT_M + 0.1, -0.01, 0.02);
    let moved = Shot {
        map_from_vehicle: [begin, end],
        ..shot(Conditions::plain(), &[])
    };
    let still = Shot {
        map_from_vehicle: [begin, begin],
        ..moved.clone()
    };
    let renderer = Renderer::new(&world);
    let frame = renderer.render(&camera, &moved, 1);
    let median_px = median(misses_px(&frame));
    assert!(median_px < 0.25, "{median_px}");
    // The shutter matters: the truth of a global one does not lie on this picture's paint.
    let wrong = Frame {
        truth: renderer.render(&camera, &still, 1).truth,
        ..frame
    };
    let wrong_px = median(misses_px(&wrong));
    assert!(wrong_px > 1.0, "{wrong_px}");
}

#[test]
fn the_same_shot_gives_the_same_bytes_with_any_number_of_threads() {
    let world = street::world(street::all_paint());
    let camera = Camera {
        readout_s: 0.02,
        ..Camera::ahead(320, 180, 1.2)
    };
    let traffic = street::traffic(25.0, STATION_M);
    for category in [Category::Rain, Category::Night] {
        let conditions = Conditions::draw(category, 0.0, 5);
        let take = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            pool.install(|| Renderer::new(&world).render(&camera, &shot(conditions, &traffic), 9))
        };
        let (one, three) = (take(1), take(3));
        assert!(one == three, "{category:?}");
        let renderer = Renderer::new(&world);
        let other = renderer.render(&camera, &shot(conditions, &traffic), 10);
        assert!(other.rgb != one.rgb, "noise is drawn by seed");
        // What was taken before does not matter.
        assert!(renderer.render(&camera, &shot(conditions, &traffic), 9) == one);
    }
}

fn truth(frame: &Frame, id: i64) -> Option<&PaintTruth> {
    frame.truth.paint.iter().find(|paint| paint.id == id)
}

#[test]
fn only_paint_that_is_there_is_drawn_and_told() {
    let world = street::open_world(street::all_paint());
    let frame = plain(&world, &cameras()[0]);
    assert!(truth(&frame, 5).is_some());
    assert_eq!((truth(&frame, 50), truth(&frame, 51)), (None, None));
    let kinds = |kind| {
        frame
            .truth
            .paint
            .iter()
            .filter(|paint| paint.kind == kind)
            .count()
    };
    assert_eq!(
        (kinds(ElementKind::Crosswalk), kinds(ElementKind::StopLine)),
        (1, 1)
    );
    assert!(kinds(ElementKind::GroundSign) >= 6);
    assert!(
        frame
            .truth
            .paint
            .iter()
            .any(|paint| paint.marking == Marking::SolidSolid)
    );
}

#[test]
fn ghosts_of_removed_paint_are_faint() {
    let bare = street::open_world(street::lines());
    let mut paint = street::lines();
    let mut ghost = street::all_paint()
        .into_iter()
        .find(|paint| paint.id == 50)
        .unwrap();
    paint.push(ghost.clone());
    let haunted = street::open_world(paint.clone());
    ghost.until_ns = i64::MAX;
    *paint.last_mut().unwrap() = ghost;
    let painted = street::open_world(paint);
    let camera = &cameras()[0];
    let [bare, haunted, painted] = [bare, haunted, painted].map(|world| plain(&world, camera));
    let change = |frame: &Frame| {
        let pairs = bare.rgb.iter().zip(&frame.rgb);
        pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>()
    };
    assert!(change(&haunted) > 0.0);
    assert!(change(&haunted) < 0.25 * change(&painted));
}

#[test]
fn a_truck_hides_the_line_behind_it() {
    let world = street::open_world(street::lines());
    let truck = TrafficVehicle {
        map_from_vehicle: street::pose(STATION_M + 14.0, -3.4, 0.0, 0.0),
        size_m: [8.0, 2.5, 3.4],
        color: [0.5, 0.5, 0.5],
        speed_m_s: 0.0,
    };
    let camera = &cameras()[0];
    let renderer = Renderer::new(&world);
    let traffic = [truck];
    let frame = renderer.render(camera, &shot(Conditions::plain(), &traffic), 1);
    let open = plain(&world, camera);
    let (hidden, free) = (truth(&frame, 4).unwrap(), truth(&open, 4).unwrap());
    assert_eq!(free.occluded_share, 0.0);
    assert!(hidden.occluded_share > 0.2, "{hidden:?}");
    assert!(hidden.visible_share < free.visible_share);
    assert_eq!(hidden.lines_px, free.lines_px);
    let [seen] = &frame.truth.vehicles[..] else {
        panic!("{:?}", frame.truth.vehicles)
    };
    let [left, top, right, bottom] = seen.box_px;
    let filled = f64::from(seen.visible_px) / ((right - left) * (bottom - top));
    assert!(filled > 0.7, "{filled}");
    assert!((seen.distance_m - 8.4).abs() < 1.0, "{}", seen.distance_m);
}

#[test]
fn boxes_hold_the_paint_of_signs() {
    let all = street::all_paint().into_iter();
    let signs: Vec<_> = all
        .filter(|paint| paint.kind != ElementKind::LaneMarking)
        .collect();
    let bare = plain(&street::open_world(Vec::new()), &cameras()[1]);
    for sign in signs {
        let frame = plain(&street::open_world(vec![sign.clone()]), &cameras()[1]);
        let Some(truth) = truth(&frame, sign.id) else {
            continue;
        };
        let [left, top, right, bottom] = truth.box_px.unwrap();
        let (mut inside, mut outside) = (0, 0);
        for (at, (a, b)) in bare.rgb.iter().zip(&frame.rgb).enumerate() {
            let pixel = at / 3;
            let (x, y) = ((pixel % 960) as f64, (pixel / 960) as f64);
            let is_in = x > left - 2.0 && x < right + 2.0 && y > top - 2.0 && y < bottom + 2.0;
            if a.abs_diff(*b) > 8 {
                *(if is_in { &mut inside } else { &mut outside }) += 1;
            }
        }
        assert!(
            inside > 0 && outside * 100 <= inside,
            "{:?}: {inside} {outside}",
            sign.sign
        );
    }
}

#[test]
fn the_truth_is_json_and_the_picture_a_jpeg() {
    let world = street::world(street::all_paint());
    let frame = plain(&world, &cameras()[2]);
    let json: serde_json::Value = serde_json::to_value::<&FrameTruth>(&frame.truth).unwrap();
    assert_eq!(json["width_px"], 960);
    assert_eq!(json["paint"][0]["kind"], "lane_marking");
    let jpeg = frame.jpeg(90).unwrap();
    assert_eq!(
        (&jpeg[..2], &jpeg[jpeg.len() - 2..]),
        (&[0xFF, 0xD8][..], &[0xFF, 0xD9][..])
    );
}

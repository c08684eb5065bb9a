//! How near the outline that is made of a paint's box comes to the paint itself, on the road.
//!
//! `cargo build --workspace --example outlines` and then `target/debug/examples/outlines LOG...`:
//! camera logs of a simulated city, with their `.frames.jsonl` of the truth in pixels. Boxes of the
//! truth stand for those of a network; both are cast onto flat ground through the calibration that
//! the log states. Paint that is cut off or hidden, or farther than 20 m, is left away.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use serde_json::Value;
use tilefold_formats::log::{ALL_TIME, LogIndex, LogReader};
use tilefold_schemas::ElementKind;
use tilefold_tiler::recording::Recording;
use tilefold_workers::areas::outline;
use tilefold_workers::camera::Camera;
use tilefold_workers::frames::FrameTree;
use tilefold_workers::surface::Surface;

/// Metres between the centres of the paint and of its outline, and between the box's own corners.
#[derive(Default)]
struct Apart {
    outline_m: Vec<f64>,
    box_m: Vec<f64>,
    width_share: Vec<f64>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut all: BTreeMap<String, Apart> = BTreeMap::new();
    for log in std::env::args().skip(1) {
        measure(Path::new(&log), &mut all)?;
    }
    println!(
        "class, paints, median and 90 % metres between centres of outline and paint, the same of the bare box, median width of the outline over the paint's"
    );
    for (class, apart) in &mut all {
        let (outline, bare) = (quantiles(&mut apart.outline_m), quantiles(&mut apart.box_m));
        let width = quantiles(&mut apart.width_share)[0];
        println!(
            "{class:22} {:5} {:.2} {:.2}  {:.2} {:.2}  {width:.2}",
            apart.outline_m.len(),
            outline[0],
            outline[1],
            bare[0],
            bare[1]
        );
    }
    Ok(())
}

fn quantiles(values: &mut [f64]) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [0.5, 0.9].map(|share| values[((values.len() - 1) as f64 * share) as usize])
}

fn camera(log: &Path) -> Result<Camera, Box<dyn Error>> {
    let mut recording = Recording::default();
    let index = LogIndex::open(log)?;
    LogReader::new().read(
        &index,
        |_, _| true,
        ALL_TIME,
        |message| recording.push(message),
    )?;
    recording.settle();
    let calibration = recording.calibrations.last().ok_or("no calibration")?;
    let tree = FrameTree::new(&recording.static_transforms);
    let mounting = tree
        .vehicle_from(&calibration.frame_id)
        .ok_or("no mounting")?;
    Ok(Camera::new(&calibration.value, mounting)?)
}

fn measure(log: &Path, all: &mut BTreeMap<String, Apart>) -> Result<(), Box<dyn Error>> {
    let camera = camera(log)?;
    let road = |pixel: [f64; 2]| {
        let [x, y, _] = camera.road_from_pixel(pixel, &Surface::FLAT)?;
        (3.0..=20.0).contains(&x).then_some([x, y])
    };
    for line in std::fs::read_to_string(log.with_extension("frames.jsonl"))?.lines() {
        let frame: Value = serde_json::from_str(line)?;
        for paint in frame["paint"].as_array().into_iter().flatten() {
            let kind = paint["kind"].as_str().and_then(ElementKind::from_name);
            let Some(kind) = kind.filter(|kind| *kind != ElementKind::LaneMarking) else {
                continue;
            };
            let Ok(edges) = serde_json::from_value::<[f64; 4]>(paint["box_px"].clone()) else {
                continue;
            };
            let is_whole = paint["visible_share"].as_f64() > Some(0.95)
                && edges[0] > 1.0
                && edges[2] < 638.0
                && edges[3] < 358.0;
            let points: Vec<[f64; 2]> = serde_json::from_value(paint["lines_px"][0].clone())?;
            let (Some(truth), Some(made), Some(bare)) = (
                points.into_iter().map(road).collect::<Option<Vec<_>>>(),
                outline::of(ElementKind::GroundSign, edges, Some(&camera)),
                outline::of(ElementKind::GroundSign, edges, None),
            ) else {
                continue;
            };
            let cast = |outline: Vec<[f64; 3]>| {
                outline
                    .into_iter()
                    .map(|[x, y, _]| road([x, y]))
                    .collect::<Option<Vec<_>>>()
            };
            let (Some(made), Some(bare)) = (cast(made), cast(bare)) else {
                continue;
            };
            if !is_whole {
                continue;
            }
            let name = match kind {
                ElementKind::GroundSign => paint["sign"].as_str().unwrap_or("sign").to_owned(),
                kind => kind.name().to_owned(),
            };
            let apart = all.entry(name).or_default();
            let distance = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
            apart
                .outline_m
                .push(distance(centre(&made), centre(&truth)));
            apart.box_m.push(distance(centre(&bare), centre(&truth)));
            apart.width_share.push(width(&made) / width(&truth));
        }
    }
    Ok(())
}

/// Middle of the bounding rectangle along the vehicle's axes.
fn centre(points: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|axis| {
        0.5 * (least(points, axis)
            - least(
                &points.iter().map(|p| [-p[0], -p[1]]).collect::<Vec<_>>(),
                axis,
            ))
    })
}

fn width(points: &[[f64; 2]]) -> f64 {
    -least(points, 1)
        - least(
            &points.iter().map(|p| [-p[0], -p[1]]).collect::<Vec<_>>(),
            1,
        )
}

fn least(points: &[[f64; 2]], axis: usize) -> f64 {
    points
        .iter()
        .map(|point| point[axis])
        .fold(f64::INFINITY, f64::min)
}

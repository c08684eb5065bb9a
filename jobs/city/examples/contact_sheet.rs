//! Renders the test street: a sheet of all categories, and a frame with its truth for every lens.
//!
//! `cargo run --release -p tilefold-city --example contact_sheet -- FOLDER [WIDTH]`
//!
//! With a width in pixels, frames are timed instead.

#![allow(clippy::unwrap_used)] // An example: a panic is the report.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use tilefold_city::World;
use tilefold_city::render::{
    Camera, Category, Conditions, Frame, Lens, Renderer, Shot, TrafficVehicle, mounting,
};

#[path = "../tests/street/mod.rs"]
mod street;

/// Where the camera vehicle is: station, and offset to the left.
const STATION_M: f64 = 8.0;
const LEFT_M: f64 = -1.75;
/// Frames that are timed.
const FRAMES: u32 = 12;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| ".".to_owned()));
    fs::create_dir_all(&folder).unwrap();
    let world = street::world(street::all_paint());
    if let Some(width_px) = arguments.next() {
        return time(&world, width_px.parse().unwrap());
    }
    sheet(&world, &folder);
    annotated(&world, &folder);
}

fn shot<'a>(
    conditions: Conditions,
    camera: &Camera,
    station_m: f64,
    traffic: &'a [TrafficVehicle],
) -> Shot<'a> {
    let whole_s = conditions.exposure_s + camera.readout_s;
    let pose = |at_m: f64| street::pose(at_m, LEFT_M, 0.004, 0.006);
    Shot {
        time_ns: street::NOW_NS,
        map_from_vehicle: [pose(station_m), pose(station_m + 12.0 * whole_s)],
        conditions,
        traffic,
    }
}

fn sheet(world: &World, folder: &Path) {
    let renderer = Renderer::new(world);
    let mut camera = Camera::ahead(640, 360, 1.15);
    camera.readout_s = 0.02;
    let mut sheet = vec![0; 640 * 3 * 360 * 3 * 3];
    for (index, category) in Category::ALL.into_iter().enumerate() {
        let every_m = if category == Category::Crowded {
            13.0
        } else {
            38.0
        };
        let station_m = STATION_M + 7.0 * index as f64 % 60.0;
        let traffic = street::traffic(every_m, station_m);
        let conditions = Conditions::draw(category, street::yaw_rad(station_m), 3);
        let frame = renderer.render(&camera, &shot(conditions, &camera, station_m, &traffic), 7);
        write_png(
            &folder.join(format!("{}.png", category.name())),
            640,
            360,
            &frame.rgb,
        );
        for (y, row) in frame.rgb.chunks_exact(640 * 3).enumerate() {
            let at = ((index / 3 * 360 + y) * 3 + index % 3) * 640 * 3;
            sheet[at..at + row.len()].copy_from_slice(row);
        }
    }
    write_png(&folder.join("sheet.png"), 1920, 1080, &sheet);
}

/// A camera of each lens model.
fn cameras() -> [(&'static str, Camera); 4] {
    let camera = |lens, view_rad: f64, k: Option<[f64; 4]>| {
        let mut camera = Camera::ahead(960, 540, view_rad);
        camera.lens = lens;
        camera.k = k.unwrap_or(camera.k);
        camera.vehicle_from_camera = mounting([1.6, 0.1, 1.45], [0.01, 0.09, -0.02]);
        camera.readout_s = 0.03;
        camera
    };
    [
        ("pinhole", camera(Lens::Pinhole, 1.1, None)),
        (
            "plumb_bob",
            camera(
                Lens::PlumbBob([-0.31, 0.11, 0.0011, 0.0005, -0.018]),
                1.2,
                None,
            ),
        ),
        (
            "rational_polynomial",
            camera(
                Lens::RationalPolynomial([0.31, -0.12, 0.0011, -0.0007, 0.013, 0.68, -0.03, 0.02]),
                1.2,
                None,
            ),
        ),
        (
            "equidistant",
            camera(
                Lens::KannalaBrandt([-0.021, 0.0043, -0.0017, 0.0002]),
                1.2,
                Some([330.0, 330.0, 479.5, 262.0]),
            ),
        ),
    ]
}

fn annotated(world: &World, folder: &Path) {
    let renderer = Renderer::new(world);
    let traffic = street::traffic(30.0, STATION_M);
    for (name, camera) in cameras() {
        let conditions = Conditions::draw(Category::Normal, 0.0, 2);
        let mut frame =
            renderer.render(&camera, &shot(conditions, &camera, STATION_M, &traffic), 7);
        let json = serde_json::to_string_pretty(&frame.truth).unwrap();
        fs::write(folder.join(format!("{name}.json")), json).unwrap();
        fs::write(folder.join(format!("{name}.jpg")), frame.jpeg(92).unwrap()).unwrap();
        annotate(&mut frame);
        write_png(
            &folder.join(format!("{name}.png")),
            frame.width_px,
            frame.height_px,
            &frame.rgb,
        );
    }
}

fn annotate(frame: &mut Frame) {
    let truth = frame.truth.clone();
    for paint in &truth.paint {
        let color = if paint.box_px.is_some() {
            [255, 0, 255]
        } else {
            [255, 0, 0]
        };
        for line in &paint.lines_px {
            for pair in line.windows(2) {
                draw(frame, pair[0], pair[1], color);
            }
        }
        outline(frame, paint.box_px, [0, 255, 255]);
    }
    for vehicle in &truth.vehicles {
        outline(frame, Some(vehicle.box_px), [0, 255, 0]);
    }
}

fn outline(frame: &mut Frame, bounds: Option<[f64; 4]>, color: [u8; 3]) {
    if let Some([left, top, right, bottom]) = bounds {
        let ring = [
            [left, top],
            [right, top],
            [right, bottom],
            [left, bottom],
            [left, top],
        ];
        for pair in ring.windows(2) {
            draw(frame, pair[0], pair[1], color);
        }
    }
}

fn draw(frame: &mut Frame, from: [f64; 2], to: [f64; 2], color: [u8; 3]) {
    let steps = (to[0] - from[0])
        .abs()
        .max((to[1] - from[1]).abs())
        .ceil()
        .max(1.0) as u32;
    for step in 0..=steps {
        let share = f64::from(step) / f64::from(steps);
        let [x, y] = [0, 1].map(|axis| (from[axis] + (to[axis] - from[axis]) * share).round());
        if x >= 0.0 && y >= 0.0 && x < f64::from(frame.width_px) && y < f64::from(frame.height_px) {
            let at = (y as usize * frame.width_px as usize + x as usize) * 3;
            frame.rgb[at..at + 3].copy_from_slice(&color);
        }
    }
}

/// Frames per second along the street, after the first frame of each category.
fn time(world: &World, width_px: u32) {
    let camera = Camera::ahead(width_px, width_px * 9 / 16, 1.15);
    for category in Category::ALL {
        let renderer = Renderer::new(world);
        let every_m = if category == Category::Crowded {
            13.0
        } else {
            38.0
        };
        let traffic = street::traffic(every_m, STATION_M);
        let conditions = Conditions::draw(category, 0.0, 3);
        let render = |station_m: f64| {
            renderer.render(&camera, &shot(conditions, &camera, station_m, &traffic), 7)
        };
        render(STATION_M);
        let start = cpu_s();
        for frame in 0..FRAMES {
            render(STATION_M + 0.8 * f64::from(frame));
        }
        let rate = f64::from(FRAMES) / (cpu_s() - start);
        println!(
            "{width_px} {:10} {rate:6.1} frames per second of one core",
            category.name()
        );
    }
}

/// Processor seconds of this process: other processes of the machine do not count (Linux).
fn cpu_s() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = stat.split(' ').collect();
    let ticks = |field: usize| fields[field].parse::<f64>().unwrap();
    (ticks(13) + ticks(14)) / 100.0
}

fn write_png(path: &Path, width_px: u32, height_px: u32, rgb: &[u8]) {
    let file = BufWriter::new(File::create(path).unwrap());
    let mut encoder = png::Encoder::new(file, width_px, height_px);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder
        .write_header()
        .unwrap()
        .write_image_data(rgb)
        .unwrap();
}

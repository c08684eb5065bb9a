//! Camera logs that need no renderer: what a log's detections say, painted red on grey as a camera
//! would see it, in place of the detections.

#![allow(clippy::unwrap_used)] // A fixture that cannot be made ends its test.

use std::fs::File;
use std::path::Path;

use jpeg_encoder::{ColorType, Encoder};
use nalgebra::{Matrix3, UnitQuaternion};
use tilefold_formats::log::{ALL_TIME, LogIndex, LogReader, Topic, TopicKind};
use tilefold_formats::log_write::{Dialect, Entry, LogWriter};
use tilefold_schemas::log::{
    CameraCalibration, CameraFrame, DetectionFrame, EncodedImage, LogMessage, Payload, Transform,
};

/// Size of the pictures.
pub const SIZE_PX: [u16; 2] = [320, 180];
/// Focal length in pixels, and height of the camera over the road in metres.
const FOCAL_PX: f64 = 190.0;
const HEIGHT_M: f64 = 1.5;
/// Half the width of what is painted, in metres.
const HALF_WIDTH_M: f64 = 0.12;
/// Topic of the pictures and frame of the camera.
pub const TOPIC: &str = "/camera";
const FRAME: &str = "camera";

/// What is wrong with a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Flaw {
    /// Nothing.
    #[default]
    None,
    /// It lacks the calibration.
    Uncalibrated,
    /// Its calibration is of pictures twice as large.
    OtherSize,
    /// Its tenth picture is cut off in the middle.
    CutPicture,
}

/// Writes the first `seconds` of `log` to `out` with pictures in place of detections.
///
/// # Panics
/// The log cannot be read, or the other one not written.
pub fn paint(log: &Path, out: &Path, seconds: i64, flaw: Flaw) {
    let index = LogIndex::open(log).unwrap();
    let mut messages: Vec<LogMessage> = Vec::new();
    let is_wanted = |_: usize, topic: &Topic| topic.kind != TopicKind::Unknown;
    LogReader::new()
        .read(&index, is_wanted, ALL_TIME, |message| {
            messages.push(message)
        })
        .unwrap();
    messages.sort_by_key(|message| message.log_time_ns);
    let vehicle = index.vehicle.clone().unwrap();
    let mut written =
        LogWriter::create(File::create(out).unwrap(), Dialect::Ros2, &vehicle, []).unwrap();
    let begin_ns = messages[0].log_time_ns;
    let mut write =
        |topic: &str, frame_id: &str, (stamp_ns, log_time_ns): (i64, i64), payload: &Payload| {
            let entry = Entry {
                topic,
                stamp_ns,
                log_time_ns,
                frame_id,
                payload,
            };
            written.write(entry).unwrap();
        };
    let begin = (begin_ns, begin_ns);
    write("/tf_static", "", begin, &mounting());
    if flaw != Flaw::Uncalibrated {
        let times = if flaw == Flaw::OtherSize { 2.0 } else { 1.0 };
        write("/camera_info", FRAME, begin, &calibration(times));
    }
    let mut pictures = 0;
    for message in messages
        .iter()
        .filter(|m| m.log_time_ns < begin_ns + seconds * 1_000_000_000)
    {
        let times = (message.stamp_ns, message.log_time_ns);
        match &message.payload {
            Payload::Detections(frame) => {
                pictures += 1;
                let is_cut = flaw == Flaw::CutPicture && pictures == 10;
                write(TOPIC, FRAME, times, &picture(frame, is_cut));
            }
            Payload::Vehicles(_) | Payload::Transforms { .. } => {}
            other => {
                let topic = &index.topics[message.topic].name;
                write(topic, &message.frame_id, times, other);
            }
        }
    }
    written.finish().unwrap();
}

fn mounting() -> Payload {
    // Optical z is the vehicle's x, optical x its right.
    let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    let ahead = UnitQuaternion::from_matrix(&axes);
    Payload::Transforms {
        transforms: vec![Transform {
            parent_frame: "base_link".to_owned(),
            child_frame: FRAME.to_owned(),
            translation_m: [0.0, 0.0, HEIGHT_M],
            rotation: ahead.coords.into(),
        }],
        is_static: true,
    }
}

fn calibration(times: f64) -> Payload {
    let [width, height] = SIZE_PX.map(|side| f64::from(side) * times);
    let focal = FOCAL_PX * times;
    let centre = [width, height].map(|side| (side - 1.0) / 2.0);
    Payload::Calibration(CameraCalibration {
        width_px: width as u32,
        height_px: height as u32,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![0.0; 5],
        k: [focal, 0.0, centre[0], 0.0, focal, centre[1], 0.0, 0.0, 1.0],
    })
}

fn picture(frame: &DetectionFrame, is_cut: bool) -> Payload {
    let [width, height] = SIZE_PX.map(usize::from);
    let mut rgb = vec![90_u8; width * height * 3];
    for detection in &frame.detections {
        for ends in detection.points.windows(2) {
            stroke(&mut rgb, ends[0], ends[1]);
        }
    }
    let mut file = Vec::new();
    Encoder::new(&mut file, 95)
        .encode(&rgb, SIZE_PX[0], SIZE_PX[1], ColorType::Rgb)
        .unwrap();
    if is_cut {
        file.truncate(file.len() / 2);
    }
    Payload::Image(CameraFrame::Encoded(EncodedImage {
        format: "jpeg".to_owned(),
        data: file.into(),
    }))
}

/// Paints a piece of a line (metres in the vehicle frame), densely, row by row of the picture.
fn stroke(rgb: &mut [u8], from: [f64; 3], to: [f64; 3]) {
    let [width, height] = SIZE_PX.map(f64::from);
    for step in 0..=200 {
        let share = f64::from(step) / 200.0;
        let [x, y] = [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
        if x < 2.0 {
            continue;
        }
        let column = |left_m: f64| (width - 1.0) / 2.0 - FOCAL_PX * left_m / x;
        let row = ((height - 1.0) / 2.0 + FOCAL_PX * HEIGHT_M / x).round();
        let columns = [y + HALF_WIDTH_M, y - HALF_WIDTH_M].map(|left_m| column(left_m).round());
        if !(0.0..height).contains(&row) {
            continue;
        }
        let first = columns[0].max(0.0) as usize;
        for at in first..(columns[1] + 1.0).clamp(0.0, width) as usize {
            let pixel = (row as usize * width as usize + at) * 3;
            rgb[pixel..pixel + 3].copy_from_slice(&[220, 20, 30]);
        }
    }
}

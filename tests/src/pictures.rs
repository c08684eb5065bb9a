//! Camera logs that need no renderer: what a log's detections say, painted red on grey as a camera
//! would see it, in place of the detections; as single pictures or, with the feature `h264`, as video.

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

/// How pictures are recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// Each as a JPEG.
    Jpeg,
    /// As H.264 with a key frame every so many pictures.
    #[cfg(feature = "h264")]
    H264 {
        /// Pictures from key frame to key frame.
        key_frame_each: u32,
    },
}

/// Writes the first `seconds` of `log` to `out` with pictures in place of detections.
///
/// # Panics
/// The log cannot be read, or the other one not written.
pub fn paint(log: &Path, out: &Path, seconds: i64, flaw: Flaw) {
    paint_as(log, out, seconds, flaw, Coding::Jpeg);
}

/// The same with pictures recorded otherwise.
///
/// # Panics
/// The log cannot be read, or the other one not written.
pub fn paint_as(log: &Path, out: &Path, seconds: i64, flaw: Flaw, coding: Coding) {
    let mut coder = Coder::new(coding);
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
                let mut image = coder.encode(&painted(frame));
                if is_cut {
                    image.data.truncate(image.data.len() / 2);
                }
                write(TOPIC, FRAME, times, &coder.payload(image));
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

/// The picture as rows of red, green and blue.
fn painted(frame: &DetectionFrame) -> Vec<u8> {
    let [width, height] = SIZE_PX.map(usize::from);
    let mut rgb = vec![90_u8; width * height * 3];
    for detection in &frame.detections {
        for ends in detection.points.windows(2) {
            stroke(&mut rgb, ends[0], ends[1]);
        }
    }
    rgb
}

/// Encodes one picture after the other.
enum Coder {
    Jpeg,
    #[cfg(feature = "h264")]
    H264 {
        encoder: Box<openh264::encoder::Encoder>,
        key_frame_each: u32,
        pictures: u32,
    },
}

impl Coder {
    fn new(coding: Coding) -> Self {
        match coding {
            Coding::Jpeg => Self::Jpeg,
            #[cfg(feature = "h264")]
            Coding::H264 { key_frame_each } => Self::H264 {
                encoder: Box::new(openh264::encoder::Encoder::new().unwrap()),
                key_frame_each,
                pictures: 0,
            },
        }
    }

    fn encode(&mut self, rgb: &[u8]) -> EncodedImage {
        match self {
            Self::Jpeg => {
                let mut file = Vec::new();
                Encoder::new(&mut file, 95)
                    .encode(rgb, SIZE_PX[0], SIZE_PX[1], ColorType::Rgb)
                    .unwrap();
                image("jpeg", file)
            }
            #[cfg(feature = "h264")]
            Self::H264 {
                encoder,
                key_frame_each,
                pictures,
            } => {
                use openh264::formats::{RgbSliceU8, YUVBuffer};
                if pictures.is_multiple_of(*key_frame_each) {
                    encoder.force_intra_frame();
                }
                *pictures += 1;
                let source = RgbSliceU8::new(rgb, SIZE_PX.map(usize::from).into());
                let yuv = YUVBuffer::from_rgb8_source(source);
                image("h264", encoder.encode(&yuv).unwrap().to_vec())
            }
        }
    }

    fn payload(&self, image: EncodedImage) -> Payload {
        Payload::Image(match self {
            Self::Jpeg => CameraFrame::Encoded(image),
            #[cfg(feature = "h264")]
            Self::H264 { .. } => CameraFrame::Video(image),
        })
    }
}

fn image(format: &str, data: Vec<u8>) -> EncodedImage {
    EncodedImage {
        format: format.to_owned(),
        data: data.into(),
    }
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

//! MCAP: the frames that speak for and against a verdict, as a case to look at in Foxglove.
//!
//! | topic | schema | |
//! | --- | --- | --- |
//! | `/case/image` | `foxglove.CompressedImage` | what the camera saw, PNG |
//! | `/case/annotations` | `foxglove.ImageAnnotations` | what is drawn over the picture of the same stamp |

use std::io::Write;

use foxglove::messages as fox;

use super::error::ExportError;
use super::memory_log::MemoryLog;
use crate::log_write::{message, timestamp};

/// Place and size of a frame's caption, in pixels.
const CAPTION_AT: fox::Point2 = fox::Point2 { x: 8.0, y: 24.0 };
const CAPTION_PX: f64 = 16.0;
/// The frame that pictures are of.
const CAMERA: &str = "camera";

/// A frame of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseFrame {
    /// Capture time, nanoseconds since the Unix epoch.
    pub stamp_ns: i64,
    /// What the camera saw, as PNG.
    pub png: Vec<u8>,
    /// What is said of it.
    pub caption: String,
    /// What is drawn over it.
    pub lines: Vec<CaseLine>,
}

/// A line that is drawn over a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseLine {
    /// What it is: `map`, `detected`, `added`, `removed` or `modified`.
    pub class: &'static str,
    /// Its vertices, in pixels of the picture.
    pub points_px: Vec<[f64; 2]>,
    /// Red, green and blue.
    pub color: [u8; 3],
    /// Its width in pixels.
    pub width_px: f64,
}

/// Writes a case; frames are in the order given.
///
/// # Errors
/// If a time lies before 1970, or `out` does not take the bytes.
pub fn write_case(frames: Vec<CaseFrame>, out: &mut impl Write) -> Result<(), ExportError> {
    let mut log = MemoryLog::create()?;
    for frame in frames {
        let stamp = timestamp(frame.stamp_ns)?;
        let image = fox::CompressedImage {
            timestamp: Some(stamp),
            frame_id: CAMERA.to_owned(),
            data: frame.png.into(),
            format: "png".to_owned(),
        };
        let image = message("foxglove.CompressedImage", &image)?;
        log.write("/case/image", frame.stamp_ns, &image)?;
        let drawn = fox::ImageAnnotations {
            timestamp: Some(stamp),
            points: frame.lines.iter().map(|line| drawn(stamp, line)).collect(),
            texts: vec![caption(stamp, &frame.caption)],
            ..Default::default()
        };
        let drawn = message("foxglove.ImageAnnotations", &drawn)?;
        log.write("/case/annotations", frame.stamp_ns, &drawn)?;
    }
    out.write_all(&log.finish()?)?;
    Ok(())
}

fn drawn(stamp: fox::Timestamp, line: &CaseLine) -> fox::PointsAnnotation {
    let points = line.points_px.iter().map(|&[x, y]| fox::Point2 { x, y });
    fox::PointsAnnotation {
        timestamp: Some(stamp),
        r#type: fox::points_annotation::Type::LineStrip.into(),
        points: points.collect(),
        outline_color: Some(color(line.color)),
        thickness: line.width_px,
        metadata: vec![fox::KeyValuePair {
            key: "class".to_owned(),
            value: line.class.to_owned(),
        }],
        ..Default::default()
    }
}

fn caption(stamp: fox::Timestamp, text: &str) -> fox::TextAnnotation {
    fox::TextAnnotation {
        timestamp: Some(stamp),
        position: Some(CAPTION_AT),
        text: text.to_owned(),
        font_size: CAPTION_PX,
        text_color: Some(color([255; 3])),
        background_color: Some(color([0; 3])),
        ..Default::default()
    }
}

fn color(rgb: [u8; 3]) -> fox::Color {
    let [r, g, b] = rgb.map(|part| f64::from(part) / 255.0);
    fox::Color { r, g, b, a: 1.0 }
}

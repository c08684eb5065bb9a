//! Raw images: rows of `step` bytes, in the encodings of ROS (`sensor_msgs/image_encodings.hpp`) and
//! Foxglove (`RawImage`).
//!
//! YUV is taken as BT.601 of full range, as OpenCV and cameras over USB have it. Bayer patterns are
//! named by their first two pixels of the first two rows, and interpolated bilinearly.

use tilefold_schemas::Picture;
use tilefold_schemas::log::RawImage;

use super::{PictureError, check_size, picture};

/// The encodings that are read.
pub const ENCODINGS: [&str; 17] = [
    "rgb8",
    "8UC3",
    "bgr8",
    "rgba8",
    "bgra8",
    "mono8",
    "8UC1",
    "mono16",
    "16UC1",
    "yuv422",
    "uyvy",
    "yuv422_yuy2",
    "yuyv",
    "bayer_rggb8",
    "bayer_bggr8",
    "bayer_gbrg8",
    "bayer_grbg8",
];

/// What the bytes of a row are.
#[derive(Debug, Clone, Copy)]
enum Form {
    /// Channels of a byte each, and where red, green and blue are among them.
    Channels(usize, [usize; 3]),
    /// Grey of two bytes, of which the greater counts.
    Wide,
    /// Two pixels in four bytes: places of the first grey, the blue and the red difference.
    Yuv([usize; 3]),
    /// One colour a pixel: column and row (0 or 1) of the red ones.
    Bayer([usize; 2]),
}

impl Form {
    fn of(encoding: &str) -> Option<Self> {
        Some(match encoding {
            "rgb8" => Self::Channels(3, [0, 1, 2]),
            // OpenCV's own order.
            "bgr8" | "8UC3" => Self::Channels(3, [2, 1, 0]),
            "rgba8" => Self::Channels(4, [0, 1, 2]),
            "bgra8" => Self::Channels(4, [2, 1, 0]),
            "mono8" | "8UC1" => Self::Channels(1, [0; 3]),
            "mono16" | "16UC1" => Self::Wide,
            "yuv422" | "uyvy" => Self::Yuv([1, 0, 2]),
            "yuv422_yuy2" | "yuyv" => Self::Yuv([0, 1, 3]),
            "bayer_rggb8" => Self::Bayer([0, 0]),
            "bayer_bggr8" => Self::Bayer([1, 1]),
            "bayer_gbrg8" => Self::Bayer([0, 1]),
            "bayer_grbg8" => Self::Bayer([1, 0]),
            _ => return None,
        })
    }

    /// Bytes that a row of so many pixels takes.
    fn row_bytes(self, width_px: usize) -> usize {
        match self {
            Self::Channels(channels, _) => width_px * channels,
            Self::Wide => width_px * 2,
            Self::Yuv(_) => width_px.div_ceil(2) * 4,
            Self::Bayer(_) => width_px,
        }
    }
}

pub(super) fn decode(image: &RawImage) -> Result<Picture, PictureError> {
    let form = Form::of(&image.encoding).ok_or_else(|| PictureError::Encoding {
        encoding: image.encoding.clone(),
    })?;
    check_size(image.width_px, image.height_px)?;
    let (width, height) = (image.width_px as usize, image.height_px as usize);
    let row_bytes = form.row_bytes(width);
    let step = match image.step as usize {
        0 => row_bytes,
        step => step,
    };
    let expected = (height as u64).saturating_sub(1) * step as u64 + row_bytes as u64;
    if step < row_bytes || (image.data.len() as u64) < expected || width * height == 0 {
        return Err(PictureError::Short {
            width_px: image.width_px,
            height_px: image.height_px,
            encoding: image.encoding.clone(),
            step: image.step,
            got: image.data.len(),
            expected: expected.max(row_bytes as u64 * height as u64),
        });
    }
    let row = |row: usize| &image.data[row * step..row * step + row_bytes];
    let mut rgb = Vec::with_capacity(width * height * 3);
    match form {
        Form::Channels(channels, order) => (0..height).for_each(|y| {
            let pixels = row(y).chunks_exact(channels);
            rgb.extend(pixels.flat_map(|pixel| order.map(|channel| pixel[channel])));
        }),
        Form::Wide => (0..height).for_each(|y| {
            let high = usize::from(!image.is_big_endian);
            rgb.extend(row(y).chunks_exact(2).flat_map(|grey| [grey[high]; 3]));
        }),
        Form::Yuv(places) => (0..height).for_each(|y| yuv_row(row(y), places, width, &mut rgb)),
        Form::Bayer(red) => bayer(row, (width, height), red, &mut rgb),
    }
    picture("raw image", (image.width_px, image.height_px), rgb)
}

fn yuv_row(row: &[u8], [grey, blue, red]: [usize; 3], width: usize, rgb: &mut Vec<u8>) {
    let end = rgb.len() + width * 3;
    for pair in row.chunks_exact(4) {
        let (u, v) = (f32::from(pair[blue]) - 128.0, f32::from(pair[red]) - 128.0);
        for y in [pair[grey], pair[grey + 2]].map(f32::from) {
            let colors = [
                y + 1.402 * v,
                y - 0.344_136 * u - 0.714_136 * v,
                y + 1.772 * u,
            ];
            rgb.extend(colors.map(|color| color.round().clamp(0.0, 255.0) as u8));
        }
    }
    rgb.truncate(end);
}

/// Each missing colour is the mean of the neighbours that have it.
fn bayer<'a>(
    row: impl Fn(usize) -> &'a [u8],
    (width, height): (usize, usize),
    [red_x, red_y]: [usize; 2],
    rgb: &mut Vec<u8>,
) {
    // 0 red, 1 green, 2 blue.
    let color = |x: usize, y: usize| usize::from(x % 2 != red_x) + usize::from(y % 2 != red_y);
    for y in 0..height {
        let rows = [
            y.checked_sub(1),
            Some(y),
            Some(y + 1).filter(|y| *y < height),
        ];
        for x in 0..width {
            let (mut sums, mut counts) = ([0_u32; 3], [0_u32; 3]);
            for near_y in rows.into_iter().flatten() {
                let line = row(near_y);
                for near_x in x.saturating_sub(1)..(x + 2).min(width) {
                    let color = color(near_x, near_y);
                    sums[color] += u32::from(line[near_x]);
                    counts[color] += 1;
                }
            }
            // Its own colour is measured.
            let own = color(x, y);
            (sums[own], counts[own]) = (u32::from(row(y)[x]), 1);
            rgb.extend([0, 1, 2].map(|color| {
                let count = counts[color].max(1);
                ((sums[color] + count / 2) / count) as u8
            }));
        }
    }
}

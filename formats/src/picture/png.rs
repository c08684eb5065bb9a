//! PNG of any colour type, eight bits or sixteen; transparency is left away.

use std::io::Cursor;

use png::{ColorType, Decoder, Limits, Transformations};
use tilefold_schemas::Picture;
use tilefold_schemas::limits::MAX_PICTURE_PX;

use super::{PictureError, check_size, picture};

pub(super) fn decode(bytes: &[u8]) -> Result<Picture, PictureError> {
    let damaged = |reason: String| PictureError::Damaged {
        kind: "PNG",
        reason,
    };
    let limits = Limits {
        bytes: MAX_PICTURE_PX as usize * 8,
    };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::normalize_to_color8());
    let mut reader = decoder
        .read_info()
        .map_err(|error| damaged(error.to_string()))?;
    let (width_px, height_px) = reader.info().size();
    check_size(width_px, height_px)?;
    let size = reader
        .output_buffer_size()
        .ok_or_else(|| damaged("its size overflows".to_owned()))?;
    let mut pixels = vec![0; size];
    let frame = reader
        .next_frame(&mut pixels)
        .map_err(|error| damaged(error.to_string()))?;
    // Reads on to the end: what follows the last row is checked as well.
    reader
        .finish()
        .map_err(|error| damaged(error.to_string()))?;
    pixels.truncate(frame.buffer_size());
    picture(
        "PNG",
        (width_px, height_px),
        to_rgb(pixels, frame.color_type),
    )
}

fn to_rgb(pixels: Vec<u8>, color: ColorType) -> Vec<u8> {
    match color {
        ColorType::Grayscale => pixels.iter().flat_map(|grey| [*grey; 3]).collect(),
        ColorType::GrayscaleAlpha => pixels.chunks_exact(2).flat_map(|p| [p[0]; 3]).collect(),
        ColorType::Rgba => pixels
            .chunks_exact(4)
            .flat_map(|p| [p[0], p[1], p[2]])
            .collect(),
        ColorType::Rgb | ColorType::Indexed => pixels,
    }
}

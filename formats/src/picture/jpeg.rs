//! JPEG, strictly: half a file is refused, not filled up with grey.

use tilefold_schemas::Picture;
use tilefold_schemas::limits::MAX_PICTURE_SIDE_PX;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::{PictureError, check_size, picture};

pub(super) fn decode(bytes: &[u8]) -> Result<Picture, PictureError> {
    let damaged = |reason: String| PictureError::Damaged {
        kind: "JPEG",
        reason,
    };
    let side_px = MAX_PICTURE_SIDE_PX as usize;
    let options = DecoderOptions::default()
        .set_strict_mode(true)
        .set_max_width(side_px)
        .set_max_height(side_px)
        .jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder
        .decode_headers()
        .map_err(|error| damaged(error.to_string()))?;
    let (width_px, height_px) = decoder
        .dimensions()
        .and_then(|(width, height)| Some((u32::try_from(width).ok()?, u32::try_from(height).ok()?)))
        .ok_or_else(|| damaged("it states no size".to_owned()))?;
    check_size(width_px, height_px)?;
    let rgb = decoder
        .decode()
        .map_err(|error| damaged(error.to_string()))?;
    if !ends(bytes) {
        return Err(damaged("it has no end-of-image marker".to_owned()));
    }
    picture("JPEG", (width_px, height_px), rgb)
}

/// Whether the end-of-image marker is there; cameras may write zeros behind it.
fn ends(bytes: &[u8]) -> bool {
    let end = bytes
        .iter()
        .rposition(|byte| *byte != 0)
        .map_or(0, |last| last + 1);
    bytes[..end].ends_with(&[0xff, 0xd9])
}

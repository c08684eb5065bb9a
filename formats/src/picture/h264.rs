//! H.264 in Annex B, as foxglove.CompressedVideo carries it: a message is one picture, and no picture
//! waits for a later one.

use openh264::OpenH264API;
use openh264::decoder::{Decoder, DecoderConfig};
use openh264::formats::YUVSource;
use tilefold_schemas::limits::MAX_ENCODED_PICTURE_BYTES;
use tilefold_schemas::log::RawImage;

use super::{PictureError, check_size};

/// Kind of a unit that begins anew: a slice of an IDR picture (ITU-T H.264, table 7-1).
const IDR: u8 = 5;

/// A decoder with its memory.
pub(super) struct Video {
    decoder: Decoder,
    /// Whether everything since a key frame was decoded.
    is_whole: bool,
}

impl Video {
    pub(super) fn new() -> Result<Self, PictureError> {
        let decoder = Decoder::with_api_config(OpenH264API::from_source(), DecoderConfig::new());
        Ok(Self {
            decoder: decoder.map_err(|error| damaged(error.to_string()))?,
            is_whole: false,
        })
    }

    /// The picture of a message.
    pub(super) fn decode(&mut self, bytes: &[u8]) -> Result<RawImage, PictureError> {
        let count = bytes.len() as u64;
        if count > MAX_ENCODED_PICTURE_BYTES {
            return Err(PictureError::TooLarge {
                what: "bytes",
                got: count,
                limit: MAX_ENCODED_PICTURE_BYTES,
            });
        }
        if !self.is_whole && !units(bytes).any(|kind| kind == IDR) {
            return Err(damaged(
                "the key frame that it builds on is missing".to_owned(),
            ));
        }
        self.is_whole = false;
        let decoded = self
            .decoder
            .decode(bytes)
            .map_err(|error| damaged(error.to_string()))?;
        let yuv = decoded.ok_or_else(|| damaged("it is not a whole picture".to_owned()))?;
        let (width, height) = yuv.dimensions();
        let (width_px, height_px) = (width as u32, height as u32);
        check_size(width_px, height_px)?;
        let mut rgb = vec![0; width * height * 3];
        yuv.write_rgb8(&mut rgb);
        self.is_whole = true;
        Ok(RawImage {
            width_px,
            height_px,
            step: width_px * 3,
            encoding: "rgb8".to_owned(),
            is_big_endian: false,
            data: rgb.into(),
        })
    }
}

fn damaged(reason: String) -> PictureError {
    PictureError::Damaged {
        kind: "frame of H.264 video",
        reason,
    }
}

/// Kinds of the units of a byte stream: the five low bits after each start code.
fn units(bytes: &[u8]) -> impl Iterator<Item = u8> + '_ {
    let starts = bytes.windows(4).filter(|four| four[..3] == [0, 0, 1]);
    starts.map(|four| four[3] & 0x1f)
}

//! Encoded and raw pictures to pixels.
//!
//! What a picture is, is told by its first bytes, not by the name that a log gives its format. Half
//! a file is an error, never half a picture; sizes are checked before anything is allocated.

#[cfg(feature = "h264")]
mod h264;
mod jpeg;
mod png;
mod raw;
mod sequence;

use tilefold_schemas::Picture;
use tilefold_schemas::limits::{MAX_ENCODED_PICTURE_BYTES, MAX_PICTURE_PX, MAX_PICTURE_SIDE_PX};
use tilefold_schemas::log::CameraFrame;

pub use raw::ENCODINGS;
pub use sequence::{KEY_FRAME_NS, Sequence};

/// Why there is no picture.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PictureError {
    /// Neither JPEG nor PNG.
    #[error(
        "the picture is neither JPEG nor PNG (it begins with {begin}, and is called {format:?}); record one of these, or raw images"
    )]
    Unknown {
        /// Its first bytes.
        begin: String,
        /// What the log calls it.
        format: String,
    },
    /// Broken, or cut off.
    #[error(
        "the {kind} cannot be decoded: {reason}; the file is damaged or cut off: record it anew"
    )]
    Damaged {
        /// `JPEG` or `PNG`.
        kind: &'static str,
        /// What the decoder says.
        reason: String,
    },
    /// Beyond a limit.
    #[error("the picture has {got} {what}, more than {limit}; is this a camera's?")]
    TooLarge {
        /// Of what.
        what: &'static str,
        /// How many.
        got: u64,
        /// The limit.
        limit: u64,
    },
    /// A raw encoding that is not read.
    #[error("raw images in {encoding:?} are not read; read are {}", ENCODINGS.join(", "))]
    Encoding {
        /// As the log names it.
        encoding: String,
    },
    /// A raw image whose numbers do not fit together.
    #[error(
        "a raw image of {width_px} x {height_px} pixels in {encoding} with {step} bytes a row has {got} bytes, {expected} are needed; the message is cut off or its header is wrong"
    )]
    Short {
        /// Pixels in a row.
        width_px: u32,
        /// Rows.
        height_px: u32,
        /// As the log names it.
        encoding: String,
        /// Bytes a row, as stated.
        step: u32,
        /// Bytes there are.
        got: usize,
        /// Bytes there should be.
        expected: u64,
    },
    /// Video that is not read.
    #[error("video in {format:?} is not read; {remedy}")]
    Video {
        /// As the log names it.
        format: String,
        /// What helps.
        remedy: &'static str,
    },
}

/// Decodes a camera frame that stands for itself; [`Sequence`] makes such ones of video.
///
/// # Errors
/// It is of no known form, damaged, cut off, too large, or a frame of video.
pub fn decode(frame: &CameraFrame) -> Result<Picture, PictureError> {
    match frame {
        CameraFrame::Encoded(image) => decode_file(&image.data, &image.format),
        CameraFrame::Raw(image) => raw::decode(image),
        CameraFrame::Video(image) => Err(PictureError::Video {
            format: image.format.clone(),
            remedy: "its frames are to be decoded in their order",
        }),
    }
}

/// Decodes a picture's file; `format` is what it is called, for the error only.
///
/// # Errors
/// As [`decode`].
pub fn decode_file(bytes: &[u8], format: &str) -> Result<Picture, PictureError> {
    let count = bytes.len() as u64;
    if count > MAX_ENCODED_PICTURE_BYTES {
        return Err(PictureError::TooLarge {
            what: "bytes",
            got: count,
            limit: MAX_ENCODED_PICTURE_BYTES,
        });
    }
    match bytes {
        [0xff, 0xd8, 0xff, ..] => jpeg::decode(bytes),
        [0x89, b'P', b'N', b'G', ..] => png::decode(bytes),
        _ => Err(PictureError::Unknown {
            begin: begin(bytes),
            format: format.to_owned(),
        }),
    }
}

fn begin(bytes: &[u8]) -> String {
    let first: Vec<String> = bytes
        .iter()
        .take(4)
        .map(|byte| format!("{byte:02x}"))
        .collect();
    if first.is_empty() {
        "no byte".to_owned()
    } else {
        first.join(" ")
    }
}

/// Holds a stated size against the limits, before anything is allocated for it.
fn check_size(width_px: u32, height_px: u32) -> Result<(), PictureError> {
    let pixels = u64::from(width_px) * u64::from(height_px);
    let too_large = |what, got, limit| Err(PictureError::TooLarge { what, got, limit });
    if width_px.max(height_px) > MAX_PICTURE_SIDE_PX {
        let side = u64::from(width_px.max(height_px));
        return too_large("pixels on a side", side, u64::from(MAX_PICTURE_SIDE_PX));
    }
    if pixels > MAX_PICTURE_PX {
        return too_large("pixels", pixels, MAX_PICTURE_PX);
    }
    Ok(())
}

/// A picture of decoded bytes, which are of the right number unless a decoder lies.
fn picture(kind: &'static str, size_px: (u32, u32), rgb: Vec<u8>) -> Result<Picture, PictureError> {
    let bytes = rgb.len();
    Picture::new(size_px.0, size_px.1, rgb).ok_or_else(|| PictureError::Damaged {
        kind,
        reason: format!("{bytes} bytes for {} x {} pixels", size_px.0, size_px.1),
    })
}

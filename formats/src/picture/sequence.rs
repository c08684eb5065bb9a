//! Pictures of one camera in their order: what video needs, whose frames build on those before them.
//!
//! H.264 is decoded where the crate is built with the feature `h264`: from a key frame on, and after
//! a damaged frame from the next key frame on, so that no picture is made of half of what it needs.

use tilefold_schemas::log::{CameraFrame, EncodedImage};

use super::PictureError;
#[cfg(feature = "h264")]
use super::h264::Video;

/// How far before a picture its key frame may lie, in nanoseconds: who wants a video's pictures from
/// a time on reads so much more before it.
pub const KEY_FRAME_NS: i64 = 10_000_000_000;

/// The frames of one camera, in the order of their times.
#[derive(Default)]
pub struct Sequence {
    #[cfg(feature = "h264")]
    video: Option<Video>,
}

impl Sequence {
    /// The frame as one that can be decoded alone: a frame of video becomes a raw image, all others
    /// are handed on.
    ///
    /// # Errors
    /// Video of another codec, damaged, without its key frame, or any where the feature is off.
    pub fn still(&mut self, frame: CameraFrame) -> Result<CameraFrame, PictureError> {
        match frame {
            CameraFrame::Video(image) => self.decoded(&image),
            other => Ok(other),
        }
    }

    #[cfg(feature = "h264")]
    fn decoded(&mut self, image: &EncodedImage) -> Result<CameraFrame, PictureError> {
        if !image.format.eq_ignore_ascii_case("h264") {
            return Err(PictureError::Video {
                format: image.format.clone(),
                remedy: "record H.264 or JPEG",
            });
        }
        let video = match &mut self.video {
            Some(video) => video,
            none => none.insert(Video::new()?),
        };
        video.decode(&image.data).map(CameraFrame::Raw)
    }

    #[cfg(not(feature = "h264"))]
    #[expect(clippy::unused_self, reason = "with the feature it is used")]
    fn decoded(&mut self, image: &EncodedImage) -> Result<CameraFrame, PictureError> {
        Err(PictureError::Video {
            format: image.format.clone(),
            remedy: "build with `--features h264` (H.264 only), or record JPEG",
        })
    }
}

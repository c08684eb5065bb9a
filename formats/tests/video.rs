//! H.264: pictures come back as they were, from a key frame on.
#![cfg(feature = "h264")]
#![allow(clippy::unwrap_used)] // What fails to be made ends its test.

use bytes::Bytes;
use openh264::encoder::Encoder;
use openh264::formats::{RgbSliceU8, YUVBuffer};
use tilefold_formats::picture::{Sequence, decode};
use tilefold_schemas::Picture;
use tilefold_schemas::log::{CameraFrame, EncodedImage};

const SIZE: (usize, usize) = (160, 96);

/// A smooth picture in which a bright square moves.
fn rgb(number: usize) -> Vec<u8> {
    let pixel = |at: usize| {
        let (x, y) = (at % SIZE.0, at / SIZE.0);
        let is_square = (20 + 4 * number..44 + 4 * number).contains(&x) && (30..60).contains(&y);
        if is_square {
            [230; 3]
        } else {
            [40 + x as u8 / 2, 60, 40 + y as u8 / 2]
        }
    };
    (0..SIZE.0 * SIZE.1).flat_map(pixel).collect()
}

/// Messages of a video whose frame 5 is a second key frame.
fn video() -> Vec<Vec<u8>> {
    let mut encoder = Encoder::new().unwrap();
    let message = |number: usize| {
        if number == 5 {
            encoder.force_intra_frame();
        }
        let pixels = rgb(number);
        let yuv = YUVBuffer::from_rgb8_source(RgbSliceU8::new(&pixels, SIZE));
        encoder.encode(&yuv).unwrap().to_vec()
    };
    (0..10).map(message).collect()
}

fn frame(data: &[u8], format: &str) -> CameraFrame {
    CameraFrame::Video(EncodedImage {
        format: format.to_owned(),
        data: Bytes::copy_from_slice(data),
    })
}

fn picture(sequence: &mut Sequence, data: &[u8]) -> Result<Picture, String> {
    let still = sequence.still(frame(data, "h264"));
    still
        .and_then(|still| decode(&still))
        .map_err(|error| error.to_string())
}

fn mean_difference(picture: &Picture, number: usize) -> f64 {
    let pairs = picture.rgb.iter().zip(rgb(number));
    let sum: f64 = pairs
        .map(|(a, b)| (f64::from(*a) - f64::from(b)).abs())
        .sum();
    sum / picture.rgb.len() as f64
}

#[test]
fn every_picture_comes_back_in_its_place() {
    let mut sequence = Sequence::default();
    for (number, message) in video().iter().enumerate() {
        let picture = picture(&mut sequence, message).unwrap();
        assert_eq!((picture.width_px, picture.height_px), (160, 96));
        let own = mean_difference(&picture, number);
        assert!(own < 6.0, "picture {number} differs by {own}");
        assert!(own < mean_difference(&picture, number + 2));
    }
}

#[test]
fn what_lacks_its_key_frame_waits_for_the_next() {
    let video = video();
    let mut sequence = Sequence::default();
    let seen: Vec<bool> = video[1..]
        .iter()
        .map(|message| picture(&mut sequence, message).is_ok())
        .collect();
    assert_eq!(
        seen,
        [false, false, false, false, true, true, true, true, true]
    );
    let error = picture(&mut Sequence::default(), &video[1]).unwrap_err();
    assert!(error.contains("key frame"), "{error}");
}

#[test]
fn after_damage_nothing_is_believed_until_the_next_key_frame() {
    let mut video = video();
    let half = video[2].len() / 2;
    video[2].truncate(half.min(12));
    let mut sequence = Sequence::default();
    let seen: Vec<bool> = video
        .iter()
        .map(|message| picture(&mut sequence, message).is_ok())
        .collect();
    assert_eq!(seen[..2], [true, true]);
    assert_eq!(seen[2..5], [false, false, false]);
    assert_eq!(seen[5..], [true; 5]);
}

#[test]
fn another_codec_is_named() {
    let mut sequence = Sequence::default();
    let error = sequence
        .still(frame(&[0, 0, 1], "h265"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("h265") && error.contains("H.264"), "{error}");
}

//! Pictures: what was drawn comes back, half a file does not, and lying sizes take no memory.

use bytes::Bytes;
use tilefold_formats::picture::{ENCODINGS, PictureError, decode, decode_file};
use tilefold_schemas::Picture;
use tilefold_schemas::log::{CameraFrame, EncodedImage, RawImage};

const WIDTH: u32 = 48;
const HEIGHT: u32 = 32;

/// Smooth in all colours, so that JPEG changes little.
fn drawn() -> Picture {
    let pixel = |i: u32| {
        let (x, y) = (i % WIDTH, i / WIDTH);
        [(x * 4) as u8, (y * 6) as u8, ((x + y) * 2) as u8]
    };
    Picture::new(WIDTH, HEIGHT, (0..WIDTH * HEIGHT).flat_map(pixel).collect()).unwrap()
}

fn jpeg() -> Vec<u8> {
    let mut bytes = Vec::new();
    jpeg_encoder::Encoder::new(&mut bytes, 98)
        .encode(
            &drawn().rgb,
            WIDTH as u16,
            HEIGHT as u16,
            jpeg_encoder::ColorType::Rgb,
        )
        .unwrap();
    bytes
}

fn png() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, WIDTH, HEIGHT);
    encoder.set_color(png::ColorType::Rgb);
    encoder
        .write_header()
        .unwrap()
        .write_image_data(&drawn().rgb)
        .unwrap();
    bytes
}

fn raw(encoding: &str, step: u32, data: Vec<u8>) -> Result<Picture, PictureError> {
    decode(&CameraFrame::Raw(RawImage {
        width_px: WIDTH,
        height_px: HEIGHT,
        step,
        encoding: encoding.to_owned(),
        is_big_endian: false,
        data: data.into(),
    }))
}

#[test]
fn files_come_back_as_they_were_drawn() {
    assert_eq!(decode_file(&png(), "png").unwrap(), drawn());
    let found = decode_file(&jpeg(), "jpeg").unwrap();
    let drawn_rgb = drawn().rgb;
    let apart = found
        .rgb
        .iter()
        .zip(&drawn_rgb)
        .map(|(a, b)| a.abs_diff(*b));
    assert!(apart.max().unwrap() <= 12);
    // What a log calls it does not matter.
    assert_eq!(decode_file(&png(), "jpeg").unwrap(), drawn());
    // Some cameras fill their buffers up.
    assert_eq!(
        decode_file(&[jpeg(), vec![0; 100]].concat(), "jpeg").unwrap(),
        found
    );
}

#[test]
fn no_part_of_a_file_is_a_picture() {
    for whole in [jpeg(), png()] {
        for end in 0..whole.len() {
            let error = decode_file(&whole[..end], "jpeg").unwrap_err().to_string();
            assert!(
                error.contains("cut off") || error.contains("neither JPEG nor PNG"),
                "{end}: {error}"
            );
        }
    }
}

#[test]
fn a_damaged_file_is_an_error_or_a_picture_of_its_size_and_never_a_panic() {
    for whole in [jpeg(), png()] {
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x55;
            if let Ok(picture) = decode_file(&damaged, "jpeg") {
                assert_eq!(
                    picture.rgb.len() as u64,
                    u64::from(picture.width_px) * u64::from(picture.height_px) * 3
                );
            }
        }
    }
}

#[test]
fn sizes_that_lie_take_no_memory() {
    // The size of a PNG is in bytes 16 to 24; its checksum is told to fit.
    let mut lying = png();
    lying[16..24].copy_from_slice(&[0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff]);
    let checksum = crc32fast::hash(&lying[12..29]);
    lying[29..33].copy_from_slice(&checksum.to_be_bytes());
    let error = decode_file(&lying, "png").unwrap_err();
    assert!(
        matches!(
            error,
            PictureError::TooLarge { .. } | PictureError::Damaged { .. }
        ),
        "{error}"
    );
    let image = RawImage {
        width_px: 16_000,
        height_px: 16_000,
        encoding: "rgb8".to_owned(),
        data: Bytes::from_static(&[1, 2, 3]),
        ..RawImage::default()
    };
    let error = decode(&CameraFrame::Raw(image)).unwrap_err().to_string();
    assert!(error.contains("more than 64000000"), "{error}");
}

#[test]
fn raw_encodings_are_read_by_their_rows() {
    let rgb = drawn().rgb;
    let rows = |channels: usize, pad: usize, of: &dyn Fn(&[u8]) -> Vec<u8>| {
        let row = |row: &[u8]| [row.chunks_exact(3).flat_map(of).collect(), vec![9; pad]].concat();
        let rows: Vec<u8> = rgb.chunks_exact(WIDTH as usize * 3).flat_map(row).collect();
        (WIDTH * channels as u32 + pad as u32, rows)
    };
    let (step, data) = rows(3, 0, &|p| p.to_vec());
    assert_eq!(raw("rgb8", step, data.clone()).unwrap(), drawn());
    assert_eq!(raw("rgb8", 0, data).unwrap(), drawn());
    let (step, data) = rows(3, 5, &|p| vec![p[2], p[1], p[0]]);
    assert_eq!(raw("bgr8", step, data).unwrap(), drawn());
    let (step, data) = rows(1, 2, &|p| vec![p[1]]);
    let grey = raw("mono8", step, data).unwrap();
    assert!(
        grey.rgb
            .chunks_exact(3)
            .zip(rgb.chunks_exact(3))
            .all(|(g, p)| g == [p[1]; 3])
    );
    let (step, data) = rows(2, 0, &|p| vec![77, p[1]]);
    assert_eq!(raw("mono16", step, data).unwrap(), grey);
}

#[test]
fn yuv_and_bayer_give_the_colours_of_the_scene() {
    // One colour all over: BT.601 of (200, 100, 50).
    let (y, u, v) = (124, 86, 182);
    let count = (WIDTH * HEIGHT) as usize;
    for (encoding, four) in [
        ("yuv422", [u, y, v, y]),
        ("uyvy", [u, y, v, y]),
        ("yuyv", [y, u, y, v]),
    ] {
        let picture = raw(encoding, WIDTH * 2, four.repeat(count / 2)).unwrap();
        let expected = [200_u8, 100, 50];
        let near = |pixel: &[u8]| pixel.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 2);
        assert!(
            picture.rgb.chunks_exact(3).all(near),
            "{encoding}: {:?}",
            &picture.rgb[..3]
        );
    }
    for (encoding, tile) in [
        ("bayer_rggb8", [[200, 100], [100, 50]]),
        ("bayer_bggr8", [[50, 100], [100, 200]]),
        ("bayer_gbrg8", [[100, 50], [200, 100]]),
        ("bayer_grbg8", [[100, 200], [50, 100]]),
    ] {
        let value = |i: u32| tile[(i / WIDTH % 2) as usize][(i % WIDTH % 2) as usize];
        let picture = raw(encoding, WIDTH, (0..WIDTH * HEIGHT).map(value).collect()).unwrap();
        assert!(
            picture
                .rgb
                .chunks_exact(3)
                .all(|pixel| pixel == [200, 100, 50]),
            "{encoding}"
        );
    }
}

#[test]
fn what_cannot_be_read_is_named_with_what_can() {
    let error = raw("64FC4", WIDTH, vec![0; 9]).unwrap_err().to_string();
    assert!(
        error.contains("64FC4") && ENCODINGS.iter().all(|known| error.contains(known)),
        "{error}"
    );
    let error = raw("rgb8", WIDTH * 3, vec![0; 100])
        .unwrap_err()
        .to_string();
    assert!(error.contains("has 100 bytes, 4608 are needed"), "{error}");
    let error = raw("rgb8", WIDTH, vec![0; 9_999]).unwrap_err().to_string();
    assert!(error.contains("48 bytes a row"), "{error}");
    let error = decode_file(b"GIF89a", "gif").unwrap_err().to_string();
    assert!(
        error.contains("begins with 47 49 46 38") && error.contains("\"gif\""),
        "{error}"
    );
    let video = CameraFrame::Video(EncodedImage {
        format: "h264".to_owned(),
        data: Bytes::from_static(&[0, 0, 1]),
    });
    assert!(decode(&video).unwrap_err().to_string().contains("h264"));
}

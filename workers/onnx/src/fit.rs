//! A picture to a network's input, and pixels of the input back to those of the picture.
//!
//! Pixel centres are whole numbers: the first one's is (0, 0), and an image covers -0.5 to its
//! width - 0.5. Bytes become floats through a table of 256 for each channel.

use fast_image_resize::images::{TypedImage, TypedImageRef};
use fast_image_resize::pixels::U8x3;
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions, Resizer};
use tilefold_schemas::Picture;

use crate::card::{ColorOrder, Fit, Input};

/// Grey of what a letterbox leaves over.
const LEFT_OVER: u8 = 114;

/// Where a picture lies in the input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Placement {
    /// Pixels of the input a pixel of the picture.
    scale: [f64; 2],
    /// First column and row of the input that are picture.
    origin_px: [u32; 2],
    /// Columns and rows of the input that are picture.
    size_px: [u32; 2],
    /// Columns and rows of the picture.
    picture_px: [u32; 2],
}

impl Placement {
    /// That of a picture of `picture_px`.
    pub(crate) fn new(picture_px: [u32; 2], input: &Input) -> Self {
        let input_px = [input.width_px, input.height_px];
        let ratio = |axis: usize| f64::from(input_px[axis]) / f64::from(picture_px[axis].max(1));
        let size_px = match input.fit {
            Fit::Stretch => input_px,
            Fit::Letterbox => {
                let factor = ratio(0).min(ratio(1));
                [0, 1].map(|axis| {
                    let side = (f64::from(picture_px[axis]) * factor).round() as u32;
                    side.clamp(1, input_px[axis])
                })
            }
        };
        Self {
            scale: [0, 1].map(|axis| f64::from(size_px[axis]) / f64::from(picture_px[axis].max(1))),
            origin_px: [0, 1].map(|axis| (input_px[axis] - size_px[axis]) / 2),
            size_px,
            picture_px,
        }
    }

    /// The pixel of the picture at a pixel of the input, drawn to the picture's edge if beyond it.
    pub(crate) fn to_picture(self, pixel: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let along = (pixel[axis] - f64::from(self.origin_px[axis]) + 0.5) / self.scale[axis];
            (along - 0.5).clamp(-0.5, f64::from(self.picture_px[axis]) - 0.5)
        })
    }
}

/// Brings pictures to a network's input; keeps its buffers.
#[derive(Debug)]
pub(crate) struct Fitter {
    input: Input,
    /// By channel of the tensor: which byte of a pixel, and what each value becomes.
    channels: [(usize, Box<[f32; 256]>); 3],
    resizer: Resizer,
    resized: Vec<u8>,
}

impl Fitter {
    pub(crate) fn new(input: &Input) -> Self {
        let order = match input.color {
            ColorOrder::Rgb => [0, 1, 2],
            ColorOrder::Bgr => [2, 1, 0],
        };
        let table = |byte: usize| {
            let mut table = Box::new([0.0; 256]);
            for (value, entry) in table.iter_mut().enumerate() {
                *entry = ((value as f64 * input.scale - input.mean[byte]) / input.std[byte]) as f32;
            }
            (byte, table)
        };
        Self {
            input: input.clone(),
            channels: order.map(table),
            resizer: Resizer::new(),
            resized: Vec::new(),
        }
    }

    /// Writes a picture into `tensor` (three planes of the input's size); where it lies there.
    ///
    /// # Errors
    /// The resizer's own, for a picture that is none.
    pub(crate) fn fit(
        &mut self,
        picture: &Picture,
        tensor: &mut [f32],
    ) -> Result<Placement, String> {
        let placement = Placement::new([picture.width_px, picture.height_px], &self.input);
        let [width, height] = placement.size_px;
        if [width, height] == placement.picture_px {
            self.lay(&picture.rgb, placement, tensor);
            return Ok(placement);
        }
        // The typed form: the other one is compiled for every kind of pixel there is.
        let source =
            TypedImageRef::<U8x3>::from_buffer(picture.width_px, picture.height_px, &picture.rgb)
                .map_err(|error| error.to_string())?;
        let mut resized = std::mem::take(&mut self.resized);
        resized.resize(width as usize * height as usize * 3, 0);
        let mut target = TypedImage::<U8x3>::from_buffer(width, height, &mut resized)
            .map_err(|error| error.to_string())?;
        let bilinear =
            ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Bilinear));
        self.resizer
            .resize_typed(&source, &mut target, &bilinear)
            .map_err(|error| error.to_string())?;
        drop(target);
        self.lay(&resized, placement, tensor);
        self.resized = resized;
        Ok(placement)
    }

    /// Spreads the bytes of the picture's part over the three planes.
    fn lay(&self, rgb: &[u8], placement: Placement, tensor: &mut [f32]) {
        let input_width = self.input.width_px as usize;
        let plane = input_width * self.input.height_px as usize;
        let [width, height] = placement.size_px.map(|side| side as usize);
        let [left, top] = placement.origin_px.map(|side| side as usize);
        let is_whole = [width, height] == [input_width, self.input.height_px as usize];
        for ((byte, table), plane) in self.channels.iter().zip(tensor.chunks_exact_mut(plane)) {
            if !is_whole {
                plane.fill(table[usize::from(LEFT_OVER)]);
            }
            let rows = plane.chunks_exact_mut(input_width).skip(top);
            for (row, line) in rows.zip(rgb.chunks_exact(width * 3)) {
                let pixels = line.chunks_exact(3);
                for (value, pixel) in row[left..left + width].iter_mut().zip(pixels) {
                    *value = table[usize::from(pixel[*byte])];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input(fit: Fit, color: ColorOrder) -> Input {
        Input {
            name: "image".to_owned(),
            width_px: 64,
            height_px: 32,
            color,
            fit,
            scale: 1.0 / 255.0,
            mean: [0.0; 3],
            std: [1.0; 3],
        }
    }

    #[test]
    fn corners_of_the_input_are_corners_of_the_picture() {
        let stretch = Placement::new([128, 128], &input(Fit::Stretch, ColorOrder::Rgb));
        assert_eq!(stretch.to_picture([-0.5, -0.5]), [-0.5, -0.5]);
        assert_eq!(stretch.to_picture([63.5, 31.5]), [127.5, 127.5]);
        assert_eq!(stretch.to_picture([0.0, 0.0]), [0.5, 1.5]);
        let letterbox = Placement::new([128, 128], &input(Fit::Letterbox, ColorOrder::Rgb));
        // The picture is 32 x 32 in the middle.
        assert_eq!(letterbox.to_picture([15.5, -0.5]), [-0.5, -0.5]);
        assert_eq!(letterbox.to_picture([47.5, 31.5]), [127.5, 127.5]);
    }

    #[test]
    fn channels_are_in_the_card_s_order_and_the_rest_is_grey() {
        let picture = Picture::new(32, 32, [255, 0, 51].repeat(1024)).unwrap();
        let mut tensor = vec![0.0; 3 * 64 * 32];
        let mut fitter = Fitter::new(&input(Fit::Letterbox, ColorOrder::Bgr));
        fitter.fit(&picture, &mut tensor).unwrap();
        let at = |plane: usize, row: usize, column: usize| tensor[(plane * 32 + row) * 64 + column];
        assert_eq!([0, 1, 2].map(|plane| at(plane, 5, 30)), [0.2, 0.0, 1.0]);
        assert_eq!(at(0, 5, 3), 114.0 / 255.0);
        assert_eq!(at(2, 31, 47), 1.0);
        assert_eq!(at(2, 31, 48), 114.0 / 255.0);
    }

    #[test]
    fn what_is_made_smaller_is_averaged() {
        // A grid of black and white pixels is grey from afar.
        let rgb =
            (0..128 * 64).flat_map(|i| [if (i % 128 + i / 128) % 2 == 0 { 0 } else { 255 }; 3]);
        let picture = Picture::new(128, 64, rgb.collect()).unwrap();
        let mut tensor = vec![0.0; 3 * 64 * 32];
        let mut fitter = Fitter::new(&input(Fit::Stretch, ColorOrder::Rgb));
        fitter.fit(&picture, &mut tensor).unwrap();
        assert!(tensor.iter().all(|value| (value - 0.5).abs() < 0.02));
    }
}

//! A picture as the map stage is given it: decoded, eight bits a channel, red first.

/// Pixels of one frame, row by row from the top; the first pixel's centre is (0, 0).
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Picture {
    /// Pixels in a row.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Red, green and blue of each pixel.
    pub rgb: Vec<u8>,
}

impl Picture {
    /// A picture of these bytes; none if they are not three for each pixel.
    #[must_use]
    pub fn new(width_px: u32, height_px: u32, rgb: Vec<u8>) -> Option<Self> {
        let bytes = u64::from(width_px) * u64::from(height_px) * 3;
        (bytes == rgb.len() as u64 && bytes > 0).then_some(Self {
            width_px,
            height_px,
            rgb,
        })
    }
}

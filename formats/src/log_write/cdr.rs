//! Little-endian CDR, as ROS 2 lays out its messages: every number is aligned to its own size,
//! counted from the end of the four bytes of header.

use bytes::BufMut;

/// A message in the making.
pub(super) struct Cdr {
    bytes: Vec<u8>,
}

impl Cdr {
    const HEADER: [u8; 4] = [0, 1, 0, 0];

    pub(super) fn new() -> Self {
        Self {
            bytes: Self::HEADER.to_vec(),
        }
    }

    fn align(&mut self, size: usize) {
        let at = self.bytes.len() - Self::HEADER.len();
        self.bytes.put_bytes(0, at.next_multiple_of(size) - at);
    }

    pub(super) fn u8(&mut self, value: u8) {
        self.bytes.put_u8(value);
    }

    pub(super) fn u16(&mut self, value: u16) {
        self.align(2);
        self.bytes.put_u16_le(value);
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes.put_u32_le(value);
    }

    pub(super) fn i32(&mut self, value: i32) {
        self.align(4);
        self.bytes.put_i32_le(value);
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.align(8);
        self.bytes.put_f64_le(value);
    }

    pub(super) fn f64s(&mut self, values: impl IntoIterator<Item = f64>) {
        values.into_iter().for_each(|value| self.f64(value));
    }

    /// A count, as it stands before sequences.
    pub(super) fn count(&mut self, count: usize) {
        self.u32(u32::try_from(count).unwrap_or(u32::MAX));
    }

    pub(super) fn string(&mut self, text: &str) {
        self.count(text.len() + 1);
        self.bytes.put_slice(text.as_bytes());
        self.bytes.put_u8(0);
    }

    pub(super) fn octets(&mut self, octets: &[u8]) {
        self.count(octets.len());
        self.bytes.put_slice(octets);
    }

    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_from_behind_the_header() {
        let mut cdr = Cdr::new();
        cdr.u8(7);
        cdr.u16(0x0201);
        cdr.f64(1.0);
        let mut expected = vec![0, 1, 0, 0, 7, 0, 1, 2, 0, 0, 0, 0];
        expected.extend(1.0_f64.to_le_bytes());
        assert_eq!(cdr.into_bytes(), expected);
    }

    #[test]
    fn strings_end_in_a_counted_zero() {
        let mut cdr = Cdr::new();
        cdr.string("ab");
        assert_eq!(cdr.into_bytes(), [0, 1, 0, 0, 3, 0, 0, 0, b'a', b'b', 0]);
    }
}

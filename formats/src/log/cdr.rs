//! A cursor over one message in CDR, as ROS 2 writes it (XCDR version 1, plain).
//!
//! The first four bytes say the byte order; from byte 4 on, every number lies at a multiple of its
//! size counted from there. The cursor borrows, checks every length against what is left before it
//! is used, and never allocates.
//!
//! Source: OMG DDS-XTypes 1.3, section 7.4 (encapsulation: 7.6.3.1.2).

use super::error::DecodeError;

/// Bytes of the encapsulation, from whose end alignment counts.
const ENCAPSULATION: usize = 4;

/// A cursor over one CDR message.
///
/// ```
/// use tilefold_formats::log::Cdr;
///
/// let bytes = [0, 1, 0, 0, 7, 0, 0, 0, 2, 0, 0, 0, b'a', 0];
/// let mut cdr = Cdr::new(&bytes)?;
/// assert_eq!(cdr.u8("count")?, 7);
/// assert_eq!(cdr.text("name")?, "a");
/// # Ok::<(), tilefold_formats::log::DecodeError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    is_little_endian: bool,
}

macro_rules! number {
    ($(#[$meta:meta])* $name:ident: $type:ty) => {
        $(#[$meta])*
        ///
        /// # Errors
        /// [`DecodeError::Short`] if the message ends before it.
        pub fn $name(&mut self, field: &'static str) -> Result<$type, DecodeError> {
            const SIZE: usize = std::mem::size_of::<$type>();
            self.align(SIZE);
            let mut bytes = [0; SIZE];
            bytes.copy_from_slice(self.take(SIZE, field)?);
            Ok(if self.is_little_endian {
                <$type>::from_le_bytes(bytes)
            } else {
                <$type>::from_be_bytes(bytes)
            })
        }
    };
}

impl<'a> Cdr<'a> {
    /// A cursor behind the encapsulation of `bytes`.
    ///
    /// # Errors
    /// [`DecodeError::Encapsulation`] if the message does not begin as plain CDR.
    pub fn new(bytes: &'a [u8]) -> Result<Self, DecodeError> {
        let is_little_endian = match bytes {
            [0, 0, _, _, ..] => false,
            [0, 1, _, _, ..] => true,
            _ => {
                return Err(DecodeError::Encapsulation {
                    got: bytes.iter().take(ENCAPSULATION).copied().collect(),
                });
            }
        };
        Ok(Self {
            bytes,
            at: ENCAPSULATION,
            is_little_endian,
        })
    }

    number!(
        /// An unsigned byte.
        u8: u8
    );
    number!(
        /// A signed byte.
        i8: i8
    );
    number!(
        /// An unsigned number of two bytes.
        u16: u16
    );
    number!(
        /// An unsigned number of four bytes.
        u32: u32
    );
    number!(
        /// A signed number of four bytes.
        i32: i32
    );
    number!(
        /// A float of eight bytes.
        f64: f64
    );

    /// An array of floats of eight bytes.
    ///
    /// # Errors
    /// [`DecodeError::Short`] if the message ends before its end.
    pub fn f64s<const N: usize>(&mut self, field: &'static str) -> Result<[f64; N], DecodeError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64(field)?;
        }
        Ok(values)
    }

    /// A text, without the zero byte that ends it.
    ///
    /// # Errors
    /// [`DecodeError::Short`] if the message ends before its end, [`DecodeError::Text`] if it is
    /// not UTF-8.
    pub fn text(&mut self, field: &'static str) -> Result<&'a str, DecodeError> {
        let length = self.length(1, field)?;
        let offset = self.at;
        let bytes = self.take(length, field)?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        std::str::from_utf8(bytes).map_err(|_| DecodeError::Text { field, offset })
    }

    /// A sequence of bytes.
    ///
    /// # Errors
    /// [`DecodeError::Short`] if the message ends before its end.
    pub fn octets(&mut self, field: &'static str) -> Result<&'a [u8], DecodeError> {
        let length = self.length(1, field)?;
        self.take(length, field)
    }

    /// The length of a sequence, whose items take `item_bytes` at least, held against what is left.
    ///
    /// # Errors
    /// [`DecodeError::Short`] if so many items cannot follow.
    pub fn length(&mut self, item_bytes: usize, field: &'static str) -> Result<usize, DecodeError> {
        let length = self.u32(field)? as usize;
        let expected = length.saturating_mul(item_bytes);
        let got = self.left();
        if expected > got {
            return Err(DecodeError::Short {
                field,
                offset: self.at,
                expected,
                got,
            });
        }
        Ok(length)
    }

    /// Bytes not yet read.
    #[must_use]
    pub fn left(&self) -> usize {
        self.bytes.len().saturating_sub(self.at)
    }

    /// Moves to the next multiple of `size` behind the encapsulation.
    fn align(&mut self, size: usize) {
        let past = (self.at - ENCAPSULATION) % size;
        if past > 0 {
            self.at = self.at.saturating_add(size - past);
        }
    }

    fn take(&mut self, length: usize, field: &'static str) -> Result<&'a [u8], DecodeError> {
        let end = self.at.saturating_add(length);
        let taken = self.bytes.get(self.at..end).ok_or(DecodeError::Short {
            field,
            offset: self.at,
            expected: length,
            got: self.left(),
        })?;
        self.at = end;
        Ok(taken)
    }
}

//! The CDR cursor, on honest and on random bytes.

use proptest::prelude::*;
use tilefold_formats::log::{Cdr, DecodeError};

use crate::maker::CdrMaker;

#[test]
fn numbers_lie_at_multiples_of_their_size_behind_byte_four() {
    for is_little_endian in [true, false] {
        let bytes = CdrMaker::new(is_little_endian)
            .u8(1)
            .f64s(&[2.5])
            .u16(3)
            .u32(4)
            .text("five")
            .octets(&[6, 7])
            .finish();
        let mut cdr = Cdr::new(&bytes).unwrap();
        assert_eq!(cdr.u8("a").unwrap(), 1);
        assert_eq!(cdr.f64("b").unwrap(), 2.5);
        assert_eq!(cdr.u16("c").unwrap(), 3);
        assert_eq!(cdr.u32("d").unwrap(), 4);
        assert_eq!(cdr.text("e").unwrap(), "five");
        assert_eq!(cdr.octets("f").unwrap(), [6, 7]);
        assert_eq!(cdr.left(), 0);
    }
}

#[test]
fn a_lying_length_is_an_error_with_place_and_sizes() {
    let bytes = CdrMaker::new(true).u32(u32::MAX).finish();
    let error = Cdr::new(&bytes).unwrap().text("frame_id").unwrap_err();
    let expected = DecodeError::Short {
        field: "frame_id",
        offset: 8,
        expected: u32::MAX as usize,
        got: 0,
    };
    assert_eq!(error, expected);
    assert_eq!(
        error.to_string(),
        "frame_id at byte 8 needs 4294967295 bytes, 0 are left"
    );
}

#[test]
fn other_encapsulations_are_refused() {
    for bytes in [&[][..], &[0, 1, 0], &[0, 3, 0, 0], &[1, 0, 0, 0]] {
        assert!(matches!(
            Cdr::new(bytes),
            Err(DecodeError::Encapsulation { .. })
        ));
    }
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic(
        bytes in proptest::collection::vec(any::<u8>(), 0..200),
        is_little_endian: bool,
        steps in proptest::collection::vec(0_u8..10, 0..60),
    ) {
        let bytes = [vec![0, u8::from(is_little_endian), 0, 0], bytes].concat();
        let mut cdr = Cdr::new(&bytes).unwrap();
        for step in steps {
            let before = cdr.left();
            match step {
                0 => drop(cdr.u8("x")),
                1 => drop(cdr.i8("x")),
                2 => drop(cdr.u16("x")),
                3 => drop(cdr.u32("x")),
                4 => drop(cdr.i32("x")),
                5 => drop(cdr.f64("x")),
                6 => drop(cdr.f64s::<9>("x")),
                7 => drop(cdr.text("x")),
                8 => drop(cdr.octets("x")),
                _ => drop(cdr.length(64, "x")),
            }
            prop_assert!(cdr.left() <= before);
        }
    }
}

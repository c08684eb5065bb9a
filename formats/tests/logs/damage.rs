//! Damaged logs: never a panic, what is sound is used, what is lost is counted.

use mcap::{Compression, WriteOptions};
use tilefold_formats::log::{ALL_TIME, IndexOrigin, LogError, LogIndex, LogReader};
use tilefold_schemas::SetAsideKind;
use tilefold_schemas::log::LogMessage;

use crate::maker::{LogFile, fixes, log_bytes};

const MESSAGES: u32 = 60;

fn options(compression: Option<Compression>) -> WriteOptions {
    WriteOptions::new()
        .chunk_size(Some(2_000))
        .compression(compression)
}

fn sound() -> Vec<u8> {
    log_bytes(options(Some(Compression::Zstd)), &fixes(MESSAGES))
}

/// What was set aside: kinds and counts.
type Losses = Vec<(SetAsideKind, u64)>;

/// What can be read of `bytes`; `None` if they are refused.
fn read(bytes: &[u8]) -> Option<(Vec<LogMessage>, Losses)> {
    let log = LogFile::new(bytes);
    let index = match LogIndex::open(&log.path) {
        Ok(index) => index,
        Err(LogError::NotMcap { .. }) => return None,
        Err(error) => panic!("{error}"),
    };
    let mut messages = Vec::new();
    let report = LogReader::new()
        .read(
            &index,
            |_, _| true,
            ALL_TIME,
            |message| messages.push(message),
        )
        .unwrap();
    let losses = index.set_aside.iter().chain(&report.set_aside);
    Some((
        messages,
        losses.map(|loss| (loss.kind, loss.count)).collect(),
    ))
}

#[test]
fn a_log_cut_at_any_byte_gives_what_came_before() {
    for bytes in [
        sound(),
        log_bytes(WriteOptions::new().use_chunks(false), &fixes(MESSAGES)),
    ] {
        let (all, none) = read(&bytes).unwrap();
        assert_eq!((all.len(), none.len()), (MESSAGES as usize, 0));
        let mut last = 0;
        for cut in (0..bytes.len()).step_by(7) {
            let Some((messages, losses)) = read(&bytes[..cut]) else {
                assert!(cut < 8);
                continue;
            };
            assert!(!losses.is_empty(), "cut at {cut}");
            assert_eq!(messages, all[..messages.len()], "cut at {cut}");
            assert!(messages.len() >= last, "cut at {cut}");
            last = messages.len();
        }
        assert_eq!(last, MESSAGES as usize);
    }
}

#[test]
fn a_flipped_bit_never_makes_a_message_that_was_not_sent() {
    for compression in [None, Some(Compression::Zstd), Some(Compression::Lz4)] {
        let bytes = log_bytes(options(compression), &fixes(MESSAGES));
        let (all, _) = read(&bytes).unwrap();
        let mut with_loss = 0;
        for at in (0..bytes.len()).step_by(5) {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << (at % 8);
            let Some((messages, losses)) = read(&flipped) else {
                continue;
            };
            assert!(
                messages.iter().all(|message| all.contains(message)),
                "flipped at {at}"
            );
            assert!(
                messages.len() == all.len() || !losses.is_empty(),
                "flipped at {at}"
            );
            with_loss += u32::from(messages.len() < all.len());
        }
        assert!(with_loss > 100, "{with_loss}");
    }
}

#[test]
fn a_chunk_with_a_wrong_checksum_is_set_aside_with_its_place_and_messages() {
    let bytes = log_bytes(options(None), &fixes(MESSAGES));
    let log = LogFile::new(&bytes);
    let (index, all, _) = log.read();
    // A latitude in the middle of the file: 48.0 in every message.
    let middle = bytes.len() / 3;
    let found = bytes[middle..]
        .windows(8)
        .position(|window| window == 48.0_f64.to_le_bytes());
    let mut flipped = bytes.clone();
    flipped[middle + found.unwrap()] ^= 1;
    let (damaged, messages, report) = LogFile::new(&flipped).read();
    assert_eq!(
        (damaged.origin, index.origin),
        (IndexOrigin::Summary, IndexOrigin::Summary)
    );
    let [loss] = &report.set_aside[..] else {
        panic!("{:?}", report.set_aside)
    };
    assert_eq!(loss.kind, SetAsideKind::LogSection);
    assert!(
        loss.offset
            .is_some_and(|offset| offset as usize <= middle + found.unwrap())
    );
    assert_eq!(messages.len() as u64 + loss.count, all.len() as u64);
    assert!(loss.count > 1);
    assert!(loss.reason.contains("checksum"), "{}", loss.reason);

    // The same without a summary: counted from the message indexes behind the chunk.
    let cut = &flipped[..flipped.len() - 40];
    let (scanned, messages, report) = LogFile::new(cut).read();
    assert_eq!(scanned.origin, IndexOrigin::Scan);
    assert_eq!(report.set_aside, []);
    let lost = scanned
        .set_aside
        .iter()
        .find(|loss| loss.reason.contains("checksum"))
        .unwrap();
    assert_eq!(messages.len() as u64 + lost.count, all.len() as u64);
}

#[test]
fn a_broken_footer_or_index_costs_a_walk_but_no_message() {
    let bytes = sound();
    let summary_start = bytes.len() - 8 - 20;
    for at in [
        bytes.len() - 1,
        bytes.len() - 10,
        summary_start,
        summary_start + 9,
        summary_start - 60,
    ] {
        let mut flipped = bytes.clone();
        flipped[at] ^= 0x40;
        let (index, messages, _) = LogFile::new(&flipped).read();
        assert_eq!(index.origin, IndexOrigin::Scan, "flipped at {at}");
        assert_eq!(messages.len(), MESSAGES as usize, "flipped at {at}");
        assert_eq!(index.set_aside[0].kind, SetAsideKind::LogSection);
    }
}

#[test]
fn lying_lengths_neither_allocate_nor_hang() {
    let bytes = sound();
    for lie in [u64::MAX, 1 << 63, 1 << 40, (1 << 28) - 1] {
        for at in (0..bytes.len().saturating_sub(8)).step_by(11) {
            let mut lying = bytes.clone();
            lying[at..at + 8].copy_from_slice(&lie.to_le_bytes());
            read(&lying);
        }
    }
}

#[test]
fn what_is_no_mcap_is_refused_with_a_fix() {
    for bytes in [&b""[..], b"#ROSBAG V2.0\n", b"\x89MCAP", &[0; 100]] {
        let log = LogFile::new(bytes);
        let error = LogIndex::open(&log.path).unwrap_err();
        assert!(matches!(error, LogError::NotMcap { .. }));
        let text = error.to_string();
        assert!(
            text.contains("no MCAP file") && text.contains("mcap convert"),
            "{text}"
        );
    }
    let missing = LogIndex::open("does/not/exist.mcap").unwrap_err();
    assert!(matches!(missing, LogError::Open { .. }));
    assert!(matches!(
        LogIndex::open(std::env::temp_dir()),
        Err(LogError::Open { .. })
    ));
}

#[test]
fn damage_without_end_is_listed_up_to_the_limit() {
    let mut made = fixes(3_000);
    for made in &mut made {
        made.payload.truncate(40);
    }
    let (_, messages, report) = LogFile::new(&log_bytes(options(None), &made)).read();
    assert_eq!(messages.len(), 0);
    assert_eq!(
        report.set_aside.len(),
        tilefold_schemas::limits::MAX_SET_ASIDE_LISTED + 1
    );
    assert_eq!(
        report.set_aside.iter().map(|loss| loss.count).sum::<u64>(),
        3_000
    );
}

//! The same messages in every layout of the file: the same nouns and the same digests.

use mcap::{Compression, WriteOptions};
use tilefold_formats::log::{IndexOrigin, LogIndex, LogReader, TopicKind};
use tilefold_schemas::log::LogMessage;

use crate::maker::{LogFile, Made, fixes, log_bytes};

/// Name, options, and how its index comes about.
fn layouts() -> Vec<(&'static str, WriteOptions, IndexOrigin)> {
    let small = || WriteOptions::new().chunk_size(Some(2_000));
    vec![
        (
            "zstd",
            small().compression(Some(Compression::Zstd)),
            IndexOrigin::Summary,
        ),
        (
            "lz4",
            small().compression(Some(Compression::Lz4)),
            IndexOrigin::Summary,
        ),
        ("stored", small().compression(None), IndexOrigin::Summary),
        (
            "one chunk",
            WriteOptions::new().compression(None),
            IndexOrigin::Summary,
        ),
        (
            "no checksums",
            small()
                .calculate_chunk_crcs(false)
                .calculate_summary_section_crc(false),
            IndexOrigin::Summary,
        ),
        (
            "no message indexes",
            small().emit_message_indexes(false),
            IndexOrigin::Summary,
        ),
        (
            "no chunks",
            WriteOptions::new().use_chunks(false),
            IndexOrigin::Scan,
        ),
        (
            "no summary",
            small()
                .emit_summary_records(false)
                .emit_summary_offsets(false),
            IndexOrigin::Scan,
        ),
        (
            "no statistics",
            small().emit_statistics(false),
            IndexOrigin::Scan,
        ),
        (
            "no channels in the summary",
            small().repeat_channels(false).repeat_schemas(false),
            IndexOrigin::Scan,
        ),
        (
            "no chunk indexes",
            small().emit_chunk_indexes(false),
            IndexOrigin::Scan,
        ),
    ]
}

#[test]
fn every_layout_gives_the_same_messages() {
    let made = fixes(60);
    let mut expected: Option<Vec<LogMessage>> = None;
    for (name, options, origin) in layouts() {
        let (index, messages, report) = LogFile::new(&log_bytes(options, &made)).read();
        assert_eq!(index.origin, origin, "{name}");
        assert_eq!(index.set_aside, [], "{name}");
        assert_eq!(report.set_aside, [], "{name}");
        assert_eq!((index.message_count(), report.messages), (60, 60), "{name}");
        assert_eq!(index.start_ns, 1_000_000_000_000, "{name}");
        assert_eq!(index.end_ns, 1_005_900_000_000, "{name}");
        assert_eq!(index.topics[0].kind, TopicKind::Gnss, "{name}");
        assert_eq!(index.topics_of(TopicKind::Gnss).count(), 1);
        if !["no summary"].contains(&name) {
            assert_eq!(index.vehicle.as_deref(), Some("car-7"), "{name}");
        }
        assert_eq!(
            *expected.get_or_insert_with(|| messages.clone()),
            messages,
            "{name}"
        );
    }
}

#[test]
fn digests_do_not_depend_on_channel_sequence_or_log_time() {
    let made = fixes(3);
    let other = Made {
        topic: "/other",
        schema: "std_msgs/msg/String",
        encoding: "cdr",
        log_time: 1,
        payload: vec![0; 9],
    };
    let late = made.iter().map(|made| Made {
        log_time: made.log_time + 77,
        topic: "/renamed",
        ..made.clone()
    });
    let renamed: Vec<Made> = std::iter::once(other).chain(late).collect();
    let digests = |made: &[Made]| -> Vec<i64> {
        let (_, messages, _) = LogFile::new(&log_bytes(WriteOptions::new(), made)).read();
        messages.iter().map(|message| message.digest).collect()
    };
    assert_eq!(digests(&made), digests(&renamed));
    assert_ne!(digests(&made)[0], digests(&made)[1]);
}

#[test]
fn only_chunks_of_the_wanted_time_and_topic_are_read() {
    let options = || {
        WriteOptions::new()
            .chunk_size(Some(2_000))
            .compression(None)
    };
    let log = LogFile::new(&log_bytes(options(), &fixes(1_000)));
    let index = LogIndex::open(&log.path).unwrap();
    assert!(index.bytes_read < index.size_bytes / 2);
    let mut reader = LogReader::new();
    let range = 1_010_000_000_000..1_010_500_000_000;
    let mut stamps = Vec::new();
    let report = reader
        .read(
            &index,
            |_, _| true,
            range,
            |message| stamps.push(message.log_time_ns),
        )
        .unwrap();
    assert_eq!(stamps.first(), Some(&1_010_000_000_000));
    assert_eq!(stamps.last(), Some(&1_010_400_000_000));
    assert_eq!((stamps.len(), report.messages), (5, 5));
    assert!(report.bytes_read <= 6_000, "{}", report.bytes_read);
    let nothing = reader
        .read(
            &index,
            |_, topic| topic.kind == TopicKind::Imu,
            i64::MIN..i64::MAX,
            |_| panic!(),
        )
        .unwrap();
    assert_eq!((nothing.bytes_read, nothing.messages), (0, 0));
}

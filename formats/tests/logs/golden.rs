//! Real logs against what the Python libraries read from them (`tests/oracles/log_figures.py`).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tilefold_formats::log::{ALL_TIME, IndexOrigin, LogIndex, LogReader};
use tilefold_schemas::log::{CameraFrame, DetectionSpace, LogMessage, Payload};

const FIGURES: &str = include_str!("../../../tests/oracles/log_figures.json");

/// Folder of real data, if there is one.
fn data() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("TILEFOLD_TEST_DATA").map_or(beside, PathBuf::from);
    folder.join("deecamp").is_dir().then_some(folder)
}

#[test]
fn real_logs_read_as_python_reads_them() {
    let Some(folder) = data() else {
        println!("skipped: no real data (set TILEFOLD_TEST_DATA to its folder)");
        return;
    };
    let figures: BTreeMap<String, Value> = serde_json::from_str(FIGURES).unwrap();
    assert!(figures.len() > 50);
    for (name, expected) in &figures {
        compare(&folder.join(name), name, expected);
    }
    println!("{} real logs read as Python reads them", figures.len());
}

fn compare(path: &Path, name: &str, expected: &Value) {
    let index = LogIndex::open(path).unwrap();
    assert_eq!(index.origin, IndexOrigin::Summary, "{name}");
    assert_eq!(index.set_aside, [], "{name}");
    assert_eq!(
        Some(index.message_count()),
        expected["messages"].as_u64(),
        "{name}"
    );
    assert_eq!(
        Some(index.start_ns),
        expected["start_ns"].as_i64(),
        "{name}"
    );
    assert_eq!(Some(index.end_ns), expected["end_ns"].as_i64(), "{name}");
    assert_eq!(
        index.vehicle.as_deref(),
        expected["vehicle"].as_str(),
        "{name}"
    );
    assert_eq!(
        Some(index.metadata.len() as u64),
        expected["metadata"].as_u64(),
        "{name}"
    );
    let topics = expected["topics"].as_object().unwrap();
    assert_eq!(index.topics.len(), topics.len(), "{name}");

    let mut figures: Vec<Figures> = index.topics.iter().map(|_| Figures::default()).collect();
    let report = LogReader::new()
        .read(
            &index,
            |_, _| true,
            ALL_TIME,
            |message| figures[message.topic].add(&message),
        )
        .unwrap();
    assert_eq!(report.set_aside, [], "{name}");
    for (topic, figures) in index.topics.iter().zip(&figures) {
        let place = format!("{name} {}", topic.name);
        let expected = &topics[&topic.name];
        assert_eq!(expected["schema"], topic.schema_name, "{place}");
        assert_eq!(expected["encoding"], topic.encoding, "{place}");
        assert_eq!(expected["messages"], topic.messages, "{place}");
        if expected.get("sum").is_some() {
            figures.compare(expected, topic.messages, &place);
        }
    }
}

/// What the script sums up for a topic.
#[derive(Default)]
struct Figures {
    messages: u64,
    first_stamp_ns: Option<i64>,
    last_stamp_ns: Option<i64>,
    sum: f64,
    sum_of_squares: f64,
    drawn: BTreeMap<String, u64>,
}

impl Figures {
    fn add(&mut self, message: &LogMessage) {
        self.messages += 1;
        self.first_stamp_ns.get_or_insert(message.stamp_ns);
        self.last_stamp_ns = Some(message.stamp_ns);
        for value in numbers(&message.payload) {
            self.sum += value;
            self.sum_of_squares += value * value;
        }
        let Payload::Detections(frame) = &message.payload else {
            return;
        };
        for detection in &frame.detections {
            let kind = format!(
                "{}/{}/{}",
                detection.kind, detection.marking, detection.color
            );
            *self.drawn.entry(kind).or_default() += 1;
            *self.drawn.entry("points".to_owned()).or_default() += detection.points.len() as u64;
        }
    }

    fn compare(&self, expected: &Value, messages: u64, place: &str) {
        assert_eq!(self.messages, messages, "{place}");
        assert_eq!(
            self.first_stamp_ns,
            expected["first_stamp_ns"].as_i64(),
            "{place}"
        );
        assert_eq!(
            self.last_stamp_ns,
            expected["last_stamp_ns"].as_i64(),
            "{place}"
        );
        let drawn: BTreeMap<String, u64> =
            serde_json::from_value(expected["drawn"].clone()).unwrap();
        assert_eq!(self.drawn, drawn, "{place}");
        let scale = expected["sum_of_squares"].as_f64().unwrap();
        assert!(
            (self.sum_of_squares - scale).abs() <= 1e-10 * scale,
            "{place}"
        );
        let off = (self.sum - expected["sum"].as_f64().unwrap()).abs();
        assert!(off <= 1e-10 * scale.max(1.0), "{place}: off by {off}");
    }
}

/// The numbers of a noun, in the order of the script.
fn numbers(payload: &Payload) -> Vec<f64> {
    match payload {
        Payload::Gnss(fix) => {
            let position = [fix.latitude_deg, fix.longitude_deg, fix.altitude_m];
            [&position[..], &fix.covariance_enu_m2.unwrap()].concat()
        }
        Payload::Imu(imu) => [
            &imu.orientation.unwrap()[..],
            &[imu.yaw_variance_rad2.unwrap()],
        ]
        .concat(),
        Payload::Pose(pose) => [&pose.position_m[..], &pose.orientation].concat(),
        Payload::Transforms { transforms, .. } => transforms
            .iter()
            .flat_map(|one| [&one.translation_m[..], &one.rotation].concat())
            .collect(),
        Payload::Calibration(camera) => {
            let size = [f64::from(camera.width_px), f64::from(camera.height_px)];
            [&size[..], &camera.d, &camera.k].concat()
        }
        Payload::Image(CameraFrame::Encoded(image)) => {
            let sum: u64 = image.data.iter().map(|byte| u64::from(*byte)).sum();
            vec![image.data.len() as f64, sum as f64]
        }
        Payload::Detections(frame) => {
            let axes = if frame.space == DetectionSpace::Metres {
                3
            } else {
                2
            };
            let points = frame
                .detections
                .iter()
                .flat_map(|detection| &detection.points);
            points.flat_map(|point| point[..axes].to_vec()).collect()
        }
        Payload::Odometry(_) | Payload::Vehicles(_) | Payload::Image(_) => Vec::new(),
    }
}

//! What a file is, by its content: a log, a map, a model or a store; what is in it, what is damaged in
//! it, and what mends that.
//!
//! Everything is read that a job would read, so that a file without findings here is one that a job
//! takes whole.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::Serialize;
use tilefold_formats::log::{ALL_TIME, IndexOrigin, LogIndex, LogReader, TopicKind};
use tilefold_formats::map::{self, MapFormat};
use tilefold_formats::model;
use tilefold_schemas::layer::ElementRow;
use tilefold_schemas::{
    ChangeRecord, ChunkRow, Element, EvidenceRow, Footprint, LayerHeader, SensorRow, SetAside,
    SetAsideKind, Sighting,
};
use tilefold_store::{Snapshot, Store, StoreError, StoredTable};

use crate::error::EngineError;

/// How much of a file is looked at to guess what it is.
const HEAD_BYTES: u64 = 64;

/// The first bytes of an MCAP file.
const MCAP: &[u8] = b"\x89MCAP0\r\n";

/// What a file is and holds.
#[derive(Debug, Clone, Serialize)]
pub struct Inspection {
    /// The file, folder or URL.
    pub file: String,
    /// What is in it.
    #[serde(flatten)]
    pub content: Content,
    /// What is damaged, or cannot be used.
    pub set_aside: Vec<SetAside>,
    /// What mends it.
    pub mend: Vec<String>,
}

/// The kinds of files there are.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Content {
    /// An MCAP file.
    Log(LogContent),
    /// A map.
    Map(MapContent),
    /// A store.
    Store(StoreContent),
    /// An ONNX file.
    Model(ModelContent),
}

/// What is in a log.
#[derive(Debug, Clone, Serialize)]
pub struct LogContent {
    /// Its size.
    pub bytes: u64,
    /// The vehicle, if the log names it.
    pub vehicle: Option<String>,
    /// Log time of the first message, nanoseconds since the Unix epoch.
    pub start_ns: i64,
    /// Log time of the last message, nanoseconds since the Unix epoch.
    pub end_ns: i64,
    /// Whether its summary could be used; without it the file was walked through.
    pub has_summary: bool,
    /// Its topics.
    pub topics: Vec<TopicContent>,
    /// Names of its metadata records.
    pub metadata: Vec<String>,
}

/// A topic of a log.
#[derive(Debug, Clone, Serialize)]
pub struct TopicContent {
    /// Its name.
    pub topic: String,
    /// Its schema.
    pub schema: String,
    /// Its encoding.
    pub encoding: String,
    /// What it is read as; `unknown` topics are not read.
    pub read_as: &'static str,
    /// Messages, as the index says.
    pub messages: u64,
    /// Messages that could be decoded.
    pub decoded: u64,
}

/// What is in a map.
#[derive(Debug, Clone, Serialize)]
pub struct MapContent {
    /// What it was written in.
    pub format: &'static str,
    /// What it says of itself.
    pub about: BTreeMap<String, String>,
    /// Elements by kind: what can be judged.
    pub elements: BTreeMap<&'static str, u64>,
    /// What is no paint, by its type in the map's words.
    pub not_paint: BTreeMap<String, u64>,
    /// Nodes, ways, relations, lanelets, areas and regulatory elements.
    pub counts: BTreeMap<&'static str, u64>,
    /// West, south, east and north end of the elements in degrees; none without elements.
    pub bounds_deg: Option<[f64; 4]>,
}

/// What is in a store.
#[derive(Debug, Clone, Serialize)]
pub struct StoreContent {
    /// Its latest version.
    pub version: i64,
    /// What made that version.
    pub operation: String,
    /// When, milliseconds since the Unix epoch.
    pub timestamp_ms: i64,
    /// Level of its tiles.
    pub tile_level: u8,
    /// Rows by table; none where a file of the table is damaged.
    pub tables: BTreeMap<&'static str, Option<i64>>,
}

/// What is in a model.
#[derive(Debug, Clone, Serialize)]
pub struct ModelContent {
    /// The program that wrote it.
    pub producer: String,
    /// Version of ONNX's own format.
    pub ir_version: i64,
    /// Versions of the operator sets; the empty domain is ONNX's own.
    pub opsets: BTreeMap<String, i64>,
    /// Inputs: name, and type and shape as in `float[1,3,360,640]`.
    pub inputs: BTreeMap<String, String>,
    /// Outputs, likewise.
    pub outputs: BTreeMap<String, String>,
    /// Operators.
    pub nodes: usize,
    /// Tensors of weights.
    pub weights: usize,
    /// Bytes of the weights in the file.
    pub weight_bytes: u64,
}

/// Looks into `path`.
///
/// # Errors
/// It is nothing that is known here, or damaged as a whole.
pub fn inspect(path: &Path) -> Result<Inspection, EngineError> {
    let is_url = path.to_str().is_some_and(|text| text.contains("://"));
    let (content, set_aside) = if is_url || path.join("tilefold.json").is_file() {
        store(path)?
    } else if path.is_dir() {
        map(path)?
    } else {
        let head = head(path)?;
        if head.starts_with(MCAP) || ends_in(path, "mcap") {
            log(path)?
        } else if model::looks_like_model(&head) || ends_in(path, "onnx") {
            described(path)?
        } else {
            map(path)?
        }
    };
    Ok(Inspection {
        file: path.display().to_string(),
        mend: mending(&content, &set_aside, path),
        content,
        set_aside,
    })
}

type Found = Result<(Content, Vec<SetAside>), EngineError>;

fn head(path: &Path) -> Result<Vec<u8>, EngineError> {
    let unread = |source| map::MapError::Io {
        file: path.display().to_string(),
        source,
    };
    let mut head = Vec::new();
    let file = File::open(path).map_err(unread)?;
    file.take(HEAD_BYTES)
        .read_to_end(&mut head)
        .map_err(unread)?;
    Ok(head)
}

/// What is damaged in its first bytes is told by its name.
fn ends_in(path: &Path, ending: &str) -> bool {
    path.extension()
        .is_some_and(|found| found.eq_ignore_ascii_case(ending))
}

fn log(path: &Path) -> Found {
    let index = LogIndex::open(path)?;
    let mut decoded = vec![0; index.topics.len()];
    let all = |_: usize, topic: &tilefold_formats::log::Topic| topic.kind != TopicKind::Unknown;
    let read = LogReader::new().read(&index, all, ALL_TIME, |message| {
        if let Some(count) = decoded.get_mut(message.topic) {
            *count += 1;
        }
    })?;
    let topics = index
        .topics
        .iter()
        .zip(decoded)
        .map(|(topic, decoded)| TopicContent {
            topic: topic.name.clone(),
            schema: topic.schema_name.clone(),
            encoding: topic.encoding.clone(),
            read_as: read_as(topic.kind),
            messages: topic.messages,
            decoded,
        });
    let content = LogContent {
        bytes: index.size_bytes,
        vehicle: index.vehicle.clone(),
        start_ns: index.start_ns,
        end_ns: index.end_ns,
        has_summary: index.origin == IndexOrigin::Summary,
        topics: topics.collect(),
        metadata: index
            .metadata
            .iter()
            .map(|record| record.name.clone())
            .collect(),
    };
    let set_aside = [index.set_aside, read.set_aside].concat();
    Ok((Content::Log(content), set_aside))
}

fn read_as(kind: TopicKind) -> &'static str {
    match kind {
        TopicKind::Gnss => "gnss",
        TopicKind::Imu => "imu",
        TopicKind::Odometry => "odometry",
        TopicKind::Pose => "pose",
        TopicKind::Transforms => "transforms",
        TopicKind::Calibration => "calibration",
        TopicKind::Image => "image",
        TopicKind::Detections(_) => "detections",
        TopicKind::Unknown => "unknown",
    }
}

fn map(path: &Path) -> Found {
    let map = map::read(path)?;
    let mut elements = BTreeMap::new();
    for element in &map.elements {
        *elements.entry(element.kind.name()).or_default() += 1;
    }
    let counts = &map.counts;
    let content = MapContent {
        format: match map.format {
            MapFormat::Lanelet2 => "lanelet2",
            MapFormat::OpenDrive => "opendrive",
            MapFormat::Argoverse2 => "argoverse2",
        },
        about: map.about,
        elements,
        not_paint: map.not_paint,
        counts: BTreeMap::from([
            ("nodes", counts.nodes),
            ("ways", counts.ways),
            ("relations", counts.relations),
            ("lanelets", counts.lanelets),
            ("areas", counts.areas),
            ("regulatory_elements", counts.regulatory_elements),
            ("deleted", counts.deleted),
        ]),
        bounds_deg: bounds_deg(&map.elements),
    };
    Ok((Content::Map(content), map.set_aside))
}

fn bounds_deg(elements: &[Element]) -> Option<[f64; 4]> {
    let points = || elements.iter().flat_map(|element| &element.points);
    let end = |axis: usize, of: fn(f64, f64) -> f64| points().map(|p| p[axis]).reduce(of);
    Some([
        end(0, f64::min)?,
        end(1, f64::min)?,
        end(0, f64::max)?,
        end(1, f64::max)?,
    ])
}

fn store(path: &Path) -> Found {
    let store = Store::open(path)?;
    let snapshot = store.snapshot(None)?;
    let mut tables = BTreeMap::new();
    let mut set_aside = Vec::new();
    let mut look = |(name, found): (&'static str, Result<i64, StoreError>)| {
        let rows = found.map_err(|error| {
            let file = path.display().to_string();
            set_aside.push(SetAside::new(SetAsideKind::File, file, error.to_string()));
        });
        tables.insert(name, rows.ok());
    };
    look(table::<ElementRow>(&snapshot));
    look(table::<EvidenceRow>(&snapshot));
    look(table::<Sighting>(&snapshot));
    look(table::<Footprint>(&snapshot));
    look(table::<ChunkRow>(&snapshot));
    look(table::<SensorRow>(&snapshot));
    look(table::<ChangeRecord>(&snapshot));
    look(table::<LayerHeader>(&snapshot));
    let info = snapshot.info();
    let content = StoreContent {
        version: info.version,
        operation: info.operation.clone(),
        timestamp_ms: info.timestamp_ms,
        tile_level: store.properties().tile_level,
        tables,
    };
    Ok((Content::Store(content), set_aside))
}

/// The rows of a table, all of whose files were held against their hashes.
fn table<R: StoredTable>(snapshot: &Snapshot) -> (&'static str, Result<i64, StoreError>) {
    let rows = snapshot
        .digest::<R>()
        .and_then(|_| snapshot.row_count::<R>());
    (R::NAME, rows)
}

fn described(path: &Path) -> Found {
    let model = model::read(path)?;
    let named = |tensors: &[model::Tensor]| {
        let pairs = tensors.iter().map(|tensor| {
            let shape = tensor.shape.join(",");
            let text = format!("{}[{shape}]", element_type(tensor.element_type));
            (tensor.name.clone(), text)
        });
        pairs.collect()
    };
    let mut set_aside = Vec::new();
    if model.has_outside_weights {
        let reason = "its weights lie in other files; models of one file are read";
        let file = path.display().to_string();
        set_aside.push(SetAside::new(SetAsideKind::File, file, reason));
    }
    let content = ModelContent {
        producer: model.producer,
        ir_version: model.ir_version,
        opsets: model.opsets.into_iter().collect(),
        inputs: named(&model.inputs),
        outputs: named(&model.outputs),
        nodes: model.nodes,
        weights: model.weights.0,
        weight_bytes: model.weights.1,
    };
    Ok((Content::Model(content), set_aside))
}

/// ONNX's numbers of the types that images and weights have.
fn element_type(number: i32) -> String {
    let name = match number {
        1 => "float",
        2 => "uint8",
        3 => "int8",
        6 => "int32",
        7 => "int64",
        9 => "bool",
        10 => "float16",
        11 => "double",
        16 => "bfloat16",
        other => return format!("type {other}"),
    };
    name.to_owned()
}

fn mending(content: &Content, set_aside: &[SetAside], path: &Path) -> Vec<String> {
    let mut mend = Vec::new();
    let name = path.display();
    let has = |kind| set_aside.iter().any(|loss| loss.kind == kind);
    match content {
        Content::Log(log) => {
            if has(SetAsideKind::LogSection) || !log.has_summary {
                mend.push(format!(
                    "`mcap recover {name} -o mended.mcap` writes what can be read into a whole \
                     file; or copy the log from the vehicle again"
                ));
            }
            if has(SetAsideKind::Message) || has(SetAsideKind::Pose) {
                mend.push("see to the program that wrote the messages named above".to_owned());
            }
            let is_there = |kind: &str| {
                log.topics
                    .iter()
                    .any(|t| t.read_as == kind && t.decoded > 0)
            };
            if !is_there("gnss") {
                mend.push("`run` needs positions: record NavSatFix or LocationFix too".to_owned());
            }
            if !is_there("detections") {
                mend.push(
                    "`run` needs detections: record SceneUpdate or ImageAnnotations too".to_owned(),
                );
            }
        }
        Content::Map(map) => {
            if has(SetAsideKind::Element) {
                mend.push(
                    "mend the elements at the lines named above, or leave them out".to_owned(),
                );
            }
            if map.elements.is_empty() {
                mend.push("there is no paint to judge: give `init` a map with markings".to_owned());
            }
        }
        Content::Store(_) if !set_aside.is_empty() => mend.push(format!(
            "restore the file from a copy; `tilefold log {name}` lists older versions, which may \
             not have it"
        )),
        Content::Model(_) if !set_aside.is_empty() => {
            mend.push("export the model as one file".to_owned());
        }
        Content::Store(_) | Content::Model(_) => {}
    }
    mend
}

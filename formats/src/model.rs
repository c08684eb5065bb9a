//! What an ONNX file says of itself: who made it, what goes in and what comes out.
//!
//! Only the frame of the protobuf is read: weights are counted and not kept, and nothing is run.

use std::fs;
use std::path::Path;

use prost::Message;

/// Protobuf has no larger messages.
const MAX_BYTES: u64 = 2 * 1024 * 1024 * 1024;

/// A model as its file describes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModelFile {
    /// Version of ONNX's own format.
    pub ir_version: i64,
    /// The program that wrote it; may be empty.
    pub producer: String,
    /// Versions of the operator sets by domain; the empty domain is ONNX's own.
    pub opsets: Vec<(String, i64)>,
    /// What goes in, without weights.
    pub inputs: Vec<Tensor>,
    /// What comes out.
    pub outputs: Vec<Tensor>,
    /// Operators.
    pub nodes: usize,
    /// Weights by count of tensors and bytes within the file.
    pub weights: (usize, u64),
    /// Whether weights lie in other files, which are not read here.
    pub has_outside_weights: bool,
}

/// An input or an output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tensor {
    /// Its name.
    pub name: String,
    /// Its type as ONNX numbers them (1 is float, 10 half, 2 to 9 integers and others).
    pub element_type: i32,
    /// Its shape; what is not fixed by its name, or `?`.
    pub shape: Vec<String>,
}

/// Why a file is no model.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The disk said no.
    #[error("cannot read model {file}: {source}; check the path and its rights")]
    Io {
        /// The file.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is none.
    #[error("{file} is no ONNX model: {reason}; export it again, as one file")]
    Damaged {
        /// The file.
        file: String,
        /// What is wrong.
        reason: String,
    },
}

/// Whether bytes may be the beginning of a model: protobuf with a small `ir_version` first.
#[must_use]
pub fn looks_like_model(head: &[u8]) -> bool {
    matches!(head, [0x08, 1..=127, rest, ..] if rest & 7 == 2 || *rest == 0x28)
}

/// Reads the file.
///
/// # Errors
/// It cannot be read, is too large, is cut, or is no model.
pub fn read(path: &Path) -> Result<ModelFile, ModelError> {
    let file = path.display().to_string();
    let io = |source| ModelError::Io {
        file: file.clone(),
        source,
    };
    let damaged = |reason: String| ModelError::Damaged {
        file: file.clone(),
        reason,
    };
    let bytes = fs::metadata(path).map_err(io)?.len();
    if bytes > MAX_BYTES {
        return Err(damaged(format!(
            "it has {bytes} bytes, protobuf has at most {MAX_BYTES}"
        )));
    }
    let bytes = fs::read(path).map_err(io)?;
    let model = wire::Model::decode(bytes.as_slice()).map_err(|e| damaged(e.to_string()))?;
    let graph = model
        .graph
        .ok_or_else(|| damaged("it has no graph".to_owned()))?;
    let weights: Vec<&str> = graph
        .weights
        .iter()
        .map(|weight| weight.name.as_str())
        .collect();
    let is_input = |value: &&wire::Value| !weights.contains(&value.name.as_str());
    Ok(ModelFile {
        ir_version: model.ir_version,
        producer: format!("{} {}", model.producer, model.producer_version)
            .trim()
            .to_owned(),
        opsets: model
            .opsets
            .into_iter()
            .map(|opset| (opset.domain, opset.version))
            .collect(),
        inputs: graph.inputs.iter().filter(is_input).map(tensor).collect(),
        outputs: graph.outputs.iter().map(tensor).collect(),
        nodes: graph.nodes.len(),
        weights: (
            graph.weights.len(),
            graph.weights.iter().map(wire::Weight::bytes).sum(),
        ),
        has_outside_weights: graph.weights.iter().any(|weight| weight.location == 1),
    })
}

fn tensor(value: &wire::Value) -> Tensor {
    let tensor = value.of.as_ref().and_then(|of| of.tensor.as_ref());
    let shape = tensor.and_then(|tensor| tensor.shape.as_ref());
    let size = |dimension: &wire::Dimension| match (dimension.size, &dimension.name) {
        (Some(size), _) => size.to_string(),
        (None, Some(name)) if !name.is_empty() => name.clone(),
        _ => "?".to_owned(),
    };
    Tensor {
        name: value.name.clone(),
        element_type: tensor.map_or(0, |tensor| tensor.element_type),
        shape: shape.map_or(Vec::new(), |shape| {
            shape.dimensions.iter().map(size).collect()
        }),
    }
}

/// The part of ONNX's messages that is looked at; all other fields are skipped.
mod wire {
    use bytes::Bytes;

    #[derive(prost::Message)]
    pub(super) struct Model {
        #[prost(int64, tag = "1")]
        pub(super) ir_version: i64,
        #[prost(string, tag = "2")]
        pub(super) producer: String,
        #[prost(string, tag = "3")]
        pub(super) producer_version: String,
        #[prost(message, optional, tag = "7")]
        pub(super) graph: Option<Graph>,
        #[prost(message, repeated, tag = "8")]
        pub(super) opsets: Vec<Opset>,
    }

    #[derive(prost::Message)]
    pub(super) struct Opset {
        #[prost(string, tag = "1")]
        pub(super) domain: String,
        #[prost(int64, tag = "2")]
        pub(super) version: i64,
    }

    #[derive(prost::Message)]
    pub(super) struct Graph {
        #[prost(message, repeated, tag = "1")]
        pub(super) nodes: Vec<Node>,
        #[prost(message, repeated, tag = "5")]
        pub(super) weights: Vec<Weight>,
        #[prost(message, repeated, tag = "11")]
        pub(super) inputs: Vec<Value>,
        #[prost(message, repeated, tag = "12")]
        pub(super) outputs: Vec<Value>,
    }

    #[derive(prost::Message)]
    pub(super) struct Node {}

    #[derive(prost::Message)]
    pub(super) struct Weight {
        #[prost(float, repeated, tag = "4")]
        pub(super) floats: Vec<f32>,
        #[prost(string, tag = "8")]
        pub(super) name: String,
        #[prost(bytes = "bytes", tag = "9")]
        pub(super) raw: Bytes,
        #[prost(int32, tag = "14")]
        pub(super) location: i32,
    }

    impl Weight {
        pub(super) fn bytes(&self) -> u64 {
            self.raw.len() as u64 + 4 * self.floats.len() as u64
        }
    }

    #[derive(prost::Message)]
    pub(super) struct Value {
        #[prost(string, tag = "1")]
        pub(super) name: String,
        #[prost(message, optional, tag = "2")]
        pub(super) of: Option<Type>,
    }

    #[derive(prost::Message)]
    pub(super) struct Type {
        #[prost(message, optional, tag = "1")]
        pub(super) tensor: Option<TensorType>,
    }

    #[derive(prost::Message)]
    pub(super) struct TensorType {
        #[prost(int32, tag = "1")]
        pub(super) element_type: i32,
        #[prost(message, optional, tag = "2")]
        pub(super) shape: Option<Shape>,
    }

    #[derive(prost::Message)]
    pub(super) struct Shape {
        #[prost(message, repeated, tag = "1")]
        pub(super) dimensions: Vec<Dimension>,
    }

    #[derive(prost::Message)]
    pub(super) struct Dimension {
        #[prost(int64, optional, tag = "1")]
        pub(super) size: Option<i64>,
        #[prost(string, optional, tag = "2")]
        pub(super) name: Option<String>,
    }
}
